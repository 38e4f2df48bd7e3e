# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The poses of a cell's bodies on the links of an arm."""

from __future__ import annotations

from ur_cartesian_driver.kinematics.link_shapes import LinkFrames
from ur_cartesian_driver.motion.cell.cell import CellBody, FRAMES
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.goal.known_frames import (
    BASE_LINK,
    FLANGE,
    T_BASE_BASE_LINK,
    T_TOOL0_FLANGE,
    TCP,
    TOOL0,
)


def T_carrier_body(body: CellBody, frames: LinkFrames, T_flange_tcp: Pose) -> tuple[int, Pose]:
    """
    Return the link that carries a body, and the pose of the body in the frame of that link.

    :param frames: the link frames of the arm, nominal or calibrated.
    :param T_flange_tcp: the TCP, for bodies in ``tool0_controller``.
    :returns: the number of the link, a row of :meth:`LinkFrames.poses`; 0 = the robot's base.
    """
    T_link_frame = {
        BASE_LINK: T_BASE_BASE_LINK,
        TOOL0: frames.flange,
        FLANGE: frames.flange @ T_TOOL0_FLANGE,
        TCP: frames.flange @ T_flange_tcp,
    }.get(body.frame, IDENTITY)
    return FRAMES[body.frame], T_link_frame @ body.T_frame_body
