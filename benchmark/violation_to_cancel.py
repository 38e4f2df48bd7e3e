# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
How long a violated tolerance takes to CANCEL on the wire, beside an echo of the same process.

Simulator, relay and robot loop are processes of their own. All packets of the robot's state pass
through the relay, which notes when each of them leaves for the robot loop, and when CANCEL comes
back. Every few packets it holds one back and sends it over another connection first, to an echo
that lives in the robot loop's process, on its event loop (:mod:`robot_loop_with_echo`), and does
nothing but answer with as many bytes as CANCEL has. So both times are taken between the same two
processes, of the same packets, with the same pauses between them: what they differ by is what the
driver does with a packet.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection
import os
import signal
import socket
import threading
import time

from figures import Figure, percentile
import paths
from processes import answer_calls, Child, child, HOST, simulator
import robot_loop_with_echo
from wire_tap import Mark, Relay, TAP_HOST, Way

from ur_cartesian_driver.driver import Driver, DriverConfig, host
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal import Goal, Tolerance, Waypoint
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.protocol.reverse import TrajectoryAction
from ur_cartesian_driver.protocol.rtde import OUTPUT_TYPES, Recipe
from ur_cartesian_driver.robot.state_recipe import NAMES

NAME = 'violated tolerance'
#: So far the tool is pushed aside, and so far it may be [m].
PUSH, BOUND = 0.004, 0.002
#: One in so many packets goes to the echo first.
ECHOED = 7
TIMEOUT = 10.0
#: The robot loop's own.
RECIPE = Recipe(NAMES, [OUTPUT_TYPES[name] for name in NAMES])
FRAME_SIZE = len(RECIPE.pack(RECIPE.zeros()))
ACTUAL, TARGET = NAMES.index('actual_TCP_pose'), NAMES.index('target_TCP_pose')


def run(quick: bool) -> Iterator[Figure]:
    """Push the arm off its path again and again."""
    with simulator() as robot, _relay(robot) as (relay, settings), _echo(relay), Driver(
                DriverConfig(robot_ip=HOST, ur_type=paths.MODEL, headless_mode=True, **settings),
                PlanningOptions(max_tool_speed=1.0)) as driver:
        driver.wait_ready(TIMEOUT)
        home = driver.state.actual_tcp_pose
        _violate(driver, robot, home, 0)  # nothing is measured cold
        relay.call('marks')
        relay.call('echoes')
        times = []
        for trial in range(1, 10 if quick else 151):
            _violate(driver, robot, home, trial)
            times.append(_reaction(relay.call('marks')))
        echoes = [1e-6 * taken for taken in relay.call('echoes')]
    for text, percent in (('p50', 50.0), ('p90', 90.0), ('p99', 99.0), ('longest', 100.0)):
        yield Figure(benchmark=NAME, name=f'packet -> CANCEL on the wire, {text}',
                     value=percentile(times, percent), unit='ms',
                     baseline=percentile(echoes, percent), than='echo of the same packets',
                     note=f'{len(times)} violations, {len(echoes)} echoes')


def _violate(driver: Driver, robot: Child, home: Pose, trial: int) -> None:
    """
    Run a goal to and fro until a push ends it.

    :raises RuntimeError: it ended in another way.
    """
    x, y, z = home.position
    there = Pose((x, y + (0.1 if trial % 2 == 0 else -0.1), z), home.quaternion)
    motion = driver.start(driver.plan(Goal(
        waypoints=(Waypoint(pose=there),), path_tolerance=Tolerance(position=(BOUND,) * 3))))
    robot.call('inject', f'offset pose x {PUSH} at 0.01 m for 0.05 s')
    outcome = motion.result(TIMEOUT)
    if outcome.code is not ErrorCode.PATH_TOLERANCE_VIOLATED:
        raise RuntimeError(f'The goal did not end by the push: {outcome.text}')
    time.sleep(0.05)


def _reaction(marks: Sequence[Mark]) -> float:
    """Return the time from the first packet with the push in it to CANCEL [ms]."""
    pushed = next(m.time for m in marks if m.port == 'rtde_port')
    cancel = next(m.time for m in marks if m.is_trajectory_action
                  and m.action == TrajectoryAction.CANCEL)
    return 1e-6 * (cancel - pushed)


# ---- the relay's process ----------------------------------------------------------------------


@contextmanager
def _relay(robot: Child) -> Iterator[tuple[Child, dict[str, object]]]:
    """Run the relay; yield it (calls: ``marks``, ``echoes``) and what the driver is told."""
    ports = robot.call('ports')
    with child(_run_relay, ports.rtde) as relay:
        yield relay, {
            'reverse_ip': TAP_HOST, 'primary_port': ports.primary, 'script_sender_port': 0,
            'dashboard_port': ports.dashboard, **relay.call('ports')}


def _run_relay(connection: Connection, rtde_port: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    relay = RelayWithEcho(rtde_port)
    threading.Thread(target=relay.run, daemon=True).start()
    answer_calls(connection, {
        'ports': lambda: relay.ports, 'echo_port': lambda: relay.echo_port,
        'marks': relay.take, 'echoes': relay.take_echoes})


@contextmanager
def _echo(relay: Child) -> Iterator[None]:
    """Have drivers that are made meanwhile run their robot loop with an echo in it."""
    module, host.MODULE = host.MODULE, robot_loop_with_echo.__name__
    os.environ[robot_loop_with_echo.PORT] = str(relay.call('echo_port'))
    try:
        yield
    finally:
        host.MODULE = module


class RelayWithEcho(Relay):
    """Passes on the robot's packets too, and tries some of them on the echo first."""

    def __init__(self, rtde_port: int) -> None:
        """
        Listen.

        :param rtde_port: the robot's own.
        """
        super().__init__()
        self._rtde_port = rtde_port
        self.listen(HOST, 'rtde_port')
        self._echo_listener = socket.create_server((HOST, 0))
        self.echo_port = self._echo_listener.getsockname()[1]
        self._echo: socket.socket | None = None
        self._echoes: list[int] = []
        self._marks_of_pushes: list[Mark] = []
        #: What waits for the echo: since when, and where it goes then.
        self._held: tuple[int, bytes, socket.socket] | None = None
        self._packets = 0

    def take(self) -> list[Mark]:
        """Return the marks since the last call, those of packets with a push in them first."""
        pushes, self._marks_of_pushes = self._marks_of_pushes, []
        return pushes + super().take()

    def take_echoes(self) -> list[int]:
        """Return how long the echo took each time since the last call [ns]."""
        echoes, self._echoes = self._echoes, []
        return echoes

    def ways(self, name: str) -> tuple[int, str, str]:
        """Let the robot be called for who calls its port; the echo has called before."""
        if name != 'rtde_port':
            return super().ways(name)
        if self._echo is None:
            self._echo, _ = self._echo_listener.accept()
            self.add_way(self._echo, self._echo, 'echo')
        return self._rtde_port, '', name

    def pass_on(self, source: socket.socket, way: Way) -> None:
        """Treat the robot's packets and the echo's answers apart."""
        if way.noted == 'rtde_port':
            self._release()  # the echo is late: the robot loop shall not wait for it
            with suppress(OSError):  # it has hung up, which its own way tells
                self._pass_state_on(source, way)
        elif way.noted == 'echo':
            self._echoed(source)
        else:
            super().pass_on(source, way)

    def _pass_state_on(self, source: socket.socket, way: Way) -> None:
        if len(source.recv(65536, socket.MSG_PEEK)) != FRAME_SIZE:
            super().pass_on(source, way)  # the handshake, or the end
            return
        data = source.recv(FRAME_SIZE)
        pushed = is_pushed(data)
        self._packets += 1
        now = time.monotonic_ns()
        if pushed:
            way.target.sendall(data)
            self._marks_of_pushes.append(Mark(now, 'rtde_port', len(data)))
        elif self._packets % ECHOED == 0 and self._echo is not None:
            self._held = now, data, way.target
            self._echo.sendall(data)
        else:
            way.target.sendall(data)

    def _echoed(self, echo: socket.socket) -> None:
        echo.recv(65536)
        now = time.monotonic_ns()
        if self._held is not None:
            self._echoes.append(now - self._held[0])
            self._release()

    def _release(self) -> None:
        held, self._held = self._held, None
        if held is not None:
            with suppress(OSError):
                held[2].sendall(held[1])


def is_pushed(data: bytes) -> bool:
    """Tell whether the tool is pushed aside in a packet."""
    values = RECIPE.unpack(data[3:])
    return abs(values[ACTUAL][0] - values[TARGET][0]) > BOUND
