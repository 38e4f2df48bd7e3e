# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Processor time of driver and simulator at 500 Hz, and lateness of the simulator.

An empty loop at 500 Hz, measured first and alone, shows the best that this machine can do.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
import time

from figures import Figure, percentile
from processes import Child, children_of, cpu_seconds, empty_loop, lateness, node, simulator
from ros_client import goal_message, TimedClient

POINTS = 1_000


@dataclass(frozen=True, slots=True)
class Sample:
    """Measurements of some seconds in one situation."""

    #: Processor time of each process, as a fraction of one core.
    cpu: Mapping[str, float]
    #: Lateness of each cycle [ms].
    late: list[float]


def run(quick: bool) -> Iterator[Figure]:
    """Measure the empty loop, then simulator and driver at rest, then both in motion."""
    duration = 2.0 if quick else 6.0
    with empty_loop() as loop:
        empty = _sample(loop, {'empty loop': loop.pid}, duration)
    with simulator() as robot:
        time.sleep(1.0)
        alone = _sample(robot, {'simulator': robot.pid}, duration)
        with node(robot) as driver, TimedClient() as client:
            # The robot loop is the node's only child.
            (robot_loop,) = children_of(driver)
            pids = {
                'simulator': robot.pid,
                'driver, node process': driver,
                'driver, robot process': robot_loop,
            }
            time.sleep(1.0)
            idle = _sample(robot, pids, duration)
            handle, _ = client.wait(client.send(goal_message(POINTS)))
            time.sleep(1.5)
            motion = _sample(robot, pids, duration)
            client.cancelled(handle)
    yield from _cpu(empty, {'alone': alone, 'idle': idle, 'in motion': motion})
    yield from _late(empty, {'alone': alone, 'driver idle': idle, 'in motion': motion})


def _sample(cycles: Child, pids: Mapping[str, int], duration: float) -> Sample:
    """Measure processes for ``duration`` [s]; ``cycles`` is the process whose cycles are timed."""
    cycles.call('begin')
    begin = time.monotonic()
    used = {name: -cpu_seconds(pid) for name, pid in pids.items()}
    time.sleep(duration)
    taken = time.monotonic() - begin
    cpu = {name: (used[name] + cpu_seconds(pid)) / taken for name, pid in pids.items()}
    return Sample(cpu, [1e3 * late for late in lateness(cycles.call('cycles'))])


def _cpu(empty: Sample, situations: Mapping[str, Sample]) -> Iterator[Figure]:
    baseline = 100.0 * empty.cpu['empty loop']
    for name in situations['idle'].cpu:
        for situation, sample in situations.items():
            if name in sample.cpu:
                yield Figure(
                    benchmark='processor time at 500 Hz',
                    name=f'{name}, {situation}',
                    value=100.0 * sample.cpu[name],
                    unit='%',
                    baseline=baseline,
                    than='empty 500 Hz loop',
                    note='of one core',
                )


def _late(empty: Sample, situations: Mapping[str, Sample]) -> Iterator[Figure]:
    for situation, sample in situations.items():
        for text, percent in (('p50', 50.0), ('p99', 99.0), ('worst', 100.0)):
            yield Figure(
                benchmark='simulator, how late cycles begin',
                name=f'{situation}, {text}',
                value=percentile(sample.late, percent),
                unit='ms',
                baseline=percentile(empty.late, percent),
                than='empty loop, alone',
                note=f'{len(sample.late):,} cycles',
            )
