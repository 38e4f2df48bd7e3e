# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The names that are not served, each with the reason."""

from __future__ import annotations

from ur_cartesian_driver.ros.ur_driver_names.offered_name import Absent

_FORCE = 'forces act along a path here: `presses` of a goal'

#: Kind, name, type, reason.
_ROWS = (
    ('service', 'force_mode_controller/start_force_mode', 'ur_msgs/srv/SetForceMode', _FORCE),
    ('service', 'force_mode_controller/stop_force_mode', 'std_srvs/srv/Trigger', _FORCE),
    (
        'service',
        'friction_model_controller/set_friction_model_parameters',
        'ur_msgs/srv/SetFrictionModelParameters',
        'the driver has no torque control',
    ),
    (
        'service',
        'controller_manager/*',
        'controller_manager_msgs/srv/*',
        'nothing of ros2_control runs: there are no controllers to switch, all names are served '
        'at all times',
    ),
    (
        'topic',
        '*/commands',
        'std_msgs/msg/Float64MultiArray',
        'the forward controllers of positions, velocities and efforts stream joint commands; here '
        'a path is checked as a whole, and live targets are poses',
    ),
    (
        'topic',
        '*_trajectory_controller/joint_trajectory',
        'trajectory_msgs/msg/JointTrajectory',
        'a trajectory without an action has no result: send it to `follow_joint_trajectory`',
    ),
    (
        'topic',
        '*_trajectory_controller/controller_state',
        'control_msgs/msg/JointTrajectoryControllerState',
        'between goals the driver has no desired state; the feedback of a goal has it',
    ),
    (
        'service',
        '*_trajectory_controller/query_state',
        'control_msgs/srv/QueryTrajectoryState',
        'between goals the driver has no desired state',
    ),
)

ABSENT = tuple(
    Absent(kind=kind, name=name, type=type_name, reason=reason)
    for kind, name, type_name, reason in _ROWS
)
