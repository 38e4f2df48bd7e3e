# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The checks of a motion during and after a press.

Along compliant axes the arm gives way to contact, so deviations along them are left out of the
other checks; a separate bound limits them. Whether a controller adds this yield to its target is
not published, so target and actual pose are treated alike. After a press the arm goes straight
from its present place to the next point; until it is there, these deviations are left out too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from ur_cartesian_driver.motion.geometry.pose import (
    conjugate,
    multiply,
    Pose,
    Quaternion,
    quaternion_from_rotation_vector,
    rotate,
    rotation_vector_from_quaternion,
)
from ur_cartesian_driver.motion.geometry.vectors import add, subtract, Vector3, vector3, Vector6
from ur_cartesian_driver.motion.state.rtde_state import RobotState

#: The tracker's time may be off by this at a point where the arm stands still [s].
POINT_TIME_TOLERANCE = 0.01
_YIELDS = (('m', 'along', 'max_yield'), ('rad', 'about', 'max_yield_angle'))


@dataclass(frozen=True, slots=True, kw_only=True)
class PressWindow:
    """A part of a path on which the tool may give way along some axes."""

    #: Planned time at which the press begins [s].
    begin: float
    #: Planned time at which the press ends [s].
    end: float
    #: Planned time at which the tool is back on its path after the press [s].
    release: float
    #: 1.0 for each compliant axis, 0.0 for each other axis.
    compliant: Vector6
    #: Orientation of the press axes in base; None = the axes of the tool.
    q_base_task: Quaternion | None
    #: The largest shift [m] and turn [rad] by which the tool may give way.
    max_yields: tuple[float, float]
    #: Whether the tool retracts along its path to the place of contact, where the goal ends.
    ends_at_contact: bool = False

    def contains(self, time: float) -> bool:
        """Return whether the tool may be off its path at a planned time [s]."""
        return self.begin - POINT_TIME_TOLERANCE <= time < self.release

    def excess(self, planned: Pose, state: RobotState, time: float) -> str | None:
        """Return a clause if the tool has given way too far, else None."""
        if time > self.end + POINT_TIME_TOLERANCE:
            return None
        shift, turn = self._errors(planned, state.actual_tcp_pose)
        for k, (error, free) in enumerate(zip((*shift, *turn), self.compliant, strict=True)):
            bound, (unit, by, name) = self.max_yields[k // 3], _YIELDS[k // 3]
            if free and not abs(error) <= bound:
                return (
                    f'the tool gave way by {abs(error):.4f} {unit} {by} {"xyz"[k % 3]} of its '
                    f'press, {name} is {bound:.4f} {unit}'
                )
        return None

    def without_yield(self, planned: Pose, pose: Pose, share: float = 0.0) -> Pose:
        """
        Return a pose as it would be if the tool had not given way.

        :param share: the fraction of the yield to keep.
        """
        q_base_task = self._axes(planned)
        shift, turn = self._errors(planned, pose)
        position = add(planned.position, rotate(q_base_task, self._stiff(shift, 0, share)))
        if not any(self.compliant[3:]):
            return Pose(position, pose.quaternion)
        turned = quaternion_from_rotation_vector(rotate(q_base_task, self._stiff(turn, 3, share)))
        return Pose(position, multiply(turned, planned.quaternion))

    def compliant_share(self, planned: Pose, direction: Vector3) -> float:
        """
        Return the fraction of a deviation along compliant axes to treat as progress, 0 to 1.

        On a path along these axes, progress cannot be distinguished from yield, so the whole
        deviation is treated as progress.

        :param direction: direction of the path in base, a unit vector; zeros for a pure turn.
        """
        x, y, z = rotate(conjugate(self._axes(planned)), direction)
        a, b, c = self.compliant[:3]
        along = a * x * x + b * y * y + c * z * z
        return along * along

    def stiff_state(self, planned: Pose, state: RobotState) -> RobotState:
        """Return a packet in which the actual motion has no error along compliant axes."""
        q_base_task = self._axes(planned)
        target, actual = state.target_tcp_acceleration, state.actual_tcp_acceleration
        return replace(
            state,
            actual_tcp_pose=self.without_yield(planned, state.actual_tcp_pose),
            actual_tcp_twist=self._stiff_rates(
                q_base_task, state.target_tcp_twist, state.actual_tcp_twist
            ),
            actual_tcp_acceleration=None
            if target is None or actual is None
            else self._stiff_rates(q_base_task, target, actual),
        )

    def _axes(self, planned: Pose) -> Quaternion:
        return planned.quaternion if self.q_base_task is None else self.q_base_task

    def _errors(self, planned: Pose, pose: Pose) -> tuple[Vector3, Vector3]:
        """Return the shift and turn from the planned pose to a pose, in the press axes."""
        to_task = conjugate(self._axes(planned))
        turn = multiply(pose.quaternion, conjugate(planned.quaternion))
        return (
            rotate(to_task, subtract(pose.position, planned.position)),
            rotate(to_task, rotation_vector_from_quaternion(turn)),
        )

    def _stiff(self, vector: Vector3, first: int, share: float = 0.0) -> Vector3:
        """Return an error with its components on compliant axes scaled by ``share``."""
        x, y, z = vector
        a, b, c = (1.0 - free * (1.0 - share) for free in self.compliant[first : first + 3])
        return (a * x, b * y, c * z)

    def _stiff_rates(self, q_base_task: Quaternion, target: Vector6, actual: Vector6) -> Vector6:
        to_task, halves = conjugate(q_base_task), []
        for first in (0, 3):
            wanted, found = (vector3(rates[first : first + 3]) for rates in (target, actual))
            error = rotate(to_task, subtract(found, wanted))
            halves.append(add(wanted, rotate(q_base_task, self._stiff(error, first))))
        return (*halves[0], *halves[1])
