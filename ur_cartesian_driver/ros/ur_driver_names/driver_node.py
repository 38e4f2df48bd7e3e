# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The driver's node, seen from another node, which calls its services without waiting."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
from contextlib import suppress
from dataclasses import dataclass, field
import threading
from time import monotonic
from typing import Any

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.node import Node

from ur_cartesian_driver.msg import DriverStatus, IOStates
from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer
from ur_cartesian_driver.ros.message_fields import Message
from ur_cartesian_driver.ros.node_endpoints import LATCHED_QOS, steady_timer

#: How long the driver may take to answer; its own bound is 40 s for most services [s].
ANSWER_TIMEOUT = 60.0
#: How long a call waits for the discovery of the driver's service [s].
DISCOVERY_TIMEOUT = 5.0
#: Age above which a status is ignored [s]; the driver publishes one every second.
STATUS_TIMEOUT = 5.0
#: Period in which waiting calls are checked [s].
CHECK_PERIOD = 0.2


class DriverSilent(Exception):
    """A call to the driver's node gets no answer; the text says why."""


@dataclass(slots=True, kw_only=True)
class _PendingCall:
    """A call that waits for the discovery of its service, or for its answer."""

    client: Any
    request: Message
    service: str
    timeout: float
    future: Future[Message] = field(default_factory=Future)
    deadline: float = field(default_factory=lambda: monotonic() + DISCOVERY_TIMEOUT)
    is_sent: bool = False


class DriverNode:
    """
    Calls the services of a driver's node, from any thread; nothing blocks.

    ``io_states`` is the last message of this topic; None = none so far.
    """

    def __init__(self, node: Node, name: str) -> None:
        """
        Prepare to call.

        :param node: the node that calls.
        :param name: the name of the driver's node; without a leading ``/`` it is relative to the
            namespace of ``node``.
        """
        self.node, self.name = node, name
        self._status: DriverStatus | None = None
        self._status_time = 0.0
        self.io_states: IOStates | None = None
        self._on_status: list[Callable[[DriverStatus], None]] = []
        self._on_close: list[Callable[[], None]] = []
        self.subscribe(DriverStatus, 'status', self._keep_status, LATCHED_QOS)
        self.subscribe(IOStates, 'io_states', self._keep_io_states, LATCHED_QOS)
        self._group = ReentrantCallbackGroup()
        self._lock = threading.Lock()  # guards the two below
        self._clients: dict[str, Any] = {}
        self._calls: list[_PendingCall] = []
        self._is_closed = False
        steady_timer(node, CHECK_PERIOD, self._look_at_calls, self._group)

    @property
    def status(self) -> DriverStatus | None:
        """The driver's status; None = there is no driver, or none any more."""
        return None if monotonic() - self._status_time > STATUS_TIMEOUT else self._status

    @property
    def is_reporting(self) -> bool:
        """Whether the driver reports the state of a robot."""
        status = self.status
        return status is not None and status.robot_mode != DriverStatus.ROBOT_MODE_UNKNOWN

    def own_name(self, name: str) -> str:
        """Return the name of a topic, service or action of the driver's node."""
        return f'{self.name}/{name}'

    def subscribe(
        self, kind: Any, name: str, callback: Callable[[Message], None], qos: Any
    ) -> Any:
        """Listen to a topic of the driver's node, and return the subscription."""
        return self.node.create_subscription(kind, self.own_name(name), callback, qos)

    def on_status(self, callback: Callable[[DriverStatus], None]) -> None:
        """Call a function with each message of the status, once a second and on change."""
        self._on_status.append(callback)

    def on_close(self, callback: Callable[[], None]) -> None:
        """Call a function before all calls are given up."""
        self._on_close.append(callback)

    def client(self, kind: Any, name: str) -> Any:
        """Return the client of a service of the driver's node; each service has one client."""
        with self._lock:
            if name not in self._clients:
                self._clients[name] = self.node.create_client(
                    kind, self.own_name(name), callback_group=self._group
                )
            return self._clients[name]

    def request(
        self, kind: Any, name: str, request: Message, timeout: float = ANSWER_TIMEOUT
    ) -> Future[Message]:
        """
        Call a service and return the future of its response.

        The future has the exception :class:`DriverSilent` if there is no answer in time.
        """
        client = self.client(kind, name)
        call = _PendingCall(
            client=client, request=request, service=self.own_name(name), timeout=timeout
        )
        with self._lock:
            self._calls.append(call)
        self._look_at(call)
        return call.future

    def close(self) -> None:
        """Fail all pending and later calls."""
        for callback in self._on_close:
            callback()
        self._is_closed = True
        self._look_at_calls()

    def call(
        self, kind: Any, name: str, request: Message, timeout: float = ANSWER_TIMEOUT
    ) -> Future[ServiceAnswer]:
        """Call a service with ``success`` and ``message``; the future always gets an answer."""
        answer: Future[ServiceAnswer] = Future()

        def finish(done: Future[Message]) -> None:
            try:
                response = done.result()
            except DriverSilent as error:
                answer.set_result(ServiceAnswer(ok=False, text=str(error)))
            else:
                answer.set_result(ServiceAnswer(ok=response.success, text=response.message))

        self.request(kind, name, request, timeout).add_done_callback(finish)
        return answer

    def warn(self, text: str) -> None:
        """Log a failure that no response can carry."""
        self.node.get_logger().warning(text)

    def _keep_status(self, message: DriverStatus) -> None:
        self._status, self._status_time = message, monotonic()
        for callback in self._on_status:
            callback(message)

    def _keep_io_states(self, message: IOStates) -> None:
        self.io_states = message

    def _look_at_calls(self) -> None:
        with self._lock:
            self._calls = [call for call in self._calls if not call.future.done()]
            calls = list(self._calls)
        for call in calls:
            self._look_at(call)

    def _look_at(self, call: _PendingCall) -> None:
        """Send a call when its service is there, or give it up when it is late."""
        if self._is_closed:
            _finish(call.future, DriverSilent('The node with the names of the UR driver ends.'))
        elif self._takes_for_sending(call):
            call.client.call_async(call.request).add_done_callback(
                lambda done: _finish(call.future, done.result())
            )
        elif monotonic() > call.deadline:
            text = f'The service {call.service} did not answer within {call.timeout:g} s.'
            if not call.is_sent:
                text = (
                    f'The service {call.service} does not exist; start the driver, or set the '
                    'parameter driver to the name of its node.'
                )
            _finish(call.future, DriverSilent(text))

    def _takes_for_sending(self, call: _PendingCall) -> bool:
        """Claim a call for this thread to send; False = it is sent, or its service is missing."""
        with self._lock:
            if call.is_sent or not call.client.service_is_ready():
                return False
            call.is_sent, call.deadline = True, monotonic() + call.timeout
            return True


def _finish(future: Future[Message], outcome: Message | DriverSilent) -> None:
    """Complete a future unless its call was given up meanwhile."""
    with suppress(InvalidStateError):
        if isinstance(outcome, DriverSilent):
            future.set_exception(outcome)
        else:
            future.set_result(outcome)
