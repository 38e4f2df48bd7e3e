# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A goal with keep_open as planned so far, and the points that a client appends.

*Client time* is the ``time_from_start`` of the points. *Motion time* is the planned time since the
motion of the goal began; it does not run while the arm waits for points. Motion time is client
time plus ``time_offset``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import IntEnum

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints
from ur_cartesian_driver.motion.goal.field_annotations import shifted
from ur_cartesian_driver.motion.goal.goal import (
    FreeAxis,
    Goal,
    IOCommand,
    PulseTrain,
    Segment,
    Waypoint,
)
from ur_cartesian_driver.motion.goal.goal_columns import (
    goal_table,
    rows_where,
    SegmentRows,
    WaypointRows,
)
from ur_cartesian_driver.motion.goal.output_names import output_name
from ur_cartesian_driver.motion.plan.plan import PlannedRows, PlannedSegment, ReferencePath
from ur_cartesian_driver.planning.append.planned_part import PlannedPart
from ur_cartesian_driver.planning.geometry.curves import SAME_ANGLE, SAME_POSITION
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.held_part_kinematics import kinematics_of
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.request.free_axis_rules import keep_open_error
from ur_cartesian_driver.planning.request.goal_fields import long_segment_error, point_field
from ur_cartesian_driver.planning.request.point_events.dwells import refuse_dwells_of_open_goals
from ur_cartesian_driver.planning.request.point_events.registry import check_outputs
from ur_cartesian_driver.planning.request.validate import check_list_lengths
from ur_cartesian_driver.planning.spline.spline_planner import SplineState


class Replacement(IntEnum):
    """Whether appended points replace planned ones, and from where; values of ``AppendPoints``."""

    APPEND = 0
    REPLACE_FROM_POINT = 1
    REPLACE_FROM_TIME = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class AppendedPoints:
    """The points of one append request."""

    waypoints: Sequence[Waypoint] = ()
    #: Empty, or one for each waypoint.
    segments: Sequence[Segment] = ()
    #: Commands whose waypoints are numbered from the start of the goal.
    io_commands: tuple[IOCommand, ...] = ()
    #: Whether these points are the last of the goal.
    last: bool = False
    #: The first point that is replaced; None = no such request.
    replace_from_point: int | None = None
    #: The client time (as in the points' times) from which the motion is replaced [s]; None = no
    #: such request.
    replace_from_time: float | None = None

    @property
    def replaces(self) -> bool:
        """Whether these points replace points of the goal."""
        return self.replace_from_point is not None or self.replace_from_time is not None

    def in_rows(self) -> AppendedPoints:
        """
        Return the same request with points and segments as rows.

        :raises WrongType: a value is not of its declared type; the text names the field.
        """
        return replace(
            self,
            waypoints=WaypointRows.of(self.waypoints, 'append.waypoints'),
            segments=SegmentRows.of(self.segments, 'append.segments'),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplannablePoint:
    """A point whose motion can be planned again, with joints and client time where it begins."""

    waypoint: Waypoint
    segment: Segment
    q_before: Joints
    time_before: float
    #: The motion to the point, as last planned.
    planned: PlannedSegment | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AppendableGoal:
    """A goal that stays open for points, with the data needed to plan more of them."""

    #: The goal without its points.
    goal: Goal
    T_flange_active: Pose
    T_flange_tcp: Pose | None
    #: Number of planned points.
    points: int = 0
    #: Number of planned records.
    records: int = 0
    #: Number of committed records: all but the ending's.
    committed_records: int = 0
    #: Motion time at which the committed records end [s].
    time: float = 0.0
    #: Motion time at which all records end [s].
    rest_time: float = 0.0
    #: Motion time less client time [s].
    time_offset: float = 0.0
    #: Client time of the last point [s].
    last_client_time: float = 0.0
    #: Joint positions at rest after the ending [rad].
    q_rest: Joints
    replannable: tuple[ReplannablePoint, ...] = ()
    #: State at the last point; None = the goal is no spline.
    state: SplineState | None = None
    #: Pieces up to ``state``, with their path, that are sent (again) together with the next part,
    #: because outputs follow these pieces or a new tail begins in the middle of one of them.
    replanned: tuple[PlannedRows, ReferencePath] | None = None
    #: Commands whose records the next part places again, each with the motion time when it is due
    #: [s].
    outputs: tuple[tuple[float, IOCommand], ...] = ()
    #: The planned parts of a spline that are not passed, in the order of planning; each is valid
    #: until the next one begins.
    parts: tuple[PlannedPart, ...] = ()
    #: The pulses that go on along appended points, each with its name in a refusal.
    pulses: tuple[tuple[str, PulseTrain], ...] = ()
    #: All commands on ``parts``, each with the motion time when it is due [s].
    commands: tuple[tuple[float, IOCommand], ...] = ()

    def kinematics(self, arm: Arm) -> TcpKinematics:
        """Return the kinematics of an arm with the TCP of the motion."""
        T_flange_tcp = self.T_flange_tcp or self.T_flange_active
        return kinematics_of(self.goal.moving_frame, arm, T_flange_tcp)


def check_appended_points(
    appendable: AppendableGoal, appended: AppendedPoints, options: PlanningOptions
) -> None:
    """
    Make the checks of appended points that do not depend on the state of the arm.

    :raises GoalRefused: the points are wrong; the text numbers points from the goal's start.
    """
    count, first = len(appended.waypoints), appendable.points
    check_list_lengths(
        'points',
        count,
        len(appended.segments),
        options,
        if_empty='give at least one point, or set last',
        if_too_many='append them in several requests',
    )
    refuse_dwells_of_open_goals(appended.segments, keep_open=True, first=first)
    for i in rows_where(SegmentRows.of(appended.segments).free_axes != FreeAxis.NONE)[:1]:
        raise keep_open_error(i + first)
    for i, command in enumerate(appended.io_commands):
        if not first <= command.waypoint < first + count:
            raise InvalidGoal(
                f'io_commands[{i}].point_index',
                f'is {command.waypoint}, but the points of this '
                f'request are {first} to {first + count - 1}',
                'name one of these',
            )
        for _, train in appendable.pulses:
            if (train.output, train.pin) == (command.output, command.pin):
                raise InvalidGoal(
                    f'io_commands[{i}].pin',
                    f'is {command.pin}, but {output_name(train.output, train.pin)} gives pulses '
                    'to the end of the goal',
                    'use another output',
                )
    # Only the new commands are checked, so that refusals number them as in this request.
    check_outputs(
        goal_table(
            replace(
                appendable.goal,
                waypoints=appended.waypoints,
                io_commands=numbered(appended, first),
            )
        ),
        options,
    )
    _check_times(appendable, appended, options)


def numbered(appended: AppendedPoints, first: int) -> tuple[IOCommand, ...]:
    """Return the appended commands, with waypoints numbered from the point ``first``."""
    return tuple(shifted(command, -first) for command in appended.io_commands)


def _check_times(
    appendable: AppendableGoal, appended: AppendedPoints, options: PlanningOptions
) -> None:
    """
    Refuse wrong client times of appended points.

    Each must be later than the time before it, by ``max_segment_time`` at most. A goal whose
    points have no times gets no points with times.
    """
    is_tail = appended.replace_from_time is not None
    times, first = WaypointRows.of(appended.waypoints).times, appendable.points
    if appendable.last_client_time == 0.0 and not times.any():
        return
    # A goal whose only point has the time 0 can be a goal with times: then the arm was at this
    # point at the start, and did not move.
    moved = any(
        known.planned.length > SAME_POSITION or known.planned.angle > SAME_ANGLE
        for known in appendable.replannable
        if known.planned is not None
    )
    if appendable.last_client_time == 0.0 and (first > 1 or moved):
        raise InvalidGoal(
            point_field(first, 'time_from_start'),
            f'is {times[0]:g} s, but the points before have no times',
            'set it to 0 in all points',
        )
    before = np.append(appendable.last_client_time, times[:-1])
    steps = times - before
    for i in rows_where(np.isfinite(steps) & (steps > options.max_segment_time))[:1]:
        raise long_segment_error(first + i, float(steps[i]), options.max_segment_time)
    for i in rows_where(steps <= 0.0)[:1]:
        raise InvalidGoal(
            point_field(first + i, 'time_from_start'),
            f'is {times[i]:g} s, not later than the {before[i]:g} s '
            + ('where the new tail begins' if not i and is_tail else 'of the point before'),
            'count times from the start of the goal',
        )
