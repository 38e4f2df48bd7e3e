# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Every error a goal can end with has its one code, and keeps its sentence on its way."""

import copy
import pickle

from checkout import CHECKOUT, needs_checkout
import pytest

from ur_cartesian_driver.motion.errors import (
    AlreadySent,
    CollisionPredicted,
    DriverError,
    ErrorCode,
    ERRORS,
    ExecutionEnded,
    GoalRefused,
    InvalidGoal,
    LocalProtocolError,
    ProtocolError,
    RemoteProtocolError,
    TooFast,
)
from ur_cartesian_driver.motion.events import Outcome

SENTENCE = 'points[2]: the wrist centre lies 1.2 m from the shoulder, and the reach is 0.85 m.'


def descendants(cls):
    for child in cls.__subclasses__():
        if child.__module__ == DriverError.__module__:  # protocols may refine them
            yield child
            yield from descendants(child)


ENDS = [*descendants(GoalRefused), *descendants(ExecutionEnded)]
ALL = [DriverError, *descendants(DriverError)]


def make(cls):
    if cls is AlreadySent:
        return cls(2, 1.5)
    return cls('points[2]', 'is wrong') if issubclass(cls, InvalidGoal) else cls(SENTENCE)


@pytest.mark.parametrize('cls', ENDS, ids=lambda cls: cls.__name__)
def test_every_way_in_which_a_goal_ends_has_a_code(cls):
    assert isinstance(make(cls).code, ErrorCode)
    assert issubclass(cls, ERRORS[cls.code])


def test_the_table_holds_nothing_else():
    kinds_of_invalid_goal = set(descendants(InvalidGoal))
    assert set(ERRORS.values()) == set(ENDS) - kinds_of_invalid_goal


def test_every_code_but_success_belongs_to_an_error():
    assert set(ERRORS) == set(ErrorCode) - {ErrorCode.SUCCESSFUL}


def test_codes_are_distinct_but_for_the_kinds_of_invalid_goal():
    assert [cls.code for cls in ERRORS.values()] == list(ERRORS)
    assert {cls.code for cls in descendants(InvalidGoal)} == {ErrorCode.INVALID_GOAL}


def test_the_numbers_of_the_original_action_are_kept():
    assert [ErrorCode(n).name for n in range(0, -7, -1)] == [
        'SUCCESSFUL',
        'INVALID_GOAL',
        'INVALID_JOINTS',
        'OLD_HEADER_TIMESTAMP',
        'PATH_TOLERANCE_VIOLATED',
        'GOAL_TOLERANCE_VIOLATED',
        'INVALID_POSTURE',
    ]


@pytest.mark.parametrize('cls', [ProtocolError, LocalProtocolError, RemoteProtocolError])
def test_a_broken_protocol_counts_as_a_lost_connection(cls):
    assert cls('three bytes too many: 00 01 02').code is ErrorCode.CONNECTION_LOST


@pytest.mark.parametrize('cls', ALL, ids=lambda cls: cls.__name__)
@pytest.mark.parametrize('travel', [lambda e: pickle.loads(pickle.dumps(e)), copy.copy])
def test_an_error_keeps_class_and_sentence_on_its_way(cls, travel):
    error = make(cls)
    arrived = travel(error)
    assert type(arrived) is cls
    assert str(arrived) == str(error) != ''


def test_a_predicted_collision_keeps_its_place_on_its_way_and_in_other_words():
    error = CollisionPredicted(SENTENCE)
    assert (error.q, error.bodies) == (None, ())
    error.q, error.bodies, error.cell = (0.1,) * 6, ('table', 'forearm_link'), 'as it is then'
    for arrived in (pickle.loads(pickle.dumps(error)), error.reworded('In other words.')):
        assert vars(arrived) == vars(error)
    assert str(error.reworded('In other words.')) == 'In other words.'


def test_an_invalid_goal_says_where_what_and_what_to_do():
    error = InvalidGoal('points[2].pose', 'is 3.1 m away, and the bound is 0.5 m', 'go nearer')
    assert str(error) == 'points[2].pose is 3.1 m away, and the bound is 0.5 m; go nearer.'
    assert error.field == 'points[2].pose'


def test_without_a_remedy_the_sentence_ends_with_the_problem():
    assert str(TooFast('segments[1]', 'needs 2 m/s')) == 'segments[1] needs 2 m/s.'


def test_every_error_is_caught_as_a_driver_error():
    assert all(issubclass(cls, DriverError) for cls in ENDS)
    assert not issubclass(GoalRefused, ExecutionEnded)


@pytest.mark.parametrize('code', ERRORS, ids=lambda code: code.name)
@pytest.mark.parametrize('travel', [lambda e: e, lambda e: pickle.loads(pickle.dumps(e))])
def test_an_outcome_raises_the_error_of_its_code_with_text_and_report(code, travel):
    outcome = Outcome(code=code, text=SENTENCE, report=('segment 0: LINEAR', 'why: a stop'))
    with pytest.raises(ERRORS[code]) as raised:
        outcome.raise_for_error()
    error = travel(raised.value)
    assert type(error) is ERRORS[code]
    assert (error.code, str(error), error.report) == (code, SENTENCE, outcome.report)


def test_an_outcome_that_succeeded_is_returned():
    outcome = Outcome(code=ErrorCode.SUCCESSFUL, text='All 2 points were executed in 4.000 s.')
    assert outcome.raise_for_error() is outcome


def test_an_error_that_was_not_raised_from_an_outcome_has_no_report():
    assert GoalRefused(SENTENCE).report == ()
    assert make(InvalidGoal).field == 'points[2]'


@needs_checkout
def test_the_page_of_errors_has_the_table():
    page = (CHECKOUT / 'doc' / 'errors.md').read_text(encoding='utf-8')
    start = page.index('| code | name |')
    rows = page[start : page.index('\n\n', start)].splitlines()[2:]
    assert rows == [
        f'| {int(code)} | {code.name} | `{cls.__name__}` | '
        f'{"before" if issubclass(cls, GoalRefused) else "during"} | '
        f'{(cls.__doc__ or "").replace("``", "`")} |'
        for code, cls in ERRORS.items()
    ]
