# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Link frames stand on the axes of our kinematics, and the meshes in them as their makers say."""

from math import pi
import sys

from meshes import need_meshes
import numpy as np
import pytest

from ur_cartesian_driver.kinematics import link_shapes as module
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.collision_bodies import CollisionBodies
from ur_cartesian_driver.kinematics.link_shapes import (
    ARM_LINKS,
    link_cylinders,
    link_meshes,
    link_shapes,
    LinkFrames,
    MODELS_WITH_MESHES,
)
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.geometry.pose import pose_from_row

FRAMES = [f'{link.name.lower()}_link' for link in ARM_LINKS]


def random_joints(n, seed=0):
    return np.random.default_rng(seed).uniform(-pi, pi, (n, 6))


@pytest.mark.parametrize('name', MODELS)
@pytest.mark.parametrize('is_calibrated', [False, True])
def test_frames_are_on_the_axes_and_end_at_the_flange(name, is_calibrated, calibrated_arm):
    arm = calibrated_arm(name) if is_calibrated else Arm(MODELS[name])
    frames = LinkFrames(arm)
    for q, rows in zip(random_joints(5), frames.poses(random_joints(5)), strict=True):
        true = arm.frames(q)
        for row, origin, axis in zip(rows[1:], true.origins, true.axes, strict=True):
            matrix = pose_from_row(row).matrix()
            np.testing.assert_allclose(matrix[:3, 2], axis, atol=1e-9)
            beside = np.cross(matrix[:3, 3] - origin, axis)
            np.testing.assert_allclose(beside, 0.0, atol=1e-9)
        flange = pose_from_row(rows[6]) @ frames.flange
        np.testing.assert_allclose(flange.matrix(), arm.forward(q).matrix(), atol=1e-9)


@pytest.mark.parametrize('name', MODELS_WITH_MESHES)
def test_frames_of_a_calibrated_arm_are_near_the_nominal_ones(name, calibrated_arm):
    """They stay in their links, however far away the frames of its DH table are."""
    real, nominal = LinkFrames(calibrated_arm(name)), LinkFrames(Arm(MODELS[name]))
    distance = np.abs((real.poses(random_joints(20)) - nominal.poses(random_joints(20)))[:, :, :3])
    assert 1e-5 < distance.max() < 0.015


@pytest.mark.parametrize('name', ['ur3', 'ur5', 'ur10', 'ur3e', 'ur5e'])
def test_meshes_stand_where_the_robot_descriptions_have_them(name):
    """Pinocchio's model of the package's URDF, from ``base``, against ours: links and meshes."""
    need_meshes(name)
    pinocchio = pytest.importorskip('pinocchio')
    shapes = link_meshes(name, 'visual')
    folder = shapes[0].mesh.parents[1]
    if shapes[0].mesh.suffix == '.obj':
        (urdf,) = folder.glob('*.urdf')
        packages, kind = folder, pinocchio.GeometryType.VISUAL
    else:
        urdf = folder.parents[1] / 'urdf' / f'{name}_robot.urdf'
        packages, kind = folder.parents[4], pinocchio.GeometryType.COLLISION
    model = pinocchio.buildModelFromUrdf(str(urdf))
    geometry = pinocchio.buildGeomFromUrdf(model, str(urdf), kind, package_dirs=[str(packages)])
    data, placement = model.createData(), pinocchio.GeometryData(geometry)
    frames = LinkFrames(Arm(MODELS[name]))
    found = {shape.name: k for k, shape in enumerate(geometry.geometryObjects)}
    for q, rows in zip(random_joints(5), frames.poses(random_joints(5)), strict=True):
        pinocchio.updateGeometryPlacements(model, data, geometry, placement, q)
        pinocchio.updateFramePlacements(model, data)
        T_base_world = data.oMf[model.getFrameId('base')].inverse()
        for shape, row, frame in zip(shapes, rows, FRAMES, strict=True):
            name_in_urdf = f'{frame}_0' if f'{frame}_0' in found else f'{frame}_inertia_0'
            T = T_base_world * placement.oMg[found[name_in_urdf]]
            mine = pose_from_row(row) @ shape.T_link_shape
            np.testing.assert_allclose(mine.matrix(), T.homogeneous, atol=1e-8, err_msg=frame)


@pytest.mark.parametrize('is_calibrated', [False, True])
def test_cylinders_move_with_their_links(is_calibrated, calibrated_arm):
    """As :class:`CollisionBodies` has them in base."""
    arm = calibrated_arm('ur10e') if is_calibrated else Arm(MODELS['ur10e'])
    bodies, q = CollisionBodies(arm), random_joints(5)
    shapes = link_cylinders(arm)
    assert link_shapes(arm) == shapes
    for rows, ends in zip(LinkFrames(arm).poses(q), bodies.cylinder_ends(q), strict=True):
        for shape, radius, (start, end) in zip(shapes, bodies.radii, ends, strict=True):
            T = pose_from_row(rows[shape.link]) @ shape.T_link_shape
            half = 0.5 * shape.length
            np.testing.assert_allclose(T.apply((0.0, 0.0, -half)), start, atol=1e-9)
            np.testing.assert_allclose(T.apply((0.0, 0.0, half)), end, atol=1e-9)
            assert shape.radius == radius


def test_a_ur7e_is_a_ur5e():
    assert link_shapes(Arm(MODELS['ur7e'])) == link_shapes(Arm(MODELS['ur5e']))


def test_without_their_package_the_shapes_are_cylinders(monkeypatch):
    monkeypatch.setattr(module, 'find_spec', lambda name: None)
    monkeypatch.setenv('AMENT_PREFIX_PATH', '')
    for name in MODELS_WITH_MESHES:
        arm = Arm(MODELS[name])
        assert link_shapes(arm) == link_cylinders(arm)
        with pytest.raises(FileNotFoundError, match='the extra `collision` brings it'):
            link_meshes(name, 'visual')


def test_files_are_found_without_importing_their_packages(monkeypatch):
    for package in ('airo_models', 'pinocchio'):
        monkeypatch.delitem(sys.modules, package, raising=False)
    for name in MODELS_WITH_MESHES:
        link_shapes(Arm(MODELS[name]))
    assert not {'airo_models', 'pinocchio'} & set(sys.modules)
