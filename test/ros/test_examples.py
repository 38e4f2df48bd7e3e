# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
from math import pi

from example_goals import OPTIONS
import numpy as np
import pytest
from tracked_files import tracked_files

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.motion.plan.primitive import MoveC, MoveJ, MoveL, MoveP, Spline
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning import check, plan
from ur_cartesian_driver.resources import share_path
from ur_cartesian_driver.ros.client import load_goal
from ur_cartesian_driver.ros.messages.goal_conversion import goal_from_message

FOLDER = share_path() / 'config' / 'examples'
NAMES = [path.stem for path in tracked_files(FOLDER, '*.yaml')]
HOME = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
ELBOW = 2


ARM = Arm(robot_model('ur5e'))
STATE = RobotState(
    timestamp=0.0,
    actual_q=HOME,
    target_q=HOME,
    actual_tcp_pose=ARM.forward(HOME),
    target_tcp_pose=ARM.forward(HOME),
)


def goal_of(name):
    return goal_from_message(
        load_goal(FOLDER / f'{name}.yaml'), Frames(), now=0, snapshot=ArmSnapshot.of(STATE)
    )


def planned(name):
    return plan(goal_of(name), STATE, ARM, OPTIONS)


def kinds(name):
    return [type(segment.primitive) for segment in planned(name).segments]


def test_there_are_examples():
    assert set(NAMES) >= {
        'square',
        'seam',
        'postures',
        'relative',
        'tilt',
        'tolerances',
        'circle',
        'figure_eight',
        'seam_timed',
        'glue',
        'spots',
        'arc_start',
        'bead',
        'grind',
        'touch',
        'pick',
    }


@pytest.mark.parametrize('name', NAMES)
def test_an_example_passes_all_checks_with_the_default_parameters(name):
    check(goal_of(name), OPTIONS)
    result = planned(name)
    assert len(result.report) >= len({segment.waypoint for segment in result.segments})
    assert any('slowed' in line for line in result.report) == (name == 'stretch')


@pytest.mark.parametrize('name', NAMES)
def test_an_example_ends_where_it_began(name):
    result = planned(name)
    assert result.segments[-1].joints == pytest.approx(HOME, abs=1e-4)


def test_the_square_is_20_cm_in_10_s_and_plain():
    result = planned('square')
    assert kinds('square') == [MoveL] * 4
    assert [segment.length for segment in result.segments] == pytest.approx([0.2] * 4)
    assert result.duration == pytest.approx(10.0)
    assert not result.goal.segments


def test_the_seam_shows_every_kind_of_motion():
    assert kinds('seam') == [MoveJ, MoveL, MoveL, MoveP, MoveC, MoveP, MoveL, MoveL, MoveJ]
    assert 14.0 < planned('seam').duration < 20.0


@pytest.mark.parametrize('name', ['circle', 'figure_eight', 'seam_timed'])
def test_goals_with_twists_are_splines_that_are_at_their_points_in_time(name):
    result = planned(name)
    assert result.execution is ExecutionMode.SPLINE
    assert set(kinds(name)) == {Spline}
    path = result.reference
    for index, point in enumerate(result.goal.waypoints):
        row = int(np.flatnonzero(path.point == index)[-1])
        assert path.time[row] == pytest.approx(point.time)
        assert path.poses[row, :3] == pytest.approx(point.pose.position, abs=1e-9)


def test_the_circle_is_round_and_even_between_its_points():
    path = planned('circle').reference
    around = path.poses[(path.point > 0) & (path.point < 13), :3] - (-0.4919, -0.1333, 0.4879)
    assert np.linalg.norm(around, axis=1) == pytest.approx(0.08, abs=6e-6)
    assert np.abs(around[:, 2]).max() < 1e-9


def test_the_timed_seam_stops_only_above_it_behind_it_and_at_home():
    assert [line for line in planned('seam_timed').report if 'stops' in line][-1] == (
        'points 0, 6: the arm stops there, because the twist is 0 (NaN lets the driver choose)'
    )


def test_the_valve_is_open_along_the_bead_and_the_light_comes_at_the_end():
    result = planned('glue')
    outputs = [
        (segment.waypoint, output.pin, output.value, output.trigger_pose is not None, output.delay)
        for segment in result.segments
        for output in segment.outputs
    ]
    assert outputs == [
        (1, 2, 1.0, True, 0.0),
        (2, 0, 0.6, True, 0.0),
        (3, 0, 1.0, True, 0.0),
        (4, 2, 0.0, True, 0.0),
        (6, 3, 1.0, False, pytest.approx(0.5)),
    ]
    assert all(segment.primitive.blend_radius > 0.0 for segment in result.segments[:-1])


def test_the_posture_of_the_seam_is_the_one_of_its_pose():
    result = planned('seam')
    assert result.goal.waypoints[0].posture.values == pytest.approx(
        result.segments[0].joints, abs=1e-3
    )


def test_the_postures_bend_the_elbow_as_asked():
    elbows = [segment.joints[ELBOW] for segment in planned('postures').segments]
    assert [elbow > 0.0 for elbow in elbows] == [True, False, False, True]
