# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Ownership of the arm among the threads of a program.

A thread owns the motion from its first motion call until the thread ends, or until the arm stands
still and the thread is in no motion call. Meanwhile a motion call of any other thread, including a
stop, ends the program. If a thread is killed in the middle of a call, the arm keeps moving; if no
thread takes over in the same cycle, the controller brakes. (The motion generator ends a stream of
servoj, speedj or speedl that is not continued in the cycle in which its last call returned.)
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Hashable
from enum import Enum

from ur_cartesian_driver.sim.motion.motion_generator import MotionGenerator
from ur_cartesian_driver.sim.motion.motion_values import MotionError, Move
from ur_cartesian_driver.urscript.script_errors import RuntimeException

#: A running script function that takes time: it yields once per cycle.
Steps = Generator[None, None, None]

#: Deceleration [rad/s^2] of a stop by the controller itself: a program has ended while the arm is
#: on no path, a thread was killed, or a move is aborted. Not published; users call the robot's
#: stop very sudden.
HARD_STOP = 15.0


#: Number of waypoints with overlapping blends that a thread can skip in one cycle; it is bounded,
#: because an endless loop of such moves has to take time. Assumed.
MAX_SKIPPED = 100


class FreedriveState(Enum):
    """Whether a person can guide the arm by hand."""

    OFF = ''
    FREEDRIVE = 'freedrive'
    TEACH = 'teach mode'


class MotionOwnership:
    """The thread that moves the arm."""

    def __init__(self, motion: MotionGenerator) -> None:
        """Begin without an owner."""
        self._motion = motion
        self._owner: Hashable = None
        #: Number of motion calls that have not returned; number of these that `abort` can end.
        self._calls = 0
        self._abortable = 0
        self._aborting = False
        #: Whether a thread was killed in a motion call, and no thread has taken over since.
        self._abandoned = False
        #: Moves that returned at once in this cycle.
        self._instant_moves = 0

    def take(self, thread: Hashable) -> None:
        """
        Make a thread the owner of the motion.

        :raises RuntimeException: another thread owns the motion.
        """
        held = self._owner is not None and (self._calls > 0 or self._motion.moving)
        if held and self._owner != thread:
            raise RuntimeException('Another thread is already controlling the robot.')
        self._owner, self._abandoned = thread, False

    def abort(self) -> None:
        """Make the running move brake and return, if the move is abortable."""
        self._aborting = self._abortable > 0

    def run(self, call: Callable[[], Move], abortable: bool = False) -> Steps:
        """
        Make a call of the motion generator and wait until the call can return.

        :param abortable: whether `abort` makes the call brake at :data:`HARD_STOP` and return.
        :raises RuntimeException: the motion generator refuses the call.
        """
        try:
            move = call()
        except MotionError as error:
            raise RuntimeException(str(error)) from None
        self._calls += 1
        self._abortable += abortable
        finished = False
        try:
            if move.returned and self._has_to_wait():
                yield
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

    def _has_to_wait(self) -> bool:
        """
        Return whether a call that could return at once has to take a cycle.

        A move to the present position takes a cycle, because programs repeat such moves in loops.
        The first such move after a motion that has ended in this cycle returns at once, so that
        moves follow each other without an idle cycle. A set-point without a duration also returns
        at once: a loop of such set-points is an error on a robot, too.
        """
        motion = self._motion
        if not motion.moving:
            return True
        if motion.has_motion and not motion.on_path:
            return False
        self._instant_moves += 1
        return self._instant_moves > (MAX_SKIPPED if motion.on_path else 1)

    def release(self, thread: Hashable) -> None:
        """Take the motion from a thread that has ended."""
        if self._owner == thread:
            self._owner = None

    def end_of_frame(self) -> None:
        """Brake if no thread has continued a motion whose thread was killed."""
        self._instant_moves = 0
        if self._calls == 0 and self._abandoned:
            self.brake()

    def let_go(self) -> None:
        """Take the motion from its thread, without stopping the arm."""
        self._owner, self._abandoned = None, False

    def brake(self) -> None:
        """Take the motion from its thread and brake at :data:`HARD_STOP`."""
        self.let_go()
        if self._motion.moving:
            self._motion.stopj(HARD_STOP)
