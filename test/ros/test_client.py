# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What a client makes of a driver that is not ready, not complete, or not the same any more."""

from concurrent.futures import ThreadPoolExecutor
import threading

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from waiting import wait_for

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.msg import DriverStatus
from ur_cartesian_driver.ros.client import GoalClient
from ur_cartesian_driver.ros.goals.deferred_action_server import DeferredActionServer
from ur_cartesian_driver.ros.node_endpoints import feedback_publishers, LATCHED_QOS
from ur_cartesian_driver.srv import Recover


class StubDriver:
    """A node with the driver's name, spun in a thread, that serves only what a test adds."""

    def __init__(self):
        self.context = Context()
        rclpy.init(args=[], context=self.context)
        self.node = rclpy.create_node('ur_cartesian_driver', context=self.context)
        self._status = self.node.create_publisher(DriverStatus, '~/status', LATCHED_QOS)
        self.accepted = threading.Event()
        self._server = None
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._pool = ThreadPoolExecutor(1)
        self._spinning = self._pool.submit(self._executor.spin)

    def report(self, state, message=''):
        self._status.publish(DriverStatus(state=state, message=message))

    def serve_goals(self):
        """Accept goals, which never end."""
        self._server = DeferredActionServer(
            self.node,
            FollowCartesianTrajectory,
            '~/follow_cartesian_trajectory',
            lambda _: self.accepted.set(),
        )

    def close(self):
        if self.context.ok():
            self._executor.shutdown()
            self._pool.shutdown()
            if self._server is not None:
                self._server.destroy()
            self.node.destroy_node()
            rclpy.shutdown(context=self.context)


@pytest.fixture
def make_driver():
    """Return a function that starts stub drivers, which are closed after the test."""
    made = []

    def make():
        made.append(StubDriver())
        return made[-1]

    yield make
    for driver in made:
        driver.close()


@pytest.fixture
def client():
    with GoalClient() as made:
        yield made


@pytest.mark.parametrize('state', [DriverStatus.STOPPED, DriverStatus.REFUSED])
def test_a_driver_that_was_stopped_is_not_ready(make_driver, client, state):
    driver = make_driver()
    driver.report(DriverStatus.READY)
    client.wait_ready(30.0)
    driver.report(state, 'Unlock it.')
    with pytest.raises(TimeoutError, match=r'is not ready after 3 s: Unlock it\.'):
        client.wait_ready(3.0)
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(client.wait_ready, 30.0)
        driver.report(DriverStatus.EXECUTING)
        waiting.result()


def test_of_two_drivers_of_one_name_none_is_chosen(make_driver, client):
    drivers = make_driver(), make_driver()
    for driver in drivers:
        driver.serve_goals()
    wait_for(lambda: len(feedback_publishers(client._node, client.action)) == 2, 10.0)
    with pytest.raises(ConnectionError, match=r'^2 drivers serve .*, and any of them could move'):
        client.send(FollowCartesianTrajectory.Goal(), timeout=1.0)
    assert not any(driver.accepted.is_set() for driver in drivers)


def test_a_driver_that_is_started_again_does_not_know_the_goal(make_driver, client):
    driver = make_driver()
    driver.serve_goals()
    with ThreadPoolExecutor(1) as pool:
        sending = pool.submit(client.send, FollowCartesianTrajectory.Goal())
        wait_for(driver.accepted.is_set, 10.0)
        driver.close()
        make_driver().serve_goals()
        with pytest.raises(
            ConnectionError, match=r'was started again; how the goal ended is not known\.'
        ):
            sending.result(30.0)


def test_a_call_to_a_driver_that_is_gone_says_what_is_not_known(make_driver, client):
    driver, called = make_driver(), threading.Event()
    driver.serve_goals()
    service = driver.node.create_service(Recover, '~/recover', lambda _, answer: answer)
    service.send_response = lambda *_: called.set()
    with ThreadPoolExecutor(1) as pool:
        calling = pool.submit(client.recover)
        assert called.wait(10.0)
        driver.close()
        with pytest.raises(ConnectionError, match='is gone; what the robot has done is not known'):
            calling.result(30.0)


@pytest.mark.parametrize(
    'call', [GoalClient.recover, GoalClient.append_to_running], ids=['recover', 'append_points']
)
def test_a_service_that_nobody_serves_is_not_waited_for(make_driver, client, request, call):
    make_driver().serve_goals()
    name = request.node.callspec.id
    with pytest.raises(TimeoutError, match=f'does not serve /ur_cartesian_driver/{name}'):
        call(client, timeout=1.0)


def test_a_closed_client_leaves_nothing_on_a_node_of_others(make_driver):
    node = make_driver().node
    before = list(node.publishers)
    with GoalClient(node=node) as client:
        client.set_path_offset(along=0.01)
        client.set_feed_override(0.5)
        assert len(list(node.publishers)) == len(before) + 2
    wait_for(lambda: list(node.publishers) == before, 5.0)
