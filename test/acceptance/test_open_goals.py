# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals that are continued while they run: producer, robot loop and robot, in virtual time."""

import asyncio
from dataclasses import replace

import numpy as np
from open_goals import BLEND, circle, corners, OpenMotion
import pytest
from robot_cell import CYCLE, run_cell

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robots import robot_model
from ur_cartesian_driver.motion.goal import ExecutionMode, Goal, ZERO6
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

#: The defaults [s].
HORIZON, MARGIN = 1.0, 0.2
#: What a producer sees is so old at most [s]: the period of the reports, and some cycles.
REACTION = 0.04 + 4 * CYCLE
ARM = Arm(robot_model('ur5e'))


def lines(home, first, count, last):
    return corners(home, first, count), (BLEND,) * count


def spline(home, first, count, last):
    points = circle(home, first, count)
    if last:  # the end of the round, at rest
        points[-1] = replace(points[-1], time=points[-1].time + 0.1, twist=ZERO6)
    return points, ()


#: How the points are joined; points with their segments; and how long before the end of what is
#: known its ending begins: a line from blend to rest, or a piece to rest [s].
KINDS = {'lines': (ExecutionMode.PRIMITIVES, lines, 0.4),
         'spline': (ExecutionMode.SPLINE, spline, 0.06)}


def goal(kind, home, count, **changes):
    execution, make, _ = KINDS[kind]
    waypoints, segments = make(home, 1, count, not changes.get('keep_open', True))
    return Goal(**{'waypoints': tuple(waypoints), 'segments': tuple(segments),
                   'execution': execution, 'keep_open': True} | changes)


class Speeds:
    """The joint speeds of each cycle, from the first in which the arm moves."""

    def __init__(self, cell):
        self._controller, self._time = cell.robot.controller, -1.0
        self.rows = []
        self._task = asyncio.ensure_future(self._look())

    async def _look(self):
        while True:
            if self._controller.time != self._time:
                self._time = self._controller.time
                if self.rows or any(self._controller.qd):
                    self.rows.append(self._controller.qd)
            await asyncio.sleep(0.5 * CYCLE)

    def stop(self):
        """Return them (cycles, 6) [rad/s], without the rest behind the end."""
        self._task.cancel()
        rows = np.array(self.rows)
        return rows[:np.flatnonzero(rows.any(axis=1))[-1] + 1]


async def produced(cell, kind, total, chunk, lead):
    """Run an open goal whose producer appends when less is left than that [s]."""
    home, speeds = cell.memory.read().actual_tcp_pose, Speeds(cell)
    motion = OpenMotion(cell, goal(kind, home, chunk))
    while motion.points < total:
        assert await motion.until(
            lambda: motion.motion.progress and motion.progress.points_received == motion.points
            and motion.progress.time_remaining < lead)
        count = min(chunk, total - motion.points)
        last = motion.points + count == total
        points, segments = KINDS[kind][1](home, motion.points + 1, count, last)
        await motion.append(points, segments, last=last)
    end = await motion.ended()
    assert end.succeeded, end.text
    assert end.text.startswith(f'All {total} points were executed')
    return motion, speeds.stop()


async def at_once(cell, kind, total):
    """Run the same as a goal whose points are all known."""
    home, speeds = cell.memory.read().actual_tcp_pose, Speeds(cell)
    motion = cell.owner.start(plan(goal(kind, home, total, keep_open=False), cell.memory.read(),
                                   ARM, PlanningOptions(max_tool_speed=1.0)))
    await cell.until(lambda: motion.outcome, 60.0)
    assert motion.outcome.succeeded
    return speeds.stop()


@pytest.mark.parametrize('kind', KINDS)
def test_a_producer_that_is_late_by_less_than_the_margin_is_not_noticed(kind):
    """
    Cycle by cycle, the arm moves as if all points had been known at the start.

    The late one appends when the motion is going to be closed within its own reaction time.
    """
    total = 15
    known = run_cell(lambda cell: at_once(cell, kind, total))
    for lead in HORIZON, MARGIN + KINDS[kind][2] + REACTION:
        motion, speeds = run_cell(lambda cell, lead=lead: produced(cell, kind, total, 5, lead))
        assert motion.outcome.report == ()
        assert len(speeds) == len(known)
        assert (speeds == known).all()
