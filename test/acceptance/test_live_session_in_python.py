# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Live targets from Python: a calibrated arm, and wrong calls."""

from time import sleep

import pytest

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

#: servoj creeps to the last target; on a busy computer in less simulated time than passes.
OPTIONS = {'live_target_timeout': 1.0}


def test_a_calibrated_arm_goes_to_the_last_target_exactly(make_driver, ur_sim):
    driver = make_driver(OPTIONS)
    driver.wait_ready(10.0)
    assert driver.arm.calibrated
    reports = []
    driver.add_servo_listener(reports.append)
    here = driver.state.actual_tcp_pose
    x, y, z = here.position
    turned = multiply(here.quaternion, quaternion_from_rotation_vector((0.1, 0.0, 0.2)))
    target = type(here)((x + 0.02, y + 0.03, z), turned)
    for _ in range(30):
        motion = driver.send_live_target(target)
        sleep(0.02)
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
