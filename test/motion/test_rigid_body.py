# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Twist and acceleration at another point of a body, against finite differences of its motion."""

from dataclasses import fields
from math import cos, sin

import numpy as np
import pytest

from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    Pose,
    quaternion_from_rotation_vector,
    rotate,
    rotation_vector_from_quaternion,
)
from ur_cartesian_driver.motion.state.rigid_body import (
    acceleration_at,
    shift_reference_point,
    twist_at,
)
from ur_cartesian_driver.motion.state.rtde_state import RobotState

FRAME = Pose((0.1, -0.2, 0.3), quaternion_from_rotation_vector((0.3, 0.2, -0.5)))
H = 1e-4


def body(t):
    """Return where a body is that turns about an axis which turns itself."""
    spin = Pose((0.0, 0.0, 0.0), quaternion_from_rotation_vector((0.0, 0.0, 0.7 * t + t * t)))
    tilt = Pose((0.0, 0.0, 0.0), quaternion_from_rotation_vector((0.4 * sin(t), 0.0, 0.0)))
    return Pose((0.3 * cos(t), 0.2 * t * t, 0.1 * t), (spin @ tilt).quaternion)


def twist(pose, t):
    """Return the twist of a frame by central differences."""
    before, after = pose(t - H), pose(t + H)
    linear = [(b - a) / (2 * H) for a, b in zip(before.position, after.position, strict=True)]
    turn = Pose((0, 0, 0), after.quaternion) @ Pose((0, 0, 0), before.quaternion).inverse()
    angular = [v / (2 * H) for v in rotation_vector_from_quaternion(turn.quaternion)]
    return (*linear, *angular)


def acceleration(pose, t):
    before, after = np.array(twist(pose, t - H)), np.array(twist(pose, t + H))
    return tuple((after - before) / (2 * H))


def frame(t):
    return body(t) @ FRAME


@pytest.mark.parametrize('t', [0.0, 0.4, 1.3])
def test_twist_and_acceleration_are_those_of_the_other_point(t):
    offset = rotate(body(t).quaternion, FRAME.position)
    there = twist_at(twist(body, t), offset)
    assert there == pytest.approx(twist(frame, t), abs=1e-5)
    assert acceleration_at(acceleration(body, t), twist(body, t), offset) == pytest.approx(
        acceleration(frame, t), abs=1e-4
    )


def test_a_state_is_carried_to_a_frame_and_back():
    state = RobotState(
        timestamp=1.0,
        actual_q=(0.1,) * 6,
        T_flange_tcp=Pose((0.0, 0.0, 0.1)),
        actual_tcp_pose=body(0.4),
        target_tcp_pose=body(0.41),
        actual_tcp_twist=twist(body, 0.4),
        target_tcp_twist=twist(body, 0.41),
        actual_tcp_acceleration=acceleration(body, 0.4),
    )
    there = shift_reference_point(state, FRAME)
    assert there.actual_tcp_pose.distance_to(frame(0.4)) < 1e-12
    assert there.target_tcp_twist == pytest.approx(twist(frame, 0.41), abs=1e-5)
    assert there.actual_tcp_acceleration == pytest.approx(acceleration(frame, 0.4), abs=1e-4)
    assert there.target_tcp_acceleration is None
    back = shift_reference_point(there, FRAME.inverse())
    for field in fields(state):
        before, after = (getattr(s, field.name) for s in (state, back))
        if isinstance(before, Pose):
            before, after = before.row(), after.row()
        assert after == (pytest.approx(before) if isinstance(before, tuple) else before)


def test_nothing_changes_at_the_tcp_itself():
    state = RobotState(timestamp=1.0, actual_q=(0.1,) * 6)
    assert shift_reference_point(state, IDENTITY) is state
