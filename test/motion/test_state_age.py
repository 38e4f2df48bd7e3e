# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The age of the robot's states, from two clocks that nobody has compared."""

from random import Random

import pytest

from ur_cartesian_driver.motion.state.state_age import (
    DRIFT,
    explain_age,
    RECOVERY_TIME,
    StaleStates,
    StateAge,
)

PERIOD = 0.002


def ages(delays, *, delay=0.0, start=5000.0, clock=1.0):
    """
    Return the ages of packets that come one period apart.

    :param delays: the time that each takes to arrive [s].
    :param delay: half the quickest round trip [s].
    :param start: time of the controller's clock at the first packet, and its speed.
    """
    age = StateAge(delay)
    return [
        age.update(1e6 + i * PERIOD + late, start + i * PERIOD * clock)
        for i, late in enumerate(delays)
    ]


def growing(rate, seconds):
    """Return the delays of a queue that grows."""
    return [rate * i * PERIOD for i in range(round(seconds / PERIOD))]


def test_packets_that_take_equally_long_are_as_old_as_the_first():
    assert ages([0.3] * 100, delay=0.004) == pytest.approx([0.004] * 100, abs=DRIFT * 0.2)


def test_a_packet_that_is_held_back_is_that_much_older():
    late = [0.001] * 50 + [0.05, 0.048, 0.046] + [0.001] * 50
    found = ages(late)
    assert found[50:53] == pytest.approx([0.049, 0.047, 0.045], abs=1e-3)
    assert max(found[:50] + found[53:]) < 1e-3


def test_a_faster_packet_shows_that_the_ones_before_were_old():
    found = ages([0.1] * 10 + [0.02] * 10 + [0.1])
    assert found[10:20] == pytest.approx([0.0] * 10, abs=1e-6)
    assert found[20] == pytest.approx(0.08, abs=1e-4)


@pytest.mark.parametrize('clock', [1.0 - 6e-4, 1.0 + 6e-4])
def test_clocks_that_drift_apart_make_no_age(clock):
    jitter = Random(1)
    late = [jitter.uniform(0.0, 0.003) for _ in range(60 * 500)]
    assert max(ages(late, clock=clock)) < 0.006


@pytest.mark.parametrize('rate', [0.003, 0.02, 0.5])
def test_a_queue_that_grows_slowly_is_not_taken_for_a_new_delay(rate):
    found = ages(growing(rate, 0.6 / rate))
    assert found[-1] == pytest.approx(0.6, rel=DRIFT / rate + 0.01)
    assert found == sorted(found)


def test_a_queue_that_stays_is_not_accepted():
    found = ages([0.0] * 100 + [0.5] * 10_000)
    assert found[-1] > 0.5 - 20.0 * DRIFT - 1e-3


def test_a_clock_that_is_set_back_begins_anew():
    age = StateAge(0.002)
    for i in range(100):
        age.update(i * PERIOD, 80.0 + i * PERIOD)
    assert age.update(0.3, 1.0) == pytest.approx(0.002)
    assert age.update(0.4, 1.05) == pytest.approx(0.052, abs=1e-3)


def test_a_controller_that_stood_still_seems_late_by_that_time():
    age = StateAge(0.0)
    age.update(10.0, 5.0)
    assert age.update(10.4, 5.002) == pytest.approx(0.398, abs=1e-3)


def test_a_pause_of_both_clocks_and_one_of_ours_alone_make_nothing_old():
    """Virtual machines may be paused with their clocks."""
    age = StateAge(0.0)
    age.update(10.0, 5.0)
    assert age.update(10.002, 5.002) == pytest.approx(0.0, abs=1e-6)
    assert age.update(10.004, 35.0) == 0.0  # ours stood still for 30 s
    assert age.update(10.006, 35.002) == pytest.approx(0.0, abs=1e-5)


def test_stale_states_become_fresh_after_a_while_below_half_the_bound():
    stale = StaleStates(0.2)
    assert not stale.update(0.2, 0.0)
    assert stale.update(0.21, 0.1)
    assert stale.age == 0.21
    assert not stale.update(0.3, 0.2)
    assert stale.update(0.5, 0.3)  # twice as old: say so
    assert not stale.update(0.11, 0.4)
    assert not stale.update(0.09, 0.39 + RECOVERY_TIME)
    assert stale.update(0.09, 0.41 + RECOVERY_TIME)
    assert stale.age == 0.0


def test_no_bound_means_any_age():
    assert not StaleStates(0.0).update(1e6, 0.0)


def test_the_sentence_has_age_bound_and_remedy():
    text = explain_age(0.2125, 0.2)
    assert '0.212 s old' in text
    assert 'max_state_age is 0.2 s' in text
    assert 'rtde_frequency' in text
