# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Packs points and segments: from rows to the flat arrays of a ``PackedPoints``.

:mod:`~ur_cartesian_driver.goal_files.goal_reading` unpacks them.
"""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.goal.field_annotations import Form, in_order_of_files
from ur_cartesian_driver.motion.goal.goal import Posture
from ur_cartesian_driver.motion.goal.goal_columns import SegmentRows, WaypointRows


def packed_fields(points: WaypointRows, segments: SegmentRows) -> dict[str, Any] | None:
    """
    Return points and segments as the fields of a ``PackedPoints``: arrays, and joint names.

    :returns: the fields; None = the message cannot hold a value: a jerk, a malformed posture, or a
        number of an enumeration that does not fit into a byte.
    """
    names = _joint_names([*points.postures.values(), *segments.via_postures.values()])
    if names is None:
        return None
    packed: dict[str, Any] = {}
    for rows in (points, segments) if segments else (points,):
        for each in in_order_of_files(rows.columns()):
            column, is_empty = getattr(rows, each.name), rows.is_default(each)
            code, kind = ('B', np.uint8) if each.field.form is Form.CHOICE else ('d', np.float64)
            if code == 'B' and (column != column.astype(kind)).any():
                return None
            if each.packed is None:
                if not is_empty:
                    return None
                continue
            if each.field.form is Form.RECORD:
                packed.setdefault('posture_joint_names', list(names))
            if is_empty and not each.column.always:
                packed[each.packed] = array(code)
                continue
            if each.field.form is Form.RECORD:
                column = _posture_numbers(column, len(rows), names)
            elif each.mask:
                column = np.where(getattr(rows, each.mask)[:, None], column, IDENTITY.row())
            packed[each.packed] = array(code, np.ascontiguousarray(column, dtype=kind).tobytes())
    return packed


def _joint_names(postures: Sequence[Posture]) -> tuple[str, ...] | None:
    """Return the names of the joints in postures; None = a posture is malformed."""
    names: dict[str, None] = {}
    for posture in postures:
        if len(posture.names) != len(posture.values) or len(set(posture.names)) != len(
            posture.names
        ):
            return None
        if any(value != value for value in posture.values):  # in arrays NaN means no preference
            return None
        names.update(dict.fromkeys(posture.names))
    return tuple(names)


def _posture_numbers(postures: Mapping[int, Posture], n: int, names: Sequence[str]) -> Floats:
    """Return postures as an array (n, joints); NaN = no preference."""
    values = np.full((n, len(names)), np.nan)
    column = {name: k for k, name in enumerate(names)}
    for row, posture in postures.items():
        values[row, [column[name] for name in posture.names]] = posture.values
    return values
