# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""From goals to primitives: their kinds, their configurations, and refusals due to the robot."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import replace
import gc
from math import degrees, hypot, pi
import re

from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import nearest, solutions
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, robot_model
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    InvalidGoal,
    InvalidPosture,
    JointLimitExceeded,
    NearSingularity,
    NotAvailable,
    RobotNotReady,
    TooFast,
    Unreachable,
)
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    Goal,
    Posture,
    Segment,
    SegmentType,
    Tolerance,
    Waypoint,
)
from ur_cartesian_driver.motion.plan.primitive import (
    MoveC,
    MoveJ,
    MoveL,
    MoveP,
    OptimoveJ,
    OptimoveL,
    Spline,
)
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.moves import joint_path_planner
from ur_cartesian_driver.preview import table
from ur_cartesian_driver.protocol.program.wire_dialects import DIALECTS

TYPE = SegmentType
OPTIONS = PlanningOptions()
SAFE = settings(max_examples=30, deadline=None)


def posture(q, *joints):
    """Return the posture that names all joints, or the joints of the given numbers."""
    chosen = joints or range(6)
    return Posture(names=tuple(JOINT_NAMES[k] for k in chosen), values=tuple(q[k] for k in chosen))


def near(a, b, tolerance=1e-9):
    return max(abs(x - y) for x, y in zip(a, b, strict=True)) < tolerance


def square(cell, **fields):
    corners = ((0.1, 0.0), (0.1, 0.2), (-0.1, 0.2), (-0.1, 0.0), (0.1, 0.0))
    points = tuple(cell.point(x, y, time=2.0 * (i + 1)) for i, (x, y) in enumerate(corners))
    return Goal(waypoints=points, **fields)


@pytest.mark.parametrize(('error', 'starts_there'), [(4e-4, True), (0.1, False)])
@pytest.mark.parametrize('execution', [ExecutionMode.PRIMITIVES, ExecutionMode.SPLINE])
def test_a_plan_begins_at_the_set_point_that_friction_leaves_the_arm_beside(
    cell, error, starts_there, execution
):
    target_q = tuple(q + error for q in cell.state.actual_q)
    goal = Goal(waypoints=(cell.point(0.05, time=2.0),), execution=execution)
    made = plan(goal, replace(cell.state, target_q=target_q), cell.arm, OPTIONS)
    begin = target_q if starts_there else cell.state.actual_q
    assert made.start == begin
    T_base_tcp = cell.arm.forward(begin) @ cell.state.T_flange_tcp
    assert made.reference.poses[0, :3] == pytest.approx(T_base_tcp.position, abs=1e-9)


def test_a_plain_square_becomes_timed_straight_lines_to_its_poses(cell):
    goal = square(cell)
    made = plan(goal, cell.state, cell.arm, OPTIONS)
    assert [segment.waypoint for segment in made.segments] == [0, 1, 2, 3, 4]
    for segment, point in zip(made.segments, goal.waypoints, strict=True):
        assert isinstance(segment.primitive, MoveL)
        assert segment.primitive.target.distance_to(point.pose) < 1e-12
        assert segment.primitive.duration == pytest.approx(2.0)
        assert segment.primitive.q_near is None
        assert cell.tool(segment.joints).distance_to(point.pose) < 1e-9
    assert made.duration == pytest.approx(10.0)
    assert made.reference.time[-1] == pytest.approx(10.0)
    assert [segment.length for segment in made.segments] == pytest.approx(
        [0.1, 0.2, 0.2, 0.2, 0.2]
    )
    assert made.segments[1].report_line == (
        'point 1: AUTO -> MOVEL, 0.200 m in 2.000 s (0.100 m/s mean), time from '
        'points[1].time_from_start; margin 0.369 m to the shoulder singularity at 67 %'
    )
    assert made.remarks[-1] == (
        'tightest margin: 0.369 m to the shoulder singularity at 67 % of the segment to point 1'
    )
    assert made.remarks[-2] == (
        'points 0, 1, 2, 3: the arm stops there, because there is no blend (blend_radius)'
    )
    assert len(made.remarks) == 3  # the other is about clearance


def test_poses_are_taken_from_the_goals_frame_and_normalised(cell):
    T_base_frame = Pose((0.2, -0.1, 0.05), (0.0, 0.0, 1.0, 0.0))
    goal = square(cell)
    moved = replace(
        goal,
        T_base_frame=T_base_frame,
        waypoints=tuple(replace(p, pose=T_base_frame.inverse() @ p.pose) for p in goal.waypoints),
    )
    made = plan(moved, cell.state, cell.arm, OPTIONS)
    for segment, point in zip(made.segments, goal.waypoints, strict=True):
        assert segment.primitive.target.distance_to(point.pose) < 1e-9
        assert hypot(*segment.primitive.target.quaternion) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(
    ('kind', 'primitive', 'has_q_near'),
    [
        (TYPE.AUTO, MoveL, False),
        (TYPE.LINEAR, MoveL, False),
        (TYPE.JOINT, MoveJ, True),
        (TYPE.PROCESS, MoveP, False),
        (TYPE.OPTIMIZED_LINEAR, OptimoveL, False),
        (TYPE.OPTIMIZED_JOINT, OptimoveJ, True),
    ],
)
def test_each_segment_type_has_its_primitive_and_joint_moves_always_a_q_near(
    cell, kind, primitive, has_q_near
):
    goal = Goal(waypoints=(cell.point(0.1, 0.05),), segments=(Segment(type=kind),))
    segment = plan(goal, cell.state, cell.arm, OPTIONS).segments[0]
    assert type(segment.primitive) is primitive
    assert (segment.primitive.q_near is not None) == has_q_near
    if has_q_near:
        assert segment.primitive.q_near == segment.joints
        assert cell.tool(segment.joints).distance_to(goal.waypoints[0].pose) < 1e-9


def test_no_time_is_predicted_of_optimized_moves(cell):
    goal = Goal(
        waypoints=(cell.point(0.1), cell.point(0.1, 0.1)),
        segments=(Segment(), Segment(type=TYPE.OPTIMIZED_LINEAR)),
    )
    made = plan(goal, cell.state, cell.arm, OPTIONS)
    known, unknown = made.report[:2]
    assert ' s (0.' in known
    assert 'in a time that the controller chooses and that is not predicted' in unknown
    assert not re.search(r'\d s\b', unknown)
    *_, first, second, total = table(made).splitlines()
    assert '? s' not in first
    assert '? s' in second
    assert '? s' in total


# -- postures -------------------------------------------------------------------------------------


@pytest.mark.parametrize('of_target', [False, True])
@pytest.mark.parametrize('of_via', [False, True])
def test_arcs_carry_joints_exactly_where_a_posture_is_and_the_pose_always_wins(
    cell, of_target, of_via
):
    start, via, end = cell.point(0.1), cell.pose(0.05, 0.05, 0.02), cell.point(0.0, 0.1)

    def off(pose):
        q = nearest(cell.arm, pose @ cell.T_flange_tcp.inverse(), cell.state.actual_q)
        return posture([value + 0.1 for value in q])

    end = replace(end, posture=off(end.pose) if of_target else Posture())
    arc = Segment(type=TYPE.CIRCULAR, via=via, via_posture=off(via) if of_via else Posture())
    goal = Goal(waypoints=(start, end), segments=(Segment(), arc))
    made = plan(goal, cell.state, cell.arm, OPTIONS)
    move = made.segments[1].primitive
    assert isinstance(move, MoveC)
    for field, wanted, as_joints in ((move.target, end.pose, of_target), (move.via, via, of_via)):
        assert isinstance(field, tuple) == as_joints
        pose = cell.tool(field) if as_joints else field
        assert pose.distance_to(wanted) < 1e-9
        assert pose.angle_to(wanted) < 1e-8
    name = {
        (False, False): 'MOVEC, ',
        (True, True): 'MOVEC_JOINT ',
        (True, False): 'MOVEC_JOINT_POSE ',
        (False, True): 'MOVEC_POSE_JOINT ',
    }
    assert f'-> {name[of_target, of_via]}' in made.segments[1].report_line


def test_arcs_are_sent_as_poses_while_the_calibration_is_unknown(cell):
    q = nearest(cell.arm, cell.pose(0.1, 0.1) @ cell.T_flange_tcp.inverse(), cell.state.actual_q)
    goal = Goal(
        waypoints=(cell.point(0.1, 0.1, posture=posture(q, 2)),),
        segments=(Segment(type=TYPE.CIRCULAR, via=cell.pose(0.07, 0.03)),),
    )
    made = plan(goal, cell.state, cell.arm, PlanningOptions(calibration_known=False))
    assert isinstance(made.segments[0].primitive.target, Pose)
    assert 'calibration of this robot is unknown' in made.remarks[0]


def test_an_arc_that_keeps_to_its_tangent_ends_in_the_turned_orientation_and_says_so(cell):
    goal = Goal(
        waypoints=(cell.point(0.1, 0.1), cell.point(0.1, 0.15)),
        segments=(
            Segment(
                type=TYPE.CIRCULAR,
                via=cell.pose(0.1 - 0.1 * 0.5**0.5 + 0.0, 0.1 * 0.5**0.5),
                arc_mode=ArcMode.FIXED,
            ),
            Segment(),
        ),
    )
    made = plan(goal, cell.state, cell.arm, OPTIONS)
    assert 'the orientation is ignored' in made.remarks[0]
    # The next line turns the tool back to the orientation of its point.
    assert made.segments[1].angle == pytest.approx(made.segments[0].angle, abs=1e-6)


def test_a_full_posture_is_sent_verbatim_where_it_leads_to_the_same_solution(cell):
    wanted = tuple(value + 0.05 for value in cell.state.actual_q)
    goal = Goal(
        waypoints=(cell.point(0.05, posture=posture(wanted)),) * 1,
        segments=(Segment(type=TYPE.JOINT),),
    )
    assert plan(goal, cell.state, cell.arm, OPTIONS).segments[0].primitive.q_near == wanted
    straight = replace(goal, segments=(Segment(),))
    assert plan(straight, cell.state, cell.arm, OPTIONS).segments[0].primitive.q_near == wanted


def test_a_partial_posture_flips_the_elbow_to_the_solution_nearest_in_it(cell):
    goal = Goal(
        waypoints=(cell.point(0.05, posture=posture((0, 0, -1.2, 0, 0, 0), 2)),),
        segments=(Segment(type=TYPE.JOINT),),
    )
    segment = plan(goal, cell.state, cell.arm, OPTIONS).segments[0]
    assert segment.joints[2] < 0.0 < cell.state.actual_q[2]
    assert segment.primitive.q_near == segment.joints
    assert cell.tool(segment.joints).distance_to(goal.waypoints[0].pose) < 1e-9
    every = solutions(cell.arm, goal.waypoints[0].pose @ cell.T_flange_tcp.inverse())
    assert abs(segment.joints[2] + 1.2) <= min(abs(q[2] + 1.2) for q in every) + 0.01


def test_a_path_that_needs_too_many_samples_is_refused_before_it_is_sampled(cell):
    back, forth = cell.point(), cell.point(0.2)  # a hundred steps of 2 mm apart
    goal = Goal(waypoints=(forth, back) * 20_100)
    text = (
        r'trajectory\.points describe a path whose check needs 4\.02e\+06 samples, more than '
        r'4,000,000, most of all on the way to points\[\d+\]; check the positions, or split'
    )
    with pytest.raises(InvalidGoal, match=text):
        plan(goal, cell.state, cell.arm, OPTIONS)


def test_samples_of_joint_moves_and_lines_count_together(cell, monkeypatch):
    goal = Goal(
        waypoints=tuple(cell.point(0.1 * (k % 2 == 0)) for k in range(12)),
        segments=(Segment(), Segment(type=TYPE.JOINT)) * 6,
    )
    for bound, refusal in (
        (700, nullcontext()),
        (500, pytest.raises(InvalidGoal, match='samples, more than 500, most of all on the way')),
    ):
        monkeypatch.setattr(joint_path_planner, '_MAX_SAMPLES', bound)
        with refusal:
            plan(goal, cell.state, cell.arm, OPTIONS)


@pytest.mark.parametrize('kind', [TYPE.LINEAR, TYPE.CIRCULAR, TYPE.PROCESS])
def test_a_straight_move_cannot_flip_the_elbow(cell, kind):
    via = cell.pose(0.03, 0.03) if kind == TYPE.CIRCULAR else None
    goal = Goal(
        waypoints=(cell.point(0.05, posture=posture((0, 0, -1.2, 0, 0, 0), 2)),),
        segments=(Segment(type=kind, via=via),),
    )
    with pytest.raises(InvalidPosture, match=r'points\[0\]\.posture .* elbow_joint arrives at'):
        plan(goal, cell.state, cell.arm, OPTIONS)
    made = plan(goal, cell.state, cell.arm, PlanningOptions(on_posture_change='movej'))
    assert isinstance(made.segments[0].primitive, MoveJ)
    assert made.segments[0].joints[2] < 0.0
    assert 'JOINT instead of' in made.remarks[0]


def test_a_turn_of_wrist_3_counts_in_a_posture(cell):
    q = cell.state.actual_q
    turned = posture((0, 0, 0, 0, 0, q[5] + 2 * pi - 0.1), 5)
    goal = Goal(waypoints=(cell.point(0.0, 0.05, posture=turned),))
    with pytest.raises(InvalidPosture, match='wrist_3_joint'):
        plan(goal, cell.state, cell.arm, OPTIONS)
    made = plan(replace(goal, segments=(Segment(type=TYPE.JOINT),)), cell.state, cell.arm, OPTIONS)
    assert made.segments[0].joints[5] == pytest.approx(q[5] + 2 * pi, abs=0.2)


def test_a_via_posture_of_another_branch_is_refused(cell):
    arc = Segment(
        type=TYPE.CIRCULAR,
        via=cell.pose(0.03, 0.03),
        via_posture=posture((0, 0, -1.2, 0, 0, 0), 2),
    )
    goal = Goal(waypoints=(cell.point(0.05),), segments=(arc,))
    with pytest.raises(InvalidPosture, match=r'segments\[0\]\.via_posture'):
        plan(goal, cell.state, cell.arm, OPTIONS)


@SAFE
@given(change=st.tuples(*[st.floats(-0.5, 0.5)] * 6), off=st.tuples(*[st.floats(-0.1, 0.1)] * 6))
def test_a_joint_move_arrives_in_the_configuration_asked_for(cell, change, off):
    q = tuple(a + b for a, b in zip(cell.state.actual_q, change, strict=True))
    goal = Goal(
        waypoints=(
            Waypoint(
                pose=cell.tool(q), posture=posture([a + b for a, b in zip(q, off, strict=True)])
            ),
        ),
        segments=(Segment(type=TYPE.JOINT),),
    )
    made = plan(goal, cell.state, cell.arm, PlanningOptions(max_approach_distance=0.0))
    arrived = made.segments[0].joints
    assert cell.tool(arrived).distance_to(goal.waypoints[0].pose) < 1e-8
    assert near(arrived, q, 1e-6) or max(map(abs, off)) > 0.02


# -- refusals that need the robot -----------------------------------------------------------------


def refusal(error, cell, goal, options=OPTIONS, state=None):
    with pytest.raises(error) as caught:
        plan(goal, state or cell.state, cell.arm, options)
    assert type(caught.value) is error
    return str(caught.value)


def test_a_point_out_of_reach_is_named_with_distance_and_bound(cell):
    text = refusal(Unreachable, cell, Goal(waypoints=(cell.point(0.1), cell.point(-1.0))))
    assert text.startswith('trajectory.points[1].pose')
    found = re.search(r'at the point .* would be ([\d.]+) m .* reach ([\d.]+) m', text)
    assert float(found[1]) > float(found[2]) + 0.1


@pytest.mark.parametrize('kind', [TYPE.LINEAR, TYPE.PROCESS, TYPE.CIRCULAR])
@pytest.mark.parametrize('angle', [pi, -pi, pi - 5e-4])
def test_half_a_turn_is_refused_because_either_way_is_as_short(cell, kind, angle):
    via = cell.pose(0.05, 0.02) if kind == TYPE.CIRCULAR else None
    goal = Goal(
        waypoints=(cell.point(0.1, turn=(0.0, 0.0, angle)),),
        segments=(Segment(type=kind, via=via),),
    )
    text = refusal(InvalidGoal, cell, goal)
    assert text.startswith('trajectory.points[0].pose.orientation turns the tool by 1')
    assert 'a point in between' in text
    way = Segment(type=kind, via=via, arc_mode=ArcMode.FIXED) if via else Segment(type=TYPE.JOINT)
    plan(replace(goal, segments=(way,)), cell.state, cell.arm, OPTIONS)


@pytest.mark.parametrize('enabled', [True, False])
def test_the_garbage_collector_is_afterwards_as_it_was(cell, enabled):
    (gc.enable if enabled else gc.disable)()
    try:
        plan(Goal(waypoints=(cell.point(0.1),)), cell.state, cell.arm, OPTIONS)
        refusal(InvalidGoal, cell, Goal(waypoints=()))
        assert gc.isenabled() is enabled
    finally:
        gc.enable()


def test_a_line_that_leaves_the_reach_half_way_names_the_place(make_cell):
    # Past the base at less than the shoulder's offset: both ends are in reach.
    cell = make_cell((0.0, -1.9, 2.2, -1.9, -pi / 2, 0.0))
    x, y, _ = cell.home.position
    goal = Goal(waypoints=(cell.point(-2.0 * x, -2.0 * y),))
    text = refusal(Unreachable, cell, goal, PlanningOptions(max_approach_distance=0.0))
    assert '% of its segment' in text


def test_a_point_beyond_the_joint_range_is_a_joint_limit(make_cell):
    cell = make_cell((2 * pi - 0.05, -1.6, 1.6, -1.6, -1.57, 0.0))
    end = cell.tool((2 * pi + 0.2, -1.6, 1.6, -1.6, -1.57, 0.0))
    text = refusal(JointLimitExceeded, cell, Goal(waypoints=(Waypoint(pose=end),)))
    assert (
        'moves shoulder_pan_joint to 6.4832 rad, outside its range of -6.2832 to 6.2832 rad; '
        'start with this joint turned back, or use a JOINT segment.'
    ) in text


def wrist_crossing(make_cell, q_middle):
    """Return a robot and a goal across the tool's way from the middle, 5 cm to both sides."""
    middle = make_cell(q_middle)
    x, y, _ = middle.home.position
    across = (-0.05 * y / hypot(x, y), 0.05 * x / hypot(x, y))
    start = middle.pose(*across) @ middle.T_flange_tcp.inverse()
    cell = make_cell(nearest(middle.arm, start, q_middle))
    return cell, middle.point(-across[0], -across[1])


def test_a_line_that_passes_a_wrist_singularity_is_refused_with_the_joint_and_the_place(make_cell):
    # Wrist 2 passes 0 by a ten-thousandth, so wrist 1 and 3 would have to swing round.
    cell, point = wrist_crossing(make_cell, (0.0, -1.2, 1.6, -0.4 - pi / 2, 1e-4, 0.4))
    text = refusal(NearSingularity, cell, Goal(waypoints=(point,)))
    assert text.startswith('trajectory.points[0].pose, at 50.0 % of its segment, comes within ')
    assert 'of the wrist singularity' in text
    assert 'less than singularity_margin_wrist = 0.05 rad' in text


def test_a_wrist_cannot_flip_on_a_line_and_can_with_a_joint_move(make_cell):
    cell = make_cell((0.3, -1.2, 1.6, -2.0, -1.2, 0.4))
    goal = Goal(waypoints=(cell.point(0.0, 0.05, posture=posture((0, 0, 0, 0, 1.2, 0), 4)),))
    assert 'wrist_2_joint arrives at -1.' in refusal(InvalidPosture, cell, goal)
    made = plan(goal, cell.state, cell.arm, PlanningOptions(on_posture_change='movej'))
    assert isinstance(made.segments[0].primitive, MoveJ)
    assert made.segments[0].joints[4] > 0.0


def test_a_far_first_point_is_refused_with_both_numbers(cell):
    goal = Goal(waypoints=(cell.point(0.0, 0.3), cell.point(0.0, 0.35)))
    text = refusal(InvalidGoal, cell, goal, PlanningOptions(max_approach_distance=0.25))
    assert 'is 0.3 m away' in text
    assert 'max_approach_distance = 0.25 m' in text
    plan(goal, cell.state, cell.arm, PlanningOptions(max_approach_distance=0.0))


def test_a_first_point_at_time_0_is_where_the_robot_stands_and_gets_no_primitive(cell):
    points = (cell.point(0.0005), cell.point(0.1, time=2.0))
    made = plan(Goal(waypoints=points), cell.state, cell.arm, OPTIONS)
    assert [segment.waypoint for segment in made.segments] == [1]
    assert made.segments[0].primitive.duration == pytest.approx(2.0)
    text = refusal(InvalidGoal, cell, Goal(waypoints=(cell.point(0.002), points[1])))
    assert text.startswith('trajectory.points[0].time_from_start is 0')
    assert '0.0020 m' in text
    text = refusal(
        InvalidGoal, cell, Goal(waypoints=(cell.point(turn=(0.02, 0.0, 0.0)), points[1]))
    )
    assert '0.0200 rad' in text


def test_a_first_point_at_time_0_in_another_posture_is_refused(cell):
    wrong = cell.point(posture=posture((0, 0, -1.5, 0, 0, 0), 2))
    text = refusal(InvalidPosture, cell, Goal(waypoints=(wrong, cell.point(0.1, time=1.0))))
    assert text.startswith('trajectory.points[0].posture')


@pytest.mark.parametrize('kind', [TYPE.LINEAR, TYPE.JOINT, TYPE.PROCESS])
def test_a_first_point_where_the_arm_stands_keeps_its_time(cell, kind):
    points = (cell.point(time=2.0), cell.point(0.02, time=4.0))
    goal = Goal(waypoints=points, segments=(Segment(type=kind), Segment()))
    made = plan(goal, cell.state, cell.arm, OPTIONS)
    assert 'point 0: the robot is already there, and waits 2 s' in made.remarks
    wait = made.segments[0].primitive
    assert wait == Spline(target=cell.state.actual_q, velocities=(0.0,) * 6, duration=2.0)
    assert [segment.duration for segment in made.segments] == pytest.approx([2.0, 2.0])
    at_2_s = made.reference.poses[made.reference.time <= 2.0]
    assert np.ptp(at_2_s, axis=0) == pytest.approx(np.zeros(7), abs=1e-6)
    only = plan(Goal(waypoints=points[:1]), cell.state, cell.arm, OPTIONS)
    assert only.duration == pytest.approx(2.0)
    # Without times nothing waits.
    untimed = plan(Goal(waypoints=(cell.point(),)), cell.state, cell.arm, OPTIONS)
    assert untimed.duration < 0.01


def test_a_robot_program_without_times_cannot_wait_at_the_first_point(cell):
    coarse = replace(OPTIONS, dialect=DIALECTS['2.0'])
    goal = Goal(waypoints=(cell.point(time=2.0), cell.point(0.02, time=4.0)))
    text = refusal(NotAvailable, cell, goal, coarse)
    assert text.startswith('trajectory.points[0].time_from_start is 2 s, but the robot is already')


def test_a_joint_move_to_where_the_arm_is_is_refused(cell):
    goal = Goal(
        waypoints=(cell.point(0.1), cell.point(0.1)),
        segments=(Segment(), Segment(type=TYPE.JOINT)),
    )
    assert 'duplicates points[0]' in refusal(InvalidGoal, cell, goal)


def test_a_robot_that_is_not_where_its_kinematics_puts_it_gets_no_plan(cell):
    elsewhere = replace(cell.state, actual_tcp_pose=cell.pose(0.05))
    text = refusal(RobotNotReady, cell, square(cell), state=elsewhere)
    assert '50.0 mm' in text
    assert 'ur5e' in text


def test_the_first_blend_must_fit_into_the_way_from_where_the_robot_stands(cell):
    goal = Goal(
        waypoints=(cell.point(0.02), cell.point(0.02, 0.1)),
        segments=(Segment(blend_radius=0.03), Segment()),
    )
    text = refusal(InvalidGoal, cell, goal)
    assert 'the blend takes 30 mm, but the arm is 20.000 mm from points[0]' in text


# -- sentences ------------------------------------------------------------------------------------


def test_everything_that_is_ignored_is_said(cell):
    some = (0.1, 0.0, 0.0, 0.0, 0.0, 0.0)
    goal = square(cell, segments=(Segment(acceleration=0.4),) * 4 + (Segment(blend_radius=0.01),))
    points = tuple(replace(p, jerk=some) for p in goal.waypoints[:-1])
    last = replace(goal.waypoints[-1], twist=some, acceleration=some)
    remarks = plan(replace(goal, waypoints=(*points, last)), cell.state, cell.arm, OPTIONS).remarks
    for text in (
        'point 4: twist is ignored',
        'point 4: acceleration is ignored',
        'points 0, 1, 2, 3: jerk is ignored',
        'points 0, 1, 2, 3: the acceleration of',
        'point 4: blend_radius is ignored: the last',
    ):
        assert any(remark.startswith(text) for remark in remarks), text


def test_blends_that_the_robot_cannot_do_become_stops_and_are_said(cell):
    points = (cell.point(0.05), cell.point(0.05, 0.1), cell.point(0.0, 0.1))
    goal = Goal(
        waypoints=points,
        segments=(
            Segment(),
            Segment(type=TYPE.CIRCULAR, via=cell.pose(0.08, 0.05), blend_radius=0.01),
            Segment(type=TYPE.JOINT),
        ),
    )
    made = plan(goal, cell.state, cell.arm, OPTIONS)
    assert made.segments[1].primitive.blend_radius == 0.0
    assert made.remarks[0] == (
        'point 1: stops instead of blending, because the robot cannot '
        'blend from CIRCULAR into JOINT'
    )


# -- the reference path ---------------------------------------------------------------------------


def check_reference(made):
    reference = made.reference
    assert np.all(np.diff(reference.time) >= 0.0)
    assert np.all(np.diff(reference.point) >= 0)
    assert np.allclose(np.linalg.norm(reference.poses[:, 3:], axis=1), 1.0)
    dots = np.einsum('ij,ij->i', reference.poses[1:, 3:], reference.poses[:-1, 3:])
    assert degrees(2.0 * float(np.arccos(np.clip(dots, -1.0, 1.0)).max(initial=0.0))) < 10.1
    assert reference.time[-1] == pytest.approx(made.duration, rel=1e-6)


straight = (TYPE.LINEAR, TYPE.JOINT, TYPE.PROCESS, TYPE.OPTIMIZED_LINEAR, TYPE.OPTIMIZED_JOINT)
spots = st.tuples(*[st.floats(-0.12, 0.12)] * 3, *[st.floats(-0.4, 0.4)] * 3)
ways = st.tuples(st.sampled_from(straight), st.floats(0.0, 0.03))


@SAFE
@given(route=st.lists(st.tuples(spots, ways), min_size=1, max_size=5))
def test_a_plan_ends_at_its_points_and_its_reference_path_is_sound(cell, route):
    goal = Goal(
        waypoints=tuple(cell.point(*spot[:3], turn=spot[3:]) for spot, _ in route),
        segments=tuple(Segment(type=kind, blend_radius=radius) for _, (kind, radius) in route),
    )
    try:
        made = plan(goal, cell.state, cell.arm, OPTIONS)
    except GoalRefused:
        return
    check_reference(made)
    end = made.reference.poses[-1]
    assert hypot(*(end[:3] - goal.waypoints[-1].pose.position)) < 1e-6
    for segment, point in zip(made.segments, goal.waypoints, strict=True):
        assert segment.primitive.target.distance_to(point.pose) < 1e-9
        assert cell.tool(segment.joints).distance_to(point.pose) < 1e-7
    assert made.segments[-1].primitive.blend_radius == 0.0


@SAFE
@given(spots=st.lists(spots, min_size=2, max_size=4), gap=st.floats(0.05, 4.0))
def test_timed_goals_keep_their_sum_or_are_too_fast(cell, spots, gap):
    assume(hypot(*spots[0]) > 1e-5)  # the time to where the robot stands already is not waited
    goal = Goal(
        waypoints=tuple(
            cell.point(*spot[:3], turn=spot[3:], time=gap * (i + 1))
            for i, spot in enumerate(spots)
        )
    )
    try:
        made = plan(goal, cell.state, cell.arm, OPTIONS)
    except TooFast:
        slow = plan(goal, cell.state, cell.arm, PlanningOptions(on_too_fast='slow'))
        assert slow.duration > gap * len(spots)
        return
    except GoalRefused:
        return
    assert made.duration == pytest.approx(gap * len(spots), rel=1e-6)
    slow = plan(goal, cell.state, cell.arm, PlanningOptions(on_too_fast='slow'))
    assert slow.duration == pytest.approx(made.duration)


@pytest.mark.parametrize(
    ('model', 'tolerance', 'warns'),
    [('ur10', 1e-4, True), ('ur10', 1e-3, False), ('ur10', 0.0, False), ('ur10e', 1e-4, False)],
)
def test_a_goal_tolerance_that_a_cb3_arm_may_not_meet_is_in_the_report(model, tolerance, warns):
    arm = Arm(robot_model(model))
    q = (0.3, -1.4, 1.5, -1.6, -1.5, 0.2)
    home = arm.forward(q)
    x, y, z = home.position
    goal = Goal(
        waypoints=(Waypoint(pose=Pose((x, y, z - 0.01), home.quaternion)),),
        goal_tolerance=Tolerance(position=(tolerance,) * 3),
    )
    state = RobotState(timestamp=0.0, actual_q=q, actual_tcp_pose=home)
    remarks = plan(goal, state, arm, PlanningOptions(max_tool_speed=1.0)).remarks
    assert any('0.0003 m by which CB3' in line for line in remarks) == warns
