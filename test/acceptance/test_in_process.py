# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Simulator, node and client in one process, as in the tests of our users."""

import os
from pathlib import Path
import threading
from time import monotonic

from action_msgs.msg import GoalStatus
import pytest
from rclpy.action.client import ActionClient
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.msg import CartesianTrajectoryPoint

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

Result = FollowCartesianTrajectory.Result
#: How long anything may take that is not a motion [s].
TIMEOUT = 60.0


class Client:
    """An action client on an executor that also holds the driver's node."""

    def __init__(self, driver, executor):
        self.driver, self.executor = driver, executor
        self.node = Node('test_client')
        self.feedback = []
        # Answers beyond the depth of a queue are lost, and ten are the default.
        queue = QoSProfile(depth=100)
        self._actions = ActionClient(
            self.node,
            FollowCartesianTrajectory,
            '/ur_cartesian_driver/follow_cartesian_trajectory',
            goal_service_qos_profile=queue,
            result_service_qos_profile=queue,
        )
        executor.add_node(driver)
        executor.add_node(self.node)
        assert self.spin_until(self._actions.server_is_ready)

    def spin_until(self, condition, timeout=TIMEOUT):
        end = monotonic() + timeout
        while not condition() and monotonic() < end:
            self.executor.spin_once(timeout_sec=0.05)
        return condition()

    def wait(self, future, timeout=TIMEOUT):
        assert self.spin_until(future.done, timeout)
        return future.result()

    def send(self, goal):
        handle = self.wait(
            self._actions.send_goal_async(
                goal, lambda message: self.feedback.append(message.feedback)
            )
        )
        assert handle.accepted
        return handle

    def result(self, handle, timeout=TIMEOUT):
        response = self.wait(handle.get_result_async(), timeout)
        return response.status, response.result

    def close(self):
        self._actions.destroy()
        self.executor.shutdown()
        self.node.destroy_node()


@pytest.fixture(
    params=[SingleThreadedExecutor, MultiThreadedExecutor],
    ids=['single-threaded', 'multi-threaded'],
)
def client(request, cartesian_driver):
    made = Client(cartesian_driver, request.param())
    yield made
    made.close()


def goal_at(driver, *offsets, seconds=0.5):
    """A goal of points beside the tool, `seconds` apart."""
    pose = driver.driver.state.actual_tcp_pose
    goal = FollowCartesianTrajectory.Goal()
    for i, (x, y, z) in enumerate(offsets):
        point = CartesianTrajectoryPoint()
        total = (i + 1) * seconds
        point.time_from_start.sec = int(total)
        point.time_from_start.nanosec = round(total % 1 * 1e9)
        position, orientation = point.pose.position, point.pose.orientation
        position.x, position.y, position.z = (
            a + b for a, b in zip(pose.position, (x, y, z), strict=True)
        )
        orientation.x, orientation.y, orientation.z, orientation.w = pose.quaternion
        goal.trajectory.points.append(point)
    return goal


def test_the_first_goal_is_done_within_five_seconds(client):
    begin = monotonic()
    handle = client.send(goal_at(client.driver, (0.0, 0.03, 0.0), (0.0, 0.0, 0.0)))
    status, result = client.result(handle)
    assert monotonic() - begin < 5.0
    assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, Result.SUCCESSFUL)
    assert [line[:8] for line in result.report[:3]] == ['point 0:', 'point 1:', 'clearanc']
    assert len(client.feedback) > 5
    last = client.feedback[-1]
    assert last.header.frame_id == 'base'
    assert last.speed_scaling == 0.0  # at rest
    assert max(message.speed_scaling for message in client.feedback) == pytest.approx(1.0)
    assert last.points_received == 2


def test_cancel_and_then_another_goal(client):
    handle = client.send(goal_at(client.driver, (0.0, 0.2, 0.0), seconds=5.0))
    assert client.spin_until(lambda: len(client.feedback) > 5)
    client.wait(handle.cancel_goal_async())
    status, result = client.result(handle)
    assert (status, result.error_code) == (GoalStatus.STATUS_CANCELED, Result.CANCELLED)
    assert max(map(abs, client.driver.driver.state.actual_qd)) < 1e-3
    status, result = client.result(client.send(goal_at(client.driver, (0.0, 0.01, 0.0))))
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string


def test_a_refused_goal_says_why_and_moves_nothing(client, ur_sim):
    goal = goal_at(client.driver, (0.0, 0.01, 0.0), (0.0, 0.02, 0.0))
    goal.trajectory.points[1].pose.orientation.x = float('nan')
    q = ur_sim.state().q
    status, result = client.result(client.send(goal))
    assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, Result.INVALID_GOAL)
    assert 'trajectory.points[1].pose.orientation' in result.error_string
    assert ur_sim.state().q == q


def test_every_goal_of_a_burst_is_answered(client):
    goal = goal_at(client.driver, (0.0, 0.01, 0.0))
    goal.validate_only = True
    requests = [client._actions.send_goal_async(goal) for _ in range(60)]
    results = [client.wait(request).get_result_async() for request in requests]
    assert {client.wait(result).status for result in results} == {GoalStatus.STATUS_SUCCEEDED}


def test_a_node_that_is_destroyed_during_a_goal_stops_the_arm(client, ur_sim):
    client.send(goal_at(client.driver, (0.0, 0.2, 0.0), seconds=5.0))
    assert client.spin_until(lambda: len(client.feedback) > 5)
    client.driver.destroy_node()
    end = monotonic() + 3.0
    while max(map(abs, ur_sim.state().qd)) > 1e-6:
        assert monotonic() < end


def resources():
    """Return resources that a test could leak: thread names, our shared memory, children."""
    threads = {t.name for t in threading.enumerate()}
    descriptors = []
    for fd in os.listdir('/proc/self/fd'):
        try:
            descriptors.append(os.readlink(f'/proc/self/fd/{fd}'))
        except OSError:  # the one that listdir itself has used
            continue
    ours = [d for d in descriptors if 'memfd:ur_cartesian_driver' in d]
    children = Path(f'/proc/self/task/{os.getpid()}/children').read_text('ascii').split()
    return threads, ours, children


@pytest.mark.parametrize('round_', [1, 2])
def test_nothing_is_left_behind(request, round_):
    before = resources()
    driver = request.getfixturevalue('cartesian_driver')
    client = Client(driver, SingleThreadedExecutor())
    ports = set(driver.driver.status.ports.values())
    status, _ = client.result(client.send(goal_at(driver, (0.0, 0.01, 0.0))))
    assert status == GoalStatus.STATUS_SUCCEEDED
    during = resources()
    assert during[1]
    assert during[0] - before[0]
    driver.destroy_node()
    request.getfixturevalue('ur_sim').close()
    client.close()
    after = resources()
    assert after[0] <= before[0]
    assert after[1:] == ([], before[2])
    assert not ports & listening_ports()


def listening_ports():
    """The TCP ports with a listener on this machine."""
    rows = Path('/proc/net/tcp').read_text('ascii').splitlines()[1:]
    return {int(row.split()[1].split(':')[1], 16) for row in rows if row.split()[3] == '0A'}
