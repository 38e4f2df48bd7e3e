# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Two moves with a blend: when the call returns, where the corner lies, how smooth it is."""

from math import atan2, pi, sin, sqrt, tan

from hypothesis import assume, given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.motion.geometry.pose import Pose

HOME = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
CYCLE = 0.002
few = settings(max_examples=10, deadline=None)
directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda d: np.linalg.norm(d) > 0.2)


def along(direction, length):
    return tuple(length * np.array(direction) / np.linalg.norm(direction))


def distances(r, waypoint):
    return np.linalg.norm(r.positions - np.array(waypoint.position), axis=1)


@pytest.mark.slow
@few
@given(directions, directions, st.floats(0.01, 0.05), st.floats(0.05, 0.4), st.floats(0.05, 0.4))
def test_blend_of_straight_lines_returns_at_the_radius_and_stays_in_the_corner(
    recorder, shifted, one, two, radius, v1, v2
):
    assume(np.dot(one, two) > -0.9 * np.linalg.norm(one) * np.linalg.norm(two))
    r = recorder()
    start = r.generator.T_base_tcp
    waypoint = shifted(start, *along(one, 0.12), turn=(0.0, 0.1, 0.0))
    end = shifted(waypoint, *along(two, 0.12), turn=(0.1, 0.0, 0.0))
    r.run(r.generator.movel(waypoint, v=v1, r=radius))
    # The next cycle at full speed would enter the blend.
    at_return = distances(r, waypoint)[-1]
    assert radius - 1e-9 <= at_return <= radius + v1 * CYCLE
    returned = len(r.poses)
    r.run(r.generator.movel(end, v=v2))
    assert r.generator.fault is None
    assert not r.generator.warnings
    assert r.generator.T_base_tcp == end
    p = r.positions - np.array(waypoint.position)
    far = np.linalg.norm(p, axis=1) > radius + 1e-9
    into, onwards = (np.array(d) / np.linalg.norm(d) for d in (one, two))
    # Outside the radius it is on the legs ...
    assert np.abs(p[:returned] - np.outer(p[:returned] @ into, into)).max() < 1e-9
    after = p[returned:][far[returned:]]
    assert np.abs(after - np.outer(after @ onwards, onwards)).max() < 1e-9
    # ... inside on the parabola: a mix of both legs whose shares' roots add up to one.
    inside = p[~far]
    if np.linalg.norm(np.cross(into, onwards)) > 0.1:
        shares, *_ = np.linalg.lstsq(np.stack([-into, onwards], axis=1), inside.T, rcond=None)
        roots = np.sqrt(np.maximum(shares / radius, 0.0)).sum(axis=0)
        assert roots == pytest.approx(1.0, abs=1e-4)
        assert (np.abs(shares.T @ np.stack([-into, onwards]) - inside) < 1e-9).all()


@pytest.mark.slow
@few
@given(directions, directions, st.floats(0.01, 0.05), st.floats(0.05, 0.5), st.floats(0.3, 2.0))
def test_tool_never_jumps_and_its_acceleration_is_bounded_through_a_blend(
    recorder, shifted, one, two, radius, v, a
):
    r = recorder()
    waypoint = shifted(r.generator.T_base_tcp, *along(one, 0.12))
    r.run(r.generator.movel(waypoint, a=a, v=v, r=radius))
    r.run(r.generator.movel(shifted(waypoint, *along(two, 0.12)), a=a, v=v))
    r.step(times=3)
    assume(np.abs(r.speeds()).max() < 0.99 * pi)
    speeds = np.linalg.norm(r.tool_speeds(), axis=1)
    accelerations = np.linalg.norm(np.diff(r.tool_speeds(), axis=0), axis=1) / CYCLE
    assert speeds.max() <= v * (1.0 + 1e-6)
    # Both legs' shares, each within a, and a change of the rate by at most half of that.
    assert accelerations.max() <= 3.0 * a


def test_blend_keeps_the_arm_from_stopping(recorder, shifted):
    r = recorder()
    waypoint = shifted(r.generator.T_base_tcp, x=0.1)
    r.run(r.generator.movel(waypoint, v=0.1, r=0.03))
    entered = len(r.poses)
    r.run(r.generator.movel(shifted(waypoint, y=0.1), v=0.1))
    speeds = np.linalg.norm(r.tool_speeds(), axis=1)[entered : entered + 200]
    assert speeds.min() > 0.1 / sqrt(2.0) * 0.99


def test_corner_at_constant_speed_takes_as_long_as_its_two_sides(recorder, shifted):
    r = recorder()
    waypoint = shifted(r.generator.T_base_tcp, x=0.1)
    count = r.run(r.generator.movel(waypoint, v=0.1, r=0.03))
    count += r.run(r.generator.movel(shifted(waypoint, y=0.1), v=0.1))
    assert abs(count * CYCLE - (0.2 / 0.1 + 0.1 / 1.2)) <= 2 * CYCLE


MIXED = {
    'movej': lambda g, q, pose, r: g.movej(q, r=r),
    'movel': lambda g, q, pose, r: g.movel(pose, r=r),
    'movep': lambda g, q, pose, r: g.movep(pose, r=r),
    'optimovej': lambda g, q, pose, r: g.optimovej(q, r=r),
    'optimovel': lambda g, q, pose, r: g.optimovel(pose, r=r),
    'movec': lambda g, q, pose, r: g.movec(
        Pose(
            tuple(
                np.array(pose.position)
                + (g.T_base_tcp.position - np.array(pose.position)) / 2
                + (0.0, 0.0, 0.02)
            ),
            pose.quaternion,
        ),
        pose,
        r=r,
    ),
}
PAIRS = [(a, b) for a in MIXED for b in MIXED]


@pytest.mark.parametrize(('first', 'second'), PAIRS)
def test_any_two_moves_blend_without_a_jump(recorder, first, second):
    r = recorder()
    g = r.generator
    q1 = (0.3, -1.5, 1.5, -1.4, -1.5, 0.2)
    q2 = (0.4, -1.3, 1.5, -1.6, -1.6, 0.1)
    radius = 0.03
    waypoint, end = g.arm.forward(q1), g.arm.forward(q2)
    r.run(MIXED[first](g, q1, waypoint, radius))
    assert distances(r, waypoint)[-1] == pytest.approx(radius, abs=2e-3)
    r.run(MIXED[second](g, q2, end, 0.0))
    r.step(times=3)
    assert g.fault is None
    assert not g.warnings
    assert g.T_base_tcp.distance_to(end) < 1e-9
    assert g.T_base_tcp.angle_to(end) < 1e-7
    assert np.abs(np.diff(r.speeds(), axis=0)).max() < 40.0 * CYCLE
    near = distances(r, waypoint)
    assert 1e-4 < near.min() < radius


def test_joint_moves_blend_in_joint_space(recorder):
    r = recorder()
    a = np.array(HOME)
    b = a + np.array([0.5, 0.0, 0.0, 0.0, 0.0, 0.0])
    c = b + np.array([0.0, 0.0, 0.3, 0.0, 0.0, 0.0])
    r.run(r.generator.movej(tuple(b), r=0.05))
    r.run(r.generator.movej(tuple(c)))
    # Only the two leading joints move: the corner lies in the plane of both legs.
    assert np.abs((r.q - a)[:, [1, 3, 4, 5]]).max() == 0.0
    assert (r.q[:, 0] <= b[0]).all()
    assert (r.q[:, 2] >= b[2]).all()
    assert not any(tuple(q) == tuple(b) for q in r.q)


def test_last_waypoint_without_a_follower_is_reached_and_the_arm_stops(recorder, shifted):
    r = recorder()
    waypoint = shifted(r.generator.T_base_tcp, x=0.1)
    r.run(r.generator.movel(waypoint, r=0.03))
    assert distances(r, waypoint)[-1] > 0.029
    r.rest()
    assert r.generator.T_base_tcp == waypoint
    assert np.linalg.norm(np.diff(r.tool_speeds(), axis=0), axis=1).max() < 1.2 * CYCLE * 1.001


@pytest.mark.parametrize('late', [1, 5, 40, 200])
def test_late_call_blends_from_where_the_arm_is(recorder, shifted, late):
    r = recorder()
    waypoint = shifted(r.generator.T_base_tcp, x=0.1)
    r.run(r.generator.movel(waypoint, v=0.1, r=0.03))
    r.step(times=late)
    end = shifted(waypoint, y=0.1)
    r.run(r.generator.movel(end, v=0.1))
    assert r.generator.T_base_tcp == end
    r.step(times=3)
    accelerations = np.diff(r.tool_speeds(), axis=0) / CYCLE
    assert np.linalg.norm(accelerations, axis=1).max() < 3.0 * 1.2


def test_waypoint_whose_blend_overlaps_the_one_before_is_skipped_with_a_warning(recorder, shifted):
    r = recorder()
    start = r.generator.T_base_tcp
    first = shifted(start, x=0.1)
    second, third = shifted(first, y=0.05), shifted(first, y=0.05, z=-0.1)
    r.run(r.generator.movel(first, r=0.03))
    skipped = r.generator.movel(second, r=0.03)
    assert skipped.returned
    r.run(r.generator.movel(third))
    assert [(w.code, w.argument) for w in r.generator.warnings] == [(171, 11)]
    assert r.generator.T_base_tcp == third
    # From the first waypoint straight to the third.
    p = r.positions[distances(r, first) > 0.031][-1000:] - np.array(first.position)
    d = np.array(third.position) - np.array(first.position)
    on_second_leg = p[p @ d > 0.0]
    assert np.linalg.norm(np.cross(on_second_leg, d), axis=1).max() < 1e-9


def test_several_overlapping_waypoints_are_skipped_one_by_one(recorder, shifted):
    r = recorder()
    first = shifted(r.generator.T_base_tcp, x=0.1)
    r.run(r.generator.movel(first, r=0.03))
    for y in (0.01, 0.02, 0.03):
        assert r.generator.movej(r.generator.q, r=0.03).returned
        assert r.generator.movel(shifted(first, y=y), r=0.03).returned
    r.run(r.generator.movel(shifted(first, y=0.1)))
    assert len(r.generator.warnings) == 6
    assert {w.argument for w in r.generator.warnings} == {4, 11}


def test_overlapping_waypoint_with_nothing_behind_it_is_reached(recorder, shifted):
    r = recorder()
    first = shifted(r.generator.T_base_tcp, x=0.1)
    second = shifted(first, y=0.05)
    r.run(r.generator.movel(first, r=0.03))
    assert r.generator.movel(second, r=0.03).returned
    r.rest()
    assert r.generator.T_base_tcp == second


def test_blends_that_touch_do_not_overlap(recorder, shifted):
    r = recorder()
    pose = r.generator.T_base_tcp
    for step in ((0.1, 0.0), (0.0, 0.06), (-0.06, 0.0), (0.0, 0.06)):
        pose = shifted(pose, x=step[0], y=step[1])
        r.run(r.generator.movel(pose, v=0.1, r=0.03))
    r.rest()
    assert not r.generator.warnings
    assert r.generator.T_base_tcp == pose


def test_stop_waypoint_inside_the_blend_before_it_makes_the_arm_stop_there(recorder, shifted):
    r = recorder()
    first = shifted(r.generator.T_base_tcp, x=0.1)
    second = shifted(first, y=0.02)
    r.run(r.generator.movel(first, r=0.03))
    r.run(r.generator.movel(second))
    assert [w.code for w in r.generator.warnings] == [197]
    # A cycle does not end there: the rest of it belongs to the next move.
    assert min(first.distance_to(pose) for pose in r.poses) < 0.5 * 1.2 * r.generator.cycle**2
    assert r.generator.T_base_tcp == second


@pytest.mark.parametrize(('turn', 'radius'), [(pi / 2, 0.03), (pi / 3, 0.03), (2.0, 0.02)])
def test_movep_goes_at_constant_speed_through_circular_fillets(recorder, shifted, turn, radius):
    r = recorder()
    a, v = 1.2, 0.4  # v^2 / 2a is longer than the radius: movel would have slowed down
    waypoint = shifted(r.generator.T_base_tcp, y=0.15)
    r.run(r.generator.movep(waypoint, a=a, v=v, r=radius))
    entered = len(r.poses)
    end = shifted(waypoint, x=0.15 * sin(turn), y=0.15 * np.cos(turn))
    r.run(r.generator.movep(end, a=a, v=v))
    near = distances(r, waypoint)
    inside = (near < radius - 1e-9).nonzero()[0]
    speeds = np.linalg.norm(r.tool_speeds(), axis=1)
    assert inside[0] >= entered
    assert speeds[entered - 5 : inside[-1]] == pytest.approx(v, rel=1e-3)
    into, onwards = np.array([0.0, 1.0, 0.0]), np.array([sin(turn), np.cos(turn), 0.0])
    fillet = radius / tan(turn / 2.0)
    bisector = (onwards - into) / np.linalg.norm(onwards - into)
    centre = np.array(waypoint.position) + bisector * np.hypot(radius, fillet)
    assert np.linalg.norm(r.positions[inside] - centre, axis=1) == pytest.approx(fillet, abs=1e-9)
    assert atan2(radius, fillet) == pytest.approx(turn / 2.0)


def test_movep_without_a_follower_still_stops_in_its_waypoint(recorder, shifted):
    r = recorder()
    waypoint = shifted(r.generator.T_base_tcp, y=0.15)
    r.run(r.generator.movep(waypoint, v=0.4, r=0.03))
    r.rest()
    assert r.generator.T_base_tcp == waypoint
    assert r.positions[:, 1].max() <= waypoint.position[1] + 1e-12


@pytest.mark.parametrize('radius', [0.002, 0.01, 0.02])
def test_times_are_kept_in_sum_through_blends(recorder, shifted, radius):
    r = recorder()
    pose, count, n, seconds = r.generator.T_base_tcp, 0, 12, 0.4
    for i in range(n):
        pose = shifted(
            pose,
            x=0.04 * (-1.0 if i // 3 % 2 else 1.0) * (i % 2),
            y=0.04 * (1 - i % 2) * (-1.0 if i > 5 else 1.0),
        )
        last = i == n - 1
        count += r.run(r.generator.movel(pose, t=seconds, r=0.0 if last else radius))
    assert r.generator.fault is None
    assert not r.generator.warnings
    assert count * CYCLE == pytest.approx(n * seconds, abs=3 * CYCLE)


def test_changed_tcp_is_not_blended_with_the_old_one(recorder, shifted):
    r = recorder()
    waypoint = shifted(r.generator.T_base_tcp, x=0.1)
    r.run(r.generator.movel(waypoint, r=0.03))
    tcp = Pose((0.0, 0.0, 0.1))
    r.generator.T_flange_tcp = tcp
    end = shifted(waypoint @ tcp, y=0.1)
    move = r.generator.movel(end)
    r.run(move)
    assert r.generator.T_base_tcp.distance_to(end) < 1e-9
    flange = np.array([r.generator.arm.forward(q).position for q in r.joints])
    assert np.linalg.norm(flange - np.array(waypoint.position), axis=1).min() < 1e-9
