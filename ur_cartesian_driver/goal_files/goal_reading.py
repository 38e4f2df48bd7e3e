# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
From a goal message, or an object with its fields, to the goal itself.

Only errors of the message itself are refused here: invalid enumerations, and both forms of points
at once. Points become rows of arrays at once, from either form; of the plain form each attribute
lookup counts.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import TypeVar

import numpy as np

from ur_cartesian_driver.goal_files.goal_schema import Message, PACKED
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.pose_rows import Floats
from ur_cartesian_driver.motion.geometry.vectors import Vector3, Vector6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    ContactEnd,
    FreeAxis,
    InputKind,
    InputWait,
    IOCommand,
    OnPathTolerance,
    OutputKind,
    PathOffset,
    PayloadChange,
    Posture,
    Press,
    PressFrame,
    ProportionalOutput,
    SafeOutput,
    ScriptCall,
    Segment,
    SegmentType,
    StaleOffset,
    Tolerance,
)
from ur_cartesian_driver.motion.goal.goal_table import (
    GoalTable,
    rows_where,
    SegmentRows,
    WaypointRows,
    zeros,
)
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain

_Enum = TypeVar('_Enum', bound=IntEnum)

_NO_POSTURE = Posture()
_PACKED_ENUMS: tuple[tuple[str, type[IntEnum]], ...] = (
    ('types', SegmentType),
    ('arc_modes', ArcMode),
    ('free_axes', FreeAxis),
)
#: The fields of a ``ProportionalOutput`` that are the same in the goal.
PROPORTIONAL_NUMBERS = (
    'begin_lead',
    'end_lead',
    'pin',
    'gain',
    'offset',
    'minimum',
    'maximum',
    'filter_time',
    'idle',
)
#: The same of a ``Press``.
PRESS_SETTINGS = (
    'max_deviation',
    'max_deviation_angle',
    'max_yield',
    'max_yield_angle',
    'damping',
    'gain_scaling',
    'zero_sensor',
)
_SEGMENT_FIELDS = (
    'types',
    'arc_modes',
    'blend_radii',
    'dwells',
    'velocities',
    'segment_accelerations',
    'vias',
    'via_postures',
    'free_axes',
    'free_minima',
    'free_maxima',
)


def goal_from_fields(message: Message) -> GoalTable:
    """
    Return the goal of a ``FollowCartesianTrajectory.Goal``; its frames only have their names.

    :raises InvalidGoal: an enumeration has no such value; the text names the field.
    """
    trajectory = message.trajectory
    waypoints, segments = rows_of_points(message, trajectory.points, 'trajectory.points')
    return GoalTable(
        waypoints=waypoints,
        segments=segments,
        frame_id=trajectory.header.frame_id,
        controlled_frame=trajectory.controlled_frame,
        path_tolerance=_tolerance(message.path_tolerance),
        goal_tolerance=_tolerance(message.goal_tolerance),
        goal_time_tolerance=seconds(message.goal_time_tolerance),
        execution=enum_member(ExecutionMode, message.execution, 'execution'),
        io_commands=io_commands(message),
        keep_open=message.keep_open,
        replace_horizon=message.replace_horizon,
        safe_outputs=tuple(
            _safe_output(output, f'safe_outputs[{i}]')
            for i, output in enumerate(message.safe_outputs)
        ),
        on_path_tolerance=enum_member(
            OnPathTolerance, message.on_path_tolerance, 'on_path_tolerance'
        ),
        stall_timeout=seconds(message.stall_timeout),
        min_speed_fraction=message.min_speed_fraction,
        script_calls=tuple(
            ScriptCall(
                waypoint=call.point_index,
                function=call.function,
                arguments=tuple(call.arguments),
                timeout=call.timeout,
            )
            for call in message.script_calls
        ),
        input_waits=tuple(
            _input_wait(wait, f'input_waits[{i}]') for i, wait in enumerate(message.input_waits)
        ),
        payload_changes=tuple(
            PayloadChange(
                waypoint=change.point_index,
                mass=change.mass,
                center_of_gravity=_three(change.center_of_gravity),
            )
            for change in message.payload_changes
        ),
        proportional_outputs=tuple(
            _proportional_output(output, f'proportional_outputs[{i}]')
            for i, output in enumerate(message.proportional_outputs)
        ),
        presses=tuple(_press(press, f'presses[{i}]') for i, press in enumerate(message.presses)),
        path_offset=_path_offset(message.path_offset),
    )


def rows_of_points(
    message: Message, points: Sequence[Message], field: str
) -> tuple[WaypointRows, SegmentRows]:
    """Return the points and segments of a message, whichever form they have."""
    if not is_packed(message.packed):
        return point_rows(points), segment_rows(message.segments)
    if given := field if points else 'segments' if message.segments else '':
        raise InvalidGoal('packed', f'is given beside {given}', 'use one form or the other')
    waypoints, segments = rows_from_message(message.packed)
    for name, enum in _PACKED_ENUMS:
        column = getattr(segments, name)
        for i in rows_where(~np.isin(column, list(enum)))[:1]:
            enum_member(enum, int(column[i]), f'packed.{name}[{i}]')
    return waypoints, segments


def point_rows(points: Sequence[Message]) -> WaypointRows:
    """Return ``CartesianTrajectoryPoint`` messages as rows."""
    n = len(points)
    postures = ((i, _posture(point.posture)) for i, point in enumerate(points))
    return WaypointRows(
        times=np.array([nanoseconds(point.time_from_start) for point in points]) / 1_000_000_000,
        poses=np.array([_seven(point.pose) for point in points]).reshape(n, 7),
        twists=_six_rows([point.twist for point in points]),
        accelerations=_six_rows([point.acceleration for point in points]),
        jerks=_six_rows([point.jerk for point in points]),
        postures={i: posture for i, posture in postures if posture},
    )


def _seven(pose: Message) -> tuple[float, ...]:
    p, q = pose.position, pose.orientation
    return (p.x, p.y, p.z, q.x, q.y, q.z, q.w)


def _six_rows(rates: Sequence[Message]) -> Floats:
    """Return ``Twist`` or ``Accel`` messages as an array (n, 6); most goals have only zeros."""
    rows = np.array([_six(rate) for rate in rates]).reshape(len(rates), 6)
    return rows if rows.any() else zeros(len(rates))


def _three(vector: Message) -> Vector3:
    return (vector.x, vector.y, vector.z)


def _six(twist: Message) -> Vector6:
    """Return a ``Twist`` or ``Accel``."""
    u, v = twist.linear, twist.angular
    return (u.x, u.y, u.z, v.x, v.y, v.z)


def _posture(posture: Message) -> Posture:
    names, values = posture.posture_joint_names, posture.posture_joint_values
    if not names and not values:
        return _NO_POSTURE
    return Posture(names=tuple(names), values=tuple(values))


def segment_rows(segments: Sequence[Message]) -> SegmentRows:
    """
    Return ``MotionSegment`` messages as rows.

    :raises InvalidGoal: an enumeration has no such value; the text names the field.
    """
    return SegmentRows.of([_segment(each, f'segments[{i}]') for i, each in enumerate(segments)])


def _segment(segment: Message, field: str) -> Segment:
    type_ = enum_member(SegmentType, segment.type, f'{field}.type')
    via: Pose | None = pose_from_message(segment.via)
    if type_ is not SegmentType.CIRCULAR and via == IDENTITY:
        via = None  # the default; another value is kept, so that it is refused and not ignored
    return Segment(
        type=type_,
        blend_radius=segment.blend_radius,
        dwell=segment.dwell,
        velocity=segment.velocity,
        acceleration=segment.acceleration,
        via=via,
        via_posture=_posture(segment.via_posture),
        arc_mode=enum_member(ArcMode, segment.arc_mode, f'{field}.arc_mode'),
        free_axis=enum_member(FreeAxis, segment.free_axis, f'{field}.free_axis'),
        free_min=segment.free_min,
        free_max=segment.free_max,
    )


def io_commands(message: Message) -> tuple[IOCommand, ...]:
    commands = message.io_commands
    return tuple(_io_command(each, f'io_commands[{i}]') for i, each in enumerate(commands))


def _io_command(command: Message, field: str) -> IOCommand:
    return IOCommand(
        waypoint=command.point_index,
        offset=seconds(command.offset),
        output=enum_member(OutputKind, command.output, f'{field}.output'),
        pin=command.pin,
        value=command.value,
        domain=enum_member(AnalogDomain, command.analog_domain, f'{field}.analog_domain'),
    )


def _input_wait(wait: Message, field: str) -> InputWait:
    return InputWait(
        waypoint=wait.point_index,
        input=enum_member(InputKind, wait.input, f'{field}.input'),
        pin=wait.pin,
        value=wait.value,
        below=wait.below,
        timeout=wait.timeout,
        go_on=wait.go_on,
    )


def _proportional_output(output: Message, field: str) -> ProportionalOutput:
    return ProportionalOutput(
        first_waypoint=output.first_point,
        last_waypoint=output.last_point,
        domain=enum_member(AnalogDomain, output.analog_domain, f'{field}.analog_domain'),
        **{name: getattr(output, name) for name in PROPORTIONAL_NUMBERS},
    )


def _press(press: Message, field: str) -> Press:
    return Press(
        first_waypoint=press.first_point,
        last_waypoint=press.last_point,
        frame=enum_member(PressFrame, press.frame, f'{field}.frame'),
        axes=tuple(press.axes),
        forces=tuple(press.forces),
        speed_limits=tuple(press.speed_limits),
        contact=enum_member(ContactEnd, press.contact, f'{field}.contact'),
        **{name: getattr(press, name) for name in PRESS_SETTINGS},
    )


def _path_offset(offset: Message) -> PathOffset:
    return PathOffset(
        limits=_three(offset.limits),
        speed=offset.speed,
        acceleration=offset.acceleration,
        timeout=offset.timeout,
        on_stale=enum_member(StaleOffset, offset.on_stale, 'path_offset.on_stale'),
    )


def _safe_output(output: Message, field: str) -> SafeOutput:
    return SafeOutput(
        output=enum_member(OutputKind, output.output, f'{field}.output'),
        pin=output.pin,
        value=output.value,
        domain=enum_member(AnalogDomain, output.analog_domain, f'{field}.analog_domain'),
        restore=output.restore,
    )


def _tolerance(tolerance: Message) -> Tolerance:
    return Tolerance(
        position=_three(tolerance.position_error),
        orientation=_three(tolerance.orientation_error),
        twist=_six(tolerance.twist_error),
        acceleration=_six(tolerance.acceleration_error),
    )


def enum_member(enum: type[_Enum], value: int, field: str) -> _Enum:
    """Return the member of a value, or refuse the value and list the members."""
    try:
        return enum(value)
    except ValueError:
        names = ', '.join(f'{member.name} ({member.value})' for member in enum)
        raise InvalidGoal(field, f'is {value}', f'it must be one of {names}') from None


# -- times and poses ---------------------------------------------------------------------------


def nanoseconds(time: Message) -> int:
    """Return a ``Duration`` or ``Time`` in nanoseconds."""
    return int(time.sec) * 1_000_000_000 + int(time.nanosec)


def seconds(time: Message) -> float:
    """Return a ``Duration`` or ``Time`` in seconds, rounded once, so nanoseconds survive."""
    return nanoseconds(time) / 1_000_000_000


def pose_from_message(pose: Message) -> Pose:
    """Return a ``geometry_msgs/Pose`` unchanged: not normalized, not checked."""
    p, q = pose.position, pose.orientation
    return Pose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


# -- flat arrays -------------------------------------------------------------------------------


def is_packed(packed: Message) -> bool:
    """Tell whether a ``PackedPoints`` holds anything."""
    return any(len(getattr(packed, name)) for name in PACKED)


def rows_from_message(packed: Message) -> tuple[WaypointRows, SegmentRows]:
    """
    Return the points and segments of a ``PackedPoints``.

    :raises InvalidGoal: an array does not fit the number of points; the text names it.
    """
    n, rest = divmod(len(packed.poses), 7)
    if rest or not n:
        raise InvalidGoal(
            'packed.poses',
            f'has {len(packed.poses)} numbers, but each point needs 7',
            'give position x y z and orientation x y z w of each point',
        )
    names = tuple(packed.posture_joint_names)
    points = WaypointRows(
        times=_column(packed, 'times', n),
        poses=_matrix(packed, 'poses', n, 7),
        twists=_matrix(packed, 'twists', n, 6),
        accelerations=_matrix(packed, 'accelerations', n, 6),
        jerks=zeros(n),
        postures=_postures(packed, 'postures', n, names),
    )
    if not any(len(getattr(packed, name)) for name in _SEGMENT_FIELDS):
        return points, SegmentRows.of(())
    types, vias = _column(packed, 'types', n), _matrix(packed, 'vias', n, 7)
    identity = np.array(IDENTITY.row())
    # Unset poses of the plain form are the identity.
    has_via = (vias != identity).any(axis=1) & bool(len(packed.vias))
    is_arc = types == SegmentType.CIRCULAR
    return points, SegmentRows(
        types=types.astype(np.int64),
        blend_radii=_column(packed, 'blend_radii', n),
        dwells=_column(packed, 'dwells', n),
        velocities=_column(packed, 'velocities', n),
        accelerations=_column(packed, 'segment_accelerations', n),
        vias=np.broadcast_to(identity, (n, 7)) if is_arc.any() and not len(packed.vias) else vias,
        has_via=has_via | is_arc,
        arc_modes=_column(packed, 'arc_modes', n).astype(np.int64),
        free_axes=_column(packed, 'free_axes', n).astype(np.int64),
        free_minima=_column(packed, 'free_minima', n),
        free_maxima=_column(packed, 'free_maxima', n),
        via_postures=_postures(packed, 'via_postures', n, names),
    )


def _matrix(packed: Message, name: str, n: int, columns: int) -> Floats:
    """Return an array of n rows; zeros if it is empty."""
    values = getattr(packed, name)
    if not len(values):
        return zeros(n, columns)
    if len(values) != n * columns:
        raise InvalidGoal(
            f'packed.{name}',
            f'has {len(values)} numbers for {n} points',
            f'give {columns} for each point, or none' if columns > 1 else f'give {n}, or none',
        )
    return np.array(values, dtype=np.float64).reshape(n, columns)


def _column(packed: Message, name: str, n: int) -> Floats:
    return _matrix(packed, name, n, 1)[:, 0]


def _postures(packed: Message, name: str, n: int, names: tuple[str, ...]) -> Mapping[int, Posture]:
    if not len(getattr(packed, name)):
        return {}
    if not names:
        raise InvalidGoal(
            f'packed.{name}', 'has numbers, but posture_joint_names is empty', 'name the joints'
        )
    values = _matrix(packed, name, n, len(names))
    given = ~np.isnan(values)
    if given.all():  # all rows share the names
        return {
            i: Posture(names=names, values=tuple(row)) for i, row in enumerate(values.tolist())
        }
    return {
        i: Posture(
            names=tuple(name for name, is_given in zip(names, given[i], strict=True) if is_given),
            values=tuple(values[i][given[i]].tolist()),
        )
        for i in rows_where(given.any(axis=1))
    }
