# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Profiles keep their closed formulas, their limits and the way they have to go."""

from math import sqrt

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.sim.motion.paths.motion_profile import (
    ramp,
    s_curve,
    timed,
    trapezoid,
)

lengths = st.floats(1e-3, 20.0)
rates = st.floats(0.05, 10.0)
starts = st.floats(0.0, 2.0)


def sampled(profile, n=401):
    t = np.linspace(0.0, profile.duration, n)
    return t, np.array([profile.at(x) for x in t])


def assert_runs_smoothly(profile, start_speed):
    t, s = sampled(profile)
    dt = t[1]
    assert s[0] == 0.0
    assert s[-1] == profile.length
    assert (np.diff(s) >= 0.0).all()
    # The last step is clamped to the exact length: no jump may hide in it.
    assert s[-1] - s[-2] <= s[-2] - s[-3] + 1e-9 * profile.length + dt * dt
    assert profile.speed(0.0) == pytest.approx(start_speed)
    speeds = [profile.speed(x) for x in t]
    assert np.sum(speeds) * dt == pytest.approx(s[-1], rel=0.02, abs=dt * max(speeds))


@given(lengths, rates, rates)
def test_trapezoid_from_rest_takes_the_time_of_the_closed_formula(d, a, v):
    expected = d / v + v / a if d > v * v / a else 2.0 * sqrt(d / a)
    assert trapezoid(d, a, v).duration == pytest.approx(expected, rel=1e-12)


@given(lengths, rates, rates, starts)
def test_trapezoid_never_exceeds_speed_and_acceleration(d, a, v, v0):
    profile = trapezoid(d, a, v, v0)
    assert_runs_smoothly(profile, v0)
    braking = max(a, v0 * v0 / (2.0 * d))
    t, s = sampled(profile)
    speed = np.diff(s) / t[1]
    assert speed.max() <= max(v, v0) * (1.0 + 1e-6) + 1e-9
    assert np.abs(np.diff(speed)).max() <= braking * t[1] * (1.0 + 1e-3) + 1e-6


@given(lengths, rates, rates)
def test_trapezoid_brakes_as_hard_as_told_at_the_end_only(d, a, v):
    profile = trapezoid(d, a, v, braking=3.0 * a)
    end = profile.duration
    peak = max(profile.speed(t) for t in np.linspace(0.0, end, 50))
    just = 0.01 * peak / a
    assert profile.speed(end - just) == pytest.approx(3.0 * a * just, rel=1e-6)
    assert peak <= v * (1.0 + 1e-9)
    assert_runs_smoothly(profile, 0.0)


@given(lengths, st.floats(0.01, 100.0), starts)
def test_timed_profile_ends_exactly_in_time(d, duration, v0):
    profile = timed(d, duration, v0)
    assert profile.duration == pytest.approx(duration, rel=1e-12)
    assert_runs_smoothly(profile, v0)


def test_timed_profile_from_rest_has_the_documented_peak():
    profile = timed(2.0, 3.0)
    assert profile.speed(1.5) == pytest.approx(1.5 * 2.0 / 3.0)
    assert profile.speed(0.5) == pytest.approx(0.5 * 4.5 * 2.0 / 9.0)


@given(lengths, st.floats(0.01, 5.0), starts)
def test_ramp_changes_the_speed_evenly_over_the_length(d, v0, v1):
    profile = ramp(d, v0, v1)
    assert profile.duration == pytest.approx(2.0 * d / (v0 + v1))
    assert profile.speed(profile.duration) == pytest.approx(v1, abs=1e-9)
    assert profile.at(profile.duration * (1.0 - 1e-9)) == pytest.approx(d, rel=1e-6)


@given(lengths, rates, rates, st.floats(0.5, 100.0), starts)
def test_s_curve_keeps_acceleration_and_speed(d, a, v, jerk, v0):
    profile = s_curve(d, a, v, jerk, v0)
    assert_runs_smoothly(profile, v0)
    t, s = sampled(profile)
    speed = np.diff(s) / t[1]
    assert speed.max() <= max(v, v0) * (1.0 + 1e-6) + 1e-9


@given(lengths, rates, rates, st.floats(0.5, 100.0))
def test_s_curve_from_rest_keeps_its_jerk(d, a, v, jerk):
    t, s = sampled(s_curve(d, a, v, jerk), 401)
    acceleration = np.diff(s, 2) / t[1] ** 2
    assert np.abs(acceleration).max() <= a * (1.0 + 1e-3) + 1e-4
    assert np.abs(np.diff(acceleration)).max() <= jerk * t[1] * 1.01 + 1e-4 * a + 1e-4


@pytest.mark.parametrize(
    ('d', 'a', 'v', 'jerk', 'expected'),
    [
        # d/v + v/a + a/j with a full ramp; 4 (d / 2j)^(1/3) when neither v nor a is reached.
        (4.0, 2.0, 1.0, 8.0, 4.0 + 0.5 + 0.25),
        (0.001, 100.0, 100.0, 8.0, 4.0 * (0.001 / 16.0) ** (1.0 / 3.0)),
    ],
)
def test_s_curve_from_rest_takes_the_time_of_the_closed_formula(d, a, v, jerk, expected):
    assert s_curve(d, a, v, jerk).duration == pytest.approx(expected, rel=1e-9)


@given(lengths, rates, rates, starts, st.floats(0.0, 1.0))
def test_time_at_inverts_progress(d, a, v, v0, fraction):
    profile = trapezoid(d, a, v, v0)
    assert profile.at(profile.time_at(fraction * d)) == pytest.approx(fraction * d, abs=1e-9)
