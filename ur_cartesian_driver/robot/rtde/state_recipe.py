# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What the driver reads from RTDE, as a :class:`~ur_cartesian_driver.motion.state.RobotState`.

Unknown numbers of modes (newer software) become the most careful one that there is.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import isfinite
from typing import Any

from ur_cartesian_driver.motion.errors import RemoteProtocolError
from ur_cartesian_driver.motion.pose import IDENTITY, Pose, Vector6
from ur_cartesian_driver.motion.state import (
    RobotMode,
    RobotState,
    RobotStatus,
    RuntimeState,
    SafetyMode,
    SafetyStatus,
)
from ur_cartesian_driver.protocol.program import registers
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeValues

POINTS_BEGUN = registers.register_name(registers.OutputInteger.POINTS_BEGUN)

REQUIRED_FIELDS = (
    'timestamp',
    'actual_q',
    'actual_qd',
    'target_q',
    'target_qd',
    'actual_TCP_pose',
    'actual_TCP_speed',
    'target_TCP_pose',
    'target_TCP_speed',
    'actual_TCP_force',
    'speed_scaling',
    'target_speed_fraction',
    'robot_mode',
    'safety_mode',
    'runtime_state',
    'robot_status_bits',
    'safety_status_bits',
)
#: Old software does not have these.
OPTIONAL_FIELDS = (
    'tcp_offset',
    'actual_TCP_acceleration',
    'target_TCP_acceleration',
    'actual_current_as_torque',
    POINTS_BEGUN,
)
#: The order in which they are asked for.
STATE_FIELDS = (*REQUIRED_FIELDS, *OPTIONAL_FIELDS)

_ROBOT_MODES = {mode.value: mode for mode in RobotMode}
_SAFETY_MODES = {mode.value: mode for mode in SafetyMode}
_RUNTIME_STATES = {state.value: state for state in RuntimeState}


#: What has to be finite: vectors, and single numbers.
_VECTORS = slice(1, 9)
_NUMBERS = ('timestamp', 'speed_scaling', 'target_speed_fraction')


def in_recipe_order(names: Sequence[str], values: RtdeValues) -> RtdeValues | tuple[Any, ...]:
    """Return values as :data:`STATE_FIELDS` has them, None for what the robot does not know."""
    if names == STATE_FIELDS:
        return values
    found = dict(zip(names, values, strict=True))
    return tuple(found.get(name) for name in STATE_FIELDS)


def robot_state_from_rtde(values: tuple[Any, ...]) -> RobotState:
    """
    Return the snapshot of one data package, whose values are in the order of :data:`STATE_FIELDS`.

    :raises RemoteProtocolError: a number is not finite: no comparison with it would ever be true,
        so whoever watches the motion would see nothing.
    """
    (
        timestamp,
        actual_q,
        actual_qd,
        target_q,
        target_qd,
        actual_pose,
        actual_twist,
        target_pose,
        target_twist,
        wrench,
        speed_scaling,
        speed_fraction,
        robot_mode,
        safety_mode,
        runtime_state,
        robot_bits,
        safety_bits,
        offset,
        actual_acceleration,
        target_acceleration,
        torque,
        points_begun,
    ) = values
    if not isfinite(
        sum(map(sum, values[_VECTORS]))
        + timestamp
        + speed_scaling
        + speed_fraction
        + sum(offset or ())
    ):
        raise RemoteProtocolError(_not_finite(values))
    modes = _modes(robot_mode, safety_mode, runtime_state, robot_bits, safety_bits)
    return RobotState(
        timestamp=timestamp,
        actual_q=actual_q,
        actual_qd=actual_qd,
        target_q=target_q,
        target_qd=target_qd,
        actual_tcp_pose=Pose.from_rotation_vector(actual_pose),
        actual_tcp_twist=actual_twist,
        target_tcp_pose=Pose.from_rotation_vector(target_pose),
        target_tcp_twist=target_twist,
        actual_tcp_acceleration=actual_acceleration,
        target_tcp_acceleration=target_acceleration,
        joint_torque=torque,
        actual_tcp_wrench=wrench,
        T_flange_tcp=_tcp(offset),
        speed_scaling=speed_scaling,
        target_speed_fraction=speed_fraction,
        robot_mode=modes[0],
        safety_mode=modes[1],
        runtime_state=modes[2],
        robot_status=modes[3],
        safety_status=modes[4],
        points_begun=points_begun or 0,
    )


@lru_cache(maxsize=16)
def _tcp(offset: Vector6 | None) -> Pose:
    return IDENTITY if offset is None else Pose.from_rotation_vector(offset)


@lru_cache(maxsize=64)
def _modes(
    robot_mode: int, safety_mode: int, runtime_state: int, robot_bits: int, safety_bits: int
) -> tuple[RobotMode, SafetyMode, RuntimeState, RobotStatus, SafetyStatus]:
    """Return numbers as what they mean; they are the same ones in most packets."""
    return (
        _ROBOT_MODES.get(robot_mode, RobotMode.NO_CONTROLLER),
        _SAFETY_MODES.get(safety_mode, SafetyMode.UNDEFINED_SAFETY_MODE),
        _RUNTIME_STATES.get(runtime_state, RuntimeState.STOPPED),
        RobotStatus(robot_bits & 0xF),
        SafetyStatus(safety_bits & 0xFFF),
    )


def _not_finite(values: tuple[Any, ...]) -> str:
    names = [
        name
        for name, value in zip(STATE_FIELDS, values, strict=True)
        if name in (*STATE_FIELDS[_VECTORS], *_NUMBERS, 'tcp_offset')
        and not isfinite(sum(value) if isinstance(value, tuple) else value or 0.0)
    ]
    return f'The robot reports numbers that are not finite: {", ".join(names)}.'
