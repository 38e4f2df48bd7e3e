# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The cell on each stretch of a path along which the tool takes and releases bodies.

A body on the tool keeps its pose in the flange frame; a released body keeps its pose in base.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from ur_cartesian_driver.kinematics.cell_poses import T_carrier_body
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.link_shapes import LinkFrames
from ur_cartesian_driver.motion.cell.cell import Cell, CellBody
from ur_cartesian_driver.motion.geometry.arrays import Floats, Int32s
from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.motion.goal.goal import PartAction, PartChange


class CellStretch(NamedTuple):
    """A stretch of a path on which the cell stays as it is."""

    rows: slice
    cell: Cell
    #: The joint positions before the first row [rad].
    q_start: Joints


def attached(cell: Cell, name: str, arm: Arm, q: Joints, T_flange_tcp: Pose) -> Cell:
    """
    Return the cell with a body attached to the tool in the body's present pose.

    :param q: the joint positions at which the tool takes the body [rad].
    :param T_flange_tcp: the active TCP, for a body that is given in ``tool0_controller``.
    :raises ValueError: the cell has no such body, the body is on the tool already, or the tool
        cannot carry it; the text is a clause.
    """
    body = cell.body(name)
    if body.is_on_tool:
        raise ValueError(f'"{name}" is on the tool already')
    T_flange_body = arm.forward(q).inverse() @ place_in_base(body, arm, q, T_flange_tcp)
    return cell.moved(name, 'tool0', T_flange_body)


def released(cell: Cell, name: str, arm: Arm, q: Joints, T_flange_tcp: Pose) -> Cell:
    """
    Return the cell with a body released from the tool in the body's present pose.

    :param q: the joint positions at which the tool releases the body [rad].
    :raises ValueError: the cell has no such body, or the body is not on the tool; the text is a
        clause.
    """
    body = cell.body(name)
    if not body.is_on_tool:
        raise ValueError(f'"{name}" is not on the tool')
    return cell.moved(name, 'base', place_in_base(body, arm, q, T_flange_tcp))


def changed(cell: Cell, change: PartChange, arm: Arm, q: Joints, T_flange_tcp: Pose) -> Cell:
    """
    Return the cell after a change at a point of a goal.

    :param q: the joint positions at this point [rad].
    :raises ValueError: the change cannot be made; the text is a clause.
    """
    make = attached if change.action is PartAction.ATTACH else released
    return make(cell, change.body, arm, q, T_flange_tcp)


def cell_stretches(
    changes: Iterable[PartChange],
    segment: Int32s,
    q: Floats,
    q_start: Joints,
    arm: Arm,
    T_flange_tcp: Pose,
    cell: Cell,
) -> Iterator[CellStretch]:
    """
    Yield the stretches of a path on which the cell stays as it is; none if the path has no rows.

    :param changes: changes that can all be made (see :func:`changed`), in any order.
    :param segment: (n,) the segment of each row, by the number of the point at its end, not
        decreasing.
    :param q: (n, 6) [rad].
    :param q_start: the joint positions before the first row [rad].
    :param cell: the cell at the start.
    """
    begin, start = 0, q_start
    for change in sorted(changes, key=lambda each: each.waypoint):
        end = int(np.searchsorted(segment, change.waypoint, side='right'))
        if end > begin:
            yield CellStretch(slice(begin, end), cell, start)
            begin, start = end, vector6(q[end - 1].tolist())
        cell = changed(cell, change, arm, start, T_flange_tcp)
    if begin < len(q):
        yield CellStretch(slice(begin, len(q)), cell, start)


def place_in_base(body: CellBody, arm: Arm, q: Joints, T_flange_tcp: Pose) -> Pose:
    """
    Return the pose of a body in the robot's base.

    :param q: the joint positions [rad].
    :param T_flange_tcp: the active TCP.
    """
    frames = LinkFrames(arm)
    link, T_link_body = T_carrier_body(body, frames, T_flange_tcp)
    return pose_from_row(frames.poses(np.array([q]))[0, link].tolist()) @ T_link_body
