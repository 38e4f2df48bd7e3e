# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``~/detect_tool_contact``: a watch for contact, beside the goals that move the arm."""

from __future__ import annotations

from concurrent.futures import Future
from typing import Any

from rclpy.action.server import CancelResponse
from rclpy.node import Node

from ur_cartesian_driver.action import DetectToolContact
from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.robot.services.service_calls import EndContactWatchCall, ServiceAnswer
from ur_cartesian_driver.ros.goals.deferred_action_server import DeferredActionServer, end_goal


class ContactAction:
    """Each goal is one watch; a goal sent while another one watches is aborted."""

    def __init__(self, node: Node, driver: Driver) -> None:
        """Start to serve."""
        self._driver = driver
        #: The goal that watches; None = none.
        self._watching: Any = None
        self._server = DeferredActionServer(  # type: ignore[no-untyped-call]  # rclpy's
            node,
            DetectToolContact,
            '~/detect_tool_contact',
            self._begin,
            cancel_callback=self._cancel,
        )

    @property
    def idle(self) -> bool:
        """Return whether no goal watches."""
        return self._watching is None

    def stop(self) -> None:
        """End the watch; its goal gets a result."""
        if not self.idle:
            self._driver.call(EndContactWatchCall())

    def close(self) -> None:
        """Stop serving; a running watch ends when the driver is closed."""
        self._server.destroy()

    def _begin(self, handle: Any) -> None:
        if not self.idle:
            text = 'Another goal watches for contact; cancel it first.'
            self._server.finish(handle, lambda handle: _end(handle, False, text))
            return
        self._watching = handle

        def on_answer(done: Future[ServiceAnswer]) -> None:
            self._server.finish(handle, lambda handle: self._finish(handle, done.result()))

        self._driver.watch_contact().add_done_callback(on_answer)

    def _cancel(self, handle: Any) -> CancelResponse:
        if not self.idle and self._watching.goal_id == handle.goal_id:
            self.stop()
        return CancelResponse.ACCEPT

    def _finish(self, handle: Any, answer: ServiceAnswer) -> Any:
        self._watching = None
        return _end(handle, answer.ok, answer.text)


def _end(handle: Any, success: bool, text: str) -> Any:
    end_goal(handle, succeeded=success)
    return DetectToolContact.Result(success=success, message=text)
