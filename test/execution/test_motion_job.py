# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The job of a plan, for the machine in another process."""

from math import pi

import pytest

from ur_cartesian_driver.execution.goal.motion_job import job_from_plan
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning import plan, PlanningOptions

ARM = Arm(robot_model('ur5e'))
Q = (0.3, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
HOME = ARM.forward(Q)
STATE = RobotState(
    timestamp=0.0, actual_q=Q, target_q=Q, actual_tcp_pose=HOME, target_tcp_pose=HOME
)


@pytest.mark.parametrize(
    'execution', [ExecutionMode.PRIMITIVES, ExecutionMode.SPLINE, ExecutionMode.SERVO]
)
@pytest.mark.parametrize(('time', 'due'), [(4.0, 4.0), (0.4, 1.5)])
def test_a_goal_is_due_at_its_time_or_where_it_is_slowed_at_the_end_of_its_plan(
    time, due, execution
):
    x, y, z = HOME.position
    goal = Goal(
        waypoints=(Waypoint(pose=Pose((x, y + 0.1, z), HOME.quaternion), time=time),),
        execution=execution,
    )
    options = PlanningOptions(on_too_fast='slow', max_tool_speed=0.1, self_collision='off')
    job = job_from_plan(plan(goal, STATE, ARM, options))
    assert job.due == pytest.approx(due, abs=0.01)
    assert job.due >= job.duration - 1e-9
