# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The signal of a feed override: which value counts, when it is lost, and what the report says."""

from math import inf, nan

import pytest

from ur_cartesian_driver.execution.goal.goal_commands import LogWarning, SetFeedTarget
from ur_cartesian_driver.execution.offsets.feed_input import FeedInput, parse_feed_input
from ur_cartesian_driver.execution.offsets.feed_requests import FeedRequests
from ur_cartesian_driver.execution.points.program_feed import ProgramFeed
from ur_cartesian_driver.motion.goal.goal import FeedOverride
from ur_cartesian_driver.motion.state.rtde_state import RobotState

BOUNDS = FeedOverride(minimum=0.3, maximum=0.9, rate=0.5, timeout=0.2)


def test_a_goal_begins_at_its_lower_bound_and_says_nothing_about_it():
    feed = FeedRequests(BOUNDS)
    assert feed.target == 0.3
    assert feed.age(10.0) == []


@pytest.mark.parametrize(
    ('fraction', 'target'), [(0.5, 0.5), (0.0, 0.3), (0.1, 0.3), (0.95, 0.9), (1.0, 0.9)]
)
def test_a_valid_value_is_cut_to_the_bounds(fraction, target):
    feed = FeedRequests(BOUNDS)
    feed.set_feed(fraction, 0.0, 1.0)
    assert feed.target == target


@pytest.mark.parametrize('fraction', [nan, inf, -inf, -0.01, 1.01])
def test_an_invalid_value_ends_the_signal_until_a_valid_one_comes(fraction):
    feed = FeedRequests(BOUNDS)
    feed.set_feed(0.8, 0.0, 1.0)
    feed.set_feed(fraction, 0.0, 1.01)
    assert feed.target == 0.3
    (warning,) = feed.age(1.02)
    assert warning == LogWarning(
        text='the signal of feed_override is invalid or older than 0.2 s: the motion slows down '
        'to 30%'
    )
    assert feed.age(1.03) == []
    feed.set_feed(0.7, 0.0, 1.04)
    assert feed.target == 0.7
    assert any('1 value was not within 0 to 1' in line for line in feed.report)


def test_a_signal_that_ends_is_lost_after_its_timeout():
    feed = FeedRequests(BOUNDS)
    feed.set_feed(0.8, 0.05, 1.0)
    assert feed.age(1.14) == []
    assert feed.target == 0.8
    assert len(feed.age(1.16)) == 1
    assert feed.target == 0.3
    assert feed.report[-1] == (
        'feed_override: the signal was lost once: invalid, or older than 0.2 s'
    )


def losses(feed, begin, end):
    """Return the times [s] of the warnings, by asking every 10 ms."""
    times = [begin + 0.01 * i for i in range(round((end - begin) / 0.01))]
    return [now for now in times if feed.age(now)]


def test_a_signal_that_is_invalid_from_the_beginning_is_said_once():
    feed = ProgramFeed(BOUNDS, FeedInput(0, 0.004, 0.02))
    broken = RobotState(timestamp=0.0, actual_q=(0.0,) * 6, standard_analog_input0=0.0)
    said = 0
    for i in range(500):
        feed.observe_feed(broken, 0.01 * i)
        said += any(isinstance(command, LogWarning) for command in feed.age(0.01 * i))
    assert said == 1
    assert not any('was lost' in line for line in feed.report)  # it was never there


def test_a_second_loss_is_said_when_a_warning_is_due_again():
    feed = FeedRequests(BOUNDS)
    feed.set_feed(0.8, 0.0, 1.0)
    assert losses(feed, 1.0, 1.5) == [pytest.approx(1.21, abs=0.02)]
    feed.set_feed(0.8, 0.0, 1.5)
    assert losses(feed, 1.5, 8.0) == [pytest.approx(3.21, abs=0.02)]


def test_a_second_loss_that_is_over_is_not_said():
    feed = FeedRequests(BOUNDS)
    feed.set_feed(0.8, 0.0, 1.0)
    assert len(losses(feed, 1.0, 1.5)) == 1
    feed.set_feed(0.8, 0.0, 1.5)
    assert losses(feed, 1.5, 2.0) == []
    for i in range(200):
        feed.set_feed(0.8, 0.0, 2.0 + 0.01 * i)
        assert feed.age(2.0 + 0.01 * i) == []


@pytest.mark.parametrize('age', [0.3, nan])
def test_a_value_that_is_old_or_out_of_order_is_ignored(age):
    feed = FeedRequests(BOUNDS)
    feed.set_feed(0.8, 0.0, 1.0)
    feed.set_feed(0.4, age, 1.1)
    assert feed.target == 0.8
    assert any('1 value was ignored' in line for line in feed.report)


def test_the_program_is_told_each_change_once_and_before_the_start():
    feed = ProgramFeed(BOUNDS)
    assert feed.prepare() == [SetFeedTarget(fraction=0.3, rate=0.5)]
    assert feed.age(1.0) == []
    feed.set_feed(0.6, 0.0, 1.0)
    assert feed.age(1.0) == [SetFeedTarget(fraction=0.6, rate=0.5)]
    assert feed.age(1.1) == []
    assert feed.age(1.3)[1:] == [SetFeedTarget(fraction=0.3, rate=0.5)]


def test_the_delay_of_a_goal_begins_with_it():
    feed = ProgramFeed(BOUNDS)

    def state(fraction, delay):
        return feed.observe_feed(
            RobotState(
                timestamp=0.0, actual_q=(0.0,) * 6, feed_override=fraction, feed_delay=delay
            ),
            1.0,
        )

    assert state(0.3, 7.0).delay == 0.0  # of earlier goals
    assert state(0.5, 7.5) == (0.5, 0.5, False)
    assert feed.report[0] == (
        'feed_override: 0 values were followed; the feed went down to 30%, and the goal took '
        '0.50 s more'
    )


@pytest.mark.parametrize(
    ('level', 'fraction'),
    [(2.0, 0.0), (5.0, 0.5), (8.0, 1.0), (1.9, 0.0), (8.1, 1.0), (1.7, None), (8.3, None)],
)
@pytest.mark.parametrize('falls', [False, True])
def test_the_level_of_an_input_gives_the_feed_and_one_beyond_its_ends_is_invalid(
    level, fraction, falls
):
    feed = ProgramFeed(BOUNDS, FeedInput(1, *((8.0, 2.0) if falls else (2.0, 8.0))))
    state = RobotState(timestamp=0.0, actual_q=(0.0,) * 6, standard_analog_input1=level)
    valid = feed.observe_feed(state, 1.0).is_valid
    assert valid == (fraction is not None)
    if valid:
        wanted = 1.0 - fraction if falls else fraction
        assert feed.target == pytest.approx(min(max(wanted, 0.3), 0.9))
    else:
        assert feed.target == 0.3


def test_an_input_that_the_robot_does_not_report_is_an_invalid_signal():
    feed = ProgramFeed(BOUNDS, FeedInput(0, 0.004, 0.02))
    assert not feed.observe_feed(RobotState(timestamp=0.0, actual_q=(0.0,) * 6), 1.0).is_valid


@pytest.mark.parametrize(
    'text',
    [
        '0',
        'standard_analog 0 2.0',
        'tool_analog 0 2 8',
        'standard_analog 2 2 8',
        'standard_analog 0 5 5',
        'standard_analog 0 nan 5',
        'standard_analog 0 a 5',
    ],
)
def test_a_text_that_names_no_input_is_refused(text):
    with pytest.raises(ValueError, match=f"^feed_override_input is '{text}'; write"):
        parse_feed_input(text)


def test_an_input_is_read_from_its_text():
    assert parse_feed_input('standard_analog 1 0.02 0.004') == FeedInput(1, 0.02, 0.004)
    assert parse_feed_input('') is None
