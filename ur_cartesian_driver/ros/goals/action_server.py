# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The action servers: they accept each goal at once and give it a :class:`GoalRun` with a thread.

The node's executor handles a goal when it is accepted and when its outcome is known. In between,
the executor serves cancel requests, parameters and the heartbeat, even with a single thread.

A coroutine that awaits a future would be the usual design. But executors of Jazzy poll a waiting
coroutine whenever they wake, and the multi-threaded one keeps an entry for each poll until the
coroutine ends. With a busy topic, a motion of ten minutes would slow down the whole process.
"""

from __future__ import annotations

from functools import partial
from itertools import chain
import threading
from typing import Any

from rclpy.action.server import CancelResponse
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile

from ur_cartesian_driver.driver import Driver, MotionHandle
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import Outcome
from ur_cartesian_driver.motion.goal.known_frames import Frames
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.ros.goals.arm_arbiter import ArmArbiter
from ur_cartesian_driver.ros.goals.cell_marker_publisher import CellMarkerPublisher
from ur_cartesian_driver.ros.goals.deferred_action_server import (
    DeferredActionServer,
    end_goal,
    GoalHandle,
)
from ur_cartesian_driver.ros.goals.goal_actions import GoalAction, installed_actions
from ur_cartesian_driver.ros.goals.goal_context import GoalContext
from ur_cartesian_driver.ros.goals.goal_run import goal_key, GoalRun
from ur_cartesian_driver.ros.goals.plan_marker_publisher import PlanMarkerPublisher
from ur_cartesian_driver.ros.message_fields import Message
from ur_cartesian_driver.ros.parameters.node_parameters import Settings
from ur_cartesian_driver.ros.tf.tf_lookup import listen_to_tf

#: How long a goal and its result are kept, for clients that ask for the result late [s].
RESULT_TIMEOUT = 60
#: A burst of requests is queued; requests beyond the depth would be lost.
REQUEST_QOS = QoSProfile(depth=1000, history=HistoryPolicy.KEEP_LAST)
#: Largest number of goals under way, each with a thread and its points in memory.
MAX_GOALS = 100
#: How long the node waits for the end of each goal when the node is destroyed [s].
JOIN_TIMEOUT = 10.0


class GoalServer:
    """Serves the actions of a node; the driver is opened and closed by the node."""

    def __init__(self, node: Node, driver: Driver, settings: Settings) -> None:
        """Start to serve."""
        self._transforms = listen_to_tf(node, settings.node.tf_max_age)
        self._plan_markers = PlanMarkerPublisher(node, settings.frames.base)
        #: Publishes the cell; the code that changes the cell calls it.
        self.cell_markers = CellMarkerPublisher(node, driver)
        self._context = GoalContext(
            driver=driver,
            arbiter=ArmArbiter(),
            frames=settings.frames.with_transforms(self._transforms),
            clock=node.get_clock(),
            settings=settings,
            show=self._show,
            show_refusal=self.cell_markers.publish,
        )
        # Guards ``_closing`` and ``_runs``.
        self._lock = threading.Lock()
        self._logger: Any = node.get_logger()
        #: The goals that have not ended, by their ids.
        self._runs: dict[bytes, GoalRun] = {}
        self._closing = False
        self._servers: dict[str, Any] = {
            action.name: self._serve(node, action) for action in installed_actions()
        }

    def _show(self, plan: Plan) -> None:
        self._plan_markers.publish(plan)
        self.cell_markers.forget_refusal()

    def _serve(self, node: Node, action: GoalAction) -> DeferredActionServer:
        return DeferredActionServer(  # type: ignore[no-untyped-call]  # rclpy's
            node,
            action.action_type,
            action.name,
            partial(self._begin, action),
            # A group of its own: with more threads, goals are served while other callbacks run.
            callback_group=MutuallyExclusiveCallbackGroup(),
            cancel_callback=self._cancel,
            result_timeout=RESULT_TIMEOUT,
            goal_service_qos_profile=REQUEST_QOS,
            result_service_qos_profile=REQUEST_QOS,
            cancel_service_qos_profile=REQUEST_QOS,
        )

    @property
    def arbiter(self) -> ArmArbiter:
        """The arbiter, which decides which goal or session may move the arm."""
        return self._context.arbiter

    @property
    def frames(self) -> Frames:
        """The frames that goals can name, including frames of tf2."""
        return self._context.frames

    @property
    def idle(self) -> bool:
        """Whether every accepted goal has its result."""
        with self._lock:
            return not self._runs

    @property
    def running_motion(self) -> MotionHandle | None:
        """The running motion; None if no goal moves the arm."""
        run = self.running_goal
        return run.motion(timeout=0.0) if run is not None and run.is_moving else None

    @property
    def running_goal(self) -> GoalRun | None:
        """The goal that moves the arm, or else the newest one that is about to; None: neither."""
        with self._lock:
            runs = list(self._runs.values())
        moving = (run for run in runs if run.is_moving)
        starting = (run for run in reversed(runs) if run.is_starting)
        return next(chain(moving, starting), None)

    def find_run(self, goal_id: bytes) -> GoalRun | None:
        """Return the run of a goal; None if the goal has ended."""
        with self._lock:
            return self._runs.get(goal_id)

    def stop(self) -> None:
        """Stop the arm, and abort all goals, present and future; does not block."""
        with self._lock:
            self._closing = True
            runs = list(self._runs.values())
        for run in runs:
            run.abort()

    def close(self) -> None:
        """End all goals and their threads, and stop serving."""
        self.stop()
        with self._lock:
            runs = list(self._runs.values())
        for run in runs:
            run.thread.join(JOIN_TIMEOUT)
        for server in self._servers.values():
            server.destroy()
        if self._transforms is not None:
            self._transforms.close()

    def _begin(self, action: GoalAction, handle: GoalHandle) -> None:
        """Start the run of an accepted goal; called by the executor."""
        run = GoalRun(handle, action, self._context, self._finish)
        if not (run.is_scheduled or action.is_validation(handle.request)):
            self.arbiter.enqueue(run.arm_request)  # by the executor, in order of arrival
        with self._lock:
            is_over_limit = len(self._runs) >= MAX_GOALS
            if not is_over_limit:
                self._runs[run.key] = run
                run.thread.start()  # under the lock, because close() joins all threads it finds
            if self._closing:
                run.abort()
        if is_over_limit:
            text = f'{MAX_GOALS} goals have not ended yet; send this one again when some have.'
            self._finish(run, Outcome(code=ErrorCode.ROBOT_NOT_READY, text=text))

    def _cancel(self, handle: GoalHandle) -> CancelResponse:
        """Cancel a goal that has not ended; called by the executor."""
        run = self.find_run(goal_key(handle))
        if run is not None:
            run.cancel()
        return CancelResponse.ACCEPT

    def _finish(self, run: GoalRun, outcome: Outcome) -> None:
        """Release the arm and hand the outcome to the executor; from any thread."""
        self.arbiter.release(run.arm_request)
        server = self._servers[run.action.name]
        server.finish(run.handle, lambda _: self._end(run, outcome))

    def _end(self, run: GoalRun, outcome: Outcome) -> Message:
        """Put a goal into its final state and return its result; called by the executor."""
        try:
            end_goal(
                run.handle,
                succeeded=outcome.succeeded,
                cancelled=outcome.code is ErrorCode.CANCELLED,
            )
        finally:
            with self._lock:
                self._runs.pop(run.key, None)
        if not run.action.is_validation(run.handle.request):
            self._log_end(outcome)
        return run.action.result(outcome)

    def _log_end(self, outcome: Outcome) -> None:
        """Log the outcome of a goal."""
        text = f'goal: {outcome.code.name}: {outcome.text}'
        if outcome.succeeded or outcome.code is ErrorCode.CANCELLED:
            self._logger.info(text)
        else:
            self._logger.warning(text)
