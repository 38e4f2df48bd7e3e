# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Rules about goals whose points are connected by a spline: SPLINE and SERVO."""

from __future__ import annotations

from math import isnan

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal, NotAvailable
from ur_cartesian_driver.motion.goal.goal import Segment, SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable, rows_where
from ur_cartesian_driver.motion.plan.joint_spline import SAME_TIME
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import (
    check_plausible,
    is_spline,
    is_timed,
    point_field,
    resolve_execution_mode,
    segment_field,
    short_segment_error,
    type_table,
)

#: Shortest time from point to point [s].
MIN_SPLINE_TIME = 0.001
#: Largest plausible coordinate of a point [m].
MAX_POINT_COORDINATE = 1000.0
#: Largest plausible component of a twist [m/s], [rad/s].
MAX_TWIST = 100.0
#: Largest plausible component of an acceleration [m/s^2], [rad/s^2].
MAX_ACCELERATION = 10_000.0

_IS_PLAIN = type_table((SegmentType.AUTO, SegmentType.LINEAR))
_USE_PRIMITIVES = 'set execution to PRIMITIVES (which ignores twists and accelerations at points)'


def check_spline_mode(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse a spline without times, or without the calibration that its joints depend on."""
    if not resolve_execution_mode(goal).traits.is_spline:
        return
    name = resolve_execution_mode(goal).name
    if is_spline(goal) and not is_timed(goal):
        raise InvalidGoal(
            'execution',
            f'is {name}, which needs times',
            'give every point a time_from_start, or set execution to PRIMITIVES',
        )
    if not options.calibration_known:
        raise NotAvailable(
            'execution',
            f'is {name}, which sends joint positions, but the calibration of this robot is '
            'unknown',
            'set execution to PRIMITIVES',
        )


def check_spline(goal: GoalTable, options: PlanningOptions) -> None:
    """Refuse points that a spline cannot connect."""
    if not is_spline(goal):
        return
    name = resolve_execution_mode(goal).name
    _check_points(goal)
    segments = goal.segments
    for i in rows_where(~_IS_PLAIN[segments.types] | (segments.blend_radii > 0.0)):
        _check_segment(i, segments[i], name)
    if goal.waypoints[0].time == 0.0:
        _check_at_rest(goal, 0, 'starts')
    if not goal.keep_open:
        _check_at_rest(goal, len(goal.waypoints) - 1, 'ends')


def _check_points(goal: GoalTable) -> None:
    points = goal.waypoints
    times = points.times
    wrong = (times > 0.0) & (np.diff(times, prepend=0.0) < MIN_SPLINE_TIME - SAME_TIME)
    for values, bound in (
        (points.poses[:, :3], MAX_POINT_COORDINATE),
        (points.twists, MAX_TWIST),
        (points.accelerations, MAX_ACCELERATION),
    ):
        wrong |= (np.abs(values) > bound).any(axis=1)
    for i in rows_where(wrong):
        point, before = points[i], float(times[i - 1]) if i > 0 else 0.0
        if point.time > 0.0 and point.time - before < MIN_SPLINE_TIME - SAME_TIME:
            raise short_segment_error(i, point.time - before, MIN_SPLINE_TIME)
        for field, numbers, bound in (
            ('pose.position', point.pose.position, MAX_POINT_COORDINATE),
            ('twist', point.twist, MAX_TWIST),
            ('acceleration', point.acceleration, MAX_ACCELERATION),
        ):
            check_plausible(point_field(i, field), numbers, bound, 'm, rad, s')


def _check_segment(index: int, segment: Segment, name: str) -> None:
    kind = SegmentType(segment.type)
    if kind not in (SegmentType.AUTO, SegmentType.LINEAR):
        raise InvalidGoal(
            segment_field(index, 'type'),
            f'is {kind.name}, but with execution {name} a spline joins the points',
            f'set it to AUTO, or {_USE_PRIMITIVES}',
        )
    if segment.blend_radius > 0.0:
        raise InvalidGoal(
            segment_field(index, 'blend_radius'),
            f'is {segment.blend_radius:g}, but with execution {name} a spline passes through '
            'the points',
            f'set it to 0, or {_USE_PRIMITIVES}',
        )


def _check_at_rest(goal: GoalTable, index: int, verb: str) -> None:
    point = goal.waypoints[index]
    for field, values in (('twist', point.twist), ('acceleration', point.acceleration)):
        if any(value != 0.0 and not isnan(value) for value in values):
            raise InvalidGoal(
                point_field(index, field),
                f'is not zero, but the motion {verb} at rest there',
                'set it to 0',
            )
