# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Packages of an RTDE client in real time: completeness, rate and lateness.

The arm moves all the time. An empty loop at 500 Hz runs in parallel and shows the delays of the
machine, as opposed to delays of the simulator.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
import socket
import time

from figures import Figure, percentile
from processes import Child, cpu_seconds, empty_loop, HOST, lateness, PERIOD, simulator

from ur_cartesian_driver.protocol.rtde.rtde_client import DataReceived, RtdeClientCodec

BENCHMARK = 'RTDE at 500 Hz in real time'
QUICK_SECONDS = 3.0

_OUTPUTS = (
    'timestamp',
    'actual_q',
    'actual_qd',
    'actual_TCP_pose',
    'actual_TCP_speed',
    'speed_scaling',
    'robot_mode',
    'safety_mode',
    'runtime_state',
)
_MOVING = """def moving():
  while True:
    movej([0.5, -1.5, 1.5, -1.5, -1.5, 0.0])
    movel(p[0.4, 0.2, 0.4, 0.0, 3.1, 0.0], v=0.5)
    movej([-0.5, -1.2, 1.7, -1.5, -1.5, 0.3])
  end
end
"""


@dataclass(frozen=True, slots=True)
class Received:
    """Received packages: controller time and arrival time of each [s]."""

    stamps: list[float]
    arrivals: list[float]


def run(quick: bool, seconds: float) -> Iterator[Figure]:
    """Receive from a simulator in motion for a time [s]."""
    duration = QUICK_SECONDS if quick else seconds
    with empty_loop() as loop, simulator() as robot:
        robot.call('run_script', _MOVING)
        with socket.create_connection((HOST, robot.call('ports').rtde), timeout=5.0) as wire:
            packages = _packages(wire)
            for _ in range(250):  # until everything that is slow only once is over
                next(packages)
            for process in (loop, robot):
                process.call('begin')
            used = -cpu_seconds(robot.pid)
            received = _listen(packages, duration)
            used += cpu_seconds(robot.pid)
        cycles, empty = (_milliseconds(process) for process in (robot, loop))
    yield from _rate(received)
    yield from _lateness(received, cycles, empty)
    yield Figure(
        benchmark=BENCHMARK,
        name='processor time of the simulator',
        unit='%',
        value=100.0 * used / duration,
        note='of one core, in motion, one client',
    )


def _packages(wire: socket.socket) -> Iterator[tuple[float, float]]:
    """Yield controller time and arrival time of each package."""
    client = RtdeClientCodec(_OUTPUTS)
    wire.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    wire.sendall(client.start())
    while True:
        data = wire.recv(65536)
        arrival = time.monotonic()
        for event in client.feed(data):
            if isinstance(event, DataReceived):
                yield float(event.values[0]), arrival  # type: ignore[arg-type]  # `timestamp`
        if request := client.data_to_send():
            wire.sendall(request)


def _listen(packages: Iterator[tuple[float, float]], duration: float) -> Received:
    end = time.monotonic() + duration
    received = Received([], [])
    for stamp, arrival in packages:
        received.stamps.append(stamp)
        received.arrivals.append(arrival)
        if arrival > end:
            return received
    raise AssertionError('the packages have no end')


def _rate(received: Received) -> Iterator[Figure]:
    """Compare the timestamps of the controller with the arrival times."""
    stamps, arrivals = received.stamps, received.arrivals
    taken = arrivals[-1] - arrivals[0]
    rate = (len(arrivals) - 1) / taken
    note = f'{len(arrivals):,} packages in {taken:.0f} s'
    yield Figure(benchmark=BENCHMARK, name='mean rate', value=rate, unit='Hz', note=note)
    yield Figure(
        benchmark=BENCHMARK,
        name='mean rate, off by',
        unit='%',
        value=100.0 * abs(rate * PERIOD - 1.0),
    )
    skipped = sum(round((b - a) / PERIOD) != 1 for a, b in pairwise(stamps))
    yield Figure(
        benchmark=BENCHMARK, name='timestamps that are not one cycle on', value=skipped, unit=''
    )
    yield Figure(
        benchmark=BENCHMARK,
        name='drift',
        value=1e3 * _drift(received),
        unit='ms',
        note='of the earliest arrivals, last tenth against first',
    )


def _drift(received: Received) -> float:
    """Return the growth of the smallest delay from the first tenth to the last tenth [s]."""
    behind = [b - a for a, b in zip(received.stamps, received.arrivals, strict=True)]
    tenth = max(1, len(behind) // 10)
    return min(behind[-tenth:]) - min(behind[:tenth])


def _lateness(
    received: Received, cycles: Sequence[float], empty: Sequence[float]
) -> Iterator[Figure]:
    behind = [b - a for a, b in zip(received.stamps, received.arrivals, strict=True)]
    earliest = min(behind)
    arrivals = [1e3 * (late - earliest) for late in behind]
    for name, late in (('cycle begins late', cycles), ('package arrives late', arrivals)):
        for text, percent in (('p50', 50.0), ('p99', 99.0), ('worst', 100.0)):
            yield Figure(
                benchmark=BENCHMARK,
                name=f'{name}, {text}',
                unit='ms',
                value=percentile(late, percent),
                baseline=percentile(empty, percent),
                than='empty loop beside it',
            )


def _milliseconds(process: Child) -> list[float]:
    return [1e3 * late for late in lateness(process.call('cycles'))]
