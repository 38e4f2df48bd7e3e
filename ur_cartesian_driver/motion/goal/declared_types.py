# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Conversion of values to exactly the types that a dataclass declares.

Users of the Python API pass numpy's numbers for floats, and lists or arrays for tuples. The driver
needs exactly the declared types, because it packs values into messages, compares them and sends
them to another process. So it converts users' values once, on entry.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import fields, is_dataclass, replace
from enum import IntEnum
from functools import cache
from numbers import Integral, Real
from types import NoneType, UnionType
from typing import Annotated, Any, get_args, get_origin, get_type_hints, Literal, TypeVar, Union

import numpy as np

T = TypeVar('T')
Convert = Callable[[Any], Any]

#: Longest part of a wrong value that an error text quotes [characters].
_MAX_QUOTED = 60


class WrongType(ValueError):
    """A value cannot be converted to its declared type; the text names field and value."""

    def __init__(self, problem: str, field: str = '') -> None:
        """
        Build the sentence.

        :param problem: the fault of the value, as a clause.
        :param field: the wrong field, for example ``waypoints[2].time``.
        """
        super().__init__(f'{field} {problem}.')
        self.problem, self.field = problem, field

    def inside(self, outer: str) -> WrongType:
        """Return this error with ``outer`` in front of its field."""
        separator = '.' if self.field and not self.field.startswith('[') else ''
        return WrongType(self.problem, f'{outer}{separator}{self.field}')


def with_declared_types(value: T, kind: type[T], name: str) -> T:
    """
    Return a value converted to exactly the type ``kind``; fields of dataclasses are converted too.

    An int that is not a member of its ``IntEnum`` is kept, for later rules to refuse.

    :param name: the name of the value, with which an error text begins.
    :returns: the same object if nothing had to be converted.
    :raises WrongType: a value cannot be converted.
    """
    converted: T = _convert_part(_converter(kind), value, name)  # type: ignore[arg-type]  # mypy has no TypeForm
    return converted


def declare_types(instance: object) -> None:
    """
    Convert the fields of a new dataclass to their declared types; for ``__post_init__``.

    :raises WrongType: a value cannot be converted.
    """
    for name, convert, default in _field_converters(type(instance)):  # type: ignore[arg-type]  # a dataclass
        value = getattr(instance, name)
        if value is default:
            continue
        converted = _convert_part(convert, value, name)
        if converted is not value:
            object.__setattr__(instance, name, converted)


def _convert_part(convert: Convert, value: Any, name: str) -> Any:
    try:
        return convert(value)
    except WrongType as error:
        raise error.inside(name) from None


def _wrong(value: Any, needed: str) -> WrongType:
    text = repr(value)
    quoted = text if len(text) <= _MAX_QUOTED else f'{text[:_MAX_QUOTED]}...'
    return WrongType(f'is {quoted}, which is no {needed}')


@cache
def _converter(kind: Hashable) -> Convert:
    """Return the function that converts values to a type."""
    origin, arguments = get_origin(kind), get_args(kind)
    if kind in _PLAIN:
        return _PLAIN[kind]
    if origin is Annotated:
        return _converter(arguments[0])
    if origin is tuple:
        parts = [_converter(part) for part in arguments if part is not Ellipsis]
        return _tuple_of_any(parts[0]) if Ellipsis in arguments else _tuple_of(parts)
    if origin in (Union, UnionType) and len(arguments) == 2 and NoneType in arguments:
        convert = _converter(next(part for part in arguments if part is not NoneType))
        return lambda value: None if value is None else convert(value)
    if origin is Literal:
        return _text
    if isinstance(kind, type) and issubclass(kind, IntEnum):
        return _member_of(kind)
    if isinstance(kind, type) and is_dataclass(kind):
        return _dataclass(kind)
    return lambda value: value  # other types are neither converted nor checked here


@cache
def declared_hints(kind: type) -> dict[str, Any]:
    """Return the annotations of a dataclass, cached because evaluating them is slow."""
    return get_type_hints(kind, include_extras=True)


@cache
def _field_converters(kind: type) -> tuple[tuple[str, Convert, Any], ...]:
    """Return the name, the converter and the default of each field."""
    hints = declared_hints(kind)
    return tuple((each.name, _converter(hints[each.name]), each.default) for each in fields(kind))


def _dataclass(kind: type) -> Convert:
    converters = _field_converters(kind)
    names = [name for name, _, _ in converters]

    def convert(value: Any) -> Any:
        if not isinstance(value, kind):
            raise _wrong(value, kind.__name__)
        changed = {}
        for name, convert_field, default in converters:
            old = getattr(value, name)
            if old is default:  # true for most fields of a point
                continue
            new = _convert_part(convert_field, old, name)
            if new is not old:
                changed[name] = new
        if type(value) is not kind:  # a subclass, which another process may not have
            return kind(**{name: getattr(value, name) for name in names} | changed)
        return replace(value, **changed) if changed else value  # type: ignore[type-var]  # a dataclass

    return convert


def _tuple_of_any(convert: Convert) -> Convert:
    """Return the function that converts tuples of any length."""

    def convert_all(values: Any) -> Any:
        plain = _sequence(values)
        converted = tuple(_convert_part(convert, value, f'[{i}]') for i, value in enumerate(plain))
        return values if type(values) is tuple and _same(values, converted) else converted

    return convert_all


def _tuple_of(converters: Sequence[Convert]) -> Convert:
    """Return the function that converts tuples with a type for each element."""
    count = len(converters)
    types = (float,) * count if all(convert is _float for convert in converters) else None

    def convert_all(values: Any) -> Any:
        if type(values) is tuple and tuple(map(type, values)) == types:  # the usual case
            return values
        plain = _sequence(values)
        if len(plain) != count:
            raise WrongType(f'has {len(plain)} values, but needs {count}')
        converted = tuple(
            _convert_part(convert, value, f'[{i}]')
            for i, (convert, value) in enumerate(zip(converters, plain, strict=True))
        )
        return values if type(values) is tuple and _same(values, converted) else converted

    return convert_all


def _sequence(values: Any) -> Sequence[Any]:
    if isinstance(values, np.ndarray):
        values = values.tolist()
    if not isinstance(values, Sequence) or isinstance(values, str | bytes):
        raise _wrong(values, 'sequence')
    return values


def _same(first: Iterable[Any], second: Iterable[Any]) -> bool:
    return all(a is b for a, b in zip(first, second, strict=True))


def _member_of(kind: type[IntEnum]) -> Convert:
    def convert(value: Any) -> Any:
        if type(value) is kind:
            return value
        try:
            number = _int(value)
        except WrongType:
            raise _wrong(value, kind.__name__) from None
        try:
            return kind(number)
        except ValueError:
            return number  # refused later, by a rule that names the members

    return convert


def _float(value: Any) -> Any:
    if type(value) is float:
        return value
    if not isinstance(value, Real) or isinstance(value, bool):
        raise _wrong(value, 'number')
    try:
        return float(value)
    except OverflowError:
        raise WrongType('is too large a number') from None


def _int(value: Any) -> Any:
    if not isinstance(value, Integral) or isinstance(value, bool):
        raise _wrong(value, 'integer')
    return int(value)


def _bool(value: Any) -> Any:
    if not isinstance(value, bool | np.bool_):
        raise _wrong(value, 'truth value')
    return bool(value)


def _text(value: Any) -> Any:
    if not isinstance(value, str):
        raise _wrong(value, 'text')
    return value if type(value) is str else str.__str__(value)


_PLAIN: dict[Any, Convert] = {float: _float, int: _int, bool: _bool, str: _text}
