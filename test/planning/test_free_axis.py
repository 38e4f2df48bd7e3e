# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The rotation about a free axis: found where there is one, no worse than a given one."""

from __future__ import annotations

from dataclasses import replace
from math import degrees, pi
import os

from free_axis_paths import free_path, OPTIONS, turned, with_ranges
from mixed_goals import mixed_case, random_robot
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, robot_model
from ur_cartesian_driver.motion.errors import GoalRefused, JointLimitExceeded
from ur_cartesian_driver.motion.geometry.pose import Pose, rotate
from ur_cartesian_driver.motion.geometry.vectors import dot, vector6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    FreeAxis,
    Goal,
    Segment,
    SegmentType,
    Waypoint,
)
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.options import MAX_CLEARANCE
from ur_cartesian_driver.planning.stop_prediction import state_at_rest

#: How many random paths: 300 for development.
COUNT = int(os.environ.get('FREE_AXIS_PATHS', '24'))
AXES = {FreeAxis.X: (1.0, 0.0, 0.0), FreeAxis.Y: (0.0, 1.0, 0.0), FreeAxis.Z: (0.0, 0.0, 1.0)}
HOME = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
ARM = Arm(robot_model('ur5e'))
STATE = state_at_rest(ARM, HOME)


def free_remark(plan):
    return next(line for line in plan.remarks if line.startswith('free axis'))


def rotations(goal, made):
    """Return by which angle each pose was turned about the free axis [rad], and check the rest."""
    angles = []
    for segment, given, chosen in zip(
        goal.segments, goal.waypoints, made.goal.waypoints, strict=True
    ):
        assert chosen.pose.position == given.pose.position
        turn = Pose((0.0,) * 3, given.pose.quaternion).inverse() @ Pose(
            (0.0,) * 3, chosen.pose.quaternion
        )
        vector = turn.rotation_vector()[3:]
        along = dot(vector, AXES[segment.free_axis]) if segment.free_axis else 0.0
        assert np.linalg.norm(vector) == pytest.approx(abs(along), abs=1e-6)
        angles.append(along)
    return angles


@pytest.mark.parametrize('number', range(COUNT))
def test_a_rotation_is_found_where_there_is_one(number):
    path = free_path(number)
    made = plan(path.goal, path.state, path.arm, OPTIONS)
    assert 'as given' not in free_remark(made)
    angles = rotations(path.goal, made)
    assert f'{degrees(max(angles)):.1f} degrees' in free_remark(made)


@pytest.mark.parametrize('number', range(0, COUNT, 4))
def test_a_rotation_is_found_within_ranges(number):
    path = free_path(number)
    goal = with_ranges(path, 1.0)
    made = plan(goal, path.state, path.arm, OPTIONS)
    for segment, angle in zip(goal.segments, rotations(goal, made), strict=True):
        turns = 2.0 * pi * np.array((-1, 0, 1))
        assert (
            (angle + turns >= segment.free_min - 1e-6) & (angle + turns <= segment.free_max + 1e-6)
        ).any()


def with_free_axis(goal, rng):
    """Return a goal in which some segments have a free axis, None where none can have it."""
    segments = list(goal.segments) or [Segment()] * len(goal.waypoints)
    axis = FreeAxis(int(rng.integers(1, 4)))
    low, high = ((0.0, 0.0), (-0.5, 0.5))[rng.integers(2)]
    for i, segment in enumerate(segments):
        after = segments[i + 1] if i + 1 < len(segments) else Segment()
        if ArcMode.FIXED not in (segment.arc_mode, after.arc_mode) and rng.random() < 0.7:
            segments[i] = replace(segment, free_axis=axis, free_min=low, free_max=high)
    if goal.keep_open or not any(segment.free_axis for segment in segments):
        return None
    return replace(goal, segments=tuple(segments))


@pytest.mark.parametrize('number', range(COUNT))
def test_what_the_fixed_planner_accepts_is_not_refused(number):
    robot, rng = random_robot(7, number), np.random.default_rng(number)
    options = PlanningOptions(**robot.options)
    for k in range(4):
        case = mixed_case(robot, 7, number, k)
        state = state_at_rest(robot.arm, vector6(case.q), case.T_flange_tcp)
        free = with_free_axis(case.goal, rng)
        try:
            plan(case.goal, state, robot.arm, options)
        except GoalRefused:
            continue
        if free is not None:
            plan(free, state, robot.arm, options)


def test_a_range_of_no_width_is_the_fixed_planner():
    path = free_path(1)
    segments = tuple(
        replace(segment, free_min=-turn, free_max=-turn)
        for segment, turn in zip(path.goal.segments, path.turns, strict=True)
    )
    made = plan(replace(path.goal, segments=segments), path.state, path.arm, OPTIONS)
    plain = Goal(
        waypoints=tuple(Waypoint(pose=pose) for pose in path.solution),
        segments=tuple(Segment(velocity=segment.velocity) for segment in segments),
    )
    fixed = plan(plain, path.state, path.arm, OPTIONS)
    assert made.remarks == fixed.remarks
    for one, other in zip(made.segments, fixed.segments, strict=True):
        assert one.joints == pytest.approx(other.joints, abs=1e-8)


@pytest.mark.parametrize('beside', [-0.004, 0.004])
def test_an_arm_just_beside_the_range_of_its_first_rotation_is_within_the_start_tolerance(beside):
    """At time 0 the arm is at the point, turned by the bound of the range and a little farther."""
    start, bound = STATE.actual_tcp_pose, 0.5
    goal = Goal(
        waypoints=tuple(
            Waypoint(
                pose=turned(Pose((x, y + dy, z), start.quaternion), FreeAxis.Z, -bound - beside),
                time=time,
            )
            for (x, y, z), dy, time in ((start.position, 0.0, 0.0), (start.position, 0.05, 2.0))
        ),
        segments=(
            Segment(
                free_axis=FreeAxis.Z,
                free_min=-1.0 if beside > 0.0 else bound,
                free_max=bound if beside > 0.0 else 1.0,
            ),
        )
        * 2,
    )
    made = plan(goal, STATE, ARM, OPTIONS)
    assert 'as given' not in free_remark(made)
    assert rotations(goal, made)[0] == pytest.approx(bound)


def test_a_chosen_goal_is_planned_again_to_the_same():
    path = free_path(2)
    made = plan(path.goal, path.state, path.arm, OPTIONS)
    again = plan(made.goal, path.state, path.arm, OPTIONS)
    assert np.array_equal(again.reference.poses, made.reference.poses)
    assert made.remarks[1:] == again.remarks


def line(count, dx=0.0, dy=0.0, dz=0.0, **fields):
    """Return a goal along a line from home."""
    x, y, z = STATE.actual_tcp_pose.position
    q = STATE.actual_tcp_pose.quaternion
    return Goal(
        waypoints=tuple(
            Waypoint(pose=Pose((x + dx * k / count, y + dy * k / count, z + dz * k / count), q))
            for k in range(1, count + 1)
        ),
        segments=(Segment(**fields),) * count,
    )


def test_nothing_turns_without_a_reason():
    goal = line(20, dy=0.1, free_axis=FreeAxis.Z, free_min=-0.5, free_max=0.5)
    made = plan(goal, STATE, ARM, PlanningOptions())
    assert max(map(abs, rotations(goal, made))) < 0.05


@pytest.mark.slow
def test_the_widest_clearance_is_looked_for_too():
    """The search looks a little farther than a goal needs."""
    options = PlanningOptions(min_clearance=MAX_CLEARANCE, self_collision='warn')
    made = plan(line(2, dy=0.04, free_axis=FreeAxis.Z), STATE, ARM, options)
    assert 'less than min_clearance = 1.0000 m' in ' '.join(made.report)


def test_fixed_points_keep_their_orientation():
    goal = line(9, dy=0.18)
    segments = [Segment()] * 9
    segments[4] = Segment(free_axis=FreeAxis.Z)
    made = plan(replace(goal, segments=tuple(segments)), STATE, ARM, PlanningOptions())
    for i, (given, chosen) in enumerate(zip(goal.waypoints, made.goal.waypoints, strict=True)):
        assert i == 4 or chosen.pose == given.pose
    assert 'point 4 turned by' in free_remark(made)


@pytest.mark.parametrize('corner', [0.0, 5e-4], ids=['stops', 'rounded'])
def test_the_wrist_unwinds_where_it_may(corner):
    """With the rotation as given the last joint turns beyond its range."""
    q = (*HOME[:5], 2.0 * pi - 0.2)
    state = state_at_rest(ARM, q)
    centre = state.actual_tcp_pose
    # The rotation about z by which the last joint would leave its range.
    waypoints = tuple(
        Waypoint(
            pose=turned(
                Pose(
                    (centre.position[0], centre.position[1] + 0.01 * k, centre.position[2]),
                    centre.quaternion,
                ),
                FreeAxis.Z,
                0.1 * k,
            )
        )
        for k in range(1, 9)
    )
    goal = Goal(waypoints=waypoints, segments=(Segment(),) * 8, corner_deviation=corner)
    with pytest.raises(JointLimitExceeded):
        plan(goal, state, ARM, PlanningOptions())
    free = replace(goal, segments=(Segment(free_axis=FreeAxis.Z),) * 8)
    made = plan(free, state, ARM, PlanningOptions())
    assert min(rotations(free, made)) < -0.5
    narrow = replace(
        goal, segments=(Segment(free_axis=FreeAxis.Z, free_min=-0.1, free_max=0.1),) * 8
    )
    with pytest.raises(JointLimitExceeded, match=r'\(no .*rotation about the free axis was found'):
        plan(narrow, state, ARM, PlanningOptions())


def test_a_joint_move_to_a_free_point_ends_where_the_path_needs_it():
    """The nearest configuration of the first point leads nowhere."""
    start = state_at_rest(ARM, (*HOME[:5], 2.0 * pi - 0.3))
    x, y, z = start.actual_tcp_pose.position
    places = [(x, y + 0.02 * k, z) for k in range(12)]
    goal = Goal(
        waypoints=tuple(
            Waypoint(pose=turned(Pose(p, start.actual_tcp_pose.quaternion), FreeAxis.Z, 0.4 * k))
            for k, p in enumerate(places)
        ),
        segments=(
            Segment(type=SegmentType.JOINT, free_axis=FreeAxis.Z, free_min=-0.1, free_max=0.1),
            *(Segment(free_axis=FreeAxis.Z, free_min=-0.1, free_max=0.1),) * 11,
        ),
    )
    made = plan(goal, start, ARM, PlanningOptions())
    assert made.goal.waypoints[0].posture.names == JOINT_NAMES
    assert made.segments[0].joints[5] < pi


def test_ranges_too_far_apart_for_a_short_way_leave_the_rotations_as_given():
    home = ARM.forward(HOME)
    x, y, z = home.position
    goal = Goal(
        waypoints=tuple(
            Waypoint(pose=Pose((x, y, z - 0.01 * k), home.quaternion)) for k in (1, 2)
        ),
        segments=tuple(
            Segment(type=kind, free_axis=FreeAxis.Z, free_min=low, free_max=low + 0.1)
            for kind, low in ((SegmentType.JOINT, 1.2), (SegmentType.LINEAR, -0.8))
        ),
    )
    made = plan(goal, STATE, ARM, OPTIONS)
    assert 'rotations as given, because no rotation' in free_remark(made)


def test_the_axis_follows_the_path_between_points():
    path = free_path(4)
    made = plan(path.goal, path.state, path.arm, OPTIONS)
    axis = AXES[path.goal.segments[0].free_axis]
    wanted = np.array([rotate(pose.quaternion, axis) for pose in path.solution])
    reached = np.array([rotate(tuple(q), axis) for q in made.reference.poses[:, 3:].tolist()])
    # Each point is passed, and from one to the next the axis stays between theirs.
    between = np.arccos(np.clip((wanted[1:] * wanted[:-1]).sum(axis=1), -1.0, 1.0))
    nearest = np.arccos(np.clip(reached @ wanted.T, -1.0, 1.0)).min(axis=1)
    assert nearest.max() < 0.5 * between.max() + pi / 180.0
    assert (np.arccos(np.clip(reached @ wanted.T, -1.0, 1.0)).min(axis=0) < 1e-6).all()


def test_a_spline_turns_evenly_where_its_rates_are_given():
    goal = line(8, dy=0.16, free_axis=FreeAxis.Z)
    waypoints = [
        replace(
            point,
            pose=turned(point.pose, FreeAxis.Z, 0.3 * (-1) ** k),
            time=0.5 * (k + 2),
            twist=(0.0, 0.04, 0.0, 0.0, 0.0, 0.0) if k < 7 else (0.0,) * 6,
        )
        for k, point in enumerate(goal.waypoints)
    ]
    made = plan(
        replace(goal, waypoints=tuple(waypoints), execution=ExecutionMode.SPLINE),
        STATE,
        ARM,
        PlanningOptions(),
    )
    assert 'as given' not in free_remark(made)
    turn = Pose((0.0,) * 3, STATE.actual_tcp_pose.quaternion).inverse()
    turns = [
        (turn @ Pose((0.0,) * 3, point.pose.quaternion)).rotation_vector()[5]
        for point in made.goal.waypoints
    ]
    assert np.abs(np.diff(turns)).max() < 0.1


def test_another_frame_than_the_tcp_must_not_turn():
    goal = replace(
        line(2, dy=0.1, free_axis=FreeAxis.Z), T_flange_controlled=Pose((0.0, 0.0, 0.1))
    )
    still = plan(goal, STATE, ARM, PlanningOptions(allow_tcp_change=False))
    assert 'as given, because a frame other than the active TCP must not' in free_remark(still)
    assert 'turned by' in free_remark(plan(goal, STATE, ARM, PlanningOptions()))
