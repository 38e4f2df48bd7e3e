# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Clocks that determine when the next controller cycle is due.

The real clock waits for absolute deadlines, so that errors do not add up: over ten minutes the
simulated robot drifts by less than a cycle. The virtual clock never waits.
"""

from __future__ import annotations

import asyncio
from collections import deque
from dataclasses import dataclass
import time
from typing import Literal, Protocol

#: The event loop can be late by this much [s], because epoll counts in milliseconds. The clock
#: therefore asks the loop to wake it this much too early, and blocks for the remaining time.
_LOOP_GRAIN = 0.001
#: A clock that is late by more than this [s] (suspended process, overloaded machine) restarts
#: instead of catching up. Robot programs count their timeouts (commonly 0.2 s) in cycles, and
#: cycles would be so short while the clock caught up that no client could answer in time.
_MAX_LAG = 0.1
#: Number of last cycles whose lateness is kept.
_MAX_SAMPLES = 20_000


@dataclass(frozen=True, slots=True)
class Lateness:
    """Lateness of the last cycles [s] (median, 99th percentile, worst), and their number."""

    p50: float
    p99: float
    worst: float
    cycles: int


class Clock(Protocol):
    """Waits until the next cycle is due, and lets the event loop run meanwhile."""

    #: Simulated time that the clock has skipped [s].
    skipped: float

    async def next_cycle(self) -> None:
        """Return when the next cycle is due."""


class VirtualClock:
    """A clock whose time passes as fast as cycles can be computed; it never waits."""

    skipped = 0.0

    async def next_cycle(self) -> None:
        """Run the servers once, without waiting."""
        await asyncio.sleep(0)


class RealClock:
    """A clock with absolute deadlines, which are one cycle apart on the monotonic clock."""

    def __init__(
        self, cycle: float, rate: float = 1.0, when_late: Literal['skip', 'wait'] = 'skip'
    ) -> None:
        """
        Set the first deadline one cycle after the first call of `next_cycle`.

        :param cycle: simulated time of a cycle [s].
        :param rate: seconds of simulated time per second of real time.
        :param when_late: 'skip' = a restart of a late clock adds the lateness to ``skipped``;
            'wait' = it adds nothing.
        """
        self._period, self._rate = cycle / rate, rate
        self._skips = when_late == 'skip'
        self._start: float | None = None
        self._count = 0
        self._late: deque[float] = deque(maxlen=_MAX_SAMPLES)
        #: Number of restarts of the clock; simulated time that the clock has skipped [s].
        self.slips, self.skipped = 0, 0.0

    async def next_cycle(self) -> None:
        """Wait for the next deadline; meanwhile the servers run at least once."""
        if self._start is None:
            self._start = time.monotonic()
        self._count += 1
        deadline = self._start + self._count * self._period
        await asyncio.sleep(max(0.0, deadline - time.monotonic() - _LOOP_GRAIN))
        rest = deadline - time.monotonic()
        if rest > 0.0:
            # This blocks for at most a millisecond, the grain of the loop's own timer.
            time.sleep(rest)  # noqa: ASYNC251
        late = max(0.0, time.monotonic() - deadline)
        self._late.append(late)
        if late > _MAX_LAG:
            self._start, self._count, self.slips = time.monotonic(), 0, self.slips + 1
            self.skipped += late * self._rate * self._skips

    def lateness(self) -> Lateness:
        """Return the lateness of the last cycles, at most 20,000."""
        late = sorted(self._late) or [0.0]
        return Lateness(
            p50=late[len(late) // 2],
            p99=late[int(0.99 * (len(late) - 1))],
            worst=late[-1],
            cycles=len(self._late),
        )
