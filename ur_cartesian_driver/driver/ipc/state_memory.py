# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The newest robot state in memory that two processes share.

The robot loop writes at the rate of RTDE, anybody reads whenever it wants and never waits: a
counter before and after the data is odd while a write is going on, and a reader that sees it odd
or changed reads again. The memory belongs to a file without a name, so nothing of it is left
behind, however the processes end.
"""

from __future__ import annotations

from math import isnan, nan
import mmap
import os
import struct
import tempfile

from ur_cartesian_driver.motion.pose import Pose, Vector6
from ur_cartesian_driver.motion.state import (
    RobotMode,
    RobotState,
    RobotStatus,
    RuntimeState,
    SafetyMode,
    SafetyStatus,
)

_COUNTER = struct.Struct('<Q')
#: valid, timestamp, q qd (actual, target), TCP pose and twist (actual, target), wrench, TCP
#: offset, two scalings, accelerations (actual, target) and joint torques (NaN: not reported),
#: modes, bits, points begun.
_DATA = struct.Struct('<?d6d6d6d6d7d6d7d6d6d7ddd6d6d6d6i')
_SIZE = mmap.PAGESIZE
_UNKNOWN = (nan,) * 6


def create() -> int:
    """Return the descriptor of memory to share; the caller closes it."""
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

    def close(self) -> None:
        """Unmap."""
        self._memory.close()

    def clear(self) -> None:
        """Say that there is no state (any more)."""
        self._write(bytes(_DATA.size))

    def write(self, state: RobotState) -> None:
        """Publish a state."""
        self._write(
            _DATA.pack(
                True,
                state.timestamp,
                *state.actual_q,
                *state.actual_qd,
                *state.target_q,
                *state.target_qd,
                *state.actual_tcp_pose.row(),
                *state.actual_tcp_twist,
                *state.target_tcp_pose.row(),
                *state.target_tcp_twist,
                *state.actual_tcp_wrench,
                *state.T_flange_tcp.row(),
                state.speed_scaling,
                state.target_speed_fraction,
                *(state.actual_tcp_acceleration or _UNKNOWN),
                *(state.target_tcp_acceleration or _UNKNOWN),
                *(state.joint_torque or _UNKNOWN),
                state.robot_mode,
                state.safety_mode,
                state.runtime_state,
                state.robot_status,
                state.safety_status,
                state.points_begun,
            )
        )

    def read(self) -> RobotState | None:
        """Return the newest state, None when there is none."""
        while True:
            (before,) = _COUNTER.unpack_from(self._memory, 0)
            data = self._memory[_COUNTER.size : _COUNTER.size + _DATA.size]
            (after,) = _COUNTER.unpack_from(self._memory, 0)
            if before == after and not before & 1:
                return _state(_DATA.unpack(data)) if before else None

    def _write(self, data: bytes) -> None:
        if self._memory.closed:  # sockets that close behind the loop still report
            return
        self._count += 1
        _COUNTER.pack_into(self._memory, 0, 2 * self._count - 1)
        self._memory[_COUNTER.size : _COUNTER.size + len(data)] = data
        _COUNTER.pack_into(self._memory, 0, 2 * self._count)


def _state(values: tuple[float, ...]) -> RobotState | None:
    if not values[0]:
        return None
    at = 1

    def take(n: int) -> tuple[float, ...]:
        nonlocal at
        at += n
        return values[at - n : at]

    def vector() -> tuple[float, float, float, float, float, float]:
        a, b, c, d, e, f = take(6)
        return (a, b, c, d, e, f)

    def known() -> Vector6 | None:
        values = vector()
        return None if isnan(values[0]) else values

    def pose() -> Pose:
        x, y, z, qx, qy, qz, qw = take(7)
        return Pose((x, y, z), (qx, qy, qz, qw))

    def number() -> int:
        return int(take(1)[0])

    return RobotState(
        timestamp=take(1)[0],
        actual_q=vector(),
        actual_qd=vector(),
        target_q=vector(),
        target_qd=vector(),
        actual_tcp_pose=pose(),
        actual_tcp_twist=vector(),
        target_tcp_pose=pose(),
        target_tcp_twist=vector(),
        actual_tcp_wrench=vector(),
        T_flange_tcp=pose(),
        speed_scaling=take(1)[0],
        target_speed_fraction=take(1)[0],
        actual_tcp_acceleration=known(),
        target_tcp_acceleration=known(),
        joint_torque=known(),
        robot_mode=RobotMode(number()),
        safety_mode=SafetyMode(number()),
        runtime_state=RuntimeState(number()),
        robot_status=RobotStatus(number()),
        safety_status=SafetyStatus(number()),
        points_begun=number(),
    )
