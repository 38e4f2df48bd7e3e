# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The motion and the service calls that a robot loop carries out for its owner."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
import itertools

from ur_cartesian_driver.driver.ipc.channel import (
    AppendAnswered,
    Buffer,
    CallAnswered,
    CallRobot,
    MotionEnded,
    MotionProgress,
    Notification,
    pack_parts,
    Request,
    TemporaryTcpSet,
)
from ur_cartesian_driver.driver.loop_connection import LoopConnection
from ur_cartesian_driver.driver.motion_handle import ActiveMotion, MotionHandle
from ur_cartesian_driver.motion.errors import ErrorCode, RobotNotReady
from ur_cartesian_driver.motion.events import Outcome
from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer, ServiceCall


class RunningMotions:
    """
    The running motion and the pending service calls, by their numbers; thread-safe.

    At most one motion runs at a time. Each motion ends with one outcome and each call with one
    answer, whatever happens to the loop.
    """

    def __init__(self, loop: LoopConnection) -> None:
        """Begin with no motions and no calls."""
        self._loop = loop
        self.numbers = itertools.count(1)
        self._motions: dict[int, ActiveMotion] = {}
        self._calls: dict[int, Future[ServiceAnswer]] = {}

    def start(
        self, active: ActiveMotion, request: Sequence[Buffer], explain_not_ready: Callable[[], str]
    ) -> None:
        """
        Send the request that starts a motion.

        :param request: the packed request.
        :param explain_not_ready: returns the reason why the robot accepts no motion; '' = none.
        :raises RobotNotReady: the robot accepts no motion, or another motion runs.
        """
        with self._loop.lock:
            if self._motions:
                raise RobotNotReady('A motion is running; wait for its end or cancel it.')
            # Asked under the lock: a loop that is lost from now on aborts this motion, too.
            if reason := explain_not_ready():
                raise RobotNotReady(reason)
            self._motions[active.motion.number] = active
            # The request is sent under the lock: another thread may find the motion and cancel
            # it, and the cancel has to arrive after the start.
            self._loop.send_packed(request)

    def call(self, call: ServiceCall) -> Future[ServiceAnswer]:
        """
        Start a call; the future always gets an answer, never an error.

        :raises LocalProtocolError: the call cannot be pickled.
        """
        future: Future[ServiceAnswer] = Future()
        future.set_running_or_notify_cancel()
        number = next(self.numbers)
        data = pack_parts(CallRobot(number=number, call=call))
        with self._loop.lock:
            if self._loop.is_open:
                self._calls[number] = future
                self._loop.send_packed(data)
                return future
        future.set_result(ServiceAnswer(ok=False, text='The driver is closed; open it.'))
        return future

    @property
    def handles(self) -> list[MotionHandle]:
        """The handle of the running motion, in a list; empty = no motion runs."""
        return [active.motion for active in self.active]

    @property
    def active(self) -> list[ActiveMotion]:
        """The driver's side of the running motion, in a list; empty = no motion runs."""
        with self._loop.lock:
            return list(self._motions.values())

    def runs(self, number: int) -> bool:
        """Return whether motion ``number`` is running."""
        return number in self._motions

    def temporary_tcp(self, unrestored: TemporaryTcpSet | None) -> TemporaryTcpSet | None:
        """
        Return the temporary TCP of the running motion; None = it sets no TCP.

        :param unrestored: the result if no motion runs: the last goal's TCP, if it still has to be
            restored.
        """
        with self._loop.lock:
            active = next(iter(self._motions.values()), None)
            return unrestored if active is None else active.temporary_tcp

    def take(self, notification: Notification | Request) -> None:
        """Process a notification about a motion or a call; all others are ignored."""
        match notification:
            case MotionProgress(motion=number, progress=progress):
                if number in self._motions:
                    self._motions[number].report(progress)
            case AppendAnswered(motion=number, answer=answer):
                active = self._motions.get(number)
                if active is not None and active.motion.appender is not None:
                    active.motion.appender.answer(answer)
            case MotionEnded(motion=number, outcome=outcome):
                with self._loop.lock:
                    active = self._motions.pop(number, None)
                if active is not None:
                    active.end(outcome)
            case CallAnswered(number=number, answer=answer):
                with self._loop.lock:
                    call = self._calls.pop(number, None)
                if call is not None:
                    call.set_result(answer)

    def abort(self, text: str) -> None:
        """End all motions and calls of a lost robot loop."""
        self.abort_calls(text)
        with self._loop.lock:
            motions, self._motions = self._motions, {}
        for active in motions.values():
            active.end(Outcome(code=ErrorCode.CONNECTION_LOST, text=text))

    def abort_calls(self, text: str) -> None:
        """Answer all calls of a lost robot loop."""
        with self._loop.lock:
            calls, self._calls = self._calls, {}
        for call in calls.values():
            call.set_result(ServiceAnswer(ok=False, text=text))
