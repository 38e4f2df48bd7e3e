# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The connections to the robot: the only sockets of the driver, and their supervision."""
