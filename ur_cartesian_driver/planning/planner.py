# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Plan a goal: choose its primitives (the single motions of the robot), or refuse the goal.

:func:`plan` checks the goal
(:func:`~ur_cartesian_driver.planning.request.joint_points.check_for_arm`), expresses it for the
TCP that is active while it runs, and calls the planner of the execution mode: :func:`plan_moves`
or :func:`plan_spline_goal`.

:func:`plan_moves` works in stages. The first finds the curve of every segment, the configuration
in which the arm arrives, and the blends between the curves; the second checks the clearance; the
third computes times and speeds; the last makes primitives, outputs, reference path and report. A
stage that finds a fault in the goal raises :class:`GoalRefused`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache, partial
from math import inf
from typing import TypeAlias

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import GoalRefused, NearSingularity
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.pose_rows import transform_rows
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.plan.plan import Plan, PlannedRows, PlannedSegment, ReferencePath
from ur_cartesian_driver.motion.plan.slow_stretch import SlowStretch
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.free_axis.free_rotations import as_named, choose_rotations
from ur_cartesian_driver.planning.free_axis.rotation_lattice import NoRotation
from ur_cartesian_driver.planning.min_speed import (
    check_min_speed,
    slower_by,
    unknown_speed_remark,
)
from ur_cartesian_driver.planning.moves.joint_path_planner import JointPathPlanner
from ur_cartesian_driver.planning.moves.plan_report import (
    blend_remarks,
    motion_version_remarks,
    segment_lines,
    stop_remarks,
    twin_remarks,
)
from ur_cartesian_driver.planning.moves.reference_path import reference_path
from ur_cartesian_driver.planning.moves.segment_geometries import SegmentGeometries
from ur_cartesian_driver.planning.moves.segment_primitives import segment_primitives
from ur_cartesian_driver.planning.moves.segment_timing import SegmentTimings
from ur_cartesian_driver.planning.moves.slow_moves import slow_move_stretches, unknown_speeds
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.output_placement import place_outputs
from ur_cartesian_driver.planning.preflight.clearance import clearance_lines
from ur_cartesian_driver.planning.preflight.exchanged_frames import (
    exchanged_frames,
    with_exchanged_frames,
)
from ur_cartesian_driver.planning.preflight.held_part_kinematics import kinematics_of
from ur_cartesian_driver.planning.preflight.offset_band_check import (
    dense_path,
    FILTER_SETTLING,
    offset_band,
    offset_remarks,
    OffsetBandCheck,
    speeds_beside,
)
from ur_cartesian_driver.planning.preflight.planned_joints import joint_moves, solved_joints
from ur_cartesian_driver.planning.preflight.start_checks import (
    check_approach,
    check_reported_tcp,
    check_start,
)
from ur_cartesian_driver.planning.request.controlled_frame import (
    retarget_to_tcp,
    RetargetedGoal,
    tool_tips,
)
from ur_cartesian_driver.planning.request.default_tolerances import apply_default_tolerances
from ur_cartesian_driver.planning.request.feed_override import feed_remark
from ur_cartesian_driver.planning.request.goal_fields import (
    is_rounded,
    is_timed,
    resolve_execution_mode,
)
from ur_cartesian_driver.planning.request.held_part_rules import (
    check_part_keeps_orientation,
    check_part_outputs,
    with_advice_for_part,
)
from ur_cartesian_driver.planning.request.ignored_fields import ignored_remarks
from ur_cartesian_driver.planning.request.joint_points import check_for_arm
from ur_cartesian_driver.planning.request.point_events.registry import (
    OUTPUT_EVENTS,
    POINT_EVENTS,
)
from ur_cartesian_driver.planning.request.point_events.safe_outputs import add_safe_outputs
from ur_cartesian_driver.planning.request.point_events.stops import Stops
from ur_cartesian_driver.planning.request.program_features import time_remarks
from ur_cartesian_driver.planning.rounded.rounded_planner import plan_rounded_path
from ur_cartesian_driver.planning.rounded.rounded_report import planned_rows, RoundedReport
from ur_cartesian_driver.planning.spline.spline_planner import (
    plan_spline,
    SplineState,
    stretch_times,
)
from ur_cartesian_driver.planning.stop_prediction import at_set_point
from ur_cartesian_driver.planning.travel.travel_to_goal import plan_with_travel

#: Static error of the TCP of a CB3 arm at full reach [m]: about 0.3 mm, because the joints of a
#: UR10 were recorded at rest 0.2 to 0.4 mrad beside their targets.
CB3_STATIC_ERROR = 3e-4
#: Sample densities of the two searches for rotations about a free axis (about which the driver may
#: turn the tool), as multiples of the usual density: the second search sees singularities between
#: the samples of the first.
_SEARCH_DENSITIES = (1, 4)

#: A function that plans a checked goal.
PlanGoal: TypeAlias = Callable[['GoalPlanner'], Plan]


def plan(
    goal: Goal,
    state: RobotState,
    arm: Arm,
    options: PlanningOptions,
    running: PlannedSegment | None = None,
) -> Plan:
    """
    Return the plan of a goal for a robot at rest.

    :param state: the robot's state, of which joints, TCP pose and TCP offset are used.
    :param arm: the kinematics, calibrated if the robot's calibration is known.
    :param running: the planned motion to the first point, if it has been sent already.
    :raises GoalRefused: the goal fails a check (a subclass is raised); the text names point,
        quantity, value and bound.
    """
    if options.twin is not None and not options.robot.model:
        options = replace(options, robot=replace(options.robot, model=arm.model.name))
    if goal.allow_travel and running is None:
        return plan_with_travel(goal, state, arm, options, _plan_direct)
    return _plan_direct(goal, state, arm, options, running)


def _plan_direct(
    goal: Goal,
    state: RobotState,
    arm: Arm,
    options: PlanningOptions,
    running: PlannedSegment | None = None,
) -> Plan:
    """Return the plan of a goal; the arm goes directly to the first point, without a travel."""
    table = check_for_arm(goal, state.T_flange_tcp, arm, options)
    if table.segments.free_axes.any():
        return _plan_free(table, state, arm, options)
    return _plan_fixed(table, state, arm, options, running)


def _plan_fixed(
    table: GoalTable,
    state: RobotState,
    arm: Arm,
    options: PlanningOptions,
    running: PlannedSegment | None = None,
) -> Plan:
    """Return the plan of a checked goal without a free axis."""
    table = add_safe_outputs(apply_default_tolerances(table, options), options)
    retargeted = retarget_to_tcp(table, at_set_point(state, arm), options)
    try:
        planner = GoalPlanner(retargeted, state.T_flange_tcp, arm, options, running)
        plan = PLANNERS[planner.mode](planner)
    except GoalRefused as refusal:
        of_part = table.moving_frame is not None
        advised = with_advice_for_part(refusal, table) if of_part else refusal
        hinted = with_exchanged_frames(advised, table, state)
        if hinted is refusal:
            raise
        raise hinted from None
    remarks = [feed_remark(table.feed_override, plan.duration)]
    if table.moving_frame is not None and (clause := exchanged_frames(table, state)):
        remarks.append(f'check the frames: {clause}')
    remarks = [remark for remark in remarks if remark]
    return replace(plan, remarks=(*plan.remarks, *remarks)) if remarks else plan


def _plan_free(table: GoalTable, state: RobotState, arm: Arm, options: PlanningOptions) -> Plan:
    """
    Return the plan of a checked goal with a free axis; choose the rotations about this axis.

    If no choice passes the checks, the goal is planned with the orientations given by its points.
    """
    refusal: GoalRefused | None = None
    found = 'no rotation about the free axis was found that leads along the whole path'
    for density in _SEARCH_DENSITIES:
        try:
            start = at_set_point(state, arm)
            chosen, remarks = choose_rotations(table, start, arm, options, density)
            plan = _plan_fixed(chosen, state, arm, options)
            return replace(plan, remarks=(*remarks, *plan.remarks))
        except NoRotation:
            break
        except GoalRefused as error:
            refusal, found = error, 'no better rotation about the free axis was found'
            if not isinstance(error, NearSingularity):
                break
    try:
        plan = _plan_fixed(as_named(table), state, arm, options)
    except GoalRefused as error:
        first = refusal or error
        raise first.reworded(f'{str(first).rstrip(".")} ({found}).') from None
    return replace(
        plan, remarks=(f'free axis: rotations as given, because {found}', *plan.remarks)
    )


def plan_moves(planner: GoalPlanner) -> Plan:
    """Return the plan of a goal whose points are connected by motion commands of the robot."""
    goal, state, arm, options = planner.goal, planner.state, planner.arm, planner.options
    first = planner.first_target()
    if planner.kinematics.frame_moves:
        check_part_keeps_orientation(goal, planner.targets, state.actual_tcp_pose, first)
    if options.laws.blend_begin < 1.0 and goal.segments.blend_radii.any():
        # The law of the digital twin describes the blends as measured on this robot. A goal must
        # not pass only thanks to this law, so the path with the assumed blends is checked first,
        # but not its duration.
        _checked_path(planner, first, replace(options, twin=None, twin_file=''), [], {})
    paths, geometries, lines = _checked_path(
        planner, first, options, planner.remarks, planner.reasons
    )
    timings = SegmentTimings(
        geometries,
        options,
        arm.model,
        paths.blend_samples,
        planner.running,
        planner.stops.waypoints,
    )
    segments = _planned_rows(paths, geometries, timings)
    del paths  # frees the samples before the reference path is made; both can be large
    motion = reference_path(
        state.actual_tcp_pose, geometries.begin, geometries.path, timings.chain.times
    )
    find_slow_stretches = cache(
        partial(slow_move_stretches, geometries, timings, motion, slower_by(goal))
    )
    limits = timings.requests.limits
    remarks = [
        *ignored_remarks(goal, translates=None if planner.timed else limits.translates),
        *motion_version_remarks(options),
        *(remark for _, remark in sorted(timings.requests.remarks.items())),
        *twin_remarks(options, timings),
        *blend_remarks(goal, geometries, timings, options),
        *lines,
        *stop_remarks(geometries),
        geometries.tightest_margins.remark,
    ]
    if goal.min_speed_fraction:
        remarks += unknown_speed_remark(goal, *unknown_speeds(geometries))
    return planner.plan(goal, segments, motion, remarks, find_slow_stretches)


def _checked_path(
    planner: GoalPlanner,
    first: int,
    options: PlanningOptions,
    remarks: list[str],
    reasons: dict[int, list[str]],
) -> tuple[JointPathPlanner, SegmentGeometries, list[str]]:
    """
    Return the joint paths and geometries from point ``first`` on, and report lines on clearance.

    :param remarks: the list to which the remarks on the path are appended.
    :param reasons: by point index, the lists to which reasons for unusual primitives are appended.
    """
    state = planner.state
    paths = JointPathPlanner(
        planner.goal, planner.targets, planner.kinematics, options, remarks, reasons
    )
    geometries = paths.geometries(first, state.actual_tcp_pose, state.actual_q)
    lines = clearance_lines(
        planner.arm,
        planner.tool_tips,
        options,
        paths.samples,
        state.actual_q,
        planner.goal.part_changes,
    )
    return paths, geometries, lines


def _planned_rows(
    paths: JointPathPlanner, geometries: SegmentGeometries, timings: SegmentTimings
) -> PlannedRows:
    """Return the segments with their primitives, expected times and report lines."""
    curves, begin = geometries.path.curves, geometries.begin
    moves = segment_primitives(paths, geometries, timings)
    return PlannedRows(
        waypoints=np.arange(begin, begin + len(geometries), dtype=np.int32),
        lengths=curves.length,
        angles=curves.angle,
        durations=timings.durations,
        blend_entries=timings.chain.blend_entries,
        joints=geometries.joints,
        primitives=moves,
        report_lines=segment_lines(geometries, timings, moves, paths.reasons),
    )


def plan_rounded_goal(planner: GoalPlanner) -> Plan:
    """Return the plan of a goal whose lines and arcs have rounded corners."""
    goal, state, options = planner.goal, planner.state, planner.options
    motion = plan_rounded_path(
        goal,
        planner.targets,
        state.actual_tcp_pose,
        state.actual_q,
        planner.kinematics,
        options,
        planner.stops.waypoints,
    )
    report = RoundedReport(motion)
    clearance = clearance_lines(
        planner.arm,
        planner.tool_tips,
        options,
        motion.path.samples,
        state.actual_q,
        goal.part_changes,
    )
    return planner.plan(
        goal,
        planned_rows(motion, report),
        motion.reference,
        [*ignored_remarks(goal), *clearance, *report.remarks],
        cache(partial(report.slow_stretches, slower_by(goal))),
        motion.point_times,
    )


def plan_spline_goal(planner: GoalPlanner) -> Plan:
    """Return the plan of a SPLINE or SERVO goal."""
    goal, state = planner.goal, planner.state
    if is_rounded(goal):
        return plan_rounded_goal(planner)
    first = planner.first_target()
    found = plan_spline(
        SplineState(q=state.actual_q),
        replace(goal, waypoints=goal.waypoints[first:], segments=goal.segments[first:]),
        planner.kinematics,
        planner.options,
        first=first,
        tool_tips=planner.tool_tips,
    )
    return planner.plan(
        stretch_times(goal, found.stretch),
        found.segments,
        found.reference,
        found.remarks,
        found.find_slow_stretches,
    )


#: The planner of each execution mode.
PLANNERS: Mapping[ExecutionMode, PlanGoal] = {
    ExecutionMode.PRIMITIVES: plan_moves,
    ExecutionMode.SPLINE: plan_spline_goal,
    ExecutionMode.SERVO: plan_spline_goal,
}


def _with_offset_band(plan: Plan, planner: GoalPlanner) -> Plan:
    """
    Return the plan with the band in which path offsets may move the tool.

    :raises GoalRefused: offsets are possible nowhere, or the arm cannot reach all of the band.
    """
    path, settling = plan.reference, 0.0
    if plan.execution.traits.streams_setpoints:
        q, qd, _ = plan.joint_spline.rows(path.time)
    else:
        path, settling = dense_path(path), FILTER_SETTLING
        q = solved_joints(planner.kinematics, plan.reference, path, joint_moves(plan), plan.start)
        qd = speeds_beside(q, path.time)
    band = offset_band(plan.goal.path_offset, path, plan.T_tcp_controlled, settling)
    warnings = OffsetBandCheck(
        kinematics=planner.kinematics,
        options=planner.options,
        band=band,
        reference=path,
        q=q,
        qd=qd,
        tool_tips=planner.tool_tips,
        part_changes=plan.goal.part_changes,
    ).check()
    remarks = (*plan.remarks, *offset_remarks(band, plan.duration), *warnings[:1])
    return replace(plan, offset_band=band, remarks=remarks)


def _held_part_remark(plan: Plan, planner: GoalPlanner) -> str:
    """Return the remark on a held part, with the peak speeds of the TCP and of the joints."""
    goal, time = plan.goal, plan.reference.time
    led = (
        f'held part: {goal.frame_id or "the part"} is led along '
        f'{goal.controlled_frame or "the fixed tool"}'
    )
    if not plan.execution.traits.is_spline:
        return f'{led} without turning, so that all speeds are those on the part and of the TCP'
    q, qd, _ = plan.joint_spline.rows(time)
    tcp = planner.kinematics.carrier_speeds(q, qd)
    assert tcp is not None
    parts = np.abs(qd) / planner.arm.model.max_joint_speed
    row, joint = divmod(int(np.argmax(parts)), 6)
    return (
        f'{led}, and all speeds are those on the part; in base the TCP reaches '
        f'{tcp.max():.3f} m/s, and {JOINT_NAMES[joint]} '
        f'{100.0 * parts[row, joint]:.0f} % of its speed limit, {time[row]:.2f} s after the start'
    )


class GoalPlanner:
    """
    One goal, prepared for the planners of all execution modes; :meth:`plan` is their last step.

    The object collects the remarks for the report of the goal.

    :param retargeted: the checked goal, expressed for the TCP that is active while it runs.
    :param T_flange_active: the TCP that is active on the robot now.
    :param running: the planned first segment, if it has been sent already.
    """

    def __init__(
        self,
        retargeted: RetargetedGoal,
        T_flange_active: Pose,
        arm: Arm,
        options: PlanningOptions,
        running: PlannedSegment | None = None,
    ) -> None:
        for kind in POINT_EVENTS:
            kind.check_robot(retargeted.goal, arm.model, retargeted.T_tcp_controlled)
        self.stops = Stops(retargeted.goal, options)
        goal, state = self.stops.moving_goal, retargeted.state
        self.goal, self.state, self.arm, self.options = goal, state, arm, options
        self.running = running
        self.T_flange_active, self._retargeted = T_flange_active, retargeted
        self.kinematics = kinematics_of(goal.moving_frame, arm, state.T_flange_tcp)
        self.tool_tips = tool_tips(goal, T_flange_active)
        self.remarks = list(retargeted.remarks)
        #: By point: the reasons for a primitive that is not the usual one of its segment type.
        self.reasons: dict[int, list[str]] = {}
        #: (n, 7) the poses of the points in the robot's base, or in the frame of a held part.
        self.targets = transform_rows(goal.T_base_frame, goal.waypoints.poses)
        self.timed = is_timed(goal)
        self.mode = resolve_execution_mode(goal)
        self.remarks += [*time_remarks(goal, options), *self._static_error_remarks()]
        check_reported_tcp(state, self.kinematics)
        self._first = pose_from_row(self.targets[0].tolist())
        check_approach(state, self._first, options)

    def _static_error_remarks(self) -> list[str]:
        """Return a warning if the arm may not meet the position tolerance of the goal."""
        tightest = min(
            (limit for limit in self.goal.goal_tolerance.position if limit > 0.0), default=inf
        )
        if self.arm.model.series != 'CB3' or tightest >= CB3_STATIC_ERROR:
            return []
        return [
            f'goal_tolerance: {tightest:g} m is less than the {CB3_STATIC_ERROR:g} m by which CB3 '
            'arms stand beside their target at full reach; the goal may end '
            'GOAL_TOLERANCE_VIOLATED'
        ]

    def first_target(self) -> int:
        """
        Return the index of the first point that needs a motion.

        It is 1 if the goal has times and point 0 is at time 0, because the robot must be at point
        0 already; otherwise it is 0.

        :raises InvalidGoal: point 0 is at time 0, but the robot is elsewhere.
        :raises InvalidPosture: point 0 is at time 0, but the arm has another posture.
        """
        points = self.goal.waypoints
        if not self.timed or points.times[0] != 0.0:
            return 0
        check_start(self.state, self._first, points.postures.get(0), self.kinematics, self.options)
        self.remarks.append('point 0: the robot is there at time 0, so nothing is sent for it')
        return 1

    def plan(
        self,
        goal: GoalTable,
        segments: PlannedRows,
        motion: ReferencePath,
        remarks: Iterable[str],
        find_slow_stretches: Callable[[], Sequence[SlowStretch]],
        point_times: Floats | None = None,
    ) -> Plan:
        """
        Return the plan of a motion, after inserting its stops and outputs.

        :param goal: the goal as planned, before the stops are inserted.
        :param remarks: appended to the remarks that have been collected so far.
        :param point_times: (n,) time at which each point is passed [s], before stops delay it;
            None = each point is at the end of a piece.
        :raises GoalRefused: the tool is slower than demanded, an output cannot be placed, or
            offsets of the path are not possible.
        """
        if goal.min_speed_fraction:
            check_min_speed(goal, find_slow_stretches())
        goal, segments, reference = self.stops.insert(goal, segments, motion)
        if goal.moving_frame is not None:
            check_part_outputs(goal, reference.poses)
        segments = place_outputs(
            segments,
            reference,
            {kind.field: kind.of(goal) for kind in OUTPUT_EVENTS},
            blend_halves=segments.blend_entries[:, -1],
            point_times=None if point_times is None else self.stops.delayed(point_times),
            control_cycle=self.arm.model.control_cycle,
            to_tcp=self.kinematics.tcp_poses if self.kinematics.frame_moves else None,
        )
        planned = Plan(
            goal=goal,
            segments=segments,
            reference=reference,
            start=self.state.actual_q,
            remarks=(*self.remarks, *remarks),
            find_slow_stretches=find_slow_stretches,
            T_flange_active=self.T_flange_active,
            T_flange_tcp=self._retargeted.T_flange_tcp,
            T_tcp_controlled=self._retargeted.T_tcp_controlled,
            older_program=self.options.older_program,
            execution=self.mode,
        )
        if goal.moving_frame is not None:
            planned = replace(
                planned, remarks=(*planned.remarks, _held_part_remark(planned, self))
            )
        return _with_offset_band(planned, self) if goal.path_offset else planned
