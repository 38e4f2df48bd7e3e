# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Builtins of every controller that need no robot: mathematics, lists, text.

Parameters are named as in the script manual, because programs can pass arguments by name.
For an argument outside its domain, a function raises an error instead of returning nan.
"""

from __future__ import annotations

from collections.abc import Callable
import math
import random
import re
from typing import Any

from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import (
    bounded,
    check_size,
    copy,
    INT_MAX,
    INT_MIN,
    is_number,
    Matrix,
    MAX_LIST_LENGTH,
    MAX_STRING,
    ScriptPose,
    Struct,
    to_text,
    type_name,
    Value,
)
from ur_cartesian_driver.urscript.script_values import (
    make_list as make_list_value,
)

#: Largest number of rows of a matrix to invert: the time grows with its cube. The manual gives no
#: limit.
MAX_INVERSE = 100

_INTEGER = re.compile(r'[+-]?[0-9]+')
_HEXADECIMAL = re.compile(r'[+-]?0[xX][0-9a-fA-F]+')
_DECIMAL = re.compile(r'[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?')


# Checks of arguments


def _wrong_type(wanted: str, value: Value) -> RuntimeException:
    return RuntimeException(f'Type error: {wanted} is needed, not {type_name(value)}')


def _number(value: Value) -> int | float:
    if is_number(value):
        return value
    raise _wrong_type('a number', value)


def _int(value: Value) -> int:
    if type(value) is int:
        return value
    if type(value) is float and value.is_integer():
        return int(value)
    raise _wrong_type('an int', value)


def _string(value: Value) -> str:
    if type(value) is str:
        return value
    raise _wrong_type('a string', value)


def _numbers(value: Value) -> list[int | float]:
    if type(value) is list or type(value) is ScriptPose:
        return [_number(item) for item in value]
    raise _wrong_type('a list of numbers', value)


def _int_range(value: int) -> int:
    if not INT_MIN <= value <= INT_MAX:
        raise RuntimeException(f'Integer overflow: {value} does not fit into 32 bits')
    return value


# Text


def str_cat(op1: Value, op2: Value) -> str:
    """Return the texts of two values, one after the other."""
    return bounded(to_text(op1) + to_text(op2))


def to_str(val: Value) -> str:
    """Return the text of a value."""
    return bounded(to_text(val))


def str_len(str: Value) -> int:
    """Return the number of characters."""
    return len(_string(str))


def str_empty(str: Value) -> bool:
    """Return whether a string has no characters."""
    return not _string(str)


def str_at(src: Value, index: Value) -> str:
    """Return the character at an index, from 0."""
    text, position = _string(src), _int(index)
    if not 0 <= position < len(text):
        raise RuntimeException(f'Index out of range: {position} in a string of {len(text)}')
    return text[position]


def str_sub(src: Value, index: Value, len: Value = MAX_STRING) -> str:
    """Return at most `len` characters from `index` on."""
    text, start, count = _string(src), _int(index), _int(len)
    if not 0 <= start <= text.__len__() or count < 0:
        raise RuntimeException(f'Index out of range: {count} characters from {start} of {text!r}')
    return text[start : start + count]


def str_find(src: Value, target: Value, start_from: Value = 0) -> int:
    """Return the first index of `target` at or after `start_from`, or -1."""
    text, start = _string(src), _int(start_from)
    if start < 0:
        raise RuntimeException(f'Index out of range: {start}')
    return text.find(_string(target), start)


def to_num(str: Value) -> int | float:
    """Return the number in a string: decimal, or hexadecimal after 0x."""
    text = _string(str).strip()
    if _INTEGER.fullmatch(text):
        return _int_range(int(text))
    if _HEXADECIMAL.fullmatch(text):
        return _int_range(int(text, 16))
    if _DECIMAL.fullmatch(text):
        return float(text)
    raise RuntimeException(f'to_num: {text!r} is not a number')


# Mathematics


def _function_of_float(compute: Callable[[float], float]) -> Callable[[Value], float]:
    """Return a builtin of one number; the parameter is named f, as in the manual."""

    def function(f: Value) -> float:
        return compute(_number(f))

    return function


def _domain(value: float, holds: bool, rule: str) -> None:
    if not holds:
        raise RuntimeException(f'Domain error: {rule}, got {to_text(float(value))}')


def acos(f: Value) -> float:
    """Return the arc cosine [rad] of a number in [-1, 1]."""
    _domain(_number(f), -1 <= f <= 1, 'acos is defined from -1 to 1')
    return math.acos(f)


def asin(f: Value) -> float:
    """Return the arc sine [rad] of a number in [-1, 1]."""
    _domain(_number(f), -1 <= f <= 1, 'asin is defined from -1 to 1')
    return math.asin(f)


def atan2(x: Value, y: Value) -> float:
    """Return the angle [rad] whose tangent is the first over the second argument."""
    return math.atan2(_number(x), _number(y))


def sqrt(f: Value) -> float:
    """Return the square root of a number that is not negative."""
    _domain(_number(f), f >= 0, 'sqrt is defined from 0 on')
    return math.sqrt(f)


def log(b: Value, f: Value) -> float:
    """Return the logarithm of `f` to the base `b`."""
    _domain(_number(b), b > 0 and b != 1, 'the base of a log is positive and not 1')
    _domain(_number(f), f > 0, 'log is defined for positive numbers')
    return math.log(f) / math.log(b)


def pow_(base: Value, exponent: Value) -> float:
    """Return a power, as a float."""
    whole = float(_number(exponent)).is_integer()
    _domain(_number(base), base >= 0 or whole, 'a negative base needs a whole exponent')
    _domain(base, base != 0 or exponent >= 0, 'zero has no negative power')
    return math.pow(base, exponent)


def d2r(d: Value) -> float:
    """Return an angle in degrees as radians."""
    return math.radians(_number(d))


def r2d(r: Value) -> float:
    """Return an angle in radians as degrees."""
    return math.degrees(_number(r))


def ceil(f: Value) -> int:
    """Return the smallest int that is not below a number."""
    return _int_range(math.ceil(_number(f)))


def floor(f: Value) -> int:
    """Return the largest int that is not above a number."""
    return _int_range(math.floor(_number(f)))


def norm(a: Value) -> float | int:
    """Return the absolute value of a number, or the length of a list or of a pose's six items."""
    return abs(a) if is_number(a) else math.hypot(*_numbers(a))


def normalize(v: Value) -> list[float]:
    """Return a list of numbers divided by its norm."""
    items = _numbers(v)
    length = math.hypot(*items)
    if length == 0:
        raise RuntimeException('Domain error: a list of zeros has no direction')
    return [item / length for item in items]


# Lists and matrices


def size(v: Value) -> int | list[int]:
    """Return the number of items or characters; for a matrix, [rows, columns]."""
    return list(v.shape) if type(v) is Matrix else length(v)


def length(v: Value) -> int:
    """Return the number of items of a list or pose, of characters, or of rows."""
    if type(v) is Matrix:
        return v.shape[0]
    if type(v) is list or type(v) is str or type(v) is ScriptPose:
        return len(v)
    raise _wrong_type('a list or a string', v)


def get_list_length(v: Value) -> int:
    """Do the same as `length`, under its older name."""
    return length(v)


def make_list(length: Value, initial_value: Value, capacity: Value = None) -> Value:
    """Return a list of equal items; the capacity is checked and has no other effect."""
    count = _int(length)
    max_items = count if capacity is None else _int(capacity)
    if not 0 <= count <= max_items:
        raise RuntimeException(
            f'make_list: length {count} does not lie in 0..{max_items} (capacity)'
        )
    if max_items > MAX_LIST_LENGTH:
        raise RuntimeException(f'make_list: more than {MAX_LIST_LENGTH} items are not possible')
    if type(initial_value) in (list, Matrix):
        raise RuntimeException('make_list: a list of lists is not possible')
    return make_list_value([copy(initial_value) for _ in range(count)])


def _matrix(value: Value) -> Matrix:
    if type(value) is Matrix:
        return value
    raise _wrong_type('a matrix', value)


def transpose(m: Value) -> Matrix:
    """Return a matrix with rows and columns exchanged."""
    return Matrix([list(column) for column in zip(*_matrix(m).rows, strict=True)])


def inv(m: Value) -> Matrix:
    """Return the inverse of a square matrix (Gauss-Jordan, largest pivot first)."""
    rows = [[float(_number(item)) for item in row] for row in _matrix(m).rows]
    n = len(rows)
    if n != len(rows[0]):
        raise RuntimeException('inv: the matrix is not square')
    if n > MAX_INVERSE:
        raise RuntimeException(f'inv: a matrix with more than {MAX_INVERSE} rows is too large')
    for i, row in enumerate(rows):
        row.extend(1.0 if i == j else 0.0 for j in range(n))
    for i in range(n):
        pivot = max(range(i, n), key=lambda k: abs(rows[k][i]))
        rows[i], rows[pivot] = rows[pivot], rows[i]
        if rows[i][i] == 0:
            raise RuntimeException('inv: the matrix is singular')
        rows[i] = [item / rows[i][i] for item in rows[i]]
        for k in range(n):
            if k != i:
                factor = rows[k][i]
                rows[k] = [a - factor * b for a, b in zip(rows[k], rows[i], strict=True)]
    return Matrix([row[n:] for row in rows])


def struct(**fields: Value) -> Struct:
    """Return a struct with the named fields."""
    return check_size(Struct(dict(fields)))


def integer_to_binary_list(x: Value) -> list[bool]:
    """Return the 32 bits of an int, the lowest first."""
    bits = _int(x)
    return [bool(bits >> position & 1) for position in range(32)]


def binary_list_to_integer(l: Value) -> int:  # noqa: E741 (the manual's name)
    """Return the int whose bits are in the list, the lowest first; the 32nd bit is the sign."""
    if type(l) is not list or len(l) > 32 or any(type(bit) is not bool for bit in l):
        raise RuntimeException('binary_list_to_integer: at most 32 bools are needed')
    unsigned = sum(1 << position for position, bit in enumerate(l) if bit)
    return unsigned - 2**32 if unsigned > INT_MAX else unsigned


def core_builtins(seed: int = 0) -> dict[str, Callable[..., Any]]:
    """
    Return the functions of the language that need no robot, by name.

    :param seed: the seed of `random()`, so that a run can be repeated.
    """
    generator = random.Random(seed)

    def random_number() -> float:
        """Return a number from 0 (included) to 1 (excluded)."""
        return generator.random()

    named = (
        acos, asin, atan2, binary_list_to_integer, ceil, d2r, floor, get_list_length,
        integer_to_binary_list, inv, length, log, make_list, norm, normalize, r2d, size, sqrt,
        str_at, str_cat, str_empty, str_find, str_len, str_sub, struct, to_num, to_str, transpose,
    )  # fmt: skip
    float_functions = {
        'atan': math.atan, 'cos': math.cos, 'sin': math.sin, 'tan': math.tan,
    }  # fmt: skip
    table: dict[str, Callable[..., Any]] = {function.__name__: function for function in named}
    table.update((name, _function_of_float(compute)) for name, compute in float_functions.items())
    table.update(pow=pow_, random=random_number)
    return table
