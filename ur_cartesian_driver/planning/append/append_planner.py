# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Plan, part by part, a goal to which points are appended while it runs (keep_open).

The last motion of a part is planned to end at rest, because the next point is unknown. The driver
holds this motion back as the *ending* of the goal. If points come in time, the ending is planned
again together with them, so that a blend or a spline passes through its end. Otherwise the ending
is sent, the arm comes to rest, and the next part begins there.

Primitives are planned together with the last two points before them, because blends depend on
these. A spline needs no such context, as position, velocity and acceleration are its whole state;
the ending of a spline is a piece that brakes after the last point
(:func:`~ur_cartesian_driver.planning.spline.spline_planner.plan_stop`).

A *record* is one instruction for the robot program. A record is *committed* if the robot executes
it whatever points come later: the records of the ending are not committed. See
:mod:`~.appendable_goal` for client time and motion time.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
import re

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.errors import GoalRefused, InvalidGoal, TooFast
from ur_cartesian_driver.motion.geometry.arrays import Floats, Int32s
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.motion.goal.goal import IOCommand, PulseTrain, Segment
from ur_cartesian_driver.motion.goal.goal_columns import goal_table, GoalTable, WaypointRows
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline, SAME_TIME
from ur_cartesian_driver.motion.plan.move_rows import SplineRows
from ur_cartesian_driver.motion.plan.plan import (
    LateLines,
    Plan,
    PlannedRows,
    PlannedSegment,
    ReferencePath,
)
from ur_cartesian_driver.motion.plan.primitive import SwitchOutput
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.append.appendable_goal import (
    AppendableGoal,
    AppendedPoints,
    check_appended_points,
    numbered,
    ReplannablePoint,
)
from ur_cartesian_driver.planning.append.planned_part import PlannedPart, unreported_piece
from ur_cartesian_driver.planning.append.replaced_tail import cut_tail, cut_time, state_at
from ur_cartesian_driver.planning.options import MAX_POINTS, PlanningOptions
from ur_cartesian_driver.planning.output_placement import place_outputs
from ur_cartesian_driver.planning.planner import plan as plan_goal
from ur_cartesian_driver.planning.request.controlled_frame import retarget_to_tcp, tool_tips
from ur_cartesian_driver.planning.request.field_rules import check_record
from ur_cartesian_driver.planning.request.ignored_fields import ignored_remarks
from ur_cartesian_driver.planning.request.joint_points import check_for_arm
from ur_cartesian_driver.planning.request.point_events.path_clock import PathClock
from ur_cartesian_driver.planning.request.point_events.pulses import check_speed, Pulses
from ur_cartesian_driver.planning.request.point_events.switched_outputs import SwitchedOutputs
from ur_cartesian_driver.planning.request.point_events.timed_path import TimedPath
from ur_cartesian_driver.planning.spline.spline_planner import (
    end_state,
    plan_spline,
    plan_stop,
    rows_along,
    SplineState,
)
from ur_cartesian_driver.planning.spline.spline_points import point_remarks
from ur_cartesian_driver.planning.stop_prediction import state_at_rest

#: Number of points that are planned again with the next ones: the last point, whose motion is held
#: back, and the one before it, whose blend leads into that motion.
REPLANNED_POINTS = 2
#: Delays [s] to try for the start of a spline from rest; the first with a valid plan is used.
START_DELAYS = (0.0, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0)
#: Number of steps of the reference path along a stopping piece.
_STOP_ROWS = 16
# Decimal places of a client's times [s]: nanoseconds.
_DIGITS = 9
#: Pattern of the numbers of points and segments in texts of the planner.
_NUMBER = re.compile(r'\b(point |points\[|segments\[)(\d+)')
_COMMAND = re.compile(r'\b(io_commands\[)(\d+)')


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class AppendPlan:
    """The plan of appended points that passed all checks."""

    #: The plan, including the ending; the times of its reference path are motion times.
    plan: Plan
    #: Number of records of the goal before the records of this plan.
    records_before: int
    #: Motion time at which those earlier records end [s].
    start_time: float
    #: Number of records of this plan that belong to the ending.
    ending_records: int
    #: Motion time at which this plan ends [s]; None = the goal has no times.
    end_time: float | None
    #: The joints over motion time; None = the goal is no spline.
    spline: JointSpline | None = None
    #: Motion time at which a spline departs from the previous plan, whose tail it replaces [s];
    #: None = it continues from the last point of the previous plan.
    cut_time: float | None = None
    #: The answer to the client.
    text: str
    #: The goal to which the next points are appended.
    next_goal: AppendableGoal


def plan_first_part(plan: Plan, arm: Arm, options: PlanningOptions) -> AppendPlan:
    """Return the first part of a goal, with its ending, from the plan of the goal."""
    goal = plan.goal
    pulses = Pulses().of(goal)
    base = AppendableGoal(
        goal=replace(
            goal,
            waypoints=(),
            segments=(),
            io_commands=(),
            pulses=(),
            age=None,
            execution=plan.execution,
        ),
        pulses=tuple((f'pulses[{i}]', each) for i, each in enumerate(pulses) if each.goes_on),
        T_flange_active=plan.T_flange_active,
        T_flange_tcp=plan.T_flange_tcp,
        q_rest=plan.start,
    )
    appended = AppendedPoints(
        waypoints=goal.waypoints, segments=goal.segments, io_commands=goal.io_commands
    )
    planner = _PartPlanner(base, appended, arm, options)
    if plan.execution.traits.is_spline:
        begin = SplineState(q=plan.start)
        return planner.spline_part(plan, begin, end_state(plan), 0, pulses)
    return planner.moves_part(plan, 0, 0.0)


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

    :param from_rest: whether the ending was sent, so that the arm is or will be at rest.
    :raises GoalRefused: the points cannot be executed; the error message numbers points from the
        start of the goal.
    """
    for i, command in enumerate(appended.io_commands):
        check_record(f'io_commands[{i}]', command)
    appended = replace(appended, io_commands=options.lead_times(appended.io_commands))
    before, cut = appendable, None
    appendable = cut_tail(before, cut_time(before, appended), arm)
    if appendable is not before:
        assert appendable.state is not None
        cut, from_rest = appendable.state.time, False
    check_appended_points(appendable, appended, options)
    time, records_before = appendable.time, appendable.committed_records
    if from_rest:
        time, records_before = appendable.rest_time, appendable.records
        appendable = replace(appendable, replannable=(), replanned=None, outputs=())
    planner = _PartPlanner(appendable, appended, arm, options)
    if not appendable.goal.execution.traits.is_spline:
        return planner.append_moves(records_before, time)
    if not from_rest:
        assert appendable.state is not None
        part = planner.append_spline(appendable.state, records_before, appendable.time_offset)
        return replace(part, cut_time=cut)
    rest = SplineState(time=time, q=appendable.q_rest)
    for delay in START_DELAYS:
        try:
            return planner.append_spline(
                rest, records_before, time + delay - appendable.last_client_time
            )
        except TooFast as refusal:  # more time remedies no other error
            last_refusal = refusal
    raise last_refusal


class _PartPlanner:
    """Plans one part of a goal, of robot motions or of spline pieces."""

    def __init__(
        self,
        appendable: AppendableGoal,
        appended: AppendedPoints,
        arm: Arm,
        options: PlanningOptions,
    ) -> None:
        self._before, self._appended, self._arm, self._options = appendable, appended, arm, options
        self._kinematics = appendable.kinematics(arm)
        self._segments = appended.segments or (Segment(),) * len(appended.waypoints)
        #: Number of points of the goal, this part included.
        self._points = appendable.points + len(appended.waypoints)

    # -- motions of the robot --------------------------------------------------------------------

    def append_moves(self, records_before: int, start_time: float) -> AppendPlan:
        """Return a part made of robot motions, planned with the last motions before the part."""
        before, appended = self._before, self._appended
        replannable, q_start = before.replannable, before.q_rest
        time_before = before.last_client_time
        if replannable:
            q_start, time_before = replannable[0].q_before, replannable[0].time_before
        first = before.points - len(replannable)
        waypoints = WaypointRows.of(
            (*(known.waypoint for known in replannable), *appended.waypoints)
        )
        if waypoints.times.any():
            waypoints = replace(waypoints, times=waypoints.times - time_before)
        goal = replace(
            before.goal,
            waypoints=waypoints,
            segments=(*(known.segment for known in replannable), *self._segments),
            io_commands=self._pending_commands(first, start_time),
            keep_open=not appended.last,
        )
        # Only the first point of a goal has to be near the arm.
        options = replace(
            self._options,
            max_approach_distance=0.0,
            max_points=min(self._options.max_points + REPLANNED_POINTS, MAX_POINTS),
        )
        # The first replanned motion has been sent, so planning starts from the blend after it.
        running = replannable[0].planned if len(replannable) == REPLANNED_POINTS else None
        try:
            plan = plan_goal(goal, self._at_rest(q_start), self._arm, options, running)
        except GoalRefused as refusal:
            raise refusal.reworded(_renumber_text(str(refusal), first)) from None
        start_time += _blend_half(plan.segments[0]) - _blend_half(running) if running else 0.0
        plan = _renumber_plan(plan, first, before.points - bool(replannable), start_time)
        return self.moves_part(plan, records_before, start_time)

    def _pending_commands(self, first: int, start_time: float) -> tuple[IOCommand, ...]:
        """
        Return the output commands of this part, and the earlier ones that are still due.

        They count the points of the goal from point ``first``, which has the number 0.
        """
        old = []
        # Index in ``replannable`` of the point whose motion is already committed; negative = none.
        committed = len(self._before.replannable) - 2
        for end_time, command in self._before.outputs:
            if command.waypoint == self._before.points - 1:
                old.append(replace(command, waypoint=command.waypoint - first))
            elif end_time > start_time and committed >= 0:
                old.append(replace(command, waypoint=committed, offset=end_time - start_time))
        return (*old, *numbered(self._appended, first))

    def moves_part(self, plan: Plan, records_before: int, start_time: float) -> AppendPlan:
        """Return a part made of robot motions, the last of which is the ending."""
        rows = plan.rows
        *durations, last = rows.durations.tolist()
        time = start_time + sum(durations)
        replannable = self._replannable(plan)
        timed = any(known.waypoint.time != 0.0 for known in replannable)
        next_goal = replace(
            self._before,
            time=time,
            rest_time=time + last,
            q_rest=vector6(rows.joints[-1].tolist()),
            replannable=replannable,
            outputs=self._commands_of_ending(plan, start_time),
        )
        return self._part(plan, records_before, start_time, 1, next_goal, timed=timed)

    def _replannable(self, plan: Plan) -> tuple[ReplannablePoint, ...]:
        """Return the last ``REPLANNED_POINTS`` points, with the state of the arm before each."""
        before = self._before
        known = list(before.replannable) + [
            ReplannablePoint(
                waypoint=waypoint,
                segment=segment,
                q_before=before.q_rest,
                time_before=before.last_client_time,
            )
            for waypoint, segment in zip(self._appended.waypoints, self._segments, strict=True)
        ]
        first = self._points - len(known)
        for segment in plan.segments:
            k = segment.waypoint - first
            if 0 <= k < len(known):
                known[k] = replace(known[k], planned=segment)
            k += 1
            if k < len(known):
                known[k] = replace(
                    known[k], q_before=segment.joints, time_before=known[k - 1].waypoint.time
                )
        return tuple(known[-REPLANNED_POINTS:])

    def _commands_of_ending(
        self, plan: Plan, start_time: float
    ) -> tuple[tuple[float, IOCommand], ...]:
        """
        Return the output commands whose records belong to the ending, each with its due time [s].

        The next part places them again. Records that precede the last motion are committed, even
        if they are due during it. Commands that set the same output to the same value have their
        records in the order of time, so the committed records belong to the earliest of them.
        """
        rows = plan.rows
        ends = _end_times(rows.waypoints, rows.durations, start_time)
        commands = [
            *(
                (ends[c.waypoint] + c.offset if c.waypoint in ends else end_time, c)
                for end_time, c in self._before.outputs
            ),
            *(
                (ends.get(c.waypoint, start_time) + c.offset, c)
                for c in self._appended.io_commands
            ),
        ]
        committed_records = Counter(
            _output_key(record)
            for segment in plan.segments[:-1]
            for record in segment.outputs
            if isinstance(record, SwitchOutput) and not record.begins_pulses
        )
        still = []
        for end_time, command in sorted(commands, key=lambda one: one[0]):
            kind = _output_key(command)
            if committed_records[kind]:
                committed_records[kind] -= 1
            else:
                still.append((end_time, command))
        return tuple(still)

    # -- splines ---------------------------------------------------------------------------------

    def append_spline(
        self, start: SplineState, records_before: int, time_offset: float
    ) -> AppendPlan:
        """
        Return a part made of spline pieces, which begins in the state ``start``.

        :param time_offset: motion time minus client time [s].
        """
        before = self._before = replace(self._before, time_offset=time_offset)
        goal = self._spline_goal(start)
        found = plan_spline(
            start,
            goal,
            self._kinematics,
            self._options,
            first=before.points,
            tool_tips=tool_tips(goal, before.T_flange_active),
        )
        segments, reference, begin = found.segments, found.reference, start
        if before.replanned is not None:
            pieces, path = before.replanned
            segments = pieces + segments
            begin = state_at(before, before.time)
            reference = path + reference
        plan = Plan(
            goal=goal,
            segments=segments,
            reference=reference,
            start=start.q,
            T_flange_active=before.T_flange_active,
            T_flange_tcp=before.T_flange_tcp,
            older_program=self._options.older_program,
            execution=goal.execution,
            remarks=found.remarks,
        )
        return self.spline_part(plan, begin, found.end, records_before)

    def _spline_goal(self, start: SplineState) -> GoalTable:
        """Return the checked goal of the appended points, with motion times and TCP poses."""
        before, appended = self._before, self._appended
        points = WaypointRows.of(appended.waypoints)
        # The points are checked as a goal of their own, with times since the point before them.
        goal = replace(
            before.goal,
            waypoints=replace(
                points, times=np.round(points.times - before.last_client_time, _DIGITS)
            ),
            segments=appended.segments,
            io_commands=numbered(appended, before.points),
            keep_open=not appended.last,
            replace_horizon=0.0,  # not allowed without keep_open; set again below
        )
        try:
            state = self._at_rest(start.q)
            table = check_for_arm(goal, state.T_flange_tcp, self._arm, self._options)
            table = retarget_to_tcp(table, state, self._options).goal
        except GoalRefused as refusal:
            raise refusal.reworded(_renumber_text(str(refusal), before.points)) from None
        points = table.waypoints
        shift = before.last_client_time + before.time_offset
        return replace(
            table,
            waypoints=replace(points, times=points.times + shift),
            replace_horizon=before.goal.replace_horizon,
        )

    def spline_part(
        self,
        plan: Plan,
        begin: SplineState,
        end: SplineState,
        records_before: int,
        pulses: Sequence[PulseTrain] = (),
    ) -> AppendPlan:
        """
        Return a part whose ending is a stopping piece, if the arm moves at its last point.

        If outputs are due at the last point or later, the piece to that point also belongs to the
        ending: the outputs are sent after that piece, and their triggers depend on the next
        points.

        :param begin: the state at the beginning of the plan; ``end``: at its last point.
        :param pulses: the pulses that begin in this part.
        """
        start_time = begin.time
        closing = self._stop(end) if end.is_moving and not self._appended.last else None
        complete, due_commands = self._place_outputs(plan, closing, start_time, pulses)
        pending = tuple(
            (time, command)
            for time, command in due_commands
            if time >= end.time - SAME_TIME and not self._appended.last
        )
        rows, moving = complete.rows, len(plan.segments)
        time, replanned = end.time, None
        if pending:
            piece = rows[moving - 1 : moving]
            time -= float(piece.durations[0])
            replanned = piece, plan.reference.since(time + 2.0 * SAME_TIME)
        assert isinstance(rows.primitives, SplineRows)
        spline = JointSpline.of(
            begin.q,
            rows.primitives,
            velocities=begin.qd,
            accelerations=begin.qdd,
            start_time=start_time,
        )
        part = PlannedPart(
            spline=spline,
            waypoints=rows.waypoints[:moving],
            records_before=records_before + (np.cumsum(rows.records) - rows.records)[:moving],
        )
        next_goal = replace(
            self._before,
            time=time,
            rest_time=end.time + (float(rows.durations[-1]) if closing else 0.0),
            q_rest=vector6(rows.joints[-1].tolist()) if closing else end.q,
            state=end,
            outputs=pending,
            replanned=replanned,
            parts=(*self._before.parts, part),
            commands=(*self._before.commands, *due_commands[len(self._before.outputs) :]),
        )
        ending = len(rows) - moving + bool(pending)
        appended = self._part(complete, records_before, start_time, ending, next_goal, timed=True)
        return replace(appended, spline=spline)

    def _stop(self, end: SplineState) -> tuple[PlannedRows, ReferencePath]:
        """Return the piece that stops the arm after the last point, and the path of the piece."""
        piece = plan_stop(end, self._arm, self._options, self._points - 1)
        times = np.linspace(0.0, piece.duration, _STOP_ROWS + 1)
        q, _, _ = rows_along(piece, end, len(times))
        return unreported_piece(piece, self._points - 1), ReferencePath(
            poses=self._kinematics.pose_rows(q),
            time=end.time + times,
            point=np.full(len(times), self._points - 1, dtype=np.int32),
            fraction=np.ones(len(times)),
        )

    def _place_outputs(
        self,
        plan: Plan,
        closing: tuple[PlannedRows, ReferencePath] | None,
        start_time: float,
        pulses: Sequence[PulseTrain],
    ) -> tuple[Plan, list[tuple[float, IOCommand]]]:
        """
        Return a plan with its stop and outputs, and the commands with their due times [s].

        :param closing: the stopping piece with its path; None = the plan has no such piece.
        """
        rows, reference = plan.rows, plan.reference
        waypoints = rows.waypoints
        if closing is not None:
            stop, path = closing
            rows, reference = rows + stop, reference + path
            # The stop leads to no point. It gets the number after the last point, so that outputs
            # that are due during the stop come after the last point.
            waypoints = np.append(waypoints, stop.waypoints + 1)
        ends = _end_times(waypoints, rows.durations, start_time)
        bare = replace(rows, waypoints=waypoints, outputs={})
        timed_path = TimedPath(bare, reference, None, start_time)
        pending, new = self._before.outputs, self._appended.io_commands
        due_commands = [
            *pending,
            *(
                (self._due_time(f'io_commands[{i}]', c, timed_path, ends), c)
                for i, c in enumerate(new)
            ),
        ]
        commands = []
        for time, command in pending:
            waypoint = max(command.waypoint, int(waypoints[0]))
            offset = max(0.0, time - ends[waypoint])
            commands.append(
                replace(command, waypoint=waypoint, offset=offset, distance=0.0, fraction=0.0)
            )
        try:
            found = place_outputs(
                bare,
                reference,
                {'io_commands': (*commands, *new), 'pulses': pulses},
                start_time=start_time,
                control_cycle=self._arm.model.control_cycle,
                to_tcp=self._kinematics.tcp_poses if self._kinematics.frame_moves else None,
            )
        except GoalRefused as refusal:
            raise refusal.reworded(_renumber_commands(str(refusal), -len(pending))) from None
        rows = replace(rows, outputs=found.outputs)
        return replace(plan, segments=rows, reference=reference), due_commands

    def _due_time(
        self, field: str, command: IOCommand, path: TimedPath, ends: Mapping[int, float]
    ) -> float:
        """
        Return the motion time at which a new command is due [s].

        :raises InvalidGoal: its place is after the last point, on a path that may change.
        """
        if not (command.distance or command.fraction or command.offset < 0.0):
            return ends[command.waypoint] + command.offset
        (found,) = SwitchedOutputs().place(command, field, path)
        last = self._points - 1
        place = found.time + found.lead - max(command.offset, 0.0)
        if place > ends[last] + SAME_TIME and not self._appended.last:
            name = 'distance' if command.distance else 'fraction'
            raise InvalidGoal(
                f'{field}.{name}',
                f'is {getattr(command, name):g}, but the path behind point {last} is not known '
                'yet',
                'send the command with a later point, as a place before it',
            )
        return found.time

    # -- both ------------------------------------------------------------------------------------

    def _part(
        self,
        plan: Plan,
        records_before: int,
        start_time: float,
        ending: int,
        next_goal: AppendableGoal,
        *,
        timed: bool,
    ) -> AppendPlan:
        """
        Return an append plan, and set the counts of points and records in its ``next_goal``.

        :param ending: the number of motions of the ending.
        :param timed: whether the points have times.
        """
        last, rows = self._appended.last, plan.rows
        # The pulses on the first part were checked, from their beginning, when it was planned.
        pulses = self._before.pulses if self._before.points else ()
        if pulses:
            clock = PathClock(plan.reference, is_spline=rows.are_spline)
            span = float(plan.reference.time[0]), float(plan.reference.time[-1])
            for field, train in pulses:
                check_speed(train, field, clock, self._arm.model.control_cycle, span)
        records = records_before + int(rows.records.sum())
        ending_records = int(rows.records[len(rows) - ending :].sum())
        # After the last motion, the robot program waits until its outputs are switched. So the
        # plan ends after the longest of their delays.
        outputs = rows.outputs.get(len(rows) - 1, ())
        delay = max(
            (each.delay for each in outputs if isinstance(each, SwitchOutput)), default=0.0
        )
        return AppendPlan(
            plan=replace(plan, goal=replace(plan.goal, keep_open=not last)),
            records_before=records_before,
            start_time=start_time,
            ending_records=0 if last else ending_records,
            end_time=next_goal.rest_time + delay if timed else None,
            text=self._text(),
            next_goal=replace(
                next_goal,
                points=self._points,
                records=records,
                committed_records=records - ending_records,
                last_client_time=self._appended.waypoints[-1].time,
            ),
        )

    def _at_rest(self, q: Joints) -> RobotState:
        """Return the state of a robot at rest at the joints ``q`` [rad], with the goal's TCP."""
        return state_at_rest(self._arm, q, self._before.T_flange_active)

    def _text(self) -> str:
        """Return the answer, with remarks on fields of the new points that have no effect."""
        before, appended = self._before, self._appended
        goal = replace(
            before.goal,
            waypoints=appended.waypoints,
            segments=appended.segments,
            keep_open=not appended.last,
        )
        remarks = point_remarks if goal.execution.traits.is_spline else ignored_remarks
        table = goal_table(goal)
        count = len(appended.waypoints)
        points = 'point' if count == 1 else 'points'
        end = ', these are the last' if appended.last else ''
        sentences = [
            f'{count} {points} appended, the goal has {self._points}{end}.',
            *(f'{text[:1].upper()}{text[1:]}.' for text in remarks(table, before.points)),
        ]
        return ' '.join(sentences)


def _renumber_plan(plan: Plan, first: int, waypoint: int, start_time: float) -> Plan:
    """
    Return the plan of the points from ``waypoint`` on, which begins at ``start_time`` [s].

    :param first: the number in the goal of the plan's point 0; the result uses numbers of the
        goal.
    :param waypoint: the first point to keep, by its number in the goal.
    """
    left_out = int(np.searchsorted(plan.rows.waypoints, waypoint - first))
    begin, rows = sum(plan.rows.durations[:left_out].tolist()), plan.rows[left_out:]
    path = plan.reference
    path = replace(path, time=path.time + (start_time - begin), point=path.point + first)
    lines = rows.report_lines
    return replace(
        plan,
        segments=replace(
            rows,
            waypoints=rows.waypoints + first,
            report_lines=LateLines.at_once(
                len(rows), lambda: [_renumber_text(line, first) for line in lines]
            ),
            notes={row: _renumber_text(note, first) for row, note in rows.notes.items()},
        ),
        reference=path.since(start_time + SAME_TIME),
        find_slow_stretches=tuple,  # the plan's function would name points by their old numbers
    )


def _renumber_text(text: str, first: int) -> str:
    """Return a text with ``first`` added to its numbers of points and segments."""
    return _NUMBER.sub(lambda found: f'{found[1]}{int(found[2]) + first}', text)


def _renumber_commands(text: str, first: int) -> str:
    """Return a text with ``first`` added to its numbers of output commands."""
    return _COMMAND.sub(lambda found: f'{found[1]}{int(found[2]) + first}', text)


def _end_times(waypoints: Int32s, durations: Floats, start_time: float) -> dict[int, float]:
    """Return, by waypoint, the time [s] at which the motion to it ends."""
    ends = np.cumsum(np.append(start_time, durations))[1:]
    return dict(zip(waypoints.tolist(), ends.tolist(), strict=True))


def _blend_half(segment: PlannedSegment) -> float:
    """Return the time [s] from the beginning of the blend after a segment to its point."""
    return segment.blend_entry.half if segment.blend_entry else 0.0


def _output_key(output: IOCommand | SwitchOutput) -> tuple[object, ...]:
    return output.output, output.pin, output.value, output.domain
