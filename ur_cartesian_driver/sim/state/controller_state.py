# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""State of the controller that programs and dashboard clients set."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from ur_cartesian_driver.motion.geometry.vectors import Vector3, Vector6


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload:
    """The payload: mass [kg], centre of gravity in the flange frame [m], inertia [kg m^2]."""

    mass: float = 0.0
    cog: Vector3 = (0.0, 0.0, 0.0)
    #: Ixx, Iyy, Izz, Ixy, Ixz, Iyz.
    inertia: Vector6 = (0.0,) * 6


@dataclass(slots=True, kw_only=True)
class Popup:
    """A window on the pendant."""

    text: str
    title: str = 'Popup'
    warning: bool = False
    error: bool = False
    blocking: bool = False
    open: bool = True


@dataclass(slots=True, kw_only=True)
class Pendant:
    """The pendant: settings shared by all dashboard clients, and the person in front of it."""

    user_role: str = 'PROGRAMMER'
    #: MANUAL, AUTOMATIC, or NONE: no client controls the operational mode.
    operational_mode: str = 'NONE'
    #: Answers of the person to the next windows that request a value.
    answers: deque[str] = field(default_factory=deque)


@dataclass(slots=True, kw_only=True)
class StoredSettings:
    """Settings that programs store and read back; they outlive programs and affect no motion."""

    #: Factor on the jerk of smooth moves, 0.01 to 1.
    jerk_gain_scaling: float = 1.0
    #: Damping of force mode, 0 to 1.
    force_damping: float = 0.005
    #: Acceleration of the robot's base [m/s^2].
    base_acceleration: Vector3 = (0.0, 0.0, 0.0)


@dataclass(slots=True, kw_only=True)
class ProcessState:
    """Process settings of a program; they end with the program."""

    #: Codes and arguments (None = any argument) of errors that pause the program.
    pause_on: set[tuple[int, int | None]] = field(default_factory=set)

    def has_pause_on(self, code: int, argument: int) -> bool:
        """Return whether an error with this code and argument pauses the program."""
        return bool(self.pause_on & {(code, argument), (code, None)})
