# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Joints and tool of the simulated arm: IK branches, rates, limits, motion of a point."""
