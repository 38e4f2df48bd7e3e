# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The table of names: everything that users of the UR ROS 2 driver call, and its counterpart here.

The node is built from this table, and the page ``doc/coming_from/ur_driver.md`` is made from it.
"""

from __future__ import annotations

from ur_cartesian_driver.ros.ur_driver_names.absent_names import ABSENT
from ur_cartesian_driver.ros.ur_driver_names.command_topics import COMMAND_TOPICS
from ur_cartesian_driver.ros.ur_driver_names.dashboard_services import DASHBOARD_SERVICES
from ur_cartesian_driver.ros.ur_driver_names.io_services import IO_SERVICES
from ur_cartesian_driver.ros.ur_driver_names.mode_action import MODE_ACTION
from ur_cartesian_driver.ros.ur_driver_names.offered_name import UrName
from ur_cartesian_driver.ros.ur_driver_names.program_services import PROGRAM_SERVICES
from ur_cartesian_driver.ros.ur_driver_names.sequence_action import SEQUENCE_ACTION
from ur_cartesian_driver.ros.ur_driver_names.state_topics import STATE_TOPICS
from ur_cartesian_driver.ros.ur_driver_names.tool_contact_action import TOOL_CONTACT_ACTION
from ur_cartesian_driver.ros.ur_driver_names.trajectory_actions import TRAJECTORY_ACTIONS

NAMES: tuple[UrName, ...] = (
    *STATE_TOPICS,
    *COMMAND_TOPICS,
    *DASHBOARD_SERVICES,
    *PROGRAM_SERVICES,
    *IO_SERVICES,
    *TRAJECTORY_ACTIONS,
    SEQUENCE_ACTION,
    TOOL_CONTACT_ACTION,
    MODE_ACTION,
    *ABSENT,
)
