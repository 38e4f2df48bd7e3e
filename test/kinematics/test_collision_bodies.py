# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The cylinders of the arm are where the arm is, and their distances are distances."""

from math import pi

from collision_shapes import body_surfaces
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.collision_bodies import (
    CollisionBodies,
    CONNECTOR,
    CONNECTOR_PAIR,
    Link,
    PAIRS,
    segment_gap,
)
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.geometry.pose import Pose

TCP = Pose((0.0, 0.05, 0.15), (0.0, 0.0, 0.0, 1.0))
H = pi / 2

#: Where arms stand every day.
EVERYDAY = {
    'upright': (0, -H, 0, -H, 0, 0),
    'stretched out': (0, 0, 0, 0, 0, 0),
    'elbow up, tool down': (0, -H, H, -H, -H, 0),
    'near pick': (0.5, -2.0, 2.2, -1.8, -H, 0.3),
    'far pick': (0, -0.8, 1.2, -2.0, -H, 0),
    'elbow on the other side': (0, -1.8, -1.6, -1.4, H, 0),
    'tool forward': (0, -2.2, 2.4, -0.2 - pi, -H, 0),
    'tool up': (0, -1.4, 1.9, -0.5 - H, H, 1.0),
    'packed well': (0, -2.4, 2.4, -1.6, -H, 0),
}
#: Folded so far that the arm is in its own way, and what meets what.
FOLDED = {
    'elbow closed': ((0, -H, 3.1, 0, 0, 0), (Link.SHOULDER, Link.FOREARM)),
    'wrist 2 into the upper arm': ((0, -H, 3.1, 1.5, 0, 0), (Link.UPPER_ARM, Link.WRIST_2)),
    'flange into the upper arm': ((0, -H, 3.1, 1, -H, 0), (Link.UPPER_ARM, Link.WRIST_3)),
    'flange on the forearm': ((0, -H, 1, H, pi, 0), (Link.FOREARM, Link.WRIST_3)),
    'forearm through the base': ((0, 1.4, 3.0, -3.0, -H, 0), (Link.BASE, Link.FOREARM)),
}


@pytest.fixture
def rng():
    return np.random.default_rng(4)


def random_joints(rng, n):
    return rng.uniform(-pi, pi, (n, 6))


def sampled(ends, n=60):
    """Points along segments: (..., 2, 3) gives (..., n, 3)."""
    u = np.linspace(0, 1, n)[:, None]
    return ends[..., :1, :] * (1 - u) + ends[..., 1:, :] * u


def closest(points, others):
    return np.linalg.norm(points[:, None] - others[None], axis=2).min()


# -- segments -------------------------------------------------------------------------------------

SEGMENTS = {
    'crossing': ((0, 0, 0), (2, 0, 0), (1, -1, 0.5), (0, 2, 0), 0.5),
    'end against the middle': ((0, 0, 0), (2, 0, 0), (1, 1, 0), (0, 2, 0), 1.0),
    'end against end': ((0, 0, 0), (1, 0, 0), (2, 1, 0), (1, 1, 0), 2**0.5),
    'parallel beside each other': ((0, 0, 0), (2, 0, 0), (1, 0.3, 0), (2, 0, 0), 0.3),
    'antiparallel': ((0, 0, 0), (2, 0, 0), (3, 0.3, 0), (-2, 0, 0), 0.3),
    'parallel behind each other': ((0, 0, 0), (1, 0, 0), (2, 0, 0), (1, 0, 0), 1.0),
    'parallel behind, the other way': ((2, 0, 0), (1, 0, 0), (1, 0, 0), (-1, 0, 0), 1.0),
    'nearly parallel': ((0, 0, 0), (1, 0, 0), (0.2, 0.1, 0), (1, 1e-9, 0), 0.1),
    'a point beside a segment': ((1, 1, 0), (0, 0, 0), (0, 0, 0), (3, 0, 0), 1.0),
    'a segment beside a point': ((0, 0, 0), (3, 0, 0), (4, 0, 0), (0, 0, 0), 1.0),
    'two points': ((1, 1, 1), (0, 0, 0), (1, 1, 3), (0, 0, 0), 2.0),
}


@pytest.mark.parametrize('case', SEGMENTS.values(), ids=SEGMENTS)
def test_segments_have_the_distance_that_geometry_gives_them(case):
    *segments, distance = case
    gap = segment_gap(*np.array(segments, dtype=float)[..., None])
    assert np.linalg.norm(gap) == pytest.approx(distance, abs=1e-8)


def test_no_two_points_of_random_segments_are_nearer_than_their_distance(rng):
    for _ in range(50):
        p, u, q, v = rng.normal(size=(4, 3))
        distance = np.linalg.norm(segment_gap(*np.array([p, u, q, v])[..., None]))
        found = closest(sampled(np.array([p, p + u])), sampled(np.array([q, q + v])))
        longest_gap = (np.linalg.norm(u) + np.linalg.norm(v)) / 59
        assert distance - 1e-12 <= found <= distance + longest_gap


# -- where the bodies are -------------------------------------------------------------------------


@pytest.mark.parametrize('name', MODELS)
def test_the_last_link_ends_in_the_flange_and_the_tool_in_the_tcp(name, rng):
    arm = Arm(MODELS[name])
    bodies = CollisionBodies(arm, TCP, tool_radius=0.02)
    q = random_joints(rng, 4)
    ends = bodies.cylinder_ends(q)
    for row, joints in enumerate(q):
        flange = arm.forward(joints)
        wrist_3 = ends[row, bodies.links.index(Link.WRIST_3)]
        tool = ends[row, bodies.links.index(Link.TOOL)]
        # The meshes of the e-Series reach 0.2 mm beyond it.
        np.testing.assert_allclose(wrist_3[1], flange.position, atol=3e-4)
        np.testing.assert_allclose(tool[0], flange.position, atol=1e-12)
        np.testing.assert_allclose(tool[1], (flange @ TCP).position, atol=1e-12)


@pytest.mark.parametrize('name', ['ur5', 'ur10e', 'ur20'])
def test_a_calibrated_arm_is_within_millimetres_of_its_model(name, calibrated_arm, rng):
    q = random_joints(rng, 50)
    real, nominal = calibrated_arm(name), Arm(MODELS[name])
    assert max(map(abs, real.geometry.d)) > 1.0  # origins far from the arm
    apart = np.abs(
        CollisionBodies(real).cylinder_ends(q) - CollisionBodies(nominal).cylinder_ends(q)
    ).max()
    assert 1e-5 < apart < 0.015


def test_tubes_join_the_axes_of_their_joints(rng):
    for model in MODELS.values():
        arm, q = Arm(model), random_joints(rng, 1)
        bodies, frames = CollisionBodies(arm), arm.frames(q[0])
        ends = bodies.cylinder_ends(q)[0]
        for link, axes in ((Link.UPPER_ARM, (1, 2)), (Link.FOREARM, (2, 3))):
            tubes = [
                each
                for each, of in zip(ends, bodies.links, strict=True)
                if of == link
                and all(
                    np.linalg.norm(np.cross(end - frames.origins[k], frames.axes[k])) < 1e-9
                    for end, k in zip(each, axes, strict=True)
                )
            ]
            (start, end), *others = tubes
            assert not others
            length = -model.geometry.a[axes[0]]
            assert np.linalg.norm(end - start) == pytest.approx(length), model.name


def test_the_connector_is_at_y_of_base_and_stands_still(rng):
    """As in the drawings of each size, where the cable leaves at +y of ``base``."""
    for model in MODELS.values():
        bodies = CollisionBodies(Arm(model))
        assert bodies.links[CONNECTOR] == Link.BASE
        start, end = bodies.cylinder_ends(random_joints(rng, 5))[:, CONNECTOR].transpose(1, 0, 2)
        assert np.ptp(end, axis=0).max() == 0.0
        x, y, z = end[0]
        assert abs(x) < 0.01
        assert 0.09 < y < 0.18
        assert 0.0 < z < 0.06
        np.testing.assert_allclose(start[0], (x, 0.0, z))


# -- distances ------------------------------------------------------------------------------------


@pytest.mark.parametrize('name', MODELS)
def test_distances_are_below_those_of_the_bodies_and_close_to_them(name, rng):
    """No two points of their rims are nearer."""
    bodies = CollisionBodies(Arm(MODELS[name]), TCP, tool_radius=0.03)
    q, compared, looseness = random_joints(rng, 12), 0, []
    for joints, distances in zip(q, bodies.distances(q), strict=True):
        surfaces = body_surfaces(bodies, joints)
        for pair, distance in zip(bodies.pairs, distances, strict=True):
            nearest = min(
                closest(one, other)
                for i, one in enumerate(surfaces)
                if bodies.links[i] == pair[0] and (pair != CONNECTOR_PAIR or i == CONNECTOR)
                for k, other in enumerate(surfaces)
                if bodies.links[k] == pair[1]
            )
            assert distance <= nearest + 1e-9, pair
            compared += 1
            if nearest > 0.3:  # the rims stand for the bodies
                looseness.append(nearest - distance)
    assert compared > 200
    assert np.median(looseness) < 0.06


@pytest.mark.parametrize('name', MODELS)
def test_turning_joint_1_changes_no_distance_but_those_from_the_base(name, rng):
    """The base has a connector, which stands still."""
    bodies = CollisionBodies(Arm(MODELS[name]), TCP, tool_radius=0.03)
    moving = [pair[0] != Link.BASE for pair in bodies.pairs]
    q = random_joints(rng, 20)
    turned = np.add(q, [0.7, 0, 0, 0, 0, 0])
    change = np.abs(bodies.distances(turned) - bodies.distances(q))
    assert change[:, moving].max() < 1e-8
    assert change[:, np.logical_not(moving)].max() > 1e-3


def test_rows_do_not_know_of_each_other(rng):
    bodies = CollisionBodies(Arm(MODELS['ur5e']))
    q = random_joints(rng, 600)  # more than one block
    together = bodies.distances(q)
    for row in (0, 255, 256, 599):
        np.testing.assert_array_equal(bodies.distances(q[row : row + 1])[0], together[row])


@pytest.mark.parametrize('name', MODELS)
def test_everyday_poses_are_free(name):
    """Wherever the arm stands beside its connector."""
    bodies = CollisionBodies(Arm(MODELS[name]))
    for turn in np.linspace(-pi, pi, 13):
        q = np.array(list(EVERYDAY.values()), dtype=float)
        q[:, 0] = turn
        for pose, row in zip(EVERYDAY, bodies.distances(q), strict=True):
            a, b = bodies.pairs[int(row.argmin())]
            assert row.min() > 0.005, f'{pose}, joint 1 at {turn}: {a} and {b}'


@pytest.mark.parametrize('case', FOLDED.values(), ids=FOLDED)
@pytest.mark.parametrize('name', MODELS)
def test_an_arm_folded_into_itself_is_found(name, case):
    q, pair = case
    bodies = CollisionBodies(Arm(MODELS[name]))
    if (name, pair) == ('ur8long', (Link.SHOULDER, Link.FOREARM)):
        return  # its forearm is so much the shorter one that it ends beside the shoulder
    assert bodies.distances(np.array([q], dtype=float))[0, bodies.pairs.index(pair)] < 0.0


def test_a_tool_counts_when_it_has_a_radius():
    arm = Arm(MODELS['ur5e'])
    assert all(Link.TOOL not in pair for pair in CollisionBodies(arm, TCP).pairs)
    assert all(Link.TOOL not in pair for pair in CollisionBodies(arm, tool_radius=0.1).pairs)
    with_tool = CollisionBodies(arm, TCP, tool_radius=0.03)
    assert {a for a, b in with_tool.pairs if b == Link.TOOL} == {
        Link.BASE,
        Link.SHOULDER,
        Link.UPPER_ARM,
        Link.FOREARM,
        Link.WRIST_1,
    }
    # Turned back, a long tool lies in the upper arm while the arm itself is free.
    long = CollisionBodies(arm, Pose((0, 0, 0.6), (0, 0, 0, 1)), tool_radius=0.03)
    q = np.array([[0, -2.2, 2.4, -0.2, -H, 0]])
    hits = [pair for pair, d in zip(long.pairs, long.distances(q)[0], strict=True) if d < 0.005]
    assert hits == [(Link.UPPER_ARM, Link.TOOL)]


def test_neighbours_share_a_joint_and_are_left_out():
    assert all(b - a >= 2 for a, b in PAIRS)
    assert len(PAIRS) == len(set(PAIRS)) == 18


@pytest.mark.parametrize('name', ['ur16e', 'ur3e', 'ur20'])
def test_the_height_of_a_body_is_that_of_its_lowest_point(name, rng):
    bodies = CollisionBodies(Arm(MODELS[name]), TCP, tool_radius=0.03)
    q, normal = random_joints(rng, 3), rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    heights = bodies.heights(q, np.array([normal, -normal]))
    for row, joints in enumerate(q):
        for k, points in enumerate(body_surfaces(bodies, joints, n=720)):
            assert heights[row, 0, k] == pytest.approx((points @ normal).min(), abs=1e-5)
            assert heights[row, 1, k] == pytest.approx(-(points @ normal).max(), abs=1e-5)


@pytest.mark.parametrize('step', [0.001, 0.02, 0.2])
@pytest.mark.parametrize('model', ['ur3', 'ur5e', 'ur20'])
def test_distances_that_are_enough_are_exact_where_they_count(rng, model, step):
    bodies = CollisionBodies(Arm(MODELS[model]), TCP, 0.03)
    for _ in range(5):
        q = random_joints(rng, 1) + np.cumsum(rng.normal(0.0, step, (500, 6)), axis=0)
        exact, found = bodies.distances(q), bodies.distances(q, enough=0.01)
        differ = found != exact
        assert differ.mean() > 0.5 or step > 0.01
        assert (found[differ] >= max(0.01, exact.min())).all()
        assert found.min() == exact.min()
        # Still lower bounds: no two points of the rims are nearer.
        for row, column in list(zip(*np.nonzero(differ), strict=True))[
            :: max(1, differ.sum() // 20)
        ]:
            surfaces, pair = body_surfaces(bodies, q[row], n=8), bodies.pairs[column]
            points = [
                np.concatenate(
                    [
                        surface
                        for k, surface in enumerate(surfaces)
                        if bodies.links[k] == link
                        and (pair != CONNECTOR_PAIR or link != Link.BASE or k == CONNECTOR)
                    ]
                )
                for link in pair
            ]
            assert found[row, column] <= closest(*points)
