# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""An arm that is pushed, and a slider that is moved, through the whole driver."""

import pytest

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.goal import Goal, Tolerance, Waypoint

pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.both_arms]

TIGHT = Tolerance(
    position=(0.001,) * 3, orientation=(0.01,) * 3, twist=(0.05,) * 6, acceleration=(0.5,) * 6
)


@pytest.mark.parametrize(
    ('fault', 'tolerance', 'text'),
    [
        (
            'offset pose x 0.004 at 0.01 m',
            Tolerance(position=(0.002,) * 3),
            'position x is off by',
        ),
        (
            'offset pose rz 0.04 at 0.01 m',
            Tolerance(orientation=(0.02,) * 3),
            'orientation z is off',
        ),
        (
            'offset twist z -0.2 at 0.01 m',
            Tolerance(twist=(0.1,) * 6),
            'linear velocity z is off by',
        ),
        (
            'offset twist ry 0.4 at 0.01 m',
            Tolerance(twist=(0.1,) * 6),
            'angular velocity y is off by',
        ),
        (
            'offset acceleration y 3 at 0.01 m',
            Tolerance(acceleration=(1.0,) * 6),
            'linear acceleration y is off by',
        ),
        (
            'offset acceleration rx -3 at 0.01 m',
            Tolerance(acceleration=(1.0,) * 6),
            'angular acceleration x is off by',
        ),
    ],
)
def test_a_push_stops_the_arm_and_is_named(ur_sim, driver, home, fault, tolerance, text):
    motion = driver.start(
        driver.plan(
            Goal(waypoints=(Waypoint(pose=home(y=0.1), time=2.0),), path_tolerance=tolerance)
        )
    )
    ur_sim.inject(fault + ' for 0.1 s')
    outcome = motion.result(10.0)
    assert outcome.code is ErrorCode.PATH_TOLERANCE_VIOLATED
    assert f'On the way to point 0 {text}' in outcome.text
    assert driver.state.actual_tcp_pose.distance_to(home()) < 0.09


def test_a_moving_slider_violates_no_tolerance(ur_sim, driver, home):
    motion = driver.start(
        driver.plan(
            Goal(
                waypoints=(Waypoint(pose=home(y=0.03), time=0.4), Waypoint(pose=home(), time=0.8)),
                path_tolerance=TIGHT,
                goal_tolerance=TIGHT,
                goal_time_tolerance=0.2,
            )
        )
    )
    for fraction in (0.2, 0.9, 0.1, 0.5, 1.0, 0.3):
        ur_sim.set_speed_slider(fraction)
        assert not motion.done() or motion.result(0.0).succeeded
    outcome = motion.result(30.0)
    assert outcome.succeeded, outcome.text
