# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Checks and converts the arguments that URScript programs pass to built-in functions.

A check returns the converted value, or raises the error that ends the program; ``name`` is the
name of the argument in its text.
"""

from __future__ import annotations

from math import isfinite

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector3, vector3, Vector6, vector6
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import (
    INT_MAX,
    INT_MIN,
    is_number,
    ScriptPose,
    type_name,
    Value,
)


def number(value: Value, name: str) -> float:
    """Return the value as a finite number."""
    if not is_number(value):
        raise RuntimeException(f'Type error: {name} must be a number, not a {type_name(value)}')
    if not isfinite(value):
        raise RuntimeException(f'{name} is {value}; it must be a finite number')
    return float(value)


def positive(value: Value, name: str) -> float:
    """Return the value as a number above zero."""
    result = number(value, name)
    if result <= 0.0:
        raise RuntimeException(f'{name} is {result:g}; it must be greater than 0')
    return result


def not_negative(value: Value, name: str) -> float:
    """Return the value as a number of zero or more."""
    result = number(value, name)
    if result < 0.0:
        raise RuntimeException(f'{name} is {result:g}; it must not be negative')
    return result


def whole(value: Value, name: str) -> int:
    """Return the value as an integer; whole floats are accepted, because divisions give floats."""
    result = number(value, name)
    if not result.is_integer():
        raise RuntimeException(f'{name} is {result:g}; it must be a whole number')
    return int(result)


def whole_within(value: Value, name: str, low: int, high: int) -> int:
    """Return the value as an integer from ``low`` to ``high``."""
    result = whole(value, name)
    if not low <= result <= high:
        raise RuntimeException(f'{name} is {result}; it must be within {low}..{high}')
    return result


def int32(value: Value, name: str) -> int:
    """Return the value as an integer that fits into 32 bits."""
    result = whole(value, name)
    if not INT_MIN <= result <= INT_MAX:
        raise RuntimeException(f'{name} is {result}; it must fit into 32 bits')
    return result


def within(value: Value, name: str, low: float, high: float) -> float:
    """Return the value as a number from ``low`` to ``high``."""
    result = number(value, name)
    if not low <= result <= high:
        raise RuntimeException(f'{name} is {result:g}; it must be within {low:g}..{high:g}')
    return result


def one_of(value: Value, name: str, choices: tuple[int, ...]) -> int:
    """Return the value as an integer that is one of the choices."""
    result = whole(value, name)
    if result not in choices:
        *first, last = map(str, choices)
        raise RuntimeException(f'{name} is {result}; it must be {", ".join(first)} or {last}')
    return result


def index(value: Value, name: str, count: int) -> int:
    """Return the value as an integer from 0 to ``count`` - 1."""
    return whole_within(value, name, 0, count - 1)


def six(value: Value, name: str) -> Vector6:
    """Return the six numbers of a list or a pose."""
    if not isinstance(value, list | ScriptPose) or len(value) != 6:
        raise RuntimeException(f'Type error: {name} must be a list of 6 numbers')
    return vector6(number(item, f'{name}[{i}]') for i, item in enumerate(value))


def three(value: Value, name: str) -> Vector3:
    """Return the three numbers of a list."""
    if not isinstance(value, list) or len(value) != 3:
        raise RuntimeException(f'Type error: {name} must be a list of 3 numbers')
    return vector3(number(item, f'{name}[{i}]') for i, item in enumerate(value))


def pose(value: Value, name: str) -> Pose:
    """Return the pose in a script value `p[...]`."""
    if not isinstance(value, ScriptPose):
        raise RuntimeException(f'Type error: {name} must be a pose, not a {type_name(value)}')
    return Pose.from_rotation_vector(six(value, name))


def is_pose(value: Value) -> bool:
    """Return whether a value is a pose rather than a list of joint positions."""
    return isinstance(value, ScriptPose)


def script_pose(value: Pose) -> ScriptPose:
    """Return a pose as a script value `p[...]`."""
    return ScriptPose(*value.rotation_vector())


def text(value: Value, name: str) -> str:
    """Return the value, which must be a string."""
    if not isinstance(value, str):
        raise RuntimeException(f'Type error: {name} must be a string, not a {type_name(value)}')
    return value
