# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The offsets that are asked of a path: the newest one, its age, and what became of all.

An offset may come at any time, jump, be too old or too large. What counts is the newest one, cut
to the limits of the goal; nothing where the path does not give way, and what the goal says where
it is stale. How the tool gets there is the matter of others.
"""

from __future__ import annotations

from math import inf, isfinite, nan

from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand, LogWarning
from ur_cartesian_driver.execution.offsets.freshness import Freshness
from ur_cartesian_driver.motion.geometry.vectors import Vector3, vector3, ZERO3
from ur_cartesian_driver.motion.goal.goal import StaleOffset
from ur_cartesian_driver.motion.plan.offset_band import OFFSET_AXES, OffsetBand

#: Shortest time between two warnings [s].
WARNING_PERIOD = 2.0


class OffsetRequests:
    """
    Takes offsets, and says where the tool shall be beside its path.

    :param band: of the path.
    """

    def __init__(self, band: OffsetBand) -> None:
        """Begin with no offset to move to."""
        self._band = band
        self._freshness = Freshness(band.timeout)
        self._newest: Vector3 = ZERO3
        self._is_stale = True
        self._cut = self._stale_count = 0
        self._largest = list(ZERO3)
        self._next_warning = -inf

    def set_offset(self, offset: Vector3, age: float, now: float) -> None:
        """
        Take an offset.

        :param offset: along, across, normal [m]; what is beyond the limits is cut.
        :param age: how long ago it was true [s].
        :param now: time of a steady clock [s].
        """
        if not all(map(isfinite, offset)):
            age = nan
        if not self._freshness.accept(age, now):
            return
        self._newest = vector3(
            min(max(value, -limit), limit)
            for value, limit in zip(offset, self._band.limits, strict=True)
        )
        self._cut += self._newest != offset
        self._is_stale = False

    def update(self, now: float) -> bool:
        """Let the newest offset age; return whether it has just become stale."""
        before, self._is_stale = self._is_stale, self._freshness.is_stale(now)
        begins = self._is_stale and not before
        self._stale_count += begins
        return begins

    def warnings(self, now: float) -> list[GoalCommand]:
        """Let the newest offset age; return the warning that it has become stale, now and then."""
        if not self.update(now) or now < self._next_warning:
            return []
        self._next_warning = now + WARNING_PERIOD
        return [LogWarning(text=self.stale_clause)]

    @property
    def stale_clause(self) -> str:
        """That the newest offset is stale, and what follows."""
        follows = 'goes back to its path' if self._fades else 'stays where it was'
        return f'the path offset is older than {self._band.timeout:g} s: the tool {follows}'

    @property
    def _fades(self) -> bool:
        return self._band.on_stale is StaleOffset.FADE

    def target(self, time: float) -> Vector3:
        """Return where the tool shall go at a time of the motion [s]."""
        if not self._band.opens(time):
            if self._is_stale:  # behind a corner it would mean another direction
                self._newest = ZERO3
            return ZERO3
        return ZERO3 if self._is_stale and self._fades else self._newest

    def note_applied(self, offset: Vector3) -> None:
        """Take note of how far the path gives way."""
        self._largest = [max(a, abs(b)) for a, b in zip(self._largest, offset, strict=True)]

    @property
    def report(self) -> tuple[str, ...]:
        """What became of the offsets, as lines of the report."""
        taken = self._freshness.accepted
        largest = ', '.join(
            f'{1e3 * value:.2f} mm {name}'
            for name, value in zip(OFFSET_AXES, self._largest, strict=True)
            if value
        )
        lines = [
            ('1 path offset was' if taken == 1 else f'{taken} path offsets were')
            + f' followed; the path gave way by {largest or "nothing"} at most'
        ]
        if self._freshness.dropped:
            lines.append(
                f'{self._freshness.dropped} path offsets came after a newer one, were older than '
                f'{self._band.timeout:g} s or not finite, and were ignored'
            )
        if self._cut:
            lines.append(f'{self._cut} path offsets were beyond path_offset.limits, and were cut')
        if self._stale_count:
            times = 'once' if self._stale_count == 1 else f'{self._stale_count} times'
            lines.append(f'the path offset was stale {times}: older than {self._band.timeout:g} s')
        return tuple(lines)
