# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The whole way in one command: simulated controller, driver node and client, a process each.

Nothing here is special to the demo: the three processes are the commands that a user starts by
hand, only their ports are free ones, so that the demo disturbs nothing that runs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import tempfile

from ur_cartesian_driver.cli import picture

#: How long a process may take to say that it is there, and to end [s].
START_TIMEOUT = 30.0
END_TIMEOUT = 10.0
_PORTS = re.compile(r'RTDE (\d+), primary (\d+), dashboard (\d+)')


def run(goal: Path, model: str, drawing: Path) -> int:
    """
    Run the demo.

    :param goal: file of the goal.
    :param drawing: where the picture goes.
    :returns: 0 only if the goal succeeded.
    """
    environment = _environment()
    with tempfile.TemporaryDirectory(prefix='ur_cartesian_demo_') as scratch, \
            process('sim', '--model', model, *_any_ports('rtde', 'primary', 'dashboard'),
                    environment=environment, stdout=subprocess.PIPE) as simulator:
        rtde, primary, dashboard = _ports(simulator)
        parameters = {
            'robot_ip': '127.0.0.1', 'ur_type': model, 'headless_mode': 'true',
            'rtde_port': rtde, 'primary_port': primary, 'dashboard_port': dashboard,
            'reverse_port': 0, 'script_sender_port': 0, 'trajectory_port': 0,
            'script_command_port': 0}
        settings = [word for name, value in parameters.items()
                    for word in ('-p', f'{name}:={value}')]
        print(f'simulated {model}, driver node and client are starting ...', flush=True)
        with process(*['--ros-args', *settings], module='ur_cartesian_driver.ros.node',
                     environment=environment):
            print('\nplan:', flush=True)
            planned = _client(goal, environment, '--validate-only')
            if planned != 0:
                return planned
            print('\nmotion:', flush=True)
            record = Path(scratch) / 'feedback.jsonl'
            status = _client(goal, environment, '--record', str(record))
            if record.is_file() and record.stat().st_size:
                picture.draw(record, drawing, title=f'{model}: {goal.stem}')
                print(f'picture of planned and executed path: {drawing}')
            return status


def _client(goal: Path, environment: dict[str, str], *options: str) -> int:
    """Send the goal from a process of its own and return its exit status."""
    with process('send', str(goal), *options, environment=environment) as client:
        return client.wait()


@contextmanager
def process(*arguments: str, environment: dict[str, str], module: str = 'ur_cartesian_driver.cli',
            stdout: int | None = None) -> Iterator[subprocess.Popen[str]]:
    """Run one of our commands; it is gone when the block is left, whatever happens."""
    command = [sys.executable, '-m', module, *arguments]
    running = subprocess.Popen(
        command, env=environment, stdout=stdout, text=True,
        # Ctrl-C is for us: we end the processes in order.
        start_new_session=True)
    try:
        yield running
    finally:
        _end(running)


def _end(running: subprocess.Popen[str]) -> None:
    """End a process in the kind way, then in the other one, together with its children."""
    if running.poll() is None:
        running.send_signal(signal.SIGINT)
    try:
        running.wait(END_TIMEOUT)
    except subprocess.TimeoutExpired:
        os.killpg(running.pid, signal.SIGKILL)
        running.wait()
    if running.stdout is not None:
        running.stdout.close()


def _ports(simulator: subprocess.Popen[str]) -> tuple[int, int, int]:
    """Read the simulator's first line, which says where it listens."""
    assert simulator.stdout is not None
    line = simulator.stdout.readline()
    match = _PORTS.search(line)
    if match is None:
        raise OSError(f'the simulator did not start; it said {line.strip()!r}')
    rtde, primary, dashboard = (int(port) for port in match.groups())
    return rtde, primary, dashboard


def _any_ports(*names: str) -> Sequence[str]:
    return [word for name in names for word in (f'--{name}-port', '0')]


def _environment() -> dict[str, str]:
    """Return an environment in which the three see each other and nobody else."""
    return {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_DOMAIN_ID': str(1 + os.getpid() % 100), **os.environ, 'PYTHONUNBUFFERED': '1'}
