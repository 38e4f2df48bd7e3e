# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The annotations that turn the goal dataclasses into a table of fields, and the rows of that table.

The goal dataclasses are ``Goal`` and the classes of its parts, all declared in
:mod:`~ur_cartesian_driver.motion.goal.goal`. Code that treats all fields alike (schema, reading,
writing, packing, columns, plain checks) iterates over :func:`goal_fields` and distinguishes the
fields by :class:`Form`, so it names no single field.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass, MISSING, replace
from enum import auto, Enum, IntEnum
from functools import cache
from math import inf, isfinite
from types import NoneType, UnionType
from typing import Annotated, Any, get_args, get_origin, TypeVar, Union

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector3, Vector6
from ur_cartesian_driver.motion.goal.declared_types import declared_hints

E = TypeVar('E')
R = TypeVar('R', 'GoalField', 'GoalColumn')


class Form(Enum):
    """The kinds of values in a goal; each kind has one representation in messages and files."""

    #: A number, a truth value or a text, unchanged.
    PLAIN = auto()
    #: The number of a pin, uint8.
    PIN = auto()
    #: A number of things, uint32.
    COUNT = auto()
    #: The index of a point, uint32.
    INDEX = auto()
    #: A member of an enumeration, sent as its number, uint8.
    CHOICE = auto()
    #: A time [s], sent as sec and nanosec.
    DURATION = auto()
    #: A vector with x, y, z.
    VECTOR = auto()
    #: A linear and an angular vector, each with x, y, z.
    RATES = auto()
    POSE = auto()
    #: A tuple of numbers or texts.
    VALUES = auto()
    #: An object of another goal dataclass, sent as a nested message.
    RECORD = auto()
    #: A sequence of objects of another goal dataclass.
    RECORDS = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class Sent:
    """The representation of a field in messages and files, if it is not the usual one."""

    #: Name of the field in the message, with dots for nested messages; '' = as in the dataclass.
    name: str = ''
    #: The form of the value; None = the usual form for the field's type.
    form: Form | None = None
    #: Whether files list the field even at its default value; None = only if the field has no
    #: default.
    always: bool | None = None
    #: The field that this one follows in files; '' = the same order as in the dataclass.
    after: str = ''


class Mark(Enum):
    """Further properties of a field."""

    #: The driver fills the field in; it is neither part of a message nor a parameter.
    NOT_SENT = auto()
    #: The field describes the point at the end of a segment, not the motion to that point.
    OF_POINT = auto()


@dataclass(frozen=True, slots=True)
class Range:
    """The range of a field's numbers, independent of other fields; the numbers must be finite."""

    low: float = -inf
    high: float = inf
    #: The unit of the numbers, for error messages.
    unit: str = ''
    #: The advice to the user in error messages.
    remedy: str = ''
    #: Whether ``low`` itself is excluded.
    above: bool = False
    #: The special meaning of 0, which is then allowed even outside the range; '' = 0 has none.
    zero: str = ''
    #: Whether the number can be NaN at a point of a spline; the driver then chooses the number.
    nan_in_splines: bool = False

    def holds(self, values: Any) -> Any:
        """Return whether a number is in the range; for an array, return a flag per number."""
        least = values > self.low if self.above else values >= self.low
        in_range = least & (values <= self.high) & (abs(values) < inf)
        return in_range | (values == 0.0) if self.zero else in_range

    def refusal(self, value: float) -> tuple[str, str]:
        """Return the fault of a number that is outside the range, and the remedy."""
        if not isfinite(value) and (self.zero or self.high == inf):
            return f'contains {value}; every number must be finite', ''
        return self._problem(value), self.remedy

    def _problem(self, value: float) -> str:
        unit = f' {self.unit}' if self.unit else ''
        to_high = f'{self.low:g} to {self.high:g}{unit}'
        if self.zero and self.low > 0.0:
            return f'is {value:g}{unit}, but must be 0 ({self.zero}) or from {to_high}'
        if self.zero:
            return f'is {value:g}{unit}, but must be from 0 ({self.zero}) to {self.high:g}{unit}'
        if self.above:
            return (
                f'is {value:g}{unit}; it must be more than {self.low:g}, and at most '
                f'{self.high:g}{unit}'
            )
        if self.high == inf:
            return f'is {value:g}{unit}; it must not be negative'
        return f'is {value:g}{unit}, outside {to_high}'


@dataclass(frozen=True, slots=True)
class ColumnOf:
    """
    The annotation of an array with a value for each point (a column).

    It names the field of a goal dataclass whose values the column holds.
    """

    field: str
    #: Name of the array in ``PackedPoints``; '' = the name of the column, None = no such array.
    packed: str | None = ''
    #: Whether the array is filled even if every point has the default, instead of being empty.
    always: bool = False
    #: The column that this one follows in files; '' = the order of the declarations.
    after: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalField:
    """A row of the table of fields: a field of a goal dataclass."""

    name: str
    #: Type of the value, without ``None`` and annotations; for a sequence, type of its elements.
    type: Any
    form: Form
    default: Any
    sent: Sent
    range: Range | None
    is_of_point: bool

    @property
    def after(self) -> str:
        """The field that this one follows in files; '' = the same order as in the dataclass."""
        return self.sent.after

    @property
    def message_name(self) -> str:
        """The name of the field in the message, with dots for nested messages."""
        return self.sent.name or self.name

    @property
    def is_always_sent(self) -> bool:
        """Whether files list the field even at its default value."""
        return not self.has_default if self.sent.always is None else self.sent.always

    @property
    def has_default(self) -> bool:
        """Whether the dataclass declares a default for the field."""
        return self.default is not MISSING


@cache
def goal_fields(kind: type) -> tuple[GoalField, ...]:
    """Return the fields of a goal dataclass that messages contain, in the order of the class."""
    hints = declared_hints(kind)
    rows = []
    for each in fields(kind):
        hint, *notes = _parts(hints[each.name])
        if Mark.NOT_SENT in notes:
            continue
        sent = next((note for note in notes if isinstance(note, Sent)), Sent())
        type_, form = _form(hint)
        rows.append(
            GoalField(
                name=each.name,
                type=type_,
                form=sent.form or form,
                default=each.default,
                sent=sent,
                range=next((note for note in notes if isinstance(note, Range)), None),
                is_of_point=Mark.OF_POINT in notes,
            )
        )
    return tuple(rows)


@cache
def index_fields(kind: type) -> tuple[GoalField, ...]:
    """Return the fields of a goal dataclass that hold the index of a point."""
    return tuple(each for each in goal_fields(kind) if each.form is Form.INDEX)


def points_of(event: object) -> dict[str, int]:
    """Return the point indices of an event (for example an ``IOCommand``), by message field."""
    kind: type = type(event)
    return {each.message_name: getattr(event, each.name) for each in index_fields(kind)}


def renumbered(event: E, number: Callable[[int], int]) -> E:
    """Return an event with the function ``number`` applied to each of its point indices."""
    kind: type = type(event)
    numbers: Any = {each.name: number(getattr(event, each.name)) for each in index_fields(kind)}
    return replace(event, **numbers)  # type: ignore[type-var]  # a dataclass


def shifted(event: E, points: int) -> E:
    """Return an event with ``points`` added to each of its point indices."""
    return renumbered(event, lambda point: point + points)


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalColumn:
    """A row of the table of columns: a column, and the field whose values it holds."""

    name: str
    column: ColumnOf
    field: GoalField

    @property
    def after(self) -> str:
        """The column that this one follows in files; '' = the order of the declarations."""
        return self.column.after

    @property
    def mask(self) -> str:
        """The name of the array that flags the points with a value; '' = all points have one."""
        return f'has_{self.field.name}' if self.field.default is None else ''

    @property
    def packed(self) -> str | None:
        """The name of the column's array in ``PackedPoints``; None = no such array."""
        return self.name if self.column.packed == '' else self.column.packed


@cache
def declared_columns(arrays: type, kind: type) -> tuple[GoalColumn, ...]:
    """Return the columns of a class of arrays, each with the field of ``kind`` that it holds."""
    hints = declared_hints(arrays)
    table = {each.name: each for each in goal_fields(kind)}
    return tuple(
        GoalColumn(name=each.name, column=note, field=table[note.field])
        for each in fields(arrays)
        for note in _parts(hints[each.name])[1:]
        if isinstance(note, ColumnOf)
    )


@cache
def in_order_of_files(rows: tuple[R, ...]) -> tuple[R, ...]:
    """Return rows of the table in the order in which files list them."""
    order = [each for each in rows if not each.after]
    for each in rows:
        if each.after:
            names = [other.name for other in order]
            order.insert(names.index(each.after) + 1, each)
    return tuple(order)


def _parts(hint: Any) -> list[Any]:
    return list(get_args(hint)) if get_origin(hint) is Annotated else [hint]


def _form(hint: Any) -> tuple[Any, Form]:
    """Return a field's type, without ``None`` and the sequence around it, and its form."""
    if get_origin(hint) in (Union, UnionType):
        hint = next(part for part in get_args(hint) if part is not NoneType)
    if hint in _FORMS:
        return hint, _FORMS[hint]
    if get_args(hint):
        inner = get_args(hint)[0]
        return inner, Form.RECORDS if is_dataclass(inner) else Form.VALUES
    if issubclass(hint, IntEnum):
        return hint, Form.CHOICE
    return hint, Form.RECORD if is_dataclass(hint) else Form.PLAIN


_FORMS = {Vector3: Form.VECTOR, Vector6: Form.RATES, Pose: Form.POSE, int: Form.PIN}
