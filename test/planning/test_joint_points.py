# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Points that give joint positions in place of a pose."""

from __future__ import annotations

from dataclasses import replace
from math import nan, pi

import numpy as np
import pytest

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import (
    GoalRefused,
    InvalidGoal,
    InvalidJoints,
    JointLimitExceeded,
    NotAvailable,
)
from ur_cartesian_driver.motion.events import PathPlace
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    FreeAxis,
    Goal,
    Posture,
    Segment,
    SegmentType,
    Waypoint,
)
from ur_cartesian_driver.motion.plan.primitive import MoveJ, MoveL, OptimoveJ
from ur_cartesian_driver.path.resumption import resume
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.append.append_planner import plan_append, plan_first_part
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints
from ur_cartesian_driver.planning.request.validate import check

NO_POSE = Pose((nan,) * 3, (nan,) * 4)
OPTIONS = PlanningOptions(max_approach_distance=0.0)
#: The arm is stretched and the wrist straight: no pose selects these joints.
UPRIGHT = (0.0, -pi / 2, 0.0, -pi / 2, 0.0, 0.0)
JOINT, OPTIMIZED = Segment(type=SegmentType.JOINT), Segment(type=SegmentType.OPTIMIZED_JOINT)


def at(q, names=JOINT_NAMES, **fields):
    """Return a point that gives joint positions."""
    return Waypoint(pose=NO_POSE, posture=Posture(names=tuple(names), values=tuple(q)), **fields)


def planned(cell, *points, segments=(), options=OPTIONS, **fields):
    goal = Goal(waypoints=points, segments=segments, **fields)
    return plan(goal, cell.state, cell.arm, options)


def refusal(cell, *points, segments=(), **fields):
    with pytest.raises(GoalRefused) as error:
        planned(cell, *points, segments=segments, **fields)
    return error.value


@pytest.mark.parametrize('q', [(0.1, -1.4, 1.7, -1.8, -1.5, 0.3), UPRIGHT])
@pytest.mark.parametrize(('segment', 'kind'), [(JOINT, MoveJ), (OPTIMIZED, OptimoveJ)])
def test_a_joint_move_is_sent_as_these_joints(cell, q, segment, kind):
    made = planned(cell, at(q), segments=(segment,))
    (primitive,) = made.rows.primitives
    assert isinstance(primitive, kind)
    assert primitive.target == q
    assert made.segments[0].joints == q
    expected = np.array(cell.tool(q).row())
    assert np.abs(made.reference.poses[-1] - expected).max() < 1e-9


def test_a_line_leads_to_the_pose_in_which_the_joints_put_the_tool(cell):
    q = (0.1, -1.4, 1.7, -1.8, -1.5, 0.3)
    (primitive,) = planned(cell, at(q)).rows.primitives
    assert isinstance(primitive, MoveL)
    assert primitive.target.distance_to(cell.tool(q)) < 1e-12


def test_the_next_line_begins_there(cell):
    q = (0.1, -1.4, 1.7, -1.8, -1.5, 0.3)
    x, y, z = cell.tool(q).position
    end = Waypoint(pose=Pose((x, y + 0.05, z), cell.tool(q).quaternion))
    made = planned(cell, at(q), end, segments=(JOINT, Segment()))
    assert made.segments[1].length == pytest.approx(0.05, abs=1e-9)


def test_the_pose_is_that_of_the_controlled_frame_in_the_frame_of_the_goal(cell):
    q = (0.1, -1.4, 1.7, -1.8, -1.5, 0.3)
    T_base_frame = Pose((0.3, 0.1, 0.2), quaternion_from_rotation_vector((0.2, 0.3, -0.4)))
    T_flange_nozzle = Pose((0.0, 0.0, 0.3), quaternion_from_rotation_vector((0.0, 0.5, 0.0)))
    made = planned(
        cell,
        at(q),
        segments=(JOINT,),
        T_base_frame=T_base_frame,
        frame_id='table',
        T_flange_controlled=T_flange_nozzle,
        controlled_frame='nozzle',
    )
    expected = cell.arm.forward(q) @ T_flange_nozzle
    there = T_base_frame @ made.goal.waypoints[0].pose
    assert there.distance_to(expected) < 1e-12
    assert there.angle_to(expected) < 1e-7
    assert made.rows.primitives[0].target == q


def test_names_carry_the_prefix_in_any_order(cell):
    q = (0.1, -1.4, 1.7, -1.8, -1.5, 0.3)
    names = [f'left_{name}' for name in reversed(JOINT_NAMES)]
    options = replace(OPTIONS, tf_prefix='left_')
    made = planned(cell, at(q[::-1], names), segments=(JOINT,), options=options)
    assert made.rows.primitives[0].target == q


def test_arcs_and_duplicates_are_checked_once_the_pose_is_known(cell):
    q = (0.1, -1.4, 1.7, -1.8, -1.5, 0.3)
    here = Waypoint(pose=cell.tool(q))
    via = replace(cell.tool(q), position=tuple(a + 0.05 for a in cell.tool(q).position))
    arc = Segment(type=SegmentType.CIRCULAR, via=via)
    goal = Goal(waypoints=(at(q), here), segments=(JOINT, arc))
    check(goal, OPTIONS)
    assert 'coincide' in str(refusal(cell, at(q), here, segments=(JOINT, arc)))
    same = refusal(cell, at(q), here, segments=(JOINT, Segment()))
    assert str(same).startswith('trajectory.points[1]')


def test_a_posture_of_some_joints_gives_no_pose(cell):
    error = refusal(cell, at((1.6,), JOINT_NAMES[2:3]), segments=(JOINT,))
    assert isinstance(error, InvalidGoal)
    assert 'trajectory.points[0].pose is NaN' in str(error)
    assert 'names 1 of the 6 joints' in str(error)


def test_a_pose_that_is_only_partly_nan_is_refused(cell):
    point = replace(at(UPRIGHT), pose=Pose((nan, 0.0, 0.0)))
    assert 'pose.position contains nan' in str(refusal(cell, point, segments=(JOINT,)))


def test_a_joint_out_of_its_range_is_not_turned_back(cell):
    error = refusal(cell, at((0.0, -1.5, 1.5, 0.0, 1.5, 7.0)), segments=(JOINT,))
    assert isinstance(error, JointLimitExceeded)
    assert 'wrist_3_joint at 7.0000 rad' in str(error)


def test_a_joint_just_out_of_its_range_is_told_with_digits_that_show_it(cell):
    q = (*cell.state.actual_q[:5], 2.0 * pi + 1e-6)
    text = 'wrist_3_joint at 6.283186 rad, outside its range of -6.2832 to 6.2832 rad'
    assert text in str(refusal(cell, at(q), segments=(JOINT,)))


def test_a_wrong_name_is_refused(cell):
    error = refusal(cell, at(UPRIGHT, ('a', *JOINT_NAMES[1:])), segments=(JOINT,))
    assert isinstance(error, InvalidJoints)


def test_no_rotation_is_free_there(cell):
    segment = replace(JOINT, free_axis=FreeAxis.Z)
    assert 'segments[0].free_axis' in str(refusal(cell, at(UPRIGHT), segments=(segment,)))


def test_it_cannot_be_resumed(cell):
    goal = Goal(waypoints=(at(UPRIGHT), Waypoint(pose=cell.home)), segments=(JOINT, Segment()))
    with pytest.raises(InvalidGoal, match=r'points\[0\]\.pose is given by joint positions'):
        resume(goal, PathPlace(point=1, fraction=0.5))


def test_a_goal_with_times_takes_its_time(cell):
    q = (0.1, -1.4, 1.7, -1.8, -1.5, 0.3)
    made = planned(cell, at(q, time=4.0), segments=(JOINT,))
    assert made.rows.primitives[0].duration == pytest.approx(4.0)


#: Two configurations near the arm, to which splines lead.
NEAR = (0.1, -1.5, 1.6, -1.6, -1.5, 0.1), (0.2, -1.5, 1.5, -1.6, -1.6, 0.0)


def test_a_spline_passes_these_joints(cell):
    made = planned(
        cell,
        *(at(q, time=2.0 + 2.0 * k) for k, q in enumerate(NEAR)),
        execution=ExecutionMode.SPLINE,
    )
    q, _, _ = made.joint_spline.rows(np.array([2.0, 4.0]))
    assert np.abs(q - NEAR).max() < 1e-6


def test_rounded_corners_lead_past_these_joints_to_the_last(cell):
    made = planned(cell, *map(at, NEAR), corner_deviation=1e-3)
    q, _, _ = made.joint_spline.rows(np.linspace(0.0, made.duration, 2000))
    assert np.abs(q[-1] - NEAR[1]).max() < 1e-6
    assert 1e-4 < np.abs(q - NEAR[0]).max(axis=1).min() < 5e-3


@pytest.mark.parametrize('execution', [ExecutionMode.PRIMITIVES, ExecutionMode.SPLINE])
def test_appended_points_lead_there(cell, execution):
    first, second = (
        at(q, time=(2.0 + 2.0 * k) * (execution is ExecutionMode.SPLINE))
        for k, q in enumerate(NEAR)
    )
    goal = Goal(waypoints=(first,), execution=execution, keep_open=True)
    begun = plan_first_part(plan(goal, cell.state, cell.arm, OPTIONS), cell.arm, OPTIONS)
    added = AppendedPoints(waypoints=(second,), segments=(), io_commands=(), last=True)
    made = plan_append(begun.next_goal, added, cell.arm, OPTIONS, from_rest=False)
    assert np.abs(made.plan.rows.joints[-1] - NEAR[1]).max() < 1e-6


def test_without_a_calibration_only_joint_moves_lead_there(cell):
    options = replace(OPTIONS, calibration_known=False)
    made = planned(cell, at(NEAR[0]), segments=(JOINT,), options=options)
    assert made.rows.primitives[0].target == NEAR[0]
    for segments in ((), (Segment(),), (Segment(type=SegmentType.PROCESS),)):
        with pytest.raises(NotAvailable, match=r'points\[0\]\.pose is NaN.*calibration'):
            planned(cell, at(NEAR[0]), segments=segments, options=options)
