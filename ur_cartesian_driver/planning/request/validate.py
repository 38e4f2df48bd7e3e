# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Every reason to refuse a goal that can be known without a robot.

:data:`RULES` is the list, in the order in which the rules are tried; each is a small function that
raises the refusal or returns. What needs the robot (reach, posture, speed) is in :mod:`~.planner`.

The texts name places as the ROS messages do (``trajectory.points[2].pose.orientation``), so that
a reader finds them in what was sent.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import IntEnum
from math import hypot, isfinite, isnan, pi, sqrt
from typing import TypeAlias, TypeVar

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import (
    InvalidGoal,
    InvalidJoints,
    NotAvailable,
    OldHeaderTimestamp,
)
from ur_cartesian_driver.motion.goal import (
    ArcMode,
    ExecutionMode,
    Goal,
    Posture,
    Segment,
    SegmentType,
    Waypoint,
)
from ur_cartesian_driver.motion.pose import IDENTITY, Pose, Quaternion
from ur_cartesian_driver.planning.geometry.curves import ArcCurve, is_same_pose
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.default_tolerances import (
    apply_default_tolerances,
    named_tolerances,
)
from ur_cartesian_driver.planning.request.goal_fields import (
    DEFAULT_SEGMENT,
    is_optimized,
    is_spline,
    is_straight,
    is_timed,
    point_field,
    resolve_execution_mode,
    segment_field,
    segment_of,
)
from ur_cartesian_driver.planning.request.io_commands import check_outputs

#: How far a quaternion's length may be off 1.
QUATERNION_TOLERANCE = 1e-3
#: No joint of these robots is told to turn further [rad]; values beyond are mistakes, as degrees.
MAX_JOINT_VALUE = 8.0 * pi
#: How far ahead a stamp may lie [s].
MAX_STAMP_AHEAD = 60.0
#: The shortest way of a spline from point to point [s].
MIN_SPLINE_TIME = 0.001
#: What points of splines may ask for before it is absurd [m], [m/s, rad/s], [m/s^2, rad/s^2].
MAX_POINT_COORDINATE = 1000.0
MAX_TWIST = 100.0
MAX_ACCELERATION = 10_000.0

Rule: TypeAlias = Callable[[Goal, PlanningOptions], None]
_Enum = TypeVar('_Enum', bound=IntEnum)


def check(goal: Goal, options: PlanningOptions) -> None:
    """
    Refuse what needs no robot to be known wrong.

    :raises GoalRefused: the subclass that fits; its text names point, field, value and bound.
    """
    for rule in RULES:
        rule(goal, options)


# -- the rules --------------------------------------------------------------------------------


def _number_of_points(goal: Goal, options: PlanningOptions) -> None:
    count = len(goal.waypoints)
    if count == 0:
        raise InvalidGoal('trajectory.points', 'is empty', 'give at least one point')
    if count > options.max_points:
        raise InvalidGoal(
            'trajectory.points',
            f'has {count} points, more than max_points = {options.max_points}',
            'split the goal or raise the parameter',
        )


def _number_of_segments(goal: Goal, options: PlanningOptions) -> None:
    if goal.segments and len(goal.segments) != len(goal.waypoints):
        raise InvalidGoal(
            'segments',
            f'has {len(goal.segments)} entries for {len(goal.waypoints)} points',
            'give none, or exactly one for each point',
        )


def _enum_values(goal: Goal, options: PlanningOptions) -> None:
    _check_enum('execution', goal.execution, ExecutionMode)
    for i, segment in enumerate(goal.segments):
        _check_enum(segment_field(i, 'type'), segment.type, SegmentType)
        _check_enum(segment_field(i, 'arc_mode'), segment.arc_mode, ArcMode)


def _numbers_of_frames(goal: Goal, options: PlanningOptions) -> None:
    for name, pose in (
        ('trajectory.header.frame_id', goal.T_base_frame),
        ('trajectory.controlled_frame', goal.T_flange_controlled),
    ):
        if pose is not None:
            _check_finite(f'the pose of {name}', (*pose.position, *pose.quaternion))
            _check_unit(f'the orientation of {name}', pose.quaternion)


def _numbers_of_points(goal: Goal, options: PlanningOptions) -> None:
    nan_allowed: bool | None = None
    for i, point in enumerate(goal.waypoints):
        if not _all_finite(point):
            nan_allowed = is_spline(goal) if nan_allowed is None else nan_allowed
            _refuse_not_finite(i, point, nan_allowed)
        _check_unit(point_field(i, 'pose.orientation'), point.pose.quaternion)


def _numbers_of_segments(goal: Goal, options: PlanningOptions) -> None:
    for i, segment in enumerate(goal.segments):
        for field in ('blend_radius', 'velocity', 'acceleration'):
            value = getattr(segment, field)
            _check_finite(segment_field(i, field), (value,))
            if value < 0.0:
                raise InvalidGoal(
                    segment_field(i, field), f'is {value:g}; it must not be negative'
                )
        if segment.via is not None:
            _check_finite(segment_field(i, 'via.position'), segment.via.position)
            _check_finite(segment_field(i, 'via.orientation'), segment.via.quaternion)
            _check_unit(segment_field(i, 'via.orientation'), segment.via.quaternion)


def _numbers_of_tolerances(goal: Goal, options: PlanningOptions) -> None:
    for name, tolerance in named_tolerances(goal):
        _check_finite(f'{name}.position_error', tolerance.position)
        _check_finite(f'{name}.orientation_error', tolerance.orientation)
        _check_finite(f'{name}.twist_error', tolerance.twist)
        _check_finite(f'{name}.acceleration_error', tolerance.acceleration)
    _check_finite('goal_time_tolerance', (goal.goal_time_tolerance,))


def _tolerances_are_measurable(goal: Goal, options: PlanningOptions) -> None:
    if options.acceleration_known:
        return
    for name, tolerance in named_tolerances(apply_default_tolerances(goal, options)):
        if max(tolerance.acceleration) > 0.0:
            raise InvalidGoal(
                f'{name}.acceleration_error',
                'is positive (or 0, and the parameters '
                f'{name}_linear_acceleration, {name}_angular_acceleration are), but the software '
                'of this robot does not report accelerations of the TCP',
                'set it to -1',
            )


def _stamp(goal: Goal, options: PlanningOptions) -> None:
    age = goal.age
    if age is None:
        return
    _check_finite('trajectory.header.stamp', (age,))
    if age > options.stamp_tolerance:
        raise OldHeaderTimestamp(
            f'trajectory.header.stamp lies {age:.3f} s in the past, more than stamp_tolerance = '
            f'{options.stamp_tolerance:g} s; send 0 for "now", or compare the clocks.'
        )
    if age < -MAX_STAMP_AHEAD:
        raise InvalidGoal(
            'trajectory.header.stamp',
            f'lies {-age:.1f} s in the future, more than {MAX_STAMP_AHEAD:g} s',
            'send the goal later',
        )


def _supported(goal: Goal, options: PlanningOptions) -> None:
    if goal.keep_open and not options.dialect.supports_append:
        raise NotAvailable(
            'keep_open',
            'is set, but a robot program of wire dialect '
            f'{options.dialect.name} has to know at the start how many points there are',
            'send all points at once, or use a robot program of wire dialect 2.14',
        )
    if goal.keep_open and goal.execution == ExecutionMode.SERVO:
        raise NotAvailable(
            'keep_open',
            'is set, but the points of a SERVO goal have to be known at its start',
            'set execution to SPLINE or PRIMITIVES',
        )
    check_outputs(goal, options)
    known = ('', options.tf_prefix + 'tool0_controller')
    if goal.T_flange_controlled is None and goal.controlled_frame not in known:
        raise InvalidGoal(
            'trajectory.controlled_frame',
            f"is '{goal.controlled_frame}', and the goal does not "
            'say where that is behind the flange',
            'set T_flange_controlled, or leave it empty',
        )


def _times(goal: Goal, options: PlanningOptions) -> None:
    if not is_timed(goal):
        return
    before = 0.0
    for i, point in enumerate(goal.waypoints):
        if point.time < 0.0 or (i > 0 and point.time <= before):
            raise InvalidGoal(
                point_field(i, 'time_from_start'),
                f'is {point.time:g} s after {before:g} s; times must increase from point to point',
                'correct it' if is_spline(goal) else 'or set all to 0 for speeds',
            )
        if point.time - before > options.max_segment_time:
            raise InvalidGoal(
                point_field(i, 'time_from_start'),
                f'gives the segment {point.time - before:g} s, '
                f'more than {options.max_segment_time:.0f} s',
                'add points in between',
            )
        before = point.time


def _spline(goal: Goal, options: PlanningOptions) -> None:
    if not is_spline(goal):
        return
    name = resolve_execution_mode(goal).name
    if not is_timed(goal):
        raise InvalidGoal(
            'execution',
            f'is {name}, and the goal has no times',
            'give every point a time_from_start, or set execution to PRIMITIVES',
        )
    _spline_can_be_sent(goal, name, options)
    before = 0.0
    for i, point in enumerate(goal.waypoints):
        if 0.0 < point.time < before + MIN_SPLINE_TIME:
            raise InvalidGoal(
                point_field(i, 'time_from_start'),
                f'gives the segment {point.time - before:g} s; '
                f'pieces of splines take at least {MIN_SPLINE_TIME:g} s',
                'leave points out',
            )
        before = point.time
        for field, values, cap in (
            ('pose.position', point.pose.position, MAX_POINT_COORDINATE),
            ('twist', point.twist, MAX_TWIST),
            ('acceleration', point.acceleration, MAX_ACCELERATION),
        ):
            if any(abs(value) > cap for value in values):
                raise InvalidGoal(
                    point_field(i, field),
                    f'contains a number beyond {cap:g}, far more than any of these robots can do',
                    'check the units: metres, radians, seconds',
                )
    for i, segment in enumerate(goal.segments):
        if segment is not DEFAULT_SEGMENT:
            _spline_segment(i, segment, name)
    if goal.waypoints[0].time == 0.0:
        _check_at_rest(goal, 0, 'the robot stands there when the motion begins')
    if not goal.keep_open:
        _check_at_rest(goal, len(goal.waypoints) - 1, 'the motion ends there')


def _spline_can_be_sent(goal: Goal, name: str, options: PlanningOptions) -> None:
    remedy = 'set execution to PRIMITIVES'
    if not options.calibration_known:
        raise NotAvailable(
            'execution',
            f'is {name}, for which joint positions are sent, and the calibration of '
            'the robot, from which they follow, is not known',
            remedy,
        )
    if goal.execution == ExecutionMode.SERVO:
        if not options.dialect.supports_servo:
            raise NotAvailable(
                'execution',
                f'is {name}, which robot programs of wire dialect '
                f'{options.dialect.name} do not know',
                remedy,
            )
        if goal.io_commands:
            raise NotAvailable(
                'io_commands',
                f'is not empty, and {name} switches no outputs',
                'set execution to SPLINE or PRIMITIVES',
            )
    elif options.dialect.is_coarse:
        raise NotAvailable(
            'execution',
            f'is {name}, and robot programs of wire dialect {options.dialect.name} '
            'count in milliseconds, too coarse for splines',
            remedy,
        )


def _spline_segment(index: int, segment: Segment, name: str) -> None:
    kind = SegmentType(segment.type)
    if kind not in (SegmentType.AUTO, SegmentType.LINEAR):
        raise InvalidGoal(
            segment_field(index, 'type'),
            f'is {kind.name}, but the execution is {name}, in which a spline joins the points',
            'set it to AUTO, or set execution to PRIMITIVES, which '
            'ignores twists and accelerations at points',
        )
    if segment.blend_radius > 0.0:
        raise InvalidGoal(
            segment_field(index, 'blend_radius'),
            f'is {segment.blend_radius:g}, but the '
            f'execution is {name}: the spline goes through the point',
            'set it to 0, or set '
            'execution to PRIMITIVES, which ignores twists and accelerations at points',
        )


def _check_at_rest(goal: Goal, index: int, why: str) -> None:
    point = goal.waypoints[index]
    for field, values in (('twist', point.twist), ('acceleration', point.acceleration)):
        if any(value != 0.0 and not isnan(value) for value in values):
            raise InvalidGoal(point_field(index, field), f'is not zero, but {why}', 'set it to 0')


def _segment_rules(goal: Goal, options: PlanningOptions) -> None:
    timed = is_timed(goal)
    for i, segment in enumerate(goal.segments):
        if segment is not DEFAULT_SEGMENT:
            if is_optimized(SegmentType(segment.type)) and not options.optimove_known:
                raise NotAvailable(
                    segment_field(i, 'type'),
                    f'is {SegmentType(segment.type).name}, which the '
                    'software of this robot does not know; it came with PolyScope 5.21 and '
                    'PolyScope X 10.8',
                    'use LINEAR or JOINT',
                )
            _speeds(i, segment, timed)
            _via(i, segment)


def _postures(goal: Goal, options: PlanningOptions) -> None:
    for i, point in enumerate(goal.waypoints):
        if point.posture:
            check_posture(point_field(i, 'posture'), point.posture, options.tf_prefix)
    for i, segment in enumerate(goal.segments):
        if segment.via_posture:
            check_posture(segment_field(i, 'via_posture'), segment.via_posture, options.tf_prefix)


def _blends(goal: Goal, options: PlanningOptions) -> None:
    if is_spline(goal):
        return
    last = len(goal.waypoints) - 1
    for i in range(1, len(goal.segments)):
        check_blends_fit(
            goal,
            i,
            goal.waypoints[i - 1].pose.distance_to(goal.waypoints[i].pose),
            goal.segments[i - 1].blend_radius,
            0.0 if i == last else goal.segments[i].blend_radius,
        )


def _motions(goal: Goal, options: PlanningOptions) -> None:
    if is_spline(goal):
        return  # it can wait at a point
    for i in range(1, len(goal.waypoints)):
        start, end = goal.waypoints[i - 1], goal.waypoints[i]
        segment = segment_of(goal, i)
        if segment.type == SegmentType.CIRCULAR:
            # The start's orientation does not matter for the shape.
            assert segment.via is not None
            arc_through_via(i, start.pose, segment.via, end.pose, segment.arc_mode)
        elif is_straight(segment.type) and is_same_pose(start.pose, end.pose):
            # With a posture it may become a joint move: decided with the robot at hand.
            if not (end.posture and options.on_posture_change == 'movej'):
                raise no_motion_error(goal, i)


#: All rules, in order: later ones may rely on what earlier ones made sure of.
RULES: tuple[Rule, ...] = (
    _number_of_points,
    _number_of_segments,
    _enum_values,
    _numbers_of_frames,
    _numbers_of_points,
    _numbers_of_segments,
    _numbers_of_tolerances,
    _tolerances_are_measurable,
    _stamp,
    _supported,
    _times,
    _spline,
    _segment_rules,
    _postures,
    _blends,
    _motions,
)


# -- shared with the checks that need the robot -------------------------------------------------


def check_posture(field: str, posture: Posture, tf_prefix: str) -> None:
    """
    Check names and values of a posture.

    :raises InvalidJoints: a name is unknown or doubled, the numbers differ, or a value is not
        finite.
    """
    names, values = posture.names, posture.values
    if len(names) != len(values):
        raise InvalidJoints(
            f'{field} has {len(names)} joint names and {len(values)} values; '
            'give one value for each name.'
        )
    known = [tf_prefix + name for name in JOINT_NAMES]
    for k, (name, value) in enumerate(zip(names, values, strict=True)):
        if name not in known:
            raise InvalidJoints(
                f"{field}.posture_joint_names[{k}] is '{name}', which is no joint "
                f'of this robot; its joints are {", ".join(known)}.'
            )
        if name in names[:k]:
            raise InvalidJoints(
                f"{field}.posture_joint_names[{k}] names '{name}' for the second "
                'time; name each joint once.'
            )
        if not isfinite(value):
            raise InvalidJoints(
                f"{field}.posture_joint_values[{k}] ('{name}') is {value}; it must be finite."
            )
        if abs(value) > MAX_JOINT_VALUE:
            raise InvalidJoints(
                f"{field}.posture_joint_values[{k}] ('{name}') is {value:g} rad, more than any "
                'joint can turn; joint values are radians, not degrees.'
            )


def check_blends_fit(goal: Goal, index: int, length: float, before: float, after: float) -> None:
    """
    Check that the blends around both ends of a segment do not overlap.

    The controller skips a waypoint whose blends overlap (C171), so that is never sent.

    :param apart: distance of the two points [m].
    """
    # A rounding error may not decide over blends that touch.
    if before + after > length * (1.0 + 1e-9) + 1e-9:
        raise InvalidGoal(
            segment_field(index if after > 0.0 else index - 1, 'blend_radius'),
            f'is too large: the blends around points {index - 1} and {index} reach '
            f'{1e3 * before:g} mm and {1e3 * after:g} mm into a segment of {1e3 * length:.3f} mm',
            'make them smaller',
        )


def arc_through_via(index: int, start: Pose, via: Pose, end: Pose, mode: ArcMode) -> ArcCurve:
    """
    Return the arc of a CIRCULAR segment.

    :raises InvalidGoal: start, via and end make no circle.
    """
    try:
        return ArcCurve.through(start, via.position, end, mode)
    except ValueError as error:
        raise InvalidGoal(
            segment_field(index, 'via'),
            f'gives no arc to point {index}: {error}',
            'move the via off the line, or use LINEAR',
        ) from None


def no_motion_error(goal: Goal, index: int) -> InvalidGoal:
    """Return the refusal of a segment without a motion."""
    dwell = goal.waypoints[index].time - goal.waypoints[index - 1].time
    dwell_clause = f' for {dwell:g} s' if is_timed(goal) else ''
    return InvalidGoal(
        point_field(index),
        f'is the same as points[{index - 1}]{dwell_clause}: there is no way to go, '
        'and the robot cannot wait at a point',
        'remove one of the two, or split the goal there',
    )


# -- details ------------------------------------------------------------------------------------


def _check_enum(field: str, value: int, kind: type[_Enum]) -> None:
    try:
        kind(value)
    except ValueError:
        names = ', '.join(f'{member.name} = {member.value}' for member in kind)
        raise InvalidGoal(field, f'is {value}, which is none of {names}') from None


def _all_finite(point: Waypoint) -> bool:
    # A sum is finite only if every term is, except that huge numbers may add up to infinity:
    # then the slow check finds nothing and nothing is refused here.
    pose = point.pose
    return isfinite(
        point.time
        + sum(pose.position)
        + sum(pose.quaternion)
        + sum(point.twist)
        + sum(point.acceleration)
        + sum(point.jerk)
    )


def _refuse_not_finite(index: int, point: Waypoint, nan_allowed: bool) -> None:
    """
    Refuse the number that is not finite.

    :param chooses: whether NaN in twist and acceleration lets the driver choose.
    """
    _check_finite(point_field(index, 'time_from_start'), (point.time,))
    _check_finite(point_field(index, 'pose.position'), point.pose.position)
    _check_finite(point_field(index, 'pose.orientation'), point.pose.quaternion)
    for field in ('twist', 'acceleration', 'jerk'):
        values = getattr(point, field)
        _check_finite(
            point_field(index, field),
            (
                0.0 if nan_allowed and field != 'jerk' and isnan(value) else value
                for value in values
            ),
        )


def _check_finite(field: str, values: Iterable[float]) -> None:
    for value in values:
        if not isfinite(value):
            raise InvalidGoal(field, f'contains {value}; every number must be finite')


def _check_unit(field: str, q: Quaternion) -> None:
    x, y, z, w = q
    square = x * x + y * y + z * z + w * w
    if abs(square - 1.0) <= QUATERNION_TOLERANCE:  # |q| is then within half of it
        return
    length = sqrt(square) if isfinite(square) else hypot(x, y, z, w)
    if length == 0.0:
        raise InvalidGoal(
            field, 'is zero, which is no orientation', 'send x, y, z, w = 0, 0, 0, 1 for none'
        )
    if abs(length - 1.0) > QUATERNION_TOLERANCE:
        raise InvalidGoal(
            field,
            f'has length {length:.6g}; a unit quaternion is needed (within '
            f'{QUATERNION_TOLERANCE:g})',
            'divide it by its length',
        )


def _speeds(index: int, segment: Segment, timed: bool) -> None:
    kind = SegmentType(segment.type)
    if timed and is_optimized(kind):
        raise InvalidGoal(
            segment_field(index, 'type'),
            f'is {kind.name}, which cannot keep the time of points[{index}]',
            'use another type, or set all times to 0',
        )
    if timed and segment.velocity > 0.0:
        raise InvalidGoal(
            segment_field(index, 'velocity'),
            f'is {segment.velocity:g} in a goal with times; either counts, not both',
            'set it, or all times, to 0',
        )
    if is_optimized(kind):
        for field in ('velocity', 'acceleration'):
            value = getattr(segment, field)
            if value > 1.0:
                raise InvalidGoal(
                    segment_field(index, field),
                    f'is {value:g}; for {kind.name} it is a fraction in (0, 1]',
                )


def _via(index: int, segment: Segment) -> None:
    kind = SegmentType(segment.type)
    if kind == SegmentType.CIRCULAR:
        if segment.via is None:
            raise InvalidGoal(
                segment_field(index, 'via'), 'is missing; an arc needs a pose between its ends'
            )
        return
    # The identity is what an unset pose of a ROS message looks like.
    for field, given in (
        ('via', segment.via not in (None, IDENTITY)),
        ('via_posture', bool(segment.via_posture)),
        ('arc_mode', segment.arc_mode != ArcMode.UNCONSTRAINED),
    ):
        if given:
            raise InvalidGoal(
                segment_field(index, field),
                f'is set, but the type is {kind.name}',
                'set the type to CIRCULAR, or leave it empty',
            )
