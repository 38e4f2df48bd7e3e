# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The page that follows a robot shows where it is, and how far from its planned path."""

from dataclasses import replace
from math import hypot, pi
from urllib.request import urlopen

import numpy as np
import pytest

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.link_shapes import LinkFrames
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Sphere
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.preview import live_page
from ur_cartesian_driver.preview.live_page import path_deviation

viser = pytest.importorskip('viser')

ARM = Arm(MODELS['ur5e'])
HOME = (0.3, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.2)
TCP = Pose((0.0, 0.0, 0.1))


@pytest.fixture(scope='module')
def planned():
    x, y, z = (home := ARM.forward(HOME) @ TCP).position
    goal = Goal(waypoints=(Waypoint(pose=Pose((x, y + 0.1, z), home.quaternion)),))
    return plan(goal, state_at_rest(ARM, HOME, TCP), ARM, PlanningOptions())


@pytest.fixture
def viser_server(monkeypatch):
    """Return what holds the server of the page that is made next."""
    made = []

    make = viser.ViserServer

    def remember(**options):
        server = make(**options)
        server.texts = []
        add_markdown = server.gui.add_markdown

        def remember_text(text):
            server.texts.append(add_markdown(text))
            return server.texts[-1]

        server.gui.add_markdown = remember_text
        made.append(server)
        return server

    monkeypatch.setattr(viser, 'ViserServer', remember)
    return made


def node(server, name):
    return server.scene._handle_from_node_name[name]


def test_the_page_follows_the_robot(planned, viser_server):
    state = state_at_rest(ARM, HOME, TCP)
    with live_page(ARM, state, plan=planned, port=0) as page:
        (server,) = viser_server
        assert page.url.startswith('http://127.0.0.1:')
        assert urlopen(page.url, timeout=5.0).status == 200
        assert '0.00 mm' in server.texts[0].content
        q = (HOME[0] + 0.5, *HOME[1:])
        moved = state_at_rest(ARM, q, Pose((0.0, 0.0, 0.2)))
        page.update(replace(moved, points_begun=1))
        expected = LinkFrames(ARM).poses(np.array([q]))[0, -1, :3]
        assert np.allclose(node(server, '/arm/wrist_3').position, expected, atol=1e-4)
        trail = node(server, '/trail').points
        assert np.allclose(trail[-1, -1], moved.actual_tcp_pose.position, atol=1e-5)
        off = path_deviation(
            planned.reference.poses[:, :3], np.array(moved.actual_tcp_pose.position)
        )
        assert off > 0.05
        assert f'planned path | {1e3 * off:.2f} mm' in server.texts[0].content
        page.say_lost('the robot sent nothing for 1 s')
        assert 'Not connected' in server.texts[0].content


def test_bodies_follow_the_link_and_the_tcp_that_carry_them(viser_server):
    place = Pose.from_rotation_vector((0.02, 0.03, 0.04, 0.1, 0.2, 0.3))
    frames = ('base', 'tool0', 'tool0_controller')
    bodies = tuple(
        CellBody(
            name=f'in {frame}',
            shapes=(PlacedShape(Sphere(0.01)),),
            frame=frame,
            T_frame_body=place,
        )
        for frame in frames
    )
    options = PlanningOptions(cell=Cell(bodies=bodies))
    with live_page(ARM, state_at_rest(ARM, HOME, TCP), options=options, port=0) as page:
        (server,) = viser_server
        for q, tcp in ((HOME, TCP), ((1.0, *HOME[1:]), TCP), (HOME, Pose((0.0, 0.1, 0.3)))):
            page.update(state_at_rest(ARM, q, tcp))
            flange = ARM.forward(q)
            expected = (place, flange @ place, flange @ tcp @ place)
            for k, T in enumerate(expected):
                found = node(server, f'/cell/{k}')
                w, x, y, z = found.wxyz
                drawn = Pose(tuple(found.position), (x, y, z, w))
                assert np.allclose(drawn.matrix(), T.matrix(), atol=1e-6)


def test_the_deviation_is_the_distance_from_the_nearest_edge():
    path = np.array([(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0)])
    assert path_deviation(path, np.array((0.5, -0.2, 0.0))) == pytest.approx(0.2)
    assert path_deviation(path, np.array((1.1, 0.5, 0.0))) == pytest.approx(0.1)
    assert path_deviation(path, np.array((2.0, 2.0, 0.0))) == pytest.approx(hypot(1.0, 1.0))


def test_a_command_without_goal_and_robot_asks_for_one(capsys):
    assert main(['show']) == 1
    assert '--live' in capsys.readouterr().err


def test_a_robot_that_does_not_answer_is_one_sentence(capsys):
    assert main(['show', '--live', '127.0.0.1', '--rtde-port', '1']) == 1
    assert 'port 1' in capsys.readouterr().err
