# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A cell to test in: a simulated robot, the node, a client, one executor for both."""

import contextlib
import os
import threading
from time import monotonic

import pytest
import rclpy
from rclpy.action.client import ActionClient
from rclpy.context import Context
from rclpy.executors import MultiThreadedExecutor, SingleThreadedExecutor
from rclpy.experimental.events_executor import EventsExecutor

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.driver import ConnectionState
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.msg import CartesianTrajectoryPoint
from ur_cartesian_driver.ros import CartesianDriverNode
from ur_cartesian_driver.ros.message_fields import duration_message, pose_message
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

EXECUTORS = {'single': SingleThreadedExecutor, 'multi': MultiThreadedExecutor}
#: A participant of DDS has ten threads. It lives until all of its actions are destroyed, and where
#: 32 live, nodes do not find each other.
PARTICIPANT_THREADS = 10
#: One thread, which makes no wait set of hundreds of entities for each callback.
EVENTS = {'events': EventsExecutor}


@pytest.fixture(autouse=True)
def private_graph(private_ros_graph):
    """Let no other run hear the nodes of these tests."""


@pytest.fixture
def no_thread_left():
    """See to it that a test ends all threads and participants that it starts."""
    before, native = set(threading.enumerate()), native_threads()
    yield
    deadline = monotonic() + 5.0
    for thread in ours(before):
        thread.join(max(0.0, deadline - monotonic()))
    assert not ours(before)
    assert native_threads() < native + PARTICIPANT_THREADS


def native_threads():
    """Return the number of threads of this process that Python has not started."""
    return len(os.listdir('/proc/self/task')) - threading.active_count()


def ours(before):
    """Return the threads that came since, without the pool that a MultiThreadedExecutor keeps."""
    return {
        thread
        for thread in set(threading.enumerate()) - before
        if not thread.name.startswith('ThreadPoolExecutor')
    }


def sim_parameters(sim, **more):
    """Return parameters for a driver of a simulated robot."""
    own = ('reverse_port', 'script_sender_port', 'trajectory_port', 'script_command_port')
    return {
        'rtde_port': sim.ports.rtde,
        'primary_port': sim.ports.primary,
        'dashboard_port': sim.ports.dashboard,
        **dict.fromkeys(own, 0),
        'headless_mode': True,
        'robot_loop': 'thread',
        # Robot, driver and client share this interpreter, which may be busy for longer.
        'max_state_age': 0.0,
        'robot_receive_timeout': 2.0,
        **more,
    }


class Cell:
    """Robot, driver and client, driven by the thread of the test."""

    def __init__(self, sim, executor='single', **parameters):
        self.sim = sim
        self.context = Context()
        rclpy.init(args=[], context=self.context)
        self.node = CartesianDriverNode(
            parameter_overrides=sim_parameters(sim, **parameters), context=self.context
        )
        self.client_node = rclpy.create_node('client', context=self.context)
        self.client = ActionClient(
            self.client_node,
            FollowCartesianTrajectory,
            '/ur_cartesian_driver/follow_cartesian_trajectory',
        )
        self.executor = (EXECUTORS | EVENTS)[executor](context=self.context)
        self.executor.add_node(self.node)
        self.executor.add_node(self.client_node)
        self.feedback = []

    def close(self):
        if not self.context.ok():
            return
        self.client.destroy()
        self.client_node.destroy_node()
        self.node.destroy_node()
        self.executor.shutdown()
        rclpy.shutdown(context=self.context)

    def spin_until(self, condition, timeout=60.0):
        deadline = monotonic() + timeout
        while not (value := condition()):
            assert monotonic() < deadline, 'it did not happen in time'
            self.executor.spin_once(timeout_sec=0.02)
        return value

    @contextlib.contextmanager
    def spun(self):
        """Spin in another thread, so that this one can wait for a client."""
        ended = threading.Event()

        def spin():
            while not ended.is_set():
                self.executor.spin_once(timeout_sec=0.05)

        thread = threading.Thread(target=spin)
        thread.start()
        try:
            yield
        finally:
            ended.set()
            thread.join()

    def wait_ready(self):
        self.spin_until(lambda: self.node.driver.status.state is ConnectionState.READY)
        self.spin_until(self.client.server_is_ready)

    def await_(self, future, timeout=60.0):
        self.spin_until(future.done, timeout)
        return future.result()

    def send(self, goal):
        """Send a goal, return the handle when it is accepted."""
        handle = self.await_(
            self.client.send_goal_async(
                goal, feedback_callback=lambda message: self.feedback.append(message.feedback)
            )
        )
        assert handle.accepted
        return handle

    def result(self, handle):
        response = self.await_(handle.get_result_async())
        return response.status, response.result

    def run(self, goal):
        return self.result(self.send(goal))

    @property
    def T_base_tcp(self):
        return self.sim.state().T_base_tcp

    def goal(self, *steps, **fields):
        """Return a goal of steps (seconds, x, y, z) from where the tool is."""
        start = self.T_base_tcp
        # A busy computer delays goals by seconds; tests of their time choose a tolerance.
        fields = {'goal_time_tolerance': duration_message(20.0), **fields}
        message = FollowCartesianTrajectory.Goal(**fields)
        for time, *offset in steps:
            position = tuple(a + b for a, b in zip(start.position, offset, strict=True))
            message.trajectory.points.append(
                CartesianTrajectoryPoint(
                    time_from_start=duration_message(time),
                    pose=pose_message(Pose(position, start.quaternion)),
                )
            )
        return message


@pytest.fixture
def parameters_for():
    """Return a function that returns parameters for a driver of a simulated robot."""
    return sim_parameters


@pytest.fixture
def sim():
    config = SimulatorConfig(rtde_port=0, primary_port=0, dashboard_port=0, when_late='wait')
    with SimulatedRobot(config) as robot:
        yield robot


@pytest.fixture(params=list(EXECUTORS))
def executor(request):
    return request.param


@pytest.fixture
def make_cell():
    """Return a function that makes cells, which are closed after the test."""
    made = []

    def make(*arguments, **parameters):
        made.append(Cell(*arguments, **parameters))
        return made[-1]

    yield make
    for cell in made:
        cell.close()


@pytest.fixture
def cell(no_thread_left, sim, executor, make_cell):
    """Return a cell that is ready, with each kind of executor."""
    made = make_cell(sim, executor)
    made.wait_ready()
    return made


@pytest.fixture
def single_cell(no_thread_left, sim, make_cell):
    """Return a cell that is ready."""
    made = make_cell(sim)
    made.wait_ready()
    return made
