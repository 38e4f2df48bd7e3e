# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The path offsets of a client: the one that applies now, its age, and a report.

An offset may come at any time, jump, be too old or too large. The newest one is used, cut to the
limits of the goal. Where the path is not open to offsets, zero is used instead. When the newest
offset is stale, the goal decides whether the tool stays at that offset or goes back to its path.
Other classes move the tool to the offset.
"""

from __future__ import annotations

from math import isfinite, nan

from ur_cartesian_driver.execution.goal.feeder import (
    Ageing,
    counted,
    Displaceable,
    how_often,
    Reporting,
)
from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand
from ur_cartesian_driver.execution.offsets.freshness import Freshness, RareWarnings
from ur_cartesian_driver.motion.geometry.vectors import Vector3, vector3, ZERO3
from ur_cartesian_driver.motion.goal.goal import StaleOffset
from ur_cartesian_driver.motion.plan.offset_band import OFFSET_AXES, OffsetBand


class OffsetRequests(Displaceable, Ageing, Reporting):
    """Accepts offsets, and returns the offset to which the tool should move."""

    def __init__(self, band: OffsetBand) -> None:
        """
        Begin with no offset.

        :param band: the offset band of the path.
        """
        self._band = band
        self._fades = band.on_stale is StaleOffset.FADE
        self._freshness, self._warnings = Freshness(band.timeout), RareWarnings()
        self._newest: Vector3 = ZERO3
        self._is_stale = True
        self._cut = self._stale_count = 0
        self._largest = list(ZERO3)

    def set_offset(self, offset: Vector3, age: float, now: float) -> None:
        """Accept an offset, cut to the limits, if it is finite and neither stale nor outdated."""
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
        self._warnings.forget()

    def age(self, now: float) -> list[GoalCommand]:
        """Check the age of the newest offset; warn, not too often, when it becomes stale."""
        before, self._is_stale = self._is_stale, self._freshness.is_stale(now)
        if self._is_stale and not before:
            self._stale_count += 1
            does = 'goes back to its path' if self._fades else 'stays at the newest offset'
            self._warnings.ask(
                f'the path offset is older than {self._band.timeout:g} s: the tool {does}'
            )
        return self._warnings.due(now)

    def target(self, time: float) -> Vector3:
        """Return the offset to which the tool should move, at a time of the motion [s]."""
        if not self._band.opens(time):
            if self._is_stale:  # the offset may not suit the path where it opens again
                self._newest = ZERO3
            return ZERO3
        return ZERO3 if self._is_stale and self._fades else self._newest

    def note_applied(self, offset: Vector3) -> None:
        """Note the offset that the tool has now."""
        self._largest = [max(a, abs(b)) for a, b in zip(self._largest, offset, strict=True)]

    @property
    def report(self) -> tuple[str, ...]:
        """The lines about followed, ignored and cut offsets, and the largest offset."""
        taken, dropped = self._freshness.accepted, self._freshness.dropped
        largest = ', '.join(
            f'{1e3 * value:.2f} mm {name}'
            for name, value in zip(OFFSET_AXES, self._largest, strict=True)
            if value
        )
        lines = [
            f'{counted(taken, "path offset")} followed; the path gave way by '
            f'{largest or "nothing"} at most'
        ]
        if dropped:
            lines.append(
                f'{counted(dropped, "path offset")} ignored: older than a newer one or than '
                f'{self._band.timeout:g} s, or not finite'
            )
        if self._cut:
            lines.append(f'{counted(self._cut, "path offset")} cut to path_offset.limits')
        if self._stale_count:
            times, age = how_often(self._stale_count), self._band.timeout
            lines.append(f'the path offset was stale {times}: older than {age:g} s')
        return tuple(lines)
