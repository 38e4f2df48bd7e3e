# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Who has the arm, by the UR driver's names: External Control, scripts, and a person's hand."""

import socket

import pytest
from std_msgs.msg import Bool, String
from ur_driver_client import kind, LATCHED

from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.protocol.program.script_sender import REQUEST
from ur_cartesian_driver.sim.motion.motion_ownership import FreedriveState

pytestmark = pytest.mark.slow

RUNNING = '/io_and_status_controller/robot_program_running', 'std_msgs/msg/Bool', LATCHED


@pytest.fixture
def free_port():
    with socket.socket() as bound:
        bound.bind(('127.0.0.1', 0))
        return bound.getsockname()[1]


def external_control(port):
    """Return a program with an External Control node, behind which it waits for ten seconds."""
    with socket.create_connection(('127.0.0.1', port), 10.0) as client:
        client.sendall(REQUEST)
        text = b''
        while b'# NODE_CONTROL_LOOP_ENDS\n' not in text:
            text += client.recv(65536)
    begin, _, rest = text.decode().partition('# NODE_CONTROL_LOOP_BEGINS\n')
    node, _, _ = rest.partition('# NODE_CONTROL_LOOP_ENDS\n')
    behind = 'set_standard_digital_out(3, True)\nsleep(10.0)\n'
    return f'def program():\n{begin}{node}{behind}end\n'


def test_control_is_handed_back_to_the_program_behind_the_node(make_ur, free_port):
    ur = make_ur(headless_mode=False, script_sender_port=free_port)
    running = ur.listen(*RUNNING)
    ur.start_robot()
    text = external_control(free_port)
    name = 'hand_back_control_test_prog.urp'
    assert not ur.cell.sim.call(lambda controller: controller.programs.load(name, text))
    assert ur.dashboard('play').success
    ur.cell.spin_until(lambda: running and running[-1].data)
    assert ur.io('hand_back_control').success
    ur.cell.spin_until(lambda: not running[-1].data)
    states = ur.listen('/io_and_status_controller/io_states', 'ur_msgs/msg/IOStates')
    ur.cell.spin_until(lambda: states and states[-1].digital_out_states[3].state)
    state = ur.dashboard('program_state', 'GetProgramState')
    assert state.state.state == kind('ur_dashboard_msgs/msg/ProgramState').PLAYING
    assert state.program_name == name


def publish(ur, name, message, until):
    """Publish a message until something happens."""
    publisher = ur.node.create_publisher(type(message), name, 1)
    ur.cell.spin_until(publisher.get_subscription_count)
    publisher.publish(message)
    ur.cell.spin_until(until)
    return publisher


@pytest.mark.parametrize('allowed', [True, False])
def test_scripts_run_where_they_are_allowed(make_ur, allowed, capfd):
    ur = make_ur(allow_scripts=allowed)
    ur.cell.wait_ready()
    script = 'sec output():\n  set_standard_digital_out(2, True)\nend\n'
    errors = []

    def done():
        errors.append(capfd.readouterr().err)
        return (
            ur.cell.sim.state().digital_outputs & 4 if allowed else 'allow_scripts' in errors[-1]
        )

    publish(ur, '/urscript_interface/script_command', String(data=script), done)
    assert bool(ur.cell.sim.state().digital_outputs & 4) is allowed


def is_guided(ur):
    """Return whether a person can guide the arm."""
    return ur.cell.sim.call(lambda controller: controller.freedrive is not FreedriveState.OFF)


def test_freedrive_ends_when_nobody_asks_for_it(make_ur):
    ur = make_ur({'freedrive_timeout': 1.0}, allow_freedrive=True)
    ur.cell.wait_ready()
    name = '/freedrive_mode_controller/enable_freedrive_mode'
    publisher = publish(ur, name, Bool(data=True), lambda: is_guided(ur))
    ur.cell.spin_until(lambda: not is_guided(ur))
    publisher.publish(Bool(data=True))
    ur.cell.spin_until(lambda: is_guided(ur))
    publisher.publish(Bool(data=False))
    ur.cell.spin_until(lambda: not is_guided(ur))
    assert ur.cell.sim.state().runtime_state is RuntimeState.PLAYING


def test_freedrive_ends_with_the_node_that_has_asked_for_it(make_ur):
    ur = make_ur(allow_freedrive=True)
    ur.cell.wait_ready()
    name = '/freedrive_mode_controller/enable_freedrive_mode'
    publish(ur, name, Bool(data=True), lambda: is_guided(ur))
    ur.cell.names.destroy_node()
    ur.cell.spin_until(lambda: not is_guided(ur))
