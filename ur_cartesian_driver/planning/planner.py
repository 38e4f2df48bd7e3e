# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
From a goal to a plan: choose the primitives, and refuse what the arm cannot do.

:func:`plan` checks a goal as far as that needs no robot
(:func:`~ur_cartesian_driver.planning.request.validate.check`), expresses it for the TCP with which
it runs, and gives it to the planner of its execution mode: :func:`plan_moves` or
:func:`plan_spline_goal`.

The stages of :func:`plan_moves`: the curve of every segment with the configuration in which it
arrives, and the blends between them; clearance; times and speeds; primitives, outputs, reference
path and report. The first reason for a refusal is raised.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import cache, partial
from math import inf, nan
from pkgutil import resolve_name
from typing import TypeAlias

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    InvalidGoal,
    InvalidPosture,
    RobotNotReady,
)
from ur_cartesian_driver.motion.goal import ArcMode, Goal, Posture, SegmentType
from ur_cartesian_driver.motion.goal_table import GoalTable, NO_POSTURE, rows_where
from ur_cartesian_driver.motion.move_rows import MoveRows, MOVES
from ur_cartesian_driver.motion.plan import Plan, PlannedRows, PlannedSegment, ReferencePath
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.pose_rows import PoseRows, transform_rows
from ur_cartesian_driver.motion.primitive import (
    Joints,
    MoveC,
    MoveJ,
    MoveL,
    MoveP,
    OptimoveJ,
    OptimoveL,
    Primitive,
    Spline,
    Stop,
    Target,
)
from ur_cartesian_driver.motion.robot_state import RobotState
from ur_cartesian_driver.motion.slow_stretch import SlowStretch
from ur_cartesian_driver.motion.vectors import vector6, ZERO6
from ur_cartesian_driver.planning.free_axis.free_rotations import as_named, choose_rotations
from ur_cartesian_driver.planning.free_axis.rotation_lattice import NoRotation
from ur_cartesian_driver.planning.geometry.curves import ArcCurve, SegmentCurve
from ur_cartesian_driver.planning.min_speed import (
    check_min_speed,
    slower_by,
    unknown_speed_remark,
)
from ur_cartesian_driver.planning.moves.joint_path_planner import JointPathPlanner, SAME_SOLUTION
from ur_cartesian_driver.planning.moves.path_margins import BlendSamples, PathSamples
from ur_cartesian_driver.planning.moves.plan_report import (
    blend_remarks,
    segment_lines,
    stop_remarks,
)
from ur_cartesian_driver.planning.moves.reference_path import reference_path
from ur_cartesian_driver.planning.moves.segment_drafts import JOINT_SPACE_TYPES
from ur_cartesian_driver.planning.moves.segment_geometries import SegmentGeometries
from ur_cartesian_driver.planning.moves.segment_timing import SegmentTimings
from ur_cartesian_driver.planning.moves.slow_moves import slow_move_stretches, unknown_speeds
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.output_placement import place_outputs
from ur_cartesian_driver.planning.preflight.clearance import clearance_lines
from ur_cartesian_driver.planning.preflight.tcp_kinematics import (
    describe_miss,
    full_posture,
    max_joint_change,
    named_joints,
    TcpKinematics,
)
from ur_cartesian_driver.planning.request.controlled_frame import (
    retarget_to_tcp,
    RetargetedGoal,
    tool_tips,
)
from ur_cartesian_driver.planning.request.default_tolerances import apply_default_tolerances
from ur_cartesian_driver.planning.request.dialect_adaptation import (
    adapt_to_dialect,
    explain_poses_only,
)
from ur_cartesian_driver.planning.request.goal_fields import (
    is_timed,
    point_field,
    resolve_execution_mode,
    segment_field,
    type_table,
)
from ur_cartesian_driver.planning.request.ignored_fields import ignored_remarks
from ur_cartesian_driver.planning.request.io_commands import add_safe_outputs
from ur_cartesian_driver.planning.request.stops import Stops
from ur_cartesian_driver.planning.request.validate import check
from ur_cartesian_driver.planning.spline.spline_planner import (
    plan_spline,
    SplineState,
    stretch_times,
)
from ur_cartesian_driver.planning.stop_prediction import at_set_point

#: How far a CB3 arm may stand beside its target: 0.2 to 0.4 mrad were recorded of a UR10 [m].
CB3_STATIC_ERROR = 3e-4
#: How far the reported TCP may be from where the kinematics puts it [m], [rad]. Calibration shifts
#: it by some millimetres; another model or another TCP shifts it much more.
MAX_MISMATCH_POSITION = 0.015
MAX_MISMATCH_ANGLE = 0.05

_CLASSES = {
    SegmentType.JOINT: MoveJ,
    SegmentType.PROCESS: MoveP,
    SegmentType.OPTIMIZED_JOINT: OptimoveJ,
    SegmentType.OPTIMIZED_LINEAR: OptimoveL,
}
#: The kind of the primitive's row, by type; that of an arc has no meaning.
_MOVE_OF = np.array([MOVES.index(_CLASSES.get(kind, MoveL)) for kind in SegmentType])
_HAS_Q_NEAR = type_table(JOINT_SPACE_TYPES)

#: A planner in the registry of execution modes.
PlanGoal: TypeAlias = Callable[['GoalPlanner'], Plan]


def plan(
    goal: Goal,
    state: RobotState,
    arm: Arm,
    options: PlanningOptions,
    running: PlannedSegment | None = None,
) -> Plan:
    """
    Return the plan of a goal for a robot that rests in a state.

    :param state: joints, TCP pose and TCP offset are read from it.
    :param arm: the kinematics, the robot's own calibrated one where it is known.
    :param running: the motion to the first point as it was planned, where it has been sent.
    :raises GoalRefused: a subclass; its text names point, quantity, value and bound.
    """
    table = check(goal, options)
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
    planner = GoalPlanner(retargeted, state.T_flange_tcp, arm, options, running)
    plan_goal: PlanGoal = resolve_name(planner.mode.traits.planner)
    return plan_goal(planner)


def _plan_free(table: GoalTable, state: RobotState, arm: Arm, options: PlanningOptions) -> Plan:
    """
    Return the plan of a checked goal whose rotations about its free axis are to be chosen.

    Where no choice passes, the orientations that the goal names may.
    """
    refusal: GoalRefused | None = None
    try:
        chosen = choose_rotations(table, at_set_point(state, arm), arm, options)
        plan = _plan_fixed(chosen.goal, state, arm, options)
        return replace(plan, remarks=(*chosen.remarks, *plan.remarks))
    except NoRotation:
        found = 'no rotation about the free axis was found that leads along the whole path'
    except GoalRefused as error:
        refusal, found = error, 'no better rotation about the free axis was found'
    try:
        plan = _plan_fixed(as_named(table), state, arm, options)
    except GoalRefused as error:
        first = refusal or error
        raise first.reworded(f'{str(first).rstrip(".")} ({found}).') from None
    return replace(
        plan, remarks=(f'free axis: rotations as given, because {found}', *plan.remarks)
    )


def plan_moves(planner: GoalPlanner) -> Plan:
    """Return the plan of a goal whose points are joined by motion commands of the robot."""
    goal, state, arm, options = planner.goal, planner.state, planner.arm, planner.options
    geometries = planner.geometries()
    lines = clearance_lines(
        arm,
        tool_tips(goal, planner.T_flange_active),
        options,
        planner.samples.q,
        state.actual_q,
        planner.samples.segment,
        planner.samples.fraction,
    )
    timings = SegmentTimings(
        geometries, options, arm.model, planner.blend_samples, planner.running
    )
    segments = planner.segments(geometries, timings)
    del planner.samples, planner.blend_samples  # long goals have many, and so has the reference
    motion = reference_path(
        state.actual_tcp_pose, geometries.begin, geometries.path, timings.chain.times
    )
    find_slow_stretches = cache(
        partial(slow_move_stretches, geometries, timings, motion, slower_by(goal))
    )
    goal, segments, reference = planner.stops.insert(goal, segments, motion)
    segments = place_outputs(
        segments,
        reference,
        goal.io_commands,
        proportional=goal.proportional_outputs,
        blend_halves=segments.blend_entries[:, -1],
    )
    remarks = [
        *ignored_remarks(goal),
        *(remark for _, remark in sorted(timings.requests.remarks.items())),
        *blend_remarks(goal, geometries, timings),
        *lines,
        *stop_remarks(geometries),
        geometries.tightest_margins.remark,
    ]
    if goal.min_speed_fraction:
        check_min_speed(goal, find_slow_stretches())
        remarks += unknown_speed_remark(goal, *unknown_speeds(geometries))
    return planner.plan(goal, segments, reference, remarks, find_slow_stretches)


def plan_spline_goal(planner: GoalPlanner) -> Plan:
    """Return the plan of a SPLINE or SERVO goal."""
    goal, state = planner.goal, planner.state
    first = planner.first_target()
    found = plan_spline(
        SplineState(q=state.actual_q),
        replace(goal, waypoints=goal.waypoints[first:], segments=goal.segments[first:]),
        planner.arm,
        state.T_flange_tcp,
        planner.options,
        first=first,
        tool_tips=tool_tips(goal, planner.T_flange_active),
    )
    if goal.min_speed_fraction:
        check_min_speed(goal, found.find_slow_stretches())
    goal, segments, reference = planner.stops.insert(
        stretch_times(goal, found.stretch), found.segments, found.reference
    )
    segments = place_outputs(
        segments, reference, goal.io_commands, proportional=goal.proportional_outputs
    )
    return planner.plan(goal, segments, reference, found.remarks, found.find_slow_stretches)


class GoalPlanner:
    """
    Makes the segments of one goal, and collects the remarks of its report.

    :param retargeted: the checked goal for the TCP with which it runs.
    :param T_flange_active: the TCP that the robot has now.
    :param running: the first segment as it was planned, where it has been sent.
    """

    def __init__(
        self,
        retargeted: RetargetedGoal,
        T_flange_active: Pose,
        arm: Arm,
        options: PlanningOptions,
        running: PlannedSegment | None = None,
    ) -> None:
        self.stops = Stops(retargeted.goal)
        goal, state = self.stops.moving_goal, retargeted.state
        self.goal, self.state, self.arm, self.options = goal, state, arm, options
        self.running = running
        self.T_flange_active, self._retargeted = T_flange_active, retargeted
        self.kinematics = TcpKinematics(arm, state.T_flange_tcp)
        self.remarks = list(retargeted.remarks)
        #: By point: why its primitive is not the plain one of its segment type.
        self.reasons: dict[int, list[str]] = {}
        self.targets = PoseRows(transform_rows(goal.T_base_frame, goal.waypoints.poses))
        self.timed = is_timed(goal)
        self.mode = resolve_execution_mode(goal)
        if self.timed and options.dialect.is_coarse and not self.mode.traits.is_spline:
            self.remarks.append(
                'all points: sent with speeds instead of times, because robot programs of wire '
                f'dialect {options.dialect.name} count in milliseconds'
            )
        self.remarks += self._static_error_remarks()
        #: The whole joint path, sampled; set by :meth:`geometries`.
        self.samples: PathSamples
        self.blend_samples: BlendSamples
        self._check_robot()
        self._check_approach()

    def _static_error_remarks(self) -> list[str]:
        """Return a warning of a goal tolerance that the arm may not meet."""
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
        Return the number of the first point to which there is a motion.

        That is 1 where point 0 is at time 0, because the robot is there already.

        :raises InvalidGoal: point 0 is at time 0, but the robot is elsewhere.
        :raises InvalidPosture: point 0 is at time 0, but the arm has another posture.
        """
        if not self.timed or self.goal.waypoints.times[0] != 0.0:
            return 0
        self._check_start_pose()
        self._check_start_posture()
        self.remarks.append('point 0: the robot is there at time 0, so nothing is sent for it')
        return 1

    def geometries(self) -> SegmentGeometries:
        """Return the curve of every segment and the configuration in which it arrives."""
        first = self.first_target()
        times = np.diff(self.goal.waypoints.times, prepend=0.0)[first:]
        if not self.timed:
            times = np.full(len(times), nan)
        joint_paths = JointPathPlanner(
            self.goal,
            self.targets.rows,
            self.kinematics,
            self.options,
            self.remarks,
            self.reasons,
        )
        geometries = joint_paths.geometries(
            first, self.state.actual_tcp_pose, self.state.actual_q, times
        )
        self.samples, self.blend_samples = joint_paths.margins.samples, joint_paths.blend_samples
        return geometries

    def plan(
        self,
        goal: Goal,
        segments: PlannedRows,
        reference: ReferencePath,
        remarks: Iterable[str],
        find_slow_stretches: Callable[[], tuple[SlowStretch, ...]],
    ) -> Plan:
        """Return the plan; its remarks follow those collected."""
        return Plan(
            goal=goal,
            segments=segments,
            reference=reference,
            start=self.state.actual_q,
            remarks=(*self.remarks, *remarks),
            find_slow_stretches=find_slow_stretches,
            T_flange_active=self.T_flange_active,
            T_flange_tcp=self._retargeted.T_flange_tcp,
            T_tcp_controlled=self._retargeted.T_tcp_controlled,
            execution=self.mode,
        )

    def segments(self, geometries: SegmentGeometries, timings: SegmentTimings) -> PlannedRows:
        """Return the primitive of each segment and what is expected of it."""
        kinds, curves = geometries.kinds, geometries.path.curves
        moves = MoveRows(
            kinds=_MOVE_OF[kinds],
            targets=self.targets.rows[geometries.begin :],
            q_near=geometries.joints,
            has_q_near=_HAS_Q_NEAR[kinds],
            velocities=timings.velocities,
            accelerations=timings.accelerations,
            durations=timings.wire_times,
            blend_radii=geometries.path.radius,
            others={},
        )
        others = {
            row: self._special(geometries, moves, row) for row in self._special_rows(geometries)
        }
        moves = replace(moves, others=others)
        indices = np.arange(geometries.begin, geometries.begin + len(geometries), dtype=np.int32)
        return PlannedRows(
            waypoints=indices,
            lengths=curves.length,
            angles=curves.angle,
            durations=timings.durations,
            blend_entries=timings.chain.blend_entries,
            joints=geometries.joints,
            primitives=moves,
            report_lines=segment_lines(geometries, timings, moves, self.reasons),
        )

    def _special_rows(self, geometries: SegmentGeometries) -> list[int]:
        """Return the rows whose primitives are more than numbers."""
        special = geometries.kinds == SegmentType.CIRCULAR
        special |= not self.options.dialect.supports_q_near
        special[list(geometries.waypoints.postures)] = True
        special[0] |= geometries.waits
        return rows_where(special)

    # -- checks of the start ---------------------------------------------------------------------

    def _check_robot(self) -> None:
        """Refuse a robot whose TCP is not where the kinematics puts it."""
        state = self.state
        predicted = self.arm.forward(state.actual_q) @ state.T_flange_tcp
        distance = predicted.distance_to(state.actual_tcp_pose)
        angle = predicted.angle_to(state.actual_tcp_pose)
        if distance > MAX_MISMATCH_POSITION or angle > MAX_MISMATCH_ANGLE:
            raise RobotNotReady(
                f'The robot reports its TCP {1e3 * distance:.1f} mm and {angle:.3f} rad away from '
                f'where the kinematics of a {self.arm.model.name} puts it; check '
                'ur_type and the TCP. If the software of the robot does not report its TCP (RTDE '
                'field tcp_offset), the TCP has to be the flange.'
            )

    def _check_approach(self) -> None:
        """Refuse a first point that is too far away."""
        distance = self.state.actual_tcp_pose.distance_to(self.targets[0])
        bound = self.options.max_approach_distance
        if 0.0 < bound < distance:
            raise InvalidGoal(
                point_field(0, 'pose.position'),
                f'is {distance:.3f} m away from the tool, more '
                f'than max_approach_distance = {bound:g} m',
                'move closer first, add points in between, or raise the parameter',
            )

    def _check_start_pose(self) -> None:
        """Refuse a first point at time 0 at which the robot is not."""
        actual, target = self.state.actual_tcp_pose, self.targets[0]
        distance, angle = actual.distance_to(target), actual.angle_to(target)
        options = self.options
        if distance > options.start_tolerance_position or angle > options.start_tolerance_angle:
            raise InvalidGoal(
                point_field(0, 'time_from_start'),
                f'is 0, but the tool is {distance:.4f} m and '
                f'{angle:.4f} rad away from the point (allowed are '
                f'{options.start_tolerance_position:g} m and {options.start_tolerance_angle:g} '
                'rad)',
                'give the first point a time greater than 0',
            )

    def _check_start_posture(self) -> None:
        """Refuse a first point at time 0 with another posture than that of the robot."""
        posture = self.goal.waypoints.postures.get(0)
        if posture:
            named = named_joints(posture, self.options.tf_prefix)
            q = self.state.actual_q
            chosen = self.kinematics.solve_posture(
                self.targets[0], named, q, point_field(0, 'pose')
            )
            # The robot is within the tolerance of the start, not exactly there.
            near = self.kinematics.nearest(self.targets[0], q, point_field(0, 'pose'))
            if clause := describe_miss(near, chosen, named):
                raise InvalidPosture(
                    f'{point_field(0, "posture")} is not the one in which the robot stands: '
                    f'{clause}; give the first point a time greater than 0.'
                )

    # -- primitives ------------------------------------------------------------------------------

    def _special(self, geometries: SegmentGeometries, moves: MoveRows, row: int) -> Primitive:
        """Return a primitive that is more than its row of numbers."""
        point, kind = geometries.begin + row, geometries.kinds[row]
        joints = vector6(geometries.joints[row].tolist())
        primitive: Primitive
        if geometries.waits and row == 0:  # no move of the robot does: a spline that rests
            primitive = Spline(
                target=self.state.actual_q,
                velocities=ZERO6,
                duration=float(moves.durations[row]),
            )
        elif kind == SegmentType.CIRCULAR:
            primitive = self._arc(geometries, moves, row, joints)
        else:
            move = moves[row]
            assert not isinstance(move, MoveC | Spline | Stop)
            primitive = move
            if kind in JOINT_SPACE_TYPES or row in geometries.waypoints.postures:
                primitive = replace(move, q_near=self._q_near(point, joints))
        primitive, reason = adapt_to_dialect(primitive, point, joints, self.options)
        if reason:
            self.reasons.setdefault(point, []).append(reason)
        return primitive

    def _q_near(self, point: int, joints: Joints) -> Joints:
        """Return the chosen solution; a full posture itself where it selects the same one."""
        posture = self.goal.waypoints.postures.get(point, NO_POSTURE)
        wanted = full_posture(named_joints(posture, self.options.tf_prefix))
        if wanted is not None:
            found = self.kinematics.nearest(
                self.targets[point], wanted, point_field(point, 'pose')
            )
            if max_joint_change(found, joints) <= SAME_SOLUTION:
                return wanted
        return joints

    def _arc(
        self, geometries: SegmentGeometries, moves: MoveRows, row: int, joints: Joints
    ) -> MoveC:
        """Return the arc, with joint fields where target or via carry a posture."""
        point, segments = geometries.begin + row, geometries.segments
        segment_via = segments.via(row)
        assert segment_via is not None
        T_base_via = self.goal.T_base_frame @ segment_via
        via: Target = T_base_via
        target: Target = self.targets[point]
        at_point, at_via = row in geometries.waypoints.postures, segments.via_postures.get(row)
        wanted = [name for name, has in (('the point', at_point), ('the via', at_via)) if has]
        if wanted and (reason := explain_poses_only(self.options)):
            self.remarks.append(
                f'point {point}: sent as poses despite the posture of '
                f'{" and ".join(wanted)}, because {reason}'
            )
        elif wanted:
            self.reasons.setdefault(point, []).append(
                f'{" and ".join(wanted)} {"has" if len(wanted) == 1 else "have"} a posture'
            )
            target = joints if at_point else target
            if at_via:
                arc = geometries.path.curves.others[row]
                via = self._via_joints(point, arc, at_via, T_base_via)
        return MoveC(
            target=target,
            via=via,
            velocity=float(moves.velocities[row]),
            acceleration=float(moves.accelerations[row]),
            blend_radius=float(moves.blend_radii[row]),
            mode=ArcMode(int(segments.arc_modes[row])),
        )

    def _via_joints(self, point: int, arc: SegmentCurve, posture: Posture, via: Pose) -> Joints:
        """
        Return the solution of the via's pose that its posture selects.

        :raises InvalidPosture: the arm follows the arc in another configuration.
        """
        assert isinstance(arc, ArcCurve)
        location = segment_field(point, 'via')
        first, last = np.searchsorted(self.samples.segment, (point, point + 1))
        row = int(first + np.argmin(np.abs(self.samples.fraction[first:last] - arc.u_via)))
        passing = vector6(self.samples.q[row].tolist())
        # The orientation of the via does not shape the arc: continue from the arc to its pose.
        q = self.kinematics.nearest(via, passing, location)
        named = named_joints(posture, self.options.tf_prefix)
        chosen = self.kinematics.solve_posture(via, named, q, location)
        if clause := describe_miss(q, chosen, named):
            raise InvalidPosture(
                f'{segment_field(point, "via_posture")} is not the configuration of the '
                f'arm on the arc: {clause}; leave it empty, or start the arc in that '
                'configuration.'
            )
        return chosen
