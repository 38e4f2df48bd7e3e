# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What the planner says of a goal, and what the robot makes of it when it is sent all the same.

A refused goal has no primitives. So those of the points before are planned, and that of the point
which is refused is written down as any driver would that does not look ahead: the type, the pose,
the speeds.
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
from ur_cartesian_driver.motion.goal import SegmentType
from ur_cartesian_driver.motion.plan import Plan
from ur_cartesian_driver.motion.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.primitive import MoveC, MoveJ, MoveL, MoveP, OptimoveJ, OptimoveL
from ur_cartesian_driver.planning import plan, PlanningOptions

#: What bounds speeds and distances is off, and what is left, geometry, has no margin.
OPTIONS = PlanningOptions(
    max_approach_distance=0.0,
    max_tool_speed=0.0,
    on_too_fast='slow',
    self_collision='off',
    singularity_margin_wrist=0.0,
    singularity_margin_elbow=0.0,
    singularity_margin_shoulder=0.0,
)

#: Refusals by what of the arm they are about.
KINDS = {
    Unreachable: 'reach',
    JointLimitExceeded: 'limit',
    NearSingularity: 'branch',
    InvalidPosture: 'branch',
}

#: Motions that take longer are run in longer cycles [s], and those that take this long are not.
LONG, TOO_LONG = 2.5, 10.0
#: So near to the border both may be right [m], [rad].
BORDER = 1e-4
#: Arrived is who is this near [rad]: the wire rounds to a millionth, and that turns the joints of
#: a nearly singular arm by a hundred times as much.
ARRIVED = 1e-3


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What one side, or both, make of a goal."""

    #: ``passes``, ``reach``, ``limit``, ``branch``; ``other`` for what has nothing to do with the
    #: arm, ``long`` for what passes and would take too long to be run.
    planner: str
    refusal: str
    #: Empty if the robot ran it to the end and arrived as it should.
    trouble: str
    #: The point that is refused, or the last one.
    point: int
    run: ProgramRun | None = None
    plan: Plan | None = None

    @property
    def passes(self):
        """Whether the planner lets it pass."""
        return self.planner in ('passes', 'long')

    @property
    def agreed(self):
        """Whether both say the same, or one of them was not asked."""
        return self.planner in ('other', 'long') or (self.passes == (not self.trouble))


def judge(robot, case, options=OPTIONS, longest=inf) -> Verdict:
    """
    Plan a goal, and run it whatever the plan says.

    :param longest: plans of motions that take longer are not run [s].
    """
    arm = robot.controller.arm
    state = robot.place(case.q, case.T_flange_tcp)
    made, refusal = _planned(case.goal, state, arm, options)
    if refusal is None:
        if made.duration > longest:
            return Verdict(planner='long', refusal='', trouble='', point=-1, plan=made)
        primitives = [segment.primitive for segment in made.segments]
        # What only longer cycles bring about (the way of one is longer than a blend) is none.
        for runner in (robot.slow, robot) if made.duration > LONG else (robot,):
            runner.place(case.q, case.T_flange_tcp)
            run = runner.run(primitives)
            trouble = run.trouble or _astray(made, run)
            if not trouble:
                break
        return Verdict(
            planner='passes',
            refusal='',
            trouble=trouble,
            point=len(case.goal.waypoints) - 1,
            run=run,
            plan=made,
        )
    kind = KINDS.get(type(refusal), 'other')
    if kind == 'other':
        return Verdict(planner=kind, refusal=str(refusal), trouble='', point=-1)
    point, before = _refused_point(case.goal, state, arm, options)
    primitives = [] if before is None else [segment.primitive for segment in before.segments]
    q = case.q if before is None else before.segments[-1].joints
    if primitives:
        primitives[-1] = replace(
            primitives[-1], blend_radius=case.goal.segments[point - 1].blend_radius
        )
    run = robot.run([*primitives, blind(case, point, q, arm)])
    trouble = run.trouble or _missed(case, point, q, arm, run)
    _check_place(refusal, case.goal.segments, point)
    return Verdict(
        planner=kind,
        refusal=f'{type(refusal).__name__}: {refusal}',
        trouble=trouble,
        point=point,
        run=run,
    )


def _check_place(refusal, segments, point) -> None:
    """Check that a refusal names the point, or that before it where a blend joins the two."""
    place = re.match(r'(trajectory\.points|segments)\[(\d+)\]', str(refusal))
    assert place is not None, f'which point? {refusal}'
    joined = point > 0 and segments[point - 1].blend_radius > 0.0
    assert point - joined <= int(place[2]) <= point, f'it is point {point}: {refusal}'


def at_the_border(robot, case, options=OPTIONS, longest=TOO_LONG) -> bool:
    """
    Tell whether somebody says something else of a goal that is hardly another one.

    The whole of it is shifted and turned along and about each axis, then each point at random.
    """
    was = judge(robot, case, options)
    rng = np.random.default_rng(1)
    neighbours = (_moved(robot.controller.arm, case, change, rng) for change in _changes(rng))
    verdicts = (judge(robot, moved, options, longest) for moved in neighbours if moved is not None)
    return any(
        verdict.passes != was.passes
        or (verdict.planner != 'long' and bool(verdict.trouble) != bool(was.trouble))
        for verdict in verdicts
        if verdict.planner != 'other'
    )


def _changes(rng):
    for axis in (3, 4, 5, 0, 1, 2):  # turns first: most borders are straight wrists
        for sign in (-BORDER, BORDER):
            step = np.zeros(6)
            step[axis] = sign
            yield step
    for _ in range(20):
        yield None


def _moved(arm, case, step, rng):
    """Return the case with all poses moved by a step, or each by its own; None: nowhere."""

    def by(pose):
        change = step if step is not None else rng.uniform(-BORDER, BORDER, 6) / np.sqrt(3.0)
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


def _planned(goal, state, arm, options):
    try:
        return plan(goal, state, arm, options), None
    except GoalRefused as refusal:
        return None, refusal


def _refused_point(goal, state, arm, options):
    """Return the first point that makes a goal refused, and the plan of those before it."""
    before = None
    for count in range(1, len(goal.waypoints) + 1):
        part = replace(goal, waypoints=goal.waypoints[:count], segments=goal.segments[:count])
        made, refusal = _planned(part, state, arm, options)
        if refusal is not None:
            return count - 1, before
        before = made
    raise AssertionError('every part of the goal passes, and the whole does not')


def blind(case, point, q, arm):
    """Return the primitive of a point as somebody would send it who does not look ahead."""
    goal = case.goal
    segment, waypoint = goal.segments[point], goal.waypoints[point]
    speeds: dict[str, Any] = {
        'velocity': segment.velocity or 0.5,
        'acceleration': segment.acceleration or 4.0,
    }
    time = waypoint.time - (goal.waypoints[point - 1].time if point else 0.0)
    # What a posture means is no question of looking ahead.
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


def _astray(made, run) -> str:
    """Say how the arm arrived in another configuration than planned."""
    off = max(abs(a - b) for a, b in zip(run.q, made.segments[-1].joints, strict=True))
    return '' if off <= ARRIVED else f'arrives {off:.6f} rad beside the configuration planned'


def _missed(case, point, q, arm, run) -> str:
    """Say which joint of a posture the blind motion did not bring to where it should."""
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
