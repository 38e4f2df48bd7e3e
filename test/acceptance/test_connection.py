# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Robots that are missing, wrong, stopped or lost: messages and behaviour of the driver."""

import contextlib
import os
import signal
import socket
import threading
from time import monotonic, sleep

import pytest
from waiting import wait_for

from ur_cartesian_driver.driver import ConnectionState, Driver, DriverConfig
from ur_cartesian_driver.motion.errors import ErrorCode, RobotNotReady
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, SegmentType, Waypoint

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]


@pytest.fixture
def long_goal(home):
    return Goal(waypoints=(Waypoint(pose=home(y=0.2), time=3.0), Waypoint(pose=home(), time=6.0)))


def moving(driver, goal):
    """Start a goal and return its motion when the arm moves."""
    motion = driver.start(driver.plan(goal))
    # The state may be unknown for a moment on a busy machine.
    wait_for(lambda: (state := driver.state) and max(map(abs, state.actual_qd)) > 0.02)
    return motion


def play(ur_sim):
    """Press play, as another client of the robot."""
    with socket.create_connection(('127.0.0.1', ur_sim.ports.dashboard)) as dashboard:
        dashboard.settimeout(5.0)
        dashboard.recv(1024)
        dashboard.sendall(b'play\n')
        dashboard.recv(1024)


def at_rest(ur_sim):
    return max(map(abs, ur_sim.state().qd)) < 1e-6


def test_cancel_brings_the_arm_to_rest_and_the_next_goal_runs(driver, long_goal, ur_sim, home):
    motion = moving(driver, long_goal)
    motion.cancel()
    outcome = motion.result(3.0)
    assert outcome.code is ErrorCode.CANCELLED
    assert at_rest(ur_sim)
    assert driver.execute(
        Goal(waypoints=(Waypoint(pose=home(), time=1.0),)), timeout=10.0
    ).succeeded


def test_cancel_in_the_middle_of_many_points(driver, home):
    """The robot discards points that it did not run; they do not run with the next goal."""
    points = tuple(
        Waypoint(pose=home(y=0.0002 * (i + 1)), time=0.01 * (i + 1)) for i in range(900)
    )
    motion = moving(driver, Goal(waypoints=points))
    motion.cancel()
    assert motion.result(4.0).code is ErrorCode.CANCELLED
    here = driver.state.actual_tcp_pose
    x, y, z = here.position
    target = Pose((x, y, z + 0.02), here.quaternion)
    assert driver.execute(
        Goal(waypoints=(Waypoint(pose=target, time=0.5),)), timeout=10.0
    ).succeeded
    assert driver.state.actual_tcp_pose.distance_to(target) < 1e-4


def test_a_second_motion_is_refused_and_the_first_goes_on(driver, long_goal):
    motion = moving(driver, long_goal)
    with pytest.raises(RobotNotReady, match='running'):
        driver.start(driver.plan(long_goal))
    motion.cancel()
    assert motion.result(3.0).code is ErrorCode.CANCELLED


@pytest.mark.ur_sim(unlock_delay=0.2)
def test_a_protective_stop_ends_the_goal_and_nothing_resumes(driver, long_goal, ur_sim):
    motion = moving(driver, long_goal)
    ur_sim.protective_stop()
    outcome = motion.result(2.0)
    assert outcome.code is ErrorCode.PROTECTIVE_STOP
    wait_for(lambda: at_rest(ur_sim))
    wait_for(lambda: driver.status.state is ConnectionState.STOPPED)
    assert 'protective stop' in driver.status.message
    q = ur_sim.state().q
    sleep(0.3)  # this one refuses to be unlocked any earlier
    ur_sim.unlock_protective_stop()
    play(ur_sim)
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    sleep(0.3)
    assert ur_sim.state().q == q
    driver.resend_robot_program()
    driver.wait_ready(30.0)


def test_an_emergency_stop_has_its_own_code(driver, long_goal, ur_sim):
    motion = moving(driver, long_goal)
    ur_sim.emergency_stop()
    assert motion.result(2.0).code is ErrorCode.EMERGENCY_STOP


def test_a_program_that_somebody_stops_ends_the_goal(driver, long_goal, ur_sim):
    motion = moving(driver, long_goal)
    ur_sim.stop_program()
    assert motion.result(2.0).code is ErrorCode.PROGRAM_STOPPED
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    sleep(0.3)
    assert not driver.status.program_running, 'a program must not start again by itself'
    driver.resend_robot_program()
    driver.wait_ready(30.0)


def test_a_slowed_and_paused_robot_is_not_a_failure(driver, home, ur_sim):
    goal = Goal(waypoints=(Waypoint(pose=home(y=0.1), time=1.0), Waypoint(pose=home(), time=2.0)))
    motion = moving(driver, goal)
    ur_sim.set_speed_slider(0.3)
    sleep(0.5)
    ur_sim.set_speed_slider(0.0)
    sleep(1.5)
    ur_sim.set_speed_slider(1.0)
    outcome = motion.result(20.0)
    assert outcome.succeeded, outcome.text


def test_a_goal_refused_for_the_robot_moves_nothing(make_driver, ur_sim):
    driver = make_driver(headless_mode=False)
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    pose = driver.state.actual_tcp_pose
    q = ur_sim.state().q
    outcome = driver.execute(Goal(waypoints=(Waypoint(pose=pose, time=1.0),)))
    assert outcome.code is ErrorCode.ROBOT_NOT_READY
    assert 'program' in outcome.text
    assert ur_sim.state().q == q


def test_a_robot_of_another_model_is_refused(make_driver):
    driver = make_driver(ur_type='ur10e')
    wait_for(lambda: driver.status.state is ConnectionState.REFUSED)
    assert 'ur5e' in driver.status.message
    assert 'ur_type is ur10e' in driver.status.message


@pytest.mark.ur_sim(model='ur5', polyscope='3.15.8')
def test_old_software_is_not_sent_what_it_does_not_know(driver, home):
    goal = Goal(
        waypoints=(Waypoint(pose=home(y=0.01)),),
        segments=(Segment(type=SegmentType.OPTIMIZED_LINEAR),),
    )
    outcome = driver.execute(goal)
    assert outcome.code is ErrorCode.INVALID_GOAL
    assert 'PolyScope 5.21' in outcome.text
    assert driver.execute(Goal(waypoints=(Waypoint(pose=home(y=0.01)),)), timeout=9.0).succeeded


@pytest.mark.ur_sim(power='off')
def test_an_arm_without_power_is_left_alone(make_driver, ur_sim):
    driver = make_driver()
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    assert 'POWER_OFF' in driver.status.message
    sleep(0.3)
    assert ur_sim.state().robot_mode.name == 'POWER_OFF'


def test_a_robot_that_does_not_answer_is_named(closed_port):
    with Driver(DriverConfig(robot_loop='thread', rtde_port=closed_port)) as driver:
        with pytest.raises(RobotNotReady, match=f'127.0.0.1 port {closed_port}'):
            driver.wait_ready(1.0)
        assert driver.state is None


def test_waiting_for_something_that_is_no_robot_ends(make_driver):
    with socket.create_server(('127.0.0.1', 0)) as server:
        port = server.getsockname()[1]
        driver = make_driver(rtde_port=port)
        connection, _ = server.accept()
        with connection:
            connection.sendall(b'HTTP/1.1 400 Bad Request\r\n\r\n')
            wait_for(lambda: driver.status.last_error, 10.0)  # given up after 5 s
        assert driver.status.state in (ConnectionState.DISCONNECTED, ConnectionState.CONNECTING)


@pytest.mark.parametrize(('number', 'bound'), [(signal.SIGKILL, 3.0), (signal.SIGSTOP, 8.0)])
def test_a_robot_loop_that_dies_or_hangs_ends_the_goal(
    make_driver, long_goal, ur_sim, driver, number, bound
):
    driver.close()
    wait_for(lambda: ur_sim.state().runtime_state.name == 'STOPPED')
    driver = make_driver(robot_loop='process')
    driver.wait_ready(30.0)
    motion = moving(driver, long_goal)
    os.kill(driver._loop.host.pid, number)
    outcome = motion.result(bound)
    assert outcome.code is ErrorCode.CONNECTION_LOST
    wait_for(lambda: at_rest(ur_sim))
    wait_for(lambda: driver.state is not None, 10.0)


def test_a_driver_with_a_robot_loop_that_hangs_can_be_closed(make_driver, driver, ur_sim):
    driver.close()
    wait_for(lambda: ur_sim.state().runtime_state.name == 'STOPPED')
    driver = make_driver(robot_loop='process')
    driver.wait_ready(30.0)
    os.kill(driver._loop.host.pid, signal.SIGSTOP)
    begin = monotonic()
    driver.close()
    assert monotonic() - begin < 10.0


def test_a_robot_loop_that_dies_does_not_bring_back_a_program_that_was_stopped(
    make_driver, ur_sim, driver
):
    driver.close()
    wait_for(lambda: ur_sim.state().runtime_state.name == 'STOPPED')
    driver = make_driver(robot_loop='process')
    driver.wait_ready(30.0)
    ur_sim.stop_program()
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    os.kill(driver._loop.host.pid, signal.SIGKILL)
    wait_for(lambda: driver.status.state is ConnectionState.DISCONNECTED)
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    sleep(0.5)
    assert ur_sim.state().runtime_state.name == 'STOPPED'
    driver.resend_robot_program()
    driver.wait_ready(30.0)


def test_the_arm_stops_when_the_owner_falls_silent(ur_sim, make_driver, home, long_goal, driver):
    del home
    driver.close()
    wait_for(lambda: ur_sim.state().runtime_state.name == 'STOPPED')
    silent = Driver(
        DriverConfig(
            robot_loop='thread',
            headless_mode=True,
            node_timeout=0.5,
            reverse_port=0,
            trajectory_port=0,
            script_command_port=0,
            script_sender_port=0,
            rtde_port=ur_sim.ports.rtde,
            primary_port=ur_sim.ports.primary,
            robot_receive_timeout=1.0,
            max_state_age=0.0,
        ),
        auto_heartbeat=False,
    )
    with silent:
        silent.wait_ready(30.0)
        motion = silent.start(silent.plan(long_goal))
        outcome = motion.result(3.0)
        assert outcome.code is ErrorCode.CANCELLED
        assert 'node_timeout' in outcome.text
        assert at_rest(ur_sim)


def test_closing_a_driver_stops_the_arm_and_ends_the_program(driver, long_goal, ur_sim):
    motion = moving(driver, long_goal)
    driver.close()
    assert motion.result(0.0).code in (ErrorCode.CANCELLED, ErrorCode.CONNECTION_LOST)
    wait_for(lambda: at_rest(ur_sim))
    wait_for(lambda: ur_sim.state().runtime_state.name == 'STOPPED')


class Relay:
    """A relay to a port of the robot that can be cut, as if RTDE alone broke."""

    def __init__(self, port):
        self._target = port
        self._pairs = []
        self._server = socket.create_server(('127.0.0.1', 0))
        self.port = self._server.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self):
        with contextlib.suppress(OSError):  # closed
            while True:
                client, _ = self._server.accept()
                robot = socket.create_connection(('127.0.0.1', self._target))
                self._pairs.append((client, robot))
                for source, sink in ((client, robot), (robot, client)):
                    threading.Thread(
                        target=self._forward, args=(source, sink), daemon=True
                    ).start()

    @staticmethod
    def _forward(source, sink):
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                sink.sendall(data)

    def cut(self):
        for end in (end for pair in self._pairs for end in pair):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()
        self._pairs.clear()

    def close(self):
        with contextlib.suppress(OSError):
            self._server.shutdown(socket.SHUT_RDWR)
        self._server.close()
        self.cut()


def test_a_program_that_outlives_rtde_is_used_again(make_driver, ur_sim):
    with contextlib.closing(Relay(ur_sim.ports.rtde)) as relay:
        driver = make_driver(rtde_port=relay.port)
        driver.wait_ready(30.0)
        pose = driver.state.actual_tcp_pose
        x, y, z = pose.position
        target = Pose((x, y + 0.2, z), pose.quaternion)
        motion = moving(driver, Goal(waypoints=(Waypoint(pose=target, time=3.0),)))
        relay.cut()
        assert motion.result(2.0).code is ErrorCode.CONNECTION_LOST
        assert driver.status.state is not ConnectionState.READY
        wait_for(lambda: at_rest(ur_sim))
        driver.wait_ready(30.0)
        assert driver.execute(
            Goal(waypoints=(Waypoint(pose=pose, time=1.0),)), timeout=10.0
        ).succeeded


@pytest.mark.ur_sim(power='off', power_on_time=0.1, brake_release_time=0.1)
def test_an_arm_that_a_person_switches_on_waits_for_resend_robot_program(make_driver, ur_sim):
    """An operator switches the power on; the program does not start by itself."""
    driver = make_driver()
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    ur_sim.call(lambda controller: controller.power_on())
    wait_for(lambda: driver.state.robot_mode.name == 'IDLE')
    ur_sim.call(lambda controller: controller.release_brakes())
    wait_for(lambda: 'resend' in driver.status.message)
    sleep(0.3)
    assert not driver.status.program_running
    driver.resend_robot_program()
    driver.wait_ready(30.0)


@pytest.mark.parametrize('paused', [False, True])
def test_a_foreign_program_is_not_replaced(make_driver, ur_sim, paused):
    ur_sim.run_script('def somebody_elses():\n  while True:\n    sync()\n  end\nend\n')
    wait_for(lambda: ur_sim.state().runtime_state.name == 'PLAYING')
    if paused:
        ur_sim.pause_program()
        wait_for(lambda: ur_sim.state().runtime_state.name == 'PAUSED')
    before = ur_sim.state().runtime_state
    driver = make_driver()
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    sleep(0.3)
    driver.resend_robot_program()
    sleep(0.3)
    assert not driver.status.program_running
    assert ur_sim.state().runtime_state is before
    assert 'Another program runs on the robot' in driver.status.message
    ur_sim.stop_program()
    sleep(0.3)
    assert ur_sim.state().runtime_state.name == 'STOPPED'
    driver.resend_robot_program()
    driver.wait_ready(30.0)


def test_a_paused_program_takes_no_goal_until_it_is_played(driver, ur_sim):
    ur_sim.pause_program()
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    assert 'paused' in driver.status.message
    pose = driver.state.actual_tcp_pose
    outcome = driver.execute(Goal(waypoints=(Waypoint(pose=pose, time=1.0),)))
    assert outcome.code is ErrorCode.ROBOT_NOT_READY
    ur_sim.play_program()
    driver.wait_ready(30.0)


def test_a_refused_robot_is_sent_no_program(make_driver, ur_sim):
    driver = make_driver(ur_type='ur10e')
    wait_for(lambda: driver.status.state is ConnectionState.REFUSED)
    driver.resend_robot_program()
    sleep(0.3)
    assert ur_sim.state().runtime_state.name == 'STOPPED'
