# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""SPLINE and SERVO goals: from points to a tool spline, a joint path and joint polynomials."""
