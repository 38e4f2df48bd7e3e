# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Points that the driver encodes and sends per second.

Sending is measured through all of the driver (pipe, robot loop, limit on the points in flight,
TCP). A reader replaces the robot program: it connects to the driver's ports, reads points, and
reports each one at once as begun, through the output register of the simulated robot.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from multiprocessing.connection import Connection
import signal
import socket
import struct
import threading
import time

from figures import Figure, seconds
import numpy as np
import paths
from processes import answer_calls, Child, child, HOST

from ur_cartesian_driver.driver import ConnectionState, Driver, DriverConfig
from ur_cartesian_driver.motion.geometry.pose import pose_rows
from ur_cartesian_driver.motion.plan.move_rows import MoveRows, MOVES
from ur_cartesian_driver.motion.plan.plan import Plan, PlannedRows
from ur_cartesian_driver.motion.plan.primitive import MoveL
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.protocol.program.registers import OutputInteger
from ur_cartesian_driver.protocol.program.trajectory_points import (
    encode_rows,
    POINT_FIELDS,
    POINT_SIZE,
)
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

NAME = 'points a second'
#: Highest possible rate: at most 500 points are in flight, and each of the 500 RTDE packages per
#: second can report all of them as begun.
MAX_RATE = 500 * 500
#: The program of the simulated robot, while the reader replaces the robot program.
IDLE_PROGRAM = 'def stand_in():\n  while True:\n    sync()\n  end\nend\n'


def run(quick: bool) -> Iterator[Figure]:
    """Measure encoding, then sending."""
    yield _encoding(10_000 if quick else 100_000)
    yield from _sending(4_000 if quick else 20_000)


def _encoding(points: int) -> Figure:
    rows = PlannedRows(
        waypoints=np.arange(points, dtype=np.int32),
        lengths=np.full(points, paths.STEP),
        angles=np.zeros(points),
        durations=np.ones(points),
        blend_entries=np.zeros((points, 5)),
        joints=np.zeros((points, 6)),
        primitives=MoveRows(
            kinds=np.full(points, MOVES.index(MoveL)),
            targets=pose_rows(paths.meander(points)),
            q_near=np.zeros((points, 6)),
            has_q_near=np.zeros(points, dtype=np.bool_),
            vias=np.zeros((points, 7)),
            arc_modes=np.zeros(points, dtype=np.int64),
            velocities=np.full(points, 0.1),
            accelerations=np.ones(points),
            durations=np.zeros(points),
            blend_radii=np.full(points, 0.002),
            others={},
        ),
        report_lines=('',) * points,
    )
    packer = struct.Struct(f'>{POINT_FIELDS}i')
    words = tuple(range(POINT_FIELDS))
    return Figure(
        benchmark=NAME,
        name='encoded',
        unit='1/s',
        value=points / seconds(lambda: encode_rows(rows), repeat=3),
        baseline=points / seconds(lambda: [packer.pack(*words) for _ in range(points)], repeat=3),
        than='struct.pack of the words alone',
        note=f'{points:,} points',
    )


def _sending(points: int) -> Iterator[Figure]:
    with child(_read) as reader:
        baseline = _plain_socket(reader, points)
        ports = reader.call('ports')
        config = DriverConfig(
            robot_ip=HOST,
            ur_type=paths.MODEL,
            rtde_port=ports.rtde,
            primary_port=ports.primary,
            dashboard_port=ports.dashboard,
            reverse_port=0,
            script_sender_port=0,
            trajectory_port=0,
            script_command_port=0,
            robot_loop='process',
            # The reader reports progress while the arm is at rest.
            max_plan_deviation=0.0,
            max_plan_deviation_angle=0.0,
        )
        with Driver(config, PlanningOptions(max_points=points)) as driver:
            _until(lambda: driver.status.state is ConnectionState.CONNECTED)
            reader.call('join', dict(driver.status.ports))
            driver.wait_ready(10.0)
            taken = _through_driver(driver, driver.plan(paths.goal(points)), reader, points)
    yield Figure(
        benchmark=NAME,
        name='sent through the driver',
        unit='1/s',
        value=points / taken,
        baseline=points / baseline,
        than='the same bytes, plain sockets',
        note=f'{points:,} points, the window bounds it to {MAX_RATE:,} after the first 500',
    )


def _through_driver(driver: Driver, plan: Plan, reader: Child, points: int) -> float:
    """Return the time from the first point to the last at the reader [s]."""
    motion = driver.start(plan)
    times = reader.call('times', points)
    motion.cancel()
    driver.close()  # the reader does not answer a cancel
    first, last = times
    return float(last - first)


def _plain_socket(reader: Child, points: int) -> float:
    with socket.create_server((HOST, 0)) as server:
        reader.call('join', {'trajectory_port': server.getsockname()[1]})
        connection, _ = server.accept()
        with connection:
            connection.sendall(bytes(points * POINT_SIZE))
            first, last = reader.call('times', points)
    return float(last - first)


def _until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 10.0
    while not condition():
        if time.monotonic() > deadline:
            raise TimeoutError('the driver did not connect within 10 s')
        time.sleep(0.02)


# ---- the reader's process ---------------------------------------------------------------------


def _read(connection: Connection) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    config = SimulatorConfig(rtde_port=0, primary_port=0, dashboard_port=0)
    with SimulatedRobot(config) as robot, ExitStack() as sockets:
        robot.run_script(IDLE_PROGRAM)
        reader = FakeRobotProgram(robot, sockets)
        answer_calls(
            connection, {'ports': lambda: robot.ports, 'join': reader.join, 'times': reader.times}
        )


class FakeRobotProgram:
    """Reads points in place of the robot program."""

    def __init__(self, robot: SimulatedRobot, sockets: ExitStack) -> None:
        """Report for ``robot``; ``sockets`` closes the connections."""
        self._robot = robot
        self._sockets = sockets
        self._arrived = 0
        self._first = self._last = 0.0

    def join(self, ports: dict[str, int]) -> None:
        """Connect to the ports in the order of the robot program, and read in the background."""
        self._arrived = 0
        for name in ('trajectory_port', 'script_command_port', 'reverse_port'):
            if name in ports:
                sock = socket.create_connection((HOST, ports[name]))
                self._sockets.enter_context(sock)
                threading.Thread(
                    target=self._take, args=(sock, name == 'trajectory_port'), daemon=True
                ).start()

    def times(self, points: int) -> tuple[float, float]:
        """Return the arrival times of the first and the last of a number of points."""
        deadline = time.monotonic() + 20.0
        while self._arrived < points * POINT_SIZE and time.monotonic() < deadline:
            time.sleep(0.005)
        if self._arrived < points * POINT_SIZE:
            raise TimeoutError(f'only {self._arrived // POINT_SIZE} of {points} points came')
        return self._first, self._last

    def _take(self, sock: socket.socket, counts: bool) -> None:
        try:
            while data := sock.recv(1 << 16):
                if counts:
                    self._count(len(data))
        except OSError:
            pass  # ``sockets`` has closed it

    def _count(self, size: int) -> None:
        self._last = time.monotonic()
        if self._arrived == 0:
            self._first = self._last
        self._arrived += size
        begun = self._arrived // POINT_SIZE
        self._robot.controller.io.outputs.integers[OutputInteger.POINTS_BEGUN] = begun
