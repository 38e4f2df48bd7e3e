# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Offsets of any kind: the path gives way within its bounds, and is itself again at the end."""

from math import inf, nan
import os
import random
from typing import Any

import numpy as np
import pytest

from ur_cartesian_driver.execution.offsets.offset_requests import OffsetRequests
from ur_cartesian_driver.execution.servo.offset_setpoints import (
    BoundedOffset,
    OffsetSetpoints,
    STEP,
)
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.goal.goal import StaleOffset
from ur_cartesian_driver.motion.plan.offset_band import OffsetBand
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.preflight.offset_band_check import fade_time

#: How many random streams; 10,000 take two minutes.
STREAMS = int(os.environ.get('OFFSET_STREAMS', '25'))
#: How many of them a test runs.
AT_A_TIME = 100
ARM = Arm(robot_model('ur5e'))
HOME = (0.0, -1.571, 1.571, -1.571, -1.571, 0.0)
LIMITS, SPEED, ACCELERATION = (0.0, 0.005, 0.004), 0.02, 0.2
ROUNDING = 1e-9


def band(duration, *, limits=LIMITS, speed=SPEED, acceleration=ACCELERATION, **changes):
    """Return the band of a straight path; it closes in time before the end."""
    times = np.arange(0.0, duration + 0.02, 0.01)
    closes = duration - fade_time(max(limits), speed, acceleration)
    return OffsetBand(
        **{
            'limits': limits,
            'speed': speed,
            'acceleration': acceleration,
            'timeout': 0.3,
            'on_stale': StaleOffset.HOLD,
            'step': 0.01,
            'axes': np.tile(np.eye(3), (len(times), 1, 1)),
            'is_open': times < closes,
        }
        | changes
    )


def test_a_second_stale_offset_is_said_when_a_warning_is_due_again():
    requests = OffsetRequests(band(20.0))
    warnings = []
    for i in range(800):
        now = 0.01 * i
        if now < 1.0 or 1.5 < now < 1.6:
            requests.set_offset((0.0, 0.001, 0.0), 0.0, now)
        warnings += [now] * len(requests.age(now))
    assert warnings == [pytest.approx(1.3, abs=0.02), pytest.approx(3.3, abs=0.02)]


class Still:
    """An arm that stands for some time."""

    def __init__(self, duration):
        self._left = duration

    def skip(self, rest):
        """It always rests."""

    def next(self, dt):
        self._left -= dt
        return HOME

    @property
    def done(self):
        return self._left <= 1e-9


class Drive:
    """A stream of set-points, and where the tool is."""

    def __init__(self, duration, **changes):
        self.band = band(duration, **changes)
        self.setpoints = OffsetSetpoints(Still(duration), self.band, ARM)
        self.time, self.joints, self.places = 0.0, [], []
        self._start = np.array(ARM.forward(HOME).position)

    def run(self, seconds, *, dt=STEP, pause=STEP):
        for _ in range(round(seconds / pause)):
            self.time += pause
            self.setpoints.requests.age(self.time)
            self.joints.append(self.setpoints.next(dt))
            self.places.append(np.array(ARM.forward(self.joints[-1]).position) - self._start)

    def offset(self, *offset, age=0.0):
        self.setpoints.requests.set_offset(offset, age, self.time)

    @property
    def place(self):
        return pytest.approx(self.places[-1] * 1e3, abs=1e-3)


class Displacements(OffsetSetpoints):
    """Offsets without the kinematics."""

    def _displaced(self, on_path, offset):
        return (*offset, 0.0, 0.0, 0.0)


def random_stream(seed):
    """Send offsets with jumps, gaps, NaN and old stamps; return times and values of set-points."""
    rng = random.Random(seed)
    # As different as may be, but it fades out within two seconds.
    speed = 10 ** rng.uniform(-3, -1)
    acceleration = max(10 ** rng.uniform(-2, 0.3), 4.0 * speed)
    limits = tuple(rng.choice((0.0, speed * rng.uniform(0.01, 1.0))) for _ in range(3))
    limits = limits if any(limits) else (0.0, 0.5 * speed, 0.0)
    made = band(
        rng.uniform(0.1, 1.0) + fade_time(max(limits), speed, acceleration),
        limits=limits,
        speed=speed,
        acceleration=acceleration,
        on_stale=rng.choice(list(StaleOffset)),
    )
    setpoints = Displacements(Still(inf), made, ARM)
    time, motion, end = 0.0, 0.0, len(made.is_open) * made.step
    times, values = [0.0], [(0.0,) * 3]
    while motion < end:
        time += STEP
        if rng.random() < 0.1:
            offset: Any = tuple(
                rng.choice(
                    (rng.gauss(0.0, 0.01), rng.choice((-1, 1)) * limit, 1e9, -inf, nan, 0.0)
                )
                for limit in limits
            )
            if rng.random() < 0.5:
                offset = tuple(rng.uniform(-1.0, 1.0) * limit for limit in limits)
            setpoints.requests.set_offset(
                offset, rng.choice((0.0, 0.0, 0.1, 5.0, -1.0, nan)), time
            )
        elif rng.random() < 0.003:
            time += rng.uniform(0.0, 1.0)  # a gap
        setpoints.requests.age(time)
        step = STEP * rng.choice((1, 1, 1, 2))  # one that catches up stands for two
        values.append(setpoints.next(step)[:3])
        motion += step
        times.append(motion)
    return made, np.array(times), np.array(values)


@pytest.mark.parametrize('first', range(0, STREAMS, AT_A_TIME))
def test_no_stream_of_offsets_exceeds_a_bound(first):
    moved, seeds = 0, range(first, min(first + AT_A_TIME, STREAMS))
    for seed in seeds:
        made, times, values = random_stream(seed)
        steps = np.diff(times)[:, None]
        speeds = np.diff(values, axis=0) / steps
        accelerations = np.diff(speeds, axis=0) / (0.5 * (steps[1:] + steps[:-1]))
        assert (np.abs(values) <= np.array(made.limits)).all(), seed
        assert np.abs(speeds).max() <= made.speed + ROUNDING / STEP, seed
        assert np.abs(accelerations).max() <= made.acceleration + 4 * ROUNDING / STEP**2, seed
        assert not values[-2:].any(), (seed, 'it ends on the path')
        moved += values.any()
    assert moved > 0.9 * len(seeds)


def test_the_tool_moves_by_the_offset_without_turning():
    drive = Drive(4.0)
    drive.run(0.2)
    assert not np.any(drive.places), 'no offset came yet'
    drive.offset(0.0, 0.003, -0.002)
    drive.run(0.3)
    assert drive.place == [0.0, 3.0, -2.0]
    assert ARM.forward(drive.joints[-1]).angle_to(ARM.forward(HOME)) < 1e-8
    drive.offset(0.5, 1.0, 0.001)  # cut at the limits
    drive.run(0.5)
    assert drive.place == [0.0, 5.0, 1.0]
    drive.run(3.0)
    assert drive.setpoints.done
    assert drive.joints[-1] == HOME


@pytest.mark.parametrize(('on_stale', 'there'), [(StaleOffset.HOLD, 3.0), (StaleOffset.FADE, 0.0)])
def test_a_stale_offset_stays_or_fades(on_stale, there):
    drive = Drive(4.0, on_stale=on_stale)
    drive.offset(0.0, 0.003, 0.0)
    drive.run(0.28)
    assert drive.place == [0.0, 3.0, 0.0]
    drive.run(0.8)
    assert drive.place == [0.0, there, 0.0]
    assert 'the path offset was stale once: older than 0.3 s' in drive.setpoints.requests.report
    drive.offset(0.0, 0.001, 0.0)
    drive.run(0.28)
    assert drive.place == [0.0, 1.0, 0.0], 'a newer one counts'


def test_a_stale_offset_does_not_come_back_behind_a_corner():
    is_open = np.arange(0.0, 4.02, 0.01) % 2.0 < 1.0
    drive = Drive(4.0, is_open=is_open)
    drive.offset(0.0, 0.003, 0.0)
    drive.run(0.9)
    assert drive.place == [0.0, 3.0, 0.0]
    drive.run(2.0)
    assert drive.place == [0.0, 0.0, 0.0]


def test_old_offsets_and_nan_are_ignored():
    drive = Drive(4.0)
    drive.run(0.1)
    drive.offset(0.0, 0.002, 0.0, age=0.05)
    for offset, age in (
        ((0.0, 0.001, 0.0), 0.06),  # older than the other
        ((0.0, 0.001, 0.0), 0.31),
        ((0.0, 0.001, 0.0), nan),
        ((0.0, nan, 0.0), 0.0),
        ((0.0, inf, 0.0), 0.0),
    ):
        drive.offset(*offset, age=age)
    drive.run(0.25)
    assert drive.place == [0.0, 2.0, 0.0]
    assert any(
        line.startswith('5 path offsets were ignored') for line in drive.setpoints.requests.report
    )


def test_a_motion_that_is_held_holds_the_offset():
    drive = Drive(4.0)
    drive.offset(0.0, 0.005, 0.0)
    drive.run(0.1)
    drive.run(0.1, dt=0.0)
    held = np.diff(drive.places[-49:], axis=0)
    assert not held.any()
    drive.run(0.1, dt=0.25 * STEP)  # and a slow one moves it slowly
    slow = np.abs(np.diff(drive.places[-49:], axis=0)).max() / STEP
    assert 0.2 * SPEED < slow < 0.26 * SPEED


def test_the_applied_offset_belongs_to_the_place_of_the_arm():
    drive = Drive(4.0)
    drive.offset(0.0, 0.005, 0.0)
    drive.run(0.2)
    for k in (5, 20, 70, 99):
        q = drive.joints[k]
        given = drive.setpoints.applied_offset(RobotState(timestamp=0.0, actual_q=q, target_q=q))
        assert given.shift == pytest.approx(tuple(drive.places[k]), abs=1e-9)
        assert given.offset == pytest.approx((0.0, drive.places[k][1], 0.0), abs=1e-9)


def test_a_moving_target_is_followed_within_a_stated_lag():
    # Its braking distance, v / (2 * 0.8 a), and a step.
    made = band(10.0)
    offset, lags = BoundedOffset(made), []
    for k in range(1500):
        target = 0.01 * k * STEP if k < 250 else 0.005
        offset.step((0.0, target, 0.0))
        lags.append(target - offset.value[1])
    assert max(lags) / 0.01 < 0.01 / (1.6 * ACCELERATION) + 2 * STEP
    assert lags[-1] == 0.0
