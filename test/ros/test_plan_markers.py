# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A plan as markers, and the frames of the links as transforms."""

from importlib import import_module
from math import pi

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Time
import numpy as np
import pytest
from visualization_msgs.msg import Marker, MarkerArray

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.link_shapes import LinkFrames
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.path import DOWN, mm, Path
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.ros.message_fields import pose_from_message
from ur_cartesian_driver.ros.messages import marker_messages
from ur_cartesian_driver.ros.messages.marker_messages import plan_markers
from ur_cartesian_driver.ros.messages.state_messages import link_transforms
from ur_cartesian_driver.ros.node_endpoints import LATCHED_QOS

ARM = Arm(MODELS['ur5e'])
HOME = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
STATE = state_at_rest(ARM, HOME, IDENTITY)
#: The package has a function of the same name.
PAGE = import_module('ur_cartesian_driver.preview.motion_page')


@pytest.fixture(scope='module')
def made():
    start = Path(STATE.target_tcp_pose.position, DOWN).at(speed=0.1, acceleration=0.5)
    path = start.by(dy=0.1, blend=mm(10)).by(dx=0.1).joint(start.by(dz=0.05).end.position)
    return plan(path.goal(), STATE, ARM, PlanningOptions())


def markers(made):
    first, *others = plan_markers(made, 'left_base', Time(sec=7)).markers
    assert first.action == Marker.DELETEALL
    assert {(m.header.frame_id, m.header.stamp.sec) for m in others} == {('left_base', 7)}
    assert len({(m.ns, m.id) for m in others}) == len(others)
    return {(m.ns, m.id): m for m in others}


def array(points):
    return np.array([(p.x, p.y, p.z) for p in points])


def test_path_points_and_ends_are_those_of_the_plan(made):
    found = markers(made)
    path = found['path', 0]
    np.testing.assert_allclose(array(path.points), made.reference.poses[:, :3])
    kinds = {tuple(np.round(255 * np.array((c.r, c.g, c.b))).astype(int)) for c in path.colors}
    expected = {PAGE.MOTIONS[kind][1] for kind in ('MoveL', 'MoveJ')}
    assert kinds == {*expected, PAGE.BLEND}
    points = array(found['points', 0].points)
    np.testing.assert_allclose(points, [w.pose.position for w in made.goal.waypoints])
    for number, row in ((0, 0), (1, -1)):
        pose = pose_from_message(found['ends', number].pose)
        np.testing.assert_allclose(pose.row(), made.reference.poses[row])


def test_each_part_of_the_path_has_the_colour_of_its_motion(made):
    """Lines at the begin, the blend beside its point, the joint motion at the end."""
    path = markers(made)['path', 0]
    places = array(path.points)
    corner, end_of_lines = (point.pose.position for point in made.goal.waypoints[:2])
    near = [int(np.argmin(np.linalg.norm(places - one, axis=1))) for one in (corner, end_of_lines)]
    colours = [(c.r, c.g, c.b) for c in path.colors]
    line, blend, joint = colours[0], colours[near[0]], colours[-1]
    assert len({line, blend, joint}) == 3
    between = np.linalg.norm(places[: near[1]] - corner, axis=1) > 0.011
    assert {colours[k] for k in np.flatnonzero(between)} == {line}
    assert set(colours[near[1] + 1 :]) == {joint}


def test_long_paths_are_thinned_out_and_keep_their_ends(made, monkeypatch):
    monkeypatch.setattr(marker_messages, 'MAX_SAMPLES', 10)
    monkeypatch.setattr(marker_messages, 'MAX_POINTS', 2)
    found = markers(made)
    path = found['path', 0]
    assert 2 <= len(path.points) <= 11
    assert len(path.colors) == len(path.points)
    np.testing.assert_allclose(array(path.points)[[0, -1]], made.reference.poses[[0, -1], :3])
    assert len(found['points', 0].points) == 2


def test_link_frames_are_where_the_arm_is():
    found = {
        one.child_frame_id: one
        for one in link_transforms(STATE, LinkFrames(ARM), 'left_', Time(sec=7))
    }
    assert {one.header.frame_id for one in found.values()} == {'left_base'}
    moved = found['left_tool0'].transform
    position, turn = moved.translation, moved.rotation
    T = Pose((position.x, position.y, position.z), (turn.x, turn.y, turn.z, turn.w))
    np.testing.assert_allclose(T.matrix(), ARM.forward(HOME).matrix(), atol=1e-9)
    assert set(found) == {
        f'left_{name}'
        for name in (
            *('base_link', 'shoulder_link', 'upper_arm_link', 'forearm_link'),
            *('wrist_1_link', 'wrist_2_link', 'wrist_3_link', 'tool0', 'flange'),
        )
    }


@pytest.mark.slow
def test_the_newest_plan_is_published(single_cell):
    """Also of a goal that is only checked, and for those who come later."""
    cell = single_cell
    cell.wait_ready()
    status, _ = cell.run(cell.goal((2.0, 0.0, 0.0, 0.05), validate_only=True))
    assert status == GoalStatus.STATUS_SUCCEEDED
    newest = []
    cell.client_node.create_subscription(
        MarkerArray, '/ur_cartesian_driver/plan_markers', newest.append, LATCHED_QOS
    )
    cell.spin_until(lambda: newest)
    path = newest[0].markers[1]
    start = cell.T_base_tcp.position
    np.testing.assert_allclose(array(path.points)[0], start, atol=1e-4)
    np.testing.assert_allclose(array(path.points)[-1], np.add(start, (0, 0, 0.05)), atol=1e-4)


def test_a_path_on_a_held_part_moves_with_the_flange():
    flange, frame = STATE.target_tcp_pose, Pose((0.0, 0.02, 0.1), DOWN)
    held = MovingFrame(T_flange_frame=frame, T_base_tool=flange @ frame)
    points = [Waypoint(pose=Pose((x, 0.0, 0.0))) for x in (0.05, 0.1)]
    goal = Goal(waypoints=points, moving_frame=held, corner_deviation=0.001)
    made = plan(goal, STATE, ARM, PlanningOptions())
    first, *others = plan_markers(made, 'left_base', Time(sec=7)).markers
    assert first.action == Marker.DELETEALL
    assert {(m.header.frame_id, m.frame_locked) for m in others} == {('left_tool0', True)}
    by_name = {(m.ns, m.id): m for m in others}
    for name in ('path', 'points'):
        np.testing.assert_allclose(pose_from_message(by_name[name, 0].pose).row(), frame.row())
    end = pose_from_message(by_name['ends', 1].pose)
    assert end.distance_to(frame @ points[-1].pose) < 1e-5
