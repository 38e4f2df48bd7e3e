# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The action server of rclpy, with goals that any thread can finish."""

from __future__ import annotations

from collections.abc import Callable
import contextlib
from typing import Any, TypeAlias

from rclpy.action.server import ActionServer
from rclpy.exceptions import InvalidHandle

from ur_cartesian_driver.goal_files.garbage import uncollected

GoalHandle: TypeAlias = Any


class DeferredActionServer(ActionServer):
    """
    An action server that gives the executor a task only when the outcome of a goal is known.

    rclpy passes every accepted goal to :meth:`notify_execute`, which creates a task that runs the
    callback to its end. Here the callback only starts the goal, and :meth:`finish` creates the
    task, from any thread.
    """

    _destroyed = False

    def take_data(self) -> Any:
        """
        Take a request without garbage collection.

        A large goal creates hundreds of thousands of objects, none of which is garbage. The
        collector would scan them repeatedly, for 40 % of the time, while no other thread can run.
        """
        with uncollected():
            return super().take_data()  # type: ignore[no-untyped-call]  # rclpy's

    def notify_execute(self, goal_handle: GoalHandle, execute_callback: Any) -> None:
        """Start a goal; rclpy has already set its state to EXECUTING."""
        (execute_callback or self._execute_callback)(goal_handle)

    def finish(self, goal_handle: GoalHandle, callback: Callable[[GoalHandle], Any]) -> None:
        """Make the executor call ``callback`` and send the result that it returns; thread-safe."""
        executor = self._node.executor
        if executor is None:  # the node is being destroyed
            return
        # An executor that has been shut down has no guard condition any more, or an invalid one.
        with contextlib.suppress(AttributeError, InvalidHandle):
            # A plain function and no coroutine, because Python warns if one is never awaited.
            executor.create_task(self._hand_over, goal_handle, callback)

    def _hand_over(self, goal_handle: GoalHandle, callback: Callable[[GoalHandle], Any]) -> None:
        if not self._destroyed:
            super().notify_execute(  # type: ignore[no-untyped-call]  # rclpy's
                goal_handle, callback
            )

    def destroy(self) -> None:
        """Destroy the server; it sends no more results."""
        self._destroyed = True
        super().destroy()  # type: ignore[no-untyped-call]  # rclpy's


def end_goal(goal_handle: GoalHandle, *, succeeded: bool, cancelled: bool = True) -> None:
    """
    Put a goal into its final state.

    :param cancelled: whether a requested cancel, if there is one, has ended the goal.
    """
    if succeeded:
        goal_handle.succeed()
    elif cancelled and goal_handle.is_cancel_requested:
        goal_handle.canceled()
    else:
        goal_handle.abort()
