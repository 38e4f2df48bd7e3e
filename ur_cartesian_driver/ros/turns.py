# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Who may move the arm: one goal at a time, and of several that want to, the newest.

A goal lines up when it comes, or when its time has come, and that numbers it. One that has passed
its checks claims the arm: all older goals in line, the one that moves and those that are still
being planned or wait, have to make way, and the claim is granted when the arm is free. An older
goal that gets through its checks after a newer one has claimed is too late. So the last word is
always that of the newest goal that passed, however long the planning of each takes, and a goal
that is refused has never disturbed another one.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
import threading


class Turn:
    """One goal's turn at the arm."""

    def __init__(self, name: str, make_way: Callable[[], None]) -> None:
        """
        Take part, without a place in line yet.

        :param make_way: called, once or never, when ``successor`` is set; from any thread.
        """
        self.name = name
        self.make_way = make_way
        #: The newer goal that takes the place of this one; empty: none does.
        self.successor = ''
        #: The goal that had to make way when this one claimed the arm; empty: none had to.
        self.predecessor = ''
        self._number = 0
        self._withdrawn = False


class Turns:
    """The line in front of one arm; thread-safe."""

    def __init__(self) -> None:
        """Begin with a free arm."""
        self._condition = threading.Condition()
        self._numbers = count(1)
        self._line: list[Turn] = []
        self._owner: Turn | None = None
        self._changes = 0

    @property
    def changes(self) -> int:
        """How often the arm was given back: after each it may stand somewhere else."""
        return self._changes

    @property
    def holder(self) -> str:
        """Who has the arm; empty: nobody."""
        owner = self._owner
        return '' if owner is None else owner.name

    def is_taken(self) -> bool:
        """Tell whether a goal has the arm."""
        return self._owner is not None

    def line_up(self, turn: Turn) -> None:
        """Be the newest."""
        with self._condition:
            turn._number = next(self._numbers)
            self._line.append(turn)

    def seize(self, turn: Turn) -> bool:
        """Take the arm if it is free; tell whether it was."""
        with self._condition:
            if self._owner is not None:
                return False
            self._owner = turn
            return True

    def seize_for_now(self, turn: Turn) -> bool:
        """
        Take the arm if it is free, and make way for whatever goal claims it; tell whether it was.

        In line it stands before all others: each of them is newer.
        """
        with self._condition:
            if self._owner is not None:
                return False
            self._owner = turn
            self._line.insert(0, turn)
            return True

    def claim(self, turn: Turn) -> None:
        """
        Have all older goals make way, and wait for the arm.

        On return the arm is that of this turn, unless it has a ``successor`` or was withdrawn.
        """
        with self._condition:
            older = (
                []
                if turn.successor or turn._withdrawn
                else [
                    other
                    for other in self._line
                    if other._number < turn._number and not other.successor
                ]
            )
            for other in older:
                other.successor = turn.name
            if self._owner is not None:
                turn.predecessor = self._owner.name
            self._condition.notify_all()
        for other in older:  # not under our lock: it does more than we can know
            other.make_way()
        with self._condition:
            self._condition.wait_for(
                lambda: self._owner is None or turn.successor or turn._withdrawn
            )
            if not (turn.successor or turn._withdrawn):
                self._owner = turn

    def withdraw(self, turn: Turn) -> None:
        """Wait no longer."""
        with self._condition:
            turn._withdrawn = True
            self._condition.notify_all()

    def leave(self, turn: Turn) -> None:
        """Leave the line, and give back the arm."""
        with self._condition:
            if turn in self._line:
                self._line.remove(turn)
            if self._owner is turn:
                self._owner = None
                self._changes += 1
            self._condition.notify_all()
