# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Gaps between keepalive messages while the node is busy with a huge goal.

The robot program halts if it waits for a message longer than ``robot_receive_timeout`` (200 ms).
The gaps between messages on the reverse socket are measured from the call that sends the goal
until the arm has moved for a while. In this time, receiving, conversion and planning hold the
node's interpreter, and the plan goes to the same robot loop that sends the messages.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import inf
import time

from figures import Figure, percentile
from processes import Child, node, simulator
from ros_client import goal_message, TimedClient
from wire_tap import Mark, marks_until_first_point, wire_tap

from ur_cartesian_driver.motion.state.rtde_state import RuntimeState

TIMEOUT = 120.0
#: How long the goal moves before it is cancelled [s].
AFTERWARDS = 1.0
#: The default ``robot_receive_timeout`` [ms].
READ_TIMEOUT = 200.0
PERCENTILES = (('p50', 50.0), ('p99', 99.0), ('p99.9', 99.9), ('longest', 100.0))


def run(quick: bool) -> Iterator[Figure]:
    """Record the messages of the idle driver, then of the busy one."""
    points, idle_time = (10_000, 3.0) if quick else (100_000, 20.0)
    message = goal_message(points)
    with (
        simulator() as robot,
        wire_tap() as (tap, parameters),
        node(robot, max_points=points, node_timeout=60.0, **parameters),
        TimedClient() as client,
    ):
        tap.call('marks')
        time.sleep(idle_time)
        idle = _gaps(tap.call('marks'))
        busy = _busy(client, tap, message)
        halted = (
            tap.call('hang_ups') > 0
            or robot.call('state').runtime_state is not RuntimeState.PLAYING
        )
    name = f'keepalives while {points:,} points arrive'
    gaps = _gaps(busy.marks)
    for text, percent in PERCENTILES:
        yield Figure(
            benchmark=name,
            name=f'gap on the reverse socket, {text}',
            value=percentile(gaps, percent),
            unit='ms',
            baseline=percentile(idle, percent),
            than='idle',
            note=f'{len(gaps)} gaps, idle {len(idle)}',
        )
    for text, begin, end in (
        ('received', busy.sent, busy.accepted),
        ('converted, planned, encoded', busy.accepted, busy.start),
        ('handed over, started', busy.start, busy.marks[-1].time),
    ):
        yield Figure(
            benchmark=name,
            name=f'longest while it is {text}',
            value=max(_gaps(busy.marks, begin, end), default=float('nan')),
            unit='ms',
        )
    yield Figure(
        benchmark=name,
        name='times that the robot program halted',
        value=float(halted),
        unit='',
        note=f'it does after {READ_TIMEOUT:g} ms without a message',
    )
    yield Figure(
        benchmark=name,
        name='goal sent -> accepted',
        value=1e-9 * (busy.accepted - busy.sent),
        unit='s',
    )
    yield Figure(
        benchmark=name,
        name='accepted -> first point on the wire',
        value=1e-9 * (busy.first_point - busy.accepted),
        unit='s',
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Busy:
    """Times of the events around the huge goal [ns]."""

    sent: int
    accepted: int
    first_point: int
    marks: Sequence[Mark]

    @property
    def start(self) -> int:
        """The time of the last message before the motion starts."""
        return max(
            m.time for m in self.marks if m.port == 'reverse_port' and not m.is_trajectory_action
        )


def _busy(client: TimedClient, tap: Child, message: object) -> Busy:
    """Send the goal, listen until it has moved for a while, cancel it."""
    tap.call('marks')
    sent = time.monotonic_ns()
    handle, accepted = client.wait(client.send(message), TIMEOUT)
    marks = marks_until_first_point(tap, client.spin, TIMEOUT)
    first_point = next(m.time for m in marks if m.port == 'trajectory_port')
    client.spin(AFTERWARDS)
    marks += tap.call('marks')
    # Not client.cancelled(), which raises if the robot program halted: that is a figure here.
    client.wait(handle.cancel_goal_async())
    client.wait(handle.get_result_async())
    return Busy(
        sent=sent,
        accepted=accepted,
        first_point=first_point,
        marks=[m for m in marks if m.time >= sent],
    )


def _gaps(marks: Sequence[Mark], begin: float = -inf, end: float = inf) -> list[float]:
    """Return the gaps between messages on the reverse socket [ms] that end in (begin, end]."""
    times = [m.time for m in marks if m.port == 'reverse_port']
    return [1e-6 * (after - before) for before, after in pairwise(times) if begin < after <= end]
