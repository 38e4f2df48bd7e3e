# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The values of URScript programs.

A value is an int, float, bool, str or None of Python; a `list` of values; a `ScriptPose`; a
`Matrix` (a list of lists of equal length); a `Struct`; a `ThreadHandle`; or a `RemoteObject`.
Lists, matrices and structs are values, not references: they are copied (`copy`) when they are
assigned, passed or returned, so a builtin can keep its arguments.

Where the controller's behaviour is not documented, we have decided: integers have 32 bits and an
overflow is an error; `/` is always a true division; `%` has the sign of the dividend (as in C);
True and False are not numbers in arithmetic; `==` and `!=` accept values of different types, as in
Python.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
import math
import operator
from typing import Any, NamedTuple, TypeGuard, TypeVar

from ur_cartesian_driver.urscript.script_errors import RuntimeException

Value = Any
T = TypeVar('T')

NESTED_LIST = 'Type error: a list holds lists only as the rows of a matrix'

INT_MIN = -(2**31)
INT_MAX = 2**31 - 1
#: Longest string that a controller makes [characters]; a longer one is an error.
MAX_STRING = 1023
#: Largest number of items of a list, matrix or struct. The manual names no limit; without one a
#: program could take all the memory.
MAX_LIST_LENGTH = 100_000


class ScriptPose(NamedTuple):
    """A position [m] and a rotation vector [rad]."""

    x: float
    y: float
    z: float
    rx: float
    ry: float
    rz: float


@dataclass(slots=True)
class Matrix:
    """Rows of numbers, all of one length."""

    rows: list[list[Value]]

    def __post_init__(self) -> None:
        if not self.rows or any(len(row) != len(self.rows[0]) for row in self.rows):
            raise RuntimeException('the rows of a matrix must have the same length')

    @property
    def shape(self) -> tuple[int, int]:
        """Number of rows and columns."""
        return len(self.rows), len(self.rows[0])


@dataclass(slots=True)
class Struct:
    """Named fields; no field can be added later."""

    fields: dict[str, Value] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class ThreadHandle:
    """Result of `run`; the number is unique within one run of a program."""

    number: int


class RemoteObject(ABC):
    """A value whose methods a program can call, such as a remote procedure handle."""

    @abstractmethod
    def call(self, method: str, arguments: Sequence[Value]) -> Value:
        """
        Call a method and return its value.

        A returned generator means, as for builtins, that the call takes several frames (control
        cycles): the generator is advanced in each of them.
        """

    def part(self, name: str) -> RemoteObject:
        """Return the object for `this.name`: its method `m` is `name.m` of this object."""
        return _RemotePart(self, name)


@dataclass(frozen=True, slots=True)
class _RemotePart(RemoteObject):
    whole: RemoteObject
    name: str

    def call(self, method: str, arguments: Sequence[Value]) -> Value:
        return self.whole.call(f'{self.name}.{method}', arguments)


def type_name(value: Value) -> str:
    """Return the name of a value's type as a URScript programmer knows it."""
    names: dict[type, str] = {
        int: 'int', float: 'float', bool: 'bool', str: 'string', list: 'list',
        ScriptPose: 'pose', Matrix: 'matrix', Struct: 'struct', ThreadHandle: 'thread',
        type(None): 'none',
    }  # fmt: skip
    return names.get(type(value), type(value).__name__)


#: Types of numbers; bool is not among them.
NUMBERS = frozenset({int, float})


#: The set of types of a list of floats, for a quick check of lists.
FLOATS = frozenset({float})


def is_number(value: Value) -> TypeGuard[int | float]:
    """Return whether a value is an int or a float; a bool is neither."""
    return type(value) is float or type(value) is int


def copy(value: Value) -> Value:
    """Return a copy that shares no list, matrix or struct with the value."""
    kind = type(value)
    if kind is list:
        return [copy(item) for item in value] if Struct in map(type, value) else value[:]
    if kind is Matrix:
        return Matrix([row[:] for row in value.rows])
    if kind is Struct:
        return Struct({name: copy(item) for name, item in value.fields.items()})
    return value


#: Types whose values hold any number of other values, and so have a size.
SIZED = frozenset({list, Matrix, Struct})


def size_of(value: Value) -> int:
    """Return the number of numbers, texts and other plain values that a value holds."""
    kind = type(value)
    if kind not in SIZED:
        return 1
    if kind is list:
        return sum(map(size_of, value)) if Struct in map(type, value) else len(value)
    if kind is Matrix:
        return len(value.rows) * len(value.rows[0])
    return sum(map(size_of, value.fields.values()))


def work_on(a: Value, b: Value) -> int:
    """Return the number of plain values that an operation on two values handles."""
    if type(a) is Matrix and type(b) is Matrix:
        return size_of(a) * b.shape[1]
    return size_of(a) + size_of(b)


def check_size(value: T) -> T:
    """Return a value, or refuse one with more than ``MAX_LIST_LENGTH`` plain values."""
    if size_of(value) > MAX_LIST_LENGTH:
        raise RuntimeException(f'more than {MAX_LIST_LENGTH} items are not possible')
    return value


def make_list(items: Sequence[Value]) -> Value:
    """Return the value of `[items]`: a matrix if the items are lists."""
    kinds = set(map(type, items))
    if list in kinds and len(kinds) == 1:
        return check_size(Matrix([item[:] for item in items]))
    if kinds & {list, Matrix}:
        raise RuntimeException(NESTED_LIST)
    return check_size([copy(item) for item in items]) if Struct in kinds else list(items)


def make_pose(items: Sequence[Value]) -> ScriptPose:
    """Return the value of `p[items]`."""
    for item in items:
        if not is_number(item):
            raise RuntimeException(f'Type error: a pose cannot hold {type_name(item)}')
    return ScriptPose(*(float(item) for item in items))


# Truth and order


def truth(value: Value) -> bool:
    """Return a value as a condition; 0, None, and an empty string or list are false."""
    if type(value) is bool:
        return value
    if isinstance(value, int | float | str | list):
        return bool(value)
    return value is not None


def _ordering(symbol: str, holds: Callable[[Any, Any], bool]) -> Callable[[Value, Value], bool]:
    def compare(a: Value, b: Value) -> bool:
        kind_a, kind_b = type(a), type(b)
        if (kind_a in NUMBERS and kind_b in NUMBERS) or (kind_a is str and kind_b is str):
            return holds(a, b)
        raise _unsupported(symbol, a, b)

    return compare


# Arithmetic


def _unsupported(symbol: str, a: Value, b: Value) -> RuntimeException:
    return RuntimeException(
        f'Type error: {symbol!r} is not defined for {type_name(a)} and {type_name(b)}'
    )


def bounded(text: str) -> str:
    """Return a computed string, or refuse one that is longer than a controller makes."""
    if len(text) > MAX_STRING:
        raise RuntimeException(f'The string is longer than {MAX_STRING} characters.')
    return text


def _checked(result: int | float) -> int | float:
    """Return a computed number, or refuse an int that does not fit into 32 bits."""
    if type(result) is int and not INT_MIN <= result <= INT_MAX:
        raise RuntimeException(f'Integer overflow: {result} does not fit into 32 bits')
    return result


def _divide(a: Any, b: Any) -> float:
    if b == 0:
        raise RuntimeException('Division by zero')
    return float(a / b)


def _remainder(a: Any, b: Any) -> int | float:
    if b == 0:
        raise RuntimeException('Remainder of a division by zero')
    if type(a) is int and type(b) is int:
        return int(math.copysign(1, a)) * (abs(a) % abs(b))
    return math.fmod(a, b) if math.isfinite(a) else math.nan


def _arithmetic(symbol: str) -> Callable[[Value, Value], Value]:
    """Extend an operation on two numbers to lists and matrices."""
    compute = COMPUTE[symbol]

    def operate(a: Value, b: Value) -> Value:
        kind_a, kind_b = type(a), type(b)
        if kind_a in NUMBERS and kind_b in NUMBERS:
            result = compute(a, b)
            return _checked(result) if type(result) is int else result
        if kind_a is Matrix or kind_b is Matrix:
            return on_matrices(a, b)
        if kind_a is list and kind_b is list:
            if len(a) != len(b):
                raise RuntimeException(
                    f'{symbol!r} needs lists of equal length, not {len(a)} and {len(b)}'
                )
            return on_lists(a, b)
        if kind_a is list and kind_b in NUMBERS:
            return on_lists(a, [b] * len(a))
        if kind_b is list and kind_a in NUMBERS:
            return on_lists([a] * len(b), b)
        if symbol == '+' and kind_a is str and kind_b is str:
            return bounded(a + b)
        raise _unsupported(symbol, a, b)

    def on_lists(a: list[Value], b: list[Value]) -> list[Value]:
        return list(map(on_items, a, b))

    def on_items(a: Value, b: Value) -> int | float:
        if type(a) in NUMBERS and type(b) in NUMBERS:
            result = compute(a, b)
            return _checked(result) if type(result) is int else result
        raise _unsupported(symbol, a, b)

    def on_matrices(a: Value, b: Value) -> Value:
        if is_number(b):
            return Matrix([[on_items(x, b) for x in row] for row in a.rows])
        if is_number(a):
            return Matrix([[on_items(a, y) for y in row] for row in b.rows])
        if symbol == '*' and type(a) is Matrix:
            return _matrix_product(a, b)
        if symbol in '+-' and type(a) is Matrix and type(b) is Matrix and a.shape == b.shape:
            rows = zip(a.rows, b.rows, strict=True)
            return Matrix([operate(x, y) for x, y in rows])
        raise _unsupported(symbol, a, b)

    return operate


def _matrix_product(a: Matrix, b: Value) -> Value:
    """Return the product of two matrices, or of a matrix and a list, which is a list."""
    columns = [b] if type(b) is list else list(zip(*b.rows, strict=True)) if _is_matrix(b) else []
    if not columns:
        raise _unsupported('*', a, b)
    if len(columns[0]) != a.shape[1]:
        raise RuntimeException(
            f"'*' needs as many columns on its left ({a.shape[1]}) as rows on its right"
            f' ({len(columns[0])})'
        )
    product = [[_dot(row, column) for column in columns] for row in a.rows]
    return [row[0] for row in product] if type(b) is list else Matrix(product)


def _is_matrix(value: Value) -> TypeGuard[Matrix]:
    return type(value) is Matrix


def _dot(row: Sequence[Value], column: Sequence[Value]) -> Value:
    total: int | float = 0
    for a, b in zip(row, column, strict=True):
        if not (is_number(a) and is_number(b)):
            raise _unsupported('*', a, b)
        total += a * b
    return _checked(total)


def negate(value: Value) -> Value:
    """Return `-value` of a number, list or matrix."""
    if type(value) is float:
        return -value
    if type(value) is int or type(value) is list or type(value) is Matrix:
        return BINARY['*'](value, -1)
    raise RuntimeException(f"Type error: '-' is not defined for {type_name(value)}")


def identity(value: Value) -> Value:
    """Return `+value` of a number, list or matrix."""
    if is_number(value) or type(value) is list or type(value) is Matrix:
        return value
    raise RuntimeException(f"Type error: '+' is not defined for {type_name(value)}")


#: The arithmetic operations on two numbers; only a result that is an int can overflow.
COMPUTE: dict[str, Callable[[Any, Any], int | float]] = {
    '+': operator.add,
    '-': operator.sub,
    '*': operator.mul,
    '/': _divide,
    '%': _remainder,
}
#: The binary operators on any two values.
BINARY: dict[str, Callable[[Value, Value], Value]] = {
    **{symbol: _arithmetic(symbol) for symbol in COMPUTE},
    '==': operator.eq,
    '!=': operator.ne,
    '<': _ordering('<', operator.lt),
    '<=': _ordering('<=', operator.le),
    '>': _ordering('>', operator.gt),
    '>=': _ordering('>=', operator.ge),
}

# Parts of values

#: A key of a part of a value: the indices of `[i]` or `[r, c]`, or the name of a field.
Key = tuple[Value, ...] | str


def get_part(container: Value, key: Key) -> Value:
    """Return `container[key]` or `container.key` itself, not a copy."""
    if isinstance(key, str):
        if isinstance(container, RemoteObject):
            return container.part(key)
        return _fields(container, key)[key]
    if type(container) is Struct:
        return container.fields[_field(container, key)]
    if type(container) is Matrix:
        row: list[Value] = container.rows[_position(key[0], container.shape[0])]
        return row if len(key) == 1 else row[_position(key[1], container.shape[1])]
    return _items(container, key)[_position(key[0], len(container))]


def set_part(container: Value, path: Sequence[Key], value: Value) -> Value:
    """
    Assign ``value`` to the part of ``container`` to which the keys in ``path`` lead.

    :returns: the container: a new object if it is a pose, else the same object.
    """
    key = path[0]
    if len(path) > 1:
        value = set_part(get_part(container, key), path[1:], value)
    if isinstance(key, str):
        _fields(container, key)[key] = value
        return container
    if type(container) is Struct:
        container.fields[_field(container, key)] = value
        return container
    if type(container) is ScriptPose:
        items = list(container)
        items[_position(_items(container, key) and key[0], 6)] = value
        return make_pose(items)
    if type(container) is Matrix:
        _set_in_matrix(container, key, value)
        return container
    if type(value) is list or type(value) is Matrix:
        raise RuntimeException(NESTED_LIST)
    _items(container, key)[_position(key[0], len(container))] = value
    return container


def _set_in_matrix(matrix: Matrix, key: tuple[Value, ...], value: Value) -> None:
    row = _position(key[0], matrix.shape[0])
    if len(key) == 2 and type(value) in (list, Matrix):
        raise RuntimeException(NESTED_LIST)
    if len(key) == 2:
        matrix.rows[row][_position(key[1], matrix.shape[1])] = value
    elif type(value) is list and len(value) == matrix.shape[1]:
        matrix.rows[row] = value
    else:
        raise RuntimeException(f'a row of this matrix is a list of {matrix.shape[1]} values')


def _fields(container: Value, name: str) -> dict[str, Value]:
    if type(container) is not Struct:
        raise RuntimeException(f'Type error: {type_name(container)} has no field {name!r}')
    if name not in container.fields:
        raise RuntimeException(f'the struct has no field {name!r}')
    return container.fields


def _field(struct: Struct, key: tuple[Value, ...]) -> str:
    """Return the name of the field that an index selects, as in `struct[0]`."""
    names = list(struct.fields)
    if len(key) != 1:
        raise RuntimeException('Type error: struct has one index, not two')
    return names[_position(key[0], len(names))]


def _items(container: Value, key: tuple[Value, ...]) -> Value:
    if type(container) is not list and type(container) is not ScriptPose:
        raise RuntimeException(f'Type error: {type_name(container)} cannot be indexed')
    if len(key) != 1:
        raise RuntimeException(f'Type error: {type_name(container)} has one index, not two')
    return container


def _position(index: Value, length: int) -> int:
    """Return a checked index as an int; a whole float, such as a result of `/`, is accepted."""
    if type(index) is float and index.is_integer():
        index = int(index)
    if type(index) is not int:
        raise RuntimeException(f'Type error: an index is an int, not {type_name(index)}')
    if not 0 <= index < length:
        raise RuntimeException(f'Index out of range: {index} is not within 0..{length - 1}')
    return index


# Text


def to_text(value: Value) -> str:
    """Return the text of a value as `textmsg` and `to_str` show it."""
    kind = type(value)
    if kind is float:
        return _float_text(value)
    if kind is list:
        return f'[{_join(value)}]'
    if kind is ScriptPose:
        return f'p[{_join(value)}]'
    if kind is Matrix:
        return f'[{_join(value.rows)}]'
    if kind is Struct:
        items = (f'{name}={to_text(item)}' for name, item in value.fields.items())
        return f'struct({", ".join(items)})'
    if kind is ThreadHandle:
        return f'thread {value.number}'
    return str(value)


def _join(items: Sequence[Value]) -> str:
    return ', '.join(to_text(item) for item in items)


def _float_text(value: float) -> str:
    """Return up to six decimals without trailing zeros; a negative zero keeps its sign."""
    if not math.isfinite(value):
        return str(value)
    return f'{value:.6f}'.rstrip('0').rstrip('.')
