# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A robot with tighter limits than its model: they are reported, used and named."""

import pytest

from ur_cartesian_driver.kinematics.robot_models import JointLimits, robot_model
from ur_cartesian_driver.motion.errors import JointLimitExceeded, TooFast
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, SegmentType, Waypoint

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

UR5E = robot_model('ur5e')
#: The base joint turns within 0.1 rad at up to 0.2 rad/s; all others keep the model's limits.
TIGHT = JointLimits(
    position=((-0.1, 0.1), *UR5E.position_limits[1:]), speed=(0.2, *UR5E.max_joint_speed[1:])
)
SOURCE = 'which the controller reports in its configuration'


@pytest.mark.ur_sim(joint_limits=TIGHT)
def test_a_goal_beyond_a_reported_range_is_refused_with_the_source_and_one_within_runs(
    driver, home
):
    for kind in (SegmentType.LINEAR, SegmentType.JOINT):
        beyond = Goal(
            waypoints=(Waypoint(pose=home(x=-0.1, y=0.2)),), segments=(Segment(type=kind),)
        )
        with pytest.raises(JointLimitExceeded, match=f'-0.1000 to 0.1000 rad, {SOURCE}'):
            driver.plan(beyond)
    within = Goal(waypoints=(Waypoint(pose=home(y=0.02), time=2.0),))
    assert driver.execute(within, timeout=10.0).succeeded


@pytest.mark.ur_sim(joint_limits=TIGHT)
@pytest.mark.parametrize('execution', [ExecutionMode.PRIMITIVES, ExecutionMode.SPLINE])
def test_a_goal_faster_than_a_reported_speed_is_refused_with_the_source(driver, home, execution):
    fast = Goal(waypoints=(Waypoint(pose=home(y=0.04), time=0.45),), execution=execution)
    with pytest.raises(TooFast, match=SOURCE):
        driver.plan(fast)


def test_without_tighter_limits_the_goals_are_those_of_the_model(driver):
    assert driver.arm.model == UR5E
