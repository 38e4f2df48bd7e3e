# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The arm that is led while it moves: ``~/live_target``, ``~/servo_state``, ``~/freedrive_mode``.

Of a target the executor only puts the message down; a thread of its own looks at the newest one,
because a frame of tf2 may have to be waited for, and whoever sends faster than that is not to hold
up the node. What cannot be followed is ignored, with a warning that says why; the target before
counts until it is too old.

A session lines up for the arm as a goal does, but before all of them: any goal takes its place.

Whoever unlocks a robot and plays its program does not think of somebody who still sends targets.
So after a stop they are not followed before they have paused once.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, InvalidStateError
import contextlib
from math import inf
import threading
from time import monotonic
from typing import Any, TypeAlias

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from rclpy.action.server import RCLError
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from std_srvs.srv import SetBool

from ur_cartesian_driver.driver import Driver, MotionHandle
from ur_cartesian_driver.driver.live_session import check_pose, LiveSession
from ur_cartesian_driver.motion.errors import DriverError, ErrorCode, InvalidGoal, RobotNotReady
from ur_cartesian_driver.motion.events import Outcome
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.servo import ServoActivity, ServoReport
from ur_cartesian_driver.motion.state import SafetyStatus
from ur_cartesian_driver.msg import ServoState
from ur_cartesian_driver.robot.services.service_calls import ServiceAnswer
from ur_cartesian_driver.ros.goals.arm_arbiter import ArmArbiter, ArmRequest
from ur_cartesian_driver.ros.messages.feedback_messages import duration_message
from ur_cartesian_driver.ros.messages.goal_conversion import nanoseconds
from ur_cartesian_driver.ros.services.command_services import completed_answer, DeferredService
from ur_cartesian_driver.ros.tf.known_frames import ArmSnapshot, Frames

#: Generated message classes carry no types.
Message: TypeAlias = Any

#: The newest one counts, and one that was lost is not sent again.
TARGET_QOS = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
#: As the other topics that tell the state.
SERVO_STATE_QOS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
#: After these somebody has to look at the robot.
SAFETY_STOPS = (
    SafetyStatus.PROTECTIVE_STOPPED
    | SafetyStatus.SAFEGUARD_STOPPED
    | SafetyStatus.EMERGENCY_STOPPED
    | SafetyStatus.ROBOT_EMERGENCY_STOPPED
    | SafetyStatus.SYSTEM_EMERGENCY_STOPPED
    | SafetyStatus.VIOLATION
    | SafetyStatus.FAULT
)
#: How often the same kind of trouble is told, at most [s].
WARNING_PERIOD = 2.0
#: How long the end of a session is waited for when the node is destroyed [s].
JOIN_TIMEOUT = 10.0
SESSION_NAME = 'the session of live targets'


def pose_from_message(message: Message) -> Pose:
    """Return the pose of a ``PoseStamped`` as it is, in its frame."""
    p, q = message.pose.position, message.pose.orientation
    return Pose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def target_from_message(
    message: Message, frames: Frames, *, snapshot: ArmSnapshot | None, now: int, max_age: float
) -> tuple[Pose, float]:
    """
    Return where the TCP is to be in the robot's base, and how old that is [s].

    :param now: time of the node's clock [ns].
    :param max_age: how old, or how far in the future, a stamp may be [s].
    :raises InvalidGoal: the pose is malformed, its frame unknown, or the stamp is not of now.
    :raises RobotNotReady: the frame moves with the arm, and nobody knows where that stands.
    """
    pose = pose_from_message(message)
    check_pose(pose)
    stamp = nanoseconds(message.header.stamp)
    age = (now - stamp) / 1_000_000_000 if stamp else 0.0
    if abs(age) > max_age:
        raise InvalidGoal(
            'header.stamp',
            f'is {abs(age):.3f} s {"old" if age > 0.0 else "in the future"}, '
            f'live_target_max_age is {max_age:g} s',
            'compare the clocks of both computers, or leave the stamp 0: then the age counts '
            'from the receipt',
        )
    return frames.T_base_frame(message.header.frame_id, snapshot) @ pose, max(0.0, age)


def servo_state_message(report: ServoReport, stamp: Time) -> ServoState:
    """Return how the streaming of set-points is going."""
    message = ServoState(
        state=int(report.activity),
        setpoints_sent=report.setpoints_sent,
        setpoints_done=report.setpoints_done,
        buffer_size=report.buffer_size,
        buffer_capacity=report.buffer_capacity,
        buffered=duration_message(report.buffered),
        lag=report.lag,
        speed_scaling=report.speed_scaling,
        joint_error=report.joint_error,
        underruns=report.underruns,
        overruns=report.overruns,
        repeats=report.repeats,
        skipped=report.skipped,
    )
    message.header.stamp = stamp
    return message


class ServoStatePublisher:
    """Publishes what the robot loop tells of set-points, as often as it is asked for."""

    def __init__(self, node: Node, driver: Driver, rate: float) -> None:
        """
        Begin to publish.

        :param rate: at most so often [Hz], more than 0.
        """
        self._clock, self._period, self._due = node.get_clock(), 1.0 / rate, -inf
        self._topic = node.create_publisher(ServoState, '~/servo_state', SERVO_STATE_QOS)
        driver.add_servo_listener(self._publish)

    def _publish(self, report: ServoReport) -> None:
        """Publish, in the thread of the driver; the end of a stream in any case."""
        now = monotonic()
        if now < self._due and report.activity is not ServoActivity.IDLE:
            return
        self._due = max(self._due + self._period, now)
        # The node, or all of ROS, may have ended meanwhile.
        with contextlib.suppress(InvalidHandle, RCLError):
            self._topic.publish(servo_state_message(report, self._clock.now().to_msg()))


class FreedriveService:
    """``~/freedrive_mode``: lets a person guide the arm by hand, and ends that."""

    def __init__(self, node: Node, driver: Driver, arbiter: ArmArbiter) -> None:
        """Begin to serve."""
        self._driver, self._arbiter = driver, arbiter
        self._motion: MotionHandle | None = None
        self._lock = threading.Lock()
        self._service = DeferredService(
            node, SetBool, '~/freedrive_mode', self.handle, MutuallyExclusiveCallbackGroup()
        )

    @property
    def idle(self) -> bool:
        """Tell whether nobody guides the arm."""
        return self._motion is None

    def close(self) -> None:
        """Hold the arm again, and wait until it is; the service goes with the node."""
        motion = self._motion
        if motion is not None:
            motion.cancel()
            with contextlib.suppress(TimeoutError):
                motion.result(JOIN_TIMEOUT)

    def handle(self, request: Message) -> Future[ServiceAnswer]:
        """Begin or end it; the answer comes when the robot has done that, or cannot."""
        with self._lock:
            motion = self._motion
            if request.data:
                return (
                    completed_answer('The arm can be guided by hand already.', ok=True)
                    if motion is not None
                    else self._start()
                )
        if motion is None:
            return completed_answer('Nobody guides the arm.', ok=True)
        answer = _FirstAnswer()
        motion.add_done_callback(
            lambda outcome: answer.set(
                outcome.code is ErrorCode.CANCELLED,
                'The arm is held by the robot again.'
                if outcome.code is ErrorCode.CANCELLED
                else outcome.text,
            )
        )
        motion.cancel()
        return answer.future

    def _start(self) -> Future[ServiceAnswer]:
        arm_request = ArmRequest('a person who guides the arm', lambda: None)
        if not self._arbiter.acquire(arm_request):
            return completed_answer(
                'A goal or a session of live targets has the arm; wait for its end or '
                'cancel it, then try again.'
            )
        answer = _FirstAnswer()
        try:
            motion = self._driver.start_freedrive(
                lambda: answer.set(True, 'The arm can be guided by hand.')
            )
        except DriverError as error:
            self._arbiter.release(arm_request)
            return completed_answer(str(error))
        self._motion = motion

        def on_end(outcome: Outcome) -> None:
            self._motion = None
            self._arbiter.release(arm_request)
            answer.set(False, outcome.text)

        motion.add_done_callback(on_end)
        return answer.future


class _FirstAnswer:
    """An answer of which the first wording counts."""

    def __init__(self) -> None:
        self.future: Future[ServiceAnswer] = Future()

    def set(self, ok: bool, text: str) -> None:
        with contextlib.suppress(InvalidStateError):
            self.future.set_result(ServiceAnswer(ok=ok, text=text))


class TargetInhibitor:
    """
    Keeps targets from being followed after a stop, until they have paused.

    :param pause: for so long there must have been none [s].
    """

    def __init__(self, pause: float) -> None:
        """Begin without."""
        self._pause = pause
        self._is_active = False
        self._last = -inf

    def activate(self) -> None:
        """Begin to hold."""
        self._is_active = True

    def blocks(self, now: float) -> bool:
        """
        Take note of a target, and tell whether it is not to be followed.

        :param now: time of a steady clock [s].
        """
        self._is_active = self._is_active and now - self._last < self._pause
        self._last = now
        return self._is_active


class LiveTargetSubscriber:
    """Listens to targets from its construction to :meth:`close`."""

    def __init__(self, node: Node, driver: Driver, arbiter: ArmArbiter, frames: Frames) -> None:
        """Begin to listen."""
        self._clock, self._logger = node.get_clock(), node.get_logger()
        self._driver, self._arbiter, self._frames = driver, arbiter, frames
        self._max_age = driver.options.live_target_max_age
        self._session: LiveSession | None = None
        self._inhibitor = TargetInhibitor(driver.options.live_target_timeout)
        #: Whether there was a session yet.
        self._had_session = False
        # Guards what follows: the newest message that nobody has looked at.
        self._condition = threading.Condition()
        self._pending: Message = None
        self._received = 0
        self._newest_stamp = 0
        self._closing = False
        self._thread = threading.Thread(target=self._run, name='servo targets', daemon=True)
        self._thread.start()
        self._subscription = node.create_subscription(
            PoseStamped,
            '~/live_target',
            self._take,
            TARGET_QOS,
            callback_group=MutuallyExclusiveCallbackGroup(),
        )

    @property
    def idle(self) -> bool:
        """Tell whether no session runs."""
        return self._session is None

    def stop(self) -> None:
        """Stop the arm and follow nothing any more; returns at once."""
        with self._condition:
            self._closing = True
            self._condition.notify_all()
        session = self._session
        if session is not None:
            session.motion.cancel()

    def close(self) -> None:
        """Stop, and wait until the arm stands; the subscription goes with the node."""
        self.stop()
        self._thread.join()
        session = self._session
        if session is not None:
            session.motion.cancel()
            with contextlib.suppress(TimeoutError):
                session.motion.result(JOIN_TIMEOUT)

    # ---- called by the executor ---------------------------------------------------------------

    def _take(self, message: Message) -> None:
        """Put a message down for the thread, unless it is older than one that came before."""
        stamp, now = nanoseconds(message.header.stamp), self._clock.now().nanoseconds
        with self._condition:
            if self._newest_stamp > now + self._max_age * 1e9:
                self._newest_stamp = 0  # nobody follows that one; or a simulated clock went back
            if 0 < stamp < self._newest_stamp:
                return
            self._newest_stamp = stamp or self._newest_stamp
            self._pending, self._received = message, now
            self._condition.notify_all()

    # ---- in the thread ------------------------------------------------------------------------

    def _run(self) -> None:
        while True:
            with self._condition:
                self._condition.wait_for(lambda: self._pending is not None or self._closing)
                if self._closing:
                    return
                message, self._pending = self._pending, None
                received = self._received
            try:
                self._handle_target(message, received)
            except DriverError as error:
                reason = str(error).removeprefix('trajectory.')  # as of a goal, which it is not
                self._logger.warning(
                    f'A message on ~/live_target is ignored: {reason}',
                    throttle_duration_sec=WARNING_PERIOD,
                )
            except Exception as error:  # the next one may be better
                self._logger.error(
                    'A message on ~/live_target is ignored, because of a defect of the driver, '
                    f'{type(error).__name__}: {error}.',
                    throttle_duration_sec=WARNING_PERIOD,
                )

    def _handle_target(self, message: Message, received: int) -> None:
        state = self._driver.state
        if state is not None and state.safety_status & SAFETY_STOPS:
            self._inhibitor.activate()
        if self._inhibitor.blocks(monotonic()):
            self._logger.warning(
                'Live targets are ignored because the robot was stopped while they came: send '
                f'none for {self._driver.options.live_target_timeout:g} s (live_target_timeout) '
                'before new ones.',
                throttle_duration_sec=WARNING_PERIOD,
            )
            return
        T_base_tcp, age = target_from_message(
            message,
            self._frames,
            now=received,
            max_age=self._max_age,
            snapshot=None if state is None else ArmSnapshot.of(state),
        )
        age += (self._clock.now().nanoseconds - received) / 1_000_000_000
        session = self._session
        if session is None or session.motion.done():
            self._start(T_base_tcp, age)
        else:
            session.set_target(T_base_tcp, age=age)

    def _start(self, T_base_tcp: Pose, age: float) -> None:
        """
        Begin a session, if nothing else has the arm.

        :raises GoalRefused: the robot is not ready, or the target cannot be meant.
        """
        arm_request = ArmRequest(
            SESSION_NAME, lambda: self._preempt_session(arm_request.preempted_by)
        )
        if not self._arbiter.acquire_preemptible(arm_request):
            self._logger.info(
                f'Live targets are ignored as long as {self._arbiter.holder} has the arm.',
                throttle_duration_sec=WARNING_PERIOD,
            )
            return
        try:
            session = self._driver.start_live_session(T_base_tcp, age=age)
        except BaseException as error:
            self._arbiter.release(arm_request)
            if self._had_session and isinstance(error, RobotNotReady):
                self._inhibitor.activate()  # it was ready before: something has stopped it
            raise
        self._session, self._had_session = session, True
        if arm_request.preempted_by:
            self._preempt_session(arm_request.preempted_by)
        session.motion.add_done_callback(self._on_session_end(arm_request))
        self._logger.info('A session of live targets begins.')

    def _preempt_session(self, preempted_by: str) -> None:
        session = self._session
        if session is not None:
            session.motion.preempt(preempted_by)

    def _on_session_end(self, arm_request: ArmRequest) -> Callable[[Outcome], None]:
        """Return what is done at the end of a session."""

        def on_end(outcome: Outcome) -> None:
            if outcome.code not in (ErrorCode.SUCCESSFUL, ErrorCode.PREEMPTED):
                self._inhibitor.activate()
            self._session = None
            self._arbiter.release(arm_request)
            self._log_end(outcome)

        return on_end

    def _log_end(self, outcome: Outcome) -> None:
        """Write into the log how a session ended."""
        text = ' '.join(
            (
                f'The session of live targets has ended: {outcome.text}',
                *(f'{line[:1].upper()}{line[1:]}.' for line in outcome.report),
            )
        )
        if outcome.code in (ErrorCode.SUCCESSFUL, ErrorCode.PREEMPTED, ErrorCode.CANCELLED):
            self._logger.info(text)
        else:
            self._logger.warning(text)
