# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``~/detect_tool_contact``: its ends, and what it says about them."""

from action_msgs.msg import GoalStatus
import pytest
from rclpy.action.client import ActionClient

from ur_cartesian_driver.action import DetectToolContact
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

pytestmark = pytest.mark.slow

#: A face across y, 5 cm beside the tool of a UR5e at its start.
FACE = -0.0833


@pytest.fixture
def sim():
    config = SimulatorConfig(
        rtde_port=0,
        primary_port=0,
        dashboard_port=0,
        when_late='wait',
        contacts=(f'plane 0 {FACE} 0 0 -1 0',),
    )
    with SimulatedRobot(config) as robot:
        yield robot


@pytest.fixture
def client(single_cell):
    client = ActionClient(
        single_cell.client_node, DetectToolContact, '/ur_cartesian_driver/detect_tool_contact'
    )
    single_cell.spin_until(client.server_is_ready)
    yield client
    client.destroy()


def send(cell, client):
    handle = cell.await_(client.send_goal_async(DetectToolContact.Goal()))
    assert handle.accepted
    return handle


def end(cell, handle):
    response = cell.await_(handle.get_result_async(), 60.0)
    return response.status, response.result.success, response.result.message


def test_contact_stops_the_goal_that_moves_the_arm(single_cell, client):
    cell = single_cell
    watching = send(cell, client)
    status, result = cell.run(cell.goal((4.0, 0.0, 0.1, 0.0)))
    assert status == GoalStatus.STATUS_ABORTED
    assert result.error_code == ErrorCode.EXECUTION_FAILED
    assert result.error_string.startswith(
        'The tool touched something while detect_tool_contact watched'
    )
    status, success, message = end(cell, watching)
    assert (status, success) == (GoalStatus.STATUS_SUCCEEDED, True)
    assert message.startswith('The tool touched at x ')
    assert cell.T_base_tcp.position[1] == pytest.approx(FACE, abs=1e-3)


def test_a_watch_is_cancelled_and_refuses_another_one(single_cell, client):
    cell = single_cell
    watching, second = send(cell, client), send(cell, client)
    assert end(cell, second) == (
        GoalStatus.STATUS_ABORTED,
        False,
        'Another goal watches for contact; cancel it first.',
    )
    assert cell.await_(watching.cancel_goal_async()).goals_canceling
    assert end(cell, watching) == (
        GoalStatus.STATUS_CANCELED,
        False,
        'The watch was ended before the tool touched.',
    )


def test_a_watch_without_a_robot_program_is_aborted(single_cell, client):
    cell = single_cell
    watching = send(cell, client)
    cell.spin_until(lambda: not cell.node.contact_action.idle)
    # Both wait until the program is known to be ours, and begin in their order.
    refused = cell.node.driver.watch_contact().result(5.0)
    assert 'watches for contact already' in refused.text
    cell.sim.stop_program()
    status, success, message = end(cell, watching)
    assert (status, success) == (GoalStatus.STATUS_ABORTED, False)
    assert message.startswith('The watch for contact ended with the robot program: ')
    stopped = RuntimeState.STOPPED
    cell.spin_until(lambda: cell.node.driver.state.runtime_state is stopped)
    status, success, message = end(cell, send(cell, client))
    assert (status, success) == (GoalStatus.STATUS_ABORTED, False)
    assert message.startswith('The robot program is STOPPED and does not read commands.')
