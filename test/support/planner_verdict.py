# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Compare the planner's verdict on a goal with the motion of a robot that gets the goal anyway.

A refused goal has no primitives. So the points before the refused one are planned, and the refused
point is sent as a driver without a pre-flight check would send it: type, pose, speeds.
"""

from dataclasses import dataclass, replace
from math import inf
import re
from typing import Any

import numpy as np
from robot_in_memory import ProgramRun

from ur_cartesian_driver.kinematics.inverse import nearest, nearest_to_posture
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    InvalidPosture,
    JointLimitExceeded,
    NearSingularity,
    Unreachable,
)
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.goal.goal import SegmentType
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.motion.plan.primitive import (
    MoveC,
    MoveJ,
    MoveL,
    MoveP,
    OptimoveJ,
    OptimoveL,
)
from ur_cartesian_driver.planning import plan, PlanningOptions

#: Checks of speeds and distances are off; geometry is checked without a margin.
OPTIONS = PlanningOptions(
    max_approach_distance=0.0,
    max_tool_speed=0.0,
    on_too_fast='slow',
    self_collision='off',
    singularity_margin_wrist=0.0,
    singularity_margin_elbow=0.0,
    singularity_margin_shoulder=0.0,
)

#: The property of the arm that each refusal is about.
KINDS = {
    Unreachable: 'reach',
    JointLimitExceeded: 'limit',
    NearSingularity: 'branch',
    InvalidPosture: 'branch',
}

#: Motions above the first bound run in longer cycles [s]; motions above the second do not run [s].
SLOW_CYCLE_DURATION, MAX_RUN_DURATION = 2.5, 10.0
#: Distance from the border within which both verdicts may be right [m], [rad].
BORDER_SHIFT = 1e-4
#: The arm has arrived when every joint is this near [rad]: the wire rounds to a millionth, and the
#: joints of a nearly singular arm turn by a hundred times as much.
ARRIVAL_TOLERANCE = 1e-3


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Verdict of the planner on a goal, and of the robot if it ran."""

    #: ``passes``, ``reach``, ``limit``, ``branch``; ``other`` = not about the arm; ``long`` = not
    #: run, as it takes too long: the arm can follow the path, unless there is a refusal.
    planner: str
    refusal: str
    #: The reason why the robot failed; empty = it arrived at the planned end.
    failure: str
    #: Index of the refused point, or of the last one.
    point: int
    run: ProgramRun | None = None
    plan: Plan | None = None

    @property
    def passes(self):
        """Whether the planner accepts the goal."""
        return self.planner in ('passes', 'long') and not self.refusal

    @property
    def agreed(self):
        """Whether planner and robot agree, or only the planner was asked."""
        return self.planner in ('other', 'long') or (self.passes == (not self.failure))


def compare(robot, case, options=OPTIONS, max_duration=inf) -> Verdict:
    """
    Plan a goal, and run it whether the planner accepts it or not.

    :param max_duration: a plan with a longer motion is not run [s].
    """
    arm = robot.controller.arm
    state = robot.place(case.q, case.T_flange_tcp)
    planned, refusal = _try_plan(case.goal, state, arm, options)
    if refusal is None:
        if planned.duration > max_duration:
            return Verdict(planner='long', refusal='', failure='', point=-1, plan=planned)
        primitives = [segment.primitive for segment in planned.segments]
        # A failure that only longer cycles cause (one moves farther than a blend) does not count.
        for runner in (robot.slow, robot) if planned.duration > SLOW_CYCLE_DURATION else (robot,):
            runner.place(case.q, case.T_flange_tcp)
            run = runner.run(primitives)
            failure = run.failure or _configuration_error(planned, run)
            if not failure:
                break
        return Verdict(
            planner='passes',
            refusal='',
            failure=failure,
            point=len(case.goal.waypoints) - 1,
            run=run,
            plan=planned,
        )
    if _is_for_time(refusal):
        return Verdict(planner='long', refusal='', failure='', point=-1)
    kind = KINDS.get(type(refusal), 'other')
    if kind == 'other':
        return Verdict(planner=kind, refusal=str(refusal), failure='', point=-1)
    point, before = _refused_point(case.goal, state, arm, options)
    _check_named_point(refusal, case.goal.segments, point)
    if point > 0 and (before is None or before.duration > max_duration):
        return Verdict(planner='long', refusal=str(refusal), failure='', point=point)
    primitives = [] if before is None else [segment.primitive for segment in before.segments]
    q = case.q if before is None else before.segments[-1].joints
    if primitives:
        primitives[-1] = replace(
            primitives[-1], blend_radius=case.goal.segments[point - 1].blend_radius
        )
    run = robot.run([*primitives, unchecked_primitive(case, point, q, arm)])
    failure = run.failure or _posture_error(case, point, q, arm, run)
    return Verdict(
        planner=kind,
        refusal=f'{type(refusal).__name__}: {refusal}',
        failure=failure,
        point=point,
        run=run,
    )


def _check_named_point(refusal, segments, point) -> None:
    """Check that a refusal names the point, or the one before if a blend joins them."""
    place = re.match(r'(trajectory\.points|segments)\[(\d+)\]', str(refusal))
    assert place is not None, f'which point? {refusal}'
    joined = point > 0 and segments[point - 1].blend_radius > 0.0
    assert point - joined <= int(place[2]) <= point, f'it is point {point}: {refusal}'


def is_borderline(robot, case, options=OPTIONS, max_duration=MAX_RUN_DURATION) -> bool:
    """
    Return whether the verdict of planner or robot changes when the goal is shifted a little.

    The whole goal is shifted along and turned about each axis, then each point at random.
    """
    was = compare(robot, case, options)
    rng = np.random.default_rng(1)
    neighbours = (_shifted(robot.controller.arm, case, change, rng) for change in _shifts(rng))
    verdicts = (
        compare(robot, moved, options, max_duration) for moved in neighbours if moved is not None
    )
    return any(
        verdict.passes != was.passes
        or (verdict.planner != 'long' and bool(verdict.failure) != bool(was.failure))
        for verdict in verdicts
        if verdict.planner != 'other'
    )


def _shifts(rng):
    for axis in (3, 4, 5, 0, 1, 2):  # turns first: most borders are straight wrists
        for sign in (-BORDER_SHIFT, BORDER_SHIFT):
            step = np.zeros(6)
            step[axis] = sign
            yield step
    for _ in range(20):
        yield None


def _shifted(arm, case, step, rng):
    """Return the case with all poses shifted by a step, or each at random; None = out of reach."""

    def by(pose):
        change = (
            step
            if step is not None
            else rng.uniform(-BORDER_SHIFT, BORDER_SHIFT, 6) / np.sqrt(3.0)
        )
        turn = Pose((0.0, 0.0, 0.0), quaternion_from_rotation_vector(tuple(change[3:])))
        turned = turn @ Pose((0.0, 0.0, 0.0), pose.quaternion)
        return Pose(tuple(np.array(pose.position) + change[:3]), turned.quaternion)

    start = by(arm.forward(case.q) @ case.T_flange_tcp)
    q = nearest(arm, start @ case.T_flange_tcp.inverse(), case.q)
    if q is None or max(abs(a - b) for a, b in zip(q, case.q, strict=True)) > 0.1:
        return None
    goal = replace(
        case.goal,
        waypoints=tuple(replace(w, pose=by(w.pose)) for w in case.goal.waypoints),
        segments=tuple(
            replace(s, via=None if s.via is None else by(s.via)) for s in case.goal.segments
        ),
    )
    return replace(case, q=q, goal=goal)


def _try_plan(goal, state, arm, options):
    try:
        return plan(goal, state, arm, options), None
    except GoalRefused as refusal:
        return None, refusal


def _is_for_time(refusal):
    """Return whether the arm can follow a refused path, but too slowly (near a singularity)."""
    return 'more than max_segment_time' in str(refusal)


def _refused_point(goal, state, arm, options):
    """
    Return the first point to which the arm cannot go, and the plan of the points before it.

    The plan is None if it takes too long, or if there are no points before.
    """
    before = None
    for count in range(1, len(goal.waypoints) + 1):
        part = replace(goal, waypoints=goal.waypoints[:count], segments=goal.segments[:count])
        planned, refusal = _try_plan(part, state, arm, options)
        if refusal is not None and not _is_for_time(refusal):
            return count - 1, before
        before = planned
    raise AssertionError('every part of the goal passes, and the whole does not')


def unchecked_primitive(case, point, q, arm):
    """Return the primitive that a driver without a pre-flight check would send for a point."""
    goal = case.goal
    segment, waypoint = goal.segments[point], goal.waypoints[point]
    speeds: dict[str, Any] = {
        'velocity': segment.velocity or 0.5,
        'acceleration': segment.acceleration or 4.0,
    }
    time = waypoint.time - (goal.waypoints[point - 1].time if point else 0.0)
    # A posture is resolved without a pre-flight check too.
    near = (
        waypoint.posture
        and nearest_to_posture(
            arm, waypoint.pose @ case.T_flange_tcp.inverse(), _named(waypoint), q
        )
    ) or q
    match segment.type:
        case SegmentType.JOINT:
            return MoveJ(target=waypoint.pose, q_near=near, duration=time, **speeds)
        case SegmentType.OPTIMIZED_JOINT:
            return OptimoveJ(target=waypoint.pose, q_near=near, **speeds)
        case SegmentType.CIRCULAR:
            return MoveC(target=waypoint.pose, via=segment.via, mode=segment.arc_mode, **speeds)
        case SegmentType.PROCESS:
            return MoveP(target=waypoint.pose, **speeds)
        case SegmentType.OPTIMIZED_LINEAR:
            return OptimoveL(target=waypoint.pose, **speeds)
        case _:
            return MoveL(target=waypoint.pose, duration=time, **speeds)


def _named(waypoint):
    return {
        JOINT_NAMES.index(name): value
        for name, value in zip(waypoint.posture.names, waypoint.posture.values, strict=True)
    }


def _configuration_error(planned, run) -> str:
    """Describe the distance of the arm's end from the planned configuration; '' = arrived."""
    off = max(abs(a - b) for a, b in zip(run.q, planned.segments[-1].joints, strict=True))
    return (
        ''
        if off <= ARRIVAL_TOLERANCE
        else f'arrives {off:.6f} rad beside the configuration planned'
    )


def _posture_error(case, point, q, arm, run) -> str:
    """Describe the joint that ends beside the goal's posture after the unchecked motion."""
    named = _named(case.goal.waypoints[point])
    if not named:
        return ''
    end = run.pose @ case.T_flange_tcp.inverse()
    chosen = nearest_to_posture(arm, end, named, q)
    off = {JOINT_NAMES[i]: abs(run.q[i] - chosen[i]) for i in named}
    return ''.join(
        f'arrives {value:.4f} rad beside the posture of {name}'
        for name, value in off.items()
        if value > 0.01
    )[:60]
