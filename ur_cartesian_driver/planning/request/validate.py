# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The checks of a goal that need no robot.

:data:`FIELD_RULES` and :data:`RULES` list the checks in the order in which they run; each is a
function that raises a refusal or returns. Reach, postures and speeds need the robot:
:mod:`~ur_cartesian_driver.planning.planner` checks them.

Refusals name fields as the ROS messages do (``trajectory.points[2].pose.orientation``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from math import isfinite
from typing import TypeAlias

import numpy as np

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, MAX_JOINT_VALUE
from ur_cartesian_driver.motion.errors import (
    InvalidGoal,
    InvalidJoints,
    NotAvailable,
    OldHeaderTimestamp,
)
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.goal.declared_types import WrongType
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    Goal,
    OnPathTolerance,
    Posture,
    Segment,
    SegmentType,
)
from ur_cartesian_driver.motion.goal.goal_columns import goal_table, GoalTable, rows_where
from ur_cartesian_driver.planning.geometry.curves import (
    goal_arcs,
    is_same_pose,
    SAME_POSITION,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.blend_limits import check_blends
from ur_cartesian_driver.planning.request.default_tolerances import (
    apply_default_tolerances,
    named_tolerances,
)
from ur_cartesian_driver.planning.request.feed_override import check_feed_override
from ur_cartesian_driver.planning.request.field_rules import (
    check_fields,
    check_finite,
    check_frames,
)
from ur_cartesian_driver.planning.request.free_axis_rules import check_free_axes
from ur_cartesian_driver.planning.request.goal_fields import (
    gives_joints,
    IS_ARC,
    IS_OPTIMIZED,
    is_rounded,
    is_spline,
    IS_STRAIGHT,
    is_timed,
    late_point_error,
    long_segment_error,
    point_field,
    segment_field,
)
from ur_cartesian_driver.planning.request.held_part_rules import check_held_part
from ur_cartesian_driver.planning.request.mode_rules import check_mode, GOAL_RULES
from ur_cartesian_driver.planning.request.path_offset import check_path_offset
from ur_cartesian_driver.planning.request.point_events.registry import check_outputs, check_stops
from ur_cartesian_driver.planning.request.program_features import check_program
from ur_cartesian_driver.planning.request.rounded_rules import check_rounded
from ur_cartesian_driver.planning.request.spline_rules import check_spline, check_spline_mode

#: Longest time by which a stamp may lie in the future [s].
MAX_STAMP_AHEAD = 60.0

Rule: TypeAlias = Callable[[GoalTable, PlanningOptions], None]


def check(goal: Goal, options: PlanningOptions) -> GoalTable:
    """
    Refuse a goal that is wrong for every robot; otherwise return it as a table.

    Output commands with named leads are replaced by commands that switch earlier.

    :raises GoalRefused: the goal is wrong; the text names point, field, value and bound.
    """
    try:
        table = goal_table(goal)
    except WrongType as error:
        raise InvalidGoal(error.field, error.problem) from None
    with np.errstate(over='ignore', invalid='ignore'):  # numbers may still be huge or NaN
        for rule in FIELD_RULES:
            rule(table, options)
        if table.io_commands:
            table = replace(table, io_commands=options.lead_times(table.io_commands))
        for rule in RULES:
            rule(table, options)
    return table


# -- the rules --------------------------------------------------------------------------------


def _number_of_points(goal: GoalTable, options: PlanningOptions) -> None:
    check_list_lengths(
        'trajectory.points',
        len(goal.waypoints),
        len(goal.segments),
        options,
        if_empty='give at least one point',
        if_too_many='split the goal or raise the parameter',
    )


def _measurable_tolerances(goal: GoalTable, options: PlanningOptions) -> None:
    check_measurable_tolerances(apply_default_tolerances(goal, options), options)


def check_measurable_tolerances(goal: GoalTable, options: PlanningOptions) -> None:
    """
    Refuse acceleration tolerances if the robot does not report accelerations.

    :param goal: the goal, with default tolerances filled in.
    """
    if options.acceleration_known:
        return
    for name, tolerance in named_tolerances(goal):
        if max(tolerance.acceleration) > 0.0:
            raise InvalidGoal(
                f'{name}.acceleration_error',
                'is positive (or 0, with a default in the parameters '
                f'{name}_linear_acceleration, {name}_angular_acceleration), but the software '
                'of this robot does not report accelerations of the TCP',
                'set it to -1',
            )


def _stamp(goal: GoalTable, options: PlanningOptions) -> None:
    check_stamp(goal.age, options)


def _keep_open(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse fields that exclude keep_open if it is set, and fields that need it if not."""
    fraction, horizon = goal.min_speed_fraction, goal.replace_horizon
    if fraction and goal.keep_open:
        raise InvalidGoal(
            'min_speed_fraction',
            f'is {fraction:g}, but the points of a goal with keep_open are not all known',
            'set it to 0, or send the whole path',
        )
    if horizon and not goal.keep_open:
        raise InvalidGoal(
            'replace_horizon',
            f'is {horizon:g} s, but only points of a goal with keep_open can be replaced',
            'set keep_open',
        )
    check_mode(goal, GOAL_RULES['replace_horizon'])


def _travel(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse fields that exclude allow_travel if it is set."""
    check_mode(goal, GOAL_RULES['allow_travel'])
    if not goal.allow_travel:
        return
    problem = ''
    if is_timed(goal):
        problem = 'but the points have times, and how long a travel takes is found out later'
    elif goal.keep_open:
        problem = 'but points of a goal with keep_open are planned one by one'
    elif goal.path_offset:
        problem = 'but the path gives way to offsets (path_offset), which a travel must not'
    elif IS_ARC[goal.motions.types[0]]:
        problem = 'but the first segment is CIRCULAR, an arc from where the arm stands'
    if problem:
        raise NotAvailable(
            'allow_travel',
            f'is set, {problem}',
            'lead to the first point by a goal of its own with allow_travel',
        )


def _supported(goal: GoalTable, options: PlanningOptions) -> None:
    check_mode(goal, GOAL_RULES['on_path_tolerance'])
    if goal.on_path_tolerance == OnPathTolerance.STALL:
        tolerance = apply_default_tolerances(goal, options).path_tolerance
        limits = (*tolerance.position, *tolerance.orientation, *tolerance.twist)
        if max((*limits, *tolerance.acceleration)) <= 0.0:
            raise InvalidGoal(
                'path_tolerance',
                'limits nothing, so that the arm is never off its path; on_path_tolerance is '
                'STALL',
                'set a limit, or on_path_tolerance to ABORT',
            )
    check_outputs(goal, options)
    known = ('', options.tf_prefix + 'tool0_controller')
    named = goal.controlled_frame if goal.moving_frame is None else ''
    if goal.T_flange_controlled is None and named not in known:
        raise InvalidGoal(
            'trajectory.controlled_frame',
            f"is '{goal.controlled_frame}', but T_flange_controlled is not set",
            'set it to the pose of this frame in the flange, or leave controlled_frame empty',
        )


def _times(goal: GoalTable, options: PlanningOptions) -> None:
    if not is_timed(goal):
        return
    times = goal.waypoints.times
    steps = np.diff(times, prepend=0.0)
    # The first point may have the time 0: then the robot is already there.
    is_in_order = (steps > 0.0) | ((steps == 0.0) & (np.arange(len(times)) == 0))
    motion_times = steps - np.append(0.0, goal.motions.dwells[:-1])
    for i in rows_where(~is_in_order | (motion_times > options.max_segment_time))[:1]:
        if is_in_order[i]:
            raise long_segment_error(i, float(motion_times[i]), options.max_segment_time)
        remedy = (
            'increase it' if is_spline(goal) else 'increase it, or set all times to 0 for speeds'
        )
        raise late_point_error(i, times, remedy)


def _segment_rules(goal: GoalTable, options: PlanningOptions) -> None:
    timed, segments = is_timed(goal), goal.segments
    is_fast = np.maximum(segments.velocities, segments.accelerations) > 1.0
    is_arc = IS_ARC[segments.types]
    has_via_fields = segments.arc_modes != ArcMode.UNCONSTRAINED
    has_via_fields |= segments.has_via & (segments.vias != IDENTITY.row()).any(axis=1)
    has_via_fields[list(segments.via_postures)] = True
    suspect = IS_OPTIMIZED[segments.types] & (timed | is_fast | (not options.optimove_known))
    suspect |= timed & (segments.velocities > 0.0)
    suspect |= np.where(is_arc, ~segments.has_via, has_via_fields)
    for i in rows_where(suspect):
        segment = segments[i]
        if IS_OPTIMIZED[segment.type] and not options.optimove_known:
            raise NotAvailable(
                segment_field(i, 'type'),
                f'is {segment.type.name}, which needs PolyScope 5.21 or PolyScope X 10.8',
                'use LINEAR or JOINT',
            )
        _speeds(i, segment, timed)
        _via(i, segment)


def _postures(goal: GoalTable, options: PlanningOptions) -> None:
    for i, posture in goal.waypoints.postures.items():
        check_posture(point_field(i, 'posture'), posture, options.tf_prefix)
    for i, posture in goal.segments.via_postures.items():
        check_posture(segment_field(i, 'via_posture'), posture, options.tf_prefix)


def _joint_points(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse points that give joint positions in place of a pose, if a joint is missing."""
    for i in rows_where(gives_joints(goal)):
        posture = goal.waypoints.postures.get(i, Posture())
        if len(posture.names) < len(JOINT_NAMES):
            raise InvalidGoal(
                point_field(i, 'pose'),
                'is NaN in every number, so the joint positions of the posture apply, but the '
                f'posture names {len(posture.names)} of the {len(JOINT_NAMES)} joints',
                'name all joints, or give the pose',
            )
        check_posture(point_field(i, 'posture'), posture, options.tf_prefix)
        if goal.segments and goal.segments.free_axes[i]:
            raise InvalidGoal(
                segment_field(i, 'free_axis'),
                'is set, but the point gives joint positions, which leave no rotation free',
                'give the pose, or set it to NONE',
            )


def _motions(goal: GoalTable, options: PlanningOptions) -> None:
    points, segments = goal.waypoints, goal.motions
    if len(points) < 2 or is_spline(goal):
        return  # in a spline, consecutive points may be equal: the arm waits
    lengths = np.linalg.norm(np.diff(points.poses[:, :3], axis=0), axis=1)
    suspect = IS_STRAIGHT[segments.types[1:]] & (lengths < 2.0 * SAME_POSITION)
    starts, ends = points.poses[:-1].copy(), points.poses[1:].copy()
    _, _, faults = goal_arcs(segments[1:], IDENTITY, starts, ends)
    suspect[[*faults]] = True
    suspect &= ~np.isnan(lengths)  # NaN: checked again when the pose has been computed
    for i in rows_where(np.append(False, suspect)):
        if i - 1 in faults:
            raise arc_error(i, faults[i - 1])
        if is_same_pose(points.pose(i - 1), points.pose(i)) and not is_rounded(goal):
            # A point with a posture may differ in the joints, so that its segment becomes a joint
            # move. The planner decides this.
            if not (i in points.postures and options.on_posture_change == 'movej'):
                raise duplicate_point_error(goal, i)


#: The rules in the order in which :func:`check` calls them; later rules rely on earlier ones.
#: Between both lists, the leads of output commands are applied. This needs fields within their
#: ranges, which FIELD_RULES ensure.
FIELD_RULES: tuple[Rule, ...] = (_number_of_points, check_fields)
RULES: tuple[Rule, ...] = (
    _joint_points,
    check_frames,
    check_held_part,
    _keep_open,
    _travel,
    _measurable_tolerances,
    _stamp,
    _supported,
    _times,
    check_spline_mode,
    check_program,
    check_spline,
    check_rounded,
    _segment_rules,
    check_free_axes,
    _postures,
    check_blends,
    check_stops,
    check_path_offset,
    check_feed_override,
    _motions,
)


# -- shared with the checks of appended points and those that need the robot ----------------------


def check_stamp(age: float | None, options: PlanningOptions) -> None:
    """
    Refuse a goal whose stamp is too old, or too far in the future.

    :param age: age of the goal's stamp on receipt [s]; None = no stamp.
    """
    if age is None:
        return
    check_finite('trajectory.header.stamp', (age,))
    if age > options.stamp_tolerance:
        raise OldHeaderTimestamp(
            f'trajectory.header.stamp is {age:.3f} s old, more than stamp_tolerance = '
            f'{options.stamp_tolerance:g} s; send 0 for "now", or synchronise the clocks.'
        )
    if age < -MAX_STAMP_AHEAD:
        raise InvalidGoal(
            'trajectory.header.stamp',
            f'is {-age:.1f} s in the future, more than {MAX_STAMP_AHEAD:g} s',
            'send the goal later',
        )


def check_list_lengths(
    field: str,
    points: int,
    segments: int,
    options: PlanningOptions,
    *,
    if_empty: str,
    if_too_many: str,
) -> None:
    """Check the numbers of points and segments; ``if_...`` are the remedies in refusals."""
    if points == 0:
        raise InvalidGoal(field, 'is empty', if_empty)
    if points > options.max_points:
        raise InvalidGoal(
            field, f'has {points} points, more than max_points = {options.max_points}', if_too_many
        )
    if segments not in (0, points):
        raise InvalidGoal(
            'segments',
            f'has {segments} entries for {points} points',
            'give none, or exactly one for each point',
        )


def check_posture(field: str, posture: Posture, tf_prefix: str) -> None:
    """
    Check names and values of a posture.

    :raises InvalidJoints: a name is unknown or repeated, names and values differ in number, or a
        value is not finite or too large.
    """
    names, values = posture.names, posture.values
    if len(names) != len(values):
        raise InvalidJoints(
            f'{field} has {len(names)} joint names but {len(values)} values; '
            'give one value for each name.'
        )
    for k, (name, value) in enumerate(zip(names, values, strict=True)):
        check_joint_name(f'{field}.posture_joint_names[{k}]', name, names[:k], tf_prefix)
        where = f"{field}.posture_joint_values[{k}] ('{name}')"
        if not isfinite(value):
            raise InvalidJoints(f'{where} is {value}; it must be finite.')
        if abs(value) > MAX_JOINT_VALUE:
            raise InvalidJoints(
                f'{where} is {value:g} rad, more than any joint can turn; give radians, not '
                'degrees.'
            )


def check_joint_name(field: str, name: str, before: Sequence[str], tf_prefix: str) -> None:
    """Refuse the name of an unknown joint, and a name that is repeated from ``before``."""
    known = [tf_prefix + each for each in JOINT_NAMES]
    if name not in known:
        raise InvalidJoints(
            f"{field} is '{name}', not a joint of this robot; use {', '.join(known)}."
        )
    if name in before:
        raise InvalidJoints(f"{field} repeats '{name}'; name each joint once.")


def arc_error(index: int, fault: str) -> InvalidGoal:
    """Return the refusal of a CIRCULAR segment whose start, via and end define no arc."""
    return InvalidGoal(
        segment_field(index, 'via'),
        f'defines no arc to point {index}: {fault}',
        'put the via near the middle of a larger arc, or use LINEAR',
    )


def duplicate_point_error(goal: GoalTable, index: int) -> InvalidGoal:
    """Return the refusal of point ``index``, which is the same as the point before."""
    times = goal.waypoints.times
    dwell = float(times[index] - times[index - 1])
    remedy = (
        f'; a dwell of {dwell:g} s at points[{index - 1}] rests there' if is_timed(goal) else ''
    )
    return InvalidGoal(
        point_field(index),
        f'duplicates points[{index - 1}]: a UR move needs a distance to go',
        f'remove one of the two{remedy}',
    )


# -- details ------------------------------------------------------------------------------------


def _speeds(index: int, segment: Segment, timed: bool) -> None:
    kind = SegmentType(segment.type)
    if timed and IS_OPTIMIZED[kind]:
        raise InvalidGoal(
            segment_field(index, 'type'),
            f'is {kind.name}, which cannot meet the time of points[{index}]',
            'use another type, or set all times to 0',
        )
    if timed and segment.velocity > 0.0:
        raise InvalidGoal(
            segment_field(index, 'velocity'),
            f'is {segment.velocity:g}, but the times of the goal set its speed',
            'set it, or all times, to 0',
        )
    if IS_OPTIMIZED[kind]:
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
                segment_field(index, 'via'),
                'is missing',
                'give a pose between the ends of the arc',
            )
        return
    # A ROS message cannot leave a pose out; the identity stands for an unset pose.
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
