# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Offsets of a path that come while the arm moves, however the robot gets them."""
