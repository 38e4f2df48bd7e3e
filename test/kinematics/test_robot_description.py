# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Others read the robot description, and their kinematics is ours."""

from math import pi
from pathlib import Path
from urllib.parse import unquote, urlparse
from xml.etree import ElementTree

import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.link_shapes import (
    link_shapes,
    LinkFrames,
    MODELS_WITH_MESHES,
)
from ur_cartesian_driver.kinematics.robot_description import LINK_NAMES, robot_description
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, MODELS
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.goal.known_frames import T_BASE_BASE_LINK, T_TOOL0_FLANGE

PREFIX = 'left_'


@pytest.mark.parametrize('name', MODELS)
@pytest.mark.parametrize('is_calibrated', [False, True])
def test_its_kinematics_is_that_of_the_arm(name, is_calibrated, calibrated_arm):
    """As pinocchio reads it: all links, tool0 and flange, from base and from base_link."""
    pinocchio = pytest.importorskip('pinocchio')
    arm = calibrated_arm(name) if is_calibrated else Arm(MODELS[name])
    model = pinocchio.buildModelFromXML(robot_description(arm, PREFIX))
    assert list(model.names)[1:] == [PREFIX + joint for joint in JOINT_NAMES]
    for joint, limits in enumerate(arm.model.position_limits, start=1):
        row = model.joints[joint].idx_q
        if np.isfinite(limits).all():
            assert (model.lowerPositionLimit[row], model.upperPositionLimit[row]) == limits
        else:
            assert model.joints[joint].nq == 2  # continuous: cosine and sine
    np.testing.assert_allclose(model.velocityLimit, arm.model.max_joint_speed)
    data = model.createData()
    q = np.random.default_rng(0).uniform(-pi, pi, (5, 6))
    for joints, rows in zip(q, LinkFrames(arm).poses(q), strict=True):
        at = pinocchio.integrate(model, pinocchio.neutral(model), joints)
        pinocchio.framesForwardKinematics(model, data, at)
        flange = arm.forward(joints)
        expected = {
            **{link: pose_from_row(row) for link, row in zip(LINK_NAMES, rows, strict=True)},
            'tool0': flange,
            'flange': flange @ T_TOOL0_FLANGE,
        }
        np.testing.assert_allclose(
            data.oMf[model.getFrameId(PREFIX + 'base')].homogeneous,
            T_BASE_BASE_LINK.inverse().matrix(),
            atol=1e-12,
        )
        for frame, T_base_frame in expected.items():
            np.testing.assert_allclose(
                data.oMf[model.getFrameId(PREFIX + frame)].homogeneous,
                (T_BASE_BASE_LINK.inverse() @ T_base_frame).matrix(),
                atol=1e-8,
                err_msg=frame,
            )


@pytest.mark.parametrize('name', ['ur5', 'ur5e', 'ur10e'])
def test_its_shapes_are_those_of_the_arm(name):
    arm = Arm(MODELS[name])
    robot = ElementTree.fromstring(robot_description(arm))
    for tag in ('visual', 'collision'):
        shapes = link_shapes(arm, tag)
        found = [
            (number, body)
            for number, link in enumerate(LINK_NAMES)
            for body in robot.findall(f"link[@name='{link}']/{tag}")
        ]
        assert [number for number, _ in found] == [shape.link for shape in shapes]
        for (_, body), shape in zip(found, shapes, strict=True):
            T = shape.T_link_shape.matrix()
            np.testing.assert_allclose(T_of(body.find('origin')), T, atol=1e-9)
            if shape.mesh is not None:
                uri = urlparse(body.find('geometry/mesh').get('filename'))
                assert uri.scheme == 'file'
                assert Path(unquote(uri.path)).samefile(shape.mesh)
            else:
                cylinder = body.find('geometry/cylinder')
                assert float(cylinder.get('radius')) == shape.radius
                assert float(cylinder.get('length')) == shape.length
    assert name in MODELS_WITH_MESHES or robot.find('.//mesh') is None


def T_of(origin):
    roll, pitch, yaw = (float(word) for word in origin.get('rpy').split())
    T = np.eye(4)
    for axis, angle in enumerate((roll, pitch, yaw)):
        vector = [0.0] * 6
        vector[3 + axis] = angle
        T = Pose.from_rotation_vector(vector).matrix() @ T
    T[:3, 3] = [float(word) for word in origin.get('xyz').split()]
    return T
