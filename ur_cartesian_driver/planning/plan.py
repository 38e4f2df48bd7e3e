# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
From a goal to a plan: choose the primitives, and refuse what the arm cannot do.

The stages: :func:`~.validate.check` (no robot needed), the way of every segment with the
configuration in which it arrives, blends, speeds, and then the primitives, the reference path and
the report. The first reason to refuse that is met is raised; nothing has been sent by then.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import degrees

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.errors import (
    InvalidGoal,
    InvalidPosture,
    JointLimitExceeded,
    NearSingularity,
    RobotNotReady,
)
from ur_cartesian_driver.motion.goal import Goal, Segment, SegmentType
from ur_cartesian_driver.motion.plan import Plan, PlannedSegment
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.primitive import (
    Joints,
    MoveC,
    MoveJ,
    MoveL,
    MoveP,
    OptimoveJ,
    OptimoveL,
    Primitive,
    Target,
)
from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.planning.controlled import carried
from ur_cartesian_driver.planning.corner import Corner
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.path import Arc, JointLine, Line, Path, same, SAME_POSITION
from ur_cartesian_driver.planning.postures import (
    full,
    missed,
    named_joints,
    Reach,
    Trace,
)
from ur_cartesian_driver.planning.reference import reference_path
from ur_cartesian_driver.planning.report import ignored, note
from ur_cartesian_driver.planning.spoken import poses_only, spoken, spoken_radius
from ur_cartesian_driver.planning.timing import Leg, schedule, Timing
from ur_cartesian_driver.planning.tolerances import with_default_tolerances
from ur_cartesian_driver.planning.validate import (
    arc_of,
    check,
    check_blends_fit,
    is_timed,
    no_way,
    PLAIN,
    point_field,
    segment_field,
    segment_of,
)

#: How far the reported TCP may be from where the kinematics puts it [m], [rad]. Calibration moves
#: it by some millimetres; another model or another TCP moves it by much more.
LARGEST_MISMATCH_POSITION = 0.015
LARGEST_MISMATCH_ANGLE = 0.05
#: Solutions that differ by less are one [rad].
_SAME_SOLUTION = 1e-6

_LINEAR, _JOINT = SegmentType.LINEAR, SegmentType.JOINT
_OPTIMIZED = (SegmentType.OPTIMIZED_LINEAR, SegmentType.OPTIMIZED_JOINT)
#: Motions that can only be blended into from some others; all else stops before them.
_BLENDS_FROM = {
    SegmentType.JOINT: (_LINEAR, _JOINT),
    SegmentType.OPTIMIZED_LINEAR: (_LINEAR, _JOINT, *_OPTIMIZED),
    SegmentType.OPTIMIZED_JOINT: (_LINEAR, _JOINT, *_OPTIMIZED),
}


def plan(goal: Goal, state: RobotState, arm: Arm, options: PlanningOptions) -> Plan:
    """
    Return the plan of a goal for a robot that rests in a state.

    :param state: joints, TCP pose and TCP offset are read from it.
    :param arm: the kinematics, the robot's own calibrated one where it is known.
    :raises GoalRefused: the subclass that fits; its text names place, quantity, value and bound.
    """
    check(goal, options)
    goal = with_default_tolerances(goal, options)
    T_flange_active = state.T_flange_tcp
    about = carried(goal, state, options)
    goal, state = about.goal, about.state
    planner = _Planner(goal, state, arm, options)
    legs = planner.blended(planner.legs())
    timings = schedule(legs, options, arm.model)
    segments = tuple(planner.segment(leg, timing)
                     for leg, timing in zip(legs, timings, strict=True))
    remarks = [*about.remarks, *planner.remarks, *ignored(goal),
               *(timing.remark for timing in timings if timing.remark)]
    return Plan(goal=goal, segments=segments, start=state.actual_q, remarks=tuple(remarks),
                reference=reference_path(state.actual_tcp_pose, legs, timings),
                T_flange_active=T_flange_active, T_flange_tcp=about.T_flange_tcp,
                T_tcp_controlled=about.T_tcp_controlled)


class _Planner:
    """The data that the stages share; made for one goal and thrown away."""

    def __init__(self, goal: Goal, state: RobotState, arm: Arm, options: PlanningOptions) -> None:
        self.goal, self.state, self.options = goal, state, options
        self.reach = Reach(arm, state.T_flange_tcp)
        self.remarks: list[str] = []
        #: By point: why its primitive is not the plain one.
        self.why: dict[int, list[str]] = {}
        self.targets = [goal.T_base_frame @ point.pose for point in goal.waypoints]
        self.timed = is_timed(goal)
        if self.timed and options.dialect.is_coarse:
            self.remarks.append(f'all points: times are kept by speeds, because robot programs '
                                f'of wire dialect {options.dialect.name} count in milliseconds')
        self._check_robot()

    # -- before the first segment ----------------------------------------------------------------

    def _check_robot(self) -> None:
        """Refuse where the robot is not what the kinematics thinks, or is somewhere else."""
        state = self.state
        predicted = self.reach.arm.forward(state.actual_q) @ state.T_flange_tcp
        apart = predicted.distance_to(state.actual_tcp_pose)
        angle = predicted.angle_to(state.actual_tcp_pose)
        if apart > LARGEST_MISMATCH_POSITION or angle > LARGEST_MISMATCH_ANGLE:
            raise RobotNotReady(
                f'The robot reports its TCP {1e3 * apart:.1f} mm and {angle:.3f} rad away from '
                f'where the kinematics of a {self.reach.arm.model.name} puts it; check ur_type '
                'and the TCP.')
        self._check_approach()

    def _check_approach(self) -> None:
        distance = self.state.actual_tcp_pose.distance_to(self.targets[0])
        bound = self.options.max_approach_distance
        if 0.0 < bound < distance:
            raise InvalidGoal(
                point_field(0, 'pose.position'), f'is {distance:.3f} m away from the tool, more '
                f'than max_approach_distance = {bound:g} m', 'move nearer first, or begin the '
                'goal with points in between, or raise the parameter')

    def _stands_at_first(self) -> bool:
        """
        Tell whether the first point is at time 0 and so needs no motion.

        :raises InvalidGoal: it is at time 0, and the robot is not there.
        """
        if not self.timed or self.goal.waypoints[0].time != 0.0:
            return False
        actual, target = self.state.actual_tcp_pose, self.targets[0]
        apart, angle = actual.distance_to(target), actual.angle_to(target)
        options = self.options
        if apart > options.start_tolerance_position or angle > options.start_tolerance_angle:
            raise InvalidGoal(
                point_field(0, 'time_from_start'), f'is 0, but the tool is {apart:.4f} m and '
                f'{angle:.4f} rad away from the point (allowed are '
                f'{options.start_tolerance_position:g} m and {options.start_tolerance_angle:g} '
                'rad)', 'give the way to the first point a time')
        self._check_start_posture()
        self.remarks.append('point 0: at time 0 and where the robot stands, so nothing is sent '
                            'for it')
        return True

    def _check_start_posture(self) -> None:
        posture = self.goal.waypoints[0].posture
        if posture:
            named = named_joints(posture, self.options.tf_prefix)
            q = self.state.actual_q
            chosen = self.reach.chosen(self.targets[0], named, q, point_field(0, 'pose'))
            # The robot stands within the start's tolerance, not exactly there.
            near = self.reach.nearest(self.targets[0], q, point_field(0, 'pose'))
            if clause := missed(near, chosen, named):
                raise InvalidPosture(f'{point_field(0, "posture")} is not the one in which the '
                                     f'robot stands: {clause}; give the first point a time.')

    # -- ways ------------------------------------------------------------------------------------

    def legs(self) -> list[Leg]:
        """Return the way of every segment and the configuration it arrives in."""
        legs: list[Leg] = []
        T_base_tcp, q = self.state.actual_tcp_pose, self.state.actual_q
        begin = 1 if self._stands_at_first() else 0
        before = 0.0
        for i in range(begin, len(self.goal.waypoints)):
            leg = self._leg(i, T_base_tcp, q)
            if self.timed and leg.time is None:
                leg = replace(leg, time=self.goal.waypoints[i].time - before)
            if leg.path.length <= SAME_POSITION and self._no_way(leg):
                leg = self._already_there(leg)
            legs.append(leg)
            T_base_tcp, q, before = leg.path.end, leg.joints, self.goal.waypoints[i].time
        return legs

    def _leg(self, i: int, T_base_tcp: Pose, q: Joints) -> Leg:
        """Return the way of one segment from a pose and a configuration."""
        goal, target = self.goal, self.targets[i]
        segment = segment_of(goal, i)
        kind = _LINEAR if segment.type == SegmentType.AUTO else SegmentType(segment.type)
        path: Path
        if kind in (_JOINT, SegmentType.OPTIMIZED_JOINT):
            path, trace = self._joint_way(i, q)
        else:
            if kind == SegmentType.CIRCULAR:
                assert segment.via is not None
                via = goal.T_base_frame @ segment.via
                path = arc_of(i, T_base_tcp, via, target, segment.arc_mode)
                self._say_fixed(i, path)
            else:
                path = Line.between(T_base_tcp, target)
            kind, path, trace = self._followed(i, kind, path, q)
        return Leg(index=i, kind=kind, waypoint=goal.waypoints[i], segment=segment, path=path,
                   q_start=q, trace=trace, time=None)

    def _say_fixed(self, i: int, arc: Arc) -> None:
        """Say where an arc that keeps to its tangent ends in another orientation than asked."""
        off = arc.end.angle_to(self.targets[i])
        if off > self.options.start_tolerance_angle:
            self.remarks.append(
                f'point {i}: the orientation of the point is ignored, because arc_mode FIXED '
                f'keeps it to the tangent; it arrives {degrees(off):.1f} degrees off')

    def _joint_way(self, i: int, q: Joints) -> tuple[JointLine, Trace]:
        """Return the joint line to a point, in the posture where one is given."""
        posture, place = self.goal.waypoints[i].posture, point_field(i, 'pose')
        if posture:
            named = named_joints(posture, self.options.tf_prefix)
            chosen = self.reach.chosen(self.targets[i], named, q, place)
        else:
            chosen = self.reach.nearest(self.targets[i], q, place)
        path = JointLine.between(self.reach.arm, self.reach.T_flange_tcp, q, chosen)
        return path, [(1.0, chosen)]

    def _followed(self, i: int, kind: SegmentType, path: Path, q: Joints
                  ) -> tuple[SegmentType, Path, Trace]:
        """
        Return a straight or circular way with its configurations, or the joint move in its place.

        :raises InvalidPosture: it does not arrive in the posture.
        """
        posture = self.goal.waypoints[i].posture
        try:
            trace = self.reach.follow(path, q, point_field(i, 'pose'))
            if posture:
                self._check_arrival(i, path, trace[-1][1])
        except (InvalidPosture, NearSingularity, JointLimitExceeded) as refusal:
            if not posture or self.options.on_posture_change != 'movej':
                raise
            self.remarks.append(f'point {i}: JOINT instead of {kind.name} '
                                f'(on_posture_change = movej), because otherwise: {refusal}')
            self.why.setdefault(i, []).append('the posture needs a joint move')
            return (_JOINT, *self._joint_way(i, q))
        return kind, path, trace

    def _check_arrival(self, i: int, path: Path, q: Joints) -> None:
        named = named_joints(self.goal.waypoints[i].posture, self.options.tf_prefix)
        chosen = self.reach.chosen(path.end, named, q, point_field(i, 'pose'))
        if clause := missed(q, chosen, named):
            raise InvalidPosture(
                f'{point_field(i, "posture")} cannot be reached by a straight or circular move: '
                f'{clause}; use a JOINT segment, or set on_posture_change to movej.')

    def _no_way(self, leg: Leg) -> bool:
        if isinstance(leg.path, JointLine):
            return max(leg.path.travel) <= _SAME_SOLUTION
        return same(leg.path.start, leg.path.end)

    def _already_there(self, leg: Leg) -> Leg:
        """Return the leg to a first point at which the robot stands; others are refused."""
        i = leg.index
        if i > 0:
            raise no_way(self.goal, i)
        waits = f'; its {leg.time:g} s are not waited' if leg.time else ''
        self.remarks.append(f'point 0: the robot stands there already{waits}')
        self.why[0] = ['the robot stands there already']
        kind = leg.kind if leg.kind == _JOINT else _LINEAR
        return replace(leg, kind=kind, time=None, segment=replace(
            PLAIN, type=leg.segment.type), waypoint=replace(leg.waypoint, twist=(0.0,) * 6))

    # -- blends ----------------------------------------------------------------------------------

    def blended(self, legs: list[Leg]) -> list[Leg]:
        """Return the legs with the corners between them."""
        if legs[0].segment.blend_radius > 0.0 and len(legs) > 1:
            check_blends_fit(self.goal, legs[0].index, legs[0].path.start.distance_to(
                legs[0].path.end), 0.0, legs[0].segment.blend_radius)
        for k in range(len(legs) - 1):
            first, second = legs[k], legs[k + 1]
            radius = spoken_radius(first.segment.blend_radius, first.index,
                                   self.options.dialect, self.remarks)
            if radius <= SAME_POSITION or not self._can_blend(first, second):
                continue  # the wire rounds so small a radius to none
            process = first.kind == second.kind == SegmentType.PROCESS
            corner = Corner.between(first.path, second.path, radius, fillet=process)
            legs[k], legs[k + 1] = replace(first, after=corner), replace(second, before=corner)
        for leg in legs:
            if leg.u_before > leg.u_after + 1e-9:
                raise InvalidGoal(segment_field(leg.index, 'blend_radius'),
                                  f'is too large: the blends at both ends of the segment to '
                                  f'point {leg.index} overlap', 'make them smaller')
        return legs

    def _can_blend(self, first: Leg, second: Leg) -> bool:
        allowed = _BLENDS_FROM.get(second.kind)
        if allowed is None or first.kind in allowed:
            return True
        self.remarks.append(
            f'point {first.index}: stops instead of blending, because the robot cannot blend '
            f'from {first.kind.name} into {second.kind.name}')
        return False

    # -- primitives ------------------------------------------------------------------------------

    def segment(self, leg: Leg, timing: Timing) -> PlannedSegment:
        """Return the primitive of a leg and what is expected of it."""
        primitive, why = spoken(self._primitive(leg, timing), leg.index, leg.joints, self.options)
        if why:
            self.why.setdefault(leg.index, []).append(why)
        return PlannedSegment(
            primitive=primitive, waypoint=leg.index, length=leg.path.length,
            angle=leg.path.angle, duration=timing.duration, joints=leg.joints,
            note=note(leg, timing, primitive, self.why.get(leg.index, ())))

    def _primitive(self, leg: Leg, timing: Timing) -> Primitive:
        blend = leg.after.radius if leg.after else 0.0
        v, a, target = timing.velocity, timing.acceleration, self.targets[leg.index]
        match leg.kind:
            case SegmentType.JOINT:
                return MoveJ(target=target, q_near=self._q_near(leg), velocity=v, acceleration=a,
                             duration=timing.wire_time, blend_radius=blend)
            case SegmentType.PROCESS:
                return MoveP(target=target, q_near=self._posture_near(leg), velocity=v,
                             acceleration=a, blend_radius=blend)
            case SegmentType.CIRCULAR:
                return self._arc(leg, v, a, blend)
            case SegmentType.OPTIMIZED_JOINT:
                return OptimoveJ(target=target, q_near=self._q_near(leg), velocity=v,
                                 acceleration=a, blend_radius=blend)
            case SegmentType.OPTIMIZED_LINEAR:
                return OptimoveL(target=target, q_near=self._posture_near(leg), velocity=v,
                                 acceleration=a, blend_radius=blend)
            case _:
                return MoveL(target=target, q_near=self._posture_near(leg), velocity=v,
                             acceleration=a, duration=timing.wire_time, blend_radius=blend)

    def _posture_near(self, leg: Leg) -> Joints | None:
        return self._q_near(leg) if leg.waypoint.posture else None

    def _q_near(self, leg: Leg) -> Joints:
        """Return the chosen solution; a full posture itself where it leads to the same one."""
        wanted = full(named_joints(leg.waypoint.posture, self.options.tf_prefix))
        if wanted is not None:
            place = point_field(leg.index, 'pose')
            found = self.reach.nearest(self.targets[leg.index], wanted, place)
            if max(abs(a - b) for a, b in zip(found, leg.joints, strict=True)) <= _SAME_SOLUTION:
                return wanted
        return leg.joints

    def _arc(self, leg: Leg, velocity: float, acceleration: float, blend: float) -> MoveC:
        """Return the arc, with joint fields where target or via carry a posture."""
        segment = leg.segment
        assert segment.via is not None
        assert isinstance(leg.path, Arc)
        T_base_via = self.goal.T_base_frame @ segment.via
        via: Target = T_base_via
        target: Target = self.targets[leg.index]
        wanted = [name for name, posture in (
            ('the point', leg.waypoint.posture), ('the via', segment.via_posture)) if posture]
        if wanted and (reason := poses_only(self.options)):
            self.remarks.append(
                f'point {leg.index}: sent as poses in spite of the posture of '
                f'{" and ".join(wanted)}, because {reason}')
        elif wanted:
            self.why.setdefault(leg.index, []).append(
                f'{" and ".join(wanted)} {"has" if len(wanted) == 1 else "have"} a posture')
            target = leg.joints if leg.waypoint.posture else target
            via = self._via_joints(leg, segment, T_base_via) if segment.via_posture else via
        return MoveC(target=target, via=via, velocity=velocity, acceleration=acceleration,
                     blend_radius=blend, mode=segment.arc_mode)

    def _via_joints(self, leg: Leg, segment: Segment, via: Pose) -> Joints:
        """
        Return the solution of the via's pose that its posture means.

        :raises InvalidPosture: the arm goes along the arc in another configuration.
        """
        assert isinstance(leg.path, Arc)
        place = segment_field(leg.index, 'via')
        passing = _at(leg.trace, leg.q_start, leg.path.u_via)
        # The orientation of the via does not shape the arc, so go on from there to its pose.
        q = self.reach.nearest(via, passing, place)
        named = named_joints(segment.via_posture, self.options.tf_prefix)
        chosen = self.reach.chosen(via, named, q, place)
        if clause := missed(q, chosen, named):
            raise InvalidPosture(
                f'{segment_field(leg.index, "via_posture")} is not the configuration in which '
                f'the arm goes along the arc: {clause}; leave it empty, or go to the start of '
                'the arc in that configuration.')
        return chosen


def _at(trace: Sequence[tuple[float, Joints]], q_start: Joints, u: float) -> Joints:
    """Return the configuration of the place of a trace that is nearest to ``u``."""
    return min([(0.0, q_start), *trace], key=lambda place: abs(place[0] - u))[1]

