# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A goal whose first point is where the arm stands keeps its times, end to end."""

import pytest
from robot_cell import run_cell

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, IOCommand, OutputKind, Tolerance, Waypoint
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

ARM = Arm(robot_model('ur5e'))


@pytest.mark.parametrize('imperfect', ['', '1'], ids=['ideal', 'imperfect'])
@pytest.mark.parametrize('times', [(8.0,), (6.0, 8.0)], ids=['one point', 'and a motion'])
def test_the_arm_waits_where_it_stands_until_the_time_of_the_point(times, imperfect):
    async def scenario(cell):
        state = cell.memory.read()
        x, y, z = state.actual_tcp_pose.position
        goal = Goal(
            waypoints=tuple(
                Waypoint(pose=Pose((x, y + 0.02 * k, z), state.actual_tcp_pose.quaternion), time=t)
                for k, t in enumerate(times)
            ),
            path_tolerance=Tolerance(position=(1e-3,) * 3),
            goal_time_tolerance=0.5,
            io_commands=(
                IOCommand(
                    waypoint=0, offset=0.0, output=OutputKind.STANDARD_DIGITAL, pin=1, value=1.0
                ),
            ),
        )
        begun = cell.loop.time()
        motion = cell.owner.start(plan(goal, state, ARM, PlanningOptions()))
        await cell.until(lambda: cell.loop.time() > begun + times[0] - 0.3, bound=10.0)
        assert motion.ended_at is None
        assert cell.memory.read().actual_tcp_pose.distance_to(state.actual_tcp_pose) < 5e-4
        await cell.until(lambda: motion.outcome is not None, bound=10.0)
        assert motion.outcome.succeeded, motion.outcome.text
        assert cell.loop.time() - begun == pytest.approx(8.1, abs=0.3)

    run_cell(scenario, imperfect=imperfect)
