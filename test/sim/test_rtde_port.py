# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The RTDE port of the simulated robot, from outside."""

from __future__ import annotations

import itertools
import json
from pathlib import Path
import struct

import pytest
from robot_ports import FREE, PAUSE, setup_inputs, Wire
from rtde_requests import setup_outputs, START, VERSION_2
from waiting import wait_for

from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

GOLDEN = json.loads((Path(__file__).parent / 'golden' / 'rtde_handshake.json').read_text())
#: The names and types in the tables of the manufacturer's client library, and sizes in bytes.
OUTPUTS = json.loads((Path(__file__).parent / 'golden' / 'rtde_outputs.json').read_text())
SIZES = {
    'BOOL': 1,
    'UINT8': 1,
    'UINT32': 4,
    'INT32': 4,
    'UINT64': 8,
    'DOUBLE': 8,
    'VECTOR3D': 24,
    'VECTOR6D': 48,
    'VECTOR6INT32': 24,
}


def read_stamps(wire, count):
    stamps = []
    while len(stamps) < count:
        kind, data = wire.rtde()
        if kind == ord('U'):
            stamps.append(struct.unpack_from('>d', data, 4)[0])
    return stamps


@pytest.mark.parametrize('name', ['handshake', 'handshake_with_types'])
def test_the_handshake_of_the_manufacturers_library_is_answered(name):
    case = GOLDEN[name]
    with (
        SimulatedRobot(SimulatorConfig(**FREE, polyscope='5.23.0')) as robot,
        Wire(robot.ports.rtde) as wire,
    ):
        seen = []
        for frame in case['frames']:
            if frame['direction'] == 'client_to_controller':
                wire.send(bytes.fromhex(frame['hex']))
            elif frame['type'] != ord('U'):
                kind, answer = wire.rtde()
                while kind == ord('U'):
                    kind, answer = wire.rtde()
                seen.append((frame, answer))
    assert len(seen) >= 7
    for frame, answer in seen:
        if name == 'handshake_with_types':  # its server answers with types, as a robot does
            assert answer.hex() == frame['hex']
        else:
            assert answer[2] == frame['type']


def test_the_older_protocol_is_spoken_too():
    frames = [f for f in GOLDEN['handshake_protocol_v1']['frames'][2:]]
    with (
        SimulatedRobot(SimulatorConfig(**FREE, model='ur5', polyscope='3.15')) as robot,
        Wire(robot.ports.rtde) as wire,
    ):
        for frame in frames:
            if frame['direction'] == 'client_to_controller':
                wire.send(bytes.fromhex(frame['hex']))
            elif frame['type'] == ord('O'):
                assert wire.rtde()[1].hex() == frame['hex']
            elif frame['type'] == ord('U'):
                assert len(wire.rtde()[1]) == len(frame['hex']) // 2
                break
            else:
                assert wire.rtde()[0] == frame['type']


def test_every_cycle_is_sent_once_and_the_clock_has_been_running_for_a_while(robot):
    with Wire(robot.ports.rtde) as wire:
        wire.send(VERSION_2 + setup_outputs('timestamp') + START)
        times = read_stamps(wire, 200)
    assert times[0] >= 40.0
    assert [b - a for a, b in itertools.pairwise(times)] == pytest.approx([0.002] * 199)


@pytest.mark.parametrize(
    ('settings', 'cycle'),
    [({'rate': 0.0}, 0.002), ({'rate': 1.0}, 0.002), ({'rate': 4.0, 'model': 'ur5'}, 0.008)],
    ids=['virtual clock', 'real clock', 'CB3'],
)
def test_timestamps_advance_by_one_cycle_for_every_client(settings, cycle):
    with (
        SimulatedRobot(SimulatorConfig(**FREE, **settings)) as robot,
        Wire(robot.ports.rtde) as one,
        Wire(robot.ports.rtde) as two,
    ):
        one.send(VERSION_2 + setup_outputs('timestamp', frequency=1.0 / cycle) + START)
        two.send(VERSION_2 + setup_outputs('timestamp', 'control_step', frequency=0.0) + START)
        for wire in (one, two):
            stamps = read_stamps(wire, 200)
            assert [b - a for a, b in itertools.pairwise(stamps)] == pytest.approx(
                [cycle] * (len(stamps) - 1), abs=1e-9
            )


@pytest.mark.parametrize(
    ('frequency', 'cycles'),
    [(499.0, 1), (300.0, 1), (250.0, 2), (200.0, 2), (125.0, 4), (60.0, 8)],
)
def test_a_frequency_is_met_by_whole_cycles_rounded_down(robot, frequency, cycles):
    with Wire(robot.ports.rtde) as wire:
        wire.send(VERSION_2 + setup_outputs('timestamp', frequency=frequency) + START)
        stamps = read_stamps(wire, 20)
    assert [b - a for a, b in itertools.pairwise(stamps)] == pytest.approx([0.002 * cycles] * 19)


def test_a_pause_ends_the_packages_until_the_next_start(robot):
    with Wire(robot.ports.rtde) as wire:
        wire.send(VERSION_2 + setup_outputs('timestamp') + START)
        wire.send(PAUSE + START)
        kinds = [wire.rtde()[0] for _ in range(50)]
    paused = kinds.index(ord('P'))
    assert kinds[paused + 1] == ord('S')
    assert set(kinds[paused + 2 :]) == {ord('U')}


@pytest.fixture(scope='module')
def any_robot():
    with SimulatedRobot(SimulatorConfig(**FREE, rate=4.0)) as robot:
        yield robot


@pytest.mark.parametrize(('name', 'data_type'), OUTPUTS.items())
def test_an_output_that_clients_know_has_its_type_and_size(any_robot, name, data_type):
    with Wire(any_robot.ports.rtde) as wire:
        wire.send(VERSION_2 + setup_outputs(name) + START)
        assert wire.rtde()[1][3:] == b'\x01'
        assert wire.rtde()[1][3:] == b'\x01' + data_type.encode()
        assert wire.rtde()[1][3:] == b'\x01'
        assert len(wire.rtde()[1]) == 4 + SIZES[data_type]


def test_two_clients_have_their_own_recipes_and_share_the_inputs(robot):
    with Wire(robot.ports.rtde) as one, Wire(robot.ports.rtde) as two:
        one.send(VERSION_2 + setup_outputs('timestamp') + setup_inputs('input_int_register_24'))
        two.send(VERSION_2 + setup_outputs('timestamp', 'input_int_register_24', 'robot_mode'))
        assert [one.rtde()[1][3:] for _ in range(3)][1:] == [b'\x01DOUBLE', b'\x01INT32']
        assert [two.rtde()[1][3:] for _ in range(2)][1:] == [b'\x01DOUBLE,INT32,INT32']
        two.send(setup_inputs('input_int_register_24', 'input_int_register_25'))
        assert two.rtde()[1][3:] == b'\x00IN_USE,INT32'
        one.send(struct.pack('>HBBi', 8, ord('U'), 1, -7))
        two.send(START)
        value = 0
        while value != -7:
            kind, data = two.rtde()
            value, mode = struct.unpack('>ii', data[12:]) if kind == ord('U') else (0, 0)
        assert mode == 7


def test_an_input_is_free_again_when_its_client_has_left(robot):
    with Wire(robot.ports.rtde) as one:
        one.send(setup_inputs('speed_slider_mask'))
        one.rtde()
    with Wire(robot.ports.rtde) as two:
        answer = b'IN_USE'
        while b'IN_USE' in answer:  # the robot notices in one of its next cycles
            two.send(setup_inputs('speed_slider_mask'))
            answer = two.rtde()[1]
        assert b'UINT32' in answer


def test_an_unknown_output_is_not_found(robot):
    with Wire(robot.ports.rtde) as wire:
        wire.send(VERSION_2 + setup_outputs('timestamp', 'no_such_thing'))
        wire.rtde()
        assert wire.rtde()[1][3:] == b'\x00DOUBLE,NOT_FOUND'


LATE_OUTPUTS = (
    'elbow_position output_int_register_24 input_bit_register_64 safety_status payload_cog '
    'script_control_line payload_inertia ft_raw_wrench'
)


@pytest.mark.parametrize(
    ('model', 'polyscope', 'missing'),
    [
        ('ur5', '3.4', LATE_OUTPUTS),
        ('ur5', '3.15', 'ft_raw_wrench'),
        ('ur5e', '5.5.0', 'payload_cog script_control_line payload_inertia ft_raw_wrench'),
        ('ur5e', '5.9', 'payload_inertia'),
        ('ur5e', '10.7', ''),
    ],
)
def test_older_software_lacks_the_outputs_that_the_guide_dates_later(model, polyscope, missing):
    names = ['output_int_register_23', 'safety_status_bits', *LATE_OUTPUTS.split()]
    with (
        SimulatedRobot(SimulatorConfig(**FREE, model=model, polyscope=polyscope)) as robot,
        Wire(robot.ports.rtde) as wire,
    ):
        wire.send(VERSION_2 + setup_outputs(*names))
        wire.rtde()
        types = wire.rtde()[1][4:].decode().split(',')
    answers = zip(names, types, strict=True)
    assert [name for name, kind in answers if kind == 'NOT_FOUND'] == missing.split()


def test_older_software_lacks_the_later_input_registers():
    with (
        SimulatedRobot(SimulatorConfig(**FREE, model='ur5', polyscope='3.8')) as robot,
        Wire(robot.ports.rtde) as wire,
    ):
        wire.send(setup_inputs('input_int_register_23', 'input_int_register_24'))
        assert wire.rtde()[1][3:] == b'\x00INT32,NOT_FOUND'


def test_the_message_of_a_client_is_in_the_log(robot):
    with Wire(robot.ports.rtde) as wire:
        wire.send(struct.pack('>HB', 17, ord('M')) + b'\x05hello\x06client\x03' + START)
        wire.rtde()
        assert 'client: hello' in robot.state().messages


def test_all_known_outputs_are_streamed(robot):
    from ur_cartesian_driver.protocol.rtde.rtde_fields import OUTPUT_TYPES

    with Wire(robot.ports.rtde) as wire:
        wire.send(VERSION_2 + setup_outputs(*OUTPUT_TYPES) + START)
        wire.rtde()
        assert b'NOT_FOUND' not in wire.rtde()[1]
        wire.rtde()
        size = 4 + sum(struct.calcsize('>' + kind.codes) for kind in OUTPUT_TYPES.values())
        assert len(wire.rtde()[1]) == size


def test_the_slider_and_an_output_can_be_set_through_rtde(robot):
    with Wire(robot.ports.rtde) as wire:
        wire.send(
            setup_inputs(
                'speed_slider_mask',
                'speed_slider_fraction',
                'standard_digital_output_mask',
                'standard_digital_output',
            )
        )
        wire.rtde()
        wire.send(struct.pack('>HBBIdBB', 18, ord('U'), 1, 1, 0.25, 0b110, 0b011))
        wait_for(lambda: robot.state().speed_slider == 0.25)
        assert robot.state().digital_outputs == 0b010


def test_a_client_that_talks_nonsense_is_disconnected_and_the_others_are_not(robot):
    with Wire(robot.ports.rtde) as good, Wire(robot.ports.rtde) as bad:
        good.send(VERSION_2 + setup_outputs('timestamp') + START)
        bad.send(b'\x00\x01\x02\x03')
        assert bad.socket.recv(100) == b''
        for _ in range(20):
            good.rtde()


@pytest.mark.slow
def test_a_client_that_does_not_read_is_dropped_and_stalls_nobody():
    from ur_cartesian_driver.protocol.rtde.rtde_fields import OUTPUT_TYPES

    with (
        SimulatedRobot(SimulatorConfig(**FREE, rate=0.0)) as robot,
        Wire(robot.ports.rtde) as lazy,
        Wire(robot.ports.rtde) as good,
    ):
        lazy.send(VERSION_2 + setup_outputs(*OUTPUT_TYPES) + START)
        good.send(VERSION_2 + setup_outputs('timestamp') + START)
        while 'RTDE 2' in robot.status_line():
            good.rtde()
        for _ in range(100):
            good.rtde()
