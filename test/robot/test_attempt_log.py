# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
import pytest

from ur_cartesian_driver.robot.transport import AttemptLog, MAX_FAILURES


@pytest.fixture
def lines():
    return []


@pytest.fixture
def attempts(lines):
    return AttemptLog(lines.append, lines.append)


def test_a_failure_that_repeats_is_said_once_and_counted_when_something_changes(attempts, lines):
    for _ in range(500):
        attempts.failed('Nobody answers.')
    assert lines == ['Nobody answers.']
    attempts.failed('The model is wrong.')
    assert lines[1:] == ['Nobody answers (500 times)', 'The model is wrong.']
    attempts.succeeded()
    assert len(lines) == 3


def test_failures_in_turn_do_not_make_each_other_new(attempts, lines):
    for _ in range(500):
        attempts.failed('a')
        attempts.failed('b')
    assert lines == ['a', 'b']
    attempts.succeeded()
    assert lines[2:] == ['a (500 times)', 'b (500 times)']


def test_after_a_success_a_failure_is_new(attempts, lines):
    for _ in range(2):
        attempts.failed('a')
        attempts.succeeded()
    assert lines == ['a', 'a']


def test_failures_that_are_never_the_same_take_no_memory(attempts, lines):
    for i in range(10 * MAX_FAILURES):
        attempts.failed(f'port {i}')
    assert len(attempts._counts) <= MAX_FAILURES
    assert len(lines) == 10 * MAX_FAILURES
