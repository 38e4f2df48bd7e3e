# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The predicted place of rest of a moving arm, against the brakes of the simulated controller."""

import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.stop_prediction import predict_stop
from ur_cartesian_driver.sim.motion.servo_motions import JointStopMotion

ARM = Arm(robot_model('ur5e'))
Q = (0.3, -1.4, 1.6, -1.7, -1.5, 0.2)
T_FLANGE_TCP = Pose((0.01, 0.02, 0.12))


def state(qd, **changes):
    return RobotState(
        **{
            'timestamp': 1.0,
            'actual_q': Q,
            'target_q': Q,
            'target_qd': qd,
            'actual_qd': qd,
            'actual_tcp_pose': ARM.forward(Q) @ T_FLANGE_TCP,
            'T_flange_tcp': T_FLANGE_TCP,
        }
        | changes
    )


@pytest.mark.parametrize('deceleration', [0.5, 4.0])
@pytest.mark.parametrize('qd', [(0.5, 0.0, 0.0, 0.0, 0.0, 0.0), (0.1, -0.4, 0.9, -1.2, 0.3, 0.05)])
def test_the_arm_rests_where_the_controller_brings_it_to_rest(qd, deceleration):
    brakes = JointStopMotion(Q, qd, deceleration)
    while not brakes.is_over:
        brakes.accept(brakes.preview(0.0005)[1])
    rest = predict_stop(state(qd), ARM, deceleration)
    assert rest.actual_q == pytest.approx(brakes.q, abs=1e-9)
    expected = ARM.forward(brakes.q) @ T_FLANGE_TCP
    assert rest.actual_tcp_pose.distance_to(expected) < 1e-9
    assert rest.actual_tcp_pose.angle_to(expected) < 1e-6
    assert not any(rest.actual_qd + rest.target_qd + rest.actual_tcp_twist)


def test_an_arm_at_rest_is_where_it_is():
    still = state((0.0,) * 6)
    assert predict_stop(still, ARM, 4.0) is still


def test_what_an_unknown_calibration_adds_stays_where_it_is_on_the_arm():
    off = Pose((0.001, 0.002, 0.001))
    moving = state((0.5,) * 6, actual_tcp_pose=ARM.forward(Q) @ off @ T_FLANGE_TCP)
    rest = predict_stop(moving, ARM, 4.0)
    assert rest.actual_tcp_pose.distance_to(ARM.forward(rest.actual_q) @ off @ T_FLANGE_TCP) < 1e-9
