# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Small values of the controller that functions of programs make."""

from __future__ import annotations

from dataclasses import dataclass

from ur_cartesian_driver.motion.pose import Vector3, Vector6


@dataclass(frozen=True, slots=True, kw_only=True)
class Payload:
    """What the flange carries: mass [kg], centre of gravity [m], inertia [kg m^2]."""

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
