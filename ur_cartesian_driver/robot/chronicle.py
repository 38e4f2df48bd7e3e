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
RECENT = 3.0
#: So many notes are kept: it bounds the memory, and what a person has to read.
KEPT = 12


@dataclass(frozen=True, slots=True)
class Note:
    """Something that happened."""

    time: float
    text: str
    is_robot_error: bool


class Chronicle:
    """The newest notes, the oldest first."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._notes: deque[Note] = deque(maxlen=KEPT)

    def add(self, text: str, now: float, *, is_robot_error: bool = False) -> None:
        """Note something; ``is_robot_error`` marks what the robot itself says is wrong."""
        self._notes.append(Note(now, text, is_robot_error))

    def robot_error(self, now: float) -> str:
        """Return what the robot last said is wrong; empty when it said nothing lately."""
        return next((note.text for note in reversed(self._lately(now)) if note.is_robot_error), '')

    def lines(self, now: float) -> tuple[str, ...]:
        """Return the chain, each link with how long before now it was."""
        return tuple(f'{now - note.time:.3f} s before: {note.text}' for note in self._lately(now))

    def _lately(self, now: float) -> list[Note]:
        return [note for note in self._notes if now - note.time <= RECENT]


@dataclass(frozen=True, slots=True, kw_only=True)
class Pulse:
    """
    How the two sides have heard of each other [s].

    :param report: how long ago the robot's last report came.
    :param sign: how long ago the last sign of life for the robot program was sent.
    :param longest: the longest pause between two of them lately.
    :param timeout: how long the robot program was last told to wait for one.
    """

    report: float
    sign: float
    longest: float
    timeout: float

    def line(self) -> str:
        """Return it in words."""
        if not isfinite(self.sign):
            return ''
        return (
            f'the last sign of life for the robot program was sent {self.sign:.3f} s before '
            f'(it waits {self.timeout:g} s for one, the longest pause between two was '
            f'{self.longest:.3f} s)'
        )


def changes(before: RobotState, after: RobotState) -> tuple[str, ...]:
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


def standing(robot: RobotState | None, pulse: Pulse) -> tuple[str, ...]:
    """Return what holds at the end: the modes, as the robot reported them last, and the pulse."""
    modes = (
        'the robot has reported nothing'
        if robot is None
        else (
            f'program {robot.runtime_state.name}, safety mode {robot.safety_mode.name}, robot '
            f'mode {robot.robot_mode.name}, as the robot reported {pulse.report:.3f} s before'
        )
    )
    return tuple(filter(None, (modes, pulse.line())))
