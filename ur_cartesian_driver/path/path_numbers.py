# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Validate user-supplied numbers.

Each function refuses a mistake by :exc:`InvalidGoal`, whose text explains it; ``where`` names the
point or method at its beginning.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite, isnan, nan
from typing import Any

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import normalize, Quaternion
from ur_cartesian_driver.motion.geometry.vectors import Vector3, Vector6
from ur_cartesian_driver.motion.goal.goal import Posture

NANOSECONDS = 1_000_000_000
#: Larger numbers in twists and accelerations, and larger joint positions [rad], must be mistakes.
_MAX_RATE, _MAX_JOINT = 100.0, 25.2
#: Largest difference between 1 and the squared length of a quaternion: for one that is accepted,
#: and for one that is kept unchanged.
_UNIT, _EXACT_UNIT = 1e-3, 1e-12


def amount(where: str, name: str, value: float | None, bound: float, unit: str) -> float | None:
    """Return a value as a number, refused if it is not from 0 to a bound; None stays None."""
    if value is None:
        return None
    number = any_number(where, name, value)
    if not 0.0 <= number <= bound:
        remedy = f'give {unit}' + (', mm() converts' if unit.startswith('m') else '')
        raise InvalidGoal(
            where, f'has the {name} {number:g}, outside 0 to {bound:g} {unit}', remedy
        )
    return number


def any_number(where: str, name: str, value: Any) -> float:
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        raise InvalidGoal(where, f'has the {name} {value!r:.60}', 'give a number') from None


def numbers(where: str, **values: Any) -> dict[str, float]:
    """Return values as numbers, by their names."""
    return {name: any_number(where, name, value) for name, value in values.items()}


def many_numbers(where: str, name: str, values: Any) -> tuple[float, ...]:
    """Return a sequence of numbers of any length."""
    try:
        return tuple(any_number(where, name, value) for value in values)
    except TypeError:
        raise InvalidGoal(
            where, f'has the {name} {values!r:.60}', 'give a sequence of numbers'
        ) from None


def vector(where: str, values: Sequence[float], bound: float, prefix: str = '') -> Vector3:
    """Return three numbers; refuse one whose magnitude is above a bound [m]."""
    try:
        x, y, z = (float(value) for value in values)
    except (TypeError, ValueError, OverflowError):
        raise InvalidGoal(
            where, f'has the position {values!r:.60}', 'give x, y and z [m]'
        ) from None
    for name, value in zip('xyz', (x, y, z), strict=True):
        if not isfinite(value):
            raise InvalidGoal(where, f'has {prefix}{name} = {value}', 'give a finite number')
        if abs(value) > bound:
            raise InvalidGoal(
                where,
                f'has {prefix}{name} = {value:g} m, more than {bound:g} m',
                f'write mm({value:g}) for millimetres',
            )
    return (x, y, z)


def unit_quaternion(where: str, q: Sequence[float]) -> Quaternion:
    """Return a unit quaternion."""
    try:
        x, y, z, w = (float(value) for value in q)
        square = x * x + y * y + z * z + w * w
    except (TypeError, ValueError, OverflowError):
        square = nan
    if not abs(square - 1.0) <= _UNIT:
        raise InvalidGoal(
            where,
            f'has the orientation {q!r:.80}, which is no unit quaternion x, y, z, w',
            'make it by against(), tilted(), roll_pitch_yaw() or axis_angle()',
        )
    # An exact quaternion stays as it is, so that reading a goal does not change it.
    return (x, y, z, w) if abs(square - 1.0) <= _EXACT_UNIT else normalize((x, y, z, w))


def six_numbers(where: str, values: Sequence[float]) -> Vector6:
    """Return three linear and three angular numbers; missing angular ones become NaN (free)."""
    try:
        given = [float(value) for value in values]
    except (TypeError, ValueError, OverflowError):
        given = []
    if len(given) not in (3, 6) or any(abs(n) > _MAX_RATE for n in given if not isnan(n)):
        raise InvalidGoal(where, f'is {values!r:.80}', 'give 3 or 6 numbers in m and rad')
    a, b, c, *rest = given
    d, e, f = rest or (nan, nan, nan)
    return (a, b, c, d, e, f)


def posture_near(where: str, posture: Mapping[str, float] | None) -> Posture:
    if not posture:
        return Posture()
    values = tuple(any_number(where, name, value) for name, value in posture.items())
    for name, value in zip(posture, values, strict=True):
        if not abs(value) <= _MAX_JOINT:
            raise InvalidGoal(
                where, f'has {name} = {value:g} rad, more than a joint turns', 'deg() converts'
            )
    return Posture(names=tuple(posture), values=values)


def to_nanoseconds(where: str, time: float | None) -> int:
    if time is None or not isfinite(time):
        raise InvalidGoal(where, f'has the time {time}', 'give a finite number of seconds')
    return round(time * NANOSECONDS)
