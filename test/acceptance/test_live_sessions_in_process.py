# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Live targets through ROS: simulator, node and a sender of poses, in one process."""

from math import hypot
import re
from time import monotonic
from typing import Any

from checkout import CHECKOUT, needs_checkout
from geometry_msgs.msg import PoseStamped
import pytest
from rclpy.action.client import ActionClient
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from std_srvs.srv import SetBool

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.msg import CartesianTrajectoryPoint, ServoState

pytestmark = [
    pytest.mark.acceptance,
    pytest.mark.slow,
    # The tests pay for each cycle.
    pytest.mark.ur_sim(frequency=125.0),
    pytest.mark.cartesian_driver(
        live_target_enabled=True, live_target_timeout=0.5, allow_freedrive=True
    ),
]

PAGE = CHECKOUT / 'doc' / 'live_targets.md'
NAME = '/ur_cartesian_driver'


class Cell:
    """The driver's node and others on one executor."""

    def __init__(self, driver, *nodes):
        self.driver, self.nodes = driver, nodes
        self.executor = SingleThreadedExecutor()
        for node in (driver, *nodes):
            self.executor.add_node(node)

    def spin(self, seconds):
        end = monotonic() + seconds
        while monotonic() < end:
            self.executor.spin_once(timeout_sec=0.01)

    def until(self, condition, bound=60.0):
        end = monotonic() + bound
        while not condition():
            assert monotonic() < end, 'it did not happen in time'
            self.executor.spin_once(timeout_sec=0.01)

    def close(self):
        self.executor.shutdown()
        for node in self.nodes:
            if hasattr(node, 'actions'):
                node.actions.destroy()
            node.destroy_node()


@pytest.fixture
def cell_with(cartesian_driver):
    made = []

    def make(*nodes):
        made.append(Cell(cartesian_driver, *nodes))
        return made[-1]

    yield make
    for cell in made:
        cell.close()


class Sender(Node):
    """Sends targets, and listens to the state of the session."""

    def __init__(self):
        super().__init__('sender')
        self.states = []
        self.freedrive_client = self.create_client(SetBool, f'{NAME}/freedrive_mode')
        self.actions = ActionClient(
            self, FollowCartesianTrajectory, f'{NAME}/follow_cartesian_trajectory'
        )
        self.targets = self.create_publisher(PoseStamped, f'{NAME}/live_target', 1)
        self.create_subscription(ServoState, f'{NAME}/servo_state', self.states.append, 10)

    def go(self, cell, pose):
        """Send a goal; return its result to come."""
        goal = FollowCartesianTrajectory.Goal()
        point = CartesianTrajectoryPoint()
        point.time_from_start.nanosec = 500_000_000
        point.pose.position.x, point.pose.position.y, point.pose.position.z = pose.position
        o = point.pose.orientation
        o.x, o.y, o.z, o.w = pose.quaternion
        point.pose.position.z += 0.01
        goal.trajectory.points.append(point)
        cell.until(self.actions.server_is_ready)
        handle = self.actions.send_goal_async(goal)
        cell.until(handle.done)
        return handle.result().get_result_async()

    def send(self, pose, dy=0.0, frame='base'):
        message = PoseStamped()
        message.header.frame_id = frame
        (message.pose.position.x, y, message.pose.position.z) = pose.position
        message.pose.position.y = y + dy
        o = message.pose.orientation
        o.x, o.y, o.z, o.w = pose.quaternion
        self.targets.publish(message)


@needs_checkout
def test_the_example_of_the_page_moves_the_tool_on_its_circle(ur_sim, cell_with):
    code = next(
        body
        for body in re.findall(
            r'^```python\n(.*?)^```$', PAGE.read_text(), re.DOTALL | re.MULTILINE
        )
        if 'class Circle' in body
    )
    names: dict[str, Any] = {'__name__': 'example'}
    exec(code, names)
    _, y0, z0 = ur_sim.state().T_base_tcp.position
    cell = cell_with(names['Circle']())
    off, seen = [], []
    end = monotonic() + 2.8
    while monotonic() < end:
        cell.spin(0.05)
        _, y, z = ur_sim.state().T_base_tcp.position
        seen.append((y - y0, z - z0))
        off.append(abs(hypot(y - y0, z - z0 - 0.04) - 0.04))
    assert max(off) < 0.008
    assert max(z for _, z in seen) > 0.05, 'it came around'
    assert not is_idle(cell.driver.live_targets)


def is_idle(targets):
    """Whether no session of live targets runs."""
    return targets._session is None


def test_a_goal_preempts_a_session_and_freedrive_works(ur_sim, cell_with):
    """One cell for several claims, as a cell costs seconds."""
    sender = Sender()
    cell = cell_with(sender)
    targets = cell.driver.live_targets
    cell.until(lambda: sender.targets.get_subscription_count() == 1)
    here = ur_sim.state().T_base_tcp
    for frame, dy in (('no such frame', 0.0), ('base', 3.0)):
        sender.send(here, dy, frame)
        cell.spin(0.1)
    assert is_idle(targets)
    assert ur_sim.state().T_base_tcp == here, 'nothing moves'

    def lead(dy, until):
        end = monotonic() + 30.0  # a busy computer delays each message
        while not until():
            assert monotonic() < end
            sender.send(here, dy)
            cell.spin(0.02)

    def is_at(dy):
        return abs(ur_sim.state().T_base_tcp.position[1] - here.position[1] - dy) < 0.002

    lead(0.03, lambda: is_at(0.03))
    result = sender.go(cell, here)
    assert not is_idle(targets)
    lead(0.03, result.done)
    assert result.result().result.error_code == 0, result.result().result.error_string
    # Somebody still tells targets: behind the goal the tool goes there again.
    lead(0.03, lambda: not is_idle(targets) and is_at(0.03))
    assert {ServoState.SERVOING, ServoState.IDLE} <= {state.state for state in sender.states}
    cell.until(lambda: is_idle(targets))
    cell.until(lambda: sender.states[-1].state == ServoState.IDLE)
    cell.until(lambda: max(map(abs, ur_sim.state().qd)) < 1e-6)

    # The third claim: teach mode is a service.
    def freedrive_client(on):
        answer = sender.freedrive_client.call_async(SetBool.Request(data=on))
        cell.until(answer.done)
        return answer.result().success, answer.result().message

    here = ur_sim.state().T_base_tcp
    assert freedrive_client(True) == (True, 'The arm can be guided by hand.')
    result = sender.go(cell, here)
    cell.until(result.done)
    assert 'guides the arm by hand' in result.result().result.error_string
    assert freedrive_client(True)[0], 'it is on already'
    assert freedrive_client(False) == (True, 'The arm is held by the robot again.')
    assert freedrive_client(False) == (True, 'The arm is not guided by hand.')
