# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Plan appended points (keep_open): part by part, each from the end of the one before.

The last motion of a part is planned to end at rest, because the next point is unknown. The driver
holds it back as the *ending* of the goal. If points come in time, it is planned again together
with them, so that a blend or a spline passes through its end. Otherwise it is sent, the arm rests
at its end, and the next part begins there.

A primitive is planned again with the two before it as context, because its blend depends on them.
A spline needs none, for its state at a point is position, velocity and acceleration; its ending is
a piece that brakes after the last point
(:func:`~ur_cartesian_driver.planning.spline.spline_planner.plan_stop`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
import re

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.errors import GoalRefused
from ur_cartesian_driver.motion.goal import IOCommand, Segment
from ur_cartesian_driver.motion.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan import Plan, PlannedSegment, ReferencePath
from ur_cartesian_driver.motion.primitive import Joints, SwitchOutput
from ur_cartesian_driver.motion.robot_state import RobotState
from ur_cartesian_driver.planning.append.appendable_goal import (
    AppendableGoal,
    AppendedPoints,
    check_appended_points,
    numbered,
    ReplannablePoint,
)
from ur_cartesian_driver.planning.geometry.curves import tcp_rows
from ur_cartesian_driver.planning.geometry.pose_rows import keep_hemisphere
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.output_placement import place_outputs
from ur_cartesian_driver.planning.planner import plan as plan_goal
from ur_cartesian_driver.planning.request.controlled_frame import retarget_to_tcp, tool_tips
from ur_cartesian_driver.planning.request.ignored_fields import ignored_remarks
from ur_cartesian_driver.planning.request.validate import check
from ur_cartesian_driver.planning.spline.spline_planner import (
    end_state,
    plan_spline,
    plan_stop,
    SplineState,
)
from ur_cartesian_driver.planning.spline.spline_points import point_remarks

#: Number of points that are planned again with the next ones: the last, which is held back, and
#: the one whose blend leads into its motion.
REPLANNED_POINTS = 2
#: Times that differ by less are the same [s].
SAME_TIME = 1e-6
#: Delays after which a spline may start again from rest [s]; the first possible one is taken.
START_DELAYS = (0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
#: Rows of the reference path along a stopping piece.
_STOP_ROWS = 16
# Digits of a client's time [s]: nanoseconds.
_DIGITS = 9
#: The numbers of points in sentences of the planner.
_NUMBER = re.compile(r'\b(point |points\[|segments\[)(\d+)')


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AppendPlan:
    """The plan of appended points, which passed all checks."""

    #: Its segments including the ending; its reference path is in motion time.
    plan: Plan
    #: How many records stay before it, and when they end [s].
    records_before: int
    start_time: float
    #: How many of its records are the ending.
    ending_records: int
    #: When it ends, if the goal has times [s].
    end_time: float | None
    #: The answer to the client.
    text: str
    #: The goal to which the next points are appended.
    next_goal: AppendableGoal


def plan_first_part(plan: Plan, arm: Arm, options: PlanningOptions) -> AppendPlan:
    """Return the first part of a goal, with its ending."""
    goal = plan.goal
    base = AppendableGoal(
        goal=replace(
            goal, waypoints=(), segments=(), io_commands=(), age=None, execution=plan.execution
        ),
        T_flange_active=plan.T_flange_active,
        T_flange_tcp=plan.T_flange_tcp,
        q_rest=plan.start,
    )
    appended = AppendedPoints(
        waypoints=goal.waypoints, segments=goal.segments, io_commands=goal.io_commands
    )
    if plan.execution.traits.is_spline:
        return _spline_append_plan(base, appended, plan, end_state(plan), 0, 0.0, arm, options)
    return _moves_append_plan(base, appended, plan, 0.0, 0)


def plan_append(
    appendable: AppendableGoal,
    appended: AppendedPoints,
    arm: Arm,
    options: PlanningOptions,
    *,
    from_rest: bool,
) -> AppendPlan:
    """
    Return the plan of appended points.

    :param from_rest: whether the ending was sent, so that the arm rests, or is about to.
    :raises GoalRefused: points are numbered from the start of the goal.
    """
    check_appended_points(appendable, appended, options)
    options = replace(
        options, max_approach_distance=0.0, max_points=options.max_points + REPLANNED_POINTS
    )
    if appendable.goal.execution.traits.is_spline:
        return _append_spline(appendable, appended, arm, options, from_rest)
    return _append_moves(appendable, appended, arm, options, from_rest)


# ---- motions of the robot -----------------------------------------------------------------------


def _append_moves(
    appendable: AppendableGoal,
    appended: AppendedPoints,
    arm: Arm,
    options: PlanningOptions,
    from_rest: bool,
) -> AppendPlan:
    if from_rest:
        appendable = replace(appendable, replannable=(), outputs=())
    replannable, start_time = (
        appendable.replannable,
        appendable.rest_time if from_rest else appendable.time,
    )
    q_start, last_client_time = (
        (replannable[0].q_before, replannable[0].time_before)
        if replannable
        else (appendable.q_rest, appendable.last_client_time)
    )
    waypoints = (*(points_known.waypoint for points_known in replannable), *appended.waypoints)
    segments = appended.segments or (Segment(),) * len(appended.waypoints)
    first = appendable.points - len(replannable)
    timed = any(point.time != 0.0 for point in waypoints)
    if timed:
        waypoints = tuple(
            replace(point, time=point.time - last_client_time) for point in waypoints
        )
    pending = max(len(replannable) - 1, 0)
    goal = replace(
        appendable.goal,
        waypoints=waypoints,
        segments=(*(k.segment for k in replannable), *segments),
        io_commands=_pending_commands(appendable, appended, first, pending, start_time),
        keep_open=not appended.last,
    )
    try:
        new_plan = plan_goal(goal, _state_at_rest(appendable, q_start, arm), arm, options)
    except GoalRefused as refusal:
        raise refusal.reworded(_renumber_text(str(refusal), first)) from None
    return _moves_append_plan(
        appendable,
        appended,
        _renumber_plan(
            new_plan,
            first,
            appendable.points - 1 if replannable else appendable.points,
            start_time,
        ),
        start_time,
        appendable.records if from_rest else appendable.committed_records,
    )


def _pending_commands(
    appendable: AppendableGoal,
    appended: AppendedPoints,
    first: int,
    pending: int,
    start_time: float,
) -> tuple[IOCommand, ...]:
    """Return the commands of a part, with those before it that are still due."""
    old = []
    for end_time, command in appendable.outputs:
        if command.waypoint == appendable.points - 1:
            old.append(replace(command, waypoint=command.waypoint - first))
        elif end_time > start_time and pending:
            old.append(replace(command, waypoint=pending - 1, offset=end_time - start_time))
    return (*old, *numbered(appended, first))


def _renumber_plan(new_plan: Plan, first: int, waypoint: int, start_time: float) -> Plan:
    """Return a plan without what leads to points before a waypoint, numbers and times shifted."""
    left_out = [s for s in new_plan.segments if s.waypoint + first < waypoint]
    begin = sum(segment.duration for segment in left_out)
    path = new_plan.reference
    path = replace(path, time=path.time + (start_time - begin), point=path.point + first)
    return replace(
        new_plan,
        segments=tuple(
            replace(
                s, waypoint=s.waypoint + first, report_line=_renumber_text(s.report_line, first)
            )
            for s in new_plan.segments[len(left_out) :]
        ),
        reference=_path_from(path, start_time, 0.5 * SAME_TIME),
    )


def _moves_append_plan(
    appendable: AppendableGoal,
    appended: AppendedPoints,
    new_plan: Plan,
    start_time: float,
    records_before: int,
) -> AppendPlan:
    """Return a part whose last motion is its ending."""
    *before, last = new_plan.segments
    count, ending_records = _record_count(new_plan.segments), _record_count((last,))
    time = start_time + sum(segment.duration for segment in before)
    end = time + last.duration
    segments = appended.segments or (Segment(),) * len(appended.waypoints)
    points = appendable.points + len(appended.waypoints)
    points_known = list(appendable.replannable) + [
        ReplannablePoint(
            waypoint=waypoint,
            segment=segment,
            q_before=appendable.q_rest,
            time_before=appendable.last_client_time,
        )
        for waypoint, segment in zip(appended.waypoints, segments, strict=True)
    ]
    arrived = {segment.waypoint: segment.joints for segment in new_plan.segments}
    replannable = [
        _with_start(points_known, k - len(points_known), arrived, points)
        for k in range(max(0, len(points_known) - REPLANNED_POINTS), len(points_known))
    ]
    last_client_time = appended.waypoints[-1].time
    timed = any(points_known.waypoint.time != 0.0 for points_known in replannable)
    next_goal = replace(
        appendable,
        points=points,
        records=records_before + count,
        committed_records=records_before + count - ending_records,
        time=time,
        rest_time=end,
        last_client_time=last_client_time,
        q_rest=last.joints,
        replannable=tuple(replannable),
        outputs=_commands_of_ending(appendable, appended, new_plan, start_time),
    )
    return AppendPlan(
        plan=replace(new_plan, goal=replace(new_plan.goal, keep_open=not appended.last)),
        records_before=records_before,
        start_time=start_time,
        ending_records=0 if appended.last else ending_records,
        end_time=end + _output_delay(last) if timed else None,
        text=_text(appendable, appended),
        next_goal=next_goal,
    )


def _with_start(
    points_known: Sequence[ReplannablePoint], k: int, arrived: dict[int, Joints], points: int
) -> ReplannablePoint:
    """Return a point (counted from the end) with where the arm was before it, if that is new."""
    here = points_known[k]
    q = arrived.get(points + k - 1)
    if q is None:
        return here
    return replace(here, q_before=q, time_before=points_known[k - 1].waypoint.time)


def _commands_of_ending(
    appendable: AppendableGoal, appended: AppendedPoints, new_plan: Plan, start_time: float
) -> tuple[tuple[float, IOCommand], ...]:
    """
    Return the commands whose records belong to the ending: the next part places them again.

    Records before the last motion are committed, even if they are due after the motion before it.
    Of commands for the same output the earlier ones have the earlier records.
    """
    ends = _end_times(new_plan.segments, start_time)
    commands = [
        *(
            (ends[c.waypoint] + c.offset if c.waypoint in ends else end_time, c)
            for end_time, c in appendable.outputs
        ),
        *((ends.get(c.waypoint, start_time) + c.offset, c) for c in appended.io_commands),
    ]
    committed_records = Counter(
        _output_key(record) for segment in new_plan.segments[:-1] for record in segment.outputs
    )
    still = []
    for end_time, command in sorted(commands, key=lambda one: one[0]):
        kind = _output_key(command)
        if committed_records[kind]:
            committed_records[kind] -= 1
        else:
            still.append((end_time, command))
    return tuple(still)


def _output_key(output: IOCommand | SwitchOutput) -> tuple[object, ...]:
    return output.output, output.pin, output.value, output.domain


# ---- splines ------------------------------------------------------------------------------------


def _append_spline(
    appendable: AppendableGoal,
    appended: AppendedPoints,
    arm: Arm,
    options: PlanningOptions,
    from_rest: bool,
) -> AppendPlan:
    """Return the part after the end of a spline; from rest as soon as the limits allow."""
    assert appendable.state is not None
    start, records_before = appendable.state, appendable.committed_records
    time_offsets = [appendable.time_offset]
    if from_rest:
        start = SplineState(time=appendable.rest_time, q=appendable.q_rest)
        records_before = appendable.records
        time_offsets = [
            appendable.rest_time + delay - appendable.last_client_time for delay in START_DELAYS
        ]
        appendable = replace(appendable, replanned_piece=None, outputs=())
    refusals = []
    for time_offset in time_offsets:
        try:
            return _append_spline_from(
                appendable, appended, start, records_before, time_offset, arm, options
            )
        except GoalRefused as refusal:
            refusals.append(refusal)
    raise refusals[-1]


def _append_spline_from(
    appendable: AppendableGoal,
    appended: AppendedPoints,
    start: SplineState,
    records_before: int,
    time_offset: float,
    arm: Arm,
    options: PlanningOptions,
) -> AppendPlan:
    # Times count from the last point: the first one is the time of its segment.
    waypoints = tuple(
        replace(point, time=round(point.time - appendable.last_client_time, _DIGITS))
        for point in appended.waypoints
    )
    goal = replace(
        appendable.goal,
        waypoints=waypoints,
        segments=appended.segments,
        io_commands=numbered(appended, appendable.points),
        keep_open=not appended.last,
    )
    state = _state_at_rest(appendable, start.q, arm)
    try:
        check(goal, options)
        retargeted = retarget_to_tcp(goal, state, options).goal
        later = replace(
            retargeted,
            waypoints=tuple(
                replace(point, time=point.time + appendable.last_client_time + time_offset)
                for point in retargeted.waypoints
            ),
        )
    except GoalRefused as refusal:
        raise refusal.reworded(_renumber_text(str(refusal), appendable.points)) from None
    found = plan_spline(
        start,
        later,
        arm,
        appendable.T_flange_tcp or appendable.T_flange_active,
        options,
        first=appendable.points,
        tool_tips=tool_tips(goal, appendable.T_flange_active),
    )
    segments, reference, start_time = found.segments, found.reference, start.time
    if appendable.replanned_piece is not None:
        replanned_piece, pending_path = appendable.replanned_piece
        segments, start_time = (replanned_piece, *segments), start.time - replanned_piece.duration
        reference = _join_paths(pending_path, reference)
    new_plan = Plan(
        goal=later,
        segments=segments,
        reference=reference,
        start=start.q,
        T_flange_active=appendable.T_flange_active,
        T_flange_tcp=appendable.T_flange_tcp,
        execution=appendable.goal.execution,
        remarks=found.remarks,
    )
    return _spline_append_plan(
        replace(appendable, time_offset=time_offset),
        appended,
        new_plan,
        found.end,
        records_before,
        start_time,
        arm,
        options,
    )


def _spline_append_plan(
    appendable: AppendableGoal,
    appended: AppendedPoints,
    new_plan: Plan,
    end: SplineState,
    records_before: int,
    start_time: float,
    arm: Arm,
    options: PlanningOptions,
) -> AppendPlan:
    """
    Return a part whose ending is a stopping piece, if the arm moves at its last point.

    If outputs are due at the last point or later, the piece to that point belongs to the ending
    too: they follow it on the wire, and their trigger poses depend on the next points.
    """
    point, plan_to_point = appendable.points + len(appended.waypoints) - 1, new_plan
    rest_time, q_rest = end.time, end.q
    if end.is_moving and not appended.last:
        new_plan = _with_stop(new_plan, end, point, arm, appendable, options)
        rest_time, q_rest = end.time + new_plan.segments[-1].duration, new_plan.segments[-1].joints
    new_plan, due_commands = _place_outputs(appendable, appended, new_plan, start_time)
    pending = tuple(
        (time, command)
        for time, command in due_commands
        if time >= end.time - SAME_TIME and not appended.last
    )
    committed_records = len(plan_to_point.segments) - (1 if pending else 0)
    count, ending_records = (
        _record_count(new_plan.segments),
        _record_count(new_plan.segments[committed_records:]),
    )
    if appended.last:
        ending_records = 0
    replanned_piece = (plan_to_point.segments[-1], plan_to_point.reference) if pending else None
    next_goal = replace(
        appendable,
        points=point + 1,
        records=records_before + count,
        committed_records=records_before + count - ending_records,
        time=end.time - (replanned_piece[0].duration if replanned_piece else 0.0),
        rest_time=rest_time,
        last_client_time=appended.waypoints[-1].time,
        q_rest=q_rest,
        state=end,
        outputs=pending,
        replanned_piece=replanned_piece
        and (
            replanned_piece[0],
            _path_from(replanned_piece[1], end.time - replanned_piece[0].duration),
        ),
    )
    return AppendPlan(
        plan=replace(new_plan, goal=replace(new_plan.goal, keep_open=not appended.last)),
        records_before=records_before,
        start_time=start_time,
        ending_records=ending_records,
        end_time=rest_time + _output_delay(new_plan.segments[-1]),
        text=_text(appendable, appended),
        next_goal=next_goal,
    )


def _place_outputs(
    appendable: AppendableGoal, appended: AppendedPoints, new_plan: Plan, start_time: float
) -> tuple[Plan, list[tuple[float, IOCommand]]]:
    """Return a plan of pieces with its outputs, and when each command is due [s]."""
    # A stopping piece leads to no point: what is due on it is due after the last one.
    last = new_plan.segments[-1]
    closes = not last.report_line and last.length == 0.0
    segments = [replace(segment, outputs=()) for segment in new_plan.segments]
    if closes:
        segments[-1] = replace(segments[-1], waypoint=last.waypoint + 1)
    ends = _end_times(segments, start_time)
    first = segments[0].waypoint
    due_commands = [
        *appendable.outputs,
        *((ends[command.waypoint] + command.offset, command) for command in appended.io_commands),
    ]
    found = place_outputs(
        segments,
        new_plan.reference,
        [
            replace(
                command,
                waypoint=max(command.waypoint, first),
                offset=max(0.0, time - ends[max(command.waypoint, first)]),
            )
            for time, command in due_commands
        ],
        start_time=start_time,
    )
    return replace(
        new_plan,
        segments=tuple(
            replace(segment, waypoint=old.waypoint, report_line=old.report_line)
            for segment, old in zip(found, new_plan.segments, strict=True)
        ),
    ), due_commands


def _path_from(
    path: ReferencePath, start_time: float, tolerance: float = SAME_TIME
) -> ReferencePath:
    """Return the rows of a path from a time on [s]; copies, so that the others can go."""
    row = max(int(np.searchsorted(path.time, start_time + tolerance, side='right')) - 1, 0)
    return ReferencePath(
        poses=path.poses[row:].copy(),
        time=path.time[row:].copy(),
        point=path.point[row:].copy(),
        blend_tolerance=path.blend_tolerance[row:].copy(),
    )


def _join_paths(first: ReferencePath, second: ReferencePath) -> ReferencePath:
    """Return two paths as one; the second begins where the first ends."""
    poses = np.concatenate([first.poses, second.poses[1:]])
    keep_hemisphere(poses)
    return ReferencePath(
        poses=poses,
        time=np.concatenate([first.time, second.time[1:]]),
        point=np.concatenate([first.point, second.point[1:]]),
        blend_tolerance=np.concatenate([first.blend_tolerance, second.blend_tolerance[1:]]),
    )


def _with_stop(
    new_plan: Plan,
    end: SplineState,
    point: int,
    arm: Arm,
    appendable: AppendableGoal,
    options: PlanningOptions,
) -> Plan:
    """Return a plan with the piece that brings the arm to rest."""
    piece = plan_stop(end, arm, options.keep_open_deceleration)
    times = np.linspace(0.0, piece.duration, _STOP_ROWS + 1)[1:]
    q, _, _ = JointSpline.of(end.q, [piece], velocities=end.qd, accelerations=end.qdd).rows(times)
    path = new_plan.reference
    poses = np.concatenate(
        [path.poses, tcp_rows(arm, appendable.T_flange_tcp or appendable.T_flange_active, q)]
    )
    keep_hemisphere(poses)
    return replace(
        new_plan,
        segments=(
            *new_plan.segments,
            PlannedSegment(
                primitive=piece,
                waypoint=point,
                length=0.0,
                angle=0.0,
                duration=piece.duration,
                joints=piece.target if isinstance(piece.target, tuple) else end.q,
                report_line='',
            ),
        ),
        reference=ReferencePath(
            poses=poses,
            time=np.concatenate([path.time, end.time + times]),
            point=np.concatenate([path.point, np.full(len(times), point, dtype=np.int32)]),
        ),
    )


# ---- both ---------------------------------------------------------------------------------------


def _state_at_rest(appendable: AppendableGoal, q: Joints, arm: Arm) -> RobotState:
    """Return the state of a robot at rest in a configuration of the goal."""
    pose = arm.forward(q) @ appendable.T_flange_active
    return RobotState(
        timestamp=0.0,
        actual_q=q,
        target_q=q,
        actual_tcp_pose=pose,
        target_tcp_pose=pose,
        T_flange_tcp=appendable.T_flange_active,
    )


def _end_times(segments: Iterable[PlannedSegment], start_time: float) -> dict[int, float]:
    """Return when the motion to each waypoint ends [s]."""
    ends, now = {}, start_time
    for segment in segments:
        now += segment.duration
        ends[segment.waypoint] = now
    return ends


def _output_delay(last: PlannedSegment) -> float:
    """Return how long the robot program waits after a motion for its outputs [s]."""
    return max((output.delay for output in last.outputs), default=0.0)


def _record_count(segments: Sequence[PlannedSegment]) -> int:
    return sum(1 + len(segment.outputs) for segment in segments)


def _renumber_text(text: str, first: int) -> str:
    """Return a text whose points are numbered from the start of the goal."""
    return _NUMBER.sub(lambda found: f'{found[1]}{int(found[2]) + first}', text)


def _text(appendable: AppendableGoal, appended: AppendedPoints) -> str:
    count = len(appended.waypoints)
    points = 'point' if count == 1 else 'points'
    end = ', these are the last' if appended.last else ''
    return ' '.join(
        [
            f'{count} {points} appended, the goal has {appendable.points + count}{end}.',
            *(
                f'{remark[:1].upper()}{remark[1:]}.'
                for remark in _append_remarks(appendable, appended)
            ),
        ]
    )


def _append_remarks(appendable: AppendableGoal, appended: AppendedPoints) -> list[str]:
    """Return remarks on fields of appended points that have no effect."""
    goal = replace(
        appendable.goal,
        waypoints=appended.waypoints,
        segments=appended.segments,
        keep_open=not appended.last,
    )
    return (point_remarks if goal.execution.traits.is_spline else ignored_remarks)(
        goal, appendable.points
    )
