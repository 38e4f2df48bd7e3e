# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The experiments of the manufacturer's servoj guide: without and with a buffer, loop closed or not.

The robot side is the guide's sample program, or its first experiment, which has no buffer;
the driver's side is ours, over RTDE only. ``doc/servo_experiments.png`` shows the same runs.
"""

import numpy as np
import pytest
from servo_cell import CYCLE
from servo_experiments import buffered, HEIGHT, unbuffered

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]


def test_without_a_buffer_setpoints_are_skipped_when_the_robot_is_slower_or_a_packet_late():
    assert unbuffered(1.0, 0.8).skipped <= 1
    slow = unbuffered(0.5, 0.8)
    assert slow.skipped == pytest.approx(0.5 * slow.written, abs=3)
    late = unbuffered(1.0, 0.8, late=7)
    assert late.skipped >= late.written // 8


@pytest.mark.parametrize(
    ('slider', 'late'),
    [(0.5, 0), *(pytest.param(1.0, late, marks=pytest.mark.exhaustive) for late in (0, 7))],
)
def test_with_the_buffer_none_is_skipped(slider, late):
    seen = buffered(slider, 0.8, late)
    assert seen.skipped == 0
    assert 0.02 < seen.lag[-1] < 0.06
    assert seen.lag.max() < 0.06


@pytest.mark.exhaustive
def test_the_motion_is_smoother_with_the_buffer():
    rough, smooth = unbuffered(0.5, 4.0), buffered(0.5, 4.0)
    assert smooth.jerkiness < 0.6 * rough.jerkiness
    arm = Arm(robot_model('ur5e'))
    heights = np.array([arm.forward(q).position[2] for q in smooth.actual[::20].tolist()])
    assert heights.max() - heights.min() == pytest.approx(HEIGHT, abs=2e-3)


@pytest.mark.exhaustive
def test_a_producer_without_end_keeps_buffer_and_lag_bounded_at_half_speed():
    seen = buffered(0.5, 40.0)
    assert seen.lag.max() < 0.06
    assert seen.skipped == 0


def test_with_the_loop_opened_the_lag_grows_as_the_slider_takes_speed_away():
    seen = buffered(0.5, 1.2, closed_loop=False)
    first, last = round(0.6 / CYCLE), round(1.2 / CYCLE) - 1
    assert seen.lag[last] - seen.lag[first] == pytest.approx(0.5 * 0.6, abs=0.02)
