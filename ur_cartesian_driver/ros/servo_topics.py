# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
``~/servo_target``: poses that the tool follows as they come.

The executor only puts a message down; a thread of its own looks at the newest one, because a frame
of tf2 may have to be waited for, and whoever sends faster than that is not to hold up the node.
What cannot be followed is ignored, with a warning that says why; the target before counts until it
is too old.

A session lines up for the arm as a goal does, but before all of them: any goal takes its place.
"""

from __future__ import annotations

from collections.abc import Callable
import contextlib
import threading
from typing import Any, TypeAlias

from geometry_msgs.msg import PoseStamped
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.driver.live import check_pose, LiveSession
from ur_cartesian_driver.motion.errors import DriverError, ErrorCode, InvalidGoal, RobotNotReady
from ur_cartesian_driver.motion.events import Outcome
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.ros.convert import nanoseconds
from ur_cartesian_driver.ros.frames import Frames, Stand
from ur_cartesian_driver.ros.turns import Turn, Turns

#: Generated message classes carry no types.
Message: TypeAlias = Any

#: The newest one counts, and one that was lost is not sent again.
NEWEST = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
#: How often the same kind of trouble is told, at most [s].
COMPLAINT = 2.0
#: How long the end of a session is waited for when the node is destroyed [s].
PATIENCE = 10.0
SESSION = 'the session of live targets'


def pose_of(message: Message) -> Pose:
    """Return the pose of a ``PoseStamped`` as it is, in its frame."""
    p, q = message.pose.position, message.pose.orientation
    return Pose((p.x, p.y, p.z), (q.x, q.y, q.z, q.w))


def target_from_message(message: Message, frames: Frames, *, stand: Stand | None, now: int,
                        max_age: float) -> tuple[Pose, float]:
    """
    Return where the TCP is to be in the robot's base, and how old that is [s].

    :param now: time of the node's clock [ns].
    :param max_age: how old, or how far in the future, a stamp may be [s].
    :raises InvalidGoal: the pose is malformed, its frame unknown, or the stamp is not of now.
    :raises RobotNotReady: the frame moves with the arm, and nobody knows where that stands.
    """
    pose = pose_of(message)
    check_pose(pose)
    stamp = nanoseconds(message.header.stamp)
    age = (now - stamp) / 1_000_000_000 if stamp else 0.0
    if abs(age) > max_age:
        raise InvalidGoal(
            'header.stamp', f'is {abs(age):.3f} s {"old" if age > 0.0 else "in the future"}, '
            f'servo_target_max_age is {max_age:g} s',
            'compare the clocks of both computers, or leave the stamp 0: then the age counts '
            'from the receipt')
    return frames.T_base_frame(message.header.frame_id, stand) @ pose, max(0.0, age)


class ServoTargets:
    """Listens to targets from its construction to :meth:`close`."""

    def __init__(self, node: Node, driver: Driver, turns: Turns, frames: Frames) -> None:
        """Begin to listen."""
        self._clock, self._logger = node.get_clock(), node.get_logger()
        self._driver, self._turns, self._frames = driver, turns, frames
        self._max_age = driver.options.servo_target_max_age
        self._session: LiveSession | None = None
        # Guards what follows: the newest message that nobody has looked at.
        self._condition = threading.Condition()
        self._pending: Message = None
        self._received = 0
        self._newest_stamp = 0
        self._closing = False
        self._thread = threading.Thread(target=self._run, name='servo targets', daemon=True)
        self._thread.start()
        self._subscription = node.create_subscription(
            PoseStamped, '~/servo_target', self._take, NEWEST,
            callback_group=MutuallyExclusiveCallbackGroup())

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
                session.motion.result(PATIENCE)

    # ---- called by the executor ---------------------------------------------------------------

    def _take(self, message: Message) -> None:
        """Put a message down for the thread, unless it is older than one that came before."""
        stamp = nanoseconds(message.header.stamp)
        with self._condition:
            if 0 < stamp < self._newest_stamp:
                return
            self._newest_stamp = stamp or self._newest_stamp
            self._pending, self._received = message, self._clock.now().nanoseconds
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
                self._follow(message, received)
            except DriverError as error:
                self._logger.warning(f'A message on ~/servo_target is ignored: {error}',
                                     throttle_duration_sec=COMPLAINT)
                self._forget_future(received)
            except Exception as error:  # the next one may be better
                self._logger.error(
                    'A message on ~/servo_target is ignored, because of a defect of the driver, '
                    f'{type(error).__name__}: {error}.', throttle_duration_sec=COMPLAINT)

    def _forget_future(self, now: int) -> None:
        """Let a stamp far in the future not silence all that come after it."""
        with self._condition:
            self._newest_stamp = min(self._newest_stamp, now)

    def _follow(self, message: Message, received: int) -> None:
        state = self._driver.state
        T_base_tcp, age = target_from_message(
            message, self._frames, now=received, max_age=self._max_age,
            stand=None if state is None else Stand.of(state))
        age += (self._clock.now().nanoseconds - received) / 1_000_000_000
        session = self._session
        if session is None or session.motion.done():
            self._begin(T_base_tcp, age)
        else:
            session.aim(T_base_tcp, age=age)

    def _begin(self, T_base_tcp: Pose, age: float) -> None:
        """
        Begin a session, if nothing else has the arm.

        :raises GoalRefused: something has, the robot is not ready, or the target cannot be meant.
        """
        turn = Turn(SESSION, lambda: self._make_way_for(turn.successor))
        if not self._turns.seize_for_now(turn):
            raise RobotNotReady('A goal has the arm; live targets are followed when it has ended.')
        try:
            session = self._driver.follow_targets(T_base_tcp, age=age)
        except BaseException:
            self._turns.leave(turn)
            raise
        self._session = session
        if turn.successor:
            self._make_way_for(turn.successor)
        session.motion.add_done_callback(self._ending(turn))
        self._logger.info('A session of live targets begins.')

    def _make_way_for(self, successor: str) -> None:
        session = self._session
        if session is not None:
            session.motion.preempt(successor)

    def _ending(self, turn: Turn) -> Callable[[Outcome], None]:
        """Return what is done at the end of a session."""
        def ended(outcome: Outcome) -> None:
            self._session = None
            self._turns.leave(turn)
            self._tell(outcome)
        return ended

    def _tell(self, outcome: Outcome) -> None:
        """Write into the log how a session ended."""
        text = ' '.join((f'The session of live targets has ended: {outcome.text}',
                         *(f'{line[:1].upper()}{line[1:]}.' for line in outcome.report)))
        if outcome.code in (ErrorCode.SUCCESSFUL, ErrorCode.PREEMPTED, ErrorCode.CANCELLED):
            self._logger.info(text)
        else:
            self._logger.warning(text)
