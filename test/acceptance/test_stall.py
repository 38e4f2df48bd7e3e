# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals that wait for an arm that is off its path, judged by what RTDE reports."""

from dataclasses import replace
from pathlib import Path as FilePath
from runpy import run_path

import numpy as np
import pytest
from robot_cell import run_cell

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal import Goal, OnPathTolerance, Tolerance, Waypoint
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.sim.faults.fault_values import AfterDistance, DeviationFault

pytestmark = [pytest.mark.acceptance]

ARM = Arm(robot_model('ur5e'))
#: Of the planned motion [s], [m].
TIME, DISTANCE = 2.0, 0.2
ALLOWED, PUSHED = 0.005, 0.02
EXAMPLE = FilePath(__file__).resolve().parents[2] / 'examples' / 'stall.py'


class Seam:
    """A line, off which the arm is pushed once in a while."""

    def __init__(self, cell, *, stall_timeout, **changes):
        self._cell, self.states = cell, []
        state = cell.memory.read()
        x, y, z = state.actual_tcp_pose.position
        there = replace(state.actual_tcp_pose, position=(x, y + DISTANCE, z))
        goal = Goal(
            waypoints=(Waypoint(pose=there, time=TIME),),
            path_tolerance=Tolerance(position=(ALLOWED,) * 3),
            execution=ExecutionMode.SERVO,
            on_path_tolerance=OnPathTolerance.STALL,
            stall_timeout=stall_timeout,
        )
        self.start = np.array((x, y, z))
        made = plan(replace(goal, **changes), state, ARM, PlanningOptions())
        self._motion = cell.owner.start(made)

    def push(self, duration):
        self._cell.robot.inject(
            DeviationFault(
                quantity='pose',
                axis='z',
                shape='offset',
                amount=PUSHED,
                trigger=AfterDistance(0.03),
                duration=duration,
            )
        )

    def looked(self):
        state = self._cell.memory.read()
        if not self.states or state.timestamp > self.states[-1].timestamp:
            self.states.append(state)
        return self._motion.outcome is not None

    async def end(self):
        await self._cell.until(self.looked, 60.0)
        return self._motion.outcome

    @property
    def speeds(self):
        return np.array([state.target_tcp_twist[1] for state in self.states])

    @property
    def off_path(self):
        """How far the controller's own target is beside the line [m]."""
        places = np.array([state.target_tcp_pose.position for state in self.states])
        return np.linalg.norm((places - self.start)[:, [0, 2]], axis=1).max()


def test_the_motion_waits_on_its_path_and_goes_on():
    async def scenario(cell):
        seam = Seam(cell, stall_timeout=5.0)
        seam.push(1.0)
        return seam, await seam.end()

    seam, outcome = run_cell(scenario)
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome
    moving = np.flatnonzero(seam.speeds > 1e-6)
    times = np.array([state.timestamp for state in seam.states])
    stands = seam.speeds[moving[0] : moving[-1]] < 1e-3  # servoj creeps
    steps = np.diff(times[moving[0] : moving[-1] + 1])
    assert 0.5 < steps[stands].sum() < 1.0  # it needs a while to stand
    assert TIME + 0.9 < times[moving[-1]] - times[moving[0]] < TIME + 1.7
    assert seam.off_path < 1e-4
    # Neither end of the wait is a jolt: the rate of the motion has slopes.
    peak = 1.5 * DISTANCE / TIME
    assert np.abs(np.diff(seam.speeds)).max() < 0.12 * peak
    assert seam.states[-1].target_tcp_pose.position[1] - seam.start[1] == pytest.approx(
        DISTANCE, abs=1e-4
    )
    (line,) = [line for line in outcome.report if 'waited' in line]
    assert line.startswith('the motion waited once for an arm that was off its path, for 0.9')


@pytest.mark.skipif(not EXAMPLE.is_file(), reason='only a checkout has the examples')
def test_the_example_waits():
    async def scenario(cell):
        path = run_path(str(EXAMPLE))['stall'](cell.memory.read().actual_tcp_pose).goal()
        fields = ('waypoints', 'segments', 'path_tolerance', 'execution', 'on_path_tolerance')
        seam = Seam(
            cell,
            stall_timeout=path.stall_timeout,
            **{name: getattr(path, name) for name in fields},
        )
        seam.push(1.0)
        return seam, await seam.end()

    seam, outcome = run_cell(scenario)
    assert outcome.succeeded, outcome
    assert any('waited once' in line for line in outcome.report)
    assert seam.off_path < 1e-4


def test_an_arm_that_does_not_come_back_ends_the_goal():
    async def scenario(cell):
        seam = Seam(cell, stall_timeout=0.6)
        seam.push(5.0)
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
        seam = Seam(cell, stall_timeout=5.0, on_path_tolerance=OnPathTolerance.ABORT)
        seam.push(1.0)
        return await seam.end()

    outcome = run_cell(scenario)
    assert outcome.code is ErrorCode.PATH_TOLERANCE_VIOLATED
    assert ' for ' not in outcome.text


def test_a_goal_that_waits_can_be_cancelled_and_paused():
    async def scenario(cell):
        seam = Seam(cell, stall_timeout=1.0)
        seam.push(2.0)
        await cell.sleep(1.2)
        assert not seam.looked()
        cell.robot.controller.programs.pause()
        await cell.sleep(1.5)  # no time in which the arm could have come back
        cell.robot.play_program()
        outcome = await seam.end()
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        seam = Seam(cell, stall_timeout=5.0)
        seam.push(3.0)
        await cell.sleep(1.5)
        cell.owner.cancel()
        return await seam.end()

    assert run_cell(scenario).code is ErrorCode.CANCELLED
