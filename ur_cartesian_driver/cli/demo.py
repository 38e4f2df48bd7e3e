# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
``ur-cartesian demo``: simulated controller, driver node and client, each in its own process.

The processes are the commands that a user would start by hand, but on free ports, in a ROS domain
and a namespace of their own, so that the demo moves no other arm. With two arms, each driver also
has a ``tf_prefix``.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, ExitStack
from dataclasses import dataclass
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import tempfile
import threading

from ur_cartesian_driver.cli.plots import feedback_plot

#: How long a process may take to end after its signal [s].
END_TIMEOUT = 10.0
_PORTS = re.compile(r'RTDE (\d+), primary (\d+), dashboard (\d+)')


@dataclass(frozen=True, slots=True, kw_only=True)
class DemoArm:
    """
    One arm of the demo.

    :param name: the name of the arm; empty for a single arm.
    """

    name: str = ''
    goal: Path
    model: str
    drawing: Path

    @property
    def namespace(self) -> str:
        """The namespace of the arm's driver, which no other driver has."""
        return f'/demo_{os.getpid()}/{self.name}'.rstrip('/')

    @property
    def tf_prefix(self) -> str:
        """The prefix of the arm's frames and joints."""
        return f'{self.name}_' if self.name else ''

    @property
    def label(self) -> str:
        """The prefix of the arm's lines of output."""
        return f'{self.name}: ' if self.name else ''


def run(arms: Sequence[DemoArm]) -> int:
    """
    Run the demo; all arms move at the same time.

    :returns: the exit status; 0 only if all goals succeeded.
    """
    environment = _environment()
    with ExitStack() as stack:
        scratch = Path(
            stack.enter_context(tempfile.TemporaryDirectory(prefix='ur_cartesian_demo_'))
        )
        print(
            f'simulated {" and ".join(arm.model for arm in arms)}, driver node and client are '
            'starting ...',
            flush=True,
        )
        for arm in arms:
            _start(arm, environment, stack)
        print('\nplan:', flush=True)
        planned = _clients({arm: ['--validate-only'] for arm in arms}, environment)
        if planned != 0:
            return planned
        print('\nmotion:', flush=True)
        records = {arm: scratch / f'{i}.jsonl' for i, arm in enumerate(arms)}
        status = _clients(
            {arm: ['--record', str(record)] for arm, record in records.items()}, environment
        )
        for arm, record in records.items():
            _draw(arm, record)
            _show(arm, environment)
        return status


def _start(arm: DemoArm, environment: dict[str, str], stack: ExitStack) -> None:
    """Start the simulated robot of an arm, and its driver."""
    simulator = stack.enter_context(
        process(
            'sim',
            '--model',
            arm.model,
            *_free_port_options('rtde', 'primary', 'dashboard'),
            environment=environment,
            stdout=subprocess.PIPE,
        )
    )
    rtde, primary, dashboard = _ports(simulator)
    parameters = {
        'robot_ip': '127.0.0.1',
        'ur_type': arm.model,
        'headless_mode': 'true',
        # The robot is simulated here, and a busy computer may be late.
        'robot_receive_timeout': 2.0,
        'max_state_age': 0.0,
        'rtde_port': rtde,
        'primary_port': primary,
        'dashboard_port': dashboard,
        'reverse_port': 0,
        'script_sender_port': 0,
        'trajectory_port': 0,
        'script_command_port': 0,
    }
    if arm.name:  # ROS cannot tell the type of an empty value
        parameters['tf_prefix'] = arm.tf_prefix
    settings = [word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')]
    # The client prints what happens; the driver adds warnings only.
    stack.enter_context(
        process(
            '--ros-args',
            '--log-level',
            'warn',
            '-r',
            f'__ns:={arm.namespace}',
            *settings,
            module='ur_cartesian_driver.ros.node',
            environment=environment,
        )
    )


def _clients(options: Mapping[DemoArm, Sequence[str]], environment: dict[str, str]) -> int:
    """Send the goals of all arms at once; return the first exit status that is not 0, or 0."""
    with ExitStack() as stack:
        clients = []
        for arm, extra_options in options.items():
            client = stack.enter_context(
                process(
                    'send',
                    str(arm.goal),
                    '--driver',
                    f'{arm.namespace}/ur_cartesian_driver',
                    '--tf-prefix',
                    arm.tf_prefix,
                    *extra_options,
                    environment=environment,
                    # Only a single client may show its progress in one line of the terminal.
                    stdout=subprocess.PIPE if arm.label else None,
                )
            )
            clients.append(client)
            if arm.label:
                threading.Thread(
                    target=_forward_output, args=(client, arm.label), daemon=True
                ).start()
        return next((status for client in clients if (status := client.wait()) != 0), 0)


def _forward_output(client: subprocess.Popen[str], label: str) -> None:
    """Print the output of a client, each line with the name of its arm."""
    assert client.stdout is not None
    for line in client.stdout:
        print(f'{label}{line}', end='', flush=True)


def _draw(arm: DemoArm, record: Path) -> None:
    if record.is_file() and record.stat().st_size:
        feedback_plot.draw(record, arm.drawing, title=f'{arm.label}{arm.model}: {arm.goal.stem}')
        print(f'picture of planned and executed path: {arm.drawing}')


def _show(arm: DemoArm, environment: dict[str, str]) -> None:
    """Write the page with the arm on its planned path."""
    options = ['--ur-type', arm.model]
    if arm.name:  # the first option is for the names in the goal, the second for the planning
        options += ['--tf-prefix', arm.tf_prefix, '-p', f'tf_prefix:={arm.tf_prefix}']
    page = str(arm.drawing.with_suffix('.html'))
    with process('show', str(arm.goal), *options, '-o', page, environment=environment) as running:
        running.wait()


@contextmanager
def process(
    *arguments: str,
    environment: dict[str, str],
    module: str = 'ur_cartesian_driver.cli',
    stdout: int | None = None,
) -> Iterator[subprocess.Popen[str]]:
    """Run one of our commands for the duration of the block."""
    command = [sys.executable, '-m', module, *arguments]
    running = subprocess.Popen(
        command,
        env=environment,
        stdout=stdout,
        text=True,
        # Ctrl-C reaches only the demo, which ends its processes in order.
        start_new_session=True,
    )
    try:
        yield running
    finally:
        _end(running)


def _end(running: subprocess.Popen[str]) -> None:
    """Interrupt a process; kill it and its children if it does not end."""
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
    """Read the ports from the simulator's first line."""
    assert simulator.stdout is not None
    line = simulator.stdout.readline()
    match = _PORTS.search(line)
    if match is None:
        raise OSError(f'the simulator did not start; it said {line.strip()!r}')
    rtde, primary, dashboard = (int(port) for port in match.groups())
    return rtde, primary, dashboard


def _free_port_options(*names: str) -> Sequence[str]:
    return [word for name in names for word in (f'--{name}-port', '0')]


def _environment() -> dict[str, str]:
    """Return an environment in which processes find only each other."""
    return {
        **os.environ,
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
        'ROS_DOMAIN_ID': str(1 + os.getpid() % 59),  # test runs use those from 60 on
        'PYTHONUNBUFFERED': '1',
    }
