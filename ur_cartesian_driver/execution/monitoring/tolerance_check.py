# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Check the arm against the path or goal tolerance, axis by axis.

An error is desired - actual. Position and orientation are compared with the planned path; twist
and acceleration with the controller's target of the same packet. So no speed profile is needed:
the slider, a pause, a blend or the robot's own limits change target and actual speed alike.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from math import isnan, nan

from ur_cartesian_driver.motion.geometry.pose import (
    conjugate,
    IDENTITY,
    multiply,
    Pose,
    Quaternion,
    rotate,
    rotation_vector_from_quaternion,
)
from ur_cartesian_driver.motion.geometry.vectors import (
    subtract,
    subtract6,
    Vector3,
    vector3,
    Vector6,
)
from ur_cartesian_driver.motion.goal.goal import Tolerance
from ur_cartesian_driver.motion.state.rigid_body import shift_reference_point
from ur_cartesian_driver.motion.state.rtde_state import RobotState

_AXES = ('x', 'y', 'z')
_UNKNOWN: Vector6 = (nan,) * 6


@dataclass(frozen=True, slots=True)
class ToleranceQuantity:
    """A quantity with three axes and one unit."""

    name: str
    unit: str
    limits: Callable[[Tolerance], Vector3]
    #: Returns the error, given planned pose, robot packet and rotation from base to goal frame.
    error: Callable[[Pose, RobotState, Quaternion], Vector3]


class ToleranceCheck:
    """Compares packets with a tolerance; quantities without a limit cost nothing."""

    def __init__(
        self, tolerance: Tolerance, T_base_frame: Pose, T_tcp_controlled: Pose = IDENTITY
    ) -> None:
        """
        Select the quantities that have a limit.

        :param tolerance: the limits; 0 or negative = no limit. Defaults were filled in before.
        :param T_base_frame: frame of the goal; all errors except orientation are in its axes.
        :param T_tcp_controlled: the compared frame, relative to the TCP.
        """
        self._q_frame_base = conjugate(T_base_frame.quaternion)
        self._T_tcp_controlled = None if T_tcp_controlled == IDENTITY else T_tcp_controlled
        self._limited = tuple(
            (quantity, quantity.limits(tolerance))
            for quantity in QUANTITIES
            if max(quantity.limits(tolerance)) > 0.0
        )

    def __bool__(self) -> bool:
        """Return whether there is any limit."""
        return bool(self._limited)

    def violation(self, desired: Pose, state: RobotState) -> str | None:
        """
        Return a clause with an axis outside its limit, its error and its limit; or None.

        Of several axes the one with the largest ratio of error to limit is named. A NaN error is
        outside every limit.

        :param desired: planned pose of the TCP in base.
        """
        if self._T_tcp_controlled is not None:
            desired = desired @ self._T_tcp_controlled
            state = shift_reference_point(state, self._T_tcp_controlled)
        return excess_clause(
            (quantity.name, axis, quantity.unit, error, limit)
            for quantity, limits in self._limited
            for axis, error, limit in zip(
                _AXES, quantity.error(desired, state, self._q_frame_base), limits, strict=True
            )
        )


def excess_clause(errors: Iterable[tuple[str, str, str, float, float]]) -> str | None:
    """
    Return a clause about the error with the largest ratio to its limit; None = no ratio exceeds 1.

    A NaN is treated as the largest error; of several NaN the first is named.

    :param errors: quantity, axis or joint, unit, error and limit; a limit <= 0 = no limit.
    """
    worst, found = 1.0, None
    for entry in errors:
        *_, error, limit = entry
        if limit > 0.0 and not abs(error) <= worst * limit:
            worst, found = abs(error) / limit, entry
            if isnan(worst):
                break
    if found is None:
        return None
    quantity, axis, unit, error, limit = found
    return (
        f'{quantity} {axis} is off by {abs(error):.6f} {unit}, the tolerance is {limit:.6f} {unit}'
    )


def _position(desired: Pose, state: RobotState, q_frame_base: Quaternion) -> Vector3:
    return rotate(q_frame_base, subtract(desired.position, state.actual_tcp_pose.position))


def _orientation(desired: Pose, state: RobotState, q_frame_base: Quaternion) -> Vector3:
    """Return the rotation vector of q_actual^-1 q_desired, in the axes of the tool."""
    actual = conjugate(state.actual_tcp_pose.quaternion)
    return rotation_vector_from_quaternion(multiply(actual, desired.quaternion))


def _rate(name: str, unit: str, field: str, first: int) -> ToleranceQuantity:
    """
    Return the quantity for the linear or angular half of a twist or acceleration.

    Its error is NaN if the robot does not report that twist or acceleration.
    """

    def limits(tolerance: Tolerance) -> Vector3:
        values: Vector6 = getattr(tolerance, field)
        return vector3(values[first : first + 3])

    def error(desired: Pose, state: RobotState, q_frame_base: Quaternion) -> Vector3:
        target: Vector6 = getattr(state, f'target_tcp_{field}') or _UNKNOWN
        actual: Vector6 = getattr(state, f'actual_tcp_{field}') or _UNKNOWN
        return rotate(q_frame_base, vector3(subtract6(target, actual)[first : first + 3]))

    return ToleranceQuantity(name, unit, limits, error)


#: Index of the first of the three axes in twists and accelerations.
_LINEAR, _ANGULAR = 0, 3
#: All quantities that have a tolerance; planning refuses limits on unreported values.
QUANTITIES: tuple[ToleranceQuantity, ...] = (
    ToleranceQuantity('position', 'm', lambda t: t.position, _position),
    ToleranceQuantity('orientation', 'rad', lambda t: t.orientation, _orientation),
    _rate('linear velocity', 'm/s', 'twist', _LINEAR),
    _rate('angular velocity', 'rad/s', 'twist', _ANGULAR),
    _rate('linear acceleration', 'm/s^2', 'acceleration', _LINEAR),
    _rate('angular acceleration', 'rad/s^2', 'acceleration', _ANGULAR),
)
