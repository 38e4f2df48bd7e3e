# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Live targets from Python: a calibrated arm, and wrong calls."""

from time import sleep

import pytest
from waiting import wait_for

from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode, InvalidGoal, RobotNotReady
from ur_cartesian_driver.motion.geometry.pose import multiply, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.sim.calibration import random_calibration

pytestmark = [
    pytest.mark.acceptance,
    pytest.mark.slow,
    pytest.mark.ur_sim(frequency=125.0, geometry=random_calibration(robot_model('ur5e'), 7)),
]

OPTIONS = {'live_target_timeout': 1.0}


def test_a_calibrated_arm_goes_to_the_last_target_exactly(make_driver, ur_sim):
    driver = make_driver(OPTIONS)
    driver.wait_ready(30.0)
    assert driver.arm.calibrated
    reports = []
    driver.add_servo_listener(reports.append)
    here = driver.state.actual_tcp_pose
    x, y, z = here.position
    turned = multiply(here.quaternion, quaternion_from_rotation_vector((0.1, 0.0, 0.2)))
    target = type(here)((x + 0.02, y + 0.03, z), turned)
    motion = driver.send_live_target(target)

    def has_arrived():
        """Send once more: servoj creeps, and a busy computer simulates less time than passes."""
        assert driver.send_live_target(target) is motion
        sleep(0.02)
        tool = ur_sim.state().T_base_tcp
        return tool.distance_to(target) < 1e-5 and tool.angle_to(target) < 1e-5

    wait_for(has_arrived)
    with pytest.raises(RobotNotReady, match='A motion is running'):
        driver.start(driver.plan(Goal(waypoints=(Waypoint(pose=here, time=1.0),))))
    with pytest.raises(InvalidGoal, match='max_approach_distance'):
        driver.send_live_target(type(here)((x + 0.7, y, z), turned))
    assert motion.result(5.0).code is ErrorCode.SUCCESSFUL
    arrived = ur_sim.state().T_base_tcp
    assert arrived.distance_to(target) < 1e-5
    assert arrived.angle_to(target) < 1e-5
    assert reports
    with pytest.raises(RobotNotReady, match='allow_freedrive is false'):
        driver.start_freedrive()
    assert driver.execute(Goal(waypoints=(Waypoint(pose=here, time=0.4),)), timeout=5.0).succeeded
