# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A plain goal: a square of 20 cm in 10 s, judged by the robot's own reports."""

from itertools import pairwise

import numpy as np
import pytest

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint

pytestmark = [
    pytest.mark.acceptance,
    pytest.mark.slow,
    pytest.mark.both_arms,
    pytest.mark.exhaustive,
]


@pytest.fixture
def square(home):
    corners = [home(), home(y=0.2), home(x=0.2, y=0.2), home(x=0.2), home()]
    return [corner.position for corner in corners], Goal(
        waypoints=tuple(
            Waypoint(pose=corner, time=2.5 * (i + 1)) for i, corner in enumerate(corners[1:])
        )
    )


def distances_to_line(points, a, b):
    a, b = np.array(a), np.array(b)
    along = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return np.linalg.norm(points - a - along[:, None] * (b - a), axis=1)


def test_a_square_in_ten_seconds(driver, square, record):
    corners, goal = square
    with record() as recording:
        outcome = driver.execute(goal, timeout=30.0)
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome.text
    assert len(outcome.report) >= 4

    positions = recording.positions
    off = np.min([distances_to_line(positions, a, b) for a, b in pairwise(corners)], axis=0)
    assert off.max() < 0.0005
    for corner in corners:
        assert np.linalg.norm(positions - np.array(corner), axis=1).min() < 0.0001
    assert recording.duration == pytest.approx(10.0, rel=0.01)


def test_progress_goes_from_the_first_to_the_last_point(driver, square):
    _, goal = square
    seen = []
    assert driver.execute(goal, on_progress=seen.append, timeout=30.0).succeeded
    waypoints = [progress.waypoint for progress in seen]
    assert waypoints == sorted(waypoints)
    assert set(waypoints) == {0, 1, 2, 3}
    fractions = [progress.fraction for progress in seen]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert max(p.desired_pose.distance_to(p.actual_pose) for p in seen) < 0.0005
    assert len(seen) > 100
