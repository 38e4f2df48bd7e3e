# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Bodies of a cell are where others see the frames that carry them."""

from math import pi

import numpy as np
import pytest

from ur_cartesian_driver.kinematics.cell_poses import T_carrier_body
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.link_shapes import LinkFrames
from ur_cartesian_driver.kinematics.robot_description import robot_description
from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.cell.cell import CellBody, FRAMES, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Sphere
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row

TCP = Pose.from_rotation_vector((0.02, -0.03, 0.15, 0.4, -0.7, 0.2))
PLACE = Pose.from_rotation_vector((0.1, 0.2, -0.3, -0.5, 0.3, 1.2))


@pytest.mark.parametrize('is_calibrated', [False, True])
@pytest.mark.parametrize('frame', FRAMES)
def test_a_body_is_where_pinocchio_sees_its_frame(frame, is_calibrated, calibrated_arm):
    """Pinocchio's frames come from the description that other programs read, with its base."""
    pinocchio = pytest.importorskip('pinocchio')
    arm = calibrated_arm('ur10e') if is_calibrated else Arm(MODELS['ur10e'])
    model = pinocchio.buildModelFromXML(robot_description(arm))
    data = model.createData()
    body = CellBody(
        name='part', shapes=(PlacedShape(Sphere(0.1)),), frame=frame, T_frame_body=PLACE
    )
    frames = LinkFrames(arm)
    link, T_link_body = T_carrier_body(body, frames, TCP)
    q = np.random.default_rng(0).uniform(-pi, pi, (5, 6))
    for joints, rows in zip(q, frames.poses(q), strict=True):
        at = pinocchio.integrate(model, pinocchio.neutral(model), joints)
        pinocchio.framesForwardKinematics(model, data, at)
        seen = data.oMf[model.getFrameId('tool0' if frame == 'tool0_controller' else frame)]
        expected = (data.oMf[model.getFrameId('base')].inverse() * seen).homogeneous
        if frame == 'tool0_controller':
            expected = expected @ TCP.matrix()
        mine = pose_from_row(rows[link]) @ T_link_body
        np.testing.assert_allclose(mine.matrix(), expected @ PLACE.matrix(), atol=1e-9)
