# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Single moves: where they go, how long they take, what they never exceed."""

from math import pi, radians, sqrt

from hypothesis import assume, given, Phase, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.sim.motion import MotionError

HOME = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
CYCLE = 0.002

few = settings(max_examples=12, deadline=None, phases=[Phase.generate])
offsets = st.tuples(*[st.floats(-1.0, 1.0)] * 6)
# Away from the home pose by this the UR5e meets neither its reach nor its base.
ways = st.tuples(st.floats(-0.12, 0.12), st.floats(-0.12, 0.12), st.floats(-0.12, 0.12))
turns = st.tuples(*[st.floats(-0.3, 0.3)] * 3)


def trapezoid_time(d, a, v):
    return d / v + v / a if d > v * v / a else 2.0 * sqrt(d / a)


def cycles(seconds):
    return seconds / CYCLE


@few
@given(offsets, st.floats(0.5, 5.0), st.floats(0.3, 3.0))
def test_movej_takes_the_time_of_the_closed_formula_and_keeps_a_and_v(recorder, way, a, v):
    target = tuple(q + w for q, w in zip(HOME, way, strict=True))
    lead = max(map(abs, way))
    assume(lead > 0.01)
    r = recorder()
    count = r.run(r.generator.movej(target, a, v))
    assert abs(count - cycles(trapezoid_time(lead, a, v))) <= 1.0 + 1e-9
    assert r.generator.q == target
    speeds = r.speeds()
    assert np.abs(speeds).max() <= v * (1.0 + 1e-9)
    assert np.abs(np.diff(speeds, axis=0)).max() <= a * CYCLE * (1.0 + 1e-6)
    # Straight in joint space: all joints share the path parameter.
    share = (r.q - HOME) @ np.array(way) / np.dot(way, way)
    assert np.abs(r.q - HOME - np.outer(share, way)).max() < 1e-12
    r.step()
    assert not r.generator.moving


@pytest.mark.slow
@few
@given(ways, turns, st.floats(0.3, 3.0), st.floats(0.05, 0.5))
def test_movel_is_straight_in_time_and_ends_exactly(recorder, shifted, way, turn, a, v):
    r = recorder()
    start = r.generator.T_base_tcp
    target = shifted(start, *way, turn=turn)
    length = max(start.distance_to(target), start.angle_to(target))
    assume(start.distance_to(target) > 0.01)
    count = r.run(r.generator.movel(target, a, v))
    assert r.generator.fault is None
    assert abs(count - cycles(trapezoid_time(length, a, v))) <= 1.0 + 1e-9
    p, d = r.positions - start.position, np.array(target.position) - start.position
    share = p @ d / (d @ d)
    assert np.abs(p - np.outer(share, d)).max() < 1e-9
    assert (np.diff(share) >= -1e-12).all()
    assert share[-1] == pytest.approx(1.0, abs=1e-12)
    reached = r.generator.arm.forward(r.generator.q)
    assert reached.distance_to(target) < 1e-12
    assert reached.angle_to(target) < 1e-9
    # Its tool poses agree with its joints.
    for q, pose in zip(r.joints[::50], r.poses[::50], strict=True):
        assert r.generator.arm.forward(q).distance_to(pose) < 1e-9
    assert np.linalg.norm(r.tool_speeds(), axis=1).max() <= v * (1.0 + 1e-6)


@pytest.mark.slow
@few
@given(st.floats(0.05, 0.1), st.floats(0.5, 5.5), st.integers(0, 1))
def test_movec_stays_on_its_circle_at_tool_speed(recorder, radius, angle, mode):
    r = recorder()
    start = r.generator.T_base_tcp
    x, y, z = start.position

    def on_circle(phi):
        return Pose(
            (x + radius * np.sin(phi), y, z + radius * (1.0 - np.cos(phi))), start.quaternion
        )

    # A tool that turns with the tangent must not turn too fast, nor over a wrist singularity.
    a, v = 1.2, 0.1
    angle = min(angle, 1.2) if mode == 1 else angle
    count = r.run(r.generator.movec(on_circle(0.4 * angle), on_circle(angle), a, v, mode=mode))
    assert r.generator.fault is None
    assert abs(count - cycles(trapezoid_time(radius * angle, a, v))) <= 1.0 + 1e-9
    out = np.linalg.norm(r.positions - (x, y, z + radius), axis=1) - radius
    assert np.abs(out).max() < 1e-9
    assert r.positions[-1] == pytest.approx(np.array(on_circle(angle).position), abs=1e-9)


def test_pure_rotation_takes_speed_and_acceleration_in_radians(recorder, shifted):
    r = recorder()
    target = shifted(r.generator.T_base_tcp, turn=(0.0, 0.0, 0.5))
    count = r.run(r.generator.movel(target, 1.2, 0.25))
    assert abs(count - cycles(trapezoid_time(0.5, 1.2, 0.25))) <= 1.0 + 1e-9
    assert np.abs(r.positions - target.position).max() < 1e-12


@pytest.mark.parametrize('seconds', [0.1, 0.5, 1.0, 2.5])
def test_time_counts_more_than_speed_and_acceleration(recorder, shifted, seconds):
    r = recorder()
    target = shifted(r.generator.T_base_tcp, x=0.05)
    assert r.run(r.generator.movel(target, 0.001, 0.001, t=seconds)) == round(cycles(seconds))
    r = recorder()
    target = tuple(q + 0.05 for q in HOME)
    assert r.run(r.generator.movej(target, 0.001, 0.001, t=seconds)) == round(cycles(seconds))


def test_time_that_is_too_short_is_stretched_by_the_joint_speed_limits(recorder):
    r = recorder()
    target = (pi - 0.1, *HOME[1:])
    count = r.run(r.generator.movej(target, t=0.1))
    assert r.generator.q == target
    assert r.generator.fault is None
    assert count >= cycles((pi - 0.1) / pi)
    assert np.abs(r.speeds()).max() <= pi * (1.0 + 1e-5)


def test_movel_slows_down_where_a_joint_would_be_too_fast(recorder, shifted):
    r = recorder()
    start = r.generator.T_base_tcp
    r.run(r.generator.movel(shifted(start, y=0.6), a=20.0, v=3.0))
    assert r.generator.fault is None
    assert np.abs(r.speeds()).max() == pytest.approx(pi, rel=1e-4)
    assert np.abs(r.positions[:, [0, 2]] - np.array(start.position)[[0, 2]]).max() < 1e-9


def test_scaling_says_what_the_limits_leave_of_the_speed(recorder):
    r = recorder()
    g = r.generator
    move = g.movej((pi - 0.1, *HOME[1:]), t=0.5)
    scaled = []
    while not move.returned:
        r.step(0.8)
        scaled.append(g.scaling)
    # Its integral is the time of the move as it was asked for.
    assert sum(scaled) * CYCLE == pytest.approx(0.5, abs=CYCLE)
    assert max(scaled) == 0.8
    assert min(scaled) < 0.5
    r.step(0.7)
    assert g.scaling == 0.7


def test_eight_millisecond_cycles_reach_the_same_place(recorder):
    r = recorder(cycle=0.008)
    target = tuple(q + 0.5 for q in HOME)
    assert (
        abs(
            r.run(r.generator.movej(target))
            - trapezoid_time(0.5, radians(80), radians(60)) / 0.008
        )
        <= 1.0
    )
    assert r.generator.q == target


@pytest.mark.slow
@few
@given(ways, st.lists(st.floats(0.0, 1.0), min_size=5, max_size=30))
def test_speed_scaling_leaves_the_path_unchanged(recorder, shifted, way, scales):
    assume(np.linalg.norm(way) > 0.02)

    def corner_at(scale):
        r = recorder()
        start = r.generator.T_base_tcp
        first = shifted(start, *way)
        r.run(r.generator.movel(first, r=0.4 * np.linalg.norm(way)), scale)
        r.run(r.generator.movel(shifted(first, z=0.1), r=0.0), scale)
        assume(r.generator.fault is None)  # some ways lead out of reach
        return r

    full = corner_at(lambda i: 1.0)
    slow = corner_at(lambda i: max(scales[i // 10 % len(scales)], 0.05 if i % 7 else 0.0))
    assert slow.generator.q == pytest.approx(full.generator.q, abs=1e-9)
    # Each place of the slowed motion lies on the polygon of the other one's, whose sides leave
    # the curve by no more than a v t^2 / 8.
    a, b = full.positions[:-1], full.positions[1:]
    side = b - a
    squares = np.maximum(np.einsum('ij,ij->i', side, side), 1e-30)
    for p in slow.positions[::20]:
        share = np.clip(np.einsum('ij,ij->i', p - a, side) / squares, 0.0, 1.0)
        assert np.linalg.norm(a + share[:, None] * side - p, axis=1).min() < 3e-6


def test_half_speed_takes_twice_the_time_and_none_stands_still(recorder):
    target = tuple(q + 0.5 for q in HOME)
    r = recorder()
    move = r.generator.movej(target)
    for _ in range(100):
        r.step(0.0)
    assert (r.generator.q == HOME and not r.generator.steady) or r.generator.qd == (0.0,) * 6
    assert (
        abs(
            r.run(move, lambda i: 0.5)
            - 2.0 * cycles(trapezoid_time(0.5, radians(80), radians(60)))
        )
        <= 1.0
    )


def test_optimovej_limits_the_jerk_and_keeps_the_joint_line(recorder):
    r = recorder()
    way = np.array([0.8, -0.3, 0.2, 0.0, 0.1, 0.0])
    r.run(r.generator.optimovej(tuple(np.array(HOME) + way), a=0.2, v=0.5))
    speeds = r.speeds()
    jerks = np.diff(speeds, 2, axis=0) / CYCLE**2
    assert 0.4 < np.abs(speeds).max() <= 0.5 * pi * (1.0 + 1e-9)
    assert np.abs(np.diff(speeds, axis=0) / CYCLE).max() <= 0.2 * 40.0 * (1.0 + 1e-9)
    assert np.abs(jerks).max() <= 400.0 * 1.01
    assert r.generator.q == pytest.approx(np.array(HOME) + way, abs=1e-12)


def test_optimovel_is_straight(recorder, shifted):
    r = recorder()
    start = r.generator.T_base_tcp
    r.run(r.generator.optimovel(shifted(start, y=0.2)))
    assert np.abs(r.positions[:, [0, 2]] - np.array(start.position)[[0, 2]]).max() < 1e-9
    assert r.positions[-1][1] == pytest.approx(start.position[1] + 0.2)


@pytest.mark.parametrize(
    'call',
    [
        lambda g, p: g.optimovej(HOME, a=0.0),
        lambda g, p: g.optimovej(HOME, v=1.1),
        lambda g, p: g.optimovel(p, r=-0.1),
        lambda g, p: g.movej(HOME, a=0.0),
        lambda g, p: g.movel(p, v=-1.0),
        lambda g, p: g.movel(p, t=-1.0),
        lambda g, p: g.movel(p, v=float('nan')),
        lambda g, p: g.movep(p, r=float('inf')),
        lambda g, p: g.movec(p, p),
    ],
)
def test_calls_that_make_no_sense_are_refused_and_nothing_moves(recorder, call):
    r = recorder()
    with pytest.raises(MotionError):
        call(r.generator, r.generator.T_base_tcp)
    r.step()
    assert r.generator.q == HOME
    assert not r.generator.moving


def test_tool_offset_moves_on_the_straight_line_not_the_flange(recorder, shifted):
    r = recorder()
    tcp = Pose.from_rotation_vector((0.05, 0.02, 0.1, 0.0, 0.3, 0.0))
    r.generator.T_flange_tcp = tcp
    start = r.generator.T_base_tcp
    target = shifted(start, x=0.1, turn=(0.2, 0.0, 0.1))
    r = type(r)(r.generator)
    r.run(r.generator.movel(target))
    assert np.abs(r.positions[:, 1:] - np.array(start.position)[1:]).max() < 1e-9
    reached = r.generator.arm.forward(r.generator.q) @ tcp
    assert reached.distance_to(target) < 1e-12


def test_next_move_in_the_frame_of_the_return_loses_no_cycle_and_hits_the_corner(
    recorder, shifted
):
    r = recorder()
    first = shifted(r.generator.T_base_tcp, x=0.05)
    r.run(r.generator.movel(first))
    assert r.generator.T_base_tcp == first
    q = r.generator.q
    move = r.generator.movel(shifted(first, y=0.05))
    r.step()
    assert r.generator.q != q
    assert not move.returned


def test_move_to_where_the_arm_stands_returns_at_once(recorder):
    r = recorder()
    assert r.generator.movej(HOME).returned
    assert r.generator.movel(r.generator.T_base_tcp).returned
    r.step()
    assert not r.generator.moving


def test_speeds_are_the_differences_of_the_positions(recorder, shifted):
    r = recorder()
    move = r.generator.movel(shifted(r.generator.T_base_tcp, x=0.05, turn=(0.0, 0.1, 0.0)))
    for _ in range(100):
        r.step()
        assert not move.returned
        assert r.generator.qd == pytest.approx(r.speeds()[-1], abs=1e-9)
        assert r.generator.tcp_twist[:3] == pytest.approx(r.tool_speeds()[-1], abs=1e-9)
        jacobian = r.generator.arm.jacobian((r.q[-1] + r.q[-2]) / 2.0)
        assert r.generator.tcp_twist == pytest.approx(
            jacobian @ np.array(r.generator.qd), abs=1e-5
        )


def test_the_same_calls_give_the_same_bits(recorder, shifted):
    def run():
        r = recorder()
        target = shifted(r.generator.T_base_tcp, x=0.1, y=0.03, turn=(0.1, 0.2, 0.3))
        r.run(r.generator.movel(target, r=0.02), lambda i: 0.3 + 0.001 * (i % 600))
        r.run(r.generator.movej(HOME))
        return r.joints

    assert run() == run()


def test_steady_after_half_a_second_at_rest(recorder):
    r = recorder()
    assert r.generator.steady
    r.run(r.generator.movej(tuple(q + 0.1 for q in HOME)))
    r.step(times=249)
    assert not r.generator.steady
    r.step(times=2)
    assert r.generator.steady


@pytest.mark.parametrize('call', ['movel', 'movej'])
def test_a_timed_move_to_where_the_arm_is_takes_its_time(recorder, call):
    r = recorder()
    where = r.generator.T_base_tcp if call == 'movel' else r.generator.q
    assert r.run(getattr(r.generator, call)(where, t=0.5)) == 250
    assert np.abs(r.speeds()).max() < 1e-9
