# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Changes of the control mode while the robot program runs a trajectory."""

from robot_in_memory import RobotInMemory

from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.plan.primitive import MoveJ

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
