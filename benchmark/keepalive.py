# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Whether the robot hears from the driver while the node is busy with a huge goal.

The robot program halts when it has waited for longer than ``robot_receive_timeout`` (200 ms). The
gaps between messages on the reverse socket are taken from the call that sends the goal until its
first point is on the wire: receiving, conversion and planning hold the node's interpreter.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
import time

from figures import Figure, percentile
from processes import Child, node, simulator
from ros_client import goal_message, TimedClient
from wire_tap import Mark, wire_tap

from ur_cartesian_driver.motion.state import RuntimeState

TIMEOUT = 120.0
PERCENTILES = (('p50', 50.0), ('p99', 99.0), ('p99.9', 99.9), ('longest', 100.0))


def run(quick: bool) -> Iterator[Figure]:
    """Listen to the idle driver, then to the busy one."""
    points, idle_time = (10_000, 3.0) if quick else (100_000, 20.0)
    message = goal_message(points)
    with simulator() as robot, wire_tap() as (tap, parameters), \
            node(robot, max_points=points, node_timeout=60.0, **parameters), \
            TimedClient() as client:
        idle = _idle(tap, idle_time)
        busy, arrival, first_point = _busy(client, tap, message)
        running = robot.call('state').runtime_state is RuntimeState.PLAYING
        halts = tap.call('hang_ups') + (not running)
    name = f'keepalives while {points:,} points arrive'
    for text, percent in PERCENTILES:
        yield Figure(benchmark=name, name=f'gap on the reverse socket, {text}',
                     value=percentile(busy, percent), unit='ms',
                     baseline=percentile(idle, percent), than='idle',
                     note=f'{len(busy)} gaps, idle {len(idle)}')
    yield Figure(benchmark=name, name='times that the robot program halted', value=halts, unit='')
    yield Figure(benchmark=name, name='goal sent -> accepted', value=arrival, unit='s')
    yield Figure(benchmark=name, name='accepted -> first point on the wire', value=first_point,
                 unit='s')


def _idle(tap: Child, duration: float) -> list[float]:
    tap.call('marks')
    time.sleep(duration)
    return _gaps(tap.call('marks'))


def _busy(client: TimedClient, tap: Child, message: object) -> tuple[list[float], float, float]:
    """Return the gaps [ms], and the times to acceptance and from there to the first point [s]."""
    tap.call('marks')
    sent = time.monotonic_ns()
    handle, accepted = client.wait(client.send(message), TIMEOUT)
    marks = _until_first_point(client, tap)
    first_point = next(m.time for m in marks if m.port == 'trajectory_port')
    client.cancelled(handle)
    return (_gaps([m for m in marks if sent <= m.time <= first_point]),
            1e-9 * (accepted - sent), 1e-9 * (first_point - accepted))


def _until_first_point(client: TimedClient, tap: Child) -> list[Mark]:
    marks: list[Mark] = []
    deadline = time.monotonic() + TIMEOUT
    while not any(m.port == 'trajectory_port' for m in marks):
        if time.monotonic() > deadline:
            raise TimeoutError(f'no point on the wire within {TIMEOUT:g} s')
        client.spin(0.1)
        marks += tap.call('marks')
    return marks


def _gaps(marks: Sequence[Mark]) -> list[float]:
    """Return the times between messages on the reverse socket [ms]."""
    times = [m.time for m in marks if m.port == 'reverse_port']
    return [1e-6 * (after - before) for before, after in zip(times, times[1:], strict=False)]
