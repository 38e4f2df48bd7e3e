# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Signals from clients while the arm moves: path offsets, the feed override, and their age."""
