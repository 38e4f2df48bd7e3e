# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``~/freedrive_mode``: start and end the mode in which a person guides the arm by hand."""

from __future__ import annotations

from concurrent.futures import Future, InvalidStateError
import contextlib
import threading
from typing import Any

from rclpy.node import Node
from std_srvs.srv import SetBool

from ur_cartesian_driver.driver import Driver, MotionHandle
from ur_cartesian_driver.motion.errors import DriverError, ErrorCode
from ur_cartesian_driver.motion.events import Outcome
from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer
from ur_cartesian_driver.ros.goals.arm_arbiter import ArmArbiter, ArmRequest
from ur_cartesian_driver.ros.services.deferred_service import completed_answer, DeferredService

#: How long the node waits for the end of freedrive when the node is destroyed [s].
JOIN_TIMEOUT = 10.0


class FreedriveService:
    """Serves freedrive, which has the arm while it is on; goals cannot preempt it."""

    def __init__(self, node: Node, driver: Driver, arbiter: ArmArbiter) -> None:
        """Start to serve."""
        self._driver, self._arbiter = driver, arbiter
        self._motion: MotionHandle | None = None
        #: The answer to the call that started freedrive, and whether freedrive is ending.
        self._started, self._is_ending = _FirstAnswer(), False
        self._lock = threading.Lock()
        self._service = DeferredService(node, SetBool, '~/freedrive_mode', self._handle)

    def close(self) -> None:
        """End freedrive and wait for its end; the node destroys the service."""
        motion = self._motion
        if motion is not None:
            motion.cancel()
            with contextlib.suppress(TimeoutError):
                motion.result(JOIN_TIMEOUT)

    def _handle(self, request: Any) -> Future[ServiceAnswer]:
        """Start or end freedrive; the answer comes when the robot has done so, or has failed."""
        with self._lock:
            motion = self._motion
            if request.data:
                if motion is None:
                    return self._start()
                if self._is_ending:
                    return completed_answer('Freedrive is ending; try again when it has ended.')
                return self._started.future
            self._is_ending = motion is not None
        if motion is None:
            return completed_answer('The arm is not guided by hand.', ok=True)
        return self._end(motion)

    def _start(self) -> Future[ServiceAnswer]:
        arm_request = ArmRequest('freedrive', lambda: None)
        if not self._arbiter.acquire(arm_request):
            return completed_answer(
                'A goal or a session of live targets has the arm; wait for its end or '
                'cancel it, then try again.'
            )
        answer = self._started = _FirstAnswer()
        try:
            motion = self._driver.start_freedrive(
                lambda: answer.set(True, 'The arm can be guided by hand.')
            )
        except DriverError as error:
            self._arbiter.release(arm_request)
            return completed_answer(str(error))
        self._motion, self._is_ending = motion, False

        def on_end(outcome: Outcome) -> None:
            self._motion = None
            self._arbiter.release(arm_request)
            answer.set(False, outcome.text)

        motion.add_done_callback(on_end)
        return answer.future

    def _end(self, motion: MotionHandle) -> Future[ServiceAnswer]:
        answer = _FirstAnswer()

        def on_end(outcome: Outcome) -> None:
            ok = outcome.code is ErrorCode.CANCELLED
            answer.set(ok, 'The arm is held by the robot again.' if ok else outcome.text)

        motion.add_done_callback(on_end)
        motion.cancel()
        return answer.future


class _FirstAnswer:
    """The answer to a service call; later answers are ignored."""

    def __init__(self) -> None:
        self.future: Future[ServiceAnswer] = Future()

    def set(self, ok: bool, text: str) -> None:
        with contextlib.suppress(InvalidStateError):
            self.future.set_result(ServiceAnswer(ok=ok, text=text))
