# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Checks during a press leave out the yield, which has a bound of its own."""

from math import inf

import pytest

from ur_cartesian_driver.execution.monitoring.press_window import PressWindow
from ur_cartesian_driver.motion.geometry.pose import (
    multiply,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.geometry.vectors import ZERO6
from ur_cartesian_driver.motion.state.rtde_state import RobotState

#: A quarter turn about x: the z axis of the tool is -y of the base.
LYING = quaternion_from_rotation_vector((1.5707963267948966, 0.0, 0.0))
PLANNED = Pose((0.1, 0.2, 0.3), LYING)


def press(axes, **fields):
    every = ('x', 'y', 'z', 'rx', 'ry', 'rz')
    return PressWindow(
        **{'begin': 1.0, 'end': 2.0, 'release': 3.0, 'q_base_task': None}
        | {'compliant': tuple(float(axis in axes) for axis in every), 'max_yields': (0.01, 0.1)}
        | fields
    )


def off(*shift, turn=(0.0, 0.0, 0.0)):
    x, y, z = (a + b for a, b in zip(PLANNED.position, shift, strict=True))
    return Pose((x, y, z), multiply(quaternion_from_rotation_vector(turn), LYING))


def state(pose):
    return RobotState(
        timestamp=0.0,
        actual_q=ZERO6,
        actual_tcp_pose=pose,
        target_tcp_twist=(0.0, 0.0, 0.1, 0.0, 0.0, 0.0),
        actual_tcp_twist=(0.02, -0.03, 0.1, 0.0, 0.0, 0.0),
    )


def test_it_lasts_until_the_tool_is_back_on_its_path():
    window = press('z')
    assert [window.contains(time) for time in (0.9, 1.0, 2.5, 3.0)] == [False, True, True, False]
    assert press('z', release=inf).contains(1e9)


def test_yield_along_the_axes_of_the_tool_is_left_out():
    assert press('z').without_yield(PLANNED, off(0.003, -0.004, 0.002)).position == pytest.approx(
        (0.103, 0.2, 0.302)
    )
    in_base = press('z', q_base_task=(0.0, 0.0, 0.0, 1.0))
    assert in_base.without_yield(PLANNED, off(0.003, -0.004, 0.002)).position == pytest.approx(
        (0.103, 0.196, 0.3)
    )


def test_turns_about_compliant_axes_are_left_out():
    pose = off(0.0, 0.0, 0.0, turn=(0.05, -0.08, 0.0))
    assert press(('z', 'rz')).without_yield(PLANNED, pose).angle_to(PLANNED) == pytest.approx(
        0.05, abs=1e-3
    )
    assert press('z').without_yield(PLANNED, pose).quaternion == pose.quaternion


def test_speeds_along_compliant_axes_are_those_of_the_target():
    stiff = press('z').stiff_state(PLANNED, state(off(0.0, -0.004, 0.0)))
    assert stiff.actual_tcp_twist == pytest.approx((0.02, 0.0, 0.1, 0.0, 0.0, 0.0), abs=1e-9)


def test_a_tool_that_gives_way_too_far_is_a_fault_while_it_presses():
    window = press(('z', 'rx'))
    assert window.excess(PLANNED, state(off(0.02, -0.009, 0.0)), 1.5) is None
    assert window.excess(PLANNED, state(off(0.0, -0.011, 0.0)), 1.5) == (
        'the tool gave way by 0.0110 m along z of its press, max_yield is 0.0100 m'
    )
    assert window.excess(PLANNED, state(off(0.0, 0.0, 0.0, turn=(0.11, 0.0, 0.0))), 1.5) == (
        'the tool gave way by 0.1100 rad about x of its press, max_yield_angle is 0.1000 rad'
    )
    assert window.excess(PLANNED, state(off(0.0, -0.011, 0.0)), 2.5) is None


@pytest.mark.parametrize(('direction', 'share'), [((1, 0, 0), 0.0), ((0, -1, 0), 1.0)])
def test_along_the_path_itself_giving_way_is_progress(direction, share):
    assert press('z').compliant_share(PLANNED, direction) == pytest.approx(share, abs=1e-12)
