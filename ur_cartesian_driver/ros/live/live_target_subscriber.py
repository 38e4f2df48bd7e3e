# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
``~/live_target``: sessions in which the arm follows poses that arrive while it moves.

The executor only stores the newest message, and a separate thread processes it. So neither the
wait for a tf2 frame nor a client that sends quickly holds up the node. A target that cannot be
followed is ignored with a warning that says why; the previous target stays in effect until it is
too old itself.

A session acquires the arm like a goal, but is treated as older than all goals, so that any goal
preempts it.

An operator who unlocks a robot and plays its program does not expect it to follow targets that
still arrive. So after a stop, targets are ignored until the client has paused for
``live_target_timeout``.
"""

from __future__ import annotations

import contextlib
from math import inf
import threading
from time import monotonic
import traceback

from geometry_msgs.msg import PoseStamped
from rclpy.node import Node

from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.driver.live_session import check_pose, LiveSession
from ur_cartesian_driver.motion.errors import DriverError, ErrorCode, RobotNotReady
from ur_cartesian_driver.motion.events import Outcome
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.motion.state.rtde_state import SafetyStatus
from ur_cartesian_driver.ros.goals.arm_arbiter import ArmArbiter, ArmRequest
from ur_cartesian_driver.ros.message_fields import (
    checked_age,
    Message,
    nanoseconds,
    pose_from_message,
)
from ur_cartesian_driver.ros.node_endpoints import newest_subscription

#: Stops after which an operator has to check the robot.
SAFETY_STOPS = (
    SafetyStatus.PROTECTIVE_STOPPED
    | SafetyStatus.SAFEGUARD_STOPPED
    | SafetyStatus.EMERGENCY_STOPPED
    | SafetyStatus.ROBOT_EMERGENCY_STOPPED
    | SafetyStatus.SYSTEM_EMERGENCY_STOPPED
    | SafetyStatus.VIOLATION
    | SafetyStatus.FAULT
)
#: Shortest time between two logs of the same warning [s].
WARNING_PERIOD = 2.0
#: How long the node waits for the end of a session when the node is destroyed [s].
JOIN_TIMEOUT = 10.0
SESSION_NAME = 'the session of live targets'


def target_from_message(
    message: Message, frames: Frames, *, snapshot: ArmSnapshot | None, now: int, max_age: float
) -> tuple[Pose, float]:
    """
    Return the target pose of the TCP in the robot's base, and its age [s].

    :param now: time of the node's clock [ns].
    :param max_age: largest distance of a stamp from now, in the past or in the future [s].
    :raises InvalidGoal: the pose is malformed, its frame unknown, or its stamp too far from now.
    :raises RobotNotReady: the frame moves with the arm, whose pose is not known yet.
    """
    pose = pose_from_message(message.pose)
    check_pose(pose)
    age = checked_age(message.header.stamp, now, max_age, 'live_target_max_age', ahead=max_age)
    return frames.T_base_frame(message.header.frame_id, snapshot) @ pose, age


class TargetInhibitor:
    """
    Blocks targets after a stop, until there is a pause between two targets; thread-safe.

    :param pause: the shortest pause that ends the blocking [s].
    """

    def __init__(self, pause: float) -> None:
        """Start without blocking."""
        self._pause = pause
        self._lock = threading.Lock()
        self._is_active = False
        self._last = -inf

    def activate(self) -> None:
        """Start to block."""
        with self._lock:
            self._is_active = True

    def blocks(self, now: float) -> bool:
        """
        Note a target, and return whether it must be ignored.

        :param now: time of a steady clock [s].
        """
        with self._lock:
            self._is_active = self._is_active and now - self._last < self._pause
            self._last = now
            return self._is_active


class LiveTargetSubscriber:
    """Follows live targets from its construction to :meth:`close`."""

    def __init__(self, node: Node, driver: Driver, arbiter: ArmArbiter, frames: Frames) -> None:
        """Subscribe, and start the thread."""
        self._clock, self._logger = node.get_clock(), node.get_logger()
        self._driver, self._arbiter, self._frames = driver, arbiter, frames
        self._max_age = driver.options.live_target_max_age
        self._session: LiveSession | None = None
        self._inhibitor = TargetInhibitor(driver.options.live_target_timeout)
        self._had_session = False
        # Guards the next four fields; ``_pending`` is the newest message not yet processed.
        self._condition = threading.Condition()
        self._pending: Message = None
        self._received = 0
        self._newest_stamp = 0
        self._closing = False
        self._thread = threading.Thread(target=self._run, name='live targets', daemon=True)
        self._thread.start()
        self._subscription = newest_subscription(node, PoseStamped, '~/live_target', self._store)

    def close(self) -> None:
        """Stop the arm, and wait until it is at rest; the node destroys the subscription."""
        with self._condition:
            self._closing = True
            self._condition.notify_all()
        self._cancel_session()
        self._thread.join()
        session = self._cancel_session()  # the thread may have started a new session
        if session is not None:
            with contextlib.suppress(TimeoutError):
                session.motion.result(JOIN_TIMEOUT)

    def _cancel_session(self) -> LiveSession | None:
        session = self._session
        if session is not None:
            session.motion.cancel()
        return session

    # ---- called by the executor ---------------------------------------------------------------

    def _store(self, message: Message) -> None:
        """Store a message for the thread, unless it is older than one that came before."""
        stamp, now = nanoseconds(message.header.stamp), self._clock.now().nanoseconds
        with self._condition:
            if self._newest_stamp > now + self._max_age * 1e9:
                # No message is compared with this stamp any more: its target is too far in the
                # future to be followed, or a simulated clock was set back.
                self._newest_stamp = 0
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
                self._process(message, received)
            except DriverError as error:
                reason = str(error).removeprefix('trajectory.')  # a target has no trajectory
                self._logger.warning(
                    f'A message on ~/live_target is ignored: {reason}',
                    throttle_duration_sec=WARNING_PERIOD,
                )
            except Exception as error:  # the next message may be processed without error
                self._logger.error(
                    'A message on ~/live_target is ignored, because of a defect of the driver, '
                    f'{type(error).__name__}: {error}.\n{traceback.format_exc()}',
                    throttle_duration_sec=WARNING_PERIOD,
                )

    def _process(self, message: Message, received: int) -> None:
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
            self._start_session(T_base_tcp, age)
        else:
            session.set_target(T_base_tcp, age=age)

    def _start_session(self, T_base_tcp: Pose, age: float) -> None:
        """
        Start a session, if the arm is free.

        :raises GoalRefused: the robot is not ready, or the target is out of bounds.
        """
        arm_request = ArmRequest(
            SESSION_NAME, lambda: self._preempt_session(arm_request.preempted_by)
        )
        if not self._arbiter.acquire(arm_request, preemptible=True):
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
                self._inhibitor.activate()  # the robot was ready before, so it was stopped
            raise
        self._session, self._had_session = session, True
        if arm_request.preempted_by:
            self._preempt_session(arm_request.preempted_by)
        session.motion.add_done_callback(
            lambda outcome: self._on_session_end(outcome, arm_request)
        )
        self._logger.info('A session of live targets begins.')

    def _preempt_session(self, preempted_by: str) -> None:
        session = self._session
        if session is not None:
            session.motion.preempt(preempted_by)

    def _on_session_end(self, outcome: Outcome, arm_request: ArmRequest) -> None:
        if outcome.code not in (ErrorCode.SUCCESSFUL, ErrorCode.PREEMPTED):
            self._inhibitor.activate()
        self._session = None
        self._arbiter.release(arm_request)
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
