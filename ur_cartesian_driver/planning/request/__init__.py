# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The demands of a goal: its fields, its checks without a robot, and features of programs."""
