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

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
import gc
from math import inf, nan
from pkgutil import resolve_name
from typing import TypeAlias

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.errors import (
    InvalidGoal,
    InvalidPosture,
    RobotNotReady,
)
from ur_cartesian_driver.motion.goal import Goal, Segment, SegmentType
from ur_cartesian_driver.motion.move_rows import MoveRows, MOVES
from ur_cartesian_driver.motion.plan import Plan, PlannedRows, PlannedSegment, ReferencePath
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.pose_rows import Floats, PoseRows, transform_rows
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
    Target,
)
from ur_cartesian_driver.motion.robot_state import RobotState
from ur_cartesian_driver.motion.vectors import ZERO6
from ur_cartesian_driver.planning.geometry.curves import ArcCurve
from ur_cartesian_driver.planning.geometry.samples import PathSamples
from ur_cartesian_driver.planning.moves.joint_path_planner import JointPathPlanner, SAME_SOLUTION
from ur_cartesian_driver.planning.moves.plan_report import (
    blend_remarks,
    segment_lines,
    stop_remarks,
    tightest_remark,
)
from ur_cartesian_driver.planning.moves.reference_path import reference_path
from ur_cartesian_driver.planning.moves.segment_data import SegmentGeometry, SegmentTiming
from ur_cartesian_driver.planning.moves.segment_drafts import JOINT_SPACE_TYPES
from ur_cartesian_driver.planning.moves.segment_geometries import SegmentGeometries
from ur_cartesian_driver.planning.moves.segment_timing import schedule
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
)
from ur_cartesian_driver.planning.request.ignored_fields import ignored_remarks
from ur_cartesian_driver.planning.request.io_commands import add_safe_outputs
from ur_cartesian_driver.planning.request.validate import check
from ur_cartesian_driver.planning.spline.spline_planner import (
    plan_spline,
    SplineState,
    stretch_times,
)

#: How far a CB3 arm may stand beside its target: 0.2 to 0.4 mrad were recorded of a UR10 [m].
CB3_STATIC_ERROR = 3e-4
#: How far the reported TCP may be from where the kinematics puts it [m], [rad]. Calibration shifts
#: it by some millimetres; another model or another TCP shifts it much more.
MAX_MISMATCH_POSITION = 0.015
MAX_MISMATCH_ANGLE = 0.05

#: The kind of the primitive's row, by type; that of an arc has no meaning.
_KINDS = {
    SegmentType.JOINT: MOVES.index(MoveJ),
    SegmentType.LINEAR: MOVES.index(MoveL),
    SegmentType.CIRCULAR: MOVES.index(MoveL),
    SegmentType.PROCESS: MOVES.index(MoveP),
    SegmentType.OPTIMIZED_JOINT: MOVES.index(OptimoveJ),
    SegmentType.OPTIMIZED_LINEAR: MOVES.index(OptimoveL),
}


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
    with _garbage_collection_paused():
        return _plan(goal, state, arm, options, running)


def _plan(
    goal: Goal,
    state: RobotState,
    arm: Arm,
    options: PlanningOptions,
    running: PlannedSegment | None,
) -> Plan:
    table = check(goal, options)
    table = add_safe_outputs(apply_default_tolerances(table, options), options)
    retargeted = retarget_to_tcp(table, state, options)
    planner = GoalPlanner(retargeted, state.T_flange_tcp, arm, options, running)
    plan_goal: PlanGoal = resolve_name(planner.mode.traits.planner)
    return plan_goal(planner)


def plan_moves(planner: GoalPlanner) -> Plan:
    """Return the plan of a goal whose points are joined by motion commands of the robot."""
    goal, state, arm, options = planner.goal, planner.state, planner.arm, planner.options
    table = planner.geometries()
    geometries = list(table)
    samples = planner.samples
    lines = clearance_lines(
        arm,
        tool_tips(goal, planner.T_flange_active),
        options,
        samples.q,
        state.actual_q,
        samples.segment,
        samples.fraction,
    )
    margins = planner.joint_path_planner.path_margins
    timings, chain = schedule(
        geometries, options, arm.model, margins.blend_samples, planner.running
    )
    entries = chain.blend_entries
    reference = reference_path(state.actual_tcp_pose, table.path, geometries, chain.times)
    segments = place_outputs(
        planner.segments(geometries, timings, entries),
        reference,
        goal.io_commands,
        blend_halves=entries[:, -1],
    )
    remarks = [
        *ignored_remarks(goal),
        *(timing.remark for timing in timings if timing.remark),
        *blend_remarks(goal, geometries, timings),
        *lines,
        *stop_remarks(geometries),
        tightest_remark(geometries),
    ]
    return planner.plan(goal, segments, reference, remarks)


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
    segments = place_outputs(found.segments, found.reference, goal.io_commands)
    return planner.plan(
        stretch_times(goal, found.stretch), segments, found.reference, found.remarks
    )


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
        goal, state = retargeted.goal, retargeted.state
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
        self.joint_path_planner = JointPathPlanner(
            goal, self.targets.rows, self.kinematics, options, self.remarks, self.reasons
        )
        #: The whole joint path, sampled; set by :meth:`geometries`.
        self.samples: PathSamples
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
        geometries = self.joint_path_planner.geometries(
            first, self.state.actual_tcp_pose, self.state.actual_q, times
        )
        self.samples = self.joint_path_planner.path_margins.samples()
        return geometries

    def plan(
        self,
        goal: Goal,
        segments: PlannedRows,
        reference: ReferencePath,
        remarks: Iterable[str],
    ) -> Plan:
        """Return the plan; its remarks follow those collected."""
        return Plan(
            goal=goal,
            segments=segments,
            reference=reference,
            start=self.state.actual_q,
            remarks=(*self.remarks, *remarks),
            T_flange_active=self.T_flange_active,
            T_flange_tcp=self._retargeted.T_flange_tcp,
            T_tcp_controlled=self._retargeted.T_tcp_controlled,
            execution=self.mode,
        )

    def segments(
        self,
        geometries: Sequence[SegmentGeometry],
        timings: Sequence[SegmentTiming],
        blend_entries: Floats,
    ) -> PlannedRows:
        """
        Return the primitive of each segment and what is expected of it.

        :param blend_entries: (n, 5) as in the rows.
        """
        n = len(geometries)
        joints = np.array([geometry.joints for geometry in geometries])
        kinds = np.array([_KINDS[geometry.kind] for geometry in geometries])
        moves = MoveRows(
            kinds=kinds,
            targets=self.targets[geometries[0].index :].rows,
            q_near=joints,
            has_q_near=np.array([geometry.kind in JOINT_SPACE_TYPES for geometry in geometries]),
            velocities=np.array([timing.velocity for timing in timings]),
            accelerations=np.array([timing.acceleration for timing in timings]),
            durations=np.array([timing.wire_time for timing in timings]),
            blend_radii=np.array(
                [
                    geometry.blend_after.radius if geometry.blend_after else 0.0
                    for geometry in geometries
                ]
            ),
            others={},
        )
        others = {
            row: self._special(geometry, moves, row)
            for row, geometry in enumerate(geometries)
            if self._is_special(geometry)
        }
        moves = replace(moves, others=others)
        return PlannedRows(
            waypoints=np.arange(geometries[0].index, geometries[0].index + n, dtype=np.int32),
            lengths=np.array([geometry.curve.length for geometry in geometries]),
            angles=np.array([geometry.curve.angle for geometry in geometries]),
            durations=np.array([timing.duration for timing in timings]),
            blend_entries=blend_entries,
            joints=joints,
            primitives=moves,
            report_lines=segment_lines(geometries, timings, moves, self.reasons),
        )

    def _is_special(self, geometry: SegmentGeometry) -> bool:
        """Tell whether a primitive is more than a row of numbers."""
        return (
            geometry.waits
            or geometry.kind == SegmentType.CIRCULAR
            or bool(geometry.waypoint.posture)
            or not self.options.dialect.supports_q_near
        )

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

    def _special(self, geometry: SegmentGeometry, moves: MoveRows, row: int) -> Primitive:
        """Return a primitive that is more than its row of numbers."""
        primitive: Primitive
        if geometry.waits:  # no move of the robot does: a spline in which the joints rest
            primitive = Spline(
                target=self.state.actual_q,
                velocities=ZERO6,
                duration=float(moves.durations[row]),
            )
        elif geometry.kind == SegmentType.CIRCULAR:
            primitive = self._arc(geometry, moves, row)
        else:
            move = moves[row]
            assert not isinstance(move, MoveC | Spline)
            primitive = move
            if geometry.kind in JOINT_SPACE_TYPES or geometry.waypoint.posture:
                primitive = replace(move, q_near=self._q_near(geometry))
        primitive, reason = adapt_to_dialect(
            primitive, geometry.index, geometry.joints, self.options
        )
        if reason:
            self.reasons.setdefault(geometry.index, []).append(reason)
        return primitive

    def _q_near(self, geometry: SegmentGeometry) -> Joints:
        """Return the chosen solution; a full posture itself where it selects the same one."""
        wanted = full_posture(named_joints(geometry.waypoint.posture, self.options.tf_prefix))
        if wanted is not None:
            location = point_field(geometry.index, 'pose')
            found = self.kinematics.nearest(self.targets[geometry.index], wanted, location)
            if max_joint_change(found, geometry.joints) <= SAME_SOLUTION:
                return wanted
        return geometry.joints

    def _arc(self, geometry: SegmentGeometry, moves: MoveRows, row: int) -> MoveC:
        """Return the arc, with joint fields where target or via carry a posture."""
        segment = geometry.segment
        assert segment.via is not None
        assert isinstance(geometry.curve, ArcCurve)
        T_base_via = self.goal.T_base_frame @ segment.via
        via: Target = T_base_via
        target: Target = self.targets[geometry.index]
        wanted = [
            name
            for name, posture in (
                ('the point', geometry.waypoint.posture),
                ('the via', segment.via_posture),
            )
            if posture
        ]
        if wanted and (reason := explain_poses_only(self.options)):
            self.remarks.append(
                f'point {geometry.index}: sent as poses despite the posture of '
                f'{" and ".join(wanted)}, because {reason}'
            )
        elif wanted:
            self.reasons.setdefault(geometry.index, []).append(
                f'{" and ".join(wanted)} {"has" if len(wanted) == 1 else "have"} a posture'
            )
            target = geometry.joints if geometry.waypoint.posture else target
            via = self._via_joints(geometry, segment, T_base_via) if segment.via_posture else via
        return MoveC(
            target=target,
            via=via,
            velocity=float(moves.velocities[row]),
            acceleration=float(moves.accelerations[row]),
            blend_radius=float(moves.blend_radii[row]),
            mode=segment.arc_mode,
        )

    def _via_joints(self, geometry: SegmentGeometry, segment: Segment, via: Pose) -> Joints:
        """
        Return the solution of the via's pose that its posture selects.

        :raises InvalidPosture: the arm follows the arc in another configuration.
        """
        assert isinstance(geometry.curve, ArcCurve)
        location = segment_field(geometry.index, 'via')
        passing = self.samples.joints_at(geometry.index, geometry.curve.u_via)
        # The orientation of the via does not shape the arc: continue from the arc to its pose.
        q = self.kinematics.nearest(via, passing, location)
        named = named_joints(segment.via_posture, self.options.tf_prefix)
        chosen = self.kinematics.solve_posture(via, named, q, location)
        if clause := describe_miss(q, chosen, named):
            raise InvalidPosture(
                f'{segment_field(geometry.index, "via_posture")} is not the configuration of the '
                f'arm on the arc: {clause}; leave it empty, or start the arc in that '
                'configuration.'
            )
        return chosen


@contextmanager
def _garbage_collection_paused() -> Iterator[None]:
    """
    Keep the garbage collector from running.

    A plan of ten thousand points is hundreds of thousands of objects. None of them becomes garbage
    before the plan is made, but the collector would scan them again and again.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
