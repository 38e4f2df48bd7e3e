# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What the driver reads from RTDE, as a :class:`~ur_cartesian_driver.motion.state.RobotState`.

Unknown numbers of modes (newer software) become the most careful one that there is.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import isfinite
from typing import Any

from ur_cartesian_driver.motion.errors import RemoteProtocolError
from ur_cartesian_driver.motion.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.state import (
    RobotMode,
    RobotState,
    RobotStatus,
    RuntimeState,
    SafetyMode,
    SafetyStatus,
)
from ur_cartesian_driver.protocol import registers

POINTS_BEGUN = registers.field(registers.OutputInteger.POINTS_BEGUN)

REQUIRED = (
    'timestamp', 'actual_q', 'actual_qd', 'target_q', 'target_qd', 'actual_TCP_pose',
    'actual_TCP_speed', 'target_TCP_pose', 'target_TCP_speed', 'actual_TCP_force',
    'speed_scaling', 'target_speed_fraction', 'robot_mode', 'safety_mode', 'runtime_state',
    'robot_status_bits', 'safety_status_bits')
#: Old software does not have these.
OPTIONAL = ('tcp_offset', 'actual_TCP_acceleration', 'target_TCP_acceleration',
            'actual_current_as_torque', POINTS_BEGUN)

_ROBOT_MODES = {mode.value: mode for mode in RobotMode}
_SAFETY_MODES = {mode.value: mode for mode in SafetyMode}
_RUNTIME_STATES = {state.value: state for state in RuntimeState}


_VECTORS = REQUIRED[1:9]
_NUMBERS = ('timestamp', 'speed_scaling', 'target_speed_fraction')


def robot_state(values: Mapping[str, Any]) -> RobotState:
    """
    Return the snapshot of one data package, given by the names above.

    :raises RemoteProtocolError: a number is not finite: no comparison with it would ever be true,
        so whoever watches the motion would see nothing.
    """
    offset = values.get('tcp_offset')
    if not isfinite(sum(map(sum, (values[name] for name in _VECTORS)))
                    + sum(values[name] for name in _NUMBERS) + sum(offset or ())):
        raise RemoteProtocolError(_not_finite(values))
    return RobotState(
        timestamp=values['timestamp'],
        actual_q=values['actual_q'],
        actual_qd=values['actual_qd'],
        target_q=values['target_q'],
        target_qd=values['target_qd'],
        actual_tcp_pose=Pose.from_rotation_vector(values['actual_TCP_pose']),
        actual_tcp_twist=values['actual_TCP_speed'],
        target_tcp_pose=Pose.from_rotation_vector(values['target_TCP_pose']),
        target_tcp_twist=values['target_TCP_speed'],
        actual_tcp_acceleration=values.get('actual_TCP_acceleration'),
        target_tcp_acceleration=values.get('target_TCP_acceleration'),
        joint_torque=values.get('actual_current_as_torque'),
        actual_tcp_wrench=values['actual_TCP_force'],
        T_flange_tcp=IDENTITY if offset is None else Pose.from_rotation_vector(offset),
        speed_scaling=values['speed_scaling'],
        target_speed_fraction=values['target_speed_fraction'],
        robot_mode=_ROBOT_MODES.get(values['robot_mode'], RobotMode.NO_CONTROLLER),
        safety_mode=_SAFETY_MODES.get(values['safety_mode'], SafetyMode.UNDEFINED_SAFETY_MODE),
        runtime_state=_RUNTIME_STATES.get(values['runtime_state'], RuntimeState.STOPPED),
        robot_status=RobotStatus(values['robot_status_bits'] & 0xF),
        safety_status=SafetyStatus(values['safety_status_bits'] & 0xFFF),
        points_begun=values.get(POINTS_BEGUN) or 0)


def _not_finite(values: Mapping[str, Any]) -> str:
    names = [name for name in (*_VECTORS, *_NUMBERS, 'tcp_offset') if not isfinite(
        sum(value) if isinstance(value := values.get(name) or 0.0, tuple) else value)]
    return f"The robot reports numbers that are not finite: {', '.join(names)}."
