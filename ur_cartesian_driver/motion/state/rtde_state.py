# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The table of the values that the robot reports by RTDE, and the robot's modes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from enum import IntEnum, IntFlag
from math import inf
from types import NoneType
from typing import Annotated, Any, get_args, get_type_hints

from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector6, ZERO6


class RobotMode(IntEnum):
    """State of the arm's power, as the controller numbers it."""

    NO_CONTROLLER = -1
    DISCONNECTED = 0
    CONFIRM_SAFETY = 1
    BOOTING = 2
    POWER_OFF = 3
    POWER_ON = 4
    IDLE = 5
    BACKDRIVE = 6
    RUNNING = 7
    UPDATING_FIRMWARE = 8


class SafetyMode(IntEnum):
    """State of the safety system, as the controller numbers it."""

    NORMAL = 1
    REDUCED = 2
    PROTECTIVE_STOP = 3
    RECOVERY = 4
    SAFEGUARD_STOP = 5
    SYSTEM_EMERGENCY_STOP = 6
    ROBOT_EMERGENCY_STOP = 7
    VIOLATION = 8
    FAULT = 9
    VALIDATE_JOINT_ID = 10
    UNDEFINED_SAFETY_MODE = 11
    AUTOMATIC_MODE_SAFEGUARD_STOP = 12
    SYSTEM_THREE_POSITION_ENABLING_STOP = 13
    TP_THREE_POSITION_ENABLING_STOP = 14
    IMMI_EMERGENCY_STOP = 15
    IMMI_SAFEGUARD_STOP = 16
    PROFISAFE_WAITING_FOR_PARAMETERS = 17
    PROFISAFE_AUTOMATIC_MODE_SAFEGUARD_STOP = 18
    PROFISAFE_SAFEGUARD_STOP = 19
    PROFISAFE_EMERGENCY_STOP = 20
    SAFETY_API_SAFEGUARD_STOP = 22


#: The modes in which the safety system lets the arm move.
MOVABLE_SAFETY_MODES = (SafetyMode.NORMAL, SafetyMode.REDUCED)


class RuntimeState(IntEnum):
    """State of the robot program, as the controller numbers it."""

    STOPPING = 0
    STOPPED = 1
    PLAYING = 2
    PAUSING = 3
    PAUSED = 4
    RESUMING = 5


class RobotStatus(IntFlag):
    """Bits of RTDE's ``robot_status_bits``."""

    POWER_ON = 1 << 0
    PROGRAM_RUNNING = 1 << 1
    TEACH_BUTTON_PRESSED = 1 << 2
    POWER_BUTTON_PRESSED = 1 << 3


class SafetyStatus(IntFlag):
    """Bits of RTDE's ``safety_status_bits``."""

    NORMAL_MODE = 1 << 0
    REDUCED_MODE = 1 << 1
    PROTECTIVE_STOPPED = 1 << 2
    RECOVERY_MODE = 1 << 3
    SAFEGUARD_STOPPED = 1 << 4
    SYSTEM_EMERGENCY_STOPPED = 1 << 5
    ROBOT_EMERGENCY_STOPPED = 1 << 6
    EMERGENCY_STOPPED = 1 << 7
    VIOLATION = 1 << 8
    FAULT = 1 << 9
    STOPPED_DUE_TO_SAFETY = 1 << 10
    THREE_POSITION_ENABLING_STOP = 1 << 11


@dataclass(frozen=True, slots=True)
class Rtde:
    """The RTDE output that a field of :class:`RobotState` holds."""

    name: str
    #: Whether older software lacks the output; the field then has its default.
    optional: bool = False
    #: Whether the monitoring of goals uses the output; then a packet in which it is not finite is
    #: refused.
    monitored: bool = True


# A complete state is never changed. The class is still not frozen, because a frozen object takes
# four times as long to create, and one is created for each packet, before the driver reacts to it.
@dataclass(slots=True)
class RobotState:
    """
    One RTDE packet: joints in rad and rad/s, poses of the TCP in the robot's base.

    Twists are the linear [m/s] and angular [rad/s] velocity of the TCP in base axes.

    This is the only table of these fields: the RTDE recipe, the shared memory and the ``~/status``
    message follow from names, types and :class:`Rtde`. Optional outputs come after the others,
    and the fields that the driver computes come last. A field of DriverStatus.msg reports the
    field of the same name, except that ``speed_scaling`` there is ``effective_speed``. The
    simulator computes RTDE outputs, also new ones, in ``sim/rtde_output_values.py``.
    """

    #: Time by the controller's clock [s].
    timestamp: Annotated[float, Rtde('timestamp')]
    actual_q: Annotated[Vector6, Rtde('actual_q')]
    actual_qd: Annotated[Vector6, Rtde('actual_qd')] = ZERO6
    target_q: Annotated[Vector6, Rtde('target_q')] = ZERO6
    target_qd: Annotated[Vector6, Rtde('target_qd')] = ZERO6
    actual_tcp_pose: Annotated[Pose, Rtde('actual_TCP_pose')] = IDENTITY
    actual_tcp_twist: Annotated[Vector6, Rtde('actual_TCP_speed')] = ZERO6
    target_tcp_pose: Annotated[Pose, Rtde('target_TCP_pose')] = IDENTITY
    target_tcp_twist: Annotated[Vector6, Rtde('target_TCP_speed')] = ZERO6
    #: Force [N] and torque [Nm] at the TCP in base axes.
    actual_tcp_wrench: Annotated[Vector6, Rtde('actual_TCP_force', monitored=False)] = ZERO6
    #: The slowdown in addition to the speed slider: 1 = none, 0 = at rest
    #: (:mod:`~.effective_speed`).
    speed_scaling: Annotated[float, Rtde('speed_scaling')] = 1.0
    #: The speed slider, 0 to 1.
    target_speed_fraction: Annotated[float, Rtde('target_speed_fraction')] = 1.0
    robot_mode: Annotated[RobotMode, Rtde('robot_mode')] = RobotMode.RUNNING
    safety_mode: Annotated[SafetyMode, Rtde('safety_mode')] = SafetyMode.NORMAL
    runtime_state: Annotated[RuntimeState, Rtde('runtime_state')] = RuntimeState.STOPPED
    robot_status: Annotated[RobotStatus, Rtde('robot_status_bits')] = RobotStatus.POWER_ON
    safety_status: Annotated[SafetyStatus, Rtde('safety_status_bits')] = SafetyStatus.NORMAL_MODE
    #: The active TCP in the flange frame.
    T_flange_tcp: Annotated[Pose, Rtde('tcp_offset', optional=True)] = IDENTITY
    #: Linear [m/s^2] and angular [rad/s^2] acceleration of the TCP in base axes; None = not
    #: reported.
    actual_tcp_acceleration: Annotated[
        Vector6 | None, Rtde('actual_TCP_acceleration', optional=True, monitored=False)
    ] = None
    target_tcp_acceleration: Annotated[
        Vector6 | None, Rtde('target_TCP_acceleration', optional=True, monitored=False)
    ] = None
    #: Torque of each joint [Nm], derived from its current; None = not reported.
    joint_torque: Annotated[
        Vector6 | None, Rtde('actual_current_as_torque', optional=True, monitored=False)
    ] = None
    #: Number of points of the running trajectory that the program has begun; 0 also if unknown.
    points_begun: Annotated[int, Rtde('output_int_register_26', optional=True)] = 0
    #: Version of our robot program.
    program_version: Annotated[int, Rtde('output_int_register_32', optional=True)] = 0
    #: Random number that identifies our robot program.
    program_number: Annotated[int, Rtde('output_int_register_33', optional=True)] = 0
    #: Count of the connections of our robot program; it changes with each connection.
    program_run: Annotated[int, Rtde('output_int_register_34', optional=True)] = 0
    #: Token of the last request to set safe outputs that our robot program has carried out.
    safe_outputs_token: Annotated[int, Rtde('output_int_register_35', optional=True)] = 0
    #: Version of the controller's own planning of movej and movel (motion version), as it was when
    #: our robot program connected; 0 = unknown.
    motion_version: Annotated[int, Rtde('output_int_register_36', optional=True)] = 0
    #: Counts of the pulses that our robot program has given, packed into one number: see
    #: ``PULSE_COUNTS`` in :mod:`~ur_cartesian_driver.protocol.program.registers`.
    pulse_counts: Annotated[int, Rtde('output_int_register_37', optional=True)] = 0
    #: Fraction of the planned speed at which our robot program runs splines (feed override), 0 to
    #: 1; total delay of splines by it since our robot program connected [s].
    feed_override: Annotated[
        float, Rtde('output_double_register_31', optional=True, monitored=False)
    ] = 1.0
    feed_delay: Annotated[
        float, Rtde('output_double_register_32', optional=True, monitored=False)
    ] = 0.0
    #: Levels of the standard analog inputs [A] or [V], as the installation sets them up; inf = not
    #: reported.
    standard_analog_input0: Annotated[
        float, Rtde('standard_analog_input0', optional=True, monitored=False)
    ] = inf
    standard_analog_input1: Annotated[
        float, Rtde('standard_analog_input1', optional=True, monitored=False)
    ] = inf
    #: Speed of the program's motion relative to its programmed speed, 0 to 1;
    #: :mod:`~.effective_speed` computes it from this packet and the earlier ones.
    effective_speed: Annotated[float, None] = 1.0
    #: Age of the state when it was read [s]: the time that it took from controller to driver.
    state_age: Annotated[float, None] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class StateField:
    """A row of :data:`STATE_TABLE`: a field of :class:`RobotState`."""

    name: str
    #: float, int, an enumeration of numbers, Vector6 or Pose; without ``None``.
    type: Any
    #: Whether the field can hold None (vectors only).
    may_be_none: bool
    default: Any
    #: The RTDE output that the field holds; None = the driver computes the field.
    rtde: Rtde | None


def _state_table() -> Iterator[StateField]:
    hints = get_type_hints(RobotState, include_extras=True)
    for field in fields(RobotState):
        kind, rtde = get_args(hints[field.name])
        yield StateField(
            name=field.name,
            type=get_args(kind)[0] if NoneType in get_args(kind) else kind,
            may_be_none=NoneType in get_args(kind),
            default=field.default,
            rtde=rtde,
        )


#: The table, in the order of the arguments of :class:`RobotState`.
STATE_TABLE = tuple(_state_table())
