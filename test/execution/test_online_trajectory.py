# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Following targets: bounded, straight, without overshoot, and never to where it cannot stop."""

from dataclasses import replace
from math import dist, hypot, pi
import re
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.execution.live.online_trajectory import (
    LiveLimits,
    OnlineTrajectoryGenerator,
)
from ur_cartesian_driver.execution.live.workspace_guard import LiveWorkspace
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.collision_bodies import CollisionBodies, Link
from ur_cartesian_driver.kinematics.inverse_incremental import singularity_distances
from ur_cartesian_driver.kinematics.robot_models import DhTable, robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.geometry.workspace import Plane

UR5E = robot_model('ur5e')
NOMINAL = Arm(UR5E)
CALIBRATED = Arm(
    UR5E,
    DhTable(
        a=vector6(v + 4e-4 for v in UR5E.geometry.a),
        d=vector6(v - 3e-4 for v in UR5E.geometry.d),
        alpha=vector6(v + 1e-3 for v in UR5E.geometry.alpha),
        theta=(1e-3, -8e-4, 5e-4, 0.0, 1e-3, 0.0),
    ),
)
HOME = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
TCP = Pose((0.01, 0.0, 0.12), quaternion_from_rotation_vector((0.0, 0.3, 0.0)))
DT = 0.008
LIMITS = LiveLimits(
    linear_velocity=0.25, linear_acceleration=1.0, angular_velocity=1.0, angular_acceleration=4.0
)


class Flight:
    """A follower and all of its set-points."""

    def __init__(self, limits=LIMITS, arm=NOMINAL, q=HOME, dt=DT):
        self.generator = OnlineTrajectoryGenerator(arm, TCP, q, limits)
        self.home, self.dt = self.generator.T_base_tcp, dt
        self.poses, self.joints = [self.home], [q]
        self.linear, self.angular = [(0.0,) * 3], [(0.0,) * 3]

    def beside(self, x=0.0, y=0.0, z=0.0, turn=(0.0, 0.0, 0.0)):
        """Return the pose at the start, moved along the base axes and turned about its own."""
        px, py, pz = self.home.position
        return Pose((px + x, py + y, pz + z), self.home.quaternion) @ Pose(
            quaternion=quaternion_from_rotation_vector(turn)
        )

    def run(self, seconds):
        for _ in range(round(seconds / self.dt)):
            self.joints.append(self.generator.step(self.dt))
            self.poses.append(self.generator.T_base_tcp)
            self.linear.append(self.generator.linear)
            self.angular.append(self.generator.angular)
        return self.generator

    def go(self, target, seconds):
        self.generator.set_target(target)
        return self.run(seconds)

    def check_bounds(self):
        """Speeds and accelerations of the tool are within the bounds, and are those told."""
        limits, dt = self.generator.limits, self.dt
        for speeds, most, acceleration in (
            (self.linear, limits.linear_velocity, limits.linear_acceleration),
            (self.angular, limits.angular_velocity, limits.angular_acceleration),
        ):
            v = np.array(speeds)
            assert np.linalg.norm(v, axis=1).max() <= most * (1.0 + 1e-9)
            assert np.linalg.norm(np.diff(v, axis=0), axis=1).max() <= acceleration * dt * (
                1.0 + 1e-6
            )
        places = np.array([pose.position for pose in self.poses])
        assert np.diff(places, axis=0) / dt == pytest.approx(np.array(self.linear[1:]), abs=1e-9)


@pytest.mark.parametrize('arm', [NOMINAL, CALIBRATED], ids=['nominal', 'calibrated'])
def test_it_goes_straight_arrives_and_rests(arm):
    flight = Flight(arm=arm)
    target = flight.beside(0.1, -0.12, 0.03, turn=(0.0, 0.2, 0.3))
    generator = flight.go(target, 1.6)
    assert generator.arrived
    assert not generator.blocked
    flight.check_bounds()
    start, end = np.array(flight.home.position), np.array(target.position)
    along = (end - start) / np.linalg.norm(end - start)
    ways = np.array([pose.position for pose in flight.poses]) - start
    assert np.abs(ways - np.outer(ways @ along, along)).max() < 1e-9, 'straight'
    assert np.diff(ways @ along).min() > -1e-9, 'never back'
    assert (ways @ along).max() < np.linalg.norm(end - start) + 1e-9, 'no overshoot'
    angles = [pose.angle_to(target) for pose in flight.poses]
    assert np.diff(angles).max() < 1e-7
    for pose, q in zip(flight.poses, flight.joints, strict=True):
        assert (arm.forward(q) @ TCP).distance_to(pose) < 1e-8


def test_it_takes_hardly_longer_than_the_fastest_motion():
    flight = Flight()
    flight.generator.set_target(flight.beside(y=0.1))
    while not flight.generator.arrived:
        flight.run(DT)
    # Up with a, on with v, down with 0.8 a.
    fastest = 0.25 / 1.0 + 0.25 / 0.8 + (0.1 - 0.5 * 0.25**2 * (1.0 + 1.0 / 0.8)) / 0.25
    assert len(flight.poses) * DT == pytest.approx(fastest, abs=3.0 * DT)


OFFSETS = st.tuples(*[st.floats(-0.08, 0.08)] * 3)
TURNS = st.tuples(*[st.floats(-0.5, 0.5)] * 3)


@pytest.mark.slow
@settings(max_examples=6, deadline=None, derandomize=True)
@given(jumps=st.lists(st.tuples(OFFSETS, TURNS, st.floats(0.02, 0.3)), min_size=1, max_size=4))
def test_wherever_targets_jump_it_stays_within_bounds_and_arrives_at_the_last(jumps):
    flight = Flight()
    for offset, turn, seconds in jumps:
        x, y, z = offset
        flight.go(flight.beside(x, y, z, turn=turn), seconds)
    flight.run(1.6)
    assert flight.generator.arrived or flight.generator.blocked
    flight.check_bounds()


@settings(max_examples=6, deadline=None, derandomize=True)
@given(steps=st.lists(st.sampled_from([0.0005, 0.002, 0.008, 0.016]), min_size=30, max_size=60))
def test_cycles_of_any_length_make_no_overshoot(steps):
    flight = Flight()
    flight.generator.set_target(flight.beside(y=0.02))
    for dt in steps:
        flight.dt = dt
        flight.run(dt)
    flight.dt = DT
    flight.run(0.8)
    ways = np.array([pose.position[1] for pose in flight.poses]) - flight.home.position[1]
    assert ways.max() < 0.02 + 1e-9
    assert flight.generator.arrived


def test_a_moving_target_is_followed_at_its_braking_distance():
    flight = Flight()
    speed = 0.1
    for i in range(200):
        target = flight.beside(y=speed * DT * i)
        flight.go(target, DT)
    lag = flight.generator.T_base_tcp.distance_to(target)
    assert flight.generator.linear[1] == pytest.approx(speed, rel=1e-3)
    assert lag == pytest.approx(speed**2 / (2.0 * 0.8 * 1.0), abs=1.1 * speed * DT)


def test_without_a_target_it_brakes_and_a_new_one_continues():
    flight = Flight()
    target = flight.beside(y=0.2)
    generator = flight.go(target, 0.3)
    assert hypot(*generator.linear) == pytest.approx(0.25)
    generator.clear_target()
    flight.run(0.3)
    assert generator.at_rest
    assert not generator.arrived
    where = generator.T_base_tcp
    assert flight.go(target, 1.5).arrived
    assert where.distance_to(flight.home) == pytest.approx(
        2.0 * 0.5 * 0.25**2 / 1.0 + 0.25 * 0.05, abs=0.003
    )
    flight.check_bounds()


# --- Where it must not go ---------------------------------------------------------------------


def rooms(q):
    """Yield the room of joints up to everything that stops them, computed the other way round."""
    lows, highs = np.array(UR5E.position_limits).T
    bodies = CollisionBodies(NOMINAL, TCP, 0.05)
    moving = [k for k, link in enumerate(bodies.links) if link != Link.BASE]
    yield 'limit', min(np.minimum(q - lows, highs - q))
    for name, value, margin in zip(
        ('wrist', 'elbow', 'shoulder'),
        singularity_distances(NOMINAL, tuple(q)),
        LIMITS.singularity_margins,
        strict=True,
    ):
        yield name, value - margin
    height = bodies.heights(np.array([q]), np.array([TABLE.normal]))[0, 0, moving].min()
    yield 'table', height - np.dot(TABLE.normal, TABLE.point) - TABLE.margin
    yield 'itself', bodies.distances(np.array([q])).min() - 0.02


TABLE = Plane(name='table', point=(0.0, 0.0, 0.03), normal=(0.0, 0.0, 1.0), margin=0.01)
ANYWHERE = replace(LIMITS, singularity_margins=(0.0, 0.0, 0.0))


def turned_about_joint(flight, joint, angle):
    """Return the pose of the tool after a turn of only one joint."""
    q = list(flight.joints[0])
    q[joint] += angle
    return NOMINAL.forward(q) @ TCP


#: Limits, joints at the start, where to (from the flight), a word of the sentence.
STOP_SIGNALS = {
    'elbow': (LIMITS, HOME, lambda flight: flight.beside(x=-1.0), 'reach|elbow'),
    'wrist': (
        replace(LIMITS, singularity_margins=(0.05, 0.0, 0.0)),
        (0.0, -1.57, 1.57, -1.57, -0.4, 0.0),
        lambda flight: turned_about_joint(flight, 4, 0.8),
        'singularity_margin_wrist',
    ),
    'table': (
        replace(LIMITS, workspace=LiveWorkspace(planes=(TABLE,), tool_radius=0.05)),
        HOME,
        lambda flight: flight.beside(z=-0.5),
        'workspace plane "table", its margin is 0.0100 m',
    ),
    'itself': (
        replace(ANYWHERE, workspace=LiveWorkspace(min_clearance=0.02, tool_radius=0.05)),
        HOME,
        lambda flight: flight.beside(x=0.42, z=-0.2),
        'would come within .* of each other',
    ),
    'limit': (
        ANYWHERE,
        (*HOME[:5], 2.0 * pi - 0.4),
        lambda flight: turned_about_joint(flight, 5, 0.8),
        'wrist_3_joint would be at',
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize('what', STOP_SIGNALS)
def test_it_stops_smoothly_before(what):
    limits, q, target_of, words = STOP_SIGNALS[what]
    flight = Flight(limits, q=q)
    generator = flight.go(target_of(flight), 2.1)
    assert generator.at_rest
    assert not generator.arrived
    assert re.search(words, generator.blocked), generator.blocked
    flight.check_bounds()
    left = [dict(rooms(np.array(q)))[what] for q in flight.joints]
    assert min(left) >= -1e-6
    assert left[-1] < 0.1, 'near to where it has to stop, not anywhere'
    assert flight.go(flight.home, 2.3).arrived, 'and it is free to leave'


def test_a_blocked_arm_does_not_tremble():
    flight = Flight()
    generator = flight.go(flight.beside(x=-1.0), 2.1)
    assert generator.blocked
    x = generator.T_base_tcp.position[0]
    for i in range(50):
        flight.go(flight.beside(x=-1.0, y=1e-4 * (i % 3)), DT)
    assert generator.at_rest
    assert generator.T_base_tcp.position[0] == pytest.approx(x, abs=1e-9)
    assert generator.blocked


def test_a_target_out_of_reach_says_so():
    flight = Flight(ANYWHERE)
    generator = flight.go(flight.beside(x=-1.0), 2.1)
    assert generator.at_rest
    assert 'reach' in generator.blocked
    flight.check_bounds()


def test_the_joints_slow_the_tool_down():
    slow = (0.1, 0.1, 0.1, 0.1, 0.1, 0.1)
    flight = Flight(replace(LIMITS, joint_velocity=slow))
    generator = flight.go(flight.beside(y=0.15), 1.0)
    assert 0.0 < np.linalg.norm(generator.linear) < LIMITS.linear_velocity
    qd = np.abs(np.diff(np.array(flight.joints), axis=0)) / DT
    assert qd.max() == pytest.approx(0.1, rel=1e-3)
    assert flight.go(flight.beside(y=0.15), 4.0).arrived


def test_an_arm_that_begins_too_near_may_leave():
    q = (0.0, -1.57, 1.57, -1.57, -0.03, 0.0)
    flight = Flight(q=q)
    assert flight.go(turned_about_joint(flight, 4, 0.01), 0.5).blocked
    assert dist(flight.generator.q, q) < 1e-6
    assert flight.go(turned_about_joint(flight, 4, -0.1), 0.5).arrived


@pytest.mark.parametrize(
    'field', ['linear_velocity', 'linear_acceleration', 'angular_velocity', 'angular_acceleration']
)
def test_bounds_are_positive(field):
    zero: dict[str, Any] = {field: 0.0}
    with pytest.raises(ValueError, match=field):
        replace(LIMITS, **zero)
