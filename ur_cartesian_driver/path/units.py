# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Millimetres and degrees to SI units."""

from __future__ import annotations

from math import radians
from typing import overload

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.vectors import Vector3


@overload
def mm(value: float, /) -> float: ...


@overload
def mm(x: float, y: float, z: float, /) -> Vector3: ...


def mm(x: float, y: float | None = None, z: float | None = None, /) -> float | Vector3:
    """
    Convert a length, or a position x, y, z, from millimetres to metres.

    :raises InvalidGoal: there are two numbers, neither a length nor a position.
    """
    if y is None:
        return x / 1000.0
    if z is None:
        raise InvalidGoal(
            'mm()', f'has the two numbers {x!r} and {y!r}', 'give one length, or x, y and z'
        )
    return (x / 1000.0, y / 1000.0, z / 1000.0)


def deg(value: float, /) -> float:
    """Convert an angle from degrees to radians."""
    return radians(value)
