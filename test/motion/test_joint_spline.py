# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Joint splines pass through what fixes them, smoothly."""

import numpy as np
import pytest

from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.primitive import Spline

START = (0.1, -1.5, 1.6, -1.2, -1.4, 0.3)


def pieces(quintic):
    random = np.random.default_rng(7)
    return [
        Spline(
            target=tuple(random.normal(size=6)),
            velocities=tuple(random.normal(size=6)),
            accelerations=tuple(random.normal(size=6)) if quintic else None,
            duration=float(random.uniform(0.05, 2.0)),
        )
        for _ in range(5)
    ]


@pytest.mark.parametrize('quintic', [True, False])
def test_ends_of_pieces_are_what_was_asked(quintic):
    given = pieces(quintic)
    spline = JointSpline.of(START, given)
    assert spline.at(0.0)[0] == pytest.approx(START, abs=1e-12)
    for piece, end in zip(given, spline.times[1:], strict=True):
        for time in (end - 1e-9, end):
            q, qd, qdd = spline.at(time)
            assert q == pytest.approx(piece.target, abs=1e-6)
            assert qd == pytest.approx(piece.velocities, abs=1e-5)
            if quintic:
                assert qdd == pytest.approx(piece.accelerations, abs=1e-3)


def test_velocities_and_accelerations_are_derivatives():
    spline = JointSpline.of(START, pieces(True), velocities=(0.5,) * 6, accelerations=(-0.3,) * 6)
    times, h = np.linspace(0.001, spline.duration - 0.001, 301), 1e-6
    _, qd, qdd = spline.rows(times)
    before, after = spline.rows(times - h), spline.rows(times + h)
    np.testing.assert_allclose((after[0] - before[0]) / (2.0 * h), qd, atol=1e-4, rtol=1e-4)
    np.testing.assert_allclose((after[1] - before[1]) / (2.0 * h), qdd, atol=5e-3, rtol=1e-3)


def test_it_rests_outside_its_time():
    spline = JointSpline.of(START, pieces(True))
    q, qd, qdd = spline.rows(np.array([-1.0, spline.duration + 1.0]))
    assert q[0] == pytest.approx(START)
    assert q[1] == pytest.approx(spline.at(spline.duration)[0])
    assert not qd.any()
    assert not qdd.any()
