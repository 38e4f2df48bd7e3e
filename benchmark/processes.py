# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The processes of a measurement: simulated robot, wire tap, empty loop, driver node.

They are child processes, use loopback only, and end with the ``with`` block that starts them. All
of them read the same clock (``time.monotonic_ns`` is one clock for the whole machine), so times
from different processes can be subtracted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from multiprocessing import get_context
from multiprocessing.connection import Connection
import os
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any, TypeAlias

from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

HOST = '127.0.0.1'
PERIOD = 0.002
START_TIMEOUT = 30.0
END_TIMEOUT = 8.0

_SPAWN = get_context('spawn')


class Child:
    """A process that answers calls: ``child.call('name', ...)`` calls a function there."""

    def __init__(self, connection: Connection, pid: int) -> None:
        """Take the connection and the process's id."""
        self._connection = connection
        self.pid = pid

    def call(self, name: str, *arguments: Any) -> Any:
        """
        Call a function of the child and wait for its result.

        :raises TimeoutError: there is no answer within START_TIMEOUT.
        """
        self._connection.send((name, arguments))
        return self.answer()

    def answer(self) -> Any:
        """Wait for a message of the child."""
        if not self._connection.poll(START_TIMEOUT):
            raise TimeoutError(f'child {self.pid} does not answer')
        return self._connection.recv()


def answer_calls(connection: Connection, functions: Mapping[str, Callable[..., Any]]) -> None:
    """Serve :meth:`Child.call` until the connection closes."""
    while True:
        try:
            name, arguments = connection.recv()
        except EOFError:
            return
        connection.send(functions[name](*arguments))


@contextmanager
def child(target: Callable[..., None], *arguments: Any) -> Iterator[Child]:
    """Run ``target(connection, *arguments)`` in a fresh process until the block is left."""
    ours, theirs = _SPAWN.Pipe()
    process = _SPAWN.Process(target=target, args=(theirs, *arguments), daemon=True)
    process.start()
    theirs.close()
    try:
        assert process.pid is not None
        yield Child(ours, process.pid)
    finally:
        ours.close()
        process.join(END_TIMEOUT)
        if process.is_alive():
            process.kill()
            process.join()


# ---- simulated robot --------------------------------------------------------------------------


#: Returns additional calls that the process of a simulated robot answers.
Calls: TypeAlias = Callable[[SimulatedRobot], Mapping[str, Callable[..., Any]]]


def no_calls(_: SimulatedRobot) -> Mapping[str, Callable[..., Any]]:
    """Return no additional calls."""
    return {}


@contextmanager
def simulator(calls: Calls = no_calls, **settings: Any) -> Iterator[Child]:
    """
    Run a simulated robot in a child process; the calls are in :func:`_simulate`.

    ``cycles`` returns the start times of the controller's cycles since ``begin``.

    :param calls: a function at the top level of a module; it returns additional calls.
    :param settings: fields of the robot's SimulatorConfig.
    """
    with child(_simulate, calls, settings) as robot:
        yield robot


def _simulate(connection: Connection, calls: Calls, settings: dict[str, Any]) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the parent
    any_port: dict[str, Any] = {
        field.name: 0 for field in fields(SimulatorConfig) if field.name.endswith('_port')
    }
    config = SimulatorConfig(**any_port | settings)
    with SimulatedRobot(config) as robot:
        beginnings = note_cycles(robot)
        answer_calls(
            connection,
            {
                'ports': lambda: robot.ports,
                'state': robot.state,
                'run_script': robot.run_script,
                'inject': robot.inject,
                'begin': beginnings.clear,
                'cycles': lambda: list(beginnings),
                **calls(robot),
            },
        )


def note_cycles(robot: SimulatedRobot) -> list[float]:
    """Return a list to which each controller cycle adds its start time [s]."""
    beginnings: list[float] = []
    step = robot.controller.step

    def noted() -> None:
        beginnings.append(time.monotonic())
        step()

    robot.controller.step = noted  # type: ignore[method-assign]  # to note each cycle
    return beginnings


@contextmanager
def empty_loop() -> Iterator[Child]:
    """Run an empty loop at 500 Hz; calls ``begin`` and ``cycles`` as in :func:`simulator`."""
    with child(_loop) as loop:
        yield loop


def _loop(connection: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    beginnings: list[float] = []
    due = time.monotonic()
    while True:
        while connection.poll():
            try:
                name, _ = connection.recv()
            except EOFError:
                return
            connection.send(list(beginnings))
            if name == 'begin':
                beginnings.clear()
                due = time.monotonic()
        due += PERIOD
        time.sleep(max(0.0, due - time.monotonic()))
        beginnings.append(time.monotonic())


def lateness(beginnings: list[float]) -> list[float]:
    """
    Return the lateness of each cycle [s], measured from a grid of 2 ms.

    The grid is the latest one for which no cycle begins before its time.
    """
    offsets = [time - i * PERIOD for i, time in enumerate(beginnings)]
    earliest = min(offsets, default=0.0)
    return [offset - earliest for offset in offsets]


# ---- driver node ------------------------------------------------------------------------------


@contextmanager
def node(robot: Child, **parameters: object) -> Iterator[int]:
    """Run the driver node for a simulated robot; yield its process id once the program runs."""
    ports = robot.call('ports')
    parameters = {
        'robot_ip': HOST,
        'ur_type': 'ur5e',
        'headless_mode': 'true',
        'rtde_port': ports.rtde,
        'primary_port': ports.primary,
        'dashboard_port': ports.dashboard,
        'reverse_port': 0,
        'script_sender_port': 0,
        'trajectory_port': 0,
        'script_command_port': 0,
    } | parameters
    settings = [word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')]
    process = subprocess.Popen(
        [
            sys.executable,
            '-m',
            'ur_cartesian_driver.ros.node',
            '--ros-args',
            '--log-level',
            'error',
            *settings,
        ],
        stdout=subprocess.DEVNULL,
        start_new_session=True,
    )
    try:
        _wait_for_program(robot, process)
        yield process.pid
    finally:
        _end(process)


def _wait_for_program(robot: Child, process: subprocess.Popen[bytes]) -> None:
    deadline = time.monotonic() + START_TIMEOUT
    while robot.call('state').runtime_state is not RuntimeState.PLAYING:
        if process.poll() is not None or time.monotonic() > deadline:
            raise RuntimeError('The driver node did not start the robot program.')
        time.sleep(0.1)
    time.sleep(0.5)  # for the program to connect


def _end(process: subprocess.Popen[bytes]) -> None:
    process.send_signal(signal.SIGINT)
    try:
        process.wait(END_TIMEOUT)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


# ---- processor time ---------------------------------------------------------------------------


def cpu_seconds(pid: int) -> float:
    """Return the processor time that a process has used, user and system [s] (proc(5))."""
    fields = _stat(pid)
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')


def peak_memory(pid: int) -> float:
    """Return the peak resident memory of a process [MB]."""
    for line in Path(f'/proc/{pid}/status').read_text().splitlines():
        if line.startswith('VmHWM:'):
            return int(line.split()[1]) / 1024.0
    raise ValueError(f'the system does not tell the memory of process {pid}')


def children_of(pid: int) -> list[int]:
    """Return the ids of the children of a process."""
    found = []
    for entry in Path('/proc').iterdir():
        if entry.name.isdigit():
            try:
                if int(_stat(int(entry.name))[1]) == pid:
                    found.append(int(entry.name))
            except OSError:
                pass  # it has just ended
    return found


def _stat(pid: int) -> list[str]:
    """Return the fields of ``/proc/PID/stat`` after the name, which can contain any character."""
    return Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
