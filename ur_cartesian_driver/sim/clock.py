# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
When the next controller cycle is due.

The real clock waits for absolute deadlines, so that errors do not add up: over ten minutes the
simulated robot drifts by less than a cycle. The virtual clock never waits.
"""

from __future__ import annotations

import asyncio
from collections import deque
from dataclasses import dataclass
import time
from typing import Protocol

#: The event loop wakes up to this much late [s] (epoll counts in milliseconds), so it is asked to
#: wake this much early, and the rest is slept.
_LOOP_GRAIN = 0.001
#: Behind by more than this [s] (a suspended process, a starved machine), the clock starts anew
#: instead of racing: programs count their timeouts in cycles, commonly 0.2 s, and in a race of
#: cycles nobody could answer them in time.
_MAX_LAG = 0.1
_MAX_SAMPLES = 20_000


@dataclass(frozen=True, slots=True)
class Lateness:
    """How late the last cycles began [s]: median, 99th percentile, worst."""

    p50: float
    p99: float
    worst: float
    cycles: int


class Clock(Protocol):
    """Waits until the next cycle is due, while others on the event loop run."""

    async def next_cycle(self) -> None:
        """Return when the next cycle is due."""


class VirtualClock:
    """Time that passes as fast as the cycles can be computed; everybody else runs in between."""

    async def next_cycle(self) -> None:
        """Let the servers run once, wait for nothing."""
        await asyncio.sleep(0)


class RealClock:
    """Absolute deadlines, one cycle apart on the monotonic clock."""

    def __init__(self, cycle: float, rate: float = 1.0) -> None:
        """
        Begin with the first deadline one cycle from the first call.

        :param cycle: [s] of simulated time.
        :param rate: seconds of simulated time per second.
        """
        self._period = cycle / rate
        self._start: float | None = None
        self._count = 0
        self._late: deque[float] = deque(maxlen=_MAX_SAMPLES)
        #: How often the clock gave up catching up.
        self.slips = 0

    async def next_cycle(self) -> None:
        """Wait for the next deadline; let the servers run at least once."""
        if self._start is None:
            self._start = time.monotonic()
        self._count += 1
        deadline = self._start + self._count * self._period
        await asyncio.sleep(max(0.0, deadline - time.monotonic() - _LOOP_GRAIN))
        rest = deadline - time.monotonic()
        if rest > 0.0:
            # At most a millisecond, the grain of the loop's own timer.
            time.sleep(rest)  # noqa: ASYNC251
        late = max(0.0, time.monotonic() - deadline)
        self._late.append(late)
        if late > _MAX_LAG:
            self._start, self._count, self.slips = time.monotonic(), 0, self.slips + 1

    def lateness(self) -> Lateness:
        """Return the figures of the last 20,000 cycles."""
        late = sorted(self._late) or [0.0]
        return Lateness(
            p50=late[len(late) // 2],
            p99=late[int(0.99 * (len(late) - 1))],
            worst=late[-1],
            cycles=len(self._late),
        )
