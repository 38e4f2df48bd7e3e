# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Tails that are replaced while the arm moves, in virtual time; another RTDE client judges.

``REPLACED_TAIL_SECONDS`` sets how long each endless motion lasts, ``REPLACED_TAIL_RATES`` how many
times a second its tail is replaced.
"""

from dataclasses import replace
import gc
from math import pi
import os
from runpy import run_path
import sys

from append_goals import AppendMotion, moved, retained_sizes
from checkout import CHECKOUT, needs_checkout
from example_goals import example_goal
import numpy as np
import pytest
from replanner import PERIOD, RADIUS, Readings, replan, Replanner
from robot_cell import run_cell

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import AlreadySent, ErrorCode, GoalRefused
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

SECONDS = float(os.environ.get('REPLACED_TAIL_SECONDS', '2'))
RATES = [float(rate) for rate in os.environ.get('REPLACED_TAIL_RATES', '30').split()]
MODES = (ExecutionMode.SERVO, ExecutionMode.SPLINE)
#: Largest change of a joint's acceleration from one packet of 8 ms to the next [rad/s^2].
MAX_JUMP = 1.0
#: Of the tool on the circle [m/s].
SPEED = 2.0 * pi / PERIOD * RADIUS
ARM = Arm(robot_model('ur5e'))
EXAMPLE = CHECKOUT / 'examples' / 'replanned.py'


async def replanned(cell, mode, rate):
    """Replace tails until the time is over; return the motion, the readings, and sizes."""
    home = cell.memory.read().actual_tcp_pose
    readings = Readings(cell, SECONDS + 10.0)
    await readings.connect()
    motion = AppendMotion(cell, Replanner(home).goal(mode), self_collision='off')
    blocks = []

    def measure():
        gc.collect()
        blocks.append(sys.getallocatedblocks())
        for name, bound in (('records', 150), ('rows', 2500), ('unsent', 150)):
            assert retained_sizes(cell)[name] < bound, name
        assert len(motion.appender._goal.parts) < 40

    await replan(cell, motion, readings, rate, SECONDS, measure)
    return motion, readings, blocks


@pytest.mark.parametrize('rate', RATES)
@pytest.mark.parametrize('mode', MODES, ids=lambda mode: mode.name)
def test_an_arm_whose_tail_is_replaced_again_and_again_neither_stops_nor_jumps(mode, rate):
    motion, readings, blocks = run_cell(lambda cell: replanned(cell, mode, rate))
    end = motion.outcome
    assert end.succeeded, end.text
    assert end.report == (), 'it was never brought to rest'
    rows = readings.moving
    assert rows[-1, 0] - rows[0, 0] > SECONDS
    tool = ARM.forward_rows(rows[:, 1:7])[:, :3]
    speeds = np.linalg.norm(np.diff(tool, axis=0), axis=1) / np.diff(rows[:, 0])
    between = slice(int(1.2 / 0.008), -int(1.0 / 0.008))
    assert speeds[between].min() > 0.8 * SPEED
    jumps = np.abs(np.diff(readings.accelerations, axis=0)).max(axis=1)
    assert jumps.max() < MAX_JUMP
    # A plan has thousands.
    half = len(blocks) // 2
    assert max(blocks[half:]) - max(blocks[:half]) < 1000, 'of hundreds of thousands'


async def moves_around(cell, mode, **options):
    """Begin the circle; return its motion and planner, half a second later."""
    planner = Replanner(cell.memory.read().actual_tcp_pose)
    motion = AppendMotion(cell, planner.goal(mode), **options)
    assert await motion.until(lambda: motion.motion.progress and motion.progress.time > 0.4)
    return motion, planner


@pytest.mark.parametrize('mode', MODES, ids=lambda mode: mode.name)
def test_what_has_been_sent_is_refused_with_what_is_possible(mode):
    async def scenario(cell):
        motion, planner = await moves_around(cell, mode)
        points = planner.chunk(motion.progress.time + 0.4)
        for choice in (
            {'replace_from_time': motion.progress.time - 0.2},
            {'replace_from_time': motion.progress.time + 0.03},
            {'replace_from_point': 1},
        ):
            known = motion.points
            with pytest.raises(
                AlreadySent, match=r'^The points to be replaced have been'
            ) as refusal:
                await motion.append(points, **choice)
            assert motion.points == known
            first = refusal.value.first_time
            assert 0.03 < first - motion.progress.time < 0.2
            assert str(refusal.value).endswith(
                f'from point {refusal.value.first_point} or from {first:.3f} s on, or later.'
            )
            answer = await motion.append(
                planner.chunk(first + 0.1), replace_from_point=refusal.value.first_point + 1
            )
            assert answer.first == refusal.value.first_point + 1
        await motion.append(last=True)
        end = await motion.ended()
        assert end.succeeded, end.text

    run_cell(scenario)


@pytest.mark.parametrize('mode', MODES, ids=lambda mode: mode.name)
def test_a_tail_that_is_refused_leaves_the_old_one(mode):
    async def scenario(cell):
        readings = Readings(cell, 10.0)
        await readings.connect()
        motion, planner = await moves_around(cell, mode)
        time = motion.progress.time + 0.2
        good = planner.chunk(time)
        far = [replace(point, pose=moved(point.pose, 2.0, 0.0, 0.0)) for point in good]
        for points, text in (
            (far, r'points\[\d+\]'),
            ([replace(good[0], time=time - 0.01)], r'where the new tail begins'),
            ((), 'points is empty'),
        ):
            with pytest.raises(GoalRefused, match=text):
                await motion.append(points, replace_from_time=time)
        points = planner.chunk(time, last=True)
        await motion.append(points, replace_from_time=time, last=True)
        end = await motion.ended()
        assert end.succeeded, end.text
        tool = ARM.forward_rows(readings.moving[-1:, 1:7])[0, :3]
        assert np.abs(tool - points[-1].pose.position).max() < 1e-3

    run_cell(scenario)


@pytest.mark.parametrize('mode', MODES, ids=lambda mode: mode.name)
def test_a_goal_that_has_run_out_goes_on_from_rest(mode):
    async def scenario(cell):
        motion, planner = await moves_around(cell, mode)
        assert await motion.until(lambda: motion.progress.awaiting_points)
        assert np.abs(cell.robot.controller.motion.qd).max() < 1e-3
        time = motion.progress.time + 0.2
        answer = await motion.append(planner.chunk(time), replace_from_time=time)
        assert 'had come to rest before these points' in answer.text
        assert await motion.until(lambda: not motion.progress.awaiting_points)
        await motion.append(last=True)
        end = await motion.ended()
        assert end.succeeded, end.text
        assert 'was brought to rest once' in end.report[0]

    run_cell(scenario)


@pytest.mark.parametrize('mode', MODES, ids=lambda mode: mode.name)
def test_a_goal_that_is_cancelled_while_it_waits_says_where_it_rests(mode):
    async def scenario(cell):
        motion, _ = await moves_around(cell, mode)
        assert await motion.until(lambda: motion.progress.awaiting_points)
        last = motion.points - 1
        cell.owner.cancel()
        end = await motion.ended()
        assert end.code is ErrorCode.CANCELLED
        assert end.text.endswith(f'(at rest behind point {last}, waiting for more).'), end.text

    run_cell(scenario)


@needs_checkout
def test_the_chunks_of_the_example_are_one_motion():
    replanned = run_path(str(EXAMPLE))['replanned']

    async def scenario(cell):
        readings = Readings(cell, 10.0)
        await readings.connect()
        motion = AppendMotion(cell, replanned(cell.memory.read().actual_tcp_pose).goal())
        assert await motion.until(lambda: motion.motion.progress)
        while motion.progress.time < 1.5:
            since = motion.progress.time + 0.3
            chunk = replanned(motion.home, since).goal().waypoints
            await motion.append(chunk, replace_from_time=since)
            await cell.sleep(0.1)
        await motion.append(last=True)
        return motion.home, await motion.ended(), readings

    home, end, readings = run_cell(scenario)
    assert end.succeeded, end.text
    assert not any('brought to rest' in line for line in end.report)
    x, y, z = (ARM.forward_rows(readings.moving[:, 1:7])[:, :3] - home.position).T
    assert np.hypot(x, y - 0.05) == pytest.approx(0.05, abs=1e-3)
    assert 0.003 < z.max() < 0.006, 'where the later plans have it'


def test_the_goal_file_takes_the_tail_of_the_other_file():
    async def scenario(cell):
        readings = Readings(cell, 15.0)
        await readings.connect()
        state = cell.memory.read()
        motion = AppendMotion(cell, example_goal('replanned', state))
        assert await motion.until(lambda: motion.motion.progress and motion.progress.time > 4.0)
        points = example_goal('replanned_tail', state).waypoints
        await motion.append(points, replace_from_time=6.0, last=True)
        return motion.home, points, await motion.ended(), readings

    home, points, end, readings = run_cell(scenario)
    assert end.succeeded, end.text
    assert end.report == (), 'it was never brought to rest'
    tool = ARM.forward_rows(readings.moving[:, 1:7])[:, :3]
    assert tool[:, 1].max() - home.position[1] == pytest.approx(0.08, abs=1e-4)
    assert np.linalg.norm(tool - points[0].pose.position, axis=1).min() < 1e-4
    assert tool[-1] == pytest.approx(home.position, abs=1e-4)
    assert np.abs(np.diff(readings.accelerations, axis=0)).max() < MAX_JUMP
