# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Ownership of the arm among the threads of a program.

One thread owns the motion: from its first motion call until it ends, or until the arm stands and
the thread is in no motion call. Meanwhile a motion call of any other thread, a stop included, ends
the program. A thread that is killed in the middle of a call leaves the arm moving; if no thread
takes over in the same cycle, the controller brakes. (A stream of servoj, speedj or speedl that is
not continued in the cycle in which its last call returned ends in the motion generator itself.)
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Hashable
from enum import Enum

from ur_cartesian_driver.sim.motion.motion_generator import MotionGenerator
from ur_cartesian_driver.sim.motion.motion_values import MotionError, Move
from ur_cartesian_driver.urscript.script_errors import RuntimeException

#: What a function of a program is that takes time: it yields once per cycle.
Steps = Generator[None, None, None]

#: How the controller brakes when a program ends or a stream dries up [rad/s^2]. The real value is
#: not published; users call the stop very sudden.
HARD_STOP = 15.0


class FreedriveState(Enum):
    """Whether a person guides the arm by hand."""

    OFF = ''
    FREEDRIVE = 'freedrive'
    TEACH = 'teach mode'


class MotionOwnership:
    """The thread that moves the arm."""

    def __init__(self, motion: MotionGenerator) -> None:
        """Begin without an owner."""
        self._motion = motion
        self._owner: Hashable = None
        self._calls = 0
        self._abortable = 0
        self._aborting = False
        self._abandoned = False

    def take(self, thread: Hashable) -> None:
        """
        Make a thread the owner.

        :raises RuntimeException: another thread is in or between motions.
        """
        held = self._owner is not None and (self._calls > 0 or self._motion.moving)
        if held and self._owner != thread:
            raise RuntimeException('Another thread is already controlling the robot.')
        self._owner, self._abandoned = thread, False

    def abort(self) -> None:
        """Let the move that runs, if it can be aborted, brake and return."""
        self._aborting = self._abortable > 0

    def run(self, call: Callable[[], Move], abortable: bool = False) -> Steps:
        """
        Make a call of the motion generator and wait until it may return.

        :param abortable: `abort` makes the call brake at :data:`HARD_STOP` and return.
        :raises RuntimeException: the call makes no sense.
        """
        try:
            move = call()
        except MotionError as error:
            raise RuntimeException(str(error)) from None
        self._calls += 1
        self._abortable += abortable
        finished = False
        try:
            if move.returned and not self._motion.moving:
                yield  # programs repeat moves to where the arm stands: these take a cycle, too
            while not move.returned:
                if self._aborting and abortable:
                    self._aborting = False
                    move = self._motion.stopj(HARD_STOP)
                yield
            finished = True
        finally:
            self._calls -= 1
            self._abortable -= abortable
            self._abandoned = self._abandoned or not finished

    def release(self, thread: Hashable) -> None:
        """Let go when a thread has ended."""
        if self._owner == thread:
            self._owner = None

    def end_of_frame(self) -> None:
        """Brake if no thread has continued a motion that was left alone."""
        if self._calls == 0 and self._abandoned:
            self.brake()

    def let_go(self) -> None:
        """Take the motion from every thread, and let it be."""
        self._owner, self._abandoned = None, False

    def brake(self) -> None:
        """Stop as hard as the controller does on its own."""
        self.let_go()
        if self._motion.moving:
            self._motion.stopj(HARD_STOP)
