# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Faults on demand, seen from outside: in cycles of the virtual clock, and through sockets."""

from __future__ import annotations

from math import dist
from random import Random
import socket
import struct

import pytest

from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.state import RobotMode, RuntimeState, SafetyMode
from ur_cartesian_driver.sim import Controller, MemorySockets, SimulatedRobot, SimulatorConfig
from ur_cartesian_driver.sim.fault_text import parse_fault
from ur_cartesian_driver.sim.faults import (
    Action,
    After,
    AXES,
    Crossing,
    Delay,
    Deviation,
    Drop,
    Event,
    ForeignMotion,
    Garbage,
    HalfOpen,
    Silence,
    Slider,
    Throttle,
    Travelled,
)
from ur_cartesian_driver.sim.faulty_sockets import FaultySockets
from ur_cartesian_driver.sim.impairment import Hampered, Impairment, Line
from ur_cartesian_driver.sim.outputs import getter
from ur_cartesian_driver.sim.rtde_session import RtdeSession

UP = 'movel(pose_add(get_target_tcp_pose(), p[0, 0, 0.2, 0, 0, 0]), a=1, v=0.1)'
DOWN = UP.replace('0.2', '-0.2')


# --- In words --------------------------------------------------------------------------------

@pytest.mark.parametrize(('text', 'fault'), [
    ('protective_stop at 2 s', Event(action=Action.PROTECTIVE_STOP, when=After(2.0))),
    ('protective_stop at 0.35 m', Event(action=Action.PROTECTIVE_STOP, when=Travelled(0.35))),
    ('emergency_stop at z = -0.3 m',
     Event(action=Action.EMERGENCY_STOP, when=Crossing('z', -0.3))),
    ('stop', Event(action=Action.STOP)),
    ('unlock at 7s', Event(action=Action.UNLOCK, when=After(7.0))),
    ('play at x=.5', Event(action=Action.PLAY, when=Crossing('x', 0.5))),
    ('slider 0.3 at 1 s', Slider(fraction=0.3, when=After(1.0))),
    ('foreign_motion z 0.05 at 1 s', ForeignMotion(axis='z', distance=0.05, when=After(1.0))),
    ('offset pose x 0.002 at 1 s for 2 s', Deviation(
        quantity='pose', axis='x', shape='offset', amount=0.002, when=After(1.0), duration=2.0)),
    ('ramp twist rz -1e-3',
     Deviation(quantity='twist', axis='rz', shape='ramp', amount=-1e-3)),
    ('noise acceleration y 0.1 at 0.2 m', Deviation(
        quantity='acceleration', axis='y', shape='noise', amount=0.1, when=Travelled(0.2))),
    ('drop rtde at 5 s', Drop(interface='rtde', when=After(5.0))),
    ('drop rtde at 5 s for 2 s', Drop(interface='rtde', when=After(5.0), duration=2.0)),
    ('half_open primary', HalfOpen(interface='primary')),
    ('silence dashboard for 1.5 s', Silence(interface='dashboard', duration=1.5)),
    ('delay sockets 0.1 s', Delay(interface='sockets', seconds=0.1)),
    ('throttle primary 1000 at 1 s', Throttle(interface='primary', rate=1000.0, when=After(1.0))),
    ('garbage rtde', Garbage(interface='rtde')),
    ('garbage rtde 8 at 1 s', Garbage(interface='rtde', size=8, when=After(1.0))),
])
def test_a_fault_can_be_written_in_words(text, fault):
    assert parse_fault(text) == fault


@pytest.mark.parametrize(('text', 'word', 'expected'), [
    ('', 'the end', 'protective_stop'),
    ('protectivestop at 2 s', 'protectivestop', 'protective_stop'),
    ('protective_stop in 2 s', 'in', "'at'"),
    ('protective_stop at 2', 'the end', 's, m'),
    ('protective_stop at 2 h', 'h', 's, m'),
    ('protective_stop at noon', 'noon', 'a time'),
    ('protective_stop at -2 s', '-2', 'no negative'),
    ('protective_stop at z 3', '3', "'='"),
    ('protective_stop for 2 s', 'for', "'at'"),
    ('slider fast', 'fast', 'slider'),
    ('offset x 0.1', 'x', 'pose, twist, acceleration'),
    ('offset pose w 0.1', 'w', 'x, y, z'),
    ('offset pose x at 2 s', 'at', 'an amount'),
    ('drop', 'the end', 'an interface'),
    ('drop rtde for 2 m', 'm', "'s'"),
    ('delay rtde soon', 'soon', 'a time'),
    ('drop rtde at 2 s & stop', '&', "'for'"),
])
def test_a_word_that_is_not_understood_is_named(text, word, expected):
    with pytest.raises(ValueError, match='not understood') as raised:
        parse_fault(text)
    assert f'at {word!r}; ' in str(raised.value)
    assert expected in str(raised.value)
    assert str(raised.value).count('\n') == 0


@pytest.mark.parametrize('text', [
    'slider 1.5', 'delay rtde 0', 'throttle rtde -1', 'garbage rtde 0'])
def test_an_impossible_amount_is_refused(text):
    with pytest.raises(ValueError, match='cannot'):
        parse_fault(text)


def test_an_unknown_interface_is_refused_with_those_that_there_are():
    with pytest.raises(ValueError, match=r"'rdte'.*sockets.*rtde.*primary.*dashboard"):
        SimulatedRobot(SimulatorConfig(faults=['drop rdte']))


# --- When ------------------------------------------------------------------------------------

def add(bench, *texts):
    for text in texts:
        bench.controller.faults.add(parse_fault(text))


def z(bench):
    return bench.controller.motion.T_base_tcp.position[2]


def stopped(bench):
    return bench.controller.safety.mode is SafetyMode.PROTECTIVE_STOP


def test_a_fault_happens_in_the_cycle_of_its_time(bench):
    add(bench, 'protective_stop at 0.5 s')
    assert bench.until(lambda: stopped(bench)) == pytest.approx(0.5)


def test_a_fault_happens_where_the_tool_has_gone_so_far(bench):
    bench.start(UP)
    start = z(bench)
    add(bench, 'protective_stop at 0.05 m')
    bench.until(lambda: stopped(bench))
    assert z(bench) - start == pytest.approx(0.05, abs=2 * 0.1 * bench.controller.cycle)


def test_the_way_counts_from_where_the_fault_was_set(bench):
    add(bench, 'slider 1 at 10 m')
    bench.start(UP)
    bench.until(lambda: bench.programs.state is RuntimeState.STOPPED)
    add(bench, 'protective_stop at 0.05 m')
    bench.wait(0.1)
    assert not stopped(bench)


@pytest.mark.parametrize(('program', 'change'), [(UP, 0.1), (DOWN, -0.1)])
def test_a_fault_happens_where_the_tool_crosses_a_plane_from_either_side(bench, program, change):
    plane = z(bench) + change
    add(bench, f'protective_stop at z = {plane} m')
    bench.wait(0.1)
    bench.start(program)
    bench.until(lambda: stopped(bench))
    assert z(bench) == pytest.approx(plane, abs=2 * 0.1 * bench.controller.cycle)


def test_a_robot_without_faults_has_nothing_to_do_for_them(bench):
    assert not bench.controller.faults.active
    add(bench, 'slider 0.5', 'offset pose x 0.1 for 0.1 s')
    assert bench.controller.faults.active
    bench.wait(0.2)
    assert not bench.controller.faults.active


def test_cleared_faults_do_not_happen_and_no_longer_last(bench):
    add(bench, 'protective_stop at 0.1 s', 'offset pose x 0.1')
    bench.step()
    bench.controller.faults.clear()
    bench.wait(0.5)
    assert not stopped(bench)
    assert read(bench, 'actual_TCP_pose') == read(bench, 'target_TCP_pose')


# --- Events ----------------------------------------------------------------------------------

@pytest.mark.parametrize(('text', 'safety', 'mode'), [
    ('protective_stop', SafetyMode.PROTECTIVE_STOP, RobotMode.RUNNING),
    ('safeguard_stop', SafetyMode.SAFEGUARD_STOP, RobotMode.RUNNING),
    ('emergency_stop', SafetyMode.ROBOT_EMERGENCY_STOP, RobotMode.POWER_OFF),
    ('violation', SafetyMode.VIOLATION, RobotMode.POWER_OFF),
    ('fault', SafetyMode.FAULT, RobotMode.POWER_OFF),
    ('power_off', SafetyMode.NORMAL, RobotMode.POWER_OFF),
])
def test_a_stop_is_reported(bench, text, safety, mode):
    add(bench, text)
    bench.wait(0.1)
    assert read(bench, 'safety_mode') == safety
    assert read(bench, 'robot_mode') == mode


def test_another_client_stops_and_pauses_and_plays(bench):
    bench.start('while True:\nsync()\nend')
    bench.wait(0.1)
    for text, state in (('pause', RuntimeState.PAUSED), ('play', RuntimeState.PLAYING),
                        ('stop', RuntimeState.STOPPED)):
        add(bench, text)
        bench.wait(0.1)
        assert read(bench, 'runtime_state') == state


def test_another_client_unlocks(make_bench):
    bench = make_bench(unlock_delay=0.2)
    add(bench, 'protective_stop', 'unlock at 0.3 s')
    bench.wait(0.2)
    assert stopped(bench)
    bench.wait(0.2)
    assert not stopped(bench)


def test_a_fault_that_the_robot_refuses_is_logged_and_has_no_effect(bench, caplog):
    add(bench, 'unlock')
    bench.step()
    assert 'unlock had no effect' in caplog.text
    assert read(bench, 'safety_mode') == SafetyMode.NORMAL


def test_the_slider_moves(bench):
    add(bench, 'slider 0.3 at 0.1 s')
    bench.wait(0.2)
    assert read(bench, 'target_speed_fraction') == 0.3


@pytest.mark.parametrize('axis', ['x', 'z', 'ry'])
def test_a_foreign_motion_takes_the_arm_away_and_replaces_the_program(bench, axis):
    bench.start('while True:\nsync()\nend')
    bench.wait(0.1)
    before = bench.controller.motion.T_base_tcp
    add(bench, f'foreign_motion {axis} 0.05')
    bench.wait(2.0)
    after = bench.controller.motion.T_base_tcp
    assert bench.programs.name == 'foreign_motion'
    moved = after.angle_to(before) if axis == 'ry' else after.distance_to(before)
    assert moved == pytest.approx(0.05)


# --- Actual values ---------------------------------------------------------------------------

def read(bench, output):
    return getter(output, 0)(bench.controller)


def error_of_pose(bench):
    """The deviation of the measured pose in base axes: three of the position, three turns."""
    actual = Pose.from_rotation_vector(read(bench, 'actual_TCP_pose'))
    target = Pose.from_rotation_vector(read(bench, 'target_TCP_pose'))
    turn = Pose(quaternion=actual.quaternion) @ Pose(quaternion=target.quaternion).inverse()
    step = [a - b for a, b in zip(actual.position, target.position, strict=True)]
    return [*step, *turn.rotation_vector()[3:]]


def error_of(bench, quantity):
    if quantity == 'pose':
        return error_of_pose(bench)
    name = {'twist': 'TCP_speed', 'acceleration': 'TCP_acceleration'}[quantity]
    return [a - b for a, b in zip(read(bench, f'actual_{name}'), read(bench, f'target_{name}'),
                                  strict=True)]


@pytest.mark.parametrize('axis', AXES)
@pytest.mark.parametrize('quantity', ['pose', 'twist', 'acceleration'])
def test_an_offset_shows_on_its_axis_alone_while_the_arm_moves(bench, quantity, axis):
    bench.start(UP)
    add(bench, f'offset {quantity} {axis} 0.003 at 0.3 s for 0.2 s')
    bench.wait(0.2)
    assert error_of(bench, quantity) == pytest.approx([0.0] * 6, abs=1e-12)
    bench.wait(0.2)
    assert error_of(bench, quantity) == pytest.approx(
        [0.003 if other == axis else 0.0 for other in AXES], abs=1e-9)
    bench.wait(0.2)
    assert error_of(bench, quantity) == pytest.approx([0.0] * 6, abs=1e-12)


@pytest.mark.parametrize('quantity', ['pose', 'twist', 'acceleration'])
def test_a_ramp_grows_with_time(bench, quantity):
    add(bench, f'ramp {quantity} y 0.01 at 0.1 s')
    bench.wait(0.6)
    assert error_of(bench, quantity)[1] == pytest.approx(0.005)


@pytest.mark.parametrize('calibrated', [False, True])
def test_the_measured_joints_lead_to_the_measured_pose(make_bench, calibrated):
    from ur_cartesian_driver.kinematics.robots import robot_model
    from ur_cartesian_driver.sim.calibration import random_calibration

    bench = make_bench(
        geometry=random_calibration(robot_model('ur5e'), 3) if calibrated else None)
    bench.controller.motion.T_flange_tcp = Pose((0.0, 0.02, 0.1))
    add(bench, 'offset pose x 0.01', 'offset pose rz 0.02')
    bench.step(2)
    motion, q = bench.controller.motion, read(bench, 'actual_q')
    T_base_tcp = bench.controller.arm.forward(q) @ motion.T_flange_tcp
    assert T_base_tcp.distance_to(
        Pose.from_rotation_vector(read(bench, 'actual_TCP_pose'))) < 1e-9
    assert 0.0 < dist(q, read(bench, 'target_q')) < 0.1


def test_the_measured_joint_speeds_lead_to_the_measured_twist(bench):
    bench.start(UP)
    add(bench, 'offset twist x 0.01')
    bench.wait(0.3)
    twist = bench.controller.arm.jacobian(read(bench, 'target_q')) @ read(bench, 'actual_qd')
    assert list(twist) == pytest.approx(read(bench, 'actual_TCP_speed'), abs=1e-4)


def test_an_acceleration_that_is_off_shows_in_the_speeds_too(bench):
    add(bench, 'offset acceleration z 0.5 for 0.2 s')
    bench.step(50)
    assert error_of(bench, 'twist')[2] == pytest.approx(0.05)
    assert dist(read(bench, 'actual_tool_accelerometer'), (0.0, 0.0, 0.0)) != pytest.approx(9.82)
    bench.step(100)
    assert error_of(bench, 'twist')[2] == 0.0


def test_programs_measure_the_same(bench):
    add(bench, 'offset pose x 0.01', 'offset twist y 0.02')
    log = bench.run("""
        sync()
        textmsg(get_actual_tcp_pose()[0] - get_target_tcp_pose()[0])
        textmsg(get_actual_tcp_speed()[1])
        q = get_actual_joint_positions()
        textmsg(get_forward_kin(q)[0] - get_target_tcp_pose()[0])""")
    assert [float(line.split()[-1]) for line in log[:4] if line[0].isdigit()] == pytest.approx(
        [0.01, 0.02, 0.01])


def noisy_packages(seed=0, cycles=200):
    """The bytes that an RTDE client gets from a robot with noise."""
    controller = Controller(SimulatorConfig())
    controller.faults.add(Deviation(
        quantity='pose', axis='x', shape='noise', amount=1e-3, seed=seed))
    session = RtdeSession(controller, set())
    for request in (VERSION_2, setup_outputs('actual_TCP_pose', 'actual_q'), START):
        session.feed(request)
    data = b''
    for _ in range(cycles):
        controller.step()
        data += b''.join(session.packages())
    return data


def test_noise_is_the_same_bytes_in_every_run_and_others_with_another_seed():
    assert noisy_packages() == noisy_packages()
    assert noisy_packages() != noisy_packages(seed=1)


def test_noise_has_the_deviation_that_was_asked_for(bench):
    add(bench, 'noise twist z 0.01')
    values = []
    for _ in range(2000):
        bench.step()
        values.append(read(bench, 'actual_TCP_speed')[2])
    assert sum(values) / len(values) == pytest.approx(0.0, abs=1e-3)
    assert (sum(v * v for v in values) / len(values)) ** 0.5 == pytest.approx(0.01, rel=0.05)


# --- Lines -----------------------------------------------------------------------------------

def test_a_line_lets_a_piece_go_when_it_is_due_and_keeps_the_order():
    line = Line(0.0)
    line.put(b'late', 2.0)
    line.put(b'early', 1.0)
    assert [line.take(t) for t in (0.5, 1.5, 2.0, 3.0)] == [b'', b'', b'lateearly', b'']


def test_a_throttled_line_trickles_at_its_rate():
    line = Line(0.0)
    line.put(bytes(100), 0.0)
    sizes = [len(line.take(0.125 * i, rate=40.0)) for i in range(1, 31)]
    assert sizes == [5] * 20 + [0] * 10


def test_what_was_not_used_of_a_rate_is_not_saved():
    line = Line(0.0)
    line.take(10.0, rate=40.0)
    line.put(bytes(100), 10.0)
    assert len(line.take(10.125, rate=40.0)) == 5


def test_a_cured_connection_lets_everything_go_at_once():
    hampered = Hampered(Impairment(delay=5.0), now=0.0)
    hampered.say(b'out', 0.0)
    hampered.hear(b'in', 0.0)
    hampered.impairment = None
    assert (hampered.said(0.1), hampered.heard(0.1), hampered.over) == (b'out', b'in', True)


# --- Sockets of programs, in memory ----------------------------------------------------------

ECHO = """
    global last = "none"
    socket_open("127.0.0.1", 50001)
    while True:
      socket_send_string("tick")
      sleep(0.05)
      global answer = socket_read_string(timeout=0.05)
      if answer != "":
        textmsg(answer)
      end
    end"""


@pytest.fixture
def talk(bench):
    """A program that talks to us, in memory: the bench and our end of the connection."""
    memory = MemorySockets()
    bench.controller = controller = Controller(SimulatorConfig(), FaultySockets(memory))
    bench.programs = controller.programs
    controller.faults.interfaces['sockets'] = controller.sockets
    accepted = memory.listen(50001)
    bench.start(ECHO)
    bench.until(lambda: bool(accepted))
    bench.wait(0.2)
    assert accepted[0].take().startswith(b'tick')
    return bench, accepted[0]


def test_a_program_finds_a_dropped_socket_closed(talk):
    bench, peer = talk
    add(bench, 'drop sockets')
    bench.wait(0.2)
    assert peer.state.name == 'CLOSED'


@pytest.mark.parametrize(('text', 'answered'), [('half_open sockets', False),
                                                ('silence sockets', True)])
def test_a_silent_program_says_nothing_and_a_half_open_socket_hears_nothing(talk, text, answered):
    bench, peer = talk
    add(bench, text)
    bench.step()
    peer.take()
    peer.feed(b'hello')
    bench.wait(0.5)
    assert not peer.take()
    assert peer.state.name == 'OPEN'
    assert ('hello' in bench.log) is answered


def test_delayed_sockets_answer_later_in_both_directions(talk):
    bench, peer = talk
    add(bench, 'delay sockets 0.4 s for 1 s')
    bench.step()
    peer.take()
    peer.feed(b'hello')
    bench.wait(0.35)
    assert not peer.take()
    assert 'hello' not in bench.log
    bench.wait(0.35)
    assert peer.take()
    assert 'hello' in bench.log


def test_garbage_comes_out_of_a_program(talk):
    bench, peer = talk
    add(bench, 'garbage sockets 32')
    peer.take()
    bench.step()
    assert len(peer.take().replace(b'tick', b'')) == 32


# --- Through real sockets --------------------------------------------------------------------

VERSION_2 = struct.pack('>HBH', 5, ord('V'), 2)
START = struct.pack('>HB', 3, ord('S'))


def setup_outputs(*names: str) -> bytes:
    payload = struct.pack('>d', 500.0) + ','.join(names).encode()
    return struct.pack('>HB', 3 + len(payload), ord('O')) + payload


class Client:
    """A socket that can wait for what must come and see that nothing comes."""

    def __init__(self, port: int) -> None:
        self.socket = socket.create_connection(('127.0.0.1', port), timeout=5.0)

    def ask(self, line: str) -> str:
        self.socket.sendall(line.encode() + b'\n')
        return self.line()

    def line(self) -> str:
        data = b''
        while not data.endswith(b'\n'):
            data += self.some(1)
        return data.decode().rstrip('\n')

    def some(self, size: int = 65536) -> bytes:
        data = self.socket.recv(size)
        assert data, 'the robot has closed the connection'
        return data

    def is_closed(self) -> bool:
        """Read until the connection ends; False when nothing more comes and it does not."""
        try:
            while self.socket.recv(65536):
                pass
        except TimeoutError:
            return False
        except ConnectionResetError:
            pass
        return True


@pytest.fixture
def connect():
    """Connect to a port; closed after the test."""
    clients = []

    def make(port):
        clients.append(Client(port))
        return clients[-1]

    yield make
    for client in clients:
        client.socket.close()


@pytest.fixture
def robot():
    config = SimulatorConfig(rtde_port=0, primary_port=0, dashboard_port=0, rate=20.0)
    with SimulatedRobot(config) as robot:
        yield robot


def streaming(connect, robot):
    client = connect(robot.ports.rtde)
    for request in (VERSION_2, setup_outputs('timestamp'), START):
        client.socket.sendall(request)
        client.some()
    return client


def passes(robot, seconds):
    """Wait until time has passed in the robot."""
    end = robot.state().timestamp + seconds
    while robot.state().timestamp < end:
        pass


def test_dropped_rtde_clients_are_disconnected_and_may_come_back(robot, connect):
    client, dashboard = streaming(connect, robot), connect(robot.ports.dashboard)
    robot.inject('drop rtde')
    assert client.is_closed()
    assert streaming(connect, robot).some()
    assert 'Connected' in dashboard.line()


def test_a_port_that_is_dropped_for_a_time_hangs_up_on_callers(robot, connect):
    robot.inject('drop dashboard for 1000 s')
    passes(robot, 0.1)
    assert connect(robot.ports.dashboard).is_closed()
    robot.clear_faults()
    passes(robot, 0.1)
    assert 'Connected' in connect(robot.ports.dashboard).line()


def test_a_half_open_connection_is_silent_and_open_while_new_ones_work(robot, connect):
    old = connect(robot.ports.dashboard)
    old.line()
    robot.inject(HalfOpen(interface='dashboard'))
    passes(robot, 0.1)
    old.socket.sendall(b'robotmode\n')
    assert connect(robot.ports.dashboard).line()
    old.socket.settimeout(0.05)
    assert not old.is_closed()


def test_silence_loses_what_is_said_and_ends(robot, connect):
    dashboard = connect(robot.ports.dashboard)
    dashboard.line()
    robot.inject('silence dashboard')
    passes(robot, 0.1)
    dashboard.socket.sendall(b'popup hello\n')
    while not robot.state().popups:  # it is heard
        pass
    robot.clear_faults()
    passes(robot, 0.1)
    assert dashboard.ask('robotmode') == 'Robotmode: RUNNING'  # not the answer to the popup


def test_silent_rtde_skips_whole_packages(robot, connect):
    client = streaming(connect, robot)
    robot.inject('silence rtde for 1 s')
    last, gap, data = None, 0.0, b''
    while gap < 0.5:
        data += client.some(4096)
        while len(data) >= 12:
            size, kind, _, stamp = struct.unpack_from('>HBBd', data)
            assert (size, kind) == (12, ord('U'))
            gap = max(gap, stamp - (last or stamp))
            last, data = stamp, data[size:]
    assert gap == pytest.approx(1.002, abs=0.005)


def test_a_delayed_dashboard_answers_after_the_way_there_and_back(robot, connect):
    dashboard = connect(robot.ports.dashboard)
    dashboard.line()
    robot.inject('delay dashboard 2 s')
    passes(robot, 0.1)
    before = robot.state().timestamp
    assert dashboard.ask('robotmode') == 'Robotmode: RUNNING'
    assert robot.state().timestamp - before >= 4.0


def test_a_throttled_dashboard_trickles(robot, connect):
    robot.inject('throttle dashboard 20')
    passes(robot, 0.1)
    before = robot.state().timestamp
    greeting = connect(robot.ports.dashboard).line()
    assert robot.state().timestamp - before >= (len(greeting) - 1) / 20.0


def test_a_delayed_farewell_still_comes(robot, connect):
    dashboard = connect(robot.ports.dashboard)
    dashboard.line()
    robot.inject('delay dashboard 1 s')
    passes(robot, 0.1)
    assert dashboard.ask('quit') == 'Disconnected'
    assert dashboard.is_closed()


@pytest.mark.parametrize('interface', ['rtde', 'primary', 'secondary', 'realtime', 'dashboard'])
def test_garbage_comes_out_of_every_port(robot, connect, interface):
    client = connect(getattr(robot.ports, interface))
    if interface == 'rtde':
        client.socket.sendall(VERSION_2)
    client.some()  # it has been accepted
    robot.inject(Garbage(interface=interface, size=3000, seed=1))
    wanted, data = Random(1).randbytes(3000), b''
    while wanted not in data:
        data += client.some()


def test_a_client_of_a_throttled_port_that_gets_too_far_behind_is_dropped(robot, connect):
    client = connect(robot.ports.primary)
    client.some()
    robot.inject('throttle primary 1')
    for _ in range(3):
        robot.inject(Garbage(interface='primary', size=500_000))
        passes(robot, 0.01)
    assert client.is_closed()


def test_a_flood_into_a_throttled_port_is_left_to_the_client(robot, connect):
    client = connect(robot.ports.dashboard)
    client.line()
    robot.inject('throttle dashboard 1')
    passes(robot, 0.1)
    client.socket.settimeout(0.1)

    def flood():
        for _ in range(500):
            client.socket.send(bytes(100_000))

    with pytest.raises(TimeoutError):  # of one piece, not of all
        flood()


@pytest.mark.ur_sim(rate=20.0, faults=['protective_stop at 0.5 s', Slider(fraction=0.25)])
def test_the_fixture_takes_faults(ur_sim):
    while ur_sim.state().safety_mode is not SafetyMode.PROTECTIVE_STOP:
        pass
    assert ur_sim.state().speed_slider == 0.25
