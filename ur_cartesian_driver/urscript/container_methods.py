# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The methods of lists, matrices and structs; controllers have these methods since PolyScope 5.15.

Methods such as `append` change the variable on which they are called. Here a list can grow beyond
its capacity, up to the largest length that `make_list` accepts.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
import inspect
from typing import Any

from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import (
    copy,
    get_part,
    make_list,
    Matrix,
    MAX_LIST_LENGTH,
    NESTED_LIST,
    Struct,
    to_text,
    type_name,
    Value,
)


def call_method(target: Value, method: str, arguments: Sequence[Value]) -> Value:
    """
    Call a method of a URScript value.

    :raises RuntimeException: the type has no such method, or the arguments do not suit it.
    """
    function = _METHODS.get(type(target), {}).get(method)
    if function is None:
        raise RuntimeException(f'Type error: {type_name(target)} has no method {method!r}')
    takes = len(inspect.signature(function).parameters) - 1
    if len(arguments) != takes:
        raise RuntimeException(
            f'{method} takes {takes} argument{"s" * (takes != 1)}, not {len(arguments)}'
        )
    return function(target, *arguments)


def _item(value: Value) -> Value:
    if type(value) is list or type(value) is Matrix:
        raise RuntimeException(NESTED_LIST)
    return value


def _place(items: list[Value], index: Value, length: int) -> int:
    """Return an index, or refuse an index that is not from 0 to ``length`` - 1."""
    if type(index) is not int or not 0 <= index < length:
        raise RuntimeException(
            f'Index out of range: {to_text(index)} is not within 0..{length - 1} '
            f'of a list of {len(items)}'
        )
    return index


def _grow(items: list[Value], added: Sequence[Value], at: int) -> None:
    if len(items) + len(added) > MAX_LIST_LENGTH:
        raise RuntimeException(f'more than {MAX_LIST_LENGTH} items are not possible')
    items[at:at] = added


def _append(items: list[Value], element: Value) -> None:
    _grow(items, [_item(element)], len(items))


def _extend(items: list[Value], other: Value) -> None:
    if type(other) is not list:
        raise RuntimeException(f'Type error: a list is needed, not {type_name(other)}')
    _grow(items, other, len(items))


def _insert(items: list[Value], index: Value, element: Value) -> None:
    _grow(items, [_item(element)], _place(items, index, len(items) + 1))


def _pop(items: list[Value]) -> Value:
    if not items:
        raise RuntimeException('pop: the list is empty')
    return items.pop()


def _remove(items: list[Value], index: Value) -> None:
    del items[_place(items, index, len(items))]


def _slice(items: list[Value], begin: Value, end: Value) -> Value:
    last = _place(items, end, len(items) + 1)
    return make_list(items[_place(items, begin, last + 1) : last])


def _get_column(matrix: Matrix, index: Value) -> Value:
    return [get_part(matrix, (row, index)) for row in range(matrix.shape[0])]


_METHODS: dict[type, dict[str, Callable[..., Any]]] = {
    list: {
        'append': _append,
        'clear': lambda items: items.clear(),
        'extend': _extend,
        'insert': _insert,
        'length': lambda items: len(items),
        'pop': _pop,
        'remove': _remove,
        'slice': _slice,
        'to_string': to_text,
    },
    Matrix: {
        'get_column': _get_column,
        'get_row': lambda matrix, index: copy(get_part(matrix, (index,))),
        'shape': lambda matrix: list(matrix.shape),
        'to_string': to_text,
    },
    Struct: {'to_string': to_text},
}
