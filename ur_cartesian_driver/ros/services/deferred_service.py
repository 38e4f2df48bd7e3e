# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A service that responds when its answer is ready.

A service callback of rclpy returns the response, so a callback that waits holds up the executor.
Here the callback returns a future at once, and the thread that completes it sends the response.
So no thread waits, with any executor and any number of pending calls.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
import contextlib
import threading
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node

from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer
from ur_cartesian_driver.ros.node_endpoints import SHUT_DOWN_ERRORS

#: Largest number of requests that wait, with all that they hold in memory.
MAX_WAITING_REQUESTS = 32

SHUTDOWN_REFUSAL = 'The driver node is shutting down.'


class DeferredService:
    """A service whose handler returns the future of its response."""

    def __init__(
        self,
        node: Node,
        kind: Any,
        name: str,
        handle: Callable[[Any], Future[Any]],
        group: MutuallyExclusiveCallbackGroup | None = None,
    ) -> None:
        """
        Start to serve.

        :param handle: takes the request and returns at once; the future may be completed by any
            thread, with a response of this kind or a :class:`ServiceAnswer`.
        """
        self._kind = kind
        service: Any = node.create_service(
            kind,
            name,
            lambda request, _: handle(request),
            callback_group=group or MutuallyExclusiveCallbackGroup(),
        )
        self._send_now = service.send_response
        # The executor passes the callback's return value and the request's header to this method.
        service.send_response = self._send_when_done

    def _send_when_done(self, future: Future[Any], header: Any) -> None:
        future.add_done_callback(lambda done: self._send(done.result(), header))

    def _send(self, answer: Any, header: Any) -> None:
        if isinstance(answer, ServiceAnswer):
            answer = self._kind.Response(success=answer.ok, message=answer.text)
        # The node, or all of ROS, may have been shut down meanwhile.
        with contextlib.suppress(*SHUT_DOWN_ERRORS):
            self._send_now(answer, header)


class RequestQueue:
    """Answers requests one by one, in a thread of its own; refuses them if too many wait."""

    def __init__(
        self, purpose: str, answer: Callable[[Any], Any], refuse: Callable[[str], Any]
    ) -> None:
        """
        Create the thread.

        :param purpose: the purpose of the requests, worded to follow "requests to".
        :param answer: takes a request and returns the response; it raises nothing.
        :param refuse: returns the response of a request that is not answered; takes the reason.
        """
        self._purpose, self._answer, self._refuse = purpose, answer, refuse
        self._thread = ThreadPoolExecutor(1, thread_name_prefix=purpose)
        self._slots = threading.Semaphore(MAX_WAITING_REQUESTS)

    def submit(self, request: Any) -> Future[Any]:
        """Return the future of the response."""
        response: Future[Any] = Future()
        if not self._slots.acquire(blocking=False):
            response.set_result(
                self._refuse(
                    f'{MAX_WAITING_REQUESTS} requests to {self._purpose} wait; send this one '
                    'again later.'
                )
            )
            return response

        def respond(done: Future[Any]) -> None:
            self._slots.release()
            response.set_result(
                self._refuse(SHUTDOWN_REFUSAL) if done.cancelled() else done.result()
            )

        try:
            self._thread.submit(self._answer, request).add_done_callback(respond)
        except RuntimeError:  # close() was called
            response.set_result(self._refuse(SHUTDOWN_REFUSAL))
        return response

    def close(self) -> None:
        """Complete the present request, and refuse waiting and new ones."""
        self._thread.shutdown(cancel_futures=True)


def completed_answer(text: str, *, ok: bool = False) -> Future[ServiceAnswer]:
    """Return a completed future with an answer, which is mostly a refusal."""
    future: Future[ServiceAnswer] = Future()
    future.set_result(ServiceAnswer(ok=ok, text=text))
    return future
