# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Points and segments in flat arrays: a ``PackedPoints`` to rows and back.

rclpy makes ten objects of each point of the plain form, and some 0.1 ms of work. A flat array is
one object, and one copy.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.goal import Posture, SegmentType
from ur_cartesian_driver.motion.goal_table import rows_where, SegmentRows, WaypointRows, zeros
from ur_cartesian_driver.motion.pose import IDENTITY
from ur_cartesian_driver.motion.pose_rows import Floats
from ur_cartesian_driver.msg import PackedPoints
from ur_cartesian_driver.ros.message_fields import Message

_SEGMENT_FIELDS = (
    'types',
    'arc_modes',
    'blend_radii',
    'velocities',
    'segment_accelerations',
    'vias',
    'via_postures',
)


def is_packed(packed: Message) -> bool:
    """Tell whether a ``PackedPoints`` holds anything."""
    return any(len(getattr(packed, name)) for name in packed.get_fields_and_field_types())


def rows_from_message(packed: Message) -> tuple[WaypointRows, SegmentRows]:
    """
    Return the points and segments of a ``PackedPoints``.

    :raises InvalidGoal: an array does not fit the number of points; the text names it.
    """
    n, rest = divmod(len(packed.poses), 7)
    if rest or not n:
        raise InvalidGoal(
            'packed.poses',
            f'has {len(packed.poses)} numbers, but each point needs 7',
            'give position x y z and orientation x y z w of each point',
        )
    names = tuple(packed.posture_joint_names)
    points = WaypointRows(
        times=_column(packed, 'times', n),
        poses=_matrix(packed, 'poses', n, 7),
        twists=_matrix(packed, 'twists', n, 6),
        accelerations=_matrix(packed, 'accelerations', n, 6),
        jerks=zeros(n),
        postures=_postures(packed, 'postures', n, names),
    )
    if not any(len(getattr(packed, name)) for name in _SEGMENT_FIELDS):
        return points, SegmentRows.of(())
    types, vias = _column(packed, 'types', n), _matrix(packed, 'vias', n, 7)
    identity = np.array(IDENTITY.row())
    # Unset poses of the plain form are the identity.
    has_via = (vias != identity).any(axis=1) & bool(len(packed.vias))
    is_arc = types == SegmentType.CIRCULAR
    return points, SegmentRows(
        types=types.astype(np.int64),
        blend_radii=_column(packed, 'blend_radii', n),
        velocities=_column(packed, 'velocities', n),
        accelerations=_column(packed, 'segment_accelerations', n),
        vias=vias if len(packed.vias) else np.broadcast_to(identity, (n, 7)),
        has_via=has_via | is_arc,
        arc_modes=_column(packed, 'arc_modes', n).astype(np.int64),
        via_postures=_postures(packed, 'via_postures', n, names),
    )


def packed_points(points: WaypointRows, segments: SegmentRows) -> PackedPoints | None:
    """
    Return points and segments as a message.

    :returns: None if they have what it does not hold: a jerk, a posture with names and values that
        do not fit, or numbers of types that do not exist.
    """
    names = _joint_names([*points.postures.values(), *segments.via_postures.values()])
    numbers = np.concatenate((segments.types, segments.arc_modes))
    if points.jerks.any() or names is None or (numbers != numbers.astype(np.uint8)).any():
        return None
    packed = PackedPoints(
        poses=_floats(points.poses),
        times=_given(points.times),
        twists=_given(points.twists),
        accelerations=_given(points.accelerations),
        posture_joint_names=list(names),
        postures=_posture_numbers(points.postures, len(points), names),
    )
    if segments:
        packed.types = array('B', segments.types.astype(np.uint8).tobytes())
        packed.arc_modes = array('B', segments.arc_modes.astype(np.uint8).tobytes())
        packed.blend_radii = _given(segments.blend_radii)
        packed.velocities = _given(segments.velocities)
        packed.segment_accelerations = _given(segments.accelerations)
        packed.via_postures = _posture_numbers(segments.via_postures, len(segments), names)
        if segments.has_via.any():
            vias = np.where(segments.has_via[:, None], segments.vias, IDENTITY.row())
            packed.vias = _floats(vias)
    return packed


# -- reading ------------------------------------------------------------------------------------


def _matrix(packed: Message, name: str, n: int, columns: int) -> Floats:
    """Return an array of n rows; zeros if it is empty."""
    values = getattr(packed, name)
    if not len(values):
        return zeros(n, columns)
    if len(values) != n * columns:
        raise InvalidGoal(
            f'packed.{name}',
            f'has {len(values)} numbers for {n} points',
            f'give {columns} for each point, or none' if columns > 1 else f'give {n}, or none',
        )
    return np.array(values, dtype=np.float64).reshape(n, columns)


def _column(packed: Message, name: str, n: int) -> Floats:
    return _matrix(packed, name, n, 1)[:, 0]


def _postures(packed: Message, name: str, n: int, names: tuple[str, ...]) -> Mapping[int, Posture]:
    if not len(getattr(packed, name)):
        return {}
    if not names:
        raise InvalidGoal(
            f'packed.{name}', 'has numbers, but posture_joint_names is empty', 'name the joints'
        )
    values = _matrix(packed, name, n, len(names))
    given = ~np.isnan(values)
    if given.all():  # all rows share the names
        return {
            i: Posture(names=names, values=tuple(row)) for i, row in enumerate(values.tolist())
        }
    return {
        i: Posture(
            names=tuple(name for name, is_given in zip(names, given[i], strict=True) if is_given),
            values=tuple(values[i][given[i]].tolist()),
        )
        for i in rows_where(given.any(axis=1))
    }


# -- writing ------------------------------------------------------------------------------------


def _floats(values: Floats) -> array[float]:
    return array('d', np.ascontiguousarray(values, dtype=np.float64).tobytes())


def _given(values: Floats) -> array[float]:
    """Return the numbers, none if all are 0."""
    return _floats(values) if values.any() else array('d')


def _joint_names(postures: Sequence[Posture]) -> tuple[str, ...] | None:
    """Return the joints that postures name, None if one of them is malformed."""
    names: dict[str, None] = {}
    for posture in postures:
        if len(posture.names) != len(posture.values) or len(set(posture.names)) != len(
            posture.names
        ):
            return None
        if any(value != value for value in posture.values):  # NaN means something else here
            return None
        names.update(dict.fromkeys(posture.names))
    return tuple(names)


def _posture_numbers(
    postures: Mapping[int, Posture], n: int, names: Sequence[str]
) -> array[float]:
    if not postures:
        return array('d')
    values: NDArray[np.float64] = np.full((n, len(names)), np.nan)
    column = {name: k for k, name in enumerate(names)}
    for row, posture in postures.items():
        values[row, [column[name] for name in posture.names]] = posture.values
    return _floats(values)
