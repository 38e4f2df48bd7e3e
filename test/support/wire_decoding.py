# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The inverse of the driver's encoders for the robot program: bytes to messages.

It follows the tables of the protocol, and shares no code with the encoders, so that a round trip
is a test of them.
"""

from __future__ import annotations

from collections.abc import Sequence
import struct
from typing import Any

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.goal import ArcMode, ContactEnd, InputKind, OutputKind
from ur_cartesian_driver.motion.plan.primitive import (
    AwaitInput,
    BeginPress,
    CallFunction,
    ChangePayload,
    EndPress,
    Instruction,
    LeadLaw,
    MoveC,
    MoveJ,
    MoveL,
    MoveP,
    OptimoveJ,
    OptimoveL,
    OutputRecord,
    PressLaw,
    Primitive,
    PulseLaw,
    SpeedLaw,
    Spline,
    Stop,
    SwitchOutput,
    Target,
    Wait,
)
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.protocol.program.reverse import ControlMode, ReverseMessage
from ur_cartesian_driver.protocol.program.wire_dialects import Dialect, NEWEST_DIALECT

#: By motion type: the move, and whether its target is a pose.
MOVES: dict[int, tuple[Any, bool]] = {
    0: (MoveJ, False),
    1: (MoveL, True),
    2: (MoveP, True),
    4: (OptimoveJ, False),
    5: (OptimoveL, True),
    6: (MoveJ, True),
    7: (MoveL, False),
    8: (MoveP, False),
    12: (OptimoveJ, True),
    13: (OptimoveL, False),
}
#: By motion type: whether target and via point of the arc are poses.
ARCS = {3: (True, True), 9: (False, False), 10: (False, True), 11: (True, False)}
SPLINE, SWITCH_OUTPUT = 51, 200


def decode_reverse(data: bytes) -> ReverseMessage:
    """Return the message that 32 bytes of the reverse socket encode."""
    timeout, a, b, c, d, e, f, mode = struct.unpack('>8i', data)
    return ReverseMessage(read_timeout=timeout, mode=ControlMode(mode), payload=(a, b, c, d, e, f))


def decode_point(data: bytes, dialect: Dialect = NEWEST_DIALECT) -> Instruction:
    """Return the primitive or output that 84 bytes encode."""
    words = struct.unpack('>21i', data)
    kind = words[20]
    fields = [word / 1e6 for word in words[:18]]
    fields += [words[18] / dialect.time_scale, words[19] / dialect.time_scale]
    if kind in MOVES:
        return _move(fields, kind, is_old=dialect.name in ('2.0', '2.10'))
    if kind in ARCS:
        return _arc(fields, *ARCS[kind], is_old=dialect.name in ('2.0', '2.10'))
    if kind == SPLINE:
        return _spline(fields, is_quintic={1: False, 2: True}[words[19]])
    return _output(fields) if kind == SWITCH_OUTPUT else _stop(fields, kind)


def _move(fields: Sequence[float], kind: int, is_old: bool) -> Primitive:
    cls, is_pose = MOVES[kind]
    move: Primitive = cls(
        target=_target(fields[:6], is_pose),
        q_near=vector6(fields[6:12]) if not is_old and is_pose and fields[14] else None,
        velocity=fields[6] if is_old else fields[12],
        acceleration=fields[12] if is_old else fields[13],
        blend_radius=fields[19],
        **({'duration': fields[18]} if cls in (MoveJ, MoveL) else {}),
    )
    return move


def _arc(fields: Sequence[float], target_is_pose: bool, via_is_pose: bool, is_old: bool) -> MoveC:
    return MoveC(
        target=_target(fields[:6], target_is_pose),
        via=_target(fields[6:12], via_is_pose),
        velocity=fields[13] if is_old else fields[12],
        acceleration=fields[12] if is_old else fields[13],
        blend_radius=fields[19],
        mode=ArcMode(int(fields[14])),
    )


def _spline(fields: Sequence[float], is_quintic: bool) -> Spline:
    return Spline(
        target=vector6(fields[:6]),
        velocities=vector6(fields[6:12]),
        accelerations=vector6(fields[12:18]) if is_quintic else None,
        duration=fields[18],
    )


def _output(fields: Sequence[float]) -> OutputRecord:
    kind = fields[12]
    if kind == 4:
        gain, offset, minimum, maximum, filter_time = fields[:5]
        return SpeedLaw(
            gain=gain, offset=offset, minimum=minimum, maximum=maximum, filter_time=filter_time
        )
    if kind == 6:
        return LeadLaw(
            lead=fields[13],
            distance=fields[15],
            speeds=tuple(fields[:12]),
            turns=bool(fields[17]),
        )
    if kind == 7:
        return PulseLaw(
            distance=1e-3 * fields[0],
            phase=fields[1],
            width=fields[2],
            count=round(1e6 * fields[3]),
            slot=round(fields[4]),
            output=OutputKind(round(fields[5])),
            pin=round(fields[6]),
        )
    of_law = {5: OutputKind.STANDARD_ANALOG, 8: OutputKind.STANDARD_DIGITAL}
    return SwitchOutput(
        output=of_law[int(kind)] if kind in of_law else OutputKind(int(kind)),
        pin=int(fields[13]),
        value=fields[14],
        domain=AnalogDomain(int(fields[15])),
        trigger_pose=_pose(fields[:6]) if fields[16] else None,
        trigger_direction=vector6(fields[6:12]),
        starts_beyond=bool(fields[17]),
        delay=fields[18],
        follows_speed=kind == 5,
        begins_pulses=kind == 8,
    )


def _stop(fields: Sequence[float], kind: int) -> Stop:
    match kind:
        case 201:
            return Wait(duration=fields[18])
        case 202:
            return AwaitInput(
                input=InputKind(int(fields[12])),
                pin=int(fields[13]),
                threshold=fields[14],
                below=bool(fields[15]),
                timeout=fields[18],
                go_on=bool(fields[16]),
            )
        case 203:
            return ChangePayload(
                mass=fields[0],
                center_of_gravity=(fields[1], fields[2], fields[3]),
                inertia=vector6(fields[6:12]),
                transition_time=fields[18],
            )
        case 204:
            return PressLaw(
                wrench=vector6(fields[:6]),
                limits=vector6(fields[6:12]),
                damping=fields[12],
                gain_scaling=fields[13],
                zero_sensor=bool(fields[14]),
                contact=ContactEnd(int(fields[15])),
            )
        case 205:
            return BeginPress(
                T_base_task=_pose(fields[:6]),
                compliant=vector6(fields[6:12]),
                follows_tool=bool(fields[12]),
            )
        case 206:
            return EndPress()
        case 207:
            return CallFunction(number=int(fields[12]), arguments=vector6(fields[:6]))
    raise ValueError(f'{kind} is an unknown motion type.')


def _pose(numbers: Sequence[float]) -> Pose:
    return Pose.from_rotation_vector(vector6(numbers))


def _target(numbers: Sequence[float], is_pose: bool) -> Target:
    return _pose(numbers) if is_pose else vector6(numbers)
