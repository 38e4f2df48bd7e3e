# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The controller's moves on a part that the arm holds: exact if the part does not turn.

The judge takes the poses on the wire, draws lines and arcs of the TCP in base between them by its
own formulas, and looks at the fixed tool from the part.
"""

from dataclasses import replace

from curve_distance import arc_points
from held_part_goals import held_case
import numpy as np
import pytest
from random_cases import cases, random_of

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    JointLimitExceeded,
    NearSingularity,
    NotAvailable,
    Unreachable,
)
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    Posture,
    Press,
    Segment,
    SegmentType,
    Waypoint,
)
from ur_cartesian_driver.motion.plan.primitive import MoveC
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.preview import sample

pytest.importorskip('pinocchio')

OPTIONS = PlanningOptions(self_collision='off', max_approach_distance=0.0, max_tool_speed=0.0)
EXPLAINED = (Unreachable, NearSingularity, JointLimitExceeded)
TCP = Pose((0.02, -0.03, 0.15), quaternion_from_rotation_vector((0.3, -0.5, 0.9)))
KINDS = (SegmentType.LINEAR, SegmentType.PROCESS, SegmentType.CIRCULAR)


def goal_without_turns(random, start):
    """Return random lines and arcs with blends, all in the orientation of their start."""
    rng = np.random.default_rng(random.randrange(2**32))
    points, segments, here = [], [], np.array(start.position)
    for _ in range(rng.integers(2, 9)):
        way = rng.normal(size=3)
        way *= rng.uniform(0.02, 0.1) / np.linalg.norm(way)
        side = np.cross(way, rng.normal(size=3))
        side *= 0.3 * np.linalg.norm(way) / np.linalg.norm(side)
        kind, via = KINDS[rng.integers(3)], None
        if kind is SegmentType.CIRCULAR:
            # Of a via only the position counts.
            turned = quaternion_from_rotation_vector(rng.normal(size=3).tolist())
            via = Pose(tuple((here + 0.5 * way + side).tolist()), turned)
        here = here + way
        points.append(Waypoint(pose=Pose(tuple(here.tolist()), start.quaternion)))
        segments.append(
            Segment(type=kind, via=via, velocity=rng.uniform(0.01, 0.2), blend_radius=0.004)
        )
    segments[-1] = replace(segments[-1], blend_radius=0.0)
    return Goal(waypoints=tuple(points), segments=tuple(segments))


def planned(case, **fields):
    state = state_at_rest(case.arm, case.state.actual_q, TCP)
    return plan(replace(case.goal, **fields), state, case.arm, OPTIONS)


def on_the_part(case, positions, like):
    """Return where the tool is on the part (n, 3) with the TCP at positions (n, 3) in base."""
    T_tcp_part = np.linalg.inv(TCP.matrix()) @ case.frame.T_flange_frame.matrix()
    T_base_tcp = np.tile(like.matrix(), (len(positions), 1, 1))
    T_base_tcp[:, :3, 3] = positions
    T_part_base = np.linalg.inv(T_base_tcp @ T_tcp_part)
    return (T_part_base @ case.frame.T_base_tool.matrix())[:, :3, 3]


@pytest.mark.random
def test_lines_and_arcs_of_the_tcp_are_those_of_the_tool_on_a_part_that_does_not_turn():
    random, refused = random_of('held moves'), 0
    count = cases(300)
    for _ in range(count):
        case = held_case(random, goal_without_turns)
        try:
            made = planned(case)
        except EXPLAINED:
            refused += 1
            continue
        assert made.execution is ExecutionMode.PRIMITIVES
        before = case.arm.forward(case.state.actual_q) @ TCP
        for segment, a, point, wanted in zip(
            made.segments, case.starts, case.goal.waypoints, case.goal.segments, strict=True
        ):
            move, b = segment.primitive, point.pose
            assert move.target.angle_to(before) < 1e-6
            if wanted.type is SegmentType.CIRCULAR:
                assert isinstance(move, MoveC)
                places = (before.position, move.via.position, move.target.position)
                positions = arc_points(*map(np.array, places))
                path = arc_points(*map(np.array, (a.position, wanted.via.position, b.position)))
            else:
                u = np.linspace(0.0, 1.0, 20)[:, None]
                positions, path = (
                    (1.0 - u) * np.array(begin) + u * np.array(end)
                    for begin, end in (
                        (before.position, move.target.position),
                        (a.position, b.position),
                    )
                )
            np.testing.assert_allclose(on_the_part(case, positions, move.target), path, atol=1e-6)
            # Length and blend are those on the part, too.
            curve = np.vstack([a.position, path])
            length = np.linalg.norm(np.diff(curve, axis=0), axis=1).sum()
            assert segment.length == pytest.approx(length, rel=1e-3)
            assert move.blend_radius == pytest.approx(wanted.blend_radius)
            before = move.target
        # The joints that are told of the end are those with the tool there.
        end = case.relative(np.array([made.segments[-1].joints]))[0]
        np.testing.assert_allclose(end, case.goal.waypoints[-1].pose.matrix(), atol=1e-6)
        first = case.relative(np.array([made.start]))[0]
        np.testing.assert_allclose(made.reference.poses[0, :3], first[:3, 3], atol=1e-9)
        # The joints of a preview lead the tool where it says.
        shown = sample(made, case.arm, TCP, 0.2)
        tool = case.relative(shown.joints)[:, :3, 3]
        np.testing.assert_allclose(tool, shown.poses[:, :3], atol=1e-6)
    assert refused <= 0.6 * count + 2


CASE = held_case(random_of('held moves refused'), goal_without_turns)
POINTS, SEGMENTS = CASE.goal.waypoints, CASE.goal.segments
HALF_A_DEGREE = quaternion_from_rotation_vector((0.0, np.radians(0.5), 0.0))
WITH_TURN = (*POINTS[:1], Waypoint(pose=POINTS[1].pose @ Pose((0.0,) * 3, HALF_A_DEGREE)))
LINES = (Segment(type=SegmentType.LINEAR, velocity=0.05),) * 2
PRESS = Press(first_waypoint=0, last_waypoint=1, axes=('z',), forces=(20.0,))


@pytest.mark.parametrize(
    ('fields', 'sentence'),
    [
        (
            {'waypoints': WITH_TURN},
            'trajectory.points[1].pose.orientation turns the part that the arm holds by 0.5 '
            'degrees from points[0], but the moves of the controller, which PRIMITIVES sends, are '
            'straight in base, and curves on a part that turns; keep the orientation, or set '
            'execution to SPLINE or SERVO, with times or a corner_deviation.',
        ),
        (
            {'waypoints': WITH_TURN, 'presses': (PRESS,)},
            'trajectory.points[1].pose.orientation turns the part that the arm holds by 0.5 '
            'degrees from points[0], but the moves of the controller, which PRIMITIVES sends, are '
            'straight in base, and curves on a part that turns, and only these give way to '
            'presses; keep the orientation.',
        ),
        (
            {
                'waypoints': tuple(
                    Waypoint(pose=point.pose @ Pose((0.0,) * 3, HALF_A_DEGREE))
                    for point in POINTS[:2]
                )
            },
            'trajectory.points[0].pose.orientation turns the part that the arm holds by 0.5 '
            'degrees from where the arm stands, but',
        ),
    ],
)
def test_moves_that_would_be_curves_on_the_part_are_refused(fields, sentence):
    with pytest.raises(NotAvailable) as refusal:
        planned(CASE, **{'waypoints': POINTS[:2], 'segments': LINES} | fields)
    assert str(refusal.value).startswith(sentence)


def test_a_part_that_turns_too_little_to_matter_is_led():
    little = quaternion_from_rotation_vector((0.0, 5e-5, 0.0))
    turned = Waypoint(pose=POINTS[1].pose @ Pose((0.0,) * 3, little))
    planned(CASE, waypoints=(POINTS[0], turned), segments=LINES)


def test_a_posture_that_a_line_misses_makes_no_joint_motion_of_it():
    state = state_at_rest(CASE.arm, CASE.state.actual_q, TCP)
    q = list(CASE.state.actual_q)
    flipped = Posture(names=(JOINT_NAMES[4],), values=(-q[4],))
    goal = replace(
        CASE.goal,
        waypoints=(POINTS[0], replace(POINTS[1], posture=flipped)),
        segments=LINES,
    )
    with pytest.raises(
        GoalRefused,
        match=r'cannot be reached by a straight .* \(free_axis\), and set execution to SPLINE',
    ):
        plan(goal, state, CASE.arm, replace(OPTIONS, on_posture_change='movej'))
