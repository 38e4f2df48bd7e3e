# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The names of the UR ROS 2 driver, served by a node of their own.

Each topic, service and action is a row of :data:`name_table.NAMES`. The node offers them by
calling the driver's node over ROS, so the driver knows nothing of them.
"""
