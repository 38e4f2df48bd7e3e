# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The meshes move with our axes, inside our cylinders, and their distances are distances."""

from math import pi

from collision_shapes import capsules, T_base_meshes
from meshes import need_meshes
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.collision_bodies import (
    CollisionBodies,
    Link,
    segment_distance,
)
from ur_cartesian_driver.kinematics.collision_meshes import CollisionMeshes, missing_meshes
from ur_cartesian_driver.kinematics.link_shapes import (
    link_meshes,
    LinkFrames,
    MODELS_WITH_MESHES,
)
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.pose import Pose, pose_from_row


@pytest.fixture(scope='module')
def pinocchio():
    need_meshes(*MODELS_WITH_MESHES)
    return pytest.importorskip('pinocchio')


@pytest.fixture(scope='module')
def all_meshes(pinocchio):
    return {name: CollisionMeshes(Arm(MODELS[name])) for name in MODELS_WITH_MESHES}


#: Models whose meshes are no convex hulls.
EXACT = ('ur3', 'ur5', 'ur10')


def random_joints(n, seed=0):
    return np.random.default_rng(seed).uniform(-pi, pi, (n, 6))


def vertices(meshes, link):
    """The vertices of a link's mesh in its own frame (n, 3)."""
    return meshes._geometry.geometryObjects[int(link)].geometry.vertices()


@pytest.mark.parametrize('name', MODELS_WITH_MESHES)
@pytest.mark.parametrize('is_calibrated', [False, True])
def test_meshes_are_in_the_frames_of_their_links(name, is_calibrated, calibrated_arm, pinocchio):
    """Pinocchio moves them by its own kinematics, :class:`LinkFrames` by ours."""
    arm = calibrated_arm(name) if is_calibrated else Arm(MODELS[name])
    meshes, q = CollisionMeshes(arm), random_joints(5)
    for joints, rows in zip(q, LinkFrames(arm).poses(q), strict=True):
        T_base_mesh = T_base_meshes(meshes, joints)
        for shape in link_meshes(name, 'collision'):
            mine, T = pose_from_row(rows[shape.link]) @ shape.T_link_shape, T_base_mesh[shape.link]
            np.testing.assert_allclose(mine.matrix(), T, atol=1e-9, err_msg=str(shape.link))


def test_on_a_calibrated_arm_the_meshes_go_with_the_real_axes(calibrated_arm, pinocchio):
    arm = calibrated_arm('ur5')
    real, nominal = CollisionMeshes(arm), CollisionMeshes(Arm(MODELS['ur5']))
    at_zero = np.linalg.inv(arm.forward((0,) * 6).matrix()) @ T_base_meshes(real, np.zeros(6))[6]
    for q in random_joints(5):
        T = T_base_meshes(real, q)
        np.testing.assert_allclose(arm.forward(q).matrix() @ at_zero, T[6], atol=1e-9)
        assert 1e-5 < np.abs(T[:, :3, 3] - T_base_meshes(nominal, q)[:, :3, 3]).max() < 0.015


@pytest.mark.slow
@pytest.mark.parametrize('name', MODELS_WITH_MESHES)
def test_cylinders_and_capsules_contain_the_meshes(name, all_meshes):
    """All vertices; the base without the plug of its cable, which sticks out of it."""
    bodies, q = CollisionBodies(Arm(MODELS[name])), random_joints(1)
    cylinder_ends, capsule_ends = bodies.cylinder_ends(q)[0], capsules(bodies, q)[0]
    for link, T in enumerate(T_base_meshes(all_meshes[name], q[0])):
        points = np.unique(vertices(all_meshes[name], link), axis=0)
        if link == Link.BASE:
            points = points[np.hypot(points[:, 0], points[:, 1]) < bodies.radii[0] + 0.003]
            assert len(points) > 100
        points = points @ T[:3, :3].T + T[:3, 3]
        mine = [k for k, of in enumerate(bodies.links) if of == link]
        outside = np.min(
            [
                beyond_cylinder(points, a, b, r)
                for (a, b), r in zip(cylinder_ends[mine], bodies.radii[mine], strict=True)
            ],
            axis=0,
        )
        assert outside.max() < 0.003 if link == Link.BASE else outside.max() < 1e-4, Link(link)
        outside = np.min(
            [
                beyond_capsule(points, a, b, r)
                for (a, b), r in zip(capsule_ends[mine], bodies.capsule_radii[mine], strict=True)
            ],
            axis=0,
        )
        assert outside.max() < (0.003 if link == Link.BASE else 0.0), Link(link)


def beyond_cylinder(points, start, end, radius):
    length = np.linalg.norm(end - start)
    along = (points - start) @ (end - start) / length
    across = np.linalg.norm(points - start - along[:, None] * (end - start) / length, axis=1)
    return np.max([-along, along - length, across - radius], axis=0)


def beyond_capsule(points, start, end, radius):
    way = end - start
    place = np.clip((points - start) @ way / max(way @ way, 1e-300), 0.0, 1.0)
    return np.linalg.norm(points - start - place[:, None] * way, axis=1) - radius


@pytest.mark.parametrize('name', EXACT)
def test_meshes_are_never_nearer_than_their_capsules(name, all_meshes):
    """Those that are no convex hulls, which fill what is between housings and tubes."""
    bodies, q = CollisionBodies(Arm(MODELS[name])), random_joints(5)
    for pair, least in zip(bodies.pairs, bodies.distances(q).T, strict=True):
        if pair[0] != Link.BASE:  # the plug
            assert (all_meshes[name].distances(pair, q) > np.maximum(least, 0.0) - 1e-6).all()


@pytest.mark.slow
@pytest.mark.parametrize('name', MODELS_WITH_MESHES)
def test_what_is_nearer_than_a_bound_is_what_has_a_smaller_distance(name, all_meshes):
    bodies, q, bound = CollisionBodies(Arm(MODELS[name])), random_joints(300, seed=1), 0.005
    counts = np.zeros(2, dtype=int)
    for pair, least in zip(bodies.pairs, bodies.distances(q).T, strict=True):
        rows = q[least < bound][:8]
        if not len(rows):
            continue
        exact = all_meshes[name].distances(pair, rows)
        near, at_least = all_meshes[name].nearer_than(bound, pair, rows)
        np.testing.assert_array_equal(near, exact < bound)
        assert (at_least[~near] <= exact[~near] + 1e-9).all()
        assert (at_least[~near] >= bound).all()
        counts += near.sum(), (~near).sum()
    assert (counts > 5).all()


@pytest.mark.slow
@pytest.mark.parametrize('name', EXACT)
def test_pairs_that_are_left_out_never_meet_first(name, all_meshes):
    """
    Base and upper arm turn past each other, and so do wrist 1 and wrist 3.

    Where the edge of wrist 2 scratches the forearm wrist 3 is in it already. The meshes of the
    UR5 also overlap by 2 mm there while the wrist is straight, where the arm itself passes.
    """
    meshes, turns = all_meshes[name], np.linspace(-pi, pi, 25)
    q = np.zeros((25, 6))
    q[:, 1] = turns
    assert meshes.distances((Link.BASE, Link.UPPER_ARM), q).min() > 0.004
    q = np.zeros((25, 6))
    q[:, 4] = turns
    assert meshes.distances((Link.WRIST_1, Link.WRIST_3), q).min() > 0.01
    q = np.zeros((225, 6))
    q[:, 3:5] = np.stack(
        np.meshgrid(np.linspace(-pi, pi, 15), np.linspace(-pi, pi, 15)), axis=-1
    ).reshape(-1, 2)
    near, _ = meshes.nearer_than(0.0, (Link.FOREARM, Link.WRIST_2), q)
    hits = near & (meshes.distances((Link.FOREARM, Link.WRIST_3), q) > 0.0)
    assert (np.abs(q[hits, 4]) < 1.0).all() if name == 'ur5' else not hits.any()


# -- against an independent computation -----------------------------------------------------------

H = pi / 2
UPPER_ARM_WRIST_1 = (Link.UPPER_ARM, Link.WRIST_1)
#: Configurations of the ur5e, the pair that is nearest in each, and whether it touches.
KNOWN = {
    'elbow closed too far': ((0.0, -H, 2.89, -1.8, -H, 0.0), UPPER_ARM_WRIST_1, True),
    'elbow almost closed': ((0.0, -H, 2.8, -1.8, -H, 0.0), UPPER_ARM_WRIST_1, False),
    'flange in the shoulder': (
        (0.0, -H, 2.9, -1.8, -1.0, 0.0),
        (Link.SHOULDER, Link.FOREARM),
        True,
    ),
}


def triangles(name, link, T):
    """The corners of the triangles (n, 3, 3) of a link in base [m], from the text of the file."""
    found = []
    for shape in link_meshes(name, 'collision'):
        if shape.link == link:
            lines = [line.split() for line in shape.mesh.read_text().splitlines()]
            points = np.array([words[1:4] for words in lines if words[:1] == ['v']], dtype=float)
            corners = [
                [int(word.split('/')[0]) - 1 for word in words[1:]]
                for words in lines
                if words[:1] == ['f']
            ]
            assert {len(face) for face in corners} == {3}
            found.append((points @ T[:3, :3].T + T[:3, 3])[np.array(corners)])
    return np.concatenate(found)


def brute_force_distance(one, other):
    """
    Return the distance of two meshes (n, 3, 3).

    0 where an edge passes through a triangle, else that of a corner from a triangle or of an edge
    from an edge. Pairs whose spheres are farther apart than the best pair do not count.
    """
    centres, radii = zip(*(spheres(mesh) for mesh in (one, other)), strict=True)
    between = np.linalg.norm(centres[0][:, None] - centres[1], axis=2)
    between -= radii[0][:, None] + radii[1]
    best = np.inf
    for bound in (np.partition(between.ravel(), 2000)[2000], None):
        rows, columns = np.nonzero(between <= (best if bound is None else bound))
        a, b = one[rows], other[columns]
        if crosses(a, b) or crosses(b, a):
            return 0.0
        best = min(best, distance_to_corners(a, b), distance_to_corners(b, a))
        for i in range(3):
            for k in range(3):
                edges = (a[:, i], a[:, i - 2] - a[:, i], b[:, k], b[:, k - 2] - b[:, k])
                best = min(best, segment_distance(*(edge.T for edge in edges)).min())
    return best


def distance_to_corners(p, q):
    """Return the smallest distance of a corner of a triangle p straight above its triangle q."""
    normal, best = normals(q), np.inf
    for k in range(3):
        height = np.einsum('nc,nc->n', p[:, k] - q[:, 0], normal)
        best = min(best, np.abs(height[is_inside(p[:, k], q, normal)]).min(initial=np.inf))
    return best


def crosses(p, q):
    """Whether an edge of a triangle p passes through its triangle q, each (n, 3, 3)."""
    normal = normals(q)
    heights = np.einsum('nkc,nc->nk', p - q[:, :1], normal)
    for k in range(3):
        crossing = np.flatnonzero(heights[:, k] * heights[:, k - 2] < 0.0)
        start, end = heights[crossing, k, None], heights[crossing, k - 2, None]
        edge = p[crossing, k - 2] - p[crossing, k]
        point = p[crossing, k] + start / (start - end) * edge
        if is_inside(point, q[crossing], normal[crossing]).any():
            return True
    return False


def normals(triangles):
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    return normal / np.maximum(np.linalg.norm(normal, axis=1), 1e-12)[:, None]


def spheres(mesh):
    centres = mesh.mean(axis=1)
    return centres, np.linalg.norm(mesh - centres[:, None], axis=2).max(axis=1)


def is_inside(points, corners, normals):
    """Whether points (n, 3) are straight above or below triangles (n, 3, 3)."""
    inside = np.ones(len(points), dtype=bool)
    for k in range(3):
        edge = corners[:, k - 2] - corners[:, k]
        inside &= np.einsum('nc,nc->n', np.cross(edge, points - corners[:, k]), normals) >= 0.0
    return inside


@pytest.mark.parametrize('case', KNOWN)
def test_known_configurations_touch_or_are_clear(case, all_meshes):
    """All pairs that are near, and at which of them the arm touches first."""
    joints, nearest, touches = KNOWN[case]
    meshes, q = all_meshes['ur5e'], np.array([joints])
    bodies = CollisionBodies(Arm(MODELS['ur5e']))
    T = [pose_from_row(row) for row in LinkFrames(bodies.arm).poses(q)[0]]
    shapes = {shape.link: shape for shape in link_meshes('ur5e', 'collision')}
    found = {}
    for pair, least in zip(bodies.pairs, bodies.distances(q)[0], strict=True):
        if least < 0.015 or pair == nearest:
            one, other = (
                triangles('ur5e', link, (T[link] @ shapes[link].T_link_shape).matrix())
                for link in pair
            )
            found[pair] = brute_force_distance(one, other)
            assert meshes.distances(pair, q)[0] == pytest.approx(found[pair], abs=1e-6), pair
    assert found[nearest] == min(found.values())
    assert (found[nearest] == 0.0) == touches


def test_the_tool_is_a_cylinder_to_the_tcp(pinocchio):
    """Touching where it reaches into the upper arm, clear where it is shorter."""
    q = np.array([(0.0, -2.0, 2.2, 0.4, -H, 0.0)])
    arm, pair = Arm(MODELS['ur5e']), (Link.UPPER_ARM, Link.TOOL)
    near = [
        CollisionMeshes(arm, Pose((0.0, 0.0, length)), 0.03).distances(pair, q)[0]
        for length in (0.05, 0.1, 0.2, 0.6)
    ]
    assert near == sorted(near, reverse=True)
    assert near[0] > 0.03
    assert near[-1] == 0.0


def test_what_is_missing_is_said(monkeypatch):
    assert missing_meshes('ur10e') == 'there are no meshes of the ur10e'
    missing_meshes.cache_clear()
    monkeypatch.setattr('ur_cartesian_driver.kinematics.link_shapes.find_spec', lambda name: None)
    monkeypatch.setenv('AMENT_PREFIX_PATH', '')
    for name, package in (('ur5', 'example-robot-data'), ('ur7e', 'airo-models')):
        assert missing_meshes(name) == (
            f'the package {package} with the meshes of the arm is not installed, the extra '
            '`collision` brings it'
        )
    missing_meshes.cache_clear()


def test_pinocchio_may_be_missing(monkeypatch, pinocchio):
    missing_meshes.cache_clear()
    monkeypatch.setattr(
        'ur_cartesian_driver.kinematics.collision_meshes.find_spec', lambda name: None
    )
    assert missing_meshes('ur5e') == 'pinocchio is not installed, the extra `collision` brings it'
    missing_meshes.cache_clear()
