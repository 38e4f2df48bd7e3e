# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What a goal asks for: its fields, its checks without a robot, its adaptation to the dialect."""
