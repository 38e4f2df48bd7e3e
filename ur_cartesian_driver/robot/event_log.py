# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The recent events at one robot, to explain why a goal or a connection ended.

"The connection dropped" explains little: it dropped because a program ended, which ended because
of a stop, which has a code. Each of these facts arrives on a different connection at a different
time. So events are noted as they come, and read together when a goal or a connection has ended.

Pure: no socket; the clock is a parameter.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import inf, isfinite
from typing import Protocol

from ur_cartesian_driver.motion.state.rtde_state import RobotState

#: Age up to which entries may explain why a goal or connection ended [s]; older ones are left out.
MAX_AGE = 3.0
#: Largest number of entries; it bounds the memory, and the text that a person has to read.
MAX_ENTRIES = 12


class KeepaliveTimes(Protocol):
    """The times of keepalives to the robot program."""

    #: Time of the last keepalive [s].
    last_keepalive: float
    #: The longest pause between two keepalives since this number was last set to 0 [s].
    max_keepalive_gap: float


@dataclass(frozen=True, slots=True)
class EventLogEntry:
    """An event, with the time at which it was noted [s]."""

    time: float
    text: str
    is_robot_error: bool


class EventLog:
    """The newest events, the robot's last report and the keepalives."""

    def __init__(
        self, clock: Callable[[], float], keepalives: KeepaliveTimes, timeout: float
    ) -> None:
        """
        Begin with no entries.

        :param timeout: longest wait of the robot program for a keepalive [s].
        """
        self._clock, self._keepalives, self._timeout = clock, keepalives, timeout
        self._entries: deque[EventLogEntry] = deque(maxlen=MAX_ENTRIES)
        #: The robot's last report, kept after the robot is lost.
        self._last_state: RobotState | None = None
        #: Time of the last report [s].
        self._last_report = inf
        #: The last result of :meth:`keepalive_gap` [s].
        self._last_gap = 0.0

    def note(self, text: str, *, is_robot_error: bool = False) -> None:
        """
        Note an event that happens now.

        :param is_robot_error: whether the robot reported the event as an error.
        """
        self._entries.append(EventLogEntry(self._clock(), text, is_robot_error))

    def note_report(self, robot: RobotState) -> None:
        """Keep the robot's newest report and its time."""
        self._last_state, self._last_report = robot, self._clock()

    @property
    def now(self) -> float:
        """The time by the clock of the entries [s]."""
        return self._clock()

    def robot_error(self, since: float = -inf) -> str:
        """
        Return the newest error that the robot reported recently; empty = none.

        :param since: errors before this time are left out [s].
        """
        entries = (entry for entry in reversed(self._recent()) if entry.time >= since)
        return next((entry.text for entry in entries if entry.is_robot_error), '')

    def keepalive_gap(self) -> float:
        """Return the longest pause between two keepalives since the last call [s]; reset it."""
        self._last_gap = self._keepalives.max_keepalive_gap
        self._keepalives.max_keepalive_gap = 0.0
        return self._last_gap

    def keepalive_age(self) -> float:
        """Return the time since the last keepalive [s]."""
        return self._clock() - self._keepalives.last_keepalive

    def event_chain(self) -> tuple[str, ...]:
        """Return lines: the recent events, oldest first; the robot's modes; the last keepalive."""
        now = self._clock()
        return (
            *(f'{now - entry.time:.3f} s before: {entry.text}' for entry in self._recent()),
            self._modes(),
            *self._keepalive_line(),
        )

    def _recent(self) -> list[EventLogEntry]:
        now = self._clock()
        return [entry for entry in self._entries if now - entry.time <= MAX_AGE]

    def _modes(self) -> str:
        robot = self._last_state
        if robot is None:
            return 'the robot has reported nothing'
        return (
            f'program {robot.runtime_state.name}, safety mode {robot.safety_mode.name}, robot '
            f'mode {robot.robot_mode.name}, as the robot reported '
            f'{self._clock() - self._last_report:.3f} s before'
        )

    def _keepalive_line(self) -> tuple[str, ...]:
        age = self.keepalive_age()
        if not isfinite(age):
            return ()
        gap = max(self._last_gap, self._keepalives.max_keepalive_gap)
        return (
            f'the last keepalive was sent to the robot program {age:.3f} s before (its timeout '
            f'is {self._timeout:g} s; the longest pause between two was {gap:.3f} s)',
        )


def mode_changes(before: RobotState, after: RobotState) -> tuple[str, ...]:
    """Return the changes of modes between two reports, as texts."""
    return tuple(
        f'{what} {old.name} -> {new.name}'
        for what, old, new in (
            ('safety mode', before.safety_mode, after.safety_mode),
            ('robot mode', before.robot_mode, after.robot_mode),
            ('program', before.runtime_state, after.runtime_state),
        )
        if old is not new
    )
