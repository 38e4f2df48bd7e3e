# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The kinematics of a held part, compared with differences of poses, and what monitors see."""

from dataclasses import replace

from held_part_goals import held_case, rounded_goal
import numpy as np
import pytest
from random_cases import random_of

from ur_cartesian_driver.kinematics.differential_kinematics import tool_rates
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.pose_rows import angle_rows, inverse_rows, rotate_rows
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.planning.preflight.held_part_kinematics import HeldPartKinematics
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.stop_prediction import state_at_rest

pytest.importorskip('pinocchio')

#: Step of differences [s].
H = 1e-4
T_FLANGE_TCP = Pose((0.01, -0.02, 0.08))


@pytest.fixture(params=range(6))
def case(request):
    return held_case(random_of('held kinematics', request.param), rounded_goal)


@pytest.fixture
def kinematics(case):
    return HeldPartKinematics(case.arm, T_FLANGE_TCP, case.frame)


@pytest.fixture
def moving(case):
    """Joint positions, velocities and accelerations near the start, (5, 6) each."""
    rng = np.random.default_rng(1)
    return (
        np.array(case.state.actual_q) + rng.normal(0.0, 0.2, (5, 6)),
        rng.normal(size=(5, 6)),
        rng.normal(size=(5, 6)),
    )


def at(moving, t):
    q, qd, qdd = moving
    return q + t * qd + 0.5 * t * t * qdd


def angular(before, after, h):
    """The angular velocity (n, 3) between rotations (n, 3, 3)."""
    W = (after - before) @ (0.5 * (after + before)).transpose(0, 2, 1) / h
    return np.stack([W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]], axis=1)


def test_poses_are_those_of_pinocchio_and_lead_back_to_the_flange(case, kinematics, moving):
    q, _, _ = moving
    poses, wanted = kinematics.pose_rows(q), case.relative(q)
    np.testing.assert_allclose(poses[:, :3], wanted[:, :3, 3], atol=1e-9)
    for row, T in zip(poses, wanted, strict=True):
        pose = Pose(tuple(row[:3].tolist()), tuple(row[3:].tolist()))
        np.testing.assert_allclose(pose.matrix(), T, atol=1e-9)
        flange = kinematics.flange(pose)
        assert case.frame.tool(flange).distance_to(pose) < 1e-12
        assert kinematics.tcp(pose).distance_to(flange @ T_FLANGE_TCP) < 1e-12
    back, flange = kinematics.flange_rows(poses), case.arm.forward_rows(q)
    np.testing.assert_allclose(back[:, :3], flange[:, :3], atol=1e-12)
    assert angle_rows(back[:, 3:], flange[:, 3:]).max() < 1e-7


def test_rates_are_the_differences_of_pinocchios_poses(case, kinematics, moving):
    before, now, after = (case.relative(at(moving, t)) for t in (-H, 0.0, H))
    p = [T[:, :3, 3] for T in (before, now, after)]
    R = [T[:, :3, :3] for T in (before, now, after)]
    twist, acceleration = kinematics.tool_rates(*moving)
    np.testing.assert_allclose(twist[:, :3], (p[2] - p[0]) / (2 * H), atol=1e-6)
    np.testing.assert_allclose(acceleration[:, :3], (p[2] - 2 * p[1] + p[0]) / H**2, atol=1e-4)
    np.testing.assert_allclose(twist[:, 3:], angular(R[0], R[2], 2 * H), atol=1e-6)
    change = angular(R[1], R[2], H) - angular(R[0], R[1], H)
    np.testing.assert_allclose(acceleration[:, 3:], change / H, rtol=1e-4, atol=1e-4)


def test_joint_rates_are_the_inverse(kinematics, moving):
    q, qd, qdd = moving
    found = kinematics.joint_rates(q, *kinematics.tool_rates(q, qd, qdd))
    np.testing.assert_allclose(found[0], qd, atol=1e-6)
    np.testing.assert_allclose(found[1], qdd, atol=1e-5)


def test_bounds_of_joint_rates_are_bounds(kinematics, moving):
    q, qd, qdd = moving
    twist, acceleration = kinematics.tool_rates(q, qd, qdd)
    for k in range(len(q)):
        sizes = [
            (float(np.linalg.norm(rows[k, :3])), float(np.linalg.norm(rows[k, 3:])))
            for rows in (twist, acceleration)
        ]
        most = kinematics.largest_joint_rates(q[k : k + 1], *sizes)
        assert np.all(np.abs(qd[k]) <= most[0] + 1e-9)
        assert np.all(np.abs(qdd[k]) <= most[1] + 1e-9)


def test_the_speed_of_the_tcp_in_base_is_known(case, kinematics, moving):
    q, qd, qdd = moving
    speeds = np.linalg.norm(tool_rates(case.arm, T_FLANGE_TCP, q, qd, qdd)[0][:, :3], axis=1)
    np.testing.assert_allclose(kinematics.carrier_speeds(q, qd), speeds, atol=1e-12)
    assert TcpKinematics(case.arm, T_FLANGE_TCP).carrier_speeds(q, qd) is None


def test_a_packet_is_seen_from_the_part(case, kinematics, moving):
    q, qd, qdd = (rows[:1] for rows in moving)
    twist, acceleration = tool_rates(case.arm, T_FLANGE_TCP, q, qd, qdd)
    known = vector6(twist[0].tolist()), vector6(acceleration[0].tolist())
    packet = replace(
        state_at_rest(case.arm, vector6(q[0].tolist()), T_FLANGE_TCP),
        actual_tcp_twist=known[0],
        target_tcp_twist=known[0],
        actual_tcp_acceleration=known[1],
    )
    seen = case.frame.seen(packet)
    twist, acceleration = kinematics.tool_rates(q, qd, qdd)
    assert seen.actual_tcp_pose.matrix() == pytest.approx(case.relative(q)[0], abs=1e-9)
    assert seen.target_tcp_twist == pytest.approx(twist[0], abs=1e-9)
    assert seen.actual_tcp_twist == seen.target_tcp_twist
    assert seen.actual_tcp_acceleration == pytest.approx(acceleration[0], abs=1e-9)
    assert seen.target_tcp_acceleration is None
    assert seen.T_flange_tcp == T_FLANGE_TCP


def test_a_shift_of_the_flange_shifts_the_tool_on_the_part(case):
    flange, shift = case.arm.forward(case.state.actual_q), (0.003, -0.002, 0.001)
    moved = case.frame.flange_shift(flange, shift)
    beside = Pose(tuple(np.add(flange.position, moved).tolist()), flange.quaternion)
    before, after = case.frame.tool(flange), case.frame.tool(beside)
    assert np.subtract(after.position, before.position) == pytest.approx(shift, abs=1e-12)
    assert after.angle_to(before) < 1e-7


def test_rows_are_inverted_and_turned_as_poses_are():
    rng = np.random.default_rng(2)
    rows = np.concatenate([rng.normal(size=(4, 3)), rng.normal(size=(4, 4))], axis=1)
    rows[:, 3:] /= np.linalg.norm(rows[:, 3:], axis=1)[:, None]
    vectors = rng.normal(size=(4, 3))
    for row, back, vector, turned in zip(
        rows, inverse_rows(rows), vectors, rotate_rows(rows[:, 3:], vectors), strict=True
    ):
        pose = Pose(tuple(row[:3].tolist()), tuple(row[3:].tolist()))
        assert back == pytest.approx(pose.inverse().row(), abs=1e-12)
        assert turned == pytest.approx(pose.matrix()[:3, :3] @ vector, abs=1e-12)
