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


class ArmRequest:
    """One goal's turn at the arm."""

    def __init__(self, name: str, on_preempt: Callable[[], None]) -> None:
        """
        Take part, without a place in line yet.

        :param on_preempt: called, once or never, when ``preempted_by`` is set; from any thread.
        """
        self.name = name
        self.on_preempt = on_preempt
        #: The newer goal that takes the place of this one; empty: none does.
        self.preempted_by = ''
        #: The goal that had to make way when this one claimed the arm; empty: none had to.
        self.preempted = ''
        self._number = 0
        self._withdrawn = False


class ArmArbiter:
    """The line in front of one arm; thread-safe."""

    def __init__(self) -> None:
        """Begin with a free arm."""
        self._condition = threading.Condition()
        self._numbers = count(1)
        self._queue: list[ArmRequest] = []
        self._holder: ArmRequest | None = None
        self._release_count = 0

    @property
    def release_count(self) -> int:
        """How often the arm was given back: after each it may stand somewhere else."""
        return self._release_count

    @property
    def holder(self) -> str:
        """Who has the arm; empty: nobody."""
        holder = self._holder
        return '' if holder is None else holder.name

    def is_held(self) -> bool:
        """Tell whether a goal has the arm."""
        return self._holder is not None

    def enqueue(self, arm_request: ArmRequest) -> None:
        """Be the newest."""
        with self._condition:
            arm_request._number = next(self._numbers)
            self._queue.append(arm_request)

    def acquire(self, arm_request: ArmRequest) -> bool:
        """Take the arm if it is free; tell whether it was."""
        with self._condition:
            if self._holder is not None:
                return False
            self._holder = arm_request
            return True

    def acquire_preemptible(self, arm_request: ArmRequest) -> bool:
        """
        Take the arm if it is free, and make way for whatever goal claims it; tell whether it was.

        In line it stands before all others: each of them is newer.
        """
        with self._condition:
            if self._holder is not None:
                return False
            self._holder = arm_request
            self._queue.insert(0, arm_request)
            return True

    def preempt(self, arm_request: ArmRequest) -> None:
        """
        Have all older goals make way, and wait for the arm.

        On return the arm is that of this turn, unless it has a ``preempted_by`` or was withdrawn.
        """
        with self._condition:
            older = (
                []
                if arm_request.preempted_by or arm_request._withdrawn
                else [
                    other
                    for other in self._queue
                    if other._number < arm_request._number and not other.preempted_by
                ]
            )
            for other in older:
                other.preempted_by = arm_request.name
            if self._holder is not None:
                arm_request.preempted = self._holder.name
            self._condition.notify_all()
        for other in older:  # not under our lock: it does more than we can know
            other.on_preempt()
        with self._condition:
            self._condition.wait_for(
                lambda: self._holder is None or arm_request.preempted_by or arm_request._withdrawn
            )
            if not (arm_request.preempted_by or arm_request._withdrawn):
                self._holder = arm_request

    def withdraw(self, arm_request: ArmRequest) -> None:
        """Wait no longer."""
        with self._condition:
            arm_request._withdrawn = True
            self._condition.notify_all()

    def release(self, arm_request: ArmRequest) -> None:
        """Leave the line, and give back the arm."""
        with self._condition:
            if arm_request in self._queue:
                self._queue.remove(arm_request)
            if self._holder is arm_request:
                self._holder = None
                self._release_count += 1
            self._condition.notify_all()
