# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Changes of the control mode while the robot program runs a trajectory."""

import pytest
from robot_in_memory import RobotInMemory

from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.plan.primitive import MoveJ
from ur_cartesian_driver.protocol.program.reverse import trajectory, TrajectoryAction

HOME = (0.3, -1.4, 1.5, -1.6, -1.5, 0.2)
MOVE = MoveJ(target=(0.3001, *HOME[1:]), velocity=1.0, acceleration=10.0)


def test_a_trajectory_that_ends_beside_a_mode_change_has_one_result():
    robot = RobotInMemory('ur5e', interleaving_seed=0)
    results = set()
    cycles = 0

    def idle_at_the_end(_controller):
        nonlocal cycles
        cycles += 1
        if cycles == last_cycle:
            robot.ask_to_idle()

    last_cycle = None
    for attempt in range(80):
        robot.place(HOME, IDENTITY)
        cycles = 0
        run = robot.run([MOVE], on_cycle=idle_at_the_end)
        late = robot.late_results(10)
        assert late == [], f'{run.result.name}, then {late}'
        results.add(run.result)
        if attempt == 10:  # the first trajectories of a program take longer
            last_cycle = cycles - 1
    assert results == {TrajectoryResult.SUCCESS, TrajectoryResult.CANCELED}


@pytest.mark.parametrize('announced', [100, 1500])
def test_a_cancel_discards_the_points_that_were_sent_and_waits_for_no_others(announced):
    """Ten points a cycle: 100 take 0.08 s at 125 Hz, after the arm has stopped."""
    robot = RobotInMemory('ur5e', frequency=125)
    robot.place(HOME, IDENTITY)
    there = MoveJ(target=(0.8, *HOME[1:]), velocity=0.5, acceleration=10.0)
    begun = robot.controller.time
    cancelled = []

    def cancel(controller):
        if controller.time - begun > 0.4 and not cancelled:
            cancelled.append(controller.time)
            robot.ask(trajectory(TrajectoryAction.CANCEL, 100, read_timeout=0))

    run = robot.run([there] * 100, announced_count=announced, on_cycle=cancel)
    assert run.result is TrajectoryResult.CANCELED
    assert robot.controller.time - cancelled[0] < 0.3
    assert robot.late_results(10) == []
    again = robot.run([MOVE])
    assert again.result is TrajectoryResult.SUCCESS
