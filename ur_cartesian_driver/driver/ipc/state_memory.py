# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The newest robot state in memory that two processes share.

The robot loop writes at the rate of RTDE; readers read at any time and never wait. A counter is
odd during a write, and a reader that sees an odd or changed counter reads again. The memory
belongs to a file without a name, so nothing is left over, however the processes end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import isnan, nan
import mmap
import os
import struct
import tempfile
from typing import Any

from ur_cartesian_driver.motion.geometry.pose import Pose, pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.motion.state.rtde_state import RobotState, STATE_TABLE

_COUNTER = struct.Struct('<Q')
#: The number of values in the field types with more than one value.
_SIZES = {Vector6: 6, Pose: 7}
#: The data in the memory: a flag whether there is a state, then all fields of ``STATE_TABLE``.
_DATA = struct.Struct(
    '<?'
    + ''.join(
        'd' * _SIZES.get(row.type, 1) if row.type in (float, *_SIZES) else 'q'
        for row in STATE_TABLE
    )
)
_SIZE = mmap.PAGESIZE
#: The six numbers that represent None in an optional field.
_UNKNOWN = (nan,) * 6


def _compile_pack() -> Callable[[RobotState], bytes]:
    """Return a function that packs a state, compiled from source because it runs at 500 Hz."""
    forms = {Vector6: '*state.{0}', Pose: '*state.{0}.position, *state.{0}.quaternion'}
    parts = (
        f'*(state.{row.name} or unknown)'
        if row.may_be_none
        else forms.get(row.type, 'state.{0}').format(row.name)
        for row in STATE_TABLE
    )
    function: Callable[[RobotState], bytes] = eval(
        f'lambda state: pack(True, {", ".join(parts)})',
        {'pack': _DATA.pack, 'unknown': _UNKNOWN},
    )
    return function


def _readers() -> Iterator[tuple[int | slice, Callable[[Any], Any]]]:
    """Yield for each field the index or slice of its numbers, and a function to convert them."""
    start = 1
    for row in STATE_TABLE:
        size = _SIZES.get(row.type, 1)
        place = start if size == 1 else slice(start, start + size)
        if row.may_be_none:
            yield place, lambda numbers: None if isnan(numbers[0]) else numbers
        elif row.type is Vector6:
            yield place, tuple
        else:
            yield place, pose_from_row if row.type is Pose else row.type
        start += size


_pack = _compile_pack()
_READERS = tuple(_readers())


def create() -> int:
    """Return the descriptor of new memory to share; the caller closes it."""
    if hasattr(os, 'memfd_create'):
        descriptor = os.memfd_create('ur_cartesian_driver')
    else:
        with tempfile.TemporaryFile() as file:
            descriptor = os.dup(file.fileno())
    os.ftruncate(descriptor, _SIZE)
    return descriptor


class StateMemory:
    """A view of the shared memory: one side writes, the other reads."""

    def __init__(self, descriptor: int) -> None:
        """Map the memory; the descriptor may be closed afterwards."""
        self._memory = mmap.mmap(descriptor, _SIZE)
        self._count = 0
        #: Count and state of the last read.
        self._last_read: tuple[int, RobotState | None] = 0, None

    def close(self) -> None:
        """Unmap the memory."""
        self._memory.close()

    def clear(self) -> None:
        """Publish that there is no state."""
        self._write(bytes(_DATA.size))

    def write(self, state: RobotState) -> None:
        """Publish a state."""
        self._write(_pack(state))

    def read(self) -> RobotState | None:
        """Return the newest state; None = there is no state."""
        while True:
            (before,) = _COUNTER.unpack_from(self._memory, 0)
            if before == self._last_read[0]:
                return self._last_read[1]
            data = self._memory[_COUNTER.size : _COUNTER.size + _DATA.size]
            (after,) = _COUNTER.unpack_from(self._memory, 0)
            if before == after and not before & 1:
                self._last_read = before, _state(_DATA.unpack(data))
                return self._last_read[1]

    def _write(self, data: bytes) -> None:
        if self._memory.closed:  # sockets that close after the memory still report states
            return
        self._count += 1
        _COUNTER.pack_into(self._memory, 0, 2 * self._count - 1)
        self._memory[_COUNTER.size : _COUNTER.size + len(data)] = data
        _COUNTER.pack_into(self._memory, 0, 2 * self._count)


def _state(values: tuple[float, ...]) -> RobotState | None:
    if not values[0]:
        return None
    return RobotState(*(read(values[place]) for place, read in _READERS))
