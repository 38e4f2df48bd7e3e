# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Trajectory points as 21 numbers, made from motion primitives and outputs.

URCL has had this table since 2.12. Velocity comes before acceleration on the wire, unlike in
URScript. The factors on the wire are S = 1,000,000 and T, which equals S except in dialect 2.0.
:mod:`~ur_cartesian_driver.protocol.program.trajectory_points` scales the numbers, and arranges
them for older programs.

=======  =====================================================================  =====
index    meaning                                                                scale
=======  =====================================================================  =====
0 - 5    target: joint positions [rad] or x y z rx ry rz [m, rad]               S
6 - 11   pose targets: q_near [rad], or zeros; MOVEC*: the via point;           S
         SPLINE: joint velocities [rad/s]; else zeros
12       velocity [rad/s or m/s; OPTIMOVE*: fraction]                           S
13       acceleration [rad/s^2 or m/s^2; OPTIMOVE*: fraction]                   S
14       pose targets: 1 = words 6 - 11 are q_near; MOVEC*: mode of the arc     S
12 - 17  SPLINE: joint accelerations [rad/s^2], zeros when cubic                S
18       duration [s]; 0 = determined by velocity and acceleration              T
19       blend radius [m]; SPLINE: its kind, unscaled                           T
20       motion type                                                            1
=======  =====================================================================  =====

SWITCH_OUTPUT is not a motion and not part of URCL: only our own robot program knows it. The
program reads it when the call of the previous motion returns: at rest, or where the blend begins.
SWITCH_OUTPUT takes no time:

=======  =====================================================================  =====
0 - 5    trigger pose, x y z rx ry rz [m, rad]; zeros without one               S
6 - 11   trigger direction, linear and angular, in the axes of that pose        S
12 - 15  kind of output, pin, value, domain of an analog output                 S
16, 17   1 = has a trigger pose; 1 = the tool starts beyond its plane           S
18       delay after the end of the last motion [s]                             T
20       motion type                                                            1
=======  =====================================================================  =====

The output kind 5 makes an analog output follow the speed of the tool until the output is switched
again. Records of the output kinds 4, 6 and 7 give laws; their word 16 is 1 although they have no
trigger pose. Kind 4 gives the law of the next record of kind 5: words 0 - 4 are gain [1/(m/s)],
offset, minimum, maximum and the time constant of the filter [s]. Kind 6 gives the lead of the next
output: words 0 - 11 are the planned speeds from that output's place back to its trigger pose, word
13 is the lead [s], 15 the distance between place and trigger pose [m or rad], and 17 is 1 if the
tool only turns. Kind 7 gives the law of the pulses that begin with the next record of kind 8:
words 0 - 7 are the distance between pulses [mm], the way to the first one [m], their width [s],
their number in millions, the slot of their count, kind and pin of the output, and 1 if pulses left
at the end of the trajectory are dropped.

The stops, which only our own program knows, are motions during which the arm stands still.
WAIT waits: word 18 is the time from the end of the previous motion until the next one may begin.
AWAIT_INPUT waits until an input has a level, CHANGE_PAYLOAD sets a payload, CALL_FUNCTION calls a
function of the prelude. PRESS_LAW, BEGIN_PRESS and END_PRESS control the controller's force mode.
Words that the table does not list are zeros:

=======  =====================================================================  =====
12, 13   AWAIT_INPUT: kind of input, pin                                        S
14, 15   AWAIT_INPUT: threshold [A, V, or 0 to 1]; 1 = wait until below it      S
16       AWAIT_INPUT: after the time-out, 1 = go on, 0 = end                    S
0 - 3    CHANGE_PAYLOAD: mass [kg], centre of gravity x y z in the flange [m]   S
6 - 11   CHANGE_PAYLOAD: inertia xx yy zz xy xz yz [kg m^2]                     S
0 - 5    CALL_FUNCTION: arguments                                               S
12       CALL_FUNCTION: number of the function                                  S
0 - 5    PRESS_LAW: wrench [N, Nm]; BEGIN_PRESS: task frame in the base         S
         [m, rad]
6 - 11   PRESS_LAW: limits [m/s, rad/s; m, rad]; BEGIN_PRESS: 1 = compliant     S
12, 13   PRESS_LAW: damping, gain scaling                                       S
14, 15   PRESS_LAW: 1 = zero the force sensor; effect of contact (ContactEnd)   S
12       BEGIN_PRESS: 1 = the task frame follows the tool                       S
18       WAIT: the time; AWAIT_INPUT: longest wait; CHANGE_PAYLOAD: transition  T
         [s]
20       motion type                                                            1
=======  =====================================================================  =====
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import TypeAlias

import numpy as np

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.rotation_rows import log_rows
from ur_cartesian_driver.motion.geometry.vectors import Vector6, ZERO6
from ur_cartesian_driver.motion.plan.move_rows import ARC, MoveRows, MOVES, SplineRows
from ur_cartesian_driver.motion.plan.primitive import (
    AwaitInput,
    BeginPress,
    CallFunction,
    ChangePayload,
    EndPress,
    Instruction,
    LEAD_PIECES,
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


class MotionType(IntEnum):
    """Word 20: the URScript function that the robot calls, and the kind of its target."""

    #: movej to joint positions
    MOVEJ = 0
    #: movel to a pose
    MOVEL = 1
    #: movep to a pose
    MOVEP = 2
    #: movec through a pose to a pose
    MOVEC = 3
    #: optimovej to joint positions
    OPTIMOVEJ = 4
    #: optimovel to a pose
    OPTIMOVEL = 5
    #: movej to the inverse kinematics of a pose, near q_near if given
    MOVEJ_POSE = 6
    #: movel to the pose of joint positions
    MOVEL_JOINT = 7
    #: movep to the pose of joint positions
    MOVEP_JOINT = 8
    #: movec through joint positions to joint positions
    MOVEC_JOINT = 9
    #: movec through a **pose** to **joint** positions: the name gives the target first
    MOVEC_JOINT_POSE = 10
    #: movec through **joint** positions to a **pose**
    MOVEC_POSE_JOINT = 11
    #: optimovej to the inverse kinematics of a pose
    OPTIMOVEJ_POSE = 12
    #: optimovel to the pose of joint positions
    OPTIMOVEL_JOINT = 13
    #: cubic or quintic joint spline, interpolated by the robot program
    SPLINE = 51
    #: not a motion: switches an output at a trigger pose; our own robot program only
    SWITCH_OUTPUT = 200
    #: the arm stands still for a time; our own robot program only
    WAIT = 201
    #: the arm stands still until an input has a level; our own robot program only
    AWAIT_INPUT = 202
    #: sets the payload; our own robot program only
    CHANGE_PAYLOAD = 203
    #: parameters of the force mode that begins next; our own robot program only
    PRESS_LAW = 204
    #: force mode begins; our own robot program only
    BEGIN_PRESS = 205
    #: force mode ends; our own robot program only
    END_PRESS = 206
    #: calls a function of the prelude; our own robot program only
    CALL_FUNCTION = 207


class SplineKind(IntEnum):
    """Word 19 of a SPLINE."""

    CUBIC = 1
    QUINTIC = 2


class FollowKind(IntEnum):
    """Word 12 of a SWITCH_OUTPUT that carries a law or starts an output by one."""

    LAW = 4
    BEGIN = 5
    LEAD = 6
    PULSE_LAW = 7
    PULSES = 8


class PointField(IntEnum):
    """Index of a field in the 21 words; for a group, the index of its first word."""

    TARGET = 0
    SECOND = 6
    VELOCITY = 12
    ACCELERATION = 13
    HAS_Q_NEAR = 14
    ARC_MODE = 14
    OUTPUT_KIND = 12
    OUTPUT_PIN = 13
    OUTPUT_VALUE = 14
    OUTPUT_DOMAIN = 15
    INPUT_KIND = 12
    INPUT_PIN = 13
    INPUT_THRESHOLD = 14
    INPUT_BELOW = 15
    INPUT_GOES_ON = 16
    FUNCTION_NUMBER = 12
    PRESS_DAMPING = 12
    PRESS_GAIN_SCALING = 13
    PRESS_ZEROES_SENSOR = 14
    PRESS_CONTACT = 15
    PRESS_FOLLOWS_TOOL = 12
    HAS_TRIGGER_POSE = 16
    STARTS_BEYOND = 17
    DURATION = 18
    BLEND = 19
    TYPE = 20


#: The 21 numbers of a point in the order of the table, before scaling.
PointFields: TypeAlias = tuple[float, ...]


def _indexed(name: str, count: int = 6) -> tuple[str, ...]:
    return tuple(f'{name}[{i}]' for i in range(count))


def _group_names(*groups: Sequence[str], time: str = 'word 18') -> tuple[str, ...]:
    """Return the field names of a record; groups name the words from 0, 6 and 12 on."""
    names = [f'word {i}' for i in range(18)]
    for first, group in zip((0, 6, 12), groups, strict=False):
        names[first : first + len(group)] = group
    return (*names, time, 'word 19', 'motion type')


_MOVE_NAMES = (
    *_indexed('target'),
    *_indexed('words 6-11'),
    'velocity',
    'acceleration',
    'mode',
    *_indexed('words 15-17', 3),
    'duration',
    'blend_radius',
    'motion type',
)
_SPLINE_NAMES = (
    *_indexed('target'),
    *_indexed('velocities'),
    *_indexed('accelerations'),
    'duration',
    'kind',
    'motion type',
)
_OUTPUT_NAMES = (
    *_indexed('trigger_pose'),
    *_indexed('trigger_direction'),
    'output',
    'pin',
    'value',
    'domain',
    'has_trigger_pose',
    'starts_beyond',
    'delay',
    'word 19',
    'motion type',
)

#: Names of the 21 numbers, for errors; all other motion types are moves.
_NAMES: Mapping[float, Sequence[str]] = {
    MotionType.SPLINE: _SPLINE_NAMES,
    MotionType.SWITCH_OUTPUT: _OUTPUT_NAMES,
    MotionType.WAIT: _group_names(time='duration'),
    MotionType.AWAIT_INPUT: _group_names(
        (), (), ('input', 'pin', 'threshold', 'below', 'go_on'), time='timeout'
    ),
    MotionType.CHANGE_PAYLOAD: _group_names(
        ('mass', *_indexed('center_of_gravity', 3)), _indexed('inertia'), time='transition_time'
    ),
    MotionType.CALL_FUNCTION: _group_names(_indexed('arguments'), (), ('number',)),
    MotionType.PRESS_LAW: _group_names(
        _indexed('wrench'),
        _indexed('limits'),
        ('damping', 'gain_scaling', 'zero_sensor', 'contact'),
    ),
    MotionType.BEGIN_PRESS: _group_names(
        _indexed('T_base_task'), _indexed('compliant'), ('follows_tool',)
    ),
    MotionType.END_PRESS: _group_names(),
}
#: The same for a SWITCH_OUTPUT that is a law, by its word 12.
_LAW_NAMES: Mapping[float, Sequence[str]] = {
    FollowKind.LAW: _group_names(('gain', 'offset', 'minimum', 'maximum', 'filter_time')),
    FollowKind.LEAD: _group_names(
        _indexed('speeds', LEAD_PIECES + 1), (), ('kind', 'lead', 'word 14', 'distance')
    ),
    FollowKind.PULSE_LAW: _group_names(
        (
            *('distance [mm]', 'phase', 'width', 'count [millions]', 'slot', 'output', 'pin'),
            'goes_on',
        )
    ),
}

#: Class -> its motion type for a target in joint positions, and its type for a target pose.
_TYPES: dict[type[Primitive], tuple[MotionType, MotionType]] = {
    MoveJ: (MotionType.MOVEJ, MotionType.MOVEJ_POSE),
    MoveL: (MotionType.MOVEL_JOINT, MotionType.MOVEL),
    MoveP: (MotionType.MOVEP_JOINT, MotionType.MOVEP),
    OptimoveJ: (MotionType.OPTIMOVEJ, MotionType.OPTIMOVEJ_POSE),
    OptimoveL: (MotionType.OPTIMOVEL_JOINT, MotionType.OPTIMOVEL),
}
#: (The target is a pose, the via point is a pose) -> motion type.
_ARC_TYPES = {
    (False, False): MotionType.MOVEC_JOINT,
    (False, True): MotionType.MOVEC_JOINT_POSE,
    (True, False): MotionType.MOVEC_POSE_JOINT,
    (True, True): MotionType.MOVEC,
}
#: Last index into ``MOVES`` of a move with a duration; the moves after it have none.
_LAST_TIMED = MOVES.index(MoveL)
_POSE_TYPES = np.array([_TYPES[move][1] if move in _TYPES else MotionType.MOVEC for move in MOVES])
_STOPS: dict[type[Stop], MotionType] = {
    Wait: MotionType.WAIT,
    AwaitInput: MotionType.AWAIT_INPUT,
    ChangePayload: MotionType.CHANGE_PAYLOAD,
    CallFunction: MotionType.CALL_FUNCTION,
    PressLaw: MotionType.PRESS_LAW,
    BeginPress: MotionType.BEGIN_PRESS,
    EndPress: MotionType.END_PRESS,
}
#: Types whose word 18 is not the duration of a move.
_WITH_DELAY = frozenset((MotionType.SWITCH_OUTPUT, *_STOPS.values()))
#: Motion types of arcs.
ARC_TYPES = frozenset(_ARC_TYPES.values())
#: Motion types of moves with a velocity and an acceleration, other than arcs.
MOVE_TYPES = frozenset(kind for kinds in _TYPES.values() for kind in kinds)
_OPTIMOVES = frozenset((*_TYPES[OptimoveJ], *_TYPES[OptimoveL]))


def motion_type(primitive: Instruction) -> MotionType:
    """
    Return the motion type of an instruction, by its class and the kind of its target (and via).

    :raises LocalProtocolError: the instruction is no primitive, stop, output or law.
    """
    if isinstance(primitive, OutputRecord):
        return MotionType.SWITCH_OUTPUT
    if isinstance(primitive, MoveC):
        return _ARC_TYPES[isinstance(primitive.target, Pose), isinstance(primitive.via, Pose)]
    if isinstance(primitive, Spline):
        return MotionType.SPLINE
    if isinstance(primitive, Stop):
        return _STOPS[type(primitive)]
    try:
        return _TYPES[type(primitive)][isinstance(primitive.target, Pose)]
    except KeyError:
        raise LocalProtocolError(f'{primitive!r} is not a motion primitive.') from None


def to_fields(primitive: Instruction) -> PointFields:
    """
    Return the 21 numbers of a primitive, a stop, an output or a law, in SI units.

    :raises LocalProtocolError: the class is unknown, or a joint target has a q_near.
    """
    kind = motion_type(primitive)
    if isinstance(primitive, SwitchOutput):
        return _output_fields(primitive)
    if isinstance(primitive, SpeedLaw):
        return _law_fields(primitive)
    if isinstance(primitive, LeadLaw):
        return _lead_fields(primitive)
    if isinstance(primitive, PulseLaw):
        return _pulse_fields(primitive)
    if isinstance(primitive, Spline):
        return _spline_fields(primitive)
    if isinstance(primitive, Stop):
        return _stop_fields(primitive)
    target, v, a = _numbers(primitive.target), primitive.velocity, primitive.acceleration
    if isinstance(primitive, MoveC):
        via, mode, radius = _numbers(primitive.via), primitive.mode, primitive.blend_radius
        return (*target, *via, v, a, mode, 0, 0, 0, 0, radius, kind)
    q_near = primitive.q_near
    if q_near is not None and not isinstance(primitive.target, Pose):
        raise LocalProtocolError(
            f'{type(primitive).__name__} has joint positions as its target and a q_near; only '
            'poses can have a q_near.'
        )
    near, has_q_near, radius = q_near or ZERO6, q_near is not None, primitive.blend_radius
    duration = primitive.duration if isinstance(primitive, MoveJ | MoveL) else 0
    return (*target, *near, v, a, has_q_near, 0, 0, 0, duration, radius, kind)


def move_fields(moves: MoveRows) -> Floats:
    """
    Return the 21 numbers of each row of moves (n, 21), in SI units.

    The rows whose moves are in ``moves.others`` are meaningless.
    """
    fields = np.zeros((len(moves), 21))
    fields[:, 0:3] = moves.targets[:, :3]
    fields[:, 3:6] = log_rows(moves.targets[:, 3:])
    fields[:, 6:12] = np.where(moves.has_q_near[:, None], moves.q_near, 0.0)
    fields[:, PointField.VELOCITY] = moves.velocities
    fields[:, PointField.ACCELERATION] = moves.accelerations
    fields[:, PointField.HAS_Q_NEAR] = moves.has_q_near
    arcs = np.flatnonzero(moves.kinds == ARC)
    fields[arcs, 6:9], fields[arcs, 9:12] = moves.vias[arcs, :3], log_rows(moves.vias[arcs, 3:])
    fields[arcs, PointField.ARC_MODE] = moves.arc_modes[arcs]
    fields[:, PointField.DURATION] = np.where(moves.kinds <= _LAST_TIMED, moves.durations, 0.0)
    fields[:, PointField.BLEND] = moves.blend_radii
    fields[:, PointField.TYPE] = _POSE_TYPES[moves.kinds]
    return fields


def spline_fields(pieces: SplineRows) -> Floats:
    """Return the 21 numbers of each piece (n, 21), in SI units."""
    quintic = pieces.quintic
    return np.concatenate(
        [
            pieces.targets,
            pieces.velocities,
            np.where(quintic[:, None], pieces.accelerations, 0.0),
            pieces.durations[:, None],
            np.where(quintic, SplineKind.QUINTIC, SplineKind.CUBIC)[:, None],
            np.full((len(pieces), 1), MotionType.SPLINE),
        ],
        axis=1,
    )


def are_plain_moves(moves: MoveRows) -> Flags:
    """Return a mask (n,) of the rows that :func:`check_fields` certainly accepts."""
    are_plain: Flags = (moves.velocities >= 0.0) & (moves.accelerations >= 0.0)
    are_plain &= (moves.blend_radii >= 0.0) & ~np.isin(_POSE_TYPES[moves.kinds], list(_OPTIMOVES))
    are_plain[list(moves.others)] = False
    return are_plain


def _output_fields(output: SwitchOutput) -> PointFields:
    trigger_pose = output.trigger_pose
    return (
        *(_numbers(trigger_pose) if trigger_pose else ZERO6),
        *output.trigger_direction,
        _output_kind(output),
        output.pin,
        output.value,
        output.domain,
        trigger_pose is not None,
        output.starts_beyond,
        output.delay,
        0,
        MotionType.SWITCH_OUTPUT,
    )


def _output_kind(output: SwitchOutput) -> int:
    if output.begins_pulses:
        return FollowKind.PULSES
    return FollowKind.BEGIN if output.follows_speed else output.output


def _law_fields(law: SpeedLaw) -> PointFields:
    numbers = (law.gain, law.offset, law.minimum, law.maximum, law.filter_time, 0)
    # At a stop, the robot program executes pending outputs of value 0. The value of a law is 1, so
    # that the program does not take it for such an output.
    switch = (FollowKind.LAW, 0, 1, 0, 1, 0)
    return (*numbers, *ZERO6, *switch, 0, 0, MotionType.SWITCH_OUTPUT)


def _lead_fields(law: LeadLaw) -> PointFields:
    switch = (FollowKind.LEAD, law.lead, 1, law.distance, 1, law.turns)
    return (*law.speeds, *switch, 0, 0, MotionType.SWITCH_OUTPUT)


def _pulse_fields(law: PulseLaw) -> PointFields:
    numbers = (1e3 * law.distance, law.phase, law.width, 1e-6 * law.count)
    output, switch = (law.slot, law.output, law.pin), (FollowKind.PULSE_LAW, 0, 1, 0, 1, 0)
    rest = (law.goes_on, *(0.0,) * 4)
    return (*numbers, *output, *rest, *switch, 0, 0, MotionType.SWITCH_OUTPUT)


def _stop_fields(stop: Stop) -> PointFields:
    kind = _STOPS[type(stop)]
    match stop:
        case AwaitInput():
            wanted = (stop.input, stop.pin, stop.threshold, stop.below, stop.go_on, 0)
            return (*ZERO6, *ZERO6, *wanted, stop.timeout, 0, kind)
        case ChangePayload():
            payload = (stop.mass, *stop.center_of_gravity, 0.0, 0.0, *stop.inertia)
            return (*payload, *ZERO6, stop.transition_time, 0, kind)
        case CallFunction():
            return (*stop.arguments, *ZERO6, stop.number, *(0.0,) * 7, kind)
        case PressLaw():
            law = (stop.damping, stop.gain_scaling, stop.zero_sensor, stop.contact, 0, 0)
            return (*stop.wrench, *stop.limits, *law, 0, 0, kind)
        case BeginPress():
            frame = stop.T_base_task.rotation_vector()
            return (*frame, *stop.compliant, stop.follows_tool, *(0.0,) * 5, 0, 0, kind)
        case EndPress():
            return (*(0.0,) * 20, kind)
        case Wait():
            return (*(0.0,) * 18, stop.duration, 0, kind)


def _spline_fields(piece: Spline) -> PointFields:
    kind = SplineKind.CUBIC if piece.accelerations is None else SplineKind.QUINTIC
    accelerations = piece.accelerations or ZERO6
    numbers = (*piece.target, *piece.velocities, *accelerations, piece.duration)
    return (*numbers, kind, MotionType.SPLINE)


def check_fields(fields: PointFields) -> None:
    """
    Refuse fields that URCL refuses to send, because the robot would misunderstand or ignore them.

    :raises LocalProtocolError: a value is out of bounds; the text names field, value and bound.
    """
    duration, blend, kind = fields[18], fields[19], fields[20]
    if kind in _WITH_DELAY and not duration >= 0.0:
        name = field_names(fields)[PointField.DURATION]
        raise LocalProtocolError(f'{name} is {duration!r} s, but must not be negative.')
    if kind == MotionType.SPLINE or kind in _WITH_DELAY:
        return
    velocity, acceleration = fields[12], fields[13]
    for name, value in (
        ('velocity', velocity),
        ('acceleration', acceleration),
        ('blend_radius', blend),
    ):
        if value < 0.0:
            raise LocalProtocolError(f'{name} is {value!r}, but must not be negative.')
    if kind in _OPTIMOVES and not (0.0 < velocity <= 1.0 and 0.0 < acceleration <= 1.0):
        raise LocalProtocolError(
            f'velocity is {velocity!r} and acceleration is {acceleration!r}, but an optimove '
            'takes fractions in (0, 1].'
        )


def field_names(fields: Sequence[float] | Floats) -> Sequence[str]:
    """Return the names of the 21 numbers of a point, for errors."""
    kind = float(fields[PointField.TYPE])
    if kind == MotionType.SWITCH_OUTPUT:
        return _LAW_NAMES.get(float(fields[PointField.OUTPUT_KIND]), _OUTPUT_NAMES)
    return _NAMES.get(kind, _MOVE_NAMES)


def _numbers(target: Target) -> Vector6:
    return target.rotation_vector() if isinstance(target, Pose) else target
