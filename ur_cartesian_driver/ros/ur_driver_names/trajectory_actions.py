# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The actions of the trajectory controllers: each forwards its goals to the driver's joint action.

Goals that a controller of ros2_control rejects are rejected here, before the driver sees them. All
others get the tolerances of the UR driver's configuration.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
import copy
from functools import partial
from itertools import pairwise
import threading
from typing import Any

from action_msgs.msg import GoalStatus
from rclpy.action.client import ActionClient
from rclpy.action.server import CancelResponse, GoalResponse
from rclpy.callback_groups import ReentrantCallbackGroup

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.ros.goals.deferred_action_server import DeferredActionServer, end_goal
from ur_cartesian_driver.ros.message_fields import class_of, duration_message, Message, nanoseconds
from ur_cartesian_driver.ros.node_endpoints import (
    Endpoints,
    feedback_publishers,
    steady_timer,
)
from ur_cartesian_driver.ros.ur_driver_names.driver_node import DriverNode
from ur_cartesian_driver.ros.ur_driver_names.names_settings import NamesSettings
from ur_cartesian_driver.ros.ur_driver_names.offered_name import Served, UrName

#: From the UR driver's configuration of its controllers: largest distance of a joint from its path
#: [rad] and, at the end, from its last point [rad], and its largest speed there [rad/s].
PATH_TOLERANCE, GOAL_TOLERANCE, STOPPED_VELOCITY = 0.2, 0.1, 0.2
#: In place of a goal_time_tolerance of 0, which means no bound to ros2_control [s].
NO_TIME_TOLERANCE = 3600.0
#: Largest velocity at the last point that counts as rest [rad/s].
REST = 1e-6
#: How long the driver's action may be gone before its goals are given up [s]; check period [s].
LOST_TIMEOUT, LOOK_PERIOD = 5.0, 1.0


def rejection(trajectory: Message, now: int) -> str:
    """
    Return the reason why a controller of ros2_control rejects a trajectory; empty = it does not.

    :param now: time of the node's clock [ns].
    """
    names, points = list(trajectory.joint_names), trajectory.points
    if len(names) != len(JOINT_NAMES) or not all(
        sum(name.endswith(joint) for name in names) == 1 for joint in JOINT_NAMES
    ):
        return f'joint_names must be the six joints of the arm, each once, not {names}'
    if not points:
        return 'the trajectory has no points'
    times = [nanoseconds(point.time_from_start) for point in points]
    for i, (before, time) in enumerate(pairwise(times), 1):
        if time <= before:
            return f'time_from_start of point {i} is not later than that of the point before'
    for i, point in enumerate(points):
        for field in ('positions', 'velocities', 'accelerations'):
            count = len(getattr(point, field))
            if count != len(names) and (count or field == 'positions'):
                return f'{field} of point {i} has {count} values, not {len(names)}'
    if any(abs(velocity) > REST for velocity in points[-1].velocities):
        return 'the velocity at the last point is not 0'
    start = nanoseconds(trajectory.header.stamp)
    if start and start + times[-1] < now:
        return 'the trajectory ends in the past'
    return ''


def with_default_tolerances(goal: Message, tolerance: Any) -> Message:
    """
    Return a goal with the tolerances that ros2_control's controller would use.

    To this controller, 0 means the value of the configuration, and a negative value no bound.

    :param tolerance: the class of ``JointTolerance``.
    """
    goal = copy.copy(goal)
    names = goal.trajectory.joint_names
    goal.path_tolerance = _filled(goal.path_tolerance, names, tolerance, PATH_TOLERANCE, 0.0)
    goal.goal_tolerance = _filled(
        goal.goal_tolerance, names, tolerance, GOAL_TOLERANCE, STOPPED_VELOCITY
    )
    return goal


def _filled(
    given: Iterable[Message],
    names: Iterable[str],
    tolerance: Any,
    position: float,
    velocity: float,
) -> list[Message]:
    by_name = {entry.name: entry for entry in given}
    unknown = [entry for name, entry in by_name.items() if name not in names]
    return [
        tolerance(
            name=name,
            position=(entry := by_name.get(name, tolerance())).position or position,
            velocity=entry.velocity or velocity,
            acceleration=entry.acceleration,
        )
        for name in names
    ] + unknown


def _with_end(goal: Message) -> Message:
    """Return a goal whose goal_time_tolerance is not 0."""
    if nanoseconds(goal.goal_time_tolerance) == 0:
        goal = copy.copy(goal)
        goal.goal_time_tolerance = duration_message(NO_TIME_TOLERANCE)
    return goal


class ForwardedGoal:
    """A goal of a client, and the driver's goal that it became."""

    def __init__(self, handle: Any) -> None:
        self.handle = handle
        #: The driver's goal; None = the driver has not accepted it yet.
        self.forwarded: Any = None
        self.seconds_lost = 0.0
        #: The publishers of feedback when the goal was sent; a restarted driver has others.
        self.publishers: Endpoints = frozenset()


class GoalForwarder(ABC):
    """An action server that forwards its goals to an action of the driver."""

    #: Whether a new goal replaces the running one; if not, the new one is rejected.
    preempts = False
    #: The class of the driver's action; None = the class of the served action.
    target_type: Any = None

    def __init__(
        self, row: UrName, driver: DriverNode, settings: NamesSettings, action: Any
    ) -> None:
        self.driver, self.action = driver, action
        self._name, self._target = row.name, driver.own_name(row.source)
        self._lock = threading.Lock()
        self._runs: dict[bytes, ForwardedGoal] = {}
        node, group = driver.node, ReentrantCallbackGroup()
        self._client = ActionClient(
            node, self.target_type or action, self._target, callback_group=group
        )
        self._server = DeferredActionServer(  # type: ignore[no-untyped-call]  # rclpy's
            node,
            action,
            row.name,
            self._begin,
            callback_group=group,
            goal_callback=self._judge,
            cancel_callback=self._cancel,
        )
        steady_timer(node, LOOK_PERIOD, self._look_for_driver, group)

    # -- conversions of subclasses ---------------------------------------------------------------

    def rejection(self, goal: Message) -> str:
        """Return the reason for rejecting a goal; empty = it is accepted."""
        return ''

    def forward(self, run: ForwardedGoal) -> None:
        """Pass a goal on by :meth:`send`, at once or later, or end it by :meth:`refuse`."""
        self.send(run, run.handle.request)

    def feedback(self, feedback: Message) -> Message:
        """Convert the driver's feedback."""
        return feedback

    def result(self, result: Message) -> Message:
        """Convert the result of the driver's goal."""
        return result

    @abstractmethod
    def failure(self, text: str) -> Message:
        """Return the result of a goal that the driver does not execute to its end."""

    # -- the same for all ------------------------------------------------------------------------

    def send(self, run: ForwardedGoal, goal: Message) -> None:
        """Send a goal to the driver, on behalf of a client's goal."""
        run.publishers = self._publishers()
        self._client.send_goal_async(
            goal,
            feedback_callback=lambda message: run.handle.publish_feedback(
                self.feedback(message.feedback)
            ),
        ).add_done_callback(partial(self._accepted, run))

    def refuse(self, run: ForwardedGoal, text: str) -> None:
        """End a goal without the driver."""
        self._end(run, GoalStatus.STATUS_ABORTED, self.failure(text))

    def close(self) -> None:
        """Stop serving; the driver goes on with its goals."""
        self._server.destroy()
        self._client.destroy()

    def _judge(self, goal: Message) -> GoalResponse:
        reason = self.rejection(goal)
        if not reason and not self._client.server_is_ready():
            reason = f'the driver does not serve {self._target}; start the driver'
        if not reason and not self.preempts and self._runs:
            reason = 'a goal is being executed; cancel it first'
        if not reason:
            return GoalResponse.ACCEPT
        self.driver.warn(f'{self._name}: goal rejected: {reason}.')
        return GoalResponse.REJECT

    def _begin(self, handle: Any) -> None:
        run = ForwardedGoal(handle)
        with self._lock:
            self._runs[_key(handle)] = run
        self.forward(run)

    def _accepted(self, run: ForwardedGoal, done: Any) -> None:
        forwarded = done.result()
        if not forwarded.accepted:
            self.refuse(run, 'The driver refused.')
            return
        run.forwarded = forwarded
        forwarded.get_result_async().add_done_callback(
            lambda done: self._end(run, done.result().status, self.result(done.result().result))
        )
        if run.handle.is_cancel_requested:
            forwarded.cancel_goal_async()

    def _cancel(self, handle: Any) -> CancelResponse:
        run = self._runs.get(_key(handle))
        if run is not None and run.forwarded is not None:
            run.forwarded.cancel_goal_async()
        return CancelResponse.ACCEPT

    def _end(self, run: ForwardedGoal, status: int, result: Message) -> None:
        """End a goal as the driver's goal ended; ignore later ends."""
        with self._lock:
            if self._runs.pop(_key(run.handle), None) is None:
                return

        def finish(handle: Any) -> Message:
            end_goal(
                handle,
                succeeded=status == GoalStatus.STATUS_SUCCEEDED,
                cancelled=status == GoalStatus.STATUS_CANCELED,
            )
            return result

        self._server.finish(run.handle, finish)

    def _look_for_driver(self) -> None:
        """Abort the goals of a driver that is gone, or that was started again meanwhile."""
        runs = list(self._runs.values())
        if not runs:
            return
        ready, publishers = self._client.server_is_ready(), self._publishers()
        for run in runs:
            run.seconds_lost = 0.0 if ready else run.seconds_lost + LOOK_PERIOD
            if run.seconds_lost >= LOST_TIMEOUT:
                self.refuse(run, 'The driver is gone: whether the arm moves is not known.')
            elif run.publishers and publishers and not publishers & run.publishers:
                self.refuse(run, 'The driver was started again, and knows nothing of this goal.')

    def _publishers(self) -> Endpoints:
        return feedback_publishers(self.driver.node, self._target)


def _key(handle: Any) -> bytes:
    return bytes(handle.goal_id.uuid)


class _TrajectoryForwarder(GoalForwarder):
    """The action of a trajectory controller."""

    preempts = True
    #: Whether goals get the tolerances of ros2_control's controller.
    has_defaults = True

    def rejection(self, goal: Message) -> str:
        if until := getattr(goal, 'until_type', 0):
            return f'until_type is {until}, but only TOOL_CONTACT (0) is known'
        return rejection(goal.trajectory, self.driver.node.get_clock().now().nanoseconds)

    def forward(self, run: ForwardedGoal) -> None:
        goal = _with_end(run.handle.request)
        if self.has_defaults:
            goal = with_default_tolerances(goal, class_of('control_msgs/msg/JointTolerance'))
        self.send(run, goal)

    def failure(self, text: str) -> Message:
        kind = self.action.Result
        result = kind(error_code=kind.PATH_TOLERANCE_VIOLATED, error_string=text)
        if hasattr(result, 'until_condition_result'):
            result.until_condition_result = kind.NOT_TRIGGERED  # 0 is TRIGGERED
        return result


class _PassthroughForwarder(_TrajectoryForwarder):
    """The pass-through controller: goals get no tolerances, and are rejected while one runs."""

    preempts = False
    has_defaults = False


class _UntilForwarder(_TrajectoryForwarder):
    preempts = False


def _row(
    name: str,
    server: type[GoalForwarder] = _TrajectoryForwarder,
    type_name: str = 'control_msgs/action/FollowJointTrajectory',
    source: str = 'follow_joint_trajectory',
    release: str = '',
) -> UrName:
    return Served(
        kind='action', name=name, type=type_name, source=source, release=release, server=server
    )


TRAJECTORY_ACTIONS = (
    # The UR driver's release for Lyrical has no scaled controller: the other one scales.
    _row('scaled_joint_trajectory_controller/follow_joint_trajectory', release='jazzy'),
    _row('joint_trajectory_controller/follow_joint_trajectory'),
    _row('passthrough_trajectory_controller/follow_joint_trajectory', _PassthroughForwarder),
    _row(
        'trajectory_until_node/execute',
        _UntilForwarder,
        'ur_msgs/action/FollowJointTrajectoryUntil',
        'follow_joint_trajectory_until',
    ),
)
