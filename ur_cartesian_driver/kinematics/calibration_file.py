# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The kinematics of one arm as the YAML that the package ``ur_description`` reads.

The file has the pose of each joint in the link before it, with all joints at 0, as in a URDF:
x y z, and roll pitch yaw of R = Rz(yaw) Ry(pitch) Rx(roll). Each joint turns about its z axis.

The DH frames of a calibrated arm make poor link frames. Its axes of shoulder lift, elbow
and wrist 1 are so nearly parallel that their common normals may lie hundreds of metres away. But
Rz(q) commutes with shifts along z and with turns about z, so a frame may lie anywhere on its axis,
turned by any constant angle, and the chain stays the same for all q. The frames of upper arm and
forearm are placed as documented for ``ur_calibration`` of the UR ROS 2 driver (its "Calibration
correction algorithm"), so both tools write the same poses.
"""

from __future__ import annotations

from math import atan2, cos, sin
from typing import Any

from ur_cartesian_driver.kinematics.chain import table_frames
from ur_cartesian_driver.kinematics.robot_models import DhTable
from ur_cartesian_driver.motion.geometry.pose import (
    Pose,
    roll_pitch_yaw_from_quaternion,
    rotate,
)

#: The joints of a file, by the link that each moves, and the numbers of each joint.
CALIBRATION_LINKS = ('shoulder', 'upper_arm', 'forearm', 'wrist_1', 'wrist_2', 'wrist_3')
CALIBRATION_FIELDS = ('x', 'y', 'z', 'roll', 'pitch', 'yaw')

_UPPER_ARM, _FOREARM = 1, 2
# Decimals of the numbers in a file [m, rad].
_DECIMALS = 12
# A flange that is off the last axis by no more than this [m, rad] is taken to be on the axis.
_ROUNDING = 1e-9
# Constants of MurmurHash64A, and the seed of libstdc++.
_MULTIPLIER, _SHIFT, _SEED = 0xC6A4A7935BD1E995, 47, 0xC70F6907
_MASK = 2**64 - 1


def calibration_text(geometry: DhTable) -> str:
    """
    Return the text of the calibration file of an arm.

    :param geometry: the DH table that the robot reports.
    :raises ValueError: the flange of the table is off the last axis.
    """
    import yaml

    links: dict[str, Any] = {}
    for name, pose in zip(CALIBRATION_LINKS, joint_poses(geometry), strict=True):
        numbers = (*pose.position, *roll_pitch_yaw_from_quaternion(pose.quaternion))
        links[name] = {
            field: round(number, _DECIMALS) + 0.0  # no -0.0
            for field, number in zip(CALIBRATION_FIELDS, numbers, strict=True)
        }
    links['hash'] = calibration_hash(geometry)
    return yaml.safe_dump({'kinematics': links}, sort_keys=False)


def joint_poses(geometry: DhTable) -> tuple[Pose, ...]:
    """
    Return the pose of each joint in the link before it, while all joints are at 0.

    :raises ValueError: the flange of the table is off the last axis, which no file can express.
    """
    if max(abs(geometry.a[5]), abs(geometry.alpha[5])) > _ROUNDING:
        raise ValueError(
            f'The flange is off the last axis (a = {geometry.a[5]:g} m, '
            f'alpha = {geometry.alpha[5]:g} rad), which a file for ur_description cannot have.'
        )
    frames = table_frames(geometry)
    # The frame of the upper arm is moved along its axis to the shoulder, the frame of the forearm
    # to the point where its axis crosses the x-y plane of the upper arm's frame.
    frames[_UPPER_ARM] @= Pose((0.0, 0.0, -geometry.d[_UPPER_ARM]))
    for k in (_UPPER_ARM, _FOREARM):
        # The next axis crosses the x-y plane of this frame at (x, y). The frame is turned until
        # its x axis points away from there, because the lengths a2 and a3 are negative.
        T = frames[k].inverse() @ frames[k + 1]
        along = -T.position[2] / rotate(T.quaternion, (0.0, 0.0, 1.0))[2]
        x, y, _ = T.apply((0.0, 0.0, along))
        half = 0.5 * atan2(-y, -x)
        frames[k] @= Pose(quaternion=(0.0, 0.0, sin(half), cos(half)))
        if k == _UPPER_ARM:
            frames[_FOREARM] @= Pose((0.0, 0.0, along))
    before = (Pose(), *frames[:-1])
    return tuple(a.inverse() @ b for a, b in zip(before, frames, strict=True))


def calibration_hash(geometry: DhTable) -> str:
    """
    Return the hash by which the UR ROS drivers recognise the arm of a file, like ``calib_123``.

    Source: ``KinematicsInfo::toHash`` of the Universal Robots Client Library. It joins the numbers
    of the table as C++ streams print them, with six digits, and takes ``std::hash`` of the text.
    """
    rows = zip(geometry.theta, geometry.d, geometry.a, geometry.alpha, strict=True)
    text = ''.join(f'{number:g}' for row in rows for number in row)
    return f'calib_{_std_hash(text.encode())}'


def _std_hash(data: bytes) -> int:
    """Return ``std::hash`` of a string in libstdc++ on 64 bits, which is MurmurHash64A."""
    whole = len(data) - len(data) % 8
    value = _SEED ^ (len(data) * _MULTIPLIER & _MASK)
    for start in range(0, whole, 8):
        word = int.from_bytes(data[start : start + 8], 'little')
        word = _mixed(word * _MULTIPLIER & _MASK) * _MULTIPLIER & _MASK
        value = (value ^ word) * _MULTIPLIER & _MASK
    if whole < len(data):
        value = (value ^ int.from_bytes(data[whole:], 'little')) * _MULTIPLIER & _MASK
    return _mixed(_mixed(value) * _MULTIPLIER & _MASK)


def _mixed(value: int) -> int:
    return value ^ value >> _SHIFT
