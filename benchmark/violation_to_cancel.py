# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Time from a violated tolerance to CANCEL, compared with an echo in the same process.

Simulator, relay and robot loop are processes of their own. All packets of the robot's state pass
through the relay. It records the time at which the first packet with a violation leaves for the
robot loop, and the time at which CANCEL comes back. In two of three trials it holds this packet
back and first sends it to an echo, over another connection. The echo runs on the event loop of the
robot loop's process (:mod:`robot_loop_with_echo`) and answers with as many bytes as CANCEL has,
alternately at once and after reading the packet. So the times of driver and echo are between the
same two processes, for the same packets, at the same moment of a motion. They differ only by the
work of the driver.

For the robot, a violation begins earlier: in the cycle of the controller in which the arm is out
of its tolerance. No answer is possible before this cycle is computed and its packet is made. The
simulator records the time for this, and both times are also given from the beginning of the cycle,
which is the time that the robot waits for an answer. No time contains the transfer from simulator
to relay, which does not exist with a real robot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
import os
import signal
import socket
import struct
import threading
import time
from typing import Any

from figures import Figure, percentile
import paths
from processes import answer_calls, Child, child, HOST, PERIOD, simulator
import robot_loop_with_echo
from wire_tap import Relay, RelayDirection, TAP_HOST

from ur_cartesian_driver.driver import Driver, DriverConfig
from ur_cartesian_driver.driver.loop import loop_host as host
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, Tolerance, Waypoint
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction
from ur_cartesian_driver.protocol.rtde.rtde_fields import OUTPUT_TYPES
from ur_cartesian_driver.protocol.rtde.rtde_recipe import Recipe
from ur_cartesian_driver.robot.rtde.state_decoding import STATE_FIELDS
from ur_cartesian_driver.sim import SimulatedRobot
from ur_cartesian_driver.sim.interfaces.rtde_session import RtdeSession

NAME = 'violated tolerance'
#: Displacement of the tool by a push, and the path tolerance [m].
PUSH, BOUND = 0.004, 0.002
#: Number of violations of each kind.
TRIALS = 100
TIMEOUT = 10.0
#: The RTDE recipe of the robot loop.
RECIPE = Recipe(STATE_FIELDS, [OUTPUT_TYPES[name] for name in STATE_FIELDS])
FRAME_SIZE = len(RECIPE.pack(RECIPE.zeros()))
TIMESTAMP = struct.Struct('>d')
ACTUAL, TARGET = STATE_FIELDS.index('actual_TCP_pose'), STATE_FIELDS.index('target_TCP_pose')


@dataclass(frozen=True, slots=True)
class Reaction:
    """Answer to a packet with a violation."""

    #: The controller time of the packet [s].
    cycle: float
    #: Time from the packet to the answer, both at the relay [ms].
    taken: float
    #: Whether the packet was decoded before the answer.
    reads: bool = True


def run(quick: bool) -> Iterator[Figure]:
    """Push the arm off its path many times."""
    cancels: list[Reaction] = []
    echoes: list[Reaction] = []
    with (
        simulator(_note_packets) as robot,
        _relay(robot) as (relay, settings),
        _echo(relay),
        Driver(
            DriverConfig(robot_ip=HOST, ur_type=paths.MODEL, headless_mode=True, **settings),
            PlanningOptions(max_tool_speed=1.0),
        ) as driver,
    ):
        driver.wait_ready(TIMEOUT)
        state = driver.state
        assert state is not None
        home = state.actual_tcp_pose
        _violate(driver, robot, home, 0)  # not measured, because nothing is cached yet
        for trial in range(1, 1 + 3 * (3 if quick else TRIALS)):
            kind = cancels if trial % 3 == 0 else echoes
            relay.call('marks')
            relay.call('await_push', kind is echoes)
            _violate(driver, robot, home, trial)
            kind.append(relay.call('echoed') if kind is echoes else _cancelled(relay))
        making = robot.call('making')
    for than, reads in (('echo', False), ('echo that reads the packet', True)):
        yield from _compare(than, cancels, [e for e in echoes if e.reads == reads], making)


def _compare(
    than: str,
    cancels: Sequence[Reaction],
    echoes: Sequence[Reaction],
    making: Mapping[float, float],
) -> Iterator[Figure]:
    """Yield the times of driver and echo from the packet, then from the start of its cycle."""
    note = f'{len(cancels)} violations, {len(echoes)} echoes'
    for name, begun in (
        ('packet -> CANCEL on the wire', lambda _: 0.0),
        ('cycle -> CANCEL at the robot', making.__getitem__),
    ):
        ours, theirs = ([begun(r.cycle) + r.taken for r in which] for which in (cancels, echoes))
        for text, percent in (('p50', 50.0), ('p90', 90.0), ('p99', 99.0), ('longest', 100.0)):
            yield Figure(
                benchmark=NAME,
                name=f'{name}, {text}',
                value=percentile(ours, percent),
                unit='ms',
                baseline=percentile(theirs, percent),
                than=than,
                note=note,
            )
    yield Figure(
        benchmark=NAME,
        name='CANCEL is there before the next cycle',
        value=_in_time(ours),
        unit='%',
        baseline=_in_time(theirs),
        than=than,
        note=note,
    )


def _in_time(times: Sequence[float]) -> float:
    """Return the share of times shorter than a cycle [%]."""
    return 100.0 * sum(1e-3 * time < PERIOD for time in times) / len(times)


def _violate(driver: Driver, robot: Child, home: Pose, trial: int) -> None:
    """
    Run a goal to one side (to the other in the next trial) until a push ends it.

    :raises RuntimeError: the goal ended otherwise.
    """
    x, y, z = home.position
    there = Pose((x, y + (0.1 if trial % 2 == 0 else -0.1), z), home.quaternion)
    motion = driver.start(
        driver.plan(
            Goal(
                waypoints=(Waypoint(pose=there),), path_tolerance=Tolerance(position=(BOUND,) * 3)
            )
        )
    )
    robot.call('inject', f'offset pose x {PUSH} at 0.01 m for 0.05 s')
    outcome = motion.result(TIMEOUT)
    if outcome.code is not ErrorCode.PATH_TOLERANCE_VIOLATED:
        raise RuntimeError(f'The goal did not end by the push: {outcome.text}')
    time.sleep(0.05)


def _cancelled(relay: Child) -> Reaction:
    """Return the reaction of the driver to the first packet with the push."""
    cycle, pushed = relay.call('pushed')
    cancel = next(
        m.time
        for m in relay.call('marks')
        if m.is_trajectory_action and m.action == TrajectoryAction.CANCEL
    )
    return Reaction(cycle, 1e-6 * (cancel - pushed))


# ---- the simulator's process ------------------------------------------------------------------


def _note_packets(robot: SimulatedRobot) -> Mapping[str, Callable[[], object]]:
    """Record the time from the beginning of the cycle to each packet (call: ``making``)."""
    making: dict[float, float] = {}
    began = 0
    step, packages = robot.controller.step, RtdeSession.packages

    def noted_step() -> None:
        nonlocal began
        began = time.monotonic_ns()
        step()

    def noted_packages(session: RtdeSession) -> Iterator[bytes]:
        for package in packages(session):
            if len(package) == FRAME_SIZE:  # the other client reads inputs and outputs
                making[robot.controller.time] = 1e-6 * (time.monotonic_ns() - began)
            yield package

    controller: Any = robot.controller
    controller.step = noted_step
    session: Any = RtdeSession
    session.packages = noted_packages  # measured
    return {'making': lambda: making}


# ---- the relay's process ----------------------------------------------------------------------


@contextmanager
def _relay(robot: Child) -> Iterator[tuple[Child, dict[str, Any]]]:
    """Run the relay; yield it (calls: ``marks``, ``await_push``, ...) and the parameters."""
    ports = robot.call('ports')
    with child(_run_relay, ports.rtde) as relay:
        yield (
            relay,
            {
                'reverse_ip': TAP_HOST,
                'primary_port': ports.primary,
                'script_sender_port': 0,
                'dashboard_port': ports.dashboard,
                **relay.call('ports'),
            },
        )


def _run_relay(connection: Connection, rtde_port: int) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    relay = RelayWithEcho(rtde_port)
    threading.Thread(target=relay.run, daemon=True).start()
    answer_calls(
        connection,
        {
            'ports': lambda: relay.ports,
            'echo_port': lambda: relay.echo_port,
            'marks': relay.take,
            'await_push': relay.await_push,
            'pushed': lambda: relay.pushed,
            'echoed': lambda: relay.echoed,
        },
    )


@contextmanager
def _echo(relay: Child) -> Iterator[None]:
    """Make drivers that start in the block run a robot loop with an echo."""
    module, host.MODULE = host.MODULE, robot_loop_with_echo.__name__
    os.environ[robot_loop_with_echo.PORT] = str(relay.call('echo_port'))
    try:
        yield
    finally:
        host.MODULE = module


class RelayWithEcho(Relay):
    """A relay for the robot's packets, too; it can send a violation to the echo first."""

    def __init__(self, rtde_port: int) -> None:
        """
        Listen.

        :param rtde_port: the RTDE port of the robot.
        """
        super().__init__()
        self._rtde_port = rtde_port
        self.listen(HOST, 'rtde_port')
        self._echo_listener = socket.create_server((HOST, 0))
        self.echo_port = self._echo_listener.getsockname()[1]
        self._echo: socket.socket | None = None
        #: Cycle [s] and time [ns] of the first packet with a push; None = not come yet.
        self.pushed: tuple[float, int] | None = None
        #: The answer of the echo to this packet; None = not come yet.
        self.echoed: Reaction | None = None
        self._asks_echo = False
        #: The packet that waits for the echo's answer, and the socket to which it goes afterwards.
        self._held: tuple[bytes, socket.socket] | None = None

    def await_push(self, asks_echo: bool) -> None:
        """Expect the first packet with a push; ``asks_echo``: send it to the echo first."""
        self._asks_echo, self.echoed, self.pushed = asks_echo, None, None

    def directions(self, name: str) -> tuple[int, str, str]:
        """Accept the echo before the first RTDE client; return port and names as in Relay."""
        if name != 'rtde_port':
            return super().directions(name)
        if self._echo is None:
            self._echo, _ = self._echo_listener.accept()
            self.add_direction(self._echo, self._echo, 'echo')
        return self._rtde_port, '', name

    def forward(self, source: socket.socket, direction: RelayDirection) -> None:
        """Handle the robot's packets and the echo's answers separately."""
        if direction.port_name == 'rtde_port':
            with suppress(OSError):  # it has hung up; its own direction handles that
                self._forward_state(source, direction)
        elif direction.port_name == 'echo':
            self._echoed(source)
        else:
            super().forward(source, direction)

    def _forward_state(self, source: socket.socket, direction: RelayDirection) -> None:
        packets, rest = divmod(len(source.recv(65536, socket.MSG_PEEK)), FRAME_SIZE)
        if rest or not packets:
            super().forward(source, direction)  # the handshake, or the end
        for _ in range(0 if rest else packets):  # several when the relay was late
            self._release()  # the echo is late: do not let the robot loop wait for it
            self._forward_packet(source.recv(FRAME_SIZE), direction)

    def _forward_packet(self, data: bytes, direction: RelayDirection) -> None:
        is_awaited = self.pushed is None and is_pushed(data)
        if is_awaited:
            self.pushed = cycle_of(data), time.monotonic_ns()
        if is_awaited and self._asks_echo and self._echo is not None:
            self._held = data, direction.target
            self._echo.sendall(data)
        else:
            direction.target.sendall(data)

    def _echoed(self, echo: socket.socket) -> None:
        answer = echo.recv(65536)
        now = time.monotonic_ns()
        if self.pushed is not None:
            cycle, since = self.pushed
            self.echoed = Reaction(cycle, 1e-6 * (now - since), any(answer))
        self._release()

    def _release(self) -> None:
        held, self._held = self._held, None
        if held is not None:
            with suppress(OSError):
                held[1].sendall(held[0])


def cycle_of(data: bytes) -> float:
    """Return the controller time of a packet [s]."""
    (timestamp,) = TIMESTAMP.unpack_from(data, 4)  # after size, type and recipe
    return float(timestamp)


def is_pushed(data: bytes) -> bool:
    """Return whether the tool is pushed aside in a packet."""
    values: Any = RECIPE.unpack(data[3:])
    return bool(abs(values[ACTUAL][0] - values[TARGET][0]) > BOUND)
