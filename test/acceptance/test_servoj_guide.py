# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The manufacturer's sample program for buffered servoj runs, and an RTDE client drives it.

``programs/servoj_guide.script`` is the sample of Universal Robots' guide "Trajectory improvements
for servoj()", word for word. Its indentation was lost and has not been restored, which
a controller does not mind. The client is our RTDE codec; it and the controller take turns cycle by
cycle, so the tests need no real time and are deterministic; the last one uses TCP.
"""

from math import pi, sin
from pathlib import Path
from socket import create_connection
from typing import Any

import pytest

from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.protocol.rtde.rtde_client import (
    DataReceived,
    HandshakeDone,
    RtdeClientCodec,
)
from ur_cartesian_driver.sim import SimulatorConfig
from ur_cartesian_driver.sim.controller_assembly import assemble
from ur_cartesian_driver.sim.interfaces.rtde_session import RtdeSession
from ur_cartesian_driver.sim.motion.motion_ownership import FreedriveState
from ur_cartesian_driver.sim.programs.script_upload import UploadDecoder

pytestmark = pytest.mark.slow

PROGRAM = Path(__file__).parent / 'programs' / 'servoj_guide.script'
CYCLE = 0.002
IDLE, TEACH, SERVO = 0, 1, 2
WAITING, EXTERNAL_TO_ROBOT = 0, 2
THRESHOLD = 0.3

OUTPUTS = (
    'timestamp',
    'actual_q',
    'actual_qd',
    'speed_scaling',
    'target_speed_fraction',
    'runtime_state',
    'output_int_register_24',
    'output_int_register_25',
    'output_double_register_24',
)
MODE, SEQUENCE, ERROR, SYNC = (f'input_int_register_{i}' for i in range(24, 28))
JOINTS = [f'input_double_register_{i}' for i in range(24, 30)]
THRESHOLDS = [f'input_double_register_{i}' for i in range(30, 36)]
STATE_TIME = 'input_double_register_46'


class ExternalController:
    """The guide's other side: writes registers, one package in each cycle, and reads packets."""

    def __init__(self):
        self.controller = assemble(SimulatorConfig()).controller
        self._session = RtdeSession(self.controller, set())
        self._client = RtdeClientCodec(
            OUTPUTS, [MODE, SEQUENCE, ERROR, SYNC, *JOINTS, *THRESHOLDS, STATE_TIME]
        )
        self._slider = RtdeClientCodec(
            ['timestamp'], ['speed_slider_mask', 'speed_slider_fraction']
        )
        self._inputs = self._connect(self._session, self._client)
        self._slider_session = RtdeSession(self.controller, set())
        self._slider_inputs = self._connect(self._slider_session, self._slider)
        self.values: dict[str, float] = dict.fromkeys(self._inputs.names, 0)
        self.values |= dict.fromkeys(THRESHOLDS, THRESHOLD)
        self.counting = True
        self.packets = []
        self.cycle()
        self.hold(self.q)
        # As a script port does; text without indentation has no line that ends it for sure.
        (program,) = UploadDecoder().feed(PROGRAM.read_bytes())
        self.controller.programs.submit(program.text)

    @staticmethod
    def _connect(session, client):
        data, ready = client.start(), []
        while not ready:
            ready = [
                event
                for event in client.feed(session.feed(data))
                if isinstance(event, HandshakeDone)
            ]
            data = client.data_to_send()
        return ready[0].inputs

    def __getattr__(self, name):
        """Return a field of the newest packet."""
        fields = {
            'q': 1,
            'qd': 2,
            'scaling': 3,
            'slider': 4,
            'state': 5,
            'mode': 6,
            'last_sequence': 7,
            'lag': 8,
        }
        if name not in fields:
            raise AttributeError(name)
        return self.packets[-1][fields[name]]

    @property
    def log(self):
        return list(self.controller.messages.log)

    @property
    def stopped(self):
        return self.state == RuntimeState.STOPPED

    def hold(self, q):
        self.values |= zip(JOINTS, q, strict=True)

    def cycle(self):
        """Let one cycle pass: the controller's, then its packet, then our answer."""
        self.controller.step()
        for event in self._client.feed(b''.join(self._session.packages())):
            assert isinstance(event, DataReceived)
            self.packets.append(event.values)
        if self.counting:
            self.values[SEQUENCE] += 1
        self._session.feed(self._inputs.pack(list(self.values.values())))

    def wait(self, seconds):
        for _ in range(round(seconds / CYCLE)):
            self.cycle()

    def until(self, condition, within=5.0):
        """Pass cycles until something holds; return the time that it took [s]."""
        begin = len(self.packets)
        while not condition():
            assert (len(self.packets) - begin) * CYCLE < within, (self.log, self.packets[-1])
            self.cycle()
        return (len(self.packets) - begin) * CYCLE

    def set_slider(self, fraction):
        self._slider_session.feed(self._slider_inputs.pack([1, fraction]))

    def stream(self, path, seconds, stretch=lambda client: 1.0):
        """
        Write the waypoint of each cycle, with the time that it belongs to.

        :param path: time on the trajectory [s] -> joint positions [rad].
        :param stretch: how much of a cycle the trajectory advances; the client's own slowing down.
        """
        time = 0.0
        while time < seconds and not self.stopped:
            time += CYCLE * stretch(self)
            self.hold(path(time))
            self.values[STATE_TIME] += CYCLE * stretch(self)
            self.cycle()


@pytest.fixture
def client():
    """A client that the program listens to, in mode IDLE."""
    made = ExternalController()
    made.until(lambda: made.last_sequence > 0)
    return made


@pytest.fixture
def servo(client):
    """A client in mode SERVO that holds the arm in place."""
    client.values |= {MODE: SERVO, SYNC: EXTERNAL_TO_ROBOT}
    client.until(lambda: client.mode == SERVO)
    client.wait(0.1)
    return client


def swing(home, amplitude=0.2, period=2.0):
    """Return a smooth motion of two joints, there and back."""

    def path(time):
        displacement = amplitude * sin(pi * time / period) ** 2
        return (home[0] + displacement, home[1] - 0.5 * displacement, *home[2:])

    return path


def test_program_begins_idle_and_reports_the_sequence_of_the_client(client):
    assert client.mode == IDLE
    assert client.state == RuntimeState.PLAYING
    client.wait(0.5)
    # Written in one cycle, read by the program and reported in the next.
    assert client.values[SEQUENCE] - client.last_sequence == 1
    assert client.log == [
        'external_control init starting',
        'external_control init done',
        f'max_joint_divergence_thresholds = {[THRESHOLD] * 6}',
    ]


def test_modes_follow_the_client_with_their_entry_and_exit(client):
    client.values[MODE] = TEACH
    client.until(lambda: client.mode == TEACH)
    client.wait(2 * CYCLE)
    assert client.controller.freedrive is FreedriveState.TEACH
    client.values |= {MODE: SERVO, SYNC: EXTERNAL_TO_ROBOT}
    client.until(lambda: client.mode == SERVO)
    client.wait(2 * CYCLE)
    assert client.controller.freedrive is FreedriveState.OFF
    client.stream(swing(client.q), 0.5)
    client.values |= {MODE: IDLE, SYNC: WAITING}
    client.until(lambda: client.log[-1] == 'running entry invokes for IDLE')
    assert max(map(abs, client.qd)) == 0.0
    texts = [line for line in client.log if 'invokes' in line]
    assert texts.count('running exit invokes for TEACH') == 1
    assert 'finished exit invokes for SERVO' in texts
    assert client.state == RuntimeState.PLAYING


def test_arm_follows_the_stream_with_the_lookahead_as_its_lag(servo):
    home, start = servo.q, len(servo.packets)
    path = swing(home)
    servo.stream(path, 2.0)
    # The program's lookahead is 0.06 s, and a waypoint takes 3 cycles through the registers.
    late = round(0.06 / CYCLE) + 3
    for i, packet in enumerate(servo.packets[start + late :]):
        assert packet[1] == pytest.approx(path((i + 1) * CYCLE), abs=3e-3)
    servo.wait(0.5)
    assert servo.q == pytest.approx(path(2.0), abs=1e-4)


def test_no_waypoint_waits_at_full_speed(servo):
    servo.stream(swing(servo.q), 1.0)
    lags = [packet[8] for packet in servo.packets[-400:]]
    assert min(lags) >= 0.0
    assert max(lags) <= 2 * CYCLE + 1e-9


def test_waypoints_are_buffered_while_the_arm_is_slowed_down_and_none_is_lost(servo):
    home, start = servo.q, len(servo.packets)
    path = swing(home)
    servo.set_slider(0.5)
    servo.stream(path, 1.0)
    # Each waypoint of 2 ms takes 4 ms: half of them wait.
    assert (servo.scaling, servo.slider) == pytest.approx((1.0, 0.5))
    assert servo.lag == pytest.approx(0.5, abs=0.02)
    held = servo.q
    servo.values[SYNC] = EXTERNAL_TO_ROBOT
    took = servo.until(lambda: servo.lag < 1e-6)
    assert took == pytest.approx(1.0, abs=0.05)
    servo.wait(0.5)
    assert held != pytest.approx(path(1.0), abs=1e-2)
    assert servo.q == pytest.approx(path(1.0), abs=1e-4)
    # The path is the same, only later: joint 2 is always displaced by half as much as joint 1.
    for packet in servo.packets[start:]:
        displacements = [b - a for a, b in zip(home, packet[1], strict=True)]
        assert displacements[1] == pytest.approx(-0.5 * displacements[0], abs=1e-6)


def test_client_that_heeds_the_lag_time_keeps_the_buffer_short(servo):
    servo.set_slider(0.4)
    # The guide: slow the trajectory down by the controller's report.
    servo.stream(swing(servo.q), 1.0, lambda client: 0.2 if client.lag > 0.05 else 1.0)
    assert (servo.scaling, servo.slider) == pytest.approx((1.0, 0.4))
    assert max(packet[8] for packet in servo.packets) < 0.07
    assert not servo.stopped


def test_buffer_that_is_full_is_reported(servo):
    servo.set_slider(0.0)
    servo.stream(swing(servo.q, period=20.0), 2.2)
    assert 'Buffer overflow' in servo.log


def test_waypoint_beyond_the_divergence_threshold_halts_the_program(servo):
    home = servo.q
    servo.stream(lambda time: (home[0] + 1.1 * THRESHOLD, *home[1:]), 0.1)
    servo.until(lambda: servo.stopped)
    assert servo.log[-1] == 'Max divergence threshold crossed.'
    servo.wait(0.5)
    assert servo.qd == (0.0,) * 6
    assert abs(servo.q[0] - home[0]) < 0.5 * THRESHOLD


def test_waypoint_within_the_threshold_is_reached(servo):
    home = servo.q
    servo.stream(lambda time: (home[0] + 0.9 * THRESHOLD, *home[1:]), 1.0)
    assert not servo.stopped
    assert servo.q[0] == pytest.approx(home[0] + 0.9 * THRESHOLD, abs=1e-3)


def test_sequence_that_stands_still_halts_the_program_after_four_seconds(servo):
    servo.counting = False
    took = servo.until(lambda: servo.stopped, within=6.0)
    assert took == pytest.approx(2001 * CYCLE, abs=0.02)
    assert 'stale sequence ID counter exceeded limit' in servo.log


def test_sequence_that_grows_now_and_then_is_enough(servo):
    servo.counting = False
    for _ in range(3):
        servo.wait(3.5)
        servo.values[SEQUENCE] += 1
    assert not servo.stopped


@pytest.mark.parametrize(
    ('error', 'text'),
    [(1, 'stopping external control'), (7, 'unknown external error received: external_error = 7')],
)
def test_error_of_the_client_halts_the_program_and_the_arm_brakes(servo, error, text):
    servo.stream(swing(servo.q), 1.0)
    servo.values[ERROR] = error
    servo.until(lambda: servo.stopped)
    assert text in servo.log
    servo.wait(0.2)
    assert servo.qd == (0.0,) * 6


def test_same_inputs_give_the_same_packets():
    def run():
        client = ExternalController()
        client.values |= {MODE: SERVO, SYNC: EXTERNAL_TO_ROBOT}
        client.until(lambda: client.mode == SERVO)
        client.stream(swing(client.q), 0.3)
        return client.packets

    assert run() == run()


def test_program_follows_a_client_over_tcp_in_real_time(ur_sim):
    client = RtdeClientCodec(
        OUTPUTS, [MODE, SEQUENCE, ERROR, SYNC, *JOINTS, *THRESHOLDS, STATE_TIME]
    )
    values: dict[str, float] = dict.fromkeys(
        [MODE, SEQUENCE, ERROR, SYNC, *JOINTS, *THRESHOLDS, STATE_TIME], 0
    )
    values |= dict.fromkeys(THRESHOLDS, THRESHOLD) | {MODE: SERVO, SYNC: EXTERNAL_TO_ROBOT}
    q: Any = None
    inputs, path, time = None, None, 0.0
    with (
        create_connection(('127.0.0.1', ur_sim.ports.rtde), 5.0) as rtde,
        create_connection(('127.0.0.1', ur_sim.ports.primary), 5.0) as primary,
    ):
        rtde.sendall(client.start())
        while time < 1.5:
            for event in client.feed(rtde.recv(65536)):
                if isinstance(event, HandshakeDone):
                    inputs = event.inputs
                    primary.sendall(PROGRAM.read_bytes())
                elif isinstance(event, DataReceived):
                    _, q, _, _, _, state, mode, *_ = event.values
                    path = path or swing(q)
                    if mode == SERVO:
                        assert state == RuntimeState.PLAYING
                        time += CYCLE
                    # There and half back, then at rest.
                    values |= zip(JOINTS, path(min(time, 1.2)), strict=True)
                    values |= {SEQUENCE: values[SEQUENCE] + 1, STATE_TIME: time}
                    rtde.sendall(inputs.pack(list(values.values())))
            rtde.sendall(client.data_to_send())
    assert q == pytest.approx(path(1.2), abs=2e-3)
