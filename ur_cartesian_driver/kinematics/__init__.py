# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Between poses and joint positions: the robots, their forward and their inverse kinematics."""
