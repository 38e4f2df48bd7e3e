# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The position of the arm while a program runs, as far as the file determines it.

Before the first move the arm's position is unknown; until the first joint motion, only the pose is
known. Most programs never read the joint positions, so inverse kinematics is postponed until a
program reads them.
"""

from __future__ import annotations

from collections.abc import Callable

from ur_cartesian_driver.importing.import_options import ImportOptions
from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.urscript import RuntimeException, to_text, Value
from ur_cartesian_driver.urscript.script_values import ScriptPose


class ArmPlace:
    """The arm's position; the controller's functions read it from the motion generator."""

    def __init__(self, controller: Controller, options: ImportOptions) -> None:
        """Begin at an unknown position."""
        self._motion, self._arm = controller.motion, options.arm
        self._model = options.arm.model.name
        #: Whether options move the path, which joint positions cannot follow.
        self.moves_path = options.moves_path
        self._motion.T_flange_tcp = options.T_flange_tcp
        #: Whether the file determines the pose; whether it also determines the joint positions.
        self.is_known = self.knows_joints = False
        #: The last target pose, and its TCP; None = the joints give the pose.
        self._last: tuple[Pose, Pose] | None = None
        #: Poses of the flange for which the joint positions have not been solved yet.
        self._flange_poses: list[Pose] = []
        #: For each TCP that was set: the line of the set_tcp call, and the TCP as text.
        self.set_tcps: dict[Pose, tuple[int, str]] = {}
        #: Joint positions computed for a pose of the file. They mean this pose, whichever the arm,
        #: so they need no remark on the assumed arm.
        self.solutions: set[tuple[Value, ...]] = set()

    @property
    def tcp(self) -> Pose:
        """The active TCP."""
        return self._motion.T_flange_tcp

    @property
    def pose(self) -> Pose:
        """The pose of the active TCP."""
        if self._last is None:
            return self._motion.T_base_tcp
        pose, tcp = self._last
        return pose if tcp == self.tcp else pose @ tcp.inverse() @ self.tcp

    @property
    def is_settled(self) -> bool:
        """Whether the joints have been solved for the last pose."""
        return not self._flange_poses

    def of_arm(self, tcp: Pose) -> str:
        """Return a clause that names the arm and the TCP that are assumed for joint positions."""
        return f'their places are those of a {self._model} with the TCP {_text(tcp)}'

    def forward(self, q: Vector6, tcp: Pose) -> Pose:
        """Return the pose of a TCP at joint positions."""
        return self._arm.forward(q) @ tcp

    def go_to(self, pose: Pose) -> None:
        """Put the tool at a pose."""
        self._last = pose, self.tcp
        self._flange_poses.append(pose @ self.tcp.inverse())
        self.is_known = True

    def turn_to(self, q: Vector6) -> None:
        """Put the arm at joint positions."""
        self._motion.teleport(q)
        self._last = None
        self._flange_poses.clear()
        self.is_known = self.knows_joints = True

    def joints(self) -> Vector6:
        """
        Return the joint positions; each pose is solved with the solution nearest to the last one.

        :raises RuntimeException: the arm cannot reach a pose.
        """
        for pose in self._flange_poses:
            self._motion.teleport(self.solution(pose @ self.tcp, self._motion.q))
        self._flange_poses.clear()
        return self._motion.q

    def solution(self, pose: Pose, near: Vector6) -> Vector6:
        """
        Return the joint positions for a pose that are nearest to given ones.

        :raises RuntimeException: the arm cannot reach the pose.
        """
        q = nearest(self._arm, pose @ self.tcp.inverse(), near)
        if q is None:
            raise RuntimeException(self.unreachable(_text(pose)))
        return q

    def unreachable(self, pose: str) -> str:
        """Return a clause that says that the arm cannot reach a pose."""
        return (
            f'a {self._model} cannot reach {pose} with the TCP {_text(self.tcp)}; name your arm '
            'and its TCP in the options'
        )

    def assumption(self, say: Callable[[str], None], *, of_joints: bool) -> None:
        """Report the assumed position of the arm, if the file does not determine it."""
        if not self.is_known:
            say(
                'where the arm stands before its first move is not in the file; '
                f'{_text(self.pose)} of a {self._model} is taken'
            )
        elif of_joints and not self.knows_joints:
            say(
                'the joints before a move to joint positions are not in the file; those of a '
                f'{self._model} that are nearest to its home are taken'
            )


def _text(pose: Pose) -> str:
    return to_text(ScriptPose(*pose.rotation_vector()))
