# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Goals that go on (keep_open): part by part, each from where the one before leads.

The last motion of a part is planned to end at rest, because nobody knows what comes, and may be
given up: the driver keeps it back as the *ending* of the goal. When points come in time, it is
planned again together with them, so that a blend or a spline goes through its end. Otherwise it
was sent, the arm rests behind it, and the next part begins there.

A straight motion is planned again with the two before it as context: its corner depends on them.
A spline needs none, for its state at a point is position, velocity and acceleration; its ending
is a piece that brakes behind the last point (:func:`~.spline_plan.closing`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
import re

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.errors import GoalRefused
from ur_cartesian_driver.motion.goal import ExecutionMode, IOCommand, Segment
from ur_cartesian_driver.motion.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan import Plan, PlannedSegment, ReferencePath
from ur_cartesian_driver.motion.primitive import Joints, SwitchOutput
from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.planning.controlled import carried, tools
from ur_cartesian_driver.planning.open_goal import (
    Addition,
    check_addition,
    Known,
    numbered,
    OpenGoal,
)
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.outputs import with_outputs
from ur_cartesian_driver.planning.path import tcp_rows
from ur_cartesian_driver.planning.plan import plan as plan_goal
from ur_cartesian_driver.planning.reference import keep_hemisphere
from ur_cartesian_driver.planning.report import ignored
from ur_cartesian_driver.planning.spline_plan import closing, end_state, plan_pieces, SplineState
from ur_cartesian_driver.planning.spline_points import remarks as point_remarks
from ur_cartesian_driver.planning.validate import check

#: So many of the last points are planned again with the next ones: the one that is kept back, and
#: one whose corner leads into its motion.
CONTEXT = 2
#: Two times nearer than this are one [s].
SAME_TIME = 1e-6
#: How much later than at once a spline may begin again from rest [s]: the first that is possible.
LEADS = (0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
#: Rows of the reference along a closing piece.
_CLOSING_ROWS = 16
# Digits of a time that a client says [s]: nanoseconds.
_DIGITS = 9
#: What counts points in a sentence of the planner.
_NUMBER = re.compile(r'\b(point |points\[|segments\[)(\d+)')


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Part:
    """A part of an open goal that has passed all checks."""

    #: Its segments, the ending among them, and its reference in the time of the whole motion.
    plan: Plan
    #: How many records stay in front of it, and when they end [s].
    behind: int
    since: float
    #: How many of its records are the ending.
    ending: int
    #: When it ends, where the goal says times [s].
    due: float | None
    #: What the client is told.
    text: str
    #: For the next part.
    then: OpenGoal


def opened(plan: Plan, arm: Arm, options: PlanningOptions) -> Part:
    """Return the first part of a goal: its plan, and how it ends for now."""
    goal = plan.goal
    base = OpenGoal(
        goal=replace(
            goal, waypoints=(), segments=(), io_commands=(), age=None, execution=plan.execution
        ),
        T_flange_active=plan.T_flange_active,
        T_flange_tcp=plan.T_flange_tcp,
        points=0,
        records=0,
        firm=0,
        time=0.0,
        rest_time=0.0,
        shift=0.0,
        told=0.0,
        q_rest=plan.start,
    )
    addition = Addition(
        waypoints=goal.waypoints, segments=goal.segments, io_commands=goal.io_commands
    )
    if plan.execution is ExecutionMode.SPLINE:
        return _spline_part(base, addition, plan, end_state(plan), 0, 0.0, arm, options)
    return _moves_part(base, addition, plan, 0.0, 0)


def following(
    open_goal: OpenGoal, addition: Addition, arm: Arm, options: PlanningOptions, *, from_rest: bool
) -> Part:
    """
    Return the part of a goal that goes on with an addition.

    :param from_rest: whether the ending was sent, so that the arm stands, or is about to.
    :raises GoalRefused: with the reason; points are numbered from the start of the goal.
    """
    check_addition(open_goal, addition, options)
    options = replace(options, max_approach_distance=0.0, max_points=options.max_points + CONTEXT)
    if open_goal.goal.execution is ExecutionMode.SPLINE:
        return _spline_on(open_goal, addition, arm, options, from_rest)
    return _moves_on(open_goal, addition, arm, options, from_rest)


# ---- motions of the robot -----------------------------------------------------------------------


def _moves_on(
    on: OpenGoal, addition: Addition, arm: Arm, options: PlanningOptions, from_rest: bool
) -> Part:
    if from_rest:
        on = replace(on, tail=(), outputs=())
    tail, since = on.tail, on.rest_time if from_rest else on.time
    q_start, told = (tail[0].q_before, tail[0].time_before) if tail else (on.q_rest, on.told)
    waypoints = (*(known.waypoint for known in tail), *addition.waypoints)
    segments = addition.segments or (Segment(),) * len(addition.waypoints)
    first = on.points - len(tail)
    timed = any(point.time != 0.0 for point in waypoints)
    if timed:
        waypoints = tuple(replace(point, time=point.time - told) for point in waypoints)
    pending = max(len(tail) - 1, 0)
    goal = replace(
        on.goal,
        waypoints=waypoints,
        segments=(*(k.segment for k in tail), *segments),
        io_commands=_outputs_due(on, addition, first, pending, since),
        keep_open=not addition.last,
    )
    try:
        made = plan_goal(goal, _standing(on, q_start, arm), arm, options)
    except GoalRefused as refusal:
        raise _renumbered(refusal, first) from None
    return _moves_part(
        on,
        addition,
        _moved(made, first, on.points - 1 if tail else on.points, since),
        since,
        on.records if from_rest else on.firm,
    )


def _outputs_due(
    on: OpenGoal, addition: Addition, first: int, pending: int, since: float
) -> tuple[IOCommand, ...]:
    """Return the commands of a part; those before it that are still due count from its start."""
    old = []
    for due, command in on.outputs:
        if command.waypoint == on.points - 1:
            old.append(replace(command, waypoint=command.waypoint - first))
        elif due > since and pending:
            old.append(replace(command, waypoint=pending - 1, offset=due - since))
    return (*old, *numbered(addition, first))


def _moved(made: Plan, first: int, waypoint: int, since: float) -> Plan:
    """Return a plan without what leads to points before a waypoint, numbers and times shifted."""
    left_out = [s for s in made.segments if s.waypoint + first < waypoint]
    begin = sum(segment.duration for segment in left_out)
    path = made.reference
    time = path.time + (since - begin)
    row = max(int(np.searchsorted(time, since + 5e-7, side='right')) - 1, 0)
    return replace(
        made,
        segments=tuple(
            replace(s, waypoint=s.waypoint + first, note=_shifted(s.note, first))
            for s in made.segments[len(left_out) :]
        ),
        reference=ReferencePath(
            poses=path.poses[row:].copy(),
            time=time[row:].copy(),
            point=(path.point[row:] + first).astype(np.int32),
            room=path.room[row:].copy(),
        ),
    )


def _moves_part(on: OpenGoal, addition: Addition, made: Plan, since: float, behind: int) -> Part:
    """Return a part whose last motion is its ending."""
    *before, last = made.segments
    count, ending = _records(made.segments), _records((last,))
    time = since + sum(segment.duration for segment in before)
    end = time + last.duration
    segments = addition.segments or (Segment(),) * len(addition.waypoints)
    points = on.points + len(addition.waypoints)
    known = list(on.tail) + [
        Known(waypoint=waypoint, segment=segment, q_before=on.q_rest, time_before=on.told)
        for waypoint, segment in zip(addition.waypoints, segments, strict=True)
    ]
    arrived = {segment.waypoint: segment.joints for segment in made.segments}
    tail = [
        _seen(known, k - len(known), arrived, points)
        for k in range(max(0, len(known) - CONTEXT), len(known))
    ]
    told = addition.waypoints[-1].time
    timed = any(known.waypoint.time != 0.0 for known in tail)
    then = replace(
        on,
        points=points,
        records=behind + count,
        firm=behind + count - ending,
        time=time,
        rest_time=end,
        told=told,
        q_rest=last.joints,
        tail=tuple(tail),
        outputs=_still_due(on, addition, made, since),
    )
    return Part(
        plan=replace(made, goal=replace(made.goal, keep_open=not addition.last)),
        behind=behind,
        since=since,
        ending=0 if addition.last else ending,
        due=end + _waits(last) if timed else None,
        text=_text(on, addition),
        then=then,
    )


def _seen(known: Sequence[Known], k: int, arrived: dict[int, Joints], points: int) -> Known:
    """Return a point (counted from the end) with where the arm was before it, if that is new."""
    here = known[k]
    q = arrived.get(points + k - 1)
    if q is None:
        return here
    return replace(here, q_before=q, time_before=known[k - 1].waypoint.time)


def _still_due(
    on: OpenGoal, addition: Addition, made: Plan, since: float
) -> tuple[tuple[float, IOCommand], ...]:
    """
    Return the commands whose records belong to the ending: the next part looks at them again.

    Not those that are due later than the last firm motion ends: one that comes before the motion
    behind it returns stands in front of that, and is firm. The earlier ones of the same kind are
    those with the earlier records.
    """
    ends, now = {}, since
    for segment in made.segments:
        now += segment.duration
        ends[segment.waypoint] = now
    commands = [
        *(
            (ends[c.waypoint] + c.offset if c.waypoint in ends else due, c)
            for due, c in on.outputs
        ),
        *((ends.get(c.waypoint, since) + c.offset, c) for c in addition.io_commands),
    ]
    firm = Counter(_kind(record) for segment in made.segments[:-1] for record in segment.outputs)
    still = []
    for due, command in sorted(commands, key=lambda one: one[0]):
        kind = _kind(command)
        if firm[kind]:
            firm[kind] -= 1
        else:
            still.append((due, command))
    return tuple(still)


def _kind(output: IOCommand | SwitchOutput) -> tuple[object, ...]:
    return output.output, output.pin, output.value, output.domain


# ---- splines ------------------------------------------------------------------------------------


def _spline_on(
    on: OpenGoal, addition: Addition, arm: Arm, options: PlanningOptions, from_rest: bool
) -> Part:
    """Return the part behind the end of a spline; from rest as soon as the limits allow."""
    assert on.state is not None
    if not from_rest:
        return _spline_behind(on, addition, on.state, on.firm, on.shift, arm, options)
    start = SplineState(time=on.rest_time, q=on.q_rest)
    on = replace(on, again=None, outputs=())
    refusals = []
    for lead in LEADS:
        try:
            return _spline_behind(
                on, addition, start, on.records, on.rest_time + lead - on.told, arm, options
            )
        except GoalRefused as refusal:
            refusals.append(refusal)
    raise refusals[-1]


def _spline_behind(
    on: OpenGoal,
    addition: Addition,
    start: SplineState,
    behind: int,
    shift: float,
    arm: Arm,
    options: PlanningOptions,
) -> Part:
    # Times count from the last point, so that they say how long the first segment is.
    waypoints = tuple(
        replace(point, time=round(point.time - on.told, _DIGITS)) for point in addition.waypoints
    )
    goal = replace(
        on.goal,
        waypoints=waypoints,
        segments=addition.segments,
        io_commands=numbered(addition, on.points),
        keep_open=not addition.last,
    )
    standing = _standing(on, start.q, arm)
    try:
        check(goal, options)
        about = carried(goal, standing, options).goal
        later = replace(
            about,
            waypoints=tuple(
                replace(point, time=point.time + on.told + shift) for point in about.waypoints
            ),
        )
    except GoalRefused as refusal:
        raise _renumbered(refusal, on.points) from None
    found = plan_pieces(
        start,
        later,
        arm,
        on.T_flange_tcp or on.T_flange_active,
        options,
        first=on.points,
        tools=tools(goal, on.T_flange_active),
    )
    segments, reference, since = found.segments, found.reference, start.time
    if on.again is not None:
        again, way = on.again
        segments, since = (again, *segments), start.time - again.duration
        reference = _joined(way, reference)
    made = Plan(
        goal=later,
        segments=segments,
        reference=reference,
        start=start.q,
        T_flange_active=on.T_flange_active,
        T_flange_tcp=on.T_flange_tcp,
        execution=ExecutionMode.SPLINE,
        remarks=found.remarks,
    )
    return _spline_part(
        replace(on, shift=shift), addition, made, found.end, behind, since, arm, options
    )


def _spline_part(
    on: OpenGoal,
    addition: Addition,
    made: Plan,
    end: SplineState,
    behind: int,
    since: float,
    arm: Arm,
    options: PlanningOptions,
) -> Part:
    """
    Return a part whose ending is a piece to rest, where its last point moves.

    Where outputs are due at the last point or later, the piece to that point belongs to the ending
    too: they stand behind it on the wire, and where each of them is depends on what comes.
    """
    point, known = on.points + len(addition.waypoints) - 1, made
    rest_time, q_rest = end.time, end.q
    if end.moves and not addition.last:
        made = _closed(made, end, point, arm, on, options)
        rest_time, q_rest = end.time + made.segments[-1].duration, made.segments[-1].joints
    made, due = _with_outputs(on, addition, made, since)
    pending = tuple(
        (time, command)
        for time, command in due
        if time >= end.time - SAME_TIME and not addition.last
    )
    firm = len(known.segments) - (1 if pending else 0)
    count, ending = _records(made.segments), _records(made.segments[firm:])
    if addition.last:
        ending = 0
    again = (known.segments[-1], known.reference) if pending else None
    then = replace(
        on,
        points=point + 1,
        records=behind + count,
        firm=behind + count - ending,
        time=end.time - (again[0].duration if again else 0.0),
        rest_time=rest_time,
        told=addition.waypoints[-1].time,
        q_rest=q_rest,
        state=end,
        outputs=pending,
        again=again and (again[0], _tail_of(again[1], end.time - again[0].duration)),
    )
    return Part(
        plan=replace(made, goal=replace(made.goal, keep_open=not addition.last)),
        behind=behind,
        since=since,
        ending=ending,
        due=rest_time + _waits(made.segments[-1]),
        text=_text(on, addition),
        then=then,
    )


def _with_outputs(
    on: OpenGoal, addition: Addition, made: Plan, since: float
) -> tuple[Plan, list[tuple[float, IOCommand]]]:
    """Return a plan of pieces with the outputs on its way, and when each command is due [s]."""
    ends, now = {}, since
    # A piece to rest leads to no point: what is due on it is due behind the last one.
    last = made.segments[-1]
    closes = not last.note and last.length == 0.0
    segments = [replace(segment, outputs=()) for segment in made.segments]
    if closes:
        segments[-1] = replace(segments[-1], waypoint=last.waypoint + 1)
    for segment in segments:
        now += segment.duration
        ends[segment.waypoint] = now
    first = segments[0].waypoint
    due = [
        *on.outputs,
        *((ends[command.waypoint] + command.offset, command) for command in addition.io_commands),
    ]
    found = with_outputs(
        segments,
        made.reference,
        [
            replace(
                command,
                waypoint=max(command.waypoint, first),
                offset=max(0.0, time - ends[max(command.waypoint, first)]),
            )
            for time, command in due
        ],
        since=since,
    )
    return replace(
        made,
        segments=tuple(
            replace(segment, waypoint=old.waypoint, note=old.note)
            for segment, old in zip(found, made.segments, strict=True)
        ),
    ), due


def _tail_of(path: ReferencePath, since: float) -> ReferencePath:
    """Return the rows of a path from a time on [s]."""
    row = max(int(np.searchsorted(path.time, since + SAME_TIME, side='right')) - 1, 0)
    return ReferencePath(
        poses=path.poses[row:].copy(),
        time=path.time[row:].copy(),
        point=path.point[row:].copy(),
        room=path.room[row:].copy(),
    )


def _joined(first: ReferencePath, second: ReferencePath) -> ReferencePath:
    """Return two paths as one; the second begins where the first ends."""
    poses = np.concatenate([first.poses, second.poses[1:]])
    keep_hemisphere(poses)
    return ReferencePath(
        poses=poses,
        time=np.concatenate([first.time, second.time[1:]]),
        point=np.concatenate([first.point, second.point[1:]]),
        room=np.concatenate([first.room, second.room[1:]]),
    )


def _closed(
    made: Plan, end: SplineState, point: int, arm: Arm, on: OpenGoal, options: PlanningOptions
) -> Plan:
    """Return a plan with the piece that brings it to rest."""
    piece = closing(end, arm, options.closing_deceleration)
    times = np.linspace(0.0, piece.duration, _CLOSING_ROWS + 1)[1:]
    q, _, _ = JointSpline.of(end.q, [piece], velocities=end.qd, accelerations=end.qdd).rows(times)
    path = made.reference
    poses = np.concatenate([path.poses, tcp_rows(arm, on.T_flange_tcp or on.T_flange_active, q)])
    keep_hemisphere(poses)
    return replace(
        made,
        segments=(
            *made.segments,
            PlannedSegment(
                primitive=piece,
                waypoint=point,
                length=0.0,
                angle=0.0,
                duration=piece.duration,
                joints=piece.target if isinstance(piece.target, tuple) else end.q,
                note='',
            ),
        ),
        reference=ReferencePath(
            poses=poses,
            time=np.concatenate([path.time, end.time + times]),
            point=np.concatenate([path.point, np.full(len(times), point, dtype=np.int32)]),
        ),
    )


# ---- both ---------------------------------------------------------------------------------------


def _standing(on: OpenGoal, q: Joints, arm: Arm) -> RobotState:
    """Return the state of a robot that rests somewhere on the way."""
    pose = arm.forward(q) @ on.T_flange_active
    return RobotState(
        timestamp=0.0,
        actual_q=q,
        target_q=q,
        actual_tcp_pose=pose,
        target_tcp_pose=pose,
        T_flange_tcp=on.T_flange_active,
    )


def _waits(last: PlannedSegment) -> float:
    """Return how long the robot program waits behind a motion for its outputs [s]."""
    return max((output.delay for output in last.outputs), default=0.0)


def _records(segments: Sequence[PlannedSegment]) -> int:
    return sum(1 + len(segment.outputs) for segment in segments)


def _renumbered(refusal: GoalRefused, first: int) -> GoalRefused:
    """Return a refusal whose points are numbered from the start of the goal."""
    error = type(refusal).__new__(type(refusal))
    Exception.__init__(error, _shifted(str(refusal), first))
    return error


def _shifted(text: str, first: int) -> str:
    return _NUMBER.sub(lambda found: f'{found[1]}{int(found[2]) + first}', text)


def _text(on: OpenGoal, addition: Addition) -> str:
    count = len(addition.waypoints)
    points = 'point' if count == 1 else 'points'
    end = ', these are the last' if addition.last else ''
    return ' '.join(
        [
            f'{count} {points} appended, the goal has {on.points + count}{end}.',
            *(f'{remark[:1].upper()}{remark[1:]}.' for remark in _ignored(on, addition)),
        ]
    )


def _ignored(on: OpenGoal, addition: Addition) -> list[str]:
    """Return what is to be said of points that ask for what is not done."""
    goal = replace(
        on.goal,
        waypoints=addition.waypoints,
        segments=addition.segments,
        keep_open=not addition.last,
    )
    return (point_remarks if goal.execution is ExecutionMode.SPLINE else ignored)(goal, on.points)
