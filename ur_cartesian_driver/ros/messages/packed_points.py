# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Points and segments in flat arrays: from rows to a ``PackedPoints``.

rclpy makes ten objects of each point of the plain form, and some 0.1 ms of work. A flat array is
one object, and one copy.
"""

from __future__ import annotations

from ur_cartesian_driver.goal_files.goal_packing import packed_fields
from ur_cartesian_driver.motion.goal_table import SegmentRows, WaypointRows
from ur_cartesian_driver.msg import PackedPoints


def packed_points(points: WaypointRows, segments: SegmentRows) -> PackedPoints | None:
    """Return points and segments as a message; None as by :func:`packed_fields`."""
    fields = packed_fields(points, segments)
    return None if fields is None else PackedPoints(**fields)
