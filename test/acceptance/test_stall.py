# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals that wait for an arm that is off its path, judged by what RTDE reports."""

from runpy import run_path

from checkout import CHECKOUT, needs_checkout
import numpy as np
import pytest
from recorded_goal import RecordedGoal
from robot_cell import run_cell

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.goal import OnPathTolerance, Tolerance
from ur_cartesian_driver.sim.faults.fault_values import AfterDistance, DeviationFault

pytestmark = [pytest.mark.acceptance]

#: Of the planned motion [s], [m].
TIME, DISTANCE = 2.0, 0.2
ALLOWED, PUSHED = 0.005, 0.02
EXAMPLE = CHECKOUT / 'examples' / 'stall.py'


def start(cell, **fields):
    """Start a line that waits for the arm where it is off the path."""
    return RecordedGoal.along_y(
        cell,
        DISTANCE,
        TIME,
        **{
            'path_tolerance': Tolerance(position=(ALLOWED,) * 3),
            'on_path_tolerance': OnPathTolerance.STALL,
        }
        | fields,
    )


def push(cell, duration):
    """Push the arm off its path, once it has moved."""
    cell.robot.inject(
        DeviationFault(
            quantity='pose',
            axis='z',
            shape='offset',
            amount=PUSHED,
            trigger=AfterDistance(0.03),
            duration=duration,
        )
    )


def off_line(seam):
    """Return how far the controller's own target is beside the line [m]."""
    return np.linalg.norm(seam.target[:, [0, 2]], axis=1).max()


def test_the_motion_waits_on_its_path_and_goes_on():
    async def scenario(cell):
        seam = start(cell, stall_timeout=5.0)
        push(cell, 1.0)
        return seam, await seam.end()

    seam, outcome = run_cell(scenario)
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome
    speeds = np.array([state.target_tcp_twist[1] for state in seam.states])
    moving, times = np.flatnonzero(speeds > 1e-6), seam.times
    stands = speeds[moving[0] : moving[-1]] < 1e-3  # servoj creeps
    steps = np.diff(times[moving[0] : moving[-1] + 1])
    assert 0.5 < steps[stands].sum() < 1.0  # it needs a while to stand
    assert TIME + 0.9 < times[moving[-1]] - times[moving[0]] < TIME + 1.7
    assert off_line(seam) < 1e-4
    # Neither end of the wait is a jolt: the rate of the motion has slopes.
    peak = 1.5 * DISTANCE / TIME
    assert np.abs(np.diff(speeds)).max() < 0.12 * peak
    assert seam.target[-1, 1] == pytest.approx(DISTANCE, abs=1e-4)
    (line,) = [line for line in outcome.report if 'waited' in line]
    assert line.startswith('the motion waited once for an arm that was off its path, for 0.9')


@needs_checkout
def test_the_example_waits():
    async def scenario(cell):
        path = run_path(str(EXAMPLE))['stall'](cell.memory.read().actual_tcp_pose)
        seam = RecordedGoal(cell, path.goal())
        push(cell, 1.0)
        return seam, await seam.end()

    seam, outcome = run_cell(scenario)
    assert outcome.succeeded, outcome
    assert any('waited once' in line for line in outcome.report)
    assert off_line(seam) < 1e-4


def test_an_arm_that_does_not_come_back_ends_the_goal():
    async def scenario(cell):
        seam = start(cell, stall_timeout=0.6)
        push(cell, 5.0)
        outcome = await seam.end()
        return seam, outcome

    seam, outcome = run_cell(scenario)
    assert outcome.code is ErrorCode.PATH_TOLERANCE_VIOLATED
    assert 'position z is off by 0.02' in outcome.text
    assert 'for 0.6 s' in outcome.text
    pushed = [
        state.timestamp
        for state in seam.states
        if abs(state.actual_tcp_pose.position[2] - seam.start[2]) > ALLOWED
    ]
    assert 0.6 < pushed[-1] - pushed[0] < 0.9


def test_without_it_the_goal_ends_at_once():
    async def scenario(cell):
        seam = start(cell, stall_timeout=5.0, on_path_tolerance=OnPathTolerance.ABORT)
        push(cell, 1.0)
        return await seam.end()

    outcome = run_cell(scenario)
    assert outcome.code is ErrorCode.PATH_TOLERANCE_VIOLATED
    assert ' for ' not in outcome.text


def test_a_goal_that_waits_can_be_cancelled_and_paused():
    async def scenario(cell):
        seam = start(cell, stall_timeout=1.0)
        push(cell, 2.0)
        await cell.sleep(1.2)
        assert seam.motion.outcome is None
        cell.robot.controller.programs.pause()
        await cell.sleep(1.5)  # no time in which the arm could have come back
        cell.robot.play_program()
        outcome = await seam.end()
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        seam = start(cell, stall_timeout=5.0)
        push(cell, 3.0)
        await cell.sleep(1.5)
        cell.owner.cancel()
        return await seam.end()

    assert run_cell(scenario).code is ErrorCode.CANCELLED
