# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A client of the trajectory action that records the time of every step."""

from __future__ import annotations

import time
from types import TracebackType
from typing import Any

from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Point, Quaternion
from geometry_msgs.msg import Pose as PoseMessage
import paths
import rclpy
from rclpy.action.client import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.msg import CartesianTrajectoryPoint

ACTION = '/ur_cartesian_driver/follow_cartesian_trajectory'


class TimedClient:
    """A context manager with a node of its own."""

    def __enter__(self) -> TimedClient:
        """Make the node and find the server."""
        self._context = Context()
        rclpy.init(args=[], context=self._context)
        self._node = rclpy.create_node('benchmark_client', context=self._context)
        self._client = ActionClient(self._node, FollowCartesianTrajectory, ACTION)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        if not self._client.wait_for_server(timeout_sec=20.0):
            raise TimeoutError(f'Nobody serves {ACTION}.')
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Leave the graph."""
        self._executor.shutdown()
        self._client.destroy()
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)

    def wait(self, future: Any, timeout: float = 60.0) -> tuple[Any, int]:
        """Return the result of a future, and the time at which it came [ns]."""
        deadline = time.monotonic() + timeout
        while not future.done():
            self._executor.spin_once(timeout_sec=0.5)
            if time.monotonic() > deadline:
                raise TimeoutError(f'no answer of the driver within {timeout:g} s')
        return future.result(), time.monotonic_ns()

    def spin(self, duration: float) -> None:
        """Serve callbacks for a time [s]."""
        deadline = time.monotonic() + duration
        while (left := deadline - time.monotonic()) > 0.0:
            self._executor.spin_once(timeout_sec=left)

    def send(self, goal: FollowCartesianTrajectory.Goal) -> Any:
        """Send a goal; return the future of its handle."""
        return self._client.send_goal_async(goal)

    def cancelled(self, handle: Any) -> int:
        """
        Cancel a goal and wait for its end; return the time of the request [ns].

        :raises RuntimeError: the goal ended otherwise.
        """
        now = time.monotonic_ns()
        request = handle.cancel_goal_async()
        self.wait(request)
        response, _ = self.wait(handle.get_result_async())
        if response.status != GoalStatus.STATUS_CANCELED:
            raise RuntimeError(f'The goal was not cancelled: {response.result.error_string}')
        return now


def goal_message(points: int) -> FollowCartesianTrajectory.Goal:
    """Return a goal message with poses only."""
    goal = FollowCartesianTrajectory.Goal()
    goal.trajectory.points = [
        CartesianTrajectoryPoint(pose=_message(pose)) for pose in paths.meander(points)
    ]
    return goal


def _message(pose: Pose) -> PoseMessage:
    (x, y, z), (qx, qy, qz, qw) = pose.position, pose.quaternion
    return PoseMessage(
        position=Point(x=x, y=y, z=z), orientation=Quaternion(x=qx, y=qy, z=qz, w=qw)
    )
