# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Points and segments in flat arrays: from rows to the fields of a ``PackedPoints``.

:mod:`~ur_cartesian_driver.goal_files.goal_reading` is the way back.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.geometry.pose_rows import Floats
from ur_cartesian_driver.motion.goal.goal import Posture
from ur_cartesian_driver.motion.goal.goal_table import Integers, SegmentRows, WaypointRows


def packed_fields(points: WaypointRows, segments: SegmentRows) -> dict[str, Any] | None:
    """
    Return points and segments as the fields of a message: arrays, and names of joints.

    :returns: None if they have what it does not hold: a jerk, a posture with names and values that
        do not fit, or numbers of types that do not exist.
    """
    names = _joint_names([*points.postures.values(), *segments.via_postures.values()])
    numbers = np.concatenate((segments.types, segments.arc_modes, segments.free_axes))
    if points.jerks.any() or names is None or (numbers != numbers.astype(np.uint8)).any():
        return None
    packed: dict[str, Any] = {
        'poses': _floats(points.poses),
        'times': _given(points.times),
        'twists': _given(points.twists),
        'accelerations': _given(points.accelerations),
        'posture_joint_names': list(names),
        'postures': _posture_numbers(points.postures, len(points), names),
    }
    if segments:
        packed |= {
            'types': _bytes(segments.types),
            'arc_modes': _bytes(segments.arc_modes),
            'blend_radii': _given(segments.blend_radii),
            'dwells': _given(segments.dwells),
            'velocities': _given(segments.velocities),
            'segment_accelerations': _given(segments.accelerations),
            'via_postures': _posture_numbers(segments.via_postures, len(segments), names),
            'free_axes': _bytes(segments.free_axes) if segments.free_axes.any() else array('B'),
            'free_minima': _given(segments.free_minima),
            'free_maxima': _given(segments.free_maxima),
        }
        if segments.has_via.any():
            vias = np.where(segments.has_via[:, None], segments.vias, IDENTITY.row())
            packed['vias'] = _floats(vias)
    return packed


def _bytes(values: Integers) -> array[int]:
    return array('B', values.astype(np.uint8).tobytes())


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
