# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Paths with rounded corners, and their time law; see doc/rounded_corners.md."""
