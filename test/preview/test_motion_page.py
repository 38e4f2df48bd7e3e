# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The page of a motion shows the arm in its place, with the words of the plan."""

from dataclasses import replace
from html import escape
from importlib import import_module
from math import nan, pi
import re
import sys

from example_goals import example_goal, OPTIONS
import numpy as np
import pytest
from recorded_scene import scenes_of

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.link_shapes import LinkFrames
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.errors import GoalRefused, Unreachable
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, Waypoint
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.preview import ArmPlan, motion_page, refusal_page

viser = pytest.importorskip('viser')

HOME = (0.3, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.2)
TCP = Pose((0.0, 0.0, 0.1))


def positions(scene, name):
    """Return the positions that a node is given, in order of time."""
    return [
        message['position']
        for _, message in scene
        if message['type'] == 'SetPositionMessage' and message['name'] == name
    ]


def moved(arm, *way):
    home = arm.forward(HOME) @ TCP
    x, y, z = home.position
    points = (Waypoint(pose=Pose((x + a, y + b, z + c), home.quaternion)) for a, b, c in way)
    return Goal(waypoints=tuple(points), segments=(Segment(blend_radius=0.01),) * len(way))


@pytest.fixture(scope='module')
def planned():
    arm = Arm(MODELS['ur5e'])
    goal = moved(arm, (0.0, 0.05, 0.0), (0.05, 0.05, -0.05))
    return arm, plan(goal, state_at_rest(arm, HOME, TCP), arm, PlanningOptions())


def test_the_page_has_a_scene_for_each_colouring_and_the_report(planned):
    arm, made = planned
    page = motion_page(made, arm)
    assert set(scenes_of(page)) == {'type', 'speed', 'margin'}
    assert all(escape(line) in page for line in made.report)
    assert len(page) < 4e6


def test_the_arm_moves_as_the_plan_does(planned):
    arm, made = planned
    scene = scenes_of(motion_page(made, arm))['type']
    wrist = positions(scene, '/arm/wrist_3')
    for q, found in ((made.start, wrist[0]), (made.segments[-1].joints, wrist[-1])):
        expected = LinkFrames(arm).poses(np.array([q]))[0, -1, :3]
        assert np.allclose(found, expected, atol=1e-4)
    assert max(time for time, _ in scene) == pytest.approx(made.duration, abs=0.05)


@pytest.mark.parametrize('name', sorted(MODELS))
def test_the_links_of_every_model_are_where_its_kinematics_has_them(name):
    arm = Arm(MODELS[name])
    q = (0.4, -1.1, 1.3, -0.7, 0.9, 0.5)
    goal = Goal(waypoints=(Waypoint(pose=arm.forward(q) @ TCP),))
    scene = scenes_of(refusal_page(goal, Unreachable('points[0] is far.'), arm, q, TCP))['type']
    found = [
        message
        for _, message in scene
        if message.get('name') == '/arm/wrist_3' and 'position' in message
    ][-1]['position']
    frames = LinkFrames(arm)
    assert np.allclose(found, frames.poses(np.array([q]))[0, -1, :3], atol=1e-4)
    flange = pose_from_row(frames.poses(np.array([q]))[0, -1]) @ frames.flange
    assert flange.distance_to(arm.forward(q)) < 1e-4


def test_a_refused_goal_shows_the_place_in_red():
    arm = Arm(MODELS['ur5e'])
    goal = moved(arm, (0.0, 0.05, 0.0), (0.0, 3.0, 0.0))
    state = state_at_rest(arm, HOME, TCP)
    with pytest.raises(GoalRefused) as caught:
        plan(goal, state, arm, PlanningOptions(max_approach_distance=0.0))
    page = refusal_page(goal, caught.value, arm, HOME, TCP)
    assert str(caught.value) in page
    scene = scenes_of(page)['type']
    (ball,) = (m for _, m in scene if m.get('name') == '/refused' and 'props' in m)
    start, end = (np.array(waypoint.pose.position) for waypoint in goal.waypoints)
    fraction = float(re.search(r'at ([\d.]+) %', str(caught.value))[1]) / 100.0
    (place,) = positions(scene, '/refused')
    assert np.allclose(place, start + fraction * (end - start), atol=1e-6)
    assert ball['props']['color'][0] > 200


def test_a_refused_goal_has_a_page_whatever_is_wrong_with_it():
    """An orientation of zeros, a point that is given by joints, and planes."""
    arm = Arm(MODELS['ur5e'])
    no_turn = Pose((0.3, 0.2, 0.4), (0.0, 0.0, 0.0, 0.0))
    joints = Pose((nan,) * 3, (nan,) * 4)
    goal = Goal(waypoints=(Waypoint(pose=joints), Waypoint(pose=no_turn)))
    options = PlanningOptions(workspace_planes=('table 0 0 -0.1 0 0 1',))
    page = refusal_page(goal, Unreachable('points[1] is wrong.'), arm, HOME, TCP, options)
    scene = scenes_of(page)['type']
    assert not any('points/0' in m.get('name', '') for _, m in scene)
    assert any(m.get('name') == '/planes/table' for _, m in scene)
    assert np.allclose(positions(scene, '/points/1'), no_turn.position)


def test_where_joints_are_unknown_the_arm_stays(planned, monkeypatch):
    arm, made = planned
    page_module = import_module('ur_cartesian_driver.preview.motion_page')
    real = page_module.sample

    def with_gap(*arguments):
        preview = real(*arguments)
        preview.joints[5:9] = np.nan
        return preview

    monkeypatch.setattr(page_module, 'sample', with_gap)
    wrist = positions(scenes_of(page_module.motion_page(made, arm))['type'], '/arm/wrist_3')
    assert np.isfinite(wrist).all()


def test_a_plan_of_the_driver_can_be_written_as_a_page(planned, tmp_path):
    arm, made = planned
    ArmPlan.of(made, arm).write_page(tmp_path / 'page.html')
    assert '__VISER_EMBED_DATA__' in (tmp_path / 'page.html').read_text()


def test_without_viser_a_sentence_says_what_to_install(planned, monkeypatch):
    arm, made = planned
    monkeypatch.setitem(sys.modules, 'viser', None)
    with pytest.raises(ImportError, match='pip install viser trimesh'):
        motion_page(replace(made), arm)


def test_the_command_writes_pages_of_plans_and_of_refusals(tmp_path, capsys):
    page = tmp_path / 'square.html'
    assert main(['show', 'square', '-o', str(page)]) == 0
    assert 'point 0: ' in page.read_text()
    refused = tmp_path / 'refused.html'
    assert main(['show', 'square', '--ur-type', 'ur3e', '-o', str(refused)]) == 1
    assert 'class="refused"' in refused.read_text()
    assert 'refused' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('name', 'marks'),
    [
        ('pick', ['close_gripper(0.6)', 'open_gripper()']),
        ('arc_start', ['waits for standard digital input 3 on']),
    ],
)
def test_what_happens_at_points_is_marked(name, marks):
    arm = Arm(MODELS['ur5e'])
    state = state_at_rest(arm, (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0))
    made = plan(example_goal(name, state), state, arm, OPTIONS)
    scene = scenes_of(motion_page(made, arm))['type']
    texts = [
        message['props']['text'] for _, message in scene if 'text' in message.get('props', {})
    ]
    assert [text for text in texts if text in marks] == marks


def on_a_part():
    """An arm with a goal on a part that it holds, and the frame on the part."""
    arm, frame = Arm(MODELS['ur5e']), Pose((0.0, 0.02, 0.1))
    held = MovingFrame(T_flange_frame=frame, T_base_tool=arm.forward(HOME) @ frame)
    points = (Waypoint(pose=Pose((x, 0.0, 0.0))) for x in (0.05, 0.1))
    return arm, Goal(waypoints=tuple(points), moving_frame=held, corner_deviation=0.001)


def test_the_path_on_a_held_part_moves_with_the_flange_before_the_tool():
    arm, goal = on_a_part()
    made = plan(goal, state_at_rest(arm, HOME, TCP), arm, PlanningOptions())
    scene = scenes_of(motion_page(made, arm))['type']
    held = goal.moving_frame
    node = '/arm/wrist_3/held_part'
    assert np.allclose(positions(scene, '/fixed_tool')[-1], held.T_base_tool.position)
    T_link_frame = LinkFrames(arm).flange @ held.T_flange_frame
    assert np.allclose(positions(scene, node)[-1], T_link_frame.position)
    assert np.allclose(positions(scene, f'{node}/points/1')[-1], (0.1, 0.0, 0.0))
    (path,) = (
        message['props']['points']
        for _, message in scene
        if message.get('name') == f'{node}/path' and 'props' in message
    )
    assert np.allclose(path.reshape(-1, 3)[[0, -1]], [(0.0, 0.0, 0.0), (0.1, 0.0, 0.0)], atol=1e-6)
    assert not [1 for _, message in scene if message.get('name') == '/path']


def test_a_refused_goal_on_a_held_part_is_drawn_where_the_part_is():
    arm, goal = on_a_part()
    far = replace(goal, waypoints=(*goal.waypoints, Waypoint(pose=Pose((0.0, 3.0, 0.0)))))
    page = refusal_page(far, Unreachable('trajectory.points[2] is far.'), arm, HOME, TCP)
    scene = scenes_of(page)['type']
    place = goal.moving_frame.frame(arm.forward(HOME)).apply((0.0, 3.0, 0.0))
    assert np.allclose(positions(scene, '/refused')[-1], place, atol=1e-5)
