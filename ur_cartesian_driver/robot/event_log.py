# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What happened lately at one robot, for whoever asks why something ended.

"The connection dropped" helps nobody: the connection drops because a program has ended, which
ended because of a stop, which has a code. Each of these is told by another connection at another
moment, so they are noted as they come, and read together when something has ended.

Pure: no socket, no clock; the time comes in.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from math import isfinite

from ur_cartesian_driver.motion.state import RobotState

#: What is older does not belong to what has just ended [s].
MAX_AGE = 3.0
#: So many notes are kept: it bounds the memory, and what a person has to read.
MAX_ENTRIES = 12


@dataclass(frozen=True, slots=True)
class EventLogEntry:
    """Something that happened."""

    time: float
    text: str
    is_robot_error: bool


class EventLog:
    """The newest notes, the oldest first."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._entries: deque[EventLogEntry] = deque(maxlen=MAX_ENTRIES)

    def add(self, text: str, now: float, *, is_robot_error: bool = False) -> None:
        """Note something; ``is_robot_error`` marks what the robot itself says is wrong."""
        self._entries.append(EventLogEntry(now, text, is_robot_error))

    def robot_error(self, now: float) -> str:
        """Return what the robot last said is wrong; empty when it said nothing lately."""
        return next((note.text for note in reversed(self._recent(now)) if note.is_robot_error), '')

    def lines(self, now: float) -> tuple[str, ...]:
        """Return the chain, each link with how long before now it was."""
        return tuple(f'{now - note.time:.3f} s before: {note.text}' for note in self._recent(now))

    def _recent(self, now: float) -> list[EventLogEntry]:
        return [note for note in self._entries if now - note.time <= MAX_AGE]


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkTiming:
    """
    How the two sides have heard of each other [s].

    :param report: how long ago the robot's last report came.
    :param keepalive: how long ago the last sign of life for the robot program was sent.
    :param max_gap: the longest pause between two of them lately.
    :param timeout: how long the robot program was last told to wait for one.
    """

    report: float
    keepalive: float
    max_gap: float
    timeout: float

    def line(self) -> str:
        """Return it in words."""
        if not isfinite(self.keepalive):
            return ''
        return (
            f'the last sign of life for the robot program was sent {self.keepalive:.3f} s before '
            f'(it waits {self.timeout:g} s for one, the longest pause between two was '
            f'{self.max_gap:.3f} s)'
        )


def mode_changes(before: RobotState, after: RobotState) -> tuple[str, ...]:
    """Return which modes differ between two reports."""
    return tuple(
        f'{what} {old.name} -> {new.name}'
        for what, old, new in (
            ('safety mode', before.safety_mode, after.safety_mode),
            ('robot mode', before.robot_mode, after.robot_mode),
            ('program', before.runtime_state, after.runtime_state),
        )
        if old is not new
    )


def describe_present(robot: RobotState | None, timing: LinkTiming) -> tuple[str, ...]:
    """Return what holds at the end: the modes, as the robot reported them last, and the pulse."""
    modes = (
        'the robot has reported nothing'
        if robot is None
        else (
            f'program {robot.runtime_state.name}, safety mode {robot.safety_mode.name}, robot '
            f'mode {robot.robot_mode.name}, as the robot reported {timing.report:.3f} s before'
        )
    )
    return tuple(filter(None, (modes, timing.line())))
