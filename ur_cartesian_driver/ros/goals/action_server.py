# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The action: every goal from its acceptance to its result.

A goal is accepted at once and gets a thread of its own, in which it is converted, planned, waited
for and watched. The executor of the node sees it twice only: when it comes, and when its outcome
is there. So cancel requests, parameters and the heartbeat are served meanwhile, also by an
executor with a single thread.

The obvious form, a coroutine that awaits a future, is not used: executors of Jazzy poll a waiting
coroutine whenever they wake, and the one with several threads keeps an entry for every poll until
the coroutine ends. A motion of ten minutes beside a busy topic would slow the whole process down.
"""

from __future__ import annotations

from collections.abc import Callable
import contextlib
from dataclasses import replace
import threading
from typing import Any, TypeAlias

from rclpy.action.server import CancelResponse, RCLError
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.driver import Driver, MotionHandle
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import (
    Cancelled,
    DriverError,
    ErrorCode,
    GoalRefused,
    Preempted,
    RobotNotReady,
)
from ur_cartesian_driver.motion.events import Outcome, Progress
from ur_cartesian_driver.motion.goal import Goal
from ur_cartesian_driver.motion.plan import Plan
from ur_cartesian_driver.planning.request.validate import check
from ur_cartesian_driver.ros.goals.arm_arbiter import ArmArbiter, ArmRequest
from ur_cartesian_driver.ros.goals.deferred_action_server import DeferredActionServer
from ur_cartesian_driver.ros.messages.feedback_messages import (
    feedback_message,
    FeedbackFrame,
    result_message,
)
from ur_cartesian_driver.ros.messages.goal_conversion import (
    goal_from_message,
    nanoseconds,
    resolve_frames,
)
from ur_cartesian_driver.ros.parameters.node_parameters import Settings
from ur_cartesian_driver.ros.tf.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.ros.tf.tf_lookup import listen_to_tf

GoalHandle: TypeAlias = Any

#: How long the result of a goal is kept for clients that ask late [s]; the goal is kept with it.
RESULT_TIMEOUT = 60
#: How requests are queued.
REQUEST_QOS = QoSProfile(depth=1000, history=HistoryPolicy.KEEP_LAST)
#: So many goals may be under way, each with a thread and its points in memory.
MAX_GOALS = 100
#: How often a waiting goal looks at the node's clock, which may be a simulated one [s].
CLOCK_PERIOD = 0.05
#: How long rclpy may need from calling us about a cancel request to noting it [s].
CANCELING_TIMEOUT = 1.0
#: How long the end of a goal is waited for when the node is destroyed [s].
JOIN_TIMEOUT = 10.0

SHUTDOWN = 'The driver node is shutting down'


class CartesianActionServer:
    """Serves ``~/follow_cartesian_trajectory``; others open and close the driver."""

    def __init__(self, node: Node, driver: Driver, settings: Settings) -> None:
        """Start to serve."""
        self._node = node
        self._clock = node.get_clock()
        self._driver = driver
        self._settings = settings
        self._transforms = listen_to_tf(node, settings.node.tf_max_age)
        self._frames = settings.frames.with_transforms(self._transforms)
        self._joint_names = tuple(settings.planning.tf_prefix + name for name in JOINT_NAMES)
        #: Which of the goals may move the arm.
        self.arbiter = ArmArbiter()
        # Guards what follows: the goals that have not ended.
        self._lock = threading.Lock()
        self._runs: dict[bytes, GoalRun] = {}
        self._closing = False
        self._server: Any = DeferredActionServer(  # type: ignore[no-untyped-call]  # rclpy's
            node,
            FollowCartesianTrajectory,
            '~/follow_cartesian_trajectory',
            self._begin,
            # Of its own: goals and cancel requests are served while other callbacks run.
            callback_group=MutuallyExclusiveCallbackGroup(),
            cancel_callback=self._cancel,
            result_timeout=RESULT_TIMEOUT,
            # Requests that come in a burst wait here; beyond the depth they would be lost.
            goal_service_qos_profile=REQUEST_QOS,
            result_service_qos_profile=REQUEST_QOS,
            cancel_service_qos_profile=REQUEST_QOS,
        )

    @property
    def frames(self) -> Frames:
        """The frames in which goals are given; also those of tf2."""
        return self._frames

    @property
    def idle(self) -> bool:
        """Tell whether every accepted goal has its result."""
        with self._lock:
            return not self._runs

    def find_run(self, key: bytes) -> GoalRun | None:
        """Return the run of a goal that has not ended, by the bytes of its id."""
        with self._lock:
            return self._runs.get(key)

    def stop(self) -> None:
        """Stop the arm, end all goals and take no new ones; returns at once."""
        with self._lock:
            self._closing = True
            runs = list(self._runs.values())
        for run in runs:
            run.shut_down()

    def close(self) -> None:
        """End all goals and their threads, and stop serving."""
        self.stop()
        with self._lock:
            runs = list(self._runs.values())
        for run in runs:
            run.thread.join(JOIN_TIMEOUT)
        self._server.destroy()
        if self._transforms is not None:
            self._transforms.close()

    # ---- called by the executor ---------------------------------------------------------------

    def _begin(self, handle: GoalHandle) -> None:
        """Give an accepted goal its thread."""
        run = GoalRun(self, handle, received=self._clock.now().nanoseconds)
        if not (run.is_scheduled or handle.request.validate_only):
            self.arbiter.enqueue(run.arm_request)  # here, where goals come one after the other
        with self._lock:
            is_over_limit = len(self._runs) >= MAX_GOALS
            if not is_over_limit:
                self._runs[run.key] = run
            if self._closing:
                run.shut_down()
        if is_over_limit:
            self.finish_run(
                run,
                Outcome(
                    code=ErrorCode.ROBOT_NOT_READY,
                    text=(
                        f'{MAX_GOALS} goals are being planned, wait or run; send this one again '
                        'when some of them have ended.'
                    ),
                ),
            )
        else:
            run.thread.start()

    def _cancel(self, handle: GoalHandle) -> CancelResponse:
        """Let every goal be cancelled that has not ended."""
        with self._lock:
            run = self._runs.get(_key(handle))
        if run is not None:
            run.cancel()
        return CancelResponse.ACCEPT

    def _finish(self, run: GoalRun, outcome: Outcome) -> FollowCartesianTrajectory.Result:
        """Bring a goal into its last state and return its result."""
        try:
            if outcome.succeeded:
                run.handle.succeed()
            elif outcome.code is ErrorCode.CANCELLED and run.handle.is_cancel_requested:
                run.handle.canceled()
            else:
                run.handle.abort()
        finally:
            with self._lock:
                self._runs.pop(run.key, None)
        return result_message(outcome)

    # ---- called by the threads of the goals ---------------------------------------------------

    def convert_goal(self, run: GoalRun) -> Goal:
        """Return the goal of a run, in our own terms."""
        return goal_from_message(
            run.handle.request,
            self._frames,
            now=run.received,
            snapshot=self._snapshot(),
            time_tolerance=self._settings.node.goal_time_tolerance,
        )

    def resolve_frames(self, run: GoalRun, goal: Goal) -> Goal:
        """Return a goal with its frames where they are now: the arm may have moved since."""
        return resolve_frames(
            goal,
            run.handle.request.trajectory,
            self._frames,
            now=self._clock.now().nanoseconds,
            snapshot=self._snapshot(),
        )

    def _snapshot(self) -> ArmSnapshot | None:
        state = self._driver.rest_state
        return None if state is None else ArmSnapshot.of(state)

    def plan(self, goal: Goal) -> Plan:
        """Plan from where the arm stands, or would stand if it were stopped now."""
        return self._driver.plan(goal)

    def wait(self, until: int, abort_requested: threading.Event) -> None:
        """Wait for a time of the node's clock [ns]."""
        while (remaining := until - self._clock.now().nanoseconds) > 0:
            if abort_requested.wait(min(remaining / 1_000_000_000, CLOCK_PERIOD)):
                return

    @property
    def is_preempting(self) -> bool:
        """Tell whether a new goal takes the place of the one that runs."""
        return self._settings.node.on_new_goal == 'preempt'

    def acquire_if_free(self, run: GoalRun, goal: Goal) -> None:
        """
        Give the arm to a goal where none has it.

        :raises GoalRefused: another goal has it; if this one is malformed, that is said instead.
        """
        if self.arbiter.acquire(run.arm_request):
            return
        check(goal, self._settings.planning)
        holder = self.arbiter.holder
        other = (
            'Another goal is'
            if not holder or holder.startswith('goal ')
            else f'{holder.capitalize()} is'
        )
        raise RobotNotReady(
            f'{other} running and on_new_goal is reject; wait for its end or '
            'cancel it, then send this goal again.'
        )

    def preempt_others(self, run: GoalRun) -> None:
        """
        Have the goal that runs make way for this one, which has passed its checks; wait for it.

        :raises RobotNotReady: the robot could not follow; the goal that runs goes on.
        """
        if self.arbiter.is_held():
            self._driver.check_can_preempt()
        self.arbiter.preempt(run.arm_request)

    def start(self, plan: Plan, on_progress: Callable[[Progress], None]) -> MotionHandle:
        """Set the arm in motion."""
        return self._driver.start(plan, on_progress)

    def finish_run(self, run: GoalRun, outcome: Outcome) -> None:
        """Give the arm free, and the outcome to the executor."""
        self.arbiter.release(run.arm_request)
        self._server.finish(run.handle, lambda handle: self._finish(run, outcome))

    def feedback_frame(self, run: GoalRun, plan: Plan) -> FeedbackFrame:
        """Return what all feedback of a goal has in common."""
        trajectory, frames = run.handle.request.trajectory, self._frames
        return FeedbackFrame(
            frame_id=trajectory.header.frame_id or frames.base,
            controlled_frame=trajectory.controlled_frame or frames.tcp,
            T_frame_base=plan.goal.T_base_frame.inverse(),
            joint_names=self._joint_names,
        )

    def publish_feedback(self, run: GoalRun, progress: Progress, frame: FeedbackFrame) -> None:
        """Send one report; publishing is safe from any thread."""
        message = feedback_message(progress, frame, self._clock.now().to_msg())
        # When the node or all of ROS is shutting down, the motion hears of it in another way.
        with contextlib.suppress(InvalidHandle, RCLError):
            run.handle.publish_feedback(message)


class GoalRun:
    """One goal, from its acceptance to its outcome, in a thread of its own."""

    def __init__(self, server: CartesianActionServer, handle: GoalHandle, received: int) -> None:
        """
        Make a run; its thread is still to be started.

        :param received: time of the node's clock [ns].
        """
        self.handle = handle
        self.key = _key(handle)
        self.received = received
        #: When it is to start [ns]; 0 = at once.
        self.start_time = nanoseconds(handle.request.trajectory.header.stamp)
        self.arm_request = ArmRequest(f'goal {self.key.hex()[:8]}', self._preempt_motion)
        self.thread = threading.Thread(target=self._run, name=self.arm_request.name, daemon=True)
        self._server = server
        self._lock = threading.Lock()
        self._motion: MotionHandle | None = None
        #: Set when the motion has begun, or never will.
        self._begun = threading.Event()
        #: Whether it waits for its time.
        self.is_waiting = self.is_scheduled
        #: The last request for more points that was granted, and its response.
        self.last_append: tuple[object, Any] | None = None
        self._abort_requested = threading.Event()
        self._cancel_requested = False

    @property
    def is_scheduled(self) -> bool:
        """Tell whether its time is still to come when it is received."""
        return self.start_time > self.received

    def motion(self, timeout: float) -> MotionHandle | None:
        """Return its motion, waiting for its begin; None: there is none [s]."""
        self._begun.wait(timeout)
        return self._motion

    @property
    def points(self) -> int:
        """How many points it has, where it may have more."""
        motion = self._motion
        return motion.appender.points if motion is not None and motion.appender else 0

    def cancel(self) -> None:
        """Stop, because the client wants it."""
        self._cancel_requested = True
        self._abort()

    def shut_down(self) -> None:
        """Stop, because the node ends."""
        self._abort()

    def _abort(self) -> None:
        with self._lock:
            self._abort_requested.set()
            motion = self._motion
        self._server.arbiter.withdraw(self.arm_request)
        if motion is not None:
            motion.cancel()

    def _preempt_motion(self) -> None:
        """Stop for a newer goal."""
        with self._lock:
            motion = self._motion
        if motion is not None:
            motion.preempt(self.arm_request.preempted_by)

    def _run(self) -> None:
        try:
            outcome = self._process()
        except DriverError as error:
            outcome = Outcome(code=error.code, text=self._refusal_text(error))
        except Exception as error:
            # A goal always ends with a result; the traceback goes the way of all threads.
            self._server.finish_run(
                self,
                Outcome(
                    code=ErrorCode.EXECUTION_FAILED,
                    text=f'The driver has a defect, {type(error).__name__}: {error}; its log says '
                    'more.',
                ),
            )
            raise
        finally:
            self._begun.set()
        if outcome.code is ErrorCode.CANCELLED and self._cancel_requested:
            self._wait_for_canceling_state()
        self._server.finish_run(self, outcome)

    def _process(self) -> Outcome:
        server, request = self._server, self.handle.request
        goal = server.convert_goal(self)
        if request.validate_only:
            return Outcome(
                code=ErrorCode.SUCCESSFUL,
                text='The goal passed all checks.',
                report=self._require_wanted(server.plan(goal)).report,
            )
        if self.is_scheduled:
            self._require_wanted(server.plan(goal))
            server.wait(self.start_time, self._abort_requested)
            self.is_waiting = False
            self._check_wanted()
            server.arbiter.enqueue(self.arm_request)
            goal = replace(goal, age=0.0)
        return self._execute(
            self._plan_preempting(goal) if server.is_preempting else self._plan_if_free(goal)
        )

    def _plan_if_free(self, goal: Goal) -> Plan:
        """Return the plan of a goal that runs if no other one does."""
        self._server.acquire_if_free(self, goal)
        return self._plan_goal(goal)

    def _plan_preempting(self, goal: Goal) -> Plan:
        """
        Return the plan of a goal for which others make way, when they have.

        It is checked first from where the arm would come to rest: refused, it has disturbed
        nobody. When the arm has been somebody else's since it is planned again from where it is.
        """
        server = self._server
        release_count = server.arbiter.release_count
        plan = self._plan_goal(goal)
        server.preempt_others(self)
        self._check_wanted()
        return plan if server.arbiter.release_count == release_count else self._plan_goal(goal)

    def _plan_goal(self, goal: Goal) -> Plan:
        return self._require_wanted(self._server.plan(self._server.resolve_frames(self, goal)))

    def _require_wanted(self, plan: Plan) -> Plan:
        """
        Return a plan that is still wanted.

        :raises ExecutionEnded: see :meth:`_check_wanted`.
        """
        self._check_wanted()
        return plan

    def _check_wanted(self) -> None:
        """
        See that the goal is still wanted.

        :raises Cancelled: it was given up meanwhile.
        :raises Preempted: a newer one has taken its place.
        """
        if self._abort_requested.is_set():
            raise self._cancellation('before anything moved')
        if preempted_by := self.arm_request.preempted_by:
            raise Preempted(
                f'{preempted_by.capitalize()} took the place of this one before anything moved.'
            )

    def _execute(self, plan: Plan) -> Outcome:
        server = self._server
        frame = server.feedback_frame(self, plan)
        motion = server.start(
            plan, lambda progress: server.publish_feedback(self, progress, frame)
        )
        with self._lock:
            self._motion = motion
            abort_requested = self._abort_requested.is_set()
        self._begun.set()
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

    def _refusal_text(self, error: DriverError) -> str:
        """Return what to say of a refusal; also that another goal had to go for nothing."""
        preempted = self.arm_request.preempted
        if not (isinstance(error, GoalRefused) and preempted):
            return str(error)
        return (
            f'{error} The goal had passed all checks from where the arm was expected to come '
            f'to rest, so {preempted} has made way for it and is over.'
        )

    def _cancellation(self, when: str) -> Cancelled:
        if self._cancel_requested:
            return Cancelled(f'The goal was cancelled {when}.')
        return Cancelled(f'{SHUTDOWN}: the goal ended {when}.')

    def _wait_for_canceling_state(self) -> None:
        """
        Wait until rclpy knows that the goal is being cancelled.

        It asks us first and changes the goal's state then, maybe in another thread; before that
        the goal cannot become CANCELED.
        """
        tick = threading.Event()
        for _ in range(int(CANCELING_TIMEOUT / 0.001)):
            if self.handle.is_cancel_requested:
                return
            tick.wait(0.001)


def _key(handle: GoalHandle) -> bytes:
    return bytes(handle.goal_id.uuid)
