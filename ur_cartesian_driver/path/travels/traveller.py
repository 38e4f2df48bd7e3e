# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Travels through the air: where the arm stands before and after each path, and its motions between.

A path describes the motion of the tool, not the arm that carries it. So a travel needs the arm,
the state in which the whole path begins, and the options for planning.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import isfinite

import numpy as np

from ur_cartesian_driver import planning
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.cell.cell import Cell
from ur_cartesian_driver.motion.errors import GoalRefused, InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.cell_stretches import changed
from ur_cartesian_driver.planning.preflight.path_left import joints_at
from ur_cartesian_driver.planning.preflight.tcp_kinematics import max_joint_change, TcpKinematics
from ur_cartesian_driver.planning.stop_prediction import at_set_point, state_at_rest
from ur_cartesian_driver.planning.travel.arm_space import ArmSpace
from ur_cartesian_driver.planning.travel.transfer import find_transfer, Transfer, TransferSettings
from ur_cartesian_driver.planning.travel.travel_to_goal import blend_radii, MAX_BLEND, SAME_JOINTS


@dataclass(frozen=True, slots=True, kw_only=True)
class AirTravel(TransferSettings):
    """
    The arm that travels from path to path, and the settings of the travels.

    :raises ValueError: a number is out of its range.
    """

    #: The arm, calibrated if the calibration is known.
    arm: Arm
    #: The state in which the whole path begins.
    state: RobotState
    options: PlanningOptions = field(default_factory=PlanningOptions)
    #: The frames that the paths can name.
    frames: Frames = field(default_factory=Frames)
    #: Largest blend radius of the motions through the air [m]; smaller where it does not fit.
    blend: float = MAX_BLEND

    def __post_init__(self) -> None:
        """Check the numbers."""
        TransferSettings.__post_init__(self)
        if not (isfinite(self.blend) and self.blend >= 0.0):
            raise ValueError(f'blend is {self.blend:g} m, but must be finite, and not negative')

    @property
    def snapshot(self) -> ArmSnapshot:
        """The arm when the whole path begins, for frames that move with it."""
        return ArmSnapshot.of(self.state)

    @property
    def begin(self) -> ArmStand:
        """The arm's joints, and the cell, when the whole path begins."""
        return ArmStand(at_set_point(self.state, self.arm).actual_q, self.options.cell)

    def end_of(self, goal: Goal, place: ArmStand) -> ArmStand:
        """
        Return the arm's joints, and the cell, at the end of a goal.

        :param place: the joints, and the cell, at the beginning of the goal.
        :raises GoalRefused: the goal cannot be executed from there.
        """
        T_flange_tcp = self.state.T_flange_tcp
        # A travel leads to the goal from any distance.
        options = replace(self.options, max_approach_distance=0.0, cell=place.cell)
        state = state_at_rest(self.arm, place.q, T_flange_tcp)
        made = planning.plan(goal, state, self.arm, options)  # loads the planner when needed
        cell = place.cell
        for change in sorted(goal.part_changes, key=lambda each: each.waypoint):
            q = joints_at(made, change.waypoint)
            cell = changed(cell, change, self.arm, q, T_flange_tcp)
        return ArmStand(vector6(made.rows.joints[-1].tolist()), cell)


@dataclass(frozen=True, slots=True)
class ArmStand:
    """The joints of the arm between two paths, with the cell at that time."""

    #: The joint positions [rad].
    q: Joints
    cell: Cell


@dataclass(frozen=True, slots=True)
class Leg:
    """A motion of a travel."""

    #: The pose at the end of the motion, in the frame of the path.
    pose: Pose
    #: The joint positions at the end by name, for a joint motion; None = a line.
    posture: dict[str, float] | None
    #: The largest blend radius at the end [m].
    blend: float


@dataclass(frozen=True, slots=True)
class PathBegin:
    """The beginning of a path, and the path as a goal."""

    goal: Goal
    #: The pose at which the path begins, in its frame.
    pose: Pose

    @property
    def in_base(self) -> Pose:
        """The pose in the robot's base."""
        return self.goal.T_base_frame @ self.pose


class Traveller:
    """
    An arm with the tool of a path, on its travel to the path.

    :param place: joints and cell when the travel begins.
    :param there: the beginning of the path.
    :param where: the beginning of refusals, such as ``The travel to path 2``.
    """

    def __init__(self, by: AirTravel, place: ArmStand, there: PathBegin, where: str) -> None:
        """Prepare the kinematics of the arm with the path's tool, and its joint space."""
        self._by, self._place, self._there, self._where = by, place, there, where
        T_flange_tool = there.goal.T_flange_controlled or by.state.T_flange_tcp
        self._kinematics = TcpKinematics(by.arm, T_flange_tool)
        self.space = ArmSpace(self._kinematics, replace(by.options, cell=place.cell))

    def runs(self) -> dict[Joints, ArmStand]:
        """
        Return the joints in which the path can begin [rad], each with the stand at the path's end.

        Each joint has the turn that is nearest to its position when the travel begins.

        :raises GoalRefused: the path can begin in no joints; the refusal is about the nearest.
        """
        found: dict[Joints, ArmStand] = {}
        refusal: GoalRefused | None = None
        every = self.space.configurations(self._there.in_base, self._place.q)
        are_free = self.space.free(np.array(every).reshape(-1, 6))
        # If no configuration is free of collisions, the refusal is about the first one.
        for q in [q for q, free in zip(every, are_free, strict=True) if free] or every[:1]:
            try:
                found[q] = self._by.end_of(self._there.goal, replace(self._place, q=q))
            except GoalRefused as error:
                refusal = refusal or error
        if not found:
            raise refusal or self._kinematics.no_solution_error(
                self._there.in_base, f'{self._where}: its start'
            )
        return found

    def legs(self, entries: Sequence[Joints]) -> tuple[list[Leg], Joints]:
        """
        Return the motions to the path, and the joint positions in which it then begins [rad].

        :raises GoalRefused: no travel was found.
        """
        q = self._place.q
        for entry in entries:
            if max_joint_change(q, entry) < SAME_JOINTS:
                return [], entry
        found = find_transfer(self.space, q, entries, self._by, self._where)
        poses = list(self._poses(q, found))
        radii = blend_radii([pose for pose, _ in poses], self._by.blend)
        legs = [
            Leg(pose, posture, radius)
            for (pose, posture), radius in zip(poses[1:], radii, strict=True)
        ]
        return legs, found.goal

    def _poses(self, q: Joints, found: Transfer) -> Iterator[tuple[Pose, dict[str, float] | None]]:
        """Yield the beginning and the end of each motion, with a posture for joint motions."""
        T_frame_base = self._there.goal.T_base_frame.inverse()
        yield T_frame_base @ self.space.tcp(q), None
        if found.retracts:
            yield T_frame_base @ self.space.tcp(vector6(found.waypoints[0].tolist())), None
        names = [self._by.options.tf_prefix + name for name in JOINT_NAMES]
        for before, row in pairwise(found.waypoints):
            if np.abs(row - before).max() >= SAME_JOINTS:
                joints = vector6(row.tolist())
                posture = dict(zip(names, joints, strict=True))
                yield T_frame_base @ self.space.tcp(joints), posture
        if max_joint_change(vector6(found.waypoints[-1].tolist()), found.goal) >= SAME_JOINTS:
            yield self._there.pose, None


def no_start(where: str) -> InvalidGoal:
    """Return the refusal of a path without a start."""
    return InvalidGoal(
        where, 'leads to a path that does not say where it begins', 'write Path(start)'
    )
