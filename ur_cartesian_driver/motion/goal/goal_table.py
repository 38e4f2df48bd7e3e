# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The points and segments of a goal in columns: a row for each point, an array for each field.

Sliced and scanned paths have up to 100,000 points. An object for each takes longer to make than
all checks of the arrays take. So inside they are rows; each is still a sequence of
:class:`~ur_cartesian_driver.motion.goal.goal.Waypoint` or
:class:`~ur_cartesian_driver.motion.goal.goal.Segment`, which are made when somebody looks at them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, Field, field, fields, replace
from itertools import chain
from operator import attrgetter, eq
from typing import Any, ClassVar, overload, TypeVar

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.pose_rows import Floats
from ur_cartesian_driver.motion.geometry.vectors import vector6, ZERO6
from ur_cartesian_driver.motion.goal.declared_types import with_declared_types
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    FreeAxis,
    Goal,
    Posture,
    Segment,
    SegmentType,
    Waypoint,
)

Integers = NDArray[np.int64]

T = TypeVar('T')
R = TypeVar('R', bound='Rows[Any]')

NO_POSTURE = Posture()
#: How many rows are made plain numbers at a time.
_BLOCK = 4096


def rows_where(mask: NDArray[np.bool_] | np.bool_) -> list[int]:
    """Return the rows of a mask (n,) that are true, in order."""
    rows: list[int] = np.flatnonzero(mask).tolist()
    return rows


def zeros(n: int, columns: int = 6) -> Floats:
    """Return an array (n, columns) of zeros that takes no memory."""
    return np.broadcast_to(np.zeros(()), (n, columns))


class Rows(Sequence[T]):
    """
    Columns of the same length that are also a sequence of objects.

    Arrays are made read-only. Mappings hold what few rows have, by row.
    """

    __slots__: ClassVar[tuple[str, ...]] = ()
    __dataclass_fields__: ClassVar[dict[str, Field[Any]]]  # every kind of rows is a dataclass

    def __post_init__(self) -> None:
        for name, column in self._columns():
            if isinstance(column, np.ndarray) and column.flags.writeable:
                view = column.view()
                view.setflags(write=False)
                object.__setattr__(self, name, view)

    def _columns(self) -> list[tuple[str, Any]]:
        return [(name, getattr(self, name)) for name in type(self).__slots__]

    def _numbers(self, *names: str) -> Iterator[tuple[Any, ...]]:
        """Yield the rows of some columns as plain numbers, which take much more memory."""
        for first in range(0, len(self), _BLOCK):
            rows = slice(first, first + _BLOCK)
            yield from zip(*(getattr(self, name)[rows].tolist() for name in names), strict=True)

    def take(self: R, rows: slice) -> R:
        """Return some of the rows."""
        first, last, _ = rows.indices(len(self))
        return replace(
            self,
            **{
                name: {row - first: column[row] for row in column if first <= row < last}
                if isinstance(column, Mapping)
                else column[rows]
                for name, column in self._columns()
            },
        )

    def with_first(self: R, first: R) -> R:
        """Return the rows with another first one."""
        columns = zip(first._columns(), self.take(slice(1, len(self)))._columns(), strict=True)
        return replace(
            self,
            **{
                name: {**a, **{row + 1: value for row, value in b.items()}}
                if isinstance(a, Mapping)
                else np.concatenate([a, b])
                for (name, a), (_, b) in columns
            },
        )

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


def _are_equal(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b, equal_nan=True)
    if isinstance(a, Sequence):
        return len(a) == len(b) and all(map(eq, a, b))
    return bool(a == b)


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class WaypointRows(Rows[Waypoint]):
    """The points of a goal in its frame; the units are those of a waypoint."""

    #: (n,) [s]
    times: Floats
    #: (n, 7) x y z [m], quaternion x y z w
    poses: Floats
    #: (n, 6) each
    twists: Floats
    accelerations: Floats
    jerks: Floats
    #: Those that are not empty, by row.
    postures: Mapping[int, Posture] = field(default_factory=dict)

    @classmethod
    def of(cls, points: Iterable[Waypoint], name: str = 'waypoints') -> WaypointRows:
        """
        Return points as rows; rows themselves as they are.

        :param name: the first part of the field in the error.
        :raises WrongType: a value is not of its declared type; the text names the field.
        """
        if isinstance(points, cls):
            return points
        plain = _plain_objects(points, Waypoint, name, _are_plain_points)
        return cls(
            times=np.array([point.time for point in plain], dtype=np.float64),
            poses=_pose_array([point.pose for point in plain]),
            twists=_six_array([point.twist for point in plain]),
            accelerations=_six_array([point.acceleration for point in plain]),
            jerks=_six_array([point.jerk for point in plain]),
            postures=_postures([point.posture for point in plain]),
        )

    def pose(self, row: int) -> Pose:
        """Return the pose of one point."""
        return pose_from_row(self.poses[row].tolist())

    def __len__(self) -> int:
        return len(self.times)

    def __iter__(self) -> Iterator[Waypoint]:
        rates = map(_vectors, (self.twists, self.accelerations, self.jerks))
        for i, ((time, pose), twist, acceleration, jerk) in enumerate(
            zip(self._numbers('times', 'poses'), *rates, strict=True)
        ):
            yield Waypoint(
                time=time,
                pose=pose_from_row(pose),
                twist=twist,
                acceleration=acceleration,
                jerk=jerk,
                posture=self.postures.get(i, NO_POSTURE),
            )


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class SegmentRows(Rows[Segment]):
    """The segments of a goal: none, or one for each point; units as those of a segment."""

    #: (n,) the numbers of :class:`~ur_cartesian_driver.motion.goal.goal.SegmentType`
    types: Integers
    #: (n,) each
    blend_radii: Floats
    dwells: Floats
    velocities: Floats
    accelerations: Floats
    #: (n, 7) poses on the arcs, and whether there is one (n,)
    vias: Floats
    has_via: NDArray[np.bool_]
    #: (n,) the numbers of :class:`~ur_cartesian_driver.motion.goal.goal.ArcMode`
    arc_modes: Integers
    #: (n,) the numbers of :class:`~ur_cartesian_driver.motion.goal.goal.FreeAxis`, and the
    #: ranges [rad]
    free_axes: Integers
    free_minima: Floats
    free_maxima: Floats
    #: Postures at the vias that are not empty, by row.
    via_postures: Mapping[int, Posture] = field(default_factory=dict)

    @classmethod
    def of(cls, segments: Iterable[Segment], name: str = 'segments') -> SegmentRows:
        """
        Return segments as rows; rows themselves as they are.

        :param name: the first part of the field in the error.
        :raises WrongType: a value is not of its declared type; the text names the field.
        """
        if isinstance(segments, cls):
            return segments
        plain = _plain_objects(segments, Segment, name, _are_plain_segments)
        vias = [segment.via for segment in plain]
        has_via = np.array([via is not None for via in vias], dtype=np.bool_)
        columns: dict[str, Any] = {
            column: np.array([getattr(segment, name) for segment in plain], dtype=kind)
            for column, (name, kind) in _NUMBERS_OF_SEGMENTS.items()
        }
        return cls(
            **columns,
            vias=_pose_array([via or IDENTITY for via in vias])
            if has_via.any()
            else zeros(len(plain), 7),
            has_via=has_via,
            via_postures=_postures([segment.via_posture for segment in plain]),
        )

    @classmethod
    def plain(cls, n: int) -> SegmentRows:
        """Return the segments of a goal that has none."""
        columns: dict[str, Any] = {
            column: np.broadcast_to(np.zeros((), dtype=kind), (n,))
            for column, (_, kind) in _NUMBERS_OF_SEGMENTS.items()
        }
        has_via = np.broadcast_to(np.zeros((), dtype=np.bool_), (n,))
        return cls(**columns, vias=zeros(n, 7), has_via=has_via)

    def via(self, row: int) -> Pose | None:
        """Return the pose on one arc, None where there is none."""
        return pose_from_row(self.vias[row].tolist()) if self.has_via[row] else None

    def __len__(self) -> int:
        return len(self.types)

    def __iter__(self) -> Iterator[Segment]:
        names = [name for name, _ in _NUMBERS_OF_SEGMENTS.values()]
        for i, numbers in enumerate(self._numbers(*_NUMBERS_OF_SEGMENTS)):
            values = dict(zip(names, numbers, strict=True))
            for name, members in _MEMBERS.items():
                values[name] = members.get(values[name], values[name])
            posture = self.via_postures.get(i, NO_POSTURE)
            yield Segment(via=self.via(i), via_posture=posture, **values)


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalTable(Goal):
    """
    A goal whose points and segments are rows; others are converted.

    :raises WrongType: a value is not of its declared type; the text names the field.
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
        """One segment for each point, plain ones where the goal has none."""
        return self.segments or SegmentRows.plain(len(self.waypoints))


def goal_table(goal: Goal) -> GoalTable:
    """
    Return a goal as a table; a table as it is.

    :raises WrongType: a value is not of its declared type; the text names the field.
    """
    if isinstance(goal, GoalTable):
        return goal
    goal = with_declared_types(goal, Goal, 'Goal')
    return GoalTable(**{each.name: getattr(goal, each.name) for each in fields(goal)})


#: The columns of segments with a number each: the field, and its type.
_NUMBERS_OF_SEGMENTS: dict[str, tuple[str, type]] = {
    'types': ('type', np.int64),
    'blend_radii': ('blend_radius', np.float64),
    'dwells': ('dwell', np.float64),
    'velocities': ('velocity', np.float64),
    'accelerations': ('acceleration', np.float64),
    'arc_modes': ('arc_mode', np.int64),
    'free_axes': ('free_axis', np.int64),
    'free_minima': ('free_min', np.float64),
    'free_maxima': ('free_max', np.float64),
}
#: The fields that are enumerations, and their members by number.
_MEMBERS: dict[str, dict[int, Any]] = {
    name: {int(member): member for member in kind}
    for name, kind in (('type', SegmentType), ('arc_mode', ArcMode), ('free_axis', FreeAxis))
}


def _plain_objects(
    objects: Iterable[T], kind: type[T], name: str, are_plain: Callable[[Sequence[T]], bool]
) -> Sequence[T]:
    """Return objects whose fields have exactly their types, which nearly all have already."""
    if isinstance(objects, tuple | list):
        try:
            if set(map(type, objects)) <= {kind} and are_plain(objects):
                return objects
        except (AttributeError, TypeError):
            pass
    return with_declared_types(objects, tuple[kind, ...], name)  # type: ignore[valid-type, arg-type]  # a type made here


def _are_plain_points(points: Sequence[Waypoint]) -> bool:
    poses = [point.pose for point in points]
    rates = [six for point in points for six in (point.twist, point.acceleration, point.jerk)]
    return (
        _only({Pose}, poses)
        and _only({float}, (point.time for point in points))
        and _are_floats([pose.position for pose in poses], 3)
        and _are_floats([pose.quaternion for pose in poses], 4)
        and _are_floats([six for six in rates if six is not ZERO6], 6)
        and _are_plain_postures(point.posture for point in points)
    )


def _are_plain_segments(segments: Sequence[Segment]) -> bool:
    vias = [segment.via for segment in segments if segment.via is not None]
    numbers = attrgetter(
        'blend_radius', 'dwell', 'velocity', 'acceleration', 'free_min', 'free_max'
    )
    return (
        _only({SegmentType}, (segment.type for segment in segments))
        and _only({ArcMode}, (segment.arc_mode for segment in segments))
        and _only({FreeAxis}, (segment.free_axis for segment in segments))
        and _only({float}, chain.from_iterable(map(numbers, segments)))
        and _only({Pose}, vias)
        and _are_floats([via.position for via in vias], 3)
        and _are_floats([via.quaternion for via in vias], 4)
        and _are_plain_postures(segment.via_posture for segment in segments)
    )


def _are_plain_postures(postures: Iterable[Posture]) -> bool:
    """Tell whether postures need no conversion, as the empty ones that most are."""
    return all(
        type(posture) is Posture
        and _is_empty_tuple(posture.names)
        and _is_empty_tuple(posture.values)
        for posture in postures
        if posture is not _DEFAULT_POSTURE
    )


def _is_empty_tuple(values: object) -> bool:
    return type(values) is tuple and not values  # an array may be neither true nor false


_DEFAULT_POSTURE = Waypoint(pose=IDENTITY).posture


def _only(kinds: set[type], values: Iterable[Any]) -> bool:
    return set(map(type, values)) <= kinds


def _are_floats(vectors: Sequence[tuple[float, ...]], count: int) -> bool:
    return (
        _only({tuple}, vectors)
        and set(map(len, vectors)) <= {count}
        and _only({float}, chain.from_iterable(vectors))
    )


def _pose_array(poses: Sequence[Pose]) -> Floats:
    rows = np.array([pose.row() for pose in poses], dtype=np.float64)
    return rows.reshape(len(poses), 7)


def _six_array(vectors: Sequence[tuple[float, ...]]) -> Floats:
    """Return vectors as an array (n, 6); nearly always they are all the same zeros."""
    if all(vector is ZERO6 for vector in vectors):
        return zeros(len(vectors))
    return np.array(vectors, dtype=np.float64).reshape(len(vectors), 6)


def _vectors(rows: Floats) -> Iterator[Any]:
    """Return rows (n, 6) as tuples; those of zeros share one."""
    if not rows.any():
        return iter((ZERO6,) * len(rows))
    return (vector6(row) if any(row) else ZERO6 for row in rows.tolist())


def _postures(postures: Sequence[Posture]) -> Mapping[int, Posture]:
    return {i: posture for i, posture in enumerate(postures) if posture}
