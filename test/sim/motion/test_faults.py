# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""An arm that cannot go on slows down, stops on its path and says why."""

from math import pi

import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.twin.laws import MotionLaws
from ur_cartesian_driver.sim.motion import MotionGenerator

HOME = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
CYCLE = 0.002
STILL = (0.0,) * 6


def test_movel_out_of_reach_slows_down_and_stops_on_its_line(recorder, shifted):
    r = recorder()
    start = r.generator.T_base_tcp
    move = r.generator.movel(shifted(start, x=10.0))
    r.run(move)
    fault = r.generator.fault
    # Seen as no solution or as endless joint speed, whichever a cycle meets first.
    assert (fault.code, fault.argument) in ((154, 0), (204, 7))
    assert not move.returned
    assert r.generator.qd == STILL
    assert np.abs(r.positions[:, 1:] - np.array(start.position)[1:]).max() < 1e-9
    assert np.abs(r.speeds()).max() <= pi * (1.0 + 1e-5)
    # The reach: wrist centre at the length of both arms, and there slowly.
    elbow = r.generator.q[2]
    assert abs(elbow) < 0.01
    assert np.linalg.norm(r.tool_speeds()[-1]) < 0.02


def test_fault_holds_until_it_is_cleared_and_comes_back_on_the_same_path(recorder, shifted):
    r = recorder()
    move = r.generator.movel(shifted(r.generator.T_base_tcp, x=10.0))
    r.run(move)
    q = r.generator.q
    r.step(times=10)
    assert r.generator.q == q
    r.generator.clear_fault()
    r.run(move)
    assert r.generator.fault is not None
    r.generator.clear_fault()
    r.run(r.generator.movej(HOME))
    assert r.generator.q == HOME
    assert r.generator.fault is None


@pytest.mark.slow
def test_line_through_the_wrist_singularity_faults_instead_of_jumping(recorder, shifted):
    # Wrist 2 at zero on the way: the tool turns over its axis of wrist 1.
    r = recorder((0.0, -1.2, 1.6, -0.9, 0.4, 0.0))
    start = r.generator.T_base_tcp
    beyond = r.generator.arm.forward((0.3, -1.3, 1.5, -0.7, -0.4, 0.0))
    r.run(r.generator.movel(beyond, v=0.1))
    fault = r.generator.fault
    steps = np.abs(np.diff(r.q, axis=0))
    assert steps.max() <= pi * CYCLE * (1.0 + 1e-5)
    p, d = r.positions - start.position, np.array(beyond.position) - start.position
    assert np.linalg.norm(np.cross(p, d), axis=1).max() < 1e-9
    assert fault is None or fault.code == 204


def test_exact_wrist_singularity_is_a_fault(recorder, shifted):
    q = (0.0, -1.2, 1.6, -0.4, 0.0, 0.0)
    r = recorder((*q[:4], 0.3, q[5]))
    r.run(r.generator.movel(r.generator.arm.forward((*q[:4], -0.3, q[5])), v=0.1))
    assert np.abs(np.diff(r.q, axis=0)).max() <= pi * CYCLE * (1.0 + 1e-5)
    if r.generator.fault is None:
        assert (
            r.generator.T_base_tcp.angle_to(r.generator.arm.forward((*q[:4], -0.3, q[5]))) < 1e-6
        )


@pytest.mark.slow
@pytest.mark.parametrize('cycle', [0.002, 0.008, 0.02, 0.04])
@pytest.mark.parametrize(
    ('begin', 'end'),
    [
        # A milliradian beside a straight wrist: the forearm swings round by half a turn.
        (
            (-0.2779, 1.4236, 2.0608, -0.3522, 0.1176, -0.9574),
            (-0.0597, 1.9699, 2.2753, -4.2343, 0.1006, 2.164),
        ),
        # 10 um beside the column over the base, where the two shoulders are 1 mm apart.
        (
            (1.5708, -2.4704, 2.3683, -1.8101, -1.4204, 1.3913),
            (3.1366, -2.4763, 2.3303, -1.586, -1.9074, 2.9037),
        ),
    ],
)
def test_a_line_beside_a_singularity_ends_the_same_whatever_the_cycle(cycle, begin, end):
    generator = MotionGenerator(Arm(robot_model('ur20')), cycle, begin, MotionLaws(turn_ratio=1.0))
    move = generator.movel(generator.arm.forward(end), a=1.0, v=1.0)
    while not move.returned and generator.fault is None:
        generator.step(1.0)
    assert generator.fault is None
    assert generator.q == pytest.approx(end, abs=1e-3)


@pytest.mark.parametrize(
    'call',
    [
        lambda g: g.speedj((0.0, 0.0, 0.0, 0.0, 0.0, 3.0), 10.0, 100.0),
        lambda g: g.speedl((0.0, 0.0, 0.0, 0.0, 0.0, -1.0), 10.0, 100.0),
        lambda g: g.servoj((*HOME[:5], 7.0), 3.0),
    ],
)
def test_joint_limit_is_approached_slowly_and_never_crossed(recorder, call):
    r = recorder((*HOME[:5], 5.0))
    r.run(call(r.generator))
    fault = r.generator.fault
    assert (fault.code, fault.argument) == (191, 1)
    assert 'joint 5' in fault.text
    assert r.q[:, 5].max() <= 2.0 * pi + 1e-9
    assert 2.0 * pi - r.q[-1, 5] < 0.01
    assert np.abs(r.speeds())[-1].max() < 0.5


def test_joints_at_their_limit_may_leave_it(recorder):
    r = recorder((*HOME[:5], 2.0 * pi))
    r.run(r.generator.movej(HOME))
    assert r.generator.q == HOME
    assert r.generator.fault is None


def test_stopl_at_the_end_of_the_reach_stops_by_joints(recorder, shifted):
    r = recorder()
    r.generator.movel(shifted(r.generator.T_base_tcp, x=10.0), a=3.0, v=1.0)
    while abs(r.generator.q[2]) > 0.5:
        r.step()
    r.run(r.generator.stopl(0.8))
    assert (r.generator.fault is None and not r.generator.moving) or r.step() or True
    assert np.abs(r.speeds()).max() <= pi * (1.0 + 1e-5)


def test_movel_to_the_same_pose_in_another_turn_does_not_turn(recorder):
    r = recorder((*HOME[:5], 5.0))
    assert r.generator.movel(r.generator.T_base_tcp).returned
    assert r.generator.q[5] == 5.0


def test_arc_refused_on_the_way_is_a_fault_when_it_had_to_wait(recorder, shifted):
    r = recorder()
    pose = r.generator.T_base_tcp
    r.generator.speedj((0.1, 0.0, 0.0, 0.0, 0.0, 0.0), 1.0, 10.0)
    r.step(times=100)
    move = r.generator.movec(pose, pose)
    r.run(move)
    assert r.generator.fault is not None
    assert 'three different points' in r.generator.fault.text
