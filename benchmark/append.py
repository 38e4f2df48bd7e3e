# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
An appendable goal of any length: points per second, memory, starvation.

Producer, planner, robot loop, robot program and simulated controller run in one process on a
virtual clock that skips all waiting, so the figure is the computing time of all of them.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, pi, sin
from pathlib import Path
import sys
from time import perf_counter
from typing import Any

from figures import Figure

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint

#: Time between points, which is a cycle of the controller [s]; points of one request; remaining
#: time of the motion at which the next request is sent [s].
STEP, CHUNK, LEAD_TIME = 0.008, 500, 2.5
#: The circle: radius [m], time for one round [s], time of acceleration at its start [s].
RADIUS, ROUND_TIME, RAMP = 0.05, 4.0, 1.0
#: Requests between two samples of the memory.
SAMPLE_PERIOD = 20


def point(home: Pose, number: int, last: bool) -> Waypoint:
    """Return a point of a circle that starts at ``home``; the arm rests at the last point."""
    t, rate = STEP * number, 2.0 * pi / ROUND_TIME
    angle, turn = (
        (0.5 * rate / RAMP * t * t, rate / RAMP * t)
        if t < RAMP
        else (rate * (t - 0.5 * RAMP), rate)
    )
    if last:
        t, turn = t + 0.1, 0.0
    c, s = cos(angle), sin(angle)
    x, y, z = home.position
    return Waypoint(
        time=t,
        pose=Pose((x + RADIUS * s, y + RADIUS * (1.0 - c), z), home.quaternion),
        twist=(RADIUS * turn * c, RADIUS * turn * s, 0.0, 0.0, 0.0, 0.0),
    )


def resident() -> float:
    """Return the memory of this process [MB]."""
    for line in Path('/proc/self/status').read_text().splitlines():
        if line.startswith('VmRSS:'):
            return float(line.split()[1]) / 1024.0
    return 0.0


async def run_goal(cell: Any, points: int) -> dict[str, Any]:
    """Run an appendable goal with a number of points; return the measurements."""
    from append_goals import (  # beside robot_cell, see run()
        AppendMotion,
        clear_network_log,
        retained_sizes,
    )

    home = cell.memory.read().actual_tcp_pose

    def chunk(first: int, count: int) -> list[Waypoint]:
        return [point(home, k, k == points) for k in range(first, first + count)]

    seen: dict[str, Any] = {'memory': [], 'kept': [], 'left': []}
    begin, planning, number = perf_counter(), 0.0, 0
    motion = AppendMotion(
        cell,
        Goal(waypoints=tuple(chunk(1, CHUNK)), keep_open=True, execution=ExecutionMode.SPLINE),
        self_collision='off',
    )
    while motion.points < points:
        while motion.outcome is None and not (
            motion.motion.progress
            and motion.progress.points_received == motion.points
            and motion.progress.time_remaining < LEAD_TIME
        ):
            await cell.sleep(0.1)
        if motion.outcome is not None:
            break
        seen['left'].append(motion.progress.time_remaining)
        count = min(CHUNK, points - motion.points)
        at = perf_counter()
        await motion.append(chunk(motion.points + 1, count), last=motion.points + count == points)
        planning += perf_counter() - at
        number += 1
        del motion.motion.progress[:-1]  # outside of tests, only the newest is kept
        clear_network_log(cell)
        if number % SAMPLE_PERIOD == 0:
            seen['memory'].append(resident())
            seen['kept'].append(retained_sizes(cell))
            if number % (5 * SAMPLE_PERIOD) == 0:
                print(
                    f'  {motion.points:,} points, {perf_counter() - begin:.0f} s, '
                    f'{resident():.1f} MB, kept {retained_sizes(cell)}',
                    flush=True,
                )
    while motion.outcome is None:
        await cell.sleep(1.0)
    end = motion.outcome
    return seen | {
        'seconds': perf_counter() - begin,
        'planning': planning,
        'outcome': end,
        'points': motion.points,
    }


def run(quick: bool, points: int = 50_000) -> Iterator[Figure]:
    """Measure an appendable spline goal with a point in each cycle."""
    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / 'test' / 'support'))
    from robot_cell import run_cell

    seen = run_cell(lambda cell: run_goal(cell, 2_000 if quick else points), feedback_rate=5.0)
    end, memory = seen['outcome'], seen['memory'] or [resident()]
    if not end.succeeded or end.report:
        raise RuntimeError(f'{end.text} {end.report}')
    name = f'appendable goal of {seen["points"]:,} points'
    yield Figure(
        benchmark='append',
        name=f'{name}, points per second',
        value=seen['points'] / seen['seconds'],
        unit='1/s',
        baseline=1.0 / STEP,
        than='of the motion',
        note=f'{seen["seconds"]:.0f} s on the virtual clock; never out of points, {end.text}',
    )
    settled = memory[min(2, len(memory) - 1)]
    yield Figure(
        benchmark='append',
        name='memory of the process at the end',
        unit='MB',
        value=memory[-1],
        baseline=settled,
        than=f'after {3 * SAMPLE_PERIOD * CHUNK:,} points',
        note='driver, simulated robot and producer',
    )
