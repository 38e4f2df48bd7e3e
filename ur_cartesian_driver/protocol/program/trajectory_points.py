# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The trajectory point interface: motion primitives to the robot program, one result back.

A point is 21 big-endian int32, 84 bytes; S = 1,000,000. The table is that of URCL since 2.12; the
order velocity, acceleration is the wire's, not URScript's. What programs of other versions read
is data, see :mod:`~ur_cartesian_driver.protocol.program.dialects`; T is the dialect's time scale.

=======  =====================================================================  =====
index    meaning                                                                scale
=======  =====================================================================  =====
0 - 5    target: joint positions [rad] or x y z rx ry rz [m, rad]               S
6 - 11   pose targets: q_near [rad], or zeros; MOVEC*: the via point;           S
         SPLINE: joint velocities [rad/s]; else zeros
12       velocity [rad/s or m/s; OPTIMOVE*: fraction]                           S
13       acceleration [rad/s^2 or m/s^2; OPTIMOVE*: fraction]                   S
14       pose targets: 1 = 6 - 11 hold q_near; MOVEC*: the mode of the arc      S
12 - 17  SPLINE: joint accelerations [rad/s^2], zeros when cubic                S
6 - 11   before 2.12, all but MOVEC* and SPLINE: the velocity, six times        S
12 - 17  before 2.12, all but MOVEC* and SPLINE: the acceleration, six times    S
18       duration [s]; 0 = by velocity and acceleration                         T
19       blend radius [m]; SPLINE: its kind, unscaled                           T
20       motion type                                                            1
=======  =====================================================================  =====

SWITCH_OUTPUT is no motion and not of the library: our own robot program alone knows it. It is
read when the motion before it returns, at its stop or where its blend begins, and takes no time:

=======  =====================================================================  =====
0 - 5    the place, x y z rx ry rz [m, rad]; zeros where there is none          S
6 - 11   the heading there, linear and angular, in the axes of the place        S
12 - 15  kind of output, pin, value, domain of an analog one                    S
16, 17   1 = there is a place; 1 = the tool comes round to it                   S
18       delay after the end of the last motion [s]                             T
20       motion type                                                            1
=======  =====================================================================  =====

The sender must

* announce the points on the reverse interface first (``TrajectoryAction.START`` with their number,
  or ``STREAM_START``), and send no more than announced;
* keep the points coming: the robot waits 0.5 s for one, and one controller step when a spline has
  left it moving. Too late means ``TrajectoryResult.FAILURE``;
* send reverse messages all the while, or the program halts;
* end at rest. The robot sets the blend radius of the last point of a counted trajectory to 0.

The result is one int32: 0 success, 1 canceled, 2 failure. It comes in a segment of its own.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from enum import IntEnum
from itertools import islice
import struct
from typing import cast, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.motion.goal import ArcMode, OutputKind, ZERO6
from ur_cartesian_driver.motion.pose import Pose, Vector6
from ur_cartesian_driver.motion.primitive import (
    Instruction,
    MoveC,
    MoveJ,
    MoveL,
    MoveP,
    OptimoveJ,
    OptimoveL,
    Primitive,
    Spline,
    SwitchOutput,
    Target,
)
from ur_cartesian_driver.motion.signals import AnalogDomain
from ur_cartesian_driver.protocol.framing import (
    checked_size,
    FIXED_POINT,
    from_fixed,
    hex_text,
    INT32_MAX,
    INT32_MIN,
    range_error,
    RecordBuffer,
    to_fixed,
)
from ur_cartesian_driver.protocol.program.dialects import Dialect, NEWEST_DIALECT


class MotionType(IntEnum):
    """Word 20: which URScript function the robot calls, and with which kind of target."""

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
    #: movej to the inverse kinematics of a pose, near q_near when that is given
    MOVEJ_POSE = 6
    #: movel to the pose of joint positions
    MOVEL_JOINT = 7
    #: movep to the pose of joint positions
    MOVEP_JOINT = 8
    #: movec through joint positions to joint positions
    MOVEC_JOINT = 9
    #: movec through a **pose** to **joint** positions: the target's kind stands first
    MOVEC_JOINT_POSE = 10
    #: movec through **joint** positions to a **pose**
    MOVEC_POSE_JOINT = 11
    #: optimovej to the inverse kinematics of a pose
    OPTIMOVEJ_POSE = 12
    #: optimovel to the pose of joint positions
    OPTIMOVEL_JOINT = 13
    #: cubic or quintic joint spline, interpolated by the robot program
    SPLINE = 51
    #: no motion: an output is switched at a place; of our own robot program alone
    SWITCH_OUTPUT = 200


class SplineKind(IntEnum):
    """Word 19 of a SPLINE."""

    CUBIC = 1
    QUINTIC = 2


class PointField(IntEnum):
    """Where a field stands in the 21 words; of a group, its first word."""

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
    HAS_TRIGGER_POSE = 16
    STARTS_BEYOND = 17
    DURATION = 18
    BLEND = 19
    TYPE = 20


#: How many outputs may wait for their places at one time.
MAX_PENDING_OUTPUTS = 64
POINT_FIELDS = 21
POINT_SIZE = 4 * POINT_FIELDS

#: The 21 numbers of a point in the order of the table, before scaling.
PointFields: TypeAlias = tuple[float, ...]

_E = TypeVar('_E', bound=IntEnum)

_POINT = struct.Struct('>21i')
_RESULT = struct.Struct('>i')

_TARGET_NAMES = tuple(f'target[{i}]' for i in range(6))
_FIELD_NAMES = (
    *_TARGET_NAMES,
    *(f'words 6-11[{i}]' for i in range(6)),
    'velocity',
    'acceleration',
    'mode',
    *(f'words 15-17[{i}]' for i in range(3)),
    'duration',
    'blend_radius',
    'motion type',
)
_REPEATED_FIELD_NAMES = (
    *_TARGET_NAMES,
    *['velocity'] * 6,
    *['acceleration'] * 6,
    'duration',
    'blend_radius',
    'motion type',
)
_SPLINE_FIELD_NAMES = (
    *_TARGET_NAMES,
    *(f'velocities[{i}]' for i in range(6)),
    *(f'accelerations[{i}]' for i in range(6)),
    'duration',
    'kind',
    'motion type',
)
_OUTPUT_FIELD_NAMES = (
    *(f'trigger_pose[{i}]' for i in range(6)),
    *(f'trigger_direction[{i}]' for i in range(6)),
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

#: Class -> motion type with joint positions, with a pose as target.
_TYPES: dict[type[Primitive], tuple[MotionType, MotionType]] = {
    MoveJ: (MotionType.MOVEJ, MotionType.MOVEJ_POSE),
    MoveL: (MotionType.MOVEL_JOINT, MotionType.MOVEL),
    MoveP: (MotionType.MOVEP_JOINT, MotionType.MOVEP),
    OptimoveJ: (MotionType.OPTIMOVEJ, MotionType.OPTIMOVEJ_POSE),
    OptimoveL: (MotionType.OPTIMOVEL_JOINT, MotionType.OPTIMOVEL),
}
#: Target is a pose, via is a pose -> motion type.
_ARC_TYPES = {
    (False, False): MotionType.MOVEC_JOINT,
    (False, True): MotionType.MOVEC_JOINT_POSE,
    (True, False): MotionType.MOVEC_POSE_JOINT,
    (True, True): MotionType.MOVEC,
}
_MOVES = {types[is_pose]: (cls, is_pose) for cls, types in _TYPES.items() for is_pose in (0, 1)}
_ARCS = {motion: kinds for kinds, motion in _ARC_TYPES.items()}
_OPTIMOVES = frozenset(
    motion for motion, (cls, _) in _MOVES.items() if cls in (OptimoveJ, OptimoveL)
)
#: Where velocity and acceleration stand.
_SPEEDS_ONCE = (PointField.VELOCITY, PointField.ACCELERATION)
_SPEEDS_REPEATED = (PointField.SECOND, PointField.VELOCITY)


def motion_type(primitive: Instruction) -> MotionType:
    """
    Return the wire's number for a primitive: its class and the kind of its target (and via).

    :raises LocalProtocolError: it is no primitive, nor an output.
    """
    if isinstance(primitive, SwitchOutput):
        return MotionType.SWITCH_OUTPUT
    if isinstance(primitive, MoveC):
        return _ARC_TYPES[isinstance(primitive.target, Pose), isinstance(primitive.via, Pose)]
    if isinstance(primitive, Spline):
        return MotionType.SPLINE
    try:
        return _TYPES[type(primitive)][isinstance(primitive.target, Pose)]
    except KeyError:
        raise LocalProtocolError(f'{primitive!r} is not a motion primitive.') from None


def to_fields(primitive: Instruction, dialect: Dialect = NEWEST_DIALECT) -> PointFields:
    """
    Return the 21 numbers of a primitive in SI units, see the table above.

    :raises LocalProtocolError: joint positions come with a q_near, which belongs to poses; or the
        dialect has no such motion, or no q_near.
    """
    kind = motion_type(primitive)
    if kind not in dialect.motion_types:
        raise _unsupported_error(dialect, f'{kind.name} (motion type {kind})')
    if isinstance(primitive, SwitchOutput):
        trigger_pose = primitive.trigger_pose
        return (
            *(_numbers(trigger_pose) if trigger_pose else ZERO6),
            *primitive.trigger_direction,
            primitive.output,
            primitive.pin,
            primitive.value,
            primitive.domain,
            trigger_pose is not None,
            primitive.starts_beyond,
            primitive.delay,
            0,
            kind,
        )
    if isinstance(primitive, Spline):
        spline = SplineKind.CUBIC if primitive.accelerations is None else SplineKind.QUINTIC
        return (
            *primitive.target,
            *primitive.velocities,
            *(primitive.accelerations or ZERO6),
            primitive.duration,
            spline,
            kind,
        )
    target, v, a = _numbers(primitive.target), primitive.velocity, primitive.acceleration
    if isinstance(primitive, MoveC):
        return (
            *target,
            *_numbers(primitive.via),
            v,
            a,
            primitive.mode,
            0,
            0,
            0,
            0,
            primitive.blend_radius,
            kind,
        )
    near = primitive.q_near
    if near is not None and not isinstance(primitive.target, Pose):
        raise LocalProtocolError(
            f'{type(primitive).__name__} has joint positions as its target and a q_near; a q_near '
            'goes with a pose only.'
        )
    duration = primitive.duration if isinstance(primitive, MoveJ | MoveL) else 0
    if dialect.q_near:
        return (
            *target,
            *(near or ZERO6),
            v,
            a,
            near is not None,
            0,
            0,
            0,
            duration,
            primitive.blend_radius,
            kind,
        )
    if near is not None:
        raise _unsupported_error(dialect, 'q_near')
    return (*target, v, v, v, v, v, v, a, a, a, a, a, a, duration, primitive.blend_radius, kind)


def _unsupported_error(dialect: Dialect, what: str) -> LocalProtocolError:
    return LocalProtocolError(f'{what} does not exist in wire dialect {dialect.name}.')


def from_fields(fields: Sequence[float], dialect: Dialect = NEWEST_DIALECT) -> Instruction:
    """
    Return the primitive, or the output, of the 21 numbers.

    :raises RemoteProtocolError: motion type, spline kind, arc mode or output is unknown.
    """
    kind = _enum_member(MotionType, fields[20], 'motion type (word 20)')
    if kind not in dialect.motion_types:
        raise RemoteProtocolError(
            f'{kind:d} is an unknown motion type (word 20) in wire dialect {dialect.name}.'
        )
    target, second = _vector(fields[:6]), _vector(fields[6:12])
    if kind is MotionType.SPLINE:
        spline = _enum_member(SplineKind, fields[19], 'spline kind (word 19)')
        third = _vector(fields[12:18]) if spline is SplineKind.QUINTIC else None
        return Spline(target=target, velocities=second, accelerations=third, duration=fields[18])
    if kind is MotionType.SWITCH_OUTPUT:
        return SwitchOutput(
            output=_enum_member(OutputKind, fields[12], 'kind of output (word 12)'),
            pin=int(fields[13]),
            value=fields[14],
            domain=_enum_member(AnalogDomain, fields[15], 'domain (word 15)'),
            trigger_pose=Pose.from_rotation_vector(target) if fields[16] else None,
            trigger_direction=second,
            starts_beyond=bool(fields[17]),
            delay=fields[18],
        )
    velocity, acceleration, flag = fields[12:15]
    if kind in _ARCS:
        target_is_pose, via_is_pose = _ARCS[kind]
        return MoveC(
            target=_target(target, target_is_pose),
            via=_target(second, via_is_pose),
            velocity=velocity,
            acceleration=acceleration,
            blend_radius=fields[19],
            mode=_enum_member(ArcMode, flag, 'arc mode (word 14)'),
        )
    cls, is_pose = _MOVES[kind]
    if not dialect.q_near:
        velocity, acceleration, flag = fields[6], fields[12], 0.0
    near = second if is_pose and flag else None
    goal = _target(target, bool(is_pose))
    if cls is MoveJ or cls is MoveL:
        return cls(
            target=goal,
            q_near=near,
            velocity=velocity,
            acceleration=acceleration,
            duration=fields[18],
            blend_radius=fields[19],
        )
    return cast(type[MoveP | OptimoveJ | OptimoveL], cls)(
        target=goal,
        q_near=near,
        velocity=velocity,
        acceleration=acceleration,
        blend_radius=fields[19],
    )


def check_fields(fields: PointFields, dialect: Dialect = NEWEST_DIALECT) -> None:
    """
    Refuse what URCL refuses to send: it would mean something else to the robot, or nothing.

    :raises LocalProtocolError: names the field, its value, the bound and the dialect.
    """
    duration, blend, kind = fields[18], fields[19], fields[20]
    if duration and (duration > dialect.max_duration or 0.0 < duration < dialect.min_duration):
        raise _duration_error(duration, dialect)
    if kind == MotionType.SWITCH_OUTPUT and not 0.0 <= duration <= dialect.max_duration:
        raise LocalProtocolError(f'delay is {duration!r} s, but it must not be negative.')
    if kind in (MotionType.SPLINE, MotionType.SWITCH_OUTPUT):
        return
    v_at, a_at = _SPEEDS_ONCE if dialect.q_near or kind in _ARCS else _SPEEDS_REPEATED
    velocity, acceleration = fields[v_at], fields[a_at]
    if velocity < 0.0 or acceleration < 0.0 or blend < 0.0:
        name, value = next(
            (name, value)
            for name, value in (
                ('velocity', velocity),
                ('acceleration', acceleration),
                ('blend_radius', blend),
            )
            if value < 0.0
        )
        raise LocalProtocolError(f'{name} is {value!r}, but it must not be negative.')
    if kind in _OPTIMOVES and not (0.0 < velocity <= 1.0 and 0.0 < acceleration <= 1.0):
        raise LocalProtocolError(
            f'velocity is {velocity!r} and acceleration is {acceleration!r}, but an optimove '
            'takes fractions in (0, 1].'
        )


def _duration_error(duration: float, dialect: Dialect) -> LocalProtocolError:
    if duration < dialect.min_duration:
        return LocalProtocolError(
            f'duration is {duration!r} s, but wire dialect {dialect.name} counts in '
            f'{1.0 / dialect.time_scale:g} s, and 0 would mean that the velocity counts.'
        )
    return LocalProtocolError(
        f'duration is {duration!r} s, but at most {dialect.max_duration} s can be sent in one '
        f'point in wire dialect {dialect.name}.'
    )


def encode_fields(fields: PointFields, dialect: Dialect = NEWEST_DIALECT) -> bytes:
    """
    Return the 84 bytes of the 21 numbers.

    :raises LocalProtocolError: a number cannot be sent.
    """
    check_fields(fields, dialect)
    spline = fields[20] == MotionType.SPLINE
    names = _names(fields[20], dialect)
    words = [to_fixed(value, name) for value, name in zip(fields[:18], names[:18], strict=True)]
    word18 = to_fixed(fields[18], names[18], dialect.time_scale)
    word19 = int(fields[19]) if spline else to_fixed(fields[19], names[19], dialect.time_scale)
    return _POINT.pack(*words, word18, word19, int(fields[20]))


def decode_fields(data: bytes, dialect: Dialect = NEWEST_DIALECT) -> PointFields:
    """
    Return the 21 numbers of 84 bytes, in SI units.

    :raises RemoteProtocolError: there are more or fewer bytes.
    """
    words = _POINT.unpack(checked_size(data, POINT_SIZE, 'trajectory point'))
    scale = dialect.time_scale
    word19 = words[19] if words[20] == MotionType.SPLINE else from_fixed(words[19], scale)
    return (
        *(from_fixed(word) for word in words[:18]),
        from_fixed(words[18], scale),
        word19,
        words[20],
    )


def encode_point(primitive: Instruction, dialect: Dialect = NEWEST_DIALECT) -> bytes:
    """
    Return the 84 bytes of a primitive.

    :raises LocalProtocolError: a value cannot be sent; the text names the field and the bound.
    """
    return encode_fields(to_fields(primitive, dialect), dialect)


def decode_point(data: bytes, dialect: Dialect = NEWEST_DIALECT) -> Instruction:
    """
    Return the primitive, or the output, of 84 bytes.

    :raises RemoteProtocolError: it has another size, or a type, kind or mode that is unknown.
    """
    try:
        return from_fields(decode_fields(data, dialect), dialect)
    except RemoteProtocolError as error:
        raise RemoteProtocolError(f'{error} Bytes: {hex_text(data)}') from None


#: Points that are encoded at once: large enough for numpy, small enough for the cache.
_CHUNK = 4096


def encode_points(primitives: Iterable[Instruction], dialect: Dialect = NEWEST_DIALECT) -> bytes:
    """
    Return the bytes of many of them, the same as :func:`encode_point` one by one but faster.

    :raises LocalProtocolError: names the point (from 0), the field and the bound.
    """
    chunks = []
    iterator = iter(primitives)
    first = 0
    while chunk := list(islice(iterator, _CHUNK)):
        chunks.append(_encode_chunk(chunk, first, dialect))
        first += len(chunk)
    return b''.join(chunks)


def _encode_chunk(primitives: list[Instruction], first: int, dialect: Dialect) -> bytes:
    rows = []
    for index, primitive in enumerate(primitives, first):
        try:
            fields = to_fields(primitive, dialect)
            check_fields(fields, dialect)
        except LocalProtocolError as error:
            raise LocalProtocolError(f'Point {index}: {error}') from None
        rows.append(fields)
    return _encode_rows(np.array(rows, dtype=np.float64), first, dialect)


def _encode_rows(fields: NDArray[np.float64], first: int, dialect: Dialect) -> bytes:
    """Return the bytes of rows of fields (n, 21) which were checked but for their range."""
    scales = np.array([FIXED_POINT] * 18 + [dialect.time_scale] * 2 + [1], dtype=np.float64)
    with np.errstate(over='ignore'):  # what becomes infinite is refused below
        scaled = fields * scales
    spline = fields[:, 20] == MotionType.SPLINE
    scaled[spline, 19] = fields[spline, 19]
    bad = ~((scaled > INT32_MIN - 0.5) & (scaled < INT32_MAX + 0.5))
    if bad.any():
        row, column = (int(i) for i in np.argwhere(bad)[0])
        error = range_error(
            float(fields[row, column]),
            _names(fields[row, 20], dialect)[column],
            int(scales[column]),
        )
        raise LocalProtocolError(f'Point {first + row}: {error}')
    # Ties away from zero, as to_fixed() does it.
    size = np.abs(scaled)
    whole = np.floor(size)
    whole += size - whole >= 0.5
    words = np.copysign(whole, scaled)
    return words.astype('>i4').tobytes()


def _names(kind: float, dialect: Dialect) -> Sequence[str]:
    """Return what the 21 numbers of a motion type are called in errors."""
    if kind == MotionType.SPLINE:
        return _SPLINE_FIELD_NAMES
    if kind == MotionType.SWITCH_OUTPUT:
        return _OUTPUT_FIELD_NAMES
    return _FIELD_NAMES if dialect.q_near or kind in _ARCS else _REPEATED_FIELD_NAMES


def encode_result(result: TrajectoryResult) -> bytes:
    """Return the 4 bytes with which the robot program ends a trajectory."""
    return _RESULT.pack(result)


class TrajectoryResultDecoder:
    """Reads the results that the robot program sends."""

    def __init__(self) -> None:
        """Start empty."""
        self._records = RecordBuffer(_RESULT.size, 'trajectory result')

    def feed(self, data: bytes) -> list[TrajectoryResult]:
        """
        Take bytes from the robot (none at all = its end) and return the results in them.

        :raises RemoteProtocolError: a number is no result, or the stream ended inside one.
        """
        return [_result(record) for record in self._records.feed(data)]


def _result(record: bytes) -> TrajectoryResult:
    (number,) = _RESULT.unpack(record)
    try:
        return TrajectoryResult(number)
    except ValueError:
        raise RemoteProtocolError(
            f'{number} is not a trajectory result (0, 1 or 2): {hex_text(record)}.'
        ) from None


def _numbers(target: Target) -> Vector6:
    return target.rotation_vector() if isinstance(target, Pose) else target


def _target(numbers: Vector6, is_pose: bool) -> Target:
    return Pose.from_rotation_vector(numbers) if is_pose else numbers


def _vector(numbers: Sequence[float]) -> Vector6:
    a, b, c, d, e, f = numbers
    return (a, b, c, d, e, f)


def _enum_member(enum: type[_E], number: float, what: str) -> _E:
    for member in enum:
        if member == number:
            return member
    raise RemoteProtocolError(f'{number:g} is an unknown {what}.')
