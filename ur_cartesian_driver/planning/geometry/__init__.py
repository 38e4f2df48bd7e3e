# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Curves, blends, splines, samples and speed profiles: geometry without goals."""
