# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Appending to goals while they run: producer, robot loop and robot, in virtual time."""

import asyncio
from dataclasses import replace
from functools import partial
import gc
import sys
from typing import Any

from append_goals import (
    AppendMotion,
    BLEND,
    circle,
    clear_network_log,
    corners,
    moved,
    retained_sizes,
)
import numpy as np
import pytest
from robot_cell import CYCLE, RTDE, run_cell

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode, GoalRefused
from ur_cartesian_driver.motion.geometry.vectors import ZERO6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    IOCommand,
    OutputKind,
    Waypoint,
)
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.both_arms]

#: The defaults [s].
HORIZON, MARGIN = 1.0, 0.2
#: What a producer sees is so old at most [s]: the period of the reports, and some cycles.
REACTION = 0.04 + 4 * CYCLE
ARM = Arm(robot_model('ur5e'))
OPTIONS = PlanningOptions(max_tool_speed=1.0)


def lines(home, first, count, last):
    return corners(home, first, count), (BLEND,) * count


def spline(home, first, count, last):
    points = circle(home, first, count)
    if last:  # the end of the round, at rest
        points[-1] = replace(points[-1], time=points[-1].time + 0.1, twist=ZERO6)
    return points, ()


#: How the points are joined; points with their segments; and how long before the end of the known
#: points the ending begins: a line from blend to rest, or a piece to rest [s].
KINDS = {
    'lines': (ExecutionMode.PRIMITIVES, lines, 0.4),
    'spline': (ExecutionMode.SPLINE, spline, 0.06),
}


def goal(kind, home, count, **changes):
    execution, make, _ = KINDS[kind]
    waypoints, segments = make(home, 1, count, not changes.get('keep_open', True))
    fields: dict[str, Any] = {
        'waypoints': tuple(waypoints),
        'segments': tuple(segments),
        'execution': execution,
        'keep_open': True,
    }
    return Goal(**fields | changes)


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
                if self.rows or any(self._controller.motion.qd):
                    self.rows.append(self._controller.motion.qd)
            await asyncio.sleep(0.5 * CYCLE)

    def stop(self):
        """Return them (cycles, 6) [rad/s], without the rest behind the end."""
        self._task.cancel()
        rows = np.array(self.rows)
        return rows[: np.flatnonzero(rows.any(axis=1))[-1] + 1]


async def produced(cell, kind, total, chunk, lead):
    """Run an appendable goal whose producer appends when less than a lead time is left [s]."""
    home, speeds = cell.memory.read().actual_tcp_pose, Speeds(cell)
    motion = AppendMotion(cell, goal(kind, home, chunk))
    while motion.points < total:
        assert await motion.until(
            lambda: (
                motion.motion.progress
                and motion.progress.points_received == motion.points
                and motion.progress.time_remaining < lead
            )
        )
        count = min(chunk, total - motion.points)
        last = motion.points + count == total
        points, segments = KINDS[kind][1](home, motion.points + 1, count, last)
        await motion.append(points, segments, last=last)
    end = await motion.ended()
    assert end.succeeded, end.text
    assert end.text.startswith(f'All {total} points were executed')
    return motion, speeds.stop()


async def at_once(cell, kind, total):
    """Run the same goal with all points known at the start."""
    home, speeds = cell.memory.read().actual_tcp_pose, Speeds(cell)
    motion = cell.owner.start(
        plan(
            goal(kind, home, total, keep_open=False),
            cell.memory.read(),
            ARM,
            PlanningOptions(max_tool_speed=1.0),
        )
    )
    await cell.until(lambda: motion.outcome, 60.0)
    assert motion.outcome.succeeded
    return speeds.stop()


@pytest.mark.parametrize('kind', KINDS)
def test_a_producer_that_is_late_by_less_than_the_margin_is_not_noticed(kind):
    """
    Cycle by cycle, the arm moves as if all points had been known at the start.

    The late producer appends when the arm is about to decelerate, within its own reaction time.
    """
    total = 9
    known = run_cell(lambda cell: at_once(cell, kind, total))
    for lead in HORIZON, MARGIN + KINDS[kind][2] + REACTION:
        motion, speeds = run_cell(partial(produced, kind=kind, total=total, chunk=3, lead=lead))
        assert motion.outcome.report == ()
        assert len(speeds) == len(known)
        assert (speeds == known).all()


async def closed(cell, kind, count=6, **changes):
    """Run an appendable goal whose producer stops until the arm rests; return it, home, speeds."""
    home, speeds = cell.memory.read().actual_tcp_pose, Speeds(cell)
    motion = AppendMotion(cell, goal(kind, home, count, **changes))
    assert await motion.until(lambda: motion.motion.progress and motion.progress.awaiting_points)
    return motion, home, speeds.stop()


@pytest.mark.parametrize('kind', KINDS)
def test_points_that_a_lost_connection_leaves_do_not_run_in_later_goals(kind):
    async def scenario(cell):
        motion = AppendMotion(cell, goal(kind, cell.memory.read().actual_tcp_pose, 10))
        await cell.sleep(0.6)
        cell.loop.cut(RTDE)
        await cell.until(lambda: motion.outcome, 3.0)
        assert motion.outcome.code is ErrorCode.CONNECTION_LOST
        await cell.until(lambda: cell.is_ready() and cell.at_rest(), 3.0)
        for _ in range(2):
            here = cell.memory.read().actual_tcp_pose
            up = moved(here, 0.0, 0.0, 0.02)
            later = cell.owner.start(
                plan(Goal(waypoints=(Waypoint(pose=up),)), cell.memory.read(), ARM, OPTIONS)
            )
            await cell.until(lambda: later.outcome, 10.0)  # noqa: B023  # at once
            assert later.outcome.succeeded, later.outcome.text
            assert cell.memory.read().target_tcp_pose.distance_to(up) < 1e-4

    run_cell(scenario)


@pytest.mark.parametrize('kind', KINDS)
def test_when_a_producer_stops_the_arm_decelerates_and_the_producer_may_continue(kind):
    async def scenario(cell):
        motion, home, speeds = await closed(cell, kind)
        step = np.abs(np.diff(speeds, axis=0)).max() / CYCLE
        assert step < 5.0, 'decelerated, not stopped hard [rad/s^2]'
        assert motion.progress.time_remaining == motion.progress.buffered == 0.0
        assert motion.progress.points_received == 6
        assert cell.at_rest()
        points, segments = KINDS[kind][1](home, 7, 5, False)
        answer = await motion.append(points, segments)
        assert 'had come to rest before these points' in answer.text
        assert ('later than their times' in answer.text) == (kind == 'spline')
        assert await motion.until(lambda: not motion.progress.awaiting_points)
        points, segments = KINDS[kind][1](home, 12, 5, True)
        answer = await motion.append(points, segments, last=True)
        assert answer.text.startswith('5 points appended, the goal has 16, these are the last.')
        end = await motion.ended()
        assert end.succeeded, end.text
        assert end.text.startswith('All 16 points were')
        (line,) = end.report
        assert line.startswith('the motion was brought to rest once, the last time behind point 5')
        assert not any('stop' in text for text in cell.owner.log)

    run_cell(scenario)


def test_last_without_points_ends_a_goal_at_its_last_point():
    async def scenario(cell):
        home = cell.memory.read().actual_tcp_pose
        moving = AppendMotion(cell, goal('spline', home, 6))
        answer = await moving.append(last=True)
        assert answer.text == 'No point follows: the goal has 6 in all.'
        with pytest.raises(GoalRefused, match=r'closed by an earlier request with last: true\.$'):
            await moving.append(circle(home, 7, 1))
        assert (await moving.ended()).succeeded
        waiting, *_ = await closed(cell, 'lines')
        await waiting.append(last=True)
        assert (await waiting.ended()).succeeded

    run_cell(scenario)


def test_a_goal_ends_when_points_stay_away_longer_than_the_timeout():
    async def scenario(cell):
        motion, *_ = await closed(cell, 'lines')
        end = await motion.ended()
        assert end.code is ErrorCode.CANCELLED
        assert end.text == (
            'No more points, and no word that there are none, came within keep_open_timeout = '
            '0.5 s (at rest behind point 5, waiting for more).'
        )
        await cell.until(cell.is_ready)
        with pytest.raises(GoalRefused, match=r'^The goal has ended\.$'):
            await motion.append(corners(motion.home, 7, 1), (BLEND,))

    run_cell(scenario, keep_open_timeout=0.5)


def test_points_that_are_refused_leave_the_goal_as_it_was():
    async def scenario(cell):
        home = cell.memory.read().actual_tcp_pose
        motion = AppendMotion(cell, goal('lines', home, 5))
        far = replace(corners(home, 6, 1)[0], pose=moved(home, 2.0, 0.0, 0.0))
        for wrong, text in (
            (([*corners(home, 6, 1), far], (BLEND,) * 2), r'points\[6\]'),
            ((corners(home, 6, 2), (BLEND,)), 'segments has 1 entries for 2 points'),
            (((), ()), r'^points is empty; give at least one point, or set last\.$'),
        ):
            with pytest.raises(GoalRefused, match=text):
                await motion.append(*wrong)
        await motion.append(corners(home, 6, 5), (BLEND,) * 5, last=True)
        end = await motion.ended()
        assert end.text.startswith('All 10 points were')
        assert end.report == (), 'it was never closed'

    run_cell(scenario)


#: Points and offsets [s]: inside a part, at its last point and after it, far into the next part,
#: at the first point of one, and behind the end.
SWITCHES = [(3, 0.0), (4, 0.0), (4, 0.03), (4, 0.25), (5, 0.0), (9, 0.0), (14, 0.1)]


def switches(first, count):
    return tuple(
        IOCommand(
            waypoint=point, offset=offset, output=OutputKind.STANDARD_DIGITAL, pin=k, value=1.0
        )
        for k, (point, offset) in enumerate(SWITCHES)
        if first <= point < first + count
    )


async def outputs_at(cell, kind, chunk):
    """Run 15 points, known at once or in parts; return when each output came on in the motion."""
    home, times, begin = cell.memory.read().actual_tcp_pose, {}, []

    async def look():
        while True:
            if not begin and any(cell.robot.controller.motion.qd):
                begin.append(cell.robot.controller.time)
            for k in range(len(SWITCHES)):
                if cell.robot.state().digital_outputs >> k & 1:
                    times.setdefault(k, cell.robot.controller.time - begin[0])
            await asyncio.sleep(0.5 * CYCLE)

    watch = asyncio.ensure_future(look())
    if chunk == 15:
        motion = cell.owner.start(
            plan(
                goal(kind, home, 15, keep_open=False, io_commands=switches(0, 15)),
                cell.memory.read(),
                ARM,
                PlanningOptions(max_tool_speed=1.0),
            )
        )
        await cell.until(lambda: motion.outcome, 60.0)
    else:
        motion = AppendMotion(cell, goal(kind, home, chunk, io_commands=switches(0, chunk)))
        while motion.points < 15:
            assert await motion.until(
                lambda: motion.motion.progress and motion.progress.time_remaining < HORIZON
            )
            last = motion.points + chunk == 15
            points, segments = KINDS[kind][1](home, motion.points + 1, chunk, last)
            await motion.append(points, segments, switches(motion.points, chunk), last=last)
        await motion.ended()
    assert motion.outcome.succeeded, motion.outcome.text
    watch.cancel()
    return times


@pytest.mark.parametrize('kind', KINDS)
def test_outputs_are_switched_as_if_all_points_had_been_known(kind):
    known = run_cell(lambda cell: outputs_at(cell, kind, 15))
    assert sorted(known) == list(range(len(SWITCHES)))
    assert run_cell(lambda cell: outputs_at(cell, kind, 5)) == known


def test_memory_stays_the_same_however_long_a_goal_goes_on():
    """Hundreds of spline pieces, a cycle each: no starvation, and no growth."""

    async def scenario(cell):
        home, sizes, blocks = cell.memory.read().actual_tcp_pose, [], []

        def part(first):
            return circle(home, first, 125, step=CYCLE)

        motion = AppendMotion(
            cell,
            Goal(waypoints=tuple(part(1)), keep_open=True, execution=ExecutionMode.SPLINE),
            self_collision='off',
        )
        while motion.points < 750:
            assert await motion.until(
                lambda: (
                    motion.motion.progress
                    and motion.progress.points_received == motion.points
                    and motion.progress.time_remaining < HORIZON
                )
            ), motion.outcome.text
            await motion.append(part(motion.points + 1))
            clear_network_log(cell)
            del motion.motion.progress[:-1]
            sizes.append(retained_sizes(cell))
            gc.collect()
            blocks.append(sys.getallocatedblocks())
        await motion.append(last=True)
        end = await motion.ended()
        assert end.succeeded, end.text
        assert end.report == (), 'it was never closed'
        for name, bound in (('records', 500), ('rows', 1000), ('unsent', 400)):
            assert max(size[name] for size in sizes) < bound, name
        assert max(blocks[3:]) - min(blocks[2:3]) < 500, 'of hundreds of thousands'

    run_cell(scenario, feedback_rate=10.0)
