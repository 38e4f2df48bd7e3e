# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Faults on demand, seen from outside: in cycles of the virtual clock."""

from __future__ import annotations

from math import dist

import pytest
from rtde_requests import setup_outputs, START, VERSION_2

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.state.rtde_state import RobotMode, RuntimeState, SafetyMode
from ur_cartesian_driver.sim import assemble, MemorySockets, SimulatorConfig
from ur_cartesian_driver.sim.faults.fault_parser import parse_fault
from ur_cartesian_driver.sim.faults.fault_values import (
    DEVIATION_AXES,
    DeviationFault,
)
from ur_cartesian_driver.sim.faults.impaired_sockets import ImpairedSockets
from ur_cartesian_driver.sim.faults.impairment import DelayLine, ImpairedConnection, Impairment
from ur_cartesian_driver.sim.interfaces.rtde_session import RtdeSession
from ur_cartesian_driver.sim.rtde_output_values import output_getter

UP = 'movel(pose_add(get_target_tcp_pose(), p[0, 0, 0.2, 0, 0, 0]), a=1, v=0.1)'
DOWN = UP.replace('0.2', '-0.2')


# --- When ------------------------------------------------------------------------------------


def add(bench, *texts):
    for text in texts:
        bench.faults.add(parse_fault(text))


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
    assert not bench.faults.active
    add(bench, 'slider 0.5', 'offset pose x 0.1 for 0.1 s')
    assert bench.faults.active
    bench.wait(0.2)
    assert not bench.faults.active


def test_cleared_faults_do_not_happen_and_no_longer_last(bench):
    add(bench, 'protective_stop at 0.1 s', 'offset pose x 0.1')
    bench.step()
    bench.faults.clear()
    bench.wait(0.5)
    assert not stopped(bench)
    assert read(bench, 'actual_TCP_pose') == read(bench, 'target_TCP_pose')


# --- Events ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('text', 'safety', 'mode'),
    [
        ('protective_stop', SafetyMode.PROTECTIVE_STOP, RobotMode.RUNNING),
        ('safeguard_stop', SafetyMode.SAFEGUARD_STOP, RobotMode.RUNNING),
        ('emergency_stop', SafetyMode.ROBOT_EMERGENCY_STOP, RobotMode.POWER_OFF),
        ('violation', SafetyMode.VIOLATION, RobotMode.POWER_OFF),
        ('fault', SafetyMode.FAULT, RobotMode.POWER_OFF),
        ('power_off', SafetyMode.NORMAL, RobotMode.POWER_OFF),
    ],
)
def test_a_stop_is_reported(bench, text, safety, mode):
    add(bench, text)
    bench.wait(0.1)
    assert read(bench, 'safety_mode') == safety
    assert read(bench, 'robot_mode') == mode


def test_another_client_stops_and_pauses_and_plays(bench):
    bench.start('while True:\nsync()\nend')
    bench.wait(0.1)
    for text, state in (
        ('pause', RuntimeState.PAUSED),
        ('play', RuntimeState.PLAYING),
        ('stop', RuntimeState.STOPPED),
    ):
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
    return output_getter(output, 0)(bench.controller)


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
    return [
        a - b
        for a, b in zip(read(bench, f'actual_{name}'), read(bench, f'target_{name}'), strict=True)
    ]


@pytest.mark.parametrize('axis', DEVIATION_AXES)
@pytest.mark.parametrize('quantity', ['pose', 'twist', 'acceleration'])
def test_an_offset_shows_on_its_axis_alone_while_the_arm_moves(bench, quantity, axis):
    bench.start(UP)
    add(bench, f'offset {quantity} {axis} 0.003 at 0.3 s for 0.2 s')
    bench.wait(0.2)
    assert error_of(bench, quantity) == pytest.approx([0.0] * 6, abs=1e-12)
    bench.wait(0.2)
    assert error_of(bench, quantity) == pytest.approx(
        [0.003 if other == axis else 0.0 for other in DEVIATION_AXES], abs=1e-9
    )
    bench.wait(0.2)
    assert error_of(bench, quantity) == pytest.approx([0.0] * 6, abs=1e-12)


@pytest.mark.parametrize('quantity', ['pose', 'twist', 'acceleration'])
def test_a_ramp_grows_with_time(bench, quantity):
    add(bench, f'ramp {quantity} y 0.01 at 0.1 s')
    bench.wait(0.6)
    assert error_of(bench, quantity)[1] == pytest.approx(0.005)


@pytest.mark.parametrize('calibrated', [False, True])
def test_the_measured_joints_lead_to_the_measured_pose(make_bench, calibrated):
    from ur_cartesian_driver.kinematics.robot_models import robot_model
    from ur_cartesian_driver.sim.calibration import random_calibration

    bench = make_bench(geometry=random_calibration(robot_model('ur5e'), 3) if calibrated else None)
    add(bench, 'offset pose x 0.01', 'offset pose rx 0.02')
    motion = bench.controller.motion
    for motion.T_flange_tcp in (Pose((0.0, 0.02, 0.1)), Pose((0.0, 0.0, 0.3))):
        bench.step(2)
        q, pose = (
            read(bench, 'actual_q'),
            Pose.from_rotation_vector(read(bench, 'actual_TCP_pose')),
        )
        T_base_tcp = bench.controller.arm.forward(q) @ motion.T_flange_tcp
        assert T_base_tcp.distance_to(pose) < 1e-9
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
        [0.01, 0.02, 0.01]
    )


def noisy_packages(seed=0, cycles=200):
    """The bytes that an RTDE client gets from a robot with noise."""
    controller, faults = assemble(SimulatorConfig())
    faults.add(DeviationFault(quantity='pose', axis='x', shape='noise', amount=1e-3, seed=seed))
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
    line = DelayLine(0.0)
    line.put(b'late', 2.0)
    line.put(b'early', 1.0)
    assert [line.take(t) for t in (0.5, 1.5, 2.0, 3.0)] == [b'', b'', b'lateearly', b'']


def test_a_throttled_line_trickles_at_its_rate():
    line = DelayLine(0.0)
    line.put(bytes(100), 0.0)
    sizes = [len(line.take(0.125 * i, rate=40.0)) for i in range(1, 31)]
    assert sizes == [5] * 20 + [0] * 10


def test_what_was_not_used_of_a_rate_is_not_saved():
    line = DelayLine(0.0)
    line.take(10.0, rate=40.0)
    line.put(bytes(100), 10.0)
    assert len(line.take(10.125, rate=40.0)) == 5


def test_a_cured_connection_lets_everything_go_at_once():
    impaired = ImpairedConnection(Impairment(delay=5.0), now=0.0)
    impaired.queue_outgoing(b'out', 0.0)
    impaired.queue_incoming(b'in', 0.0)
    impaired.impairment = None
    assert (impaired.due_outgoing(0.1), impaired.due_incoming(0.1), impaired.is_over) == (
        b'out',
        b'in',
        True,
    )


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
    sockets = ImpairedSockets(memory)
    controller, bench.faults = assemble(SimulatorConfig(), sockets)
    bench.controller = controller
    bench.programs = controller.programs
    bench.faults.interfaces['sockets'] = sockets
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


@pytest.mark.parametrize(
    ('text', 'answered'), [('half_open sockets', False), ('silence sockets', True)]
)
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


def test_a_delay_of_sockets_delays_the_end_of_the_data_too(talk):
    bench, peer = talk
    add(bench, 'delay sockets 0.3 s')
    bench.step()
    peer.feed(b'hello')
    peer.hang_up()
    bench.wait(0.2)
    assert 'hello' not in bench.log
    bench.wait(0.4)
    assert 'hello' in bench.log
