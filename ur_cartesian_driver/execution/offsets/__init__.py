# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Offsets that displace a path while the arm moves, and the age of values from clients."""
