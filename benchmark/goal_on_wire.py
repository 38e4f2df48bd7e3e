# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Reaction times of the driver: from goal to first byte, from cancel request to CANCEL on the wire.

Simulator, relay and driver node are processes of their own; the client is in this process.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
import time

from figures import Figure, median, percentile, seconds
import paths
from processes import Child, node, peak_memory, simulator
from ros_client import goal_message, TimedClient
from wire_tap import marks_until_first_point, wire_tap

from ur_cartesian_driver.driver.ipc import channel
from ur_cartesian_driver.execution.goal.motion_job import job_from_plan
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.goal.known_frames import Frames
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction
from ur_cartesian_driver.protocol.program.trajectory_points import encode_rows
from ur_cartesian_driver.ros.messages.goal_conversion import goal_from_message
from ur_cartesian_driver.ros.messages.packed_points import in_flat_arrays

POINTS = 1_000
#: The largest number of points that a goal may have.
MANY = 100_000
#: How long each goal moves before it is cancelled [s].
MOVING = 0.3
TIMEOUT = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Times:
    """Times of the events of one goal [ns]."""

    sent: int
    accepted: int
    first_point: int
    cancel_requested: int
    cancel_on_wire: int


def run(quick: bool) -> Iterator[Figure]:
    """Send a plain, a packed and a huge goal a few times each, and cancel each of them."""
    with (
        simulator() as robot,
        wire_tap() as (tap, parameters),
        node(robot, **parameters) as driver,
        TimedClient() as client,
    ):
        plain = goal_message(POINTS)
        count = 4 if quick else 12
        goals = [_one_goal(client, tap, plain) for _ in range(count)]
        packed = [_one_goal(client, tap, in_flat_arrays(plain)) for _ in range(count)]
        huge = [
            _one_goal(client, tap, in_flat_arrays(goal_message(MANY)))
            for _ in range(1 if quick else 5)
        ]
        peak = peak_memory(driver)
    # The first goal is reported separately, because nothing was imported or cached before it.
    yield from _goal_figures(goals)
    yield from _whole_way(goals[1:], packed, huge)
    yield Figure(
        benchmark='node', name=f'peak memory, up to {MANY:,} points', value=peak, unit='MB'
    )
    yield from _breakdown([_ms(g.accepted, g.first_point) for g in goals[1:]])
    yield from _cancel_figures(goals)


def _one_goal(client: TimedClient, tap: Child, message: object) -> Times:
    tap.call('marks')
    sent = time.monotonic_ns()
    handle, accepted = client.wait(client.send(message))
    marks = marks_until_first_point(tap, client.spin, TIMEOUT)
    client.spin(MOVING)
    cancel_requested = client.cancelled(handle)
    marks += tap.call('marks')
    client.spin(0.2)
    return Times(
        sent=sent,
        accepted=accepted,
        cancel_requested=cancel_requested,
        first_point=next(m.time for m in marks if m.port == 'trajectory_port'),
        cancel_on_wire=next(
            m.time for m in marks if m.is_trajectory_action and m.action == TrajectoryAction.CANCEL
        ),
    )


def _goal_figures(goals: Sequence[Times]) -> Iterator[Figure]:
    name = f'goal of {POINTS:,} points'
    warm = goals[1:]
    times = [_ms(g.accepted, g.first_point) for g in warm]
    yield Figure(
        benchmark=name,
        name='accepted -> first point on the wire, p50',
        value=median(times),
        unit='ms',
        baseline=median([_ms(g.sent, g.accepted) for g in warm]),
        than='ROS: sent -> accepted',
        note=f'{len(warm)} goals',
    )
    yield Figure(benchmark=name, name='the same, slowest', value=max(times), unit='ms')
    yield Figure(
        benchmark=name,
        name='the same, first goal of the node',
        value=_ms(goals[0].accepted, goals[0].first_point),
        unit='ms',
    )


def _whole_way(
    plain: Sequence[Times], packed: Sequence[Times], huge: Sequence[Times]
) -> Iterator[Figure]:
    """Report the time from the client's call to the first point, for plain and packed goals."""
    before = median([_ms(g.sent, g.first_point) for g in plain])
    for points, form, goals in (
        (POINTS, 'plain', plain),
        (POINTS, 'packed', packed),
        (MANY, 'packed', huge),
    ):
        yield Figure(
            benchmark=f'goal of {points:,} points',
            name=f'client call -> first point on the wire, {form}, p50',
            value=median([_ms(g.sent, g.first_point) for g in goals]),
            unit='ms',
            baseline=before,
            than=f'{POINTS:,} points, plain',
            note=f'{len(goals)} goals',
        )


def _breakdown(totals: Sequence[float]) -> Iterator[Figure]:
    """Time the steps of the goal in this process; the rest of its time is threads and transfer."""
    name, total = 'its parts, timed one by one', median(totals)
    message, frames = goal_message(POINTS), Frames()
    arm = Arm(robot_model(paths.MODEL))
    state, options = paths.at_home(arm), PlanningOptions()
    goal = goal_from_message(message, frames, now=0)
    planned = plan(goal, state, arm, options)
    points = encode_rows(planned.rows)

    def handed_over() -> object:
        request = channel.StartMotion(motion=1, job=job_from_plan(planned), points=points)
        return channel.unpack(channel.pack(request)[channel.LENGTH.size :])

    left = total
    for part, step in (
        ('conversion', lambda: goal_from_message(message, frames, now=0)),
        ('planning', lambda: plan(goal, state, arm, options)),
        ('encoding', lambda: encode_rows(planned.rows)),
        ('packing and unpacking for the other process', handed_over),
    ):
        taken = 1e3 * seconds(step, repeat=5)
        left -= taken
        yield Figure(
            benchmark=name, name=part, value=taken, unit='ms', baseline=total, than='the whole'
        )
    yield Figure(
        benchmark=name,
        name='rest: threads, pipe, sockets, busy cores',
        value=left,
        unit='ms',
        baseline=total,
        than='the whole',
    )


def _cancel_figures(goals: Sequence[Times]) -> Iterator[Figure]:
    times = [_ms(g.cancel_requested, g.cancel_on_wire) for g in goals]
    for text, value in (
        ('p50', median(times)),
        ('p90', percentile(times, 90)),
        ('slowest', max(times)),
    ):
        yield Figure(
            benchmark='cancel',
            name=f'client call -> CANCEL on the wire, {text}',
            value=value,
            unit='ms',
            note=f'{len(times)} goals',
        )


def _ms(start: int, end: int) -> float:
    return 1e-6 * (end - start)
