# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Decides which goal or session may move the arm: one at a time, and the newest preempts the others.

A goal enters the queue when it arrives (if it has a start time, at that time), and gets a number.
When it has passed its checks, it preempts all older goals in the queue (the running one, and those
still being planned or waiting) and acquires the arm as soon as the arm is free. An older goal that
passes its checks after that is too late. So the newest goal that passes always wins, however long
each goal's planning takes, and a refused goal never disturbs another one. While a goal waits for
the arm, nobody else can acquire it, although the arm is free for a moment before the goal has it.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
import threading


class ArmRequest:
    """The request of one goal or session for the arm."""

    def __init__(self, name: str, on_preempt: Callable[[], None]) -> None:
        """
        Make a request that is not in the queue yet.

        :param name: for messages, for example ``goal 5f0c91ab``.
        :param on_preempt: called at most once, when ``preempted_by`` is set, from any thread.
        """
        self.name = name
        self.on_preempt = on_preempt
        #: Name of the newer request that preempted this one; empty: none did.
        self.preempted_by = ''
        #: Name of the request that this one preempted; empty: none.
        self.preempted = ''
        self._number = 0
        self._withdrawn = False


class ArmArbiter:
    """The queue for one arm; thread-safe."""

    def __init__(self) -> None:
        """Start with a free arm."""
        self._condition = threading.Condition()
        self._numbers = count(1)
        self._queue: list[ArmRequest] = []
        self._holder: ArmRequest | None = None
        self._waiting: list[ArmRequest] = []
        self._release_count = 0

    @property
    def release_count(self) -> int:
        """The number of releases of the arm; before each of them the arm may have moved."""
        return self._release_count

    @property
    def holder(self) -> str:
        """The name of the request that has the arm, or waits for it; empty: none."""
        with self._condition:
            first = next((each for each in (self._holder, *self._waiting) if each), None)
        return '' if first is None else first.name

    def enqueue(self, arm_request: ArmRequest) -> None:
        """Append a request to the queue as the newest."""
        with self._condition:
            arm_request._number = next(self._numbers)
            self._queue.append(arm_request)

    def acquire(self, arm_request: ArmRequest, *, preemptible: bool = False) -> bool:
        """
        Acquire the arm if it is free and nobody waits for it; return whether it was acquired.

        :param preemptible: whether any other request can preempt this one, which is therefore
            queued as the oldest.
        """
        with self._condition:
            if self._holder is not None or self._waiting:
                return False
            self._holder = arm_request
            if preemptible:
                self._queue.insert(0, arm_request)
            return True

    def preempt(self, arm_request: ArmRequest) -> None:
        """
        Preempt all older requests, and wait for the arm.

        On return the request has the arm, unless it was preempted or withdrawn itself.
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
            self._waiting.append(arm_request)
            self._condition.notify_all()
        for other in older:  # without our lock, because callbacks may take other locks
            other.on_preempt()
        with self._condition:
            self._condition.wait_for(
                lambda: self._holder is None or arm_request.preempted_by or arm_request._withdrawn
            )
            self._waiting.remove(arm_request)
            if not (arm_request.preempted_by or arm_request._withdrawn):
                self._holder = arm_request

    def withdraw(self, arm_request: ArmRequest) -> None:
        """End the wait of a request for the arm."""
        with self._condition:
            arm_request._withdrawn = True
            self._condition.notify_all()

    def release(self, arm_request: ArmRequest) -> None:
        """Remove a request from the queue, and release the arm if the request has it."""
        with self._condition:
            for requests in (self._queue, self._waiting):
                if arm_request in requests:
                    requests.remove(arm_request)
            if self._holder is arm_request:
                self._holder = None
                self._release_count += 1
            self._condition.notify_all()
