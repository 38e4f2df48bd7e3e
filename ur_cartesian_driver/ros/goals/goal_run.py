# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
One accepted goal, from its acceptance to its outcome, in a thread of its own.

A run converts the goal, plans it, waits for its start time and for the arm, and follows the
motion. The threads of the node's executor handle a goal only twice: when it is accepted, and when
its outcome is known.
"""

from __future__ import annotations

from collections.abc import Callable
import contextlib
from dataclasses import replace
import threading
from typing import Any

from ur_cartesian_driver.driver import MotionHandle
from ur_cartesian_driver.motion.errors import (
    Cancelled,
    CollisionPredicted,
    DriverError,
    ErrorCode,
    GoalRefused,
    Preempted,
    RobotNotReady,
)
from ur_cartesian_driver.motion.events import Outcome, Progress
from ur_cartesian_driver.motion.goal.joint_goal import JointGoal
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.planning.request.joint_goal_rules import check_joint_goal
from ur_cartesian_driver.planning.request.validate import check
from ur_cartesian_driver.ros.goals.arm_arbiter import ArmRequest
from ur_cartesian_driver.ros.goals.deferred_action_server import GoalHandle
from ur_cartesian_driver.ros.goals.goal_actions import AnyGoal, GoalAction
from ur_cartesian_driver.ros.goals.goal_context import GoalContext
from ur_cartesian_driver.ros.message_fields import nanoseconds
from ur_cartesian_driver.ros.node_endpoints import SHUT_DOWN_ERRORS

#: Period of the reads of the node's clock while a goal waits for its start time [s]; the clock
#: may be a simulated one.
CLOCK_PERIOD = 0.05
#: Longest wait for rclpy to change a goal's state to CANCELING after its cancel callback [s].
CANCELING_TIMEOUT = 1.0

SHUTDOWN = 'The driver node is shutting down'


class GoalRun:
    """One goal, from its acceptance to its outcome."""

    def __init__(
        self,
        handle: GoalHandle,
        action: GoalAction,
        context: GoalContext,
        on_end: Callable[[GoalRun, Outcome], None],
    ) -> None:
        """
        Make a run, whose thread the caller has to start.

        :param on_end: called with this run and the outcome, in the thread of the run.
        """
        self.handle, self.action = handle, action
        self.key = goal_key(handle)
        self._context = context
        self._on_end = on_end
        self._received = context.now()
        #: The start time of the motion [ns]; 0 = at once.
        self._start_time = nanoseconds(handle.request.trajectory.header.stamp)
        self.arm_request = ArmRequest(f'goal {self.key.hex()[:8]}', self._preempt_motion)
        self.thread = threading.Thread(target=self._run, name=self.arm_request.name, daemon=True)
        #: Whether the goal waits for its start time.
        self.is_waiting = self.is_scheduled
        #: Key and response of the last accepted append request, so that a repetition of the
        #: request gets the same response.
        self.last_append: tuple[object, Any] | None = None
        self._lock = threading.Lock()
        self._motion: MotionHandle | None = None
        #: Set when the motion has begun, or will never begin.
        self._begun = threading.Event()
        self._abort_requested = threading.Event()
        self._cancel_requested = False

    @property
    def is_scheduled(self) -> bool:
        """Whether the start time was in the future when the goal was received."""
        return self._start_time > self._received

    @property
    def is_moving(self) -> bool:
        """Whether the goal moves the arm."""
        motion = self._motion
        return motion is not None and not motion.done()

    @property
    def is_starting(self) -> bool:
        """Whether the goal moves the arm as soon as it is planned and the arm is free."""
        return not (
            self._begun.is_set()
            or self.is_waiting
            or self.action.is_validation(self.handle.request)
        )

    @property
    def points(self) -> int:
        """The number of points of a goal with keep_open; 0 = no keep_open, or no motion yet."""
        motion = self._motion
        return motion.appender.points if motion is not None and motion.appender else 0

    def motion(self, timeout: float) -> MotionHandle | None:
        """Wait up to ``timeout`` [s] for the motion and return it; None if it has not begun."""
        self._begun.wait(timeout)
        return self._motion

    def cancel(self) -> None:
        """End the goal because its client cancels it."""
        self._cancel_requested = True
        self.abort()

    def abort(self) -> None:
        """End the goal; if its motion has begun, stop the arm."""
        with self._lock:
            self._abort_requested.set()
            motion = self._motion
        self._context.arbiter.withdraw(self.arm_request)
        if motion is not None:
            motion.cancel()

    def _preempt_motion(self) -> None:
        with self._lock:
            motion = self._motion
        if motion is not None:
            motion.preempt(self.arm_request.preempted_by)

    # ---- in the thread of the run -------------------------------------------------------------

    def _run(self) -> None:
        try:
            outcome = self._process()
        except DriverError as error:
            outcome = Outcome(code=error.code, text=self._refusal_text(error))
        except Exception as error:
            # A goal always ends with a result; the thread prints the traceback.
            self._end_motion()
            text = f'The driver has a defect, {type(error).__name__}: {error}; its log says more.'
            self._on_end(self, Outcome(code=ErrorCode.EXECUTION_FAILED, text=text))
            raise
        finally:
            self._begun.set()
        if outcome.code is ErrorCode.CANCELLED and self._cancel_requested:
            self._wait_for_canceling_state()
        self._on_end(self, outcome)

    def _end_motion(self) -> None:
        """Stop the arm and wait for its rest, before another goal can get it."""
        if self._motion is not None:
            self._motion.cancel()
            self._motion.result()

    def _process(self) -> Outcome:
        context, request = self._context, self.handle.request
        goal = self.action.goal(request, context, self._received)
        if self.action.is_validation(request):
            plan = self._plan(goal)
            context.show(plan)
            return Outcome(
                code=ErrorCode.SUCCESSFUL,
                text='The goal passed all checks.',
                report=plan.short_report(),
            )
        if self.is_scheduled:
            self._plan(goal)
            self._wait_for_start_time()
            context.arbiter.enqueue(self.arm_request)
            goal = replace(goal, age=0.0)
        if context.settings.node.on_new_goal == 'preempt':
            return self._execute(self._plan_and_preempt(goal))
        return self._execute(self._plan_if_free(goal))

    def _wait_for_start_time(self) -> None:
        while (remaining := self._start_time - self._context.now()) > 0:
            if self._abort_requested.wait(min(remaining / 1_000_000_000, CLOCK_PERIOD)):
                break
        self.is_waiting = False
        self._check_wanted()

    def _plan_if_free(self, goal: AnyGoal) -> Plan:
        """
        Acquire the arm and plan the goal.

        :raises GoalRefused: the goal is malformed, the arm is not free, or planning refuses the
            goal. These are checked in this order, so a malformed goal is reported as such even if
            the arm is not free.
        """
        arbiter = self._context.arbiter
        if not arbiter.acquire(self.arm_request):
            if isinstance(goal, JointGoal):
                check_joint_goal(goal, self._context.driver.options)
            else:
                check(goal, self._context.driver.options)
            holder = arbiter.holder
            other = (
                'Another goal is'
                if not holder or holder.startswith('goal ')
                else f'{holder.capitalize()} is'
            )
            raise RobotNotReady(
                f'{other} running and on_new_goal is reject; wait for its end or '
                'cancel it, then send this goal again.'
            )
        return self._plan_from_here(goal)

    def _plan_and_preempt(self, goal: AnyGoal) -> Plan:
        """
        Plan the goal, preempt older goals, and return the plan.

        The goal is first planned from the position where the arm would come to rest if it stopped
        now, so that a refused goal disturbs no other one. It is planned again if another goal has
        moved the arm meanwhile.

        :raises GoalRefused: the goal is refused, or the running motion cannot be preempted.
        """
        arbiter = self._context.arbiter
        release_count = arbiter.release_count
        plan = self._plan_from_here(goal)
        if arbiter.holder:
            self._context.driver.check_can_preempt()
        arbiter.preempt(self.arm_request)
        self._check_wanted()
        if arbiter.release_count == release_count:
            return plan
        del plan  # a long plan takes 100 MB or more, and so will the next one
        return self._plan_from_here(goal)

    def _plan_from_here(self, goal: AnyGoal) -> Plan:
        """Plan a goal with the present poses of its frames, which may have moved meanwhile."""
        return self._plan(self.action.resolved(goal, self.handle.request, self._context))

    def _plan(self, goal: AnyGoal) -> Plan:
        try:
            plan = self._context.driver.plan(goal)
        except CollisionPredicted as refusal:
            self._context.show_refusal(refusal)
            raise
        self._check_wanted()
        return plan

    def _check_wanted(self) -> None:
        """
        Check that the goal was neither aborted nor preempted meanwhile.

        :raises ExecutionEnded: the goal was aborted or preempted.
        """
        if self._abort_requested.is_set():
            raise self._cancellation('before anything moved')
        if preempted_by := self.arm_request.preempted_by:
            raise Preempted(
                f'{preempted_by.capitalize()} took the place of this one before anything moved.'
            )

    def _execute(self, plan: Plan) -> Outcome:
        # Feedback and markers show the renewed plan, which is the one that is executed.
        try:
            plan = self._context.driver.renewed(plan)
            motion = self._context.driver.start(plan, self._feedback_publisher(plan))
        except CollisionPredicted as refusal:
            self._context.show_refusal(refusal)
            raise
        with self._lock:
            self._motion = motion
            abort_requested = self._abort_requested.is_set()
        self._begun.set()
        self._context.show(plan)  # while the arm moves, as showing a long plan takes time
        del plan  # a long plan takes much memory
        if abort_requested:
            motion.cancel()
        elif self.arm_request.preempted_by:
            motion.preempt(self.arm_request.preempted_by)
        outcome = motion.result()
        if (
            outcome.code is ErrorCode.CANCELLED
            and not self._cancel_requested
            and self._abort_requested.is_set()
        ):
            return replace(outcome, text=str(self._cancellation('and the arm was stopped')))
        return outcome

    def _feedback_publisher(self, plan: Plan) -> Callable[[Progress], None]:
        """Return the function that publishes feedback, from any thread."""
        make = self.action.feedback_of(self.handle.request, plan, self._context)

        def publish(progress: Progress) -> None:
            # A client may react to the first feedback, so motion() must return the motion by then.
            # This wait cannot delay the start of the motion, because the driver holds no lock here
            # and has already sent the whole request to start.
            self._begun.wait()
            message = make(progress)
            # Ignore that the node, or all of ROS, is shutting down, which cancels the motion.
            with contextlib.suppress(*SHUT_DOWN_ERRORS):
                self.handle.publish_feedback(message)

        return publish

    def _refusal_text(self, error: DriverError) -> str:
        """Return the text of an error; a refusal also names the goal that was preempted for it."""
        preempted = self.arm_request.preempted
        if not (isinstance(error, GoalRefused) and preempted):
            return str(error)
        return (
            f'{error} The goal had passed all checks from where the arm was expected to come '
            f'to rest, so it preempted {preempted}, which is over.'
        )

    def _cancellation(self, when: str) -> Cancelled:
        if self._cancel_requested:
            return Cancelled(f'The goal was cancelled {when}.')
        return Cancelled(f'{SHUTDOWN}: the goal ended {when}.')

    def _wait_for_canceling_state(self) -> None:
        """
        Wait until rclpy has put the goal into the state CANCELING.

        rclpy calls the cancel callback first and changes the state afterwards, possibly in another
        thread. Until the state has changed, the goal cannot become CANCELED.
        """
        tick = threading.Event()
        for _ in range(int(CANCELING_TIMEOUT / 0.001)):
            if self.handle.is_cancel_requested:
                return
            tick.wait(0.001)


def goal_key(handle: GoalHandle) -> bytes:
    """Return the bytes of a goal's id."""
    return bytes(handle.goal_id.uuid)
