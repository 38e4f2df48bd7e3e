# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The action server of rclpy, but for when the executor hears of a goal."""

from __future__ import annotations

from collections.abc import Callable
import gc
from typing import Any, TypeAlias

from rclpy.action.server import ActionServer

GoalHandle: TypeAlias = Any


class DeferredActionServer(ActionServer):
    """
    An action server whose goals come to the executor when their outcome is there.

    rclpy hands every accepted goal to :meth:`notify_execute`, which gives the executor a task that
    waits for the callback. Here the callback begins the goal at once, and the task comes with
    :meth:`finish`, from whatever thread.
    """

    _destroyed = False

    def take_data(self) -> Any:
        """
        Take a request without a garbage collection in between.

        A large goal makes hundreds of thousands of objects, none of which is garbage, and the
        collector would walk through them again and again: 40 % of the time, in which no other
        thread runs.
        """
        enabled = gc.isenabled()
        gc.disable()
        try:
            return super().take_data()  # type: ignore[no-untyped-call]  # rclpy's
        finally:
            if enabled:
                gc.enable()

    def notify_execute(self, goal_handle: GoalHandle, execute_callback: Any) -> None:
        """Begin a goal; it is in the state EXECUTING."""
        (execute_callback or self._execute_callback)(goal_handle)

    def finish(self, goal_handle: GoalHandle, callback: Callable[[GoalHandle], Any]) -> None:
        """Let the executor call back for the result and send it; from any thread."""
        executor = self._node.executor
        if executor is not None:  # None: nobody is left to send it
            # A plain function first: a coroutine that no executor runs any more would complain.
            executor.create_task(self._hand_over, goal_handle, callback)

    def _hand_over(self, goal_handle: GoalHandle, callback: Callable[[GoalHandle], Any]) -> None:
        if not self._destroyed:
            super().notify_execute(  # type: ignore[no-untyped-call]  # rclpy's
                goal_handle, callback
            )

    def destroy(self) -> None:
        """Send no more results."""
        self._destroyed = True
        super().destroy()  # type: ignore[no-untyped-call]  # rclpy's
