# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A large program is compiled while the cycles go on; on the virtual clock no time passes."""

import signal
import socket
import subprocess
import sys
import time

from plain_clients import PlainPrimary
import pytest
from robot_ports import FREE
from waiting import wait_for

from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig
from ur_cartesian_driver.sim.programs.script_upload import MAX_UPLOAD_SIZE

pytestmark = [pytest.mark.slow, pytest.mark.exhaustive]


def program(size, first='sync()'):
    """Return a program that does something at once, and has many moves behind it."""
    move = '  movej([0.0, -1.57, 1.57, -1.57, -1.57, 0.1], a=1.0, v=0.5, r=0.001)\n'
    return f'def large():\n  {first}\n' + size // len(move) * move + 'end\n'


def is_playing(robot):
    return robot.state().runtime_state is RuntimeState.PLAYING


def test_cycles_go_on_while_a_large_program_is_compiled():
    with SimulatedRobot(SimulatorConfig(**FREE, frequency=125.0)) as robot:
        began, cycles = time.monotonic(), robot.state().timestamp
        with socket.create_connection(('127.0.0.1', robot.ports.secondary)) as client:
            client.sendall(program(150_000, 'sleep(60)').encode())
            wait_for(lambda: is_playing(robot))
        passed, cycles = time.monotonic() - began, robot.state().timestamp - cycles
        assert passed > 0.2, 'compiling was too short to see anything'
        # One that waited for the compiler would have done none. Both share an interpreter and,
        # on a busy computer, less than a processor.
        assert cycles > 0.1 * passed


def test_a_program_that_is_stopped_while_it_is_compiled_does_not_start():
    with SimulatedRobot(SimulatorConfig(**FREE, frequency=125.0)) as robot:
        robot.call(lambda controller: controller.programs.submit(program(50_000)))
        robot.stop_program()
        robot.run_script('def second():\n  sleep(60)\nend\n')
        wait_for(lambda: is_playing(robot))
        assert robot.state().program == 'second'


@pytest.mark.parametrize('size', [100, 50_000])
def test_on_the_virtual_clock_a_program_starts_when_it_was_sent(size):
    with SimulatedRobot(SimulatorConfig(**FREE, rate=0.0)) as robot:
        times = []

        def submit(controller):
            times.append(controller.time)
            controller.programs.on_end = lambda: times.append(controller.time)
            controller.programs.submit(program(size, 'halt'))

        robot.call(submit)
        wait_for(lambda: len(times) == 2)
        assert times[1] - times[0] == pytest.approx(robot.config.cycle)


def test_a_program_that_is_too_long_is_refused_in_words_and_the_next_one_runs():
    with (
        SimulatedRobot(SimulatorConfig(**FREE)) as robot,
        PlainPrimary('127.0.0.1', robot.ports.primary) as client,
    ):
        client.send(program(MAX_UPLOAD_SIZE + 100_000))
        assert client.await_('text')['text'] == (
            'The program is longer than 1 MiB, which this controller does not take; split it.'
        )
        client.send('def next():\n  sleep(60)\nend\n')
        wait_for(lambda: robot.state().program == 'next')


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('rate', ['0', '1'])
def test_a_signal_ends_the_simulator_while_it_compiles(number, rate):
    ports = [f'--{name}-port=0' for name in ('rtde', 'primary', 'dashboard')]
    command = [sys.executable, '-m', 'ur_cartesian_driver.cli', 'sim', '--rate', rate, *ports]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as simulator:
        assert simulator.stdout is not None
        port = int(simulator.stdout.readline().split('secondary ')[1].split(',')[0])
        with socket.create_connection(('127.0.0.1', port)) as client:
            client.sendall(program(MAX_UPLOAD_SIZE - 1000).encode())
            time.sleep(0.5)
            simulator.send_signal(number)
            assert simulator.wait(3.0) != 0
