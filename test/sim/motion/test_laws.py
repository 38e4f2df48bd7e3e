# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Laws of every kind of move, in all directions and at all speeds."""

from dataclasses import dataclass
from math import pi, sqrt

from hypothesis import assume, given, Phase, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.motion.geometry.pose import Pose

pytestmark = pytest.mark.slow

HOME = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
CYCLE = 0.002
#: How far an arc leaves its chord [m].
BULGE = 0.01

few = settings(max_examples=6, deadline=None, phases=[Phase.generate])
directions = st.tuples(*[st.floats(-1.0, 1.0)] * 3).filter(lambda d: np.linalg.norm(d) > 0.2)
turns = st.tuples(*[st.floats(-0.05, 0.05)] * 3)
joint_ways = st.tuples(*[st.floats(-0.2, 0.2)] * 6).filter(lambda way: max(map(abs, way)) > 0.05)
sliders = st.floats(0.2, 1.0)


@dataclass(frozen=True)
class Way:
    """A move from HOME: its direction, turn and joints, its speed and acceleration."""

    direction: tuple
    turn: tuple
    joints: tuple
    a: float
    v: float
    distance: float = 0.08

    def pose(self, start, part=1.0, aside=0.0):
        """Return a pose on the way, or beside it [m]."""
        d = np.array(self.direction) / np.linalg.norm(self.direction)
        across = np.cross(d, np.eye(3)[np.argmin(np.abs(d))])
        shift = part * self.distance * d + aside * across / np.linalg.norm(across)
        turn = Pose.from_rotation_vector((0.0, 0.0, 0.0, *(part * w for w in self.turn)))
        return Pose(tuple(np.array(start.position) + shift), start.quaternion) @ turn

    def q(self, start):
        return tuple(a + b for a, b in zip(start, self.joints, strict=True))


ways = st.builds(Way, directions, turns, joint_ways, st.floats(0.5, 2.0), st.floats(0.1, 0.4))


def arc(g, way, r, mode):
    return g.movec(
        way.pose(g.T_base_tcp, 0.5, BULGE), way.pose(g.T_base_tcp), way.a, way.v, r, mode
    )


MOVES = {
    'movej': lambda g, way, r: g.movej(way.q(g.q), way.a, way.v, r=r),
    'movel': lambda g, way, r: g.movel(way.pose(g.T_base_tcp), way.a, way.v, r=r),
    'movep': lambda g, way, r: g.movep(way.pose(g.T_base_tcp), way.a, way.v, r),
    'movec': lambda g, way, r: arc(g, way, r, 0),
    'movec, fixed': lambda g, way, r: arc(g, way, r, 1),
    'optimovej': lambda g, way, r: g.optimovej(way.q(g.q), way.a / 8.0, way.v, r),
    'optimovel': lambda g, way, r: g.optimovel(way.pose(g.T_base_tcp), way.a / 8.0, way.v, r),
}
JOINT_MOVES = {'movej', 'optimovej'}
any_move = pytest.mark.parametrize('name', sorted(MOVES))
blend_kinds = pytest.mark.parametrize(
    ('first', 'second'),
    [('movej', 'movej'), ('movej', 'movel'), ('movel', 'movej'), ('movel', 'movel')],
)


def rates(r, name):
    """Return the speed of each cycle in the unit that the call is given in."""
    if name in JOINT_MOVES:
        return np.abs(r.speeds()).max(axis=1)
    tool = np.linalg.norm(r.tool_speeds(), axis=1)
    turn = [a.angle_to(b) / CYCLE for a, b in zip(r.poses[:-1], r.poses[1:], strict=True)]
    # With a fixed orientation the tool turns as the arc tells it, and no faster than that.
    return tool if name == 'movec, fixed' else np.maximum(tool, turn)


def run(recorder, name, way, scale=1.0):
    r = recorder()
    r.run(MOVES[name](r.generator, way, 0.0), lambda i: scale)
    assume(r.generator.fault is None)
    # Where joints are at their limit the move is slower than asked for, which is another law.
    assume(np.abs(r.speeds()).max() < 0.99 * pi)
    return r


def trapezoid_time(d, a, v):
    return d / v + v / a if d > v * v / a else 2.0 * sqrt(d / a)


def farthest(points, polygon):
    """Return the largest distance of a point from a polygon [m]."""
    a, side = polygon[:-1], np.diff(polygon, axis=0)
    squares = np.maximum(np.einsum('ij,ij->i', side, side), 1e-30)
    worst = 0.0
    for p in points:
        share = np.clip(np.einsum('ij,ij->i', p - a, side) / squares, 0.0, 1.0)
        worst = max(worst, np.linalg.norm(a + share[:, None] * side - p, axis=1).min())
    return worst


@pytest.mark.parametrize('name', ['movej', 'movel', 'movep', 'movec', 'movec, fixed'])
@few
@given(ways)
def test_speed_and_acceleration_are_never_above_the_request(recorder, name, way):
    r = run(recorder, name, way)
    r.step()
    speeds = rates(r, name)
    assert speeds.max() <= way.v * (1.0 + 1e-6)
    assert np.abs(np.diff(speeds)).max() <= way.a * CYCLE * (1.0 + 1e-4) + 1e-7


@few
@given(ways)
def test_optimovej_keeps_its_fractions_of_what_joints_can_do(recorder, way):
    r = run(recorder, 'optimovej', way)
    r.step(times=2)
    speeds = r.speeds()
    assert np.abs(speeds).max() <= way.v * pi * (1.0 + 1e-6)
    assert np.abs(np.diff(speeds, axis=0)).max() <= way.a / 8.0 * 40.0 * CYCLE * (1.0 + 1e-6)
    assert np.abs(np.diff(speeds, 2, axis=0)).max() <= 400.0 * CYCLE**2 * (1.0 + 1e-3)


@pytest.mark.parametrize('name', ['movej', 'movel', 'movep', 'movec'])
@few
@given(ways)
def test_time_equals_the_closed_formula(recorder, name, way):
    r = run(recorder, name, way)
    if name == 'movej':
        length = max(map(abs, way.joints))
    elif name == 'movec':
        # A circle through three points: chord and height give radius and angle.
        chord, height = way.distance, BULGE
        radius = (chord**2 / 4.0 + height**2) / (2.0 * height)
        angle = 2.0 * np.arctan2(chord / 2.0, radius - height)
        length = max(radius * angle, r.poses[0].angle_to(r.poses[-1]))
    else:
        length = max(way.distance, r.poses[0].angle_to(r.poses[-1]))
    seconds = (len(r.poses) - 1) * CYCLE
    assert abs(seconds - trapezoid_time(length, way.a, way.v)) <= CYCLE * (1.0 + 1e-6)


@pytest.mark.parametrize('name', ['movel', 'movep', 'optimovel'])
@few
@given(ways, sliders)
def test_straight_moves_are_straight_at_every_speed(recorder, name, way, slider):
    r = run(recorder, name, way, slider)
    d = np.array(way.direction) / np.linalg.norm(way.direction)
    p = r.positions - r.positions[0]
    assert np.linalg.norm(np.cross(p, d), axis=1).max() < 1e-9
    assert (np.diff(p @ d) > -1e-12).all()
    assert p[-1] == pytest.approx(way.distance * d, abs=1e-12)


@pytest.mark.parametrize('name', ['movec', 'movec, fixed'])
@few
@given(ways, sliders)
def test_arcs_are_circles_at_every_speed(recorder, name, way, slider):
    r = run(recorder, name, way, slider)
    start = r.poses[0]
    a, b, c = (np.array(p.position) for p in (start, way.pose(start, 0.5, BULGE), way.pose(start)))
    # Equally far from the three points, in their plane.
    normal = np.cross(b - a, c - a)
    centre = np.linalg.solve(
        [b - a, c - a, normal], [(b @ b - a @ a) / 2.0, (c @ c - a @ a) / 2.0, normal @ a]
    )
    out = r.positions - centre
    assert np.linalg.norm(out, axis=1) == pytest.approx(np.linalg.norm(a - centre), abs=1e-9)
    assert np.abs(out @ normal).max() / np.linalg.norm(normal) < 1e-9
    assert r.positions[-1] == pytest.approx(c, abs=1e-9)
    assert np.linalg.norm(r.positions - b, axis=1).min() <= way.v * CYCLE


@any_move
@few
@given(ways, sliders)
def test_slider_stretches_the_time_and_leaves_the_path(recorder, name, way, slider):
    full, slow = run(recorder, name, way), run(recorder, name, way, slider)
    cycles = len(full.poses) - 1
    # Each ends in the cycle in which its time is over: up to one cycle late.
    assert (cycles - 1) / slider <= len(slow.poses) - 1 <= cycles / slider + 1
    assert farthest(slow.positions[::7], full.positions) < 1e-5
    assert slow.generator.q == pytest.approx(full.generator.q, abs=1e-9)


@blend_kinds
@few
@given(ways, ways, sliders)
def test_slider_leaves_the_path_through_a_blend(recorder, first, second, one, two, slider):
    def through(scale):
        r = recorder()
        r.run(MOVES[first](r.generator, one, 0.02), lambda i: scale)
        # From the same waypoint, wherever in its blend the arm is.
        r.run(onwards(r.generator, first, second, one, two), lambda i: scale)
        assume(r.generator.fault is None and np.abs(r.speeds()).max() < 0.99 * pi)
        return r

    full, slow = through(1.0), through(slider)
    # A slowed arm comes nearer to the border before the call returns.
    assert farthest(slow.positions[::7], full.positions) < 1e-5
    assert slow.generator.q == pytest.approx(full.generator.q, abs=1e-9)


def waypoint(g, first, one):
    """Return pose and joints of the first move's end."""
    start = g.arm.forward(HOME)
    if first == 'movej':
        q = one.q(HOME)
        return g.arm.forward(q), q
    pose = one.pose(start)
    return pose, nearest(g.arm, pose, HOME)


def onwards(g, first, second, one, two):
    """Call the second move, which goes its way from the end of the first."""
    pose, q = waypoint(g, first, one)
    if second == 'movej':
        return g.movej(two.q(q), two.a, two.v)
    return g.movel(two.pose(pose), two.a, two.v)


@blend_kinds
@few
@given(ways, ways, st.floats(0.005, 0.03))
def test_blend_starts_and_ends_at_its_radius(recorder, first, second, one, two, radius):
    r = recorder()
    g = r.generator
    make_blend, q = waypoint(g, first, one)
    r.run(MOVES[first](g, one, radius))
    entered = len(r.poses)
    r.run(onwards(g, first, second, one, two))
    assume(g.fault is None and not g.warnings)
    assume(np.abs(r.speeds()).max() < 0.99 * pi)
    away = np.linalg.norm(r.positions - make_blend.position, axis=1)
    assume(away[0] > radius and away[-1] > radius)
    fastest = np.linalg.norm(r.tool_speeds(), axis=1).max() * CYCLE
    # The call returns in the last cycle before the border.
    assert away[entered - 1] == pytest.approx(radius, abs=fastest + 1e-9)
    # Until there on the first leg, and from the border behind it on the second.
    left = entered + np.argmax(away[entered:] > radius + 1e-9)
    assert_on_leg(r, first, slice(0, entered), HOME, q)
    assert_on_leg(r, second, slice(left, None), q, g.q)
    # Between, the waypoint itself is cut off.
    assert away[entered:left].max(initial=0.0) <= radius + fastest


def assert_on_leg(r, name, part, start, end):
    """Check that places lie on the line between two joint positions, in joints or in space."""
    if name == 'movej':
        points, a, b = r.q[part], np.array(start), np.array(end)
    else:
        points = r.positions[part]
        a, b = (np.array(r.generator.arm.forward(q).position) for q in (start, end))
    d = (b - a) / np.linalg.norm(b - a)
    share = (points - a) @ d
    assert np.abs(points - a - np.outer(share, d)).max() < 1e-8
    assert (np.diff(share) > -1e-9).all()


@any_move
@few
@given(ways)
def test_tool_and_joints_are_the_inverse_of_each_other(recorder, name, way):
    r = run(recorder, name, way)
    g = r.generator
    tcp = Pose.from_rotation_vector((0.02, 0.0, 0.1, 0.0, 0.2, 0.0))
    for before, q, pose in zip(r.joints[:-1:40], r.joints[1::40], r.poses[1::40], strict=True):
        reached = g.arm.forward(q)
        assert reached.distance_to(pose) < 1e-9
        assert reached.angle_to(pose) < 1e-7
        assert nearest(g.arm, reached @ tcp @ tcp.inverse(), before) == pytest.approx(q, abs=1e-8)
