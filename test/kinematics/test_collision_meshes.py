# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The meshes move with our axes, inside our cylinders, and their distances are distances."""

import json
from math import pi
from pathlib import Path

from collision_shapes import beyond_bodies, T_base_meshes
from meshes import need_meshes
import numpy as np
import pytest
from random_cases import cases, random_of
from scipy.spatial.distance import cdist

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.collision_bodies import (
    CollisionBodies,
    Link,
    segment_gap,
)
from ur_cartesian_driver.kinematics.collision_meshes import (
    CollisionMeshes,
    missing_meshes,
)
from ur_cartesian_driver.kinematics.link_shapes import (
    connector_shape,
    link_meshes,
    LinkFrames,
    mesh_tolerance,
    MODELS_WITH_MESHES,
)
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.kinematics.solids import coal
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.clearance import Clearance

#: Joints [rad] and distances [m] by model and pair of links.
GOLDEN = json.loads((Path(__file__).parent / 'golden' / 'mesh_distances.json').read_text())


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
            if shape.mesh is not None:
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
@pytest.mark.parametrize('detail', ['visual', 'collision'])
@pytest.mark.parametrize('name', MODELS_WITH_MESHES)
def test_bodies_contain_every_triangle_of_the_meshes(name, detail, pinocchio):
    """
    Triangles are divided until each part has its corners in one body, which is convex.

    Of the drawn bases of the e-Series only the part above the mounting surface counts: the cable.
    One triangle of 5 mm² is 6 cm beside all others of the UR10's drawn upper arm, by an oversight.
    """
    bodies, q = CollisionBodies(Arm(MODELS[name])), random_joints(1)
    T = [pose_from_row(row) for row in LinkFrames(bodies.arm).poses(q)[0]]
    contained = 0
    for shape in link_meshes(name, detail):
        if shape.mesh is None:
            continue
        T_base_mesh = T[shape.link] @ shape.T_link_shape
        parts = loaded_triangles(shape.mesh, T_base_mesh.matrix())
        if (name, detail, shape.link) == ('ur10', 'visual', Link.UPPER_ARM):
            loose = (-0.1012, 0.0331, 0.6615)
            apart = np.linalg.norm(parts - T_base_mesh.matrix()[:3] @ (*loose, 1.0), axis=2)
            assert (apart.max(axis=1) < 0.004).sum() == 3  # its corners
            parts = parts[apart.max(axis=1) > 0.06]
        if shape.link == Link.BASE and detail == 'visual':
            parts = parts[(parts[:, :, 2] > -0.0005).all(axis=1)]
        contained += len(parts)
        for _ in range(20):
            outside = beyond_bodies(bodies, q[0], shape.link, parts.reshape(-1, 3))
            is_inside = (outside.reshape(-1, len(parts), 3) < 1e-6).all(axis=2).any(axis=0)
            parts = halves(parts[~is_inside])
            if not len(parts):
                break
        assert not len(parts), f'{shape.link}: {1e3 * outside.min(axis=0).max():.2f} mm outside'
    assert contained > 3000


def loaded_triangles(file, T):
    """The corners of the triangles (n, 3, 3) of a mesh in base [m]."""
    mesh = coal().MeshLoader().load(str(file), np.ones(3))
    points = mesh.vertices() @ T[:3, :3].T + T[:3, 3]
    corners = [mesh.tri_indices(k) for k in range(mesh.num_tris)]
    found = points[np.array([[corner[i] for i in range(3)] for corner in corners])]
    # Coal reads some triangles of these drawings with wrong corners: each corner by itself.
    return found.reshape(-1, 1, 3).repeat(3, axis=1) if file.suffix == '.dae' else found


def halves(parts):
    """Divide triangles (n, 3, 3) at the middle of their longest edges: (2 n, 3, 3)."""
    edges = np.linalg.norm(parts - np.roll(parts, -1, axis=1), axis=2)
    rows, first = np.arange(len(parts)), edges.argmax(axis=1)
    a, b, c = (parts[rows, (first + k) % 3] for k in range(3))
    middle = 0.5 * (a + b)
    return np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])


@pytest.mark.random
@pytest.mark.parametrize('name', GOLDEN)
def test_meshes_are_never_nearer_than_the_bodies(name, all_meshes):
    """Compare random configurations with bodies nearer than 3 cm, and a few of the others."""
    bodies, meshes = CollisionBodies(Arm(MODELS[name])), all_meshes[name]
    rng = np.random.default_rng(random_of('meshes of', name).getrandbits(32))
    q, compared = rng.uniform(-pi, pi, (cases(100_000), 6)), 0
    for pair, lower in zip(bodies.pairs, bodies.distances(q).T, strict=True):
        wanted = (lower > 0.0) & ((lower < 0.03) | (np.arange(len(q)) < len(q) // 1000))
        distances = meshes.distances(pair, q[wanted]) + mesh_tolerance(name)
        assert (distances >= lower[wanted] - 1e-6).all(), pair
        compared += len(distances)
    assert compared > len(q) // 10


KEPT = [(name, pair) for name, pairs in GOLDEN.items() for pair in pairs]


def test_configurations_that_touch_are_kept_for_every_model():
    touching = {
        name: sum(row[-1] == 0.0 for rows in pairs.values() for row in rows)
        for name, pairs in GOLDEN.items()
    }
    assert list(touching) == ['ur3', 'ur5', 'ur10', 'ur3e', 'ur5e']
    assert min(touching.values()) > 40


@pytest.mark.parametrize(('name', 'pair'), KEPT)
def test_bodies_are_never_farther_apart_than_others_measure(name, pair):
    """By FCL, with the robot descriptions that come with the meshes."""
    rows = np.array(GOLDEN[name][pair])
    bodies = CollisionBodies(Arm(MODELS[name]))
    column = bodies.pairs.index(tuple(Link[link] for link in pair.split()))
    assert (bodies.distances(rows[:, :6])[:, column] <= rows[:, 6] + 1e-6).all()


@pytest.mark.parametrize('choice', ['refuse', 'auto'])
@pytest.mark.parametrize('name', GOLDEN)
def test_no_configuration_that_touches_is_accepted(name, choice, pinocchio):
    rows = np.array([row for rows in GOLDEN[name].values() for row in rows])
    clearance = Clearance(Arm(MODELS[name]), Pose(), PlanningOptions(self_collision=choice))
    assert clearance.too_close(rows[rows[:, 6] == 0.0, :6]).all()


#: Of 100,000 random configurations of a UR5, those that touch its connector alone by FCL, and what
#: touches it. Capsules that left it out reported them as clear, the first by 14 mm.
IN_THE_CONNECTOR = (
    ((-2.42, -0.56, 2.75, 2.55, 0.21, -0.91), Link.WRIST_1),
    ((-1.5029, -0.6053, 2.7518, 2.1759, -0.6132, -0.6776), Link.FOREARM),
    ((1.6045, -2.7415, -2.722, 0.7517, 1.2926, -1.7553), Link.FOREARM),
    ((1.7675, 1.5562, 2.7287, -1.8924, -1.2426, 2.7627), Link.FOREARM),
    ((-1.8456, 1.4659, -2.7604, -1.5099, -2.7065, -2.0128), Link.FOREARM),
    ((1.6379, 1.5511, 2.7535, -2.4517, -0.7166, 2.4895), Link.FOREARM),
    ((2.0333, 1.4676, 2.5423, 0.3216, 0.0081, 0.4246), Link.WRIST_2),
    ((-1.9697, -0.5059, 2.7613, -2.6593, -1.6342, 1.622), Link.FOREARM),
    ((1.4933, -2.4041, -2.7601, 0.6443, 0.5935, 2.9232), Link.FOREARM),
    ((-2.4632, 2.0862, -2.5763, -2.7782, -1.7673, 2.0158), Link.WRIST_2),
)


@pytest.mark.parametrize('choice', ['refuse', 'auto'])
@pytest.mark.parametrize(('joints', 'link'), IN_THE_CONNECTOR)
def test_a_link_in_the_connector_of_a_ur5_is_refused(joints, link, choice, pinocchio):
    options = PlanningOptions(self_collision=choice)
    clear = Clearance(Arm(MODELS['ur5']), Pose(), options).check(np.array([joints]), (0.0,) * 6)
    assert clear.violation.text == (
        f'base and {link} touch, less than min_clearance = 0.0050 m (measured between meshes of '
        'the ur5)'
    )


@pytest.mark.parametrize('name', MODELS_WITH_MESHES)
def test_the_connector_counts_beside_the_meshes(name, all_meshes):
    """A flange is no farther from the base than from the end of the connector."""
    arm = Arm(MODELS[name])
    shape, q = connector_shape(arm), random_joints(20_000, seed=3)
    x, y, z = shape.T_link_shape.position
    end = np.array((x, y + 0.5 * shape.length, z))
    apart = np.linalg.norm(np.array(arm.frames_rows(q).position).T - end, axis=1)
    nearest = np.argsort(apart)[:20]
    distances = all_meshes[name].distances((Link.BASE, Link.WRIST_3), q[nearest])
    assert (distances <= apart[nearest]).all()


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
    """The corners of the triangles (n, 3, 3) of a link in base [m], by the texts of its files."""
    found = []
    for shape in link_meshes(name, 'collision'):
        if shape.link != link:
            continue
        points, corners = (
            cylinder_triangles(shape.radius, shape.length)
            if shape.mesh is None
            else file_triangles(shape.mesh)
        )
        T_base_shape = T @ shape.T_link_shape.matrix()
        found.append((points @ T_base_shape[:3, :3].T + T_base_shape[:3, 3])[corners])
    return np.concatenate(found)


def file_triangles(file):
    """The points (n, 3) and the corners (m, 3) of the triangles of an OBJ file."""
    lines = [line.split() for line in file.read_text().splitlines()]
    points = np.array([words[1:4] for words in lines if words[:1] == ['v']], dtype=float)
    corners = [
        [int(word.split('/')[0]) - 1 for word in words[1:]]
        for words in lines
        if words[:1] == ['f']
    ]
    assert {len(face) for face in corners} == {3}
    return points, np.array(corners)


def cylinder_triangles(radius, length, n=512):
    """The same of the side of a cylinder about z; its faces are at most 1 um inside it."""
    angle = np.arange(n) * (2.0 * pi / n)
    rim = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    low, high = (np.column_stack([rim, np.full(n, z)]) for z in (-0.5 * length, 0.5 * length))
    k, after = np.arange(n), np.roll(np.arange(n), -1)
    corners = [np.stack([k, after, k + n], axis=1), np.stack([after, after + n, k + n], axis=1)]
    return np.concatenate([low, high]), np.concatenate(corners)


def brute_force_distance(one, other):
    """
    Return the distance of two meshes (n, 3, 3).

    0 where an edge passes through a triangle, else the smallest distance from a corner to a
    triangle or from an edge to an edge. Pairs whose spheres are farther apart than the best pair
    do not count.
    """
    centres, radii = zip(*(spheres(mesh) for mesh in (one, other)), strict=True)
    between = cdist(*centres)
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
                best = min(
                    best, np.linalg.norm(segment_gap(*(edge.T for edge in edges)), axis=0).min()
                )
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
    found = {}
    for pair, least in zip(bodies.pairs, bodies.distances(q)[0], strict=True):
        if least < 0.015 or pair == nearest:
            one, other = (triangles('ur5e', link, T[link].matrix()) for link in pair)
            found[pair] = brute_force_distance(one, other)
            expected = max(0.0, found[pair] - mesh_tolerance('ur5e'))
            assert meshes.distances(pair, q)[0] == pytest.approx(expected, abs=2e-6), pair
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
