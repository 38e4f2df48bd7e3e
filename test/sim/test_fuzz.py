# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Clients of every port that send nonsense, stop in the middle, hang up, or never read.

The robot answers or hangs up, and goes on; a second RTDE client gets every cycle meanwhile. Each
case has a seed, so it is the same in each run.
"""

from __future__ import annotations

from contextlib import ExitStack, suppress
from dataclasses import fields
import itertools
import json
from pathlib import Path
from random import Random
import socket
import struct
from typing import Any

import pytest
from tracked_files import tracked_files

from ur_cartesian_driver.protocol.rtde.rtde_fields import OUTPUT_TYPES
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig
from ur_cartesian_driver.sim.simulated_robot import Ports

HOST = '127.0.0.1'
#: Port and PolyScope version of each server; the two generations do not serve the same ones.
PORTS = [
    ('robot_api', '10.11') if field.name == 'robot_api' else (field.name, '')
    for field in fields(Ports)
]
FREE: dict[str, Any] = {
    field.name: 0 for field in fields(SimulatorConfig) if field.name.endswith('_port')
}
HERE = Path(__file__).parent
SEEDS = range(40)
#: No cycle may come so late [s]; a busy machine alone makes some late.
HUNG = 2.0

HANDSHAKE = [
    bytes.fromhex(frame['hex'])
    for frame in json.loads((HERE / 'golden' / 'rtde_handshake.json').read_text())[
        'handshake_with_types'
    ]['frames']
    if frame['direction'] == 'client_to_controller'
]
LINES = [
    line + b'\n'
    for line in (
        b'load a.urp',
        b'play',
        b'pause',
        b'stop',
        b'robotmode',
        b'programState',
        b'popup careful',
        b'power on',
        b'brake release',
        b'unlock protective stop',
        b'version',
        b'addToLog x',
        b'quit',
    )
]
SCRIPTS = [
    b'set speed 0.5\n',
    b'stop program\n',
    b'power on\n',
    b'set robotmode run\n',
    b'set_standard_digital_out(2, True)\n',
    b'textmsg("hello", [1, 2])\n',
    b'def a():\n  i = 0\n  while i < 50:\n    i = i + 1\n    sync()\n  end\nend\n',
    b'sec b():\n  set_tool_voltage(24)\nend\n',
    b'def c():\n  movej([0.1, -1.5, 1.5, -1.5, -1.5, 0.0])\n  speedl([0, 0, 0.1, 0, 0, 0])\nend\n',
    *(
        text
        for path in tracked_files(HERE / 'programs', '*.script')
        if b'socket_' not in (text := path.read_bytes())
    ),
]
REQUESTS = [
    b'PUT /universal-robots/robot-api/robotstate/v1/state HTTP/1.1\r\nHost: robot\r\n'
    b'Content-Length: 23\r\n\r\n{"action": "POWER_OFF"}\n',
    b'GET /universal-robots/robot-api/robotstate/v1/robotmode HTTP/1.1\r\nHost: robot\r\n\r\n',
    b'GET / HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n',
]
VALID = {'rtde': HANDSHAKE, 'dashboard': LINES, 'robot_api': REQUESTS}


def random_bytes(random, _):
    return [random.randbytes(random.randint(1, 3000))]


def truncated(random, valid):
    data = b''.join(valid)
    return [data[: random.randint(1, len(data))]]


def mutated(random, valid):
    data = bytearray(b''.join(random.choices(valid, k=4)))
    for _ in range(random.choice((1, 2, 5, 30))):
        data[random.randrange(len(data))] = random.choice((random.randrange(256), 0, 255, 10))
    return [bytes(data)]


def in_any_order(random, valid):
    return random.choices(valid, k=random.randint(1, 20))


def oversized(random, valid):
    head = random.choice((b'\xff\xff', b'\x00\x00\x00\x00', valid[0][:2], b'def a():\n', b'"'))
    return [head + random.choice((b'x', b'\x00', b'(', b'1+')) * 100_000]


def slow(random, valid):
    data = random.choice(valid)[:150]
    return [data[i : i + 1] for i in range(len(data))]


ATTACKS = (random_bytes, truncated, mutated, in_any_order, oversized, slow)


class Watcher:
    """An RTDE client that misses nothing."""

    def __init__(self, robot: SimulatedRobot) -> None:
        self._robot = robot
        self._socket = socket.create_connection((HOST, robot.ports.rtde), timeout=10.0)
        self._stream = self._socket.makefile('rb')
        recipe = struct.pack('>d', 500.0) + b'timestamp'
        self._socket.sendall(
            struct.pack('>HBH', 5, ord('V'), 2)
            + struct.pack('>HB', 3 + len(recipe), ord('O'))
            + recipe
            + struct.pack('>HB', 3, ord('S'))
        )
        self.last = self._stamp()

    def close(self) -> None:
        self._stream.close()
        self._socket.close()

    def _stamp(self) -> float:
        while True:
            size, kind = struct.unpack('>HB', self._stream.read(3))
            data = self._stream.read(size - 3)
            if kind == ord('U'):
                return struct.unpack('>d', data[1:])[0]

    def follow(self, cycles: int = 5) -> None:
        """Read on until some cycles after now; each must have come, once."""
        until = self._robot.call(lambda c: c.timestamp) + cycles * 0.002
        stamps = [self.last]
        while stamps[-1] < until:
            stamps.append(self._stamp())
        steps = [round((b - a) / 0.002) for a, b in itertools.pairwise(stamps)]
        assert set(steps) == {1}
        self.last = stamps[-1]


@pytest.fixture(scope='module')
def robot(polyscope):
    programs = {'a.urp': SCRIPTS[6].decode()}
    config = SimulatorConfig(**FREE, programs=programs, polyscope=polyscope, when_late='wait')
    with SimulatedRobot(config) as robot:
        yield robot


@pytest.fixture(scope='module')
def watcher(robot):
    watcher = Watcher(robot)
    yield watcher
    watcher.close()


def connect(robot: SimulatedRobot, port: str) -> socket.socket:
    return socket.create_connection((HOST, getattr(robot.ports, port)), timeout=10.0)


def until_hung_up(wire: socket.socket) -> bytes:
    """Say that nothing more comes; return all that the robot says before it hangs up too."""
    data = b''
    with suppress(ConnectionError, BrokenPipeError):
        with suppress(OSError):  # it has hung up already
            wire.shutdown(socket.SHUT_WR)
        while piece := wire.recv(65536):
            data += piece
    return data


@pytest.mark.slow
@pytest.mark.parametrize(('port', 'polyscope'), PORTS, scope='module')
@pytest.mark.parametrize('attack', ATTACKS)
def test_nonsense_ends_nothing_but_its_own_connection(robot, watcher, port, attack):
    for seed in SEEDS if attack is not slow else SEEDS[:4]:
        random = Random(f'{port} {attack.__name__} {seed}')
        with connect(robot, port) as wire:
            for piece in attack(random, VALID.get(port, SCRIPTS)):
                try:
                    wire.sendall(piece)
                except ConnectionError:
                    break  # the robot has hung up, as it may
                if attack is slow:
                    watcher.follow(1)
            if random.random() < 0.3:  # hang up hard: RST instead of FIN
                wire.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack('ii', 1, 0))
            else:
                until_hung_up(wire)
        watcher.follow()
    lateness = robot.lateness()
    assert lateness is not None
    assert lateness.worst < HUNG


@pytest.mark.slow
@pytest.mark.parametrize('polyscope', [''], scope='module')
@pytest.mark.parametrize('seed', SEEDS[:5])
def test_each_line_of_the_dashboard_is_answered_by_one_line(robot, watcher, seed):
    random = Random(seed)
    lines = [
        bytes(random.choices(b'abc powerlnt\t"\\%\xc3\x00', k=random.randrange(40)))
        for _ in range(50)
    ]
    with connect(robot, 'dashboard') as wire:
        wire.sendall(b'\n'.join(lines) + b'\n')
        assert until_hung_up(wire).count(b'\n') == 1 + len(lines)
    watcher.follow()


@pytest.mark.slow
@pytest.mark.parametrize(('port', 'polyscope'), PORTS, scope='module')
def test_clients_that_never_read_stall_nobody(robot, watcher, port):
    everything = struct.pack('>d', 0.0) + ','.join(OUTPUT_TYPES).encode()
    questions = {
        'rtde': HANDSHAKE[0]
        + struct.pack('>HB', 3 + len(everything), ord('O'))
        + everything
        + struct.pack('>HB', 3, ord('S')),
        'dashboard': b'PolyscopeVersion\n' * 200,
    }
    with ExitStack() as wires:
        for _ in range(3):
            wire = wires.enter_context(connect(robot, port))
            wire.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            wire.sendall(questions.get(port, b'textmsg("hello")\n' * 20))
        watcher.follow(200)
    watcher.follow()


@pytest.mark.slow
@pytest.mark.parametrize('polyscope', [''], scope='module')
def test_calls_that_are_given_up_at_once_stall_nobody(robot, watcher):
    for port, _ in [server for server in PORTS if not server[1]] * 5:
        connect(robot, port).close()
    watcher.follow()
