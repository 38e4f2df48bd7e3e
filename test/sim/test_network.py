# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The ports of the simulated robot, from outside: real sockets on the loopback interface."""

from __future__ import annotations

import gc
import itertools
import json
from pathlib import Path
import socket
import struct
import threading
import time

import pytest
from rtde_requests import setup_outputs, START, VERSION_2

from ur_cartesian_driver.motion.state import RuntimeState, SafetyMode
from ur_cartesian_driver.protocol.primary import (
    ConfigurationData,
    ErrorCodeMessage,
    KeyMessage,
    KinematicsInfo,
    PrimaryDecoder,
    RobotModeData,
    RobotState,
    RuntimeExceptionMessage,
    SafetyModeMessage,
    TextMessage,
    VersionMessage,
)
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

GOLDEN = json.loads((Path(__file__).parent / 'golden' / 'rtde_handshake.json').read_text())
FREE = {'rtde_port': 0, 'primary_port': 0, 'dashboard_port': 0}
#: The names and types in the tables of the manufacturer's client library, and sizes in bytes.
OUTPUTS = json.loads((Path(__file__).parent / 'golden' / 'rtde_outputs.json').read_text())
SIZES = {'BOOL': 1, 'UINT8': 1, 'UINT32': 4, 'INT32': 4, 'UINT64': 8, 'DOUBLE': 8,
         'VECTOR3D': 24, 'VECTOR6D': 48, 'VECTOR6INT32': 24}
HOST = '127.0.0.1'


class Wire:
    """A client's socket that reads exactly what is asked for."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection((HOST, port), timeout=5.0)

    def __enter__(self) -> Wire:
        return self

    def __exit__(self, *_: object) -> None:
        self.socket.close()

    def send(self, data: bytes) -> None:
        self.socket.sendall(data)

    def exactly(self, size: int) -> bytes:
        data = b''
        while len(data) < size:
            data += self._more(size - len(data))
        return data

    def line(self) -> str:
        data = b''
        while not data.endswith(b'\n'):
            data += self._more(1)
        return data.decode().rstrip('\n')

    def ask(self, line: str) -> str:
        self.send(line.encode() + b'\n')
        return self.line()

    def rtde(self) -> tuple[int, bytes]:
        size, kind = struct.unpack('>HB', head := self.exactly(3))
        return kind, head + self.exactly(size - 3)

    def _more(self, size: int) -> bytes:
        data = self.socket.recv(size)
        assert data, 'the robot has closed the connection'
        return data


class Primary(Wire):
    """A client of the primary interface; collects frames until one fits."""

    def __init__(self, port: int) -> None:
        super().__init__(port)
        self._decoder = PrimaryDecoder()
        self._waiting: list[object] = []

    def next(self) -> object:
        while not self._waiting:
            self._waiting += self._decoder.feed(self._more(65536))
        return self._waiting.pop(0)

    def await_(self, kind: type, **fields: object) -> object:
        while True:
            frame = self.next()
            if isinstance(frame, kind) and all(
                    getattr(frame, name) == value for name, value in fields.items()):
                return frame


@pytest.fixture
def robot():
    with SimulatedRobot(SimulatorConfig(**FREE, rate=20.0)) as robot:
        yield robot


def setup_inputs(*names: str) -> bytes:
    payload = ','.join(names).encode()
    return struct.pack('>HB', 3 + len(payload), ord('I')) + payload


PAUSE = struct.pack('>HB', 3, ord('P'))


@pytest.mark.parametrize('name', ['handshake', 'handshake_with_types'])
def test_the_handshake_of_the_manufacturers_library_is_answered(name):
    case = GOLDEN[name]
    with (SimulatedRobot(SimulatorConfig(**FREE, polyscope='5.23.0')) as robot,
          Wire(robot.ports.rtde) as wire):
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
    with SimulatedRobot(SimulatorConfig(**FREE, model='ur5', polyscope='3.15')) as robot, \
            Wire(robot.ports.rtde) as wire:
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
        times = [struct.unpack('>d', data[4:])[0]
                 for kind, data in (wire.rtde() for _ in range(203)) if kind == ord('U')]
    assert times[0] >= 40.0
    assert [b - a for a, b in itertools.pairwise(times)] == pytest.approx([0.002] * 199)


def test_a_frequency_is_kept_by_spreading_packages_over_the_cycles(robot):
    with Wire(robot.ports.rtde) as wire:
        wire.send(VERSION_2 + setup_outputs('timestamp', frequency=125.0) + START)
        times = [struct.unpack('>d', data[4:])[0]
                 for kind, data in (wire.rtde() for _ in range(50)) if kind == ord('U')]
    assert [b - a for a, b in itertools.pairwise(times)] == pytest.approx(
        [0.008] * (len(times) - 1))


@pytest.mark.parametrize(('settings', 'cycle'), [
    ({'rate': 0.0}, 0.002), ({'rate': 1.0}, 0.002), ({'rate': 4.0, 'model': 'ur5'}, 0.008)],
    ids=['virtual clock', 'real clock', 'CB3'])
def test_timestamps_advance_by_one_cycle_for_every_client(settings, cycle):
    with SimulatedRobot(SimulatorConfig(**FREE, **settings)) as robot, \
            Wire(robot.ports.rtde) as one, Wire(robot.ports.rtde) as two:
        one.send(VERSION_2 + setup_outputs('timestamp', frequency=1.0 / cycle) + START)
        two.send(VERSION_2 + setup_outputs('timestamp', 'control_step', frequency=0.0) + START)
        for wire in (one, two):
            stamps = [struct.unpack_from('>d', data, 4)[0]
                      for kind, data in (wire.rtde() for _ in range(203)) if kind == ord('U')]
            assert [b - a for a, b in itertools.pairwise(stamps)] == pytest.approx(
                [cycle] * (len(stamps) - 1), abs=1e-9)


@pytest.mark.parametrize('frequency', [250.0, 200.0, 150.0, 333.3, 499.0, 60.0])
def test_a_frequency_that_does_not_divide_is_kept_on_average(robot, frequency):
    with Wire(robot.ports.rtde) as wire:
        wire.send(VERSION_2 + setup_outputs('timestamp', frequency=frequency) + START)
        stamps = [struct.unpack('>d', data[4:])[0]
                  for kind, data in (wire.rtde() for _ in range(100)) if kind == ord('U')]
    gaps = [round((b - a) / 0.002) for a, b in itertools.pairwise(stamps)]
    assert {int(500.0 / frequency), -int(-500.0 // frequency)} >= set(gaps)
    assert stamps[-1] - stamps[0] == pytest.approx(len(gaps) / frequency, abs=0.002)


def test_a_pause_ends_the_packages_until_the_next_start(robot):
    with Wire(robot.ports.rtde) as wire:
        wire.send(VERSION_2 + setup_outputs('timestamp') + START)
        wire.send(PAUSE + START)
        kinds = [wire.rtde()[0] for _ in range(50)]
    paused = kinds.index(ord('P'))
    assert kinds[paused + 1] == ord('S')
    assert set(kinds[paused + 2:]) == {ord('U')}


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


def test_all_known_outputs_are_streamed(robot):
    from ur_cartesian_driver.protocol.rtde_fields import OUTPUT_TYPES
    with Wire(robot.ports.rtde) as wire:
        wire.send(VERSION_2 + setup_outputs(*OUTPUT_TYPES) + START)
        wire.rtde()
        assert b'NOT_FOUND' not in wire.rtde()[1]
        wire.rtde()
        size = 4 + sum(struct.calcsize('>' + kind.codes) for kind in OUTPUT_TYPES.values())
        assert len(wire.rtde()[1]) == size


def test_the_slider_and_an_output_can_be_set_through_rtde(robot):
    with Wire(robot.ports.rtde) as wire:
        wire.send(setup_inputs('speed_slider_mask', 'speed_slider_fraction',
                               'standard_digital_output_mask', 'standard_digital_output'))
        wire.rtde()
        wire.send(struct.pack('>HBBIdBB', 18, ord('U'), 1, 1, 0.25, 0b110, 0b011))
        until(lambda: robot.state().speed_slider == 0.25)
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
    from ur_cartesian_driver.protocol.rtde_fields import OUTPUT_TYPES
    with SimulatedRobot(SimulatorConfig(**FREE, rate=0.0)) as robot, \
            Wire(robot.ports.rtde) as lazy, Wire(robot.ports.rtde) as good:
        lazy.send(VERSION_2 + setup_outputs(*OUTPUT_TYPES) + START)
        good.send(VERSION_2 + setup_outputs('timestamp') + START)
        while 'RTDE 2' in robot.status_line():
            good.rtde()
        for _ in range(100):
            good.rtde()


def test_each_primary_client_gets_the_version_first_then_states(robot):
    for _ in range(2):
        with Primary(robot.ports.primary) as wire:
            version = wire.next()
            assert isinstance(version, VersionMessage)
            assert (version.major, version.minor) == (5, 21)
            packages = {type(p): p for p in wire.await_(RobotState).packages}
    assert packages[RobotModeData].robot_mode == 7
    assert packages[ConfigurationData].robot_type == 1
    assert packages[KinematicsInfo].a == pytest.approx((0, -0.425, -0.3922, 0, 0, 0))


def test_a_state_has_the_size_and_order_of_a_recorded_one(robot):
    with Primary(robot.ports.primary) as wire:
        wire.exactly(wire_size(wire))
        data = wire.exactly(wire_size(wire))
    # A recorded UR5e: its sub-packages in this order with these sizes.
    expected = {0: 47, 1: 251, 4: 101, 5: 225, 9: 53, 3: 75, 2: 37, 6: 445, 7: 61, 8: 9, 10: 43,
                11: 26, 12: 8}
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
    program = (b'stop program\ndef hello():\n\t# a comment\n\n\tif True:\n\t\ttextmsg("hi ", 1)\n'
               b'\tend\nend\n\n')
    with Primary(robot.ports.primary) as sender, Primary(robot.ports.primary) as listener:
        listener.next()
        for i in range(0, len(program), 7):
            sender.send(program[i:i + 7])
        for wire in (sender, listener):
            wire.await_(KeyMessage, title='PROGRAM_XXX_STARTED', text='hello')
            wire.await_(TextMessage, text='hi 1')
            wire.await_(KeyMessage, title='PROGRAM_XXX_STOPPED', text='hello')


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
    assert (error.line, error.column) == (2, 3)
    assert error.text == 'compile_error_name_not_found:calldoesntexist:'


def test_a_bare_line_is_a_program_of_its_own(robot):
    with Primary(robot.ports.primary) as wire:
        wire.send(b'set_standard_digital_out(2, True)\n')
        wire.await_(KeyMessage, title='PROGRAM_XXX_STOPPED')
    assert robot.state().digital_outputs == 0b100


def test_the_speed_can_be_set_by_a_line(robot):
    with Primary(robot.ports.primary) as wire:
        wire.send(b'set speed 0.5\n')
        until(lambda: robot.state().speed_slider == 0.5)


def test_in_local_control_the_script_port_is_read_only():
    with SimulatedRobot(SimulatorConfig(**FREE, remote_control=False)) as robot, \
            Primary(robot.ports.primary) as wire:
        wire.send(b'def a():\n  sync()\nend\n')
        assert wire.await_(ErrorCodeMessage).label == 'C210A0'
        assert robot.state().runtime_state is RuntimeState.STOPPED


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
        until(lambda: robot.state().timestamp > stopped_at + 5.1)
        wire.send(b'set unlock protective stop\n')
        wire.await_(SafetyModeMessage, safety_mode=1)
        assert robot.state().runtime_state is RuntimeState.PAUSED
        robot.play_program()
        until(lambda: robot.state().runtime_state is RuntimeState.PLAYING)


def test_the_dashboard_answers_in_the_robots_words():
    programs = {'a.urp': 'def a():\n  while True:\n    sync()\n  end\nend\n'}
    conversation = {
        'PolyscopeVersion': 'URSoftware 5.21.0.0 (Jan 01 2026)',
        'robotmode': 'Robotmode: POWER_OFF',
        'safetystatus': 'Safetystatus: NORMAL',
        'programState': 'STOPPED <unnamed>',
        'play': 'Failed to execute: play',
        'brake release': 'Brake releasing',
        'is in remote control': 'true',
        'get robot model': 'UR5',
        'load b.urp': 'File not found: b.urp',
        'load /ursim/programs/a.urp': 'Loading program: /ursim/programs/a.urp',
        'popup careful': 'showing popup',
        'close popup': 'closing popup',
        'brake_release': 'could not understand: "brake_release"',
    }
    config = SimulatorConfig(**FREE, rate=20.0, power='off', programs=programs)
    with SimulatedRobot(config) as robot, Wire(robot.ports.dashboard) as wire:
        assert wire.line() == 'Connected: Universal Robots Dashboard Server'
        for command, answer in conversation.items():
            assert wire.ask(command) == answer
        until(lambda: wire.ask('robotmode') == 'Robotmode: RUNNING')
        assert wire.ask('play') == 'Starting program'
        assert wire.ask('running') == 'Program running: true'
        assert wire.ask('pause') == 'Pausing program'
        until(lambda: wire.ask('programState') == 'PAUSED a.urp')
        assert wire.ask('stop') == 'Stopped'
        until(lambda: wire.ask('programState') == 'STOPPED a.urp')
        assert wire.ask('quit') == 'Disconnected'
        assert wire.socket.recv(10) == b''


def test_polyscope_x_has_no_dashboard():
    with SimulatedRobot(SimulatorConfig(**FREE, polyscope='10.8')) as robot, \
            Wire(robot.ports.rtde) as wire:
        assert robot.ports.dashboard == 0
        wire.send(struct.pack('>HB', 3, ord('v')))
        assert struct.unpack('>4I', wire.rtde()[1][3:]) == (10, 8, 0, 0)


@pytest.mark.parametrize(('settings', 'command', 'known'), [
    ({}, 'safetystatus', True),
    ({'polyscope': '5.3'}, 'safetystatus', False),
    ({'model': 'ur5'}, 'safetystatus', False),
    ({'model': 'ur5'}, 'getUserRole', True),
    ({}, 'getUserRole', False),
])
def test_the_dashboard_knows_what_its_software_knew(settings, command, known):
    with SimulatedRobot(SimulatorConfig(**FREE, **settings)) as robot, \
            Wire(robot.ports.dashboard) as wire:
        wire.line()
        assert ('could not understand' not in wire.ask(command)) is known


def test_a_script_reads_and_sends_integers_and_notices_a_closed_peer(robot):
    received = []
    robot.on_socket_data = lambda port, data: received.append((port, data))
    with socket.create_server((HOST, 0)) as server, Primary(robot.ports.primary) as wire:
        port = server.getsockname()[1]
        wire.send(f"""def echo():
  textmsg(socket_open("{HOST}", {port}, "s"))
  got = socket_read_binary_integer(3, "s", 0)
  textmsg(got)
  socket_send_int(got[1] + got[3], "s")
  textmsg(socket_read_binary_integer(2, "s", 0))
  textmsg(socket_send_int(1, "s"))
end
""".encode())
        peer, _ = server.accept()
        with peer:
            peer.settimeout(5.0)
            peer.sendall(struct.pack('>3i', 5, -6, 7)[:6])
            peer.sendall(struct.pack('>3i', 5, -6, 7)[6:])
            assert struct.unpack('>i', peer.recv(4)) == (12,)
        texts = [wire.await_(TextMessage).text for _ in range(4)]
    assert texts == ['True', '[3, 5, -6, 7]', '[0, -1, -1]', 'False']
    assert b''.join(data for _, data in received) == struct.pack('>3i', 5, -6, 7)
    assert {p for p, _ in received} == {port}


def test_a_refused_connection_is_false_at_once(robot):
    with socket.create_server((HOST, 0)) as server:
        port = server.getsockname()[1]
    with Primary(robot.ports.primary) as wire:
        wire.send(f'def a():\n  textmsg(socket_open("{HOST}", {port}))\nend\n'.encode())
        assert wire.await_(TextMessage).text == 'False'


def test_the_sockets_of_a_program_close_when_it_ends(robot):
    with socket.create_server((HOST, 0)) as server:
        port = server.getsockname()[1]
        robot.run_script(f'def a():\n  socket_open("{HOST}", {port})\n  sync()\nend\n')
        peer, _ = server.accept()
        with peer:
            peer.settimeout(5.0)
            assert peer.recv(10) == b''


def test_closing_leaves_no_thread_and_no_socket_behind(recwarn):
    threads = set(threading.enumerate())
    robot = SimulatedRobot(SimulatorConfig(**FREE)).start()
    ports = robot.ports
    with Wire(ports.rtde) as wire, Primary(ports.primary), Wire(ports.dashboard):
        wire.send(VERSION_2 + setup_outputs('timestamp') + START)
        wire.rtde()
        robot.close()
        robot.close()
    assert set(threading.enumerate()) == threads
    for port in (ports.rtde, ports.primary, ports.dashboard):
        with pytest.raises(ConnectionRefusedError):
            socket.create_connection((HOST, port), timeout=1.0)
    gc.collect()
    assert [str(w.message) for w in recwarn if w.category is ResourceWarning] == []


def test_a_taken_port_is_named(robot):
    with pytest.raises(OSError, match=f'primary port {robot.ports.primary} on 127.0.0.1'):
        SimulatedRobot(SimulatorConfig(**FREE | {'primary_port': robot.ports.primary})).start()


def test_an_emergency_stop_cuts_the_power(robot):
    robot.emergency_stop()
    until(lambda: robot.state().robot_mode == 3)
    assert robot.state().safety_mode is SafetyMode.ROBOT_EMERGENCY_STOP
    assert 'ROBOT_EMERGENCY_STOP' in robot.status_line()


def until(happened, within=5.0):
    """Ask again and again; each question takes the robot's thread a cycle to answer."""
    deadline = time.monotonic() + within
    while not happened():
        assert time.monotonic() < deadline
