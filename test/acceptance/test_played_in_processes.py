# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The usual way of the README, without headless mode: a program with External Control is played.

Simulators are processes, and sockets are real. Each robot has an address of its own, at which its
driver listens too, so that all have the ports of a real robot.
"""

from contextlib import contextmanager, ExitStack, suppress
import os
import re
from runpy import run_path
import socket
import subprocess
from time import monotonic, sleep
import urllib.request

from checkout import CHECKOUT, needs_checkout
import pytest
from random_cases import cases, random_of, SEED
from waiting import wait_for

from ur_cartesian_driver.cli.demo import process
from ur_cartesian_driver.driver import Driver, DriverConfig
from ur_cartesian_driver.path import Path
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

PLAY = (
    'The robot program does not run; play a program with the External Control node on the pendant.'
)
ROBOTS = {
    'CB3': ('127.9.0.1', 'ur5', '3.15'),
    'e-Series': ('127.9.0.2', 'ur5e', '5.21'),
    'PolyScope X': ('127.9.0.3', 'ur5e', '10.12'),
}
EXAMPLE = CHECKOUT / 'examples' / 'tool_change.urp'
ENVIRONMENT = {**os.environ, 'PYTHONUNBUFFERED': '1'}


@contextmanager
def simulator(host, model, polyscope, *options, program='external_control.urp'):
    """Run a simulated robot without power, and External Control loaded; yield the process."""
    words = ['--host', host, '--model', model, '--polyscope', polyscope, '--power-off']
    words += ['--program', str(program), '--external-control-host', host, *options]
    with process('sim', *words, environment=ENVIRONMENT, stdout=subprocess.PIPE) as running:
        assert running.stdout is not None
        assert running.stdout.readline().startswith(f'simulated {model} on {host}')
        yield running


@contextmanager
def driver_of(host, model, first_port=50001, **settings):
    """Run a driver that waits for its program to be played."""
    names = ('reverse_port', 'script_sender_port', 'trajectory_port', 'script_command_port')
    config = DriverConfig(
        robot_ip=host,
        ur_type=model,
        bind_address=host,
        robot_api_port=8000,
        # Processes that start keep a small computer busy.
        robot_receive_timeout=2.0,
        max_state_age=0.0,
        **{name: first_port + i for i, name in enumerate(names)} | settings,
    )
    with Driver(config) as driver:
        wait_for(lambda: driver.status.state is not ConnectionState.DISCONNECTED)
        yield driver


def run_goal(driver, dy):
    driver.wait_ready(30.0)
    path = Path(driver.state.actual_tcp_pose).at(speed=0.1).by(dy=dy)
    driver.execute(path, timeout=60.0).raise_for_error()


def play(host, polyscope):
    """Play the loaded program, as another client does."""
    if polyscope.startswith('10.'):
        request = urllib.request.Request(
            f'http://{host}:8000/universal-robots/robot-api/program/v1/state',
            data=b'{"action": "play"}',
            method='PUT',
        )
        with urllib.request.urlopen(request, timeout=30) as answer:
            assert answer.status == 200
    else:
        assert dashboard(host, 'play') == ['Starting program']


def dashboard(host, *commands):
    with socket.create_connection((host, 29999)) as client, client.makefile('r') as answers:
        assert answers.readline().startswith('Connected')
        client.sendall(''.join(f'{command}\n' for command in commands).encode())
        return [answers.readline().strip() for _ in commands]


@pytest.mark.parametrize('generation', ROBOTS)
def test_from_power_off_to_goals_and_back_to_the_pendant(generation):
    host, model, polyscope = ROBOTS[generation]
    with simulator(host, model, polyscope):
        with driver_of(host, model) as driver:
            wait_for(lambda: 'The arm is in mode POWER_OFF' in driver.status.message)
            answer = driver.recover()
            assert answer.ok, answer.text
            assert 'release the brakes, play the loaded program' in answer.text
            run_goal(driver, 0.02)
            answer = driver.hand_back_control()
            assert answer.ok, answer.text
            wait_for(lambda: driver.status.message == PLAY)
            play(host, polyscope)
            run_goal(driver, -0.02)
        # A driver that comes back finds the program ended.
        with driver_of(host, model) as driver:
            wait_for(lambda: driver.status.message == PLAY)
            play(host, polyscope)
            run_goal(driver, 0.02)


@pytest.mark.parametrize('generation', ['CB3', 'e-Series'])
def test_a_driver_that_comes_later_needs_another_play(generation):
    host, model, polyscope = ROBOTS[generation]
    host = re.sub(r'\d+$', lambda last: str(int(last[0]) + 10), host)
    with simulator(host, model, polyscope):
        with driver_of(host, model) as driver:
            assert driver.recover().ok
            driver.wait_ready(30.0)
        wait_for(lambda: dashboard(host, 'running') == ['Program running: false'])
        assert dashboard(host, 'load external_control.urp', 'play') == [
            'Loading program: external_control.urp',
            'Starting program',
        ]
        # The window of the node waits for a person.
        wait_for(lambda: dashboard(host, 'programState') == ['PLAYING external_control.urp'])
        with driver_of(host, model) as driver:
            wait_for(lambda: driver.status.message.startswith('Another program runs'))
            assert dashboard(host, 'close popup', 'stop', 'play') == [
                'closing popup',
                'Stopped',
                'Starting program',
            ]
            run_goal(driver, 0.02)


@needs_checkout
def test_the_arm_comes_round_to_the_example_of_a_tool_change():
    host = '127.9.0.41'
    tool_change = run_path(str(EXAMPLE.with_suffix('.py')))['tool_change']
    with simulator(host, 'ur5e', '5.21', program=EXAMPLE), driver_of(host, 'ur5e') as driver:
        assert driver.recover().ok
        for _ in range(2):
            driver.wait_ready(30.0)
            path = tool_change(driver.state.actual_tcp_pose)
            driver.execute(path, timeout=60.0).raise_for_error()
            answer = driver.hand_back_control()
            assert answer.ok, answer.text
        driver.wait_ready(30.0)


def test_two_arms_have_a_port_each():
    with ExitStack() as stack:
        drivers = []
        for host, port in ('127.9.0.21', 50001), ('127.9.0.22', 50011):
            options = '--external-control-port', str(port + 1)
            stack.enter_context(simulator(host, 'ur5e', '5.21', *options))
            drivers.append(stack.enter_context(driver_of(host, 'ur5e', port)))
        for driver in drivers:
            assert driver.recover().ok
        for driver in drivers:
            run_goal(driver, 0.02)


def test_the_node_and_the_commands_of_the_readme():
    host = '127.9.0.31'
    parameters = {
        'robot_ip': host,
        'bind_address': host,
        'robot_receive_timeout': 2.0,
        'max_state_age': 0.0,
    }
    words = [word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')]
    with (
        simulator(host, 'ur5e', '5.21'),
        process(
            '--ros-args',
            '--log-level',
            'fatal',
            *words,
            module='ur_cartesian_driver.ros.node',
            environment=ENVIRONMENT,
        ),
    ):
        for command in ['recover'], ['send', 'relative']:
            with process(*command, environment=ENVIRONMENT, stdout=subprocess.PIPE) as client:
                assert client.stdout is not None
                said = client.stdout.read()
                assert client.wait(60.0) == 0, said


class Person:
    """A person at the pendant of a robot in this process, who also starts and ends the driver."""

    def __init__(self, robot, stack):
        self._robot, self._stack = robot, stack
        self.driver = None
        self.toggle_driver()

    def play(self):
        with suppress(RuntimeError):  # the robot refuses
            self._robot.play_program()

    def pause(self):
        with suppress(RuntimeError):
            self._robot.pause_program()

    def stop(self):
        self._robot.stop_program()

    def hand_back(self):
        if self.driver is not None:
            self.driver.hand_back_control()

    def drop_connections(self):
        self._robot.inject('drop sockets', 'drop rtde', 'drop primary')

    def toggle_driver(self):
        if self.driver is None:
            self._session = ExitStack()
            self._stack.push(self._session)
            host, model = self._robot.config.host, self._robot.config.model
            self.driver = self._session.enter_context(driver_of(host, model, robot_loop='thread'))
        else:
            self._session.close()
            self.driver = None

    def follow_status(self):
        """Do what the status says until it is READY; return the sentences."""
        followed, end = [], monotonic() + 60.0
        while self.driver.status.state is not ConnectionState.READY:
            assert monotonic() < end, (followed, self.driver.status)
            message = self.driver.status.message
            sleep(1.0)  # what gets there by itself is not a person's affair
            if self.driver.status.message != message:
                continue
            if message.startswith('Another program runs'):
                self._robot.close_popups()
                self.stop()
            elif message not in (PLAY, 'The robot program is paused; play it on the pendant.'):
                continue
            followed.append(message)
            self.play()
        return followed


@pytest.mark.random
@pytest.mark.parametrize('case', range(cases(30)))
def test_drawn_sequences_over_tcp_end_ready(case):
    host, model, polyscope = ROBOTS[[*ROBOTS][case % 3]]
    host = host.replace('127.9.0', '127.9.1')
    draw = random_of('external control over tcp', case)
    names = ('play', 'play', 'stop', 'pause', 'hand_back', 'toggle_driver', 'drop_connections')
    steps = [(draw.choice(names), draw.uniform(0.0, 1.0)) for _ in range(6)]
    print(f'RANDOM_SEED={SEED}:', *(f'{name}, {wait:.2f} s;' for name, wait in steps))
    config = SimulatorConfig(
        model=model,
        host=host,
        polyscope=polyscope,
        frequency=125.0,
        when_late='wait',
        program='external_control.urp',
        external_control_host=host,
    )
    with SimulatedRobot(config) as robot, ExitStack() as stack:
        person = Person(robot, stack)
        for name, wait in steps:
            getattr(person, name)()
            sleep(wait)
        if person.driver is None:
            person.toggle_driver()
        print('followed:', person.follow_status())
        run_goal(person.driver, 0.02)
