# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The annotations with which the dataclasses of a goal become a table, and the rows of that table.

:mod:`~ur_cartesian_driver.motion.goal.goal` declares the fields. Whoever handles all of them alike
(schema, reading, writing, packing, columns, plain checks) goes through :func:`goal_fields` and
decides by :class:`Form`, and so need not know any field.
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
    """The kinds of values that a goal has, each with one form in messages and files."""

    #: A number, a truth value or a text, as it is.
    PLAIN = auto()
    #: The number of a pin, uint8.
    PIN = auto()
    #: The number of a point, uint32.
    INDEX = auto()
    #: The number of a member of an enumeration, uint8.
    CHOICE = auto()
    #: Seconds, as sec and nanosec.
    DURATION = auto()
    #: x, y, z.
    VECTOR = auto()
    #: Linear and angular x, y, z.
    RATES = auto()
    POSE = auto()
    #: A tuple of numbers or texts.
    VALUES = auto()
    #: A dataclass of the table.
    RECORD = auto()
    #: A sequence of dataclasses of the table.
    RECORDS = auto()


@dataclass(frozen=True, slots=True, kw_only=True)
class Sent:
    """The form of a field in messages and files."""

    #: Its name there, with dots where it is inside of other messages; '' = as in the dataclass.
    name: str = ''
    form: Form | None = None
    #: Whether a file has it even where it has its default; None = if there is no default.
    always: bool | None = None
    #: The field behind which files have it, where that is another one than in the dataclass.
    after: str = ''


class Mark(Enum):
    """Further properties of a field."""

    #: The driver fills it in; neither messages nor parameters have it.
    NOT_SENT = auto()
    #: It says something of the point where a segment ends, and not of the motion to there.
    OF_POINT = auto()


@dataclass(frozen=True, slots=True)
class Range:
    """The numbers that a field takes, whatever the other fields say; all are finite."""

    low: float = -inf
    high: float = inf
    #: As the refusal has it.
    unit: str = ''
    remedy: str = ''
    #: Whether the least number is excluded.
    above: bool = False
    #: What 0 means where it is beside the range, or needs to be said.
    zero: str = ''
    #: Whether the driver chooses the number where a spline has NaN.
    nan_in_splines: bool = False

    def holds(self, values: Any) -> Any:
        """Tell whether a number is in the range; of an array, tell it of each number."""
        least = values > self.low if self.above else values >= self.low
        in_range = least & (values <= self.high) & (abs(values) < inf)
        return in_range | (values == 0.0) if self.zero else in_range

    def refusal(self, value: float) -> tuple[str, str]:
        """Return the fault of a number that is out of the range, and the remedy."""
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
    """The field of an object that an array of rows holds, a row for each point."""

    field: str
    #: The array of ``PackedPoints``; '' = with the name of the column, None = it has none.
    packed: str | None = ''
    #: Whether that is there even where all rows have the default.
    always: bool = False
    #: The column behind which files have it, where that is another one than here.
    after: str = ''


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalField:
    """A row of the table: a field of one of the dataclasses of a goal."""

    name: str
    #: Without ``None`` and annotations; of a sequence, of its elements.
    type: Any
    form: Form
    default: Any
    sent: Sent
    range: Range | None
    is_of_point: bool

    @property
    def after(self) -> str:
        """The field behind which files have it, '' where that is the one before."""
        return self.sent.after

    @property
    def message_name(self) -> str:
        """Its name in the message."""
        return self.sent.name or self.name

    @property
    def is_always_sent(self) -> bool:
        """Whether files have it even where it has its default."""
        return not self.has_default if self.sent.always is None else self.sent.always

    @property
    def has_default(self) -> bool:
        """Whether the dataclass has a default for it."""
        return self.default is not MISSING


@cache
def goal_fields(kind: type) -> tuple[GoalField, ...]:
    """Return the fields of a dataclass that messages have, in its order."""
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
    """Return the fields of a dataclass that number points."""
    return tuple(each for each in goal_fields(kind) if each.form is Form.INDEX)


def points_of(event: object) -> dict[str, int]:
    """Return the points that a dataclass of the table names, by field of the message."""
    kind: type = type(event)
    return {each.message_name: getattr(event, each.name) for each in index_fields(kind)}


def renumbered(event: E, number: Callable[[int], int]) -> E:
    """Return a dataclass of the table with other numbers of the points that it names."""
    kind: type = type(event)
    numbers: Any = {each.name: number(getattr(event, each.name)) for each in index_fields(kind)}
    return replace(event, **numbers)  # type: ignore[type-var]  # a dataclass


def shifted(event: E, points: int) -> E:
    """Return a dataclass of the table that names points so many numbers later."""
    return renumbered(event, lambda point: point + points)


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalColumn:
    """A row of the table of columns: an array, and the field that it holds."""

    name: str
    column: ColumnOf
    field: GoalField

    @property
    def after(self) -> str:
        """The column behind which files have it, '' where that is the one before."""
        return self.column.after

    @property
    def mask(self) -> str:
        """The array that tells which rows have a value, '' if all have."""
        return f'has_{self.field.name}' if self.field.default is None else ''

    @property
    def packed(self) -> str | None:
        """The name of its array in ``PackedPoints``, None if it has none."""
        return self.name if self.column.packed == '' else self.column.packed


@cache
def goal_columns(arrays: type, kind: type) -> tuple[GoalColumn, ...]:
    """Return the columns of a dataclass of arrays that hold the fields of a kind of objects."""
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
    """Return rows of the table in the order in which files have them."""
    order = [each for each in rows if not each.after]
    for each in rows:
        if each.after:
            names = [other.name for other in order]
            order.insert(names.index(each.after) + 1, each)
    return tuple(order)


def _parts(hint: Any) -> list[Any]:
    return list(get_args(hint)) if get_origin(hint) is Annotated else [hint]


def _form(hint: Any) -> tuple[Any, Form]:
    """Return the type of a field without ``None`` or sequence, and the form that it has."""
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
