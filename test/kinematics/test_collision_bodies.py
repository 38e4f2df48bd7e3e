# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The cylinders of the arm are where the arm is, and their distances are distances."""

from math import pi

from collision_shapes import capsules
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.collision_bodies import (
    CollisionBodies,
    Link,
    PAIRS,
    segment_distance,
)
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.pose import Pose

TCP = Pose((0.0, 0.05, 0.15), (0.0, 0.0, 0.0, 1.0))
H = pi / 2

#: Where arms stand every day; the first joint does not matter.
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
    assert segment_distance(*np.array(segments, dtype=float)) == pytest.approx(distance, abs=1e-8)


def test_no_two_points_of_random_segments_are_nearer_than_their_distance(rng):
    for _ in range(50):
        p, u, q, v = rng.normal(size=(4, 3))
        distance = segment_distance(p, u, q, v)
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
        np.testing.assert_allclose(wrist_3[1], flange.position, atol=1e-12)
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


def test_tubes_join_the_housings_of_their_joints(rng):
    for model in MODELS.values():
        ends = CollisionBodies(Arm(model)).cylinder_ends(random_joints(rng, 1))[0]
        links = CollisionBodies(Arm(model)).links
        for link, length in (
            (Link.UPPER_ARM, model.geometry.a[1]),
            (Link.FOREARM, model.geometry.a[2]),
        ):
            first, tube, last = (ends[k] for k, of in enumerate(links) if of == link)
            assert np.linalg.norm(tube[1] - tube[0]) == pytest.approx(-length)
            for place, housing in ((tube[0], first), (tube[1], last)):
                on_axis = segment_distance(place, np.zeros(3), housing[0], housing[1] - housing[0])
                assert on_axis < 1e-12, (model.name, link)


def test_capsules_contain_their_cylinders(rng):
    bodies = CollisionBodies(Arm(MODELS['ur3']), TCP, tool_radius=0.03)
    q = random_joints(rng, 2)
    for ends, covers in zip(bodies.cylinder_ends(q), capsules(bodies, q), strict=True):
        for (start, end), radius, cover, thick in zip(
            ends, bodies.radii, covers, bodies.capsule_radii, strict=True
        ):
            axis = (end - start) / np.linalg.norm(end - start)
            across = np.cross(axis, rng.normal(size=3))
            across *= radius / np.linalg.norm(across)
            for point in (start + across, end + across, 0.5 * (start + end) + across):
                out = segment_distance(point, np.zeros(3), cover[0], cover[1] - cover[0])
                assert out <= thick + 1e-12


# -- distances ------------------------------------------------------------------------------------


@pytest.mark.parametrize('name', ['ur3e', 'ur10'])
def test_distances_are_those_of_the_nearest_points_of_the_capsules(name, rng):
    bodies = CollisionBodies(Arm(MODELS[name]), TCP, tool_radius=0.03)
    q = random_joints(rng, 3)
    lines = sampled(capsules(bodies, q))
    for row, distances in enumerate(bodies.distances(q)):
        for pair, distance in zip(bodies.pairs, distances, strict=True):
            found = min(
                closest(lines[row, i], lines[row, j])
                - bodies.capsule_radii[i]
                - bodies.capsule_radii[j]
                for i, of in enumerate(bodies.links)
                if of == pair[0]
                for j, other in enumerate(bodies.links)
                if other == pair[1]
            )
            assert distance - 1e-9 <= found < distance + 0.02, pair


@pytest.mark.parametrize('name', MODELS)
def test_turning_joint_1_changes_no_distance(name, rng):
    bodies = CollisionBodies(Arm(MODELS[name]), TCP, tool_radius=0.03)
    q = random_joints(rng, 20)
    turned = np.add(q, [0.7, 0, 0, 0, 0, 0])
    np.testing.assert_allclose(bodies.distances(turned), bodies.distances(q), atol=1e-12)


def test_rows_do_not_know_of_each_other(rng):
    bodies = CollisionBodies(Arm(MODELS['ur5e']))
    q = random_joints(rng, 600)  # more than one block
    together = bodies.distances(q)
    for row in (0, 255, 256, 599):
        np.testing.assert_array_equal(bodies.distances(q[row : row + 1])[0], together[row])


@pytest.mark.parametrize('name', MODELS)
def test_everyday_poses_are_free(name):
    bodies = CollisionBodies(Arm(MODELS[name]))
    distances = bodies.distances(np.array(list(EVERYDAY.values()), dtype=float))
    for pose, row in zip(EVERYDAY, distances, strict=True):
        a, b = bodies.pairs[int(row.argmin())]
        assert row.min() > 0.005, f'{pose}: {a} and {b}'


@pytest.mark.parametrize('case', FOLDED.values(), ids=FOLDED)
@pytest.mark.parametrize('name', MODELS)
def test_an_arm_folded_into_itself_is_found(name, case):
    q, pair = case
    bodies = CollisionBodies(Arm(MODELS[name]))
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
    assert len(PAIRS) == len(set(PAIRS)) == 17


def test_the_height_of_a_cylinder_is_that_of_its_lowest_point(rng):
    bodies = CollisionBodies(Arm(MODELS['ur16e']), TCP, tool_radius=0.03)
    q, normal = random_joints(rng, 3), rng.normal(size=3)
    normal /= np.linalg.norm(normal)
    heights = bodies.heights(q, np.array([normal, -normal]))
    angle = np.linspace(0, 2 * pi, 721)[:, None]
    for row, ends in enumerate(bodies.cylinder_ends(q)):
        for k, (start, end) in enumerate(ends):
            axis = (end - start) / np.linalg.norm(end - start)
            u = np.cross(axis, normal)
            u /= np.linalg.norm(u)
            rim = bodies.radii[k] * (np.cos(angle) * u + np.sin(angle) * np.cross(axis, u))
            points = np.concatenate([start + rim, end + rim])
            assert heights[row, 0, k] == pytest.approx((points @ normal).min(), abs=1e-5)
            assert heights[row, 1, k] == pytest.approx(-(points @ normal).max(), abs=1e-5)


@pytest.mark.parametrize('step', [0.001, 0.02, 0.2])
@pytest.mark.parametrize('model', ['ur3', 'ur5e', 'ur20'])
def test_distances_that_are_enough_are_exact_where_they_count(rng, model, step):
    bodies = CollisionBodies(Arm(MODELS[model]), TCP, 0.03)
    for _ in range(5):
        q = random_joints(rng, 1) + np.cumsum(rng.normal(0.0, step, (500, 6)), axis=0)
        exact, found = bodies.distances(q), bodies.distances(q, enough=0.01)
        counts = exact < max(0.01, exact.min() + 1e-12)
        assert (found[counts] == exact[counts]).all()
        assert (found <= exact + 1e-12).all()
        assert (found[~counts] >= max(0.01, exact.min())).all()
