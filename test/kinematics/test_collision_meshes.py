# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The meshes stand on our axes where the robot description has them, inside our cylinders."""

from math import pi
import sys

from collision_shapes import capsules, T_base_meshes
import numpy as np
import pytest

from ur_cartesian_driver.kinematics import collision_meshes as module
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.collision_bodies import CollisionBodies, Link
from ur_cartesian_driver.kinematics.collision_meshes import CollisionMeshes, MODELS_WITH_MESHES
from ur_cartesian_driver.kinematics.robot_models import MODELS

FRAMES = (
    'base_link',
    'shoulder_link',
    'upper_arm_link',
    'forearm_link',
    'wrist_1_link',
    'wrist_2_link',
    'wrist_3_link',
)


@pytest.fixture(scope='module')
def pinocchio():
    found = pytest.importorskip('pinocchio')
    try:
        module._find_share()
    except FileNotFoundError as error:
        pytest.skip(str(error))
    return found


@pytest.fixture(scope='module')
def all_meshes(pinocchio):
    return {name: CollisionMeshes(Arm(MODELS[name])) for name in MODELS_WITH_MESHES}


def random_joints(n, seed=0):
    return np.random.default_rng(seed).uniform(-pi, pi, (n, 6))


def vertices(meshes, link):
    """The vertices of a link's mesh in its own frame (n, 3)."""
    return meshes._geometry.geometryObjects[int(link)].geometry.vertices()


@pytest.mark.parametrize('name', MODELS_WITH_MESHES)
def test_meshes_are_where_the_robot_description_moves_them(name, all_meshes, pinocchio):
    """Pinocchio's model of the URDF, from ``base``, against our axes: all links, and tool0."""
    urdf = module._find_share() / module._DESCRIPTION / f'{name}_robot.urdf'
    model = pinocchio.buildModelFromUrdf(str(urdf))
    data, arm = model.createData(), Arm(MODELS[name])
    for q in random_joints(10):
        pinocchio.framesForwardKinematics(model, data, q)
        T_world = {
            frame: data.oMf[model.getFrameId(frame)] for frame in ('base', 'tool0', *FRAMES)
        }
        T_base_world = T_world['base'].inverse()
        np.testing.assert_allclose(
            arm.forward(q).matrix(), (T_base_world * T_world['tool0']).homogeneous, atol=1e-10
        )
        # In these descriptions every mesh has the frame of its link.
        for T, frame in zip(T_base_meshes(all_meshes[name], q), FRAMES, strict=True):
            np.testing.assert_allclose(
                T, (T_base_world * T_world[frame]).homogeneous, atol=1e-10, err_msg=frame
            )


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


@pytest.mark.parametrize('name', MODELS_WITH_MESHES)
def test_meshes_are_never_nearer_than_their_capsules(name, all_meshes):
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
@pytest.mark.parametrize('name', MODELS_WITH_MESHES)
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


def test_other_models_have_no_meshes():
    assert CollisionMeshes.of(Arm(MODELS['ur5e'])) is None


def test_without_pinocchio_there_are_no_meshes(monkeypatch):
    monkeypatch.setitem(sys.modules, 'pinocchio', None)
    assert CollisionMeshes.of(Arm(MODELS['ur5'])) is None
