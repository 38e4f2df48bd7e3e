# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Encoded records of a motion, kept until they are sent."""

from __future__ import annotations

from ur_cartesian_driver.protocol.program.trajectory_points import POINT_SIZE


class PointBuffer:
    """Encoded records by their number in the goal; each record is taken once, in order."""

    def __init__(self, data: bytes = b'') -> None:
        """Begin with the first records of a motion."""
        self._data = bytearray(data)
        self._first = 0

    def __len__(self) -> int:
        """Return the number of kept records."""
        return len(self._data) // POINT_SIZE

    def put(self, behind: int, data: bytes) -> None:
        """Keep the first ``behind`` records of the goal, and replace all others by ``data``."""
        del self._data[(behind - self._first) * POINT_SIZE :]
        self._data += data

    def take(self, first: int, end: int) -> bytes:
        """Return the records to send, and forget them and all earlier ones."""
        begin, stop = ((number - self._first) * POINT_SIZE for number in (first, end))
        taken = bytes(self._data[begin:stop])
        del self._data[:stop]
        self._first = end
        return taken
