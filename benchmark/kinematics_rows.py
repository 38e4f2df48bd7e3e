# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Inverse kinematics along a path, all rows at once; compared with pinocchio, row by row."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from figures import Figure, seconds
from kinematics import pinocchio_or_none
import numpy as np
from numpy.typing import NDArray
import paths

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse_rows import solve_path
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import Vector6

NAME = 'kinematics, poses of a path per second'
START: Vector6 = (0.3, -1.6, 1.9, -1.8, -1.5, 0.4)
PATH_LENGTH = (0.8, 0.4, -0.6, 0.5, 0.3, 1.0)
#: Number of rows, and the smaller number on which pinocchio is timed.
ROWS, ROWS_ONE_BY_ONE = 40_000, 2_000
Rows = NDArray[np.float64]


def run(quick: bool) -> Iterator[Figure]:
    """Follow a path of a UR5e, nominal and calibrated, whose joint positions are known."""
    rows = ROWS // 10 if quick else ROWS
    joints = np.array(START) + np.linspace(0.0, 1.0, rows)[:, None] * np.array(PATH_LENGTH)
    for name, arm in ('nominal', Arm(robot_model('ur5e'))), ('calibrated', paths.calibrated_arm()):
        poses = arm.forward_rows(joints)
        solve_path(arm, poses[:1], START)  # fits the ideal arm, once for each arm
        yield from _path_figure(name, arm, poses, joints)


def _path_figure(name: str, arm: Arm, poses: Rows, joints: Rows) -> Iterator[Figure]:
    reference = pinocchio_or_none(arm)
    taken = seconds(lambda: solve_path(arm, poses, START))
    other = None
    if reference is not None:
        sparse = poses[:ROWS_ONE_BY_ONE]
        other = len(sparse) / seconds(lambda: _one_by_one(reference, sparse), repeat=2)
    path = solve_path(arm, poses, START)
    yield Figure(
        benchmark=NAME,
        name=f'{name}, followed',
        value=len(poses) / taken,
        unit='1/s',
        baseline=other,
        than='pinocchio, CLIK from the row before',
        note=f'{len(poses)} poses',
    )
    back = arm.forward_rows(path.q) - poses
    yield Figure(
        benchmark=NAME,
        name=f'{name}, largest error of position',
        value=1e9 * float(np.linalg.norm(back[:, :3], axis=1).max()),
        unit='nm',
    )
    yield Figure(
        benchmark=NAME,
        name=f'{name}, largest error of a joint',
        value=1e9 * float(np.abs(path.q - joints).max()),
        unit='nrad',
    )


def _one_by_one(reference: Any, poses: Rows) -> None:
    before: Any = START
    for pose in poses:
        before = reference.inverse(pose_from_row(pose), before)
