# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The points and segments of a goal in columns: a row for each point, an array for each field.

Sliced and scanned paths have up to 100,000 points. Creating an object for each of them would take
longer than all checks of the arrays. So the driver stores arrays, in classes that are still
sequences of :class:`~ur_cartesian_driver.motion.goal.goal.Waypoint` or
:class:`~ur_cartesian_driver.motion.goal.goal.Segment`: these objects are created on access.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, Field, field, fields, replace
from functools import cache, lru_cache
from itertools import chain
from operator import eq
from typing import Any, ClassVar, overload, TypeVar

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import vector6, ZERO6
from ur_cartesian_driver.motion.goal.declared_types import with_declared_types
from ur_cartesian_driver.motion.goal.field_annotations import (
    declared_columns,
    Form,
    goal_fields,
    GoalColumn,
    GoalField,
)
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    Segment,
    SegmentColumns,
    Waypoint,
    WaypointColumns,
)

T = TypeVar('T')
R = TypeVar('R', bound='Rows[Any]')
G = TypeVar('G', bound='GoalRows[Any]')

#: Number of rows that are converted to plain numbers at a time.
_BLOCK = 4096


def rows_where(mask: Flags | np.bool_) -> list[int]:
    """Return the indices of the true rows of a mask (n,), in order."""
    rows: list[int] = np.nonzero(mask)[0].tolist()
    return rows


@cache
def _names(kind: type[Rows[Any]]) -> tuple[str, ...]:
    return tuple(each.name for each in fields(kind))


def zeros(n: int, columns: int = 6) -> Floats:
    """Return a read-only array (n, columns) of zeros, a view of a single zero to save memory."""
    return np.broadcast_to(np.zeros(()), (n, columns))


class Rows(Sequence[T]):
    """
    Columns of the same length that are also a sequence of objects.

    A column is usually an array, which is made read-only. A column for which only few rows have a
    value is a mapping from the index of the row to the value.
    """

    __slots__: ClassVar[tuple[str, ...]] = ()
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]  # every kind of rows is a dataclass

    def __post_init__(self) -> None:
        for name in _names(type(self)):
            column = getattr(self, name)
            if isinstance(column, np.ndarray) and column.flags.writeable:
                view = column.view()
                view.setflags(write=False)
                object.__setattr__(self, name, view)

    def _columns(self) -> list[tuple[str, Any]]:
        return [(name, getattr(self, name)) for name in _names(type(self))]

    def _numbers(self, *names: str) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of some columns as plain numbers, in blocks to save memory."""
        for first in range(0, len(self), _BLOCK):
            rows = slice(first, first + _BLOCK)
            yield from zip(*(getattr(self, name)[rows].tolist() for name in names), strict=True)

    def take(self: R, rows: slice) -> R:
        """Return the rows that a slice selects; its step must be 1."""
        first, last, _ = rows.indices(len(self))
        if last - first == len(self):
            return self
        return replace(
            self,
            **{
                name: {row - first: column[row] for row in column if first <= row < last}
                if not isinstance(column, np.ndarray) and isinstance(column, Mapping)
                else column[rows]
                for name, column in self._columns()
            },
        )

    def __add__(self: R, other: R) -> R:
        """Return these rows, followed by others of the same kind."""
        columns = zip(self._columns(), other._columns(), strict=True)
        return replace(self, **{name: _joined(a, b, len(self)) for (name, a), (_, b) in columns})

    @overload
    def __getitem__(self, index: int) -> T: ...

    @overload
    def __getitem__(self: R, index: slice) -> R: ...

    def __getitem__(self, index: int | slice) -> Any:
        if isinstance(index, slice):
            if index.step not in (None, 1):
                raise ValueError(f'{type(self).__name__}: a slice must have a step of 1.')
            return self.take(index)
        row = range(len(self))[index]
        return next(iter(self.take(slice(row, row + 1))))

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, type(self)):
            if isinstance(other, Sequence) and len(other) == len(self):
                return all(a == b for a, b in zip(self, other, strict=True))
            return NotImplemented
        return all(
            _are_equal(a, b)
            for (_, a), (_, b) in zip(self._columns(), other._columns(), strict=True)
        )

    def __hash__(self) -> int:
        return hash((type(self), len(self)))


def _joined(a: Any, b: Any, n: int) -> Any:
    """Return a column of n rows, followed by the same column of other rows."""
    if isinstance(a, Mapping):
        return {**a, **{row + n: value for row, value in b.items()}}
    return np.concatenate([a, b]) if isinstance(a, np.ndarray) else a + b


def _are_equal(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b, equal_nan=True)
    if isinstance(a, Sequence):
        return len(a) == len(b) and all(map(eq, a, b))
    return bool(a == b)


class GoalRows(Rows[T]):
    """Rows whose columns hold the fields of a goal dataclass."""

    __slots__: ClassVar[tuple[str, ...]] = ()
    #: The class of the objects that the rows stand for: Waypoint or Segment.
    kind: ClassVar[type]

    @classmethod
    def columns(cls) -> tuple[GoalColumn, ...]:
        """Return the columns, each with the field of ``kind`` whose values it holds."""
        return declared_columns(cls, cls.kind)

    @classmethod
    def of(cls: type[G], objects: Iterable[T], name: str = '') -> G:
        """
        Return objects as rows; rows are returned unchanged.

        :param name: the name of ``objects`` in error messages; '' = ``waypoints`` or
            ``segments``.
        :raises WrongType: a value cannot be converted to its type; the text names the field.
        """
        if isinstance(objects, cls):
            return objects
        plain = _plain_objects(objects, cls.kind, name or f'{cls.kind.__name__.lower()}s')
        columns: dict[str, Any] = {}
        for each in cls.columns():
            values = [getattr(one, each.field.name) for one in plain]
            if each.mask:
                columns[each.mask] = np.array([value is not None for value in values], dtype=bool)
                values = [value or IDENTITY for value in values]
            columns[each.name] = _array(each.field, values)
        return cls.of_columns(len(plain), columns)

    @classmethod
    def of_columns(cls: type[G], n: int, columns: Mapping[str, Any]) -> G:
        """Return n rows; columns that are None or left out are filled with the default."""
        given = {name: rows for name, rows in columns.items() if rows is not None}
        return cls(**{**cls._defaults(n), **given})

    @classmethod
    @lru_cache(maxsize=16)  # a plan asks for them again and again
    def _defaults(cls, n: int) -> Mapping[str, Any]:
        """Return all columns of n rows, filled with the defaults."""
        masks = {
            each.mask: np.broadcast_to(np.False_, (n,)) for each in cls.columns() if each.mask
        }
        return masks | {each.name: default_column(each.field, n) for each in cls.columns()}

    def is_default(self, column: GoalColumn) -> bool:
        """Return whether each row of a column has the field's default (0 if it declares none)."""
        if column.mask:
            return not getattr(self, column.mask).any()
        rows, default = getattr(self, column.name), column.field.default
        if not isinstance(rows, np.ndarray):
            return not rows
        differs = rows != default if column.field.form is Form.PLAIN and default else rows
        return not differs.any()

    def values(self, column: GoalColumn) -> Iterable[Any]:
        """Return the values of a column, in the type that ``kind`` declares for the field."""
        rows, form = getattr(self, column.name), column.field.form
        if isinstance(rows, Mapping):
            return (rows.get(i, column.field.default) for i in range(len(self)))
        if form is Form.RATES:
            return _vectors(rows)
        if column.mask:
            given = getattr(self, column.mask).tolist()
            if not any(given):
                return (None,) * len(self)
            return (
                pose_from_row(row) if is_given else None
                for row, is_given in zip(rows.tolist(), given, strict=True)
            )
        if form is Form.POSE:
            return map(pose_from_row, rows.tolist())
        numbers: list[Any] = rows.tolist()
        if form is Form.CHOICE:
            members = {int(member): member for member in column.field.type}
            return [members.get(number, number) for number in numbers]
        return numbers

    def __len__(self) -> int:
        return len(getattr(self, self.columns()[0].name))

    def __iter__(self) -> Iterator[T]:
        columns, kind = self.columns(), self.kind
        names = [each.field.name for each in columns]
        for first in range(0, len(self), _BLOCK):
            block = self.take(slice(first, first + _BLOCK))
            for row in zip(*map(block.values, columns), strict=True):
                yield kind(**dict(zip(names, row)))  # noqa: B905  # as many as columns


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class WaypointRows(GoalRows[Waypoint], WaypointColumns):
    """The points of a goal, in the frame of the goal."""

    kind: ClassVar[type[Waypoint]] = Waypoint

    def pose(self, row: int) -> Pose:
        """Return the pose of one point."""
        return pose_from_row(self.poses[row].tolist())


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class SegmentRows(GoalRows[Segment], SegmentColumns):
    """The segments of a goal."""

    kind: ClassVar[type[Segment]] = Segment

    @classmethod
    @lru_cache(maxsize=8)  # a plan asks for them again and again
    def plain(cls, n: int) -> SegmentRows:
        """Return n default segments, for a goal that gives none."""
        return cls.of_columns(n, {})

    def via(self, row: int) -> Pose | None:
        """Return the pose on the arc of one segment; None if it has none."""
        return pose_from_row(self.vias[row].tolist()) if self.has_via[row] else None


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalTable(Goal):
    """
    A goal whose points and segments are rows; sequences of objects are converted to rows.

    :raises WrongType: a value cannot be converted to its type; the text names the field.
    """

    waypoints: WaypointRows
    segments: SegmentRows = field(default=())  # type: ignore[assignment]  # converted below

    def __post_init__(self) -> None:
        """Convert points and segments."""
        for name, kind in (('waypoints', WaypointRows), ('segments', SegmentRows)):
            rows = kind.of(getattr(self, name), f'Goal.{name}')
            object.__setattr__(self, name, rows)

    @property
    def motions(self) -> SegmentRows:
        """One segment for each point; default ones if the goal gives none."""
        return self.segments or SegmentRows.plain(len(self.waypoints))


def goal_table(goal: Goal) -> GoalTable:
    """
    Return a goal as a table; a table is returned unchanged.

    :raises WrongType: a value cannot be converted to its type; the text names the field.
    """
    if isinstance(goal, GoalTable):
        return goal
    goal = with_declared_types(goal, Goal, 'Goal')
    return GoalTable(**{each.name: getattr(goal, each.name) for each in fields(goal)})


def default_column(each: GoalField, n: int) -> Any:
    """Return a column of n rows that all have the field's default (0 if it declares none)."""
    if each.form is Form.RECORD:
        return {}
    if each.form is Form.RATES:
        return zeros(n)
    if each.form is Form.POSE:
        return np.broadcast_to(np.array(IDENTITY.row()), (n, 7))
    default = each.default if each.has_default else 0
    return np.broadcast_to(np.array(default, dtype=_number_type(each)), (n,))


def _number_type(each: GoalField) -> type:
    return np.int64 if each.form is Form.CHOICE else np.float64


def _array(each: GoalField, values: Sequence[Any]) -> Any:
    """Return the column of a field; None, for a default column, if all values are the default."""
    if each.form is Form.RECORD:
        return {i: value for i, value in enumerate(values) if value}
    default = IDENTITY if each.form is Form.POSE else each.default
    if all(value is default for value in values):
        return None
    if each.form is Form.POSE:
        values = [pose.row() for pose in values]
    return np.array(values, dtype=_number_type(each))


def _plain_objects(objects: Iterable[T], kind: type[T], name: str) -> Sequence[T]:
    """Return the objects, converted if a field does not have exactly its declared type."""
    if isinstance(objects, tuple | list):
        try:
            if _only({kind}, objects) and all(
                _are_plain(each, [getattr(one, each.name) for one in objects])
                for each in goal_fields(kind)  # type: ignore[arg-type]  # a class is hashable
            ):
                return objects
        except (AttributeError, TypeError):
            pass
    return with_declared_types(objects, tuple[kind, ...], name)  # type: ignore[valid-type, arg-type]  # the type is built at run time


def _are_plain(each: GoalField, values: Sequence[Any]) -> bool:
    """Return whether the values of a field need no conversion."""
    values = [value for value in values if value is not each.default]
    if each.form is Form.RATES:
        return _are_floats(values, 6)
    if not _only({each.type}, values):
        return False
    if each.form is Form.RECORD:
        # Only empty postures are plain. Test for tuples first: any() would fail on arrays in them.
        parts = [part for one in values for part in (one.names, one.values)]
        return _only({tuple}, parts) and not any(parts)
    return each.form is not Form.POSE or (
        _are_floats([pose.position for pose in values], 3)
        and _are_floats([pose.quaternion for pose in values], 4)
    )


def _only(kinds: set[type], values: Iterable[Any]) -> bool:
    return set(map(type, values)) <= kinds


def _are_floats(vectors: Sequence[tuple[float, ...]], count: int) -> bool:
    return (
        _only({tuple}, vectors)
        and set(map(len, vectors)) <= {count}
        and _only({float}, chain.from_iterable(vectors))
    )


def _vectors(rows: Floats) -> Iterable[Any]:
    """Return rows (n, 6) as tuples; rows of zeros share one tuple."""
    if not rows.any():
        return (ZERO6,) * len(rows)
    return (vector6(row) if any(row) else ZERO6 for row in rows.tolist())
