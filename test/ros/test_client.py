# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What a client makes of a driver that is not ready, not complete, or not the same any more."""

from concurrent.futures import ThreadPoolExecutor

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor

from ur_cartesian_driver.msg import DriverStatus
from ur_cartesian_driver.ros.client import GoalClient
from ur_cartesian_driver.ros.state.state_publisher import LATCHED_QOS


class StubDriver:
    """A node with the driver's name, spun in a thread, that serves only what a test adds."""

    def __init__(self):
        self.context = Context()
        rclpy.init(args=[], context=self.context)
        self.node = rclpy.create_node('ur_cartesian_driver', context=self.context)
        self._status = self.node.create_publisher(DriverStatus, '~/status', LATCHED_QOS)
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._pool = ThreadPoolExecutor(1)
        self._spinning = self._pool.submit(self._executor.spin)

    def report(self, state, message=''):
        self._status.publish(DriverStatus(state=state, message=message))

    def close(self):
        if self.context.ok():
            self._executor.shutdown()
            self._pool.shutdown()
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
    driver.report(state, 'Unlock it.')
    with pytest.raises(TimeoutError, match=r'is not ready after 3 s: Unlock it\.'):
        client.wait_ready(3.0)
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(client.wait_ready, 30.0)
        driver.report(DriverStatus.EXECUTING)
        waiting.result()
