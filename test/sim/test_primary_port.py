# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The primary and secondary ports of the simulated robot, from outside."""

from __future__ import annotations

import struct
import time

import pytest
from robot_ports import FREE, Primary, Wire
from waiting import wait_for

from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.protocol.client_interfaces.primary_messages import (
    ErrorCodeMessage,
    KeyMessage,
    RawMessage,
    RobotStateFrame,
    RuntimeExceptionMessage,
    SafetyModeMessage,
    TextMessage,
    VersionMessage,
)
from ur_cartesian_driver.protocol.client_interfaces.primary_state import (
    ConfigurationData,
    KinematicsInfo,
    RobotModeData,
)
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig


def test_each_primary_client_gets_the_version_first_then_states(robot):
    for _ in range(2):
        with Primary(robot.ports.primary) as wire:
            version = wire.next()
            assert isinstance(version, VersionMessage)
            assert (version.major, version.minor) == (5, 21)
            assert version.timestamp == 2**64 - 1  # as robots send it
            assert time.strptime(version.date, '%d-%m-%Y, %H:%M:%S')
            packages = {type(p): p for p in wire.await_(RobotStateFrame).packages}
    assert packages[RobotModeData].robot_mode == 7
    assert packages[ConfigurationData].robot_type == 1
    assert packages[ConfigurationData].robot_sub_type == 3  # an e-Series, as recorded
    assert packages[KinematicsInfo].a == pytest.approx((0, -0.425, -0.3922, 0, 0, 0))


def test_a_state_has_the_size_and_order_of_a_recorded_one(robot):
    with Primary(robot.ports.primary) as wire:
        wire.exactly(wire_size(wire))
        data = wire.exactly(wire_size(wire))
    # A recorded UR5e: its sub-packages in this order with these sizes.
    expected = {
        0: 47,
        1: 251,
        4: 101,
        5: 225,
        9: 53,
        3: 75,
        2: 37,
        6: 445,
        7: 61,
        8: 9,
        10: 43,
        11: 26,
        12: 8,
    }
    found = {}
    start = 1
    while start < len(data):
        size, kind = struct.unpack_from('>IB', data, start)
        found[kind] = size
        start += size
    assert found == expected
    assert list(found) == list(expected)


def wire_size(wire: Wire) -> int:
    return struct.unpack('>i', wire.exactly(4))[0] - 4


def test_a_program_that_comes_in_pieces_runs_and_all_clients_hear_of_it(robot):
    program = (
        b'stop program\ndef hello():\n\t# a comment\n\n\tif True:\n\t\ttextmsg("hi ", 1)\n'
        b'\tend\nend\n\n'
    )
    with Primary(robot.ports.primary) as sender, Primary(robot.ports.primary) as listener:
        listener.next()
        for i in range(0, len(program), 7):
            sender.send(program[i : i + 7])
        for wire in (sender, listener):
            wire.await_(KeyMessage, title='PROGRAM_XXX_STARTED', text='hello')
            wire.await_(TextMessage, text='hi 1')
            wire.await_(KeyMessage, title='PROGRAM_XXX_STOPPED', text='hello')


def test_clients_hear_of_a_window(robot):
    with Primary(robot.ports.primary) as wire:
        wire.send(b'popup("Part lost", "Gripper", error=True)\n')
        content = wire.await_(RawMessage, message_type=2).content
    # As published clients unpack it: number, type, warning, error, blocking, length of the title.
    assert struct.unpack('>II???B', content[:12]) == (0, 0, False, True, False, 7)
    assert content[12:] == b'GripperPart lost'


def test_clients_hear_of_a_request_and_a_person_answers(robot):
    with Primary(robot.ports.primary) as wire:
        wire.send(b'textmsg(request_integer_from_primary_client("How many?"))\n')
        content = wire.await_(RawMessage, message_type=9).content
        assert (struct.unpack('>II', content[:8]), content[8:]) == ((0, 1), b'How many?')
        robot.answer('3')
        wire.await_(TextMessage, text='3')


def test_a_program_that_lost_its_indentation_runs_too(robot):
    with Primary(robot.ports.primary) as wire:
        wire.send(b'def flat():\nif True:\ntextmsg("a")\nend\ntextmsg("b")\nend\n')
        wire.await_(TextMessage, text='b')


def test_a_program_without_an_inner_end_is_refused_and_the_next_one_runs(robot):
    with Primary(robot.ports.primary) as wire:
        wire.send(b'def lame():\n  if True:\n    sync()\nend\ndef fine():\n  sync()\nend\n')
        assert 'syntax_error' in wire.await_(RuntimeExceptionMessage).text
        wire.await_(KeyMessage, title='PROGRAM_XXX_STOPPED', text='fine')


def test_a_compile_error_comes_with_line_and_column(robot):
    with Primary(robot.ports.primary) as wire:
        wire.send(b'def illegal_fun():\n  calldoesntexist()\nend\n')
        error = wire.await_(RuntimeExceptionMessage)
        wire.send(b'def stops():\n  a = sqrt(-1)\nend\n')
        later = wire.await_(RuntimeExceptionMessage)
    assert (error.line, error.column) == (2, 3)
    assert error.text == 'compile_error_name_not_found:calldoesntexist:'
    assert error.timestamp == 2**64 - 1 > later.timestamp  # as recorded in URSim


def test_a_bare_line_is_a_program_of_its_own(robot):
    with Primary(robot.ports.primary) as wire:
        wire.send(b'set_standard_digital_out(2, True)\n')
        wire.await_(KeyMessage, title='PROGRAM_XXX_STOPPED')
    assert robot.state().digital_outputs == 0b100


@pytest.mark.parametrize(
    ('line', 'text'),
    [
        (b'  set_flag(1 True)', 'syntax_error_on_line:1:set_flag(1 True):'),
        (b'nothing()', 'compile_error_name_not_found:nothing:'),
        (b'a = sqrt(-1)', 'Runtime error (1:5): Domain error: sqrt is defined from 0 on, got -1'),
    ],
)
def test_the_mistake_of_a_bare_line_is_in_line_1(robot, line, text):
    with Primary(robot.ports.primary) as wire:
        wire.send(line + b'\n')
        error = wire.await_(RuntimeExceptionMessage)
    assert (error.line, error.text) == (1, text)


def test_the_speed_can_be_set_by_a_line(robot):
    with Primary(robot.ports.primary) as wire:
        wire.send(b'confirm user safety parameters\nset real\nset sim\nset real\nset speed 0.5\n')
        wait_for(lambda: robot.state().speed_slider == 0.5)
    assert robot.state().messages == ()


def test_in_local_control_the_script_port_is_read_only():
    with (
        SimulatedRobot(SimulatorConfig(**FREE, remote_control=False)) as robot,
        Primary(robot.ports.primary) as wire,
    ):
        wire.send(b'def a():\n  sync()\nend\n')
        assert wire.await_(ErrorCodeMessage).label == 'C210A0'
        assert robot.state().runtime_state is RuntimeState.STOPPED


def test_the_right_to_send_is_that_of_the_time_of_the_connection():
    with SimulatedRobot(SimulatorConfig(**FREE, remote_control=False)) as robot:

        def turn_key(*, remote):
            robot.call(lambda controller: setattr(controller, 'remote_control', remote))

        with Primary(robot.ports.primary) as old:
            old.await_(VersionMessage)
            turn_key(remote=True)
            old.send(b'set speed 0.5\n')
            assert old.await_(ErrorCodeMessage).label == 'C210A0'
            with Primary(robot.ports.primary) as new:
                new.send(b'set speed 0.4\n')
                wait_for(lambda: robot.state().speed_slider == 0.4)
                turn_key(remote=False)
                for wire in (old, new):  # the robot hangs up
                    with pytest.raises((ConnectionError, AssertionError), match=r'clos|reset'):
                        wire.await_(KeyMessage)


def test_a_protective_stop_is_announced_once_and_unlocked_by_a_line(robot):
    with Primary(robot.ports.primary) as wire:
        wire.send(b'def a():\n  while True:\n    sync()\n  end\nend\n')
        wire.await_(KeyMessage, title='PROGRAM_XXX_STARTED')
        robot.protective_stop()
        error = wire.await_(ErrorCodeMessage)
        assert (error.label, error.level) == ('C209A0', 2)
        wire.await_(SafetyModeMessage, safety_mode=3)
        with pytest.raises(RuntimeError, match='5 s'):
            robot.unlock_protective_stop()
        stopped_at = robot.state().timestamp
        wait_for(lambda: robot.state().timestamp > stopped_at + 5.1)
        wire.send(b'set unlock protective stop\n')
        wire.await_(SafetyModeMessage, safety_mode=1)
        assert robot.state().runtime_state is RuntimeState.PAUSED
        robot.play_program()
        wait_for(lambda: robot.state().runtime_state is RuntimeState.PLAYING)
