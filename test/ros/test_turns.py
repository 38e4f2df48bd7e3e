# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Who may move the arm, whatever the threads of the goals do first."""

from random import Random
import threading

import pytest

from ur_cartesian_driver.ros.turns import Turn, Turns


class Goal:
    """A goal that makes way as soon as it is asked to."""

    def __init__(self, turns, name):
        self.turns, self.calls = turns, 0
        self.turn = Turn(name, self._make_way)

    def _make_way(self):
        self.calls += 1


class RunningGoal(Goal):
    """One that gives the arm back when it has to."""

    def _make_way(self):
        super()._make_way()
        self.turns.leave(self.turn)


@pytest.fixture
def turns():
    return Turns()


def lined_up(turns, *names):
    goals = [RunningGoal(turns, name) for name in names]
    for goal in goals:
        turns.line_up(goal.turn)
    return goals


def test_a_newer_claim_makes_all_older_goals_give_way_once(turns):
    oldest, older, newest = lined_up(turns, 'goal 1', 'goal 2', 'goal 3')
    turns.claim(oldest.turn)
    assert turns.is_taken()
    changes = turns.changes
    turns.claim(newest.turn)
    assert (oldest.turn.successor, older.turn.successor) == ('goal 3', 'goal 3')
    assert (oldest.calls, older.calls, newest.calls) == (1, 1, 0)
    assert newest.turn.predecessor == 'goal 1'
    assert turns.changes == changes + 1
    turns.leave(newest.turn)
    assert not turns.is_taken()


def test_an_older_goal_that_passes_after_a_newer_one_is_too_late(turns):
    old, new = lined_up(turns, 'goal 1', 'goal 2')
    turns.claim(new.turn)
    turns.claim(old.turn)
    assert old.turn.successor == 'goal 2'
    assert not new.turn.successor
    turns.leave(old.turn)
    assert turns.is_taken()


def test_a_goal_that_is_not_in_line_yet_is_left_alone(turns):
    later = RunningGoal(turns, 'goal 1')
    (now,) = lined_up(turns, 'goal 2')
    turns.claim(now.turn)
    assert not later.turn.successor
    turns.line_up(later.turn)
    turns.claim(later.turn)
    assert now.turn.successor == 'goal 1'


def test_a_withdrawn_goal_waits_no_longer_and_does_not_get_the_arm(turns):
    stubborn, waiting = Goal(turns, 'goal 1'), Goal(turns, 'goal 2')
    for goal in (stubborn, waiting):
        turns.line_up(goal.turn)
    turns.claim(stubborn.turn)
    thread = threading.Thread(target=turns.claim, args=(waiting.turn,))
    thread.start()
    turns.withdraw(waiting.turn)
    thread.join(5.0)
    assert not thread.is_alive()
    turns.leave(waiting.turn)
    assert turns.is_taken()
    turns.leave(stubborn.turn)
    assert not turns.is_taken()


def test_the_arm_is_seized_only_when_it_is_free(turns):
    first, second = lined_up(turns, 'goal 1', 'goal 2')
    assert turns.seize(first.turn)
    assert not turns.seize(second.turn)
    turns.leave(first.turn)
    assert turns.seize(second.turn)


def test_what_has_the_arm_for_now_makes_way_for_every_goal(turns):
    (early,) = lined_up(turns, 'goal 1')
    session = RunningGoal(turns, 'a session')
    assert turns.seize_for_now(session.turn)
    assert not turns.seize_for_now(Turn('another session', lambda: None))
    turns.claim(early.turn)
    assert (session.turn.successor, session.calls) == ('goal 1', 1)
    assert early.turn.predecessor == 'a session'
    assert not turns.seize_for_now(session.turn), 'as long as the goal has the arm'
    turns.leave(early.turn)
    assert turns.seize_for_now(session.turn)


@pytest.mark.parametrize('seed', range(5))
def test_one_goal_at_a_time_has_the_arm_and_the_newest_the_last(turns, seed):
    random, goals, moved = Random(seed), [], []
    moving, at_a_time, asked = [], [], {}

    def run(goal):
        turns.claim(goal.turn)
        if not goal.turn.successor:
            moving.append(goal)
            at_a_time.append(len(moving))
            moved.append(goal)
            if goal is not goals[-1]:
                asked[goal].wait(5.0)
            moving.remove(goal)
        turns.leave(goal.turn)

    for i in range(12):
        event = threading.Event()
        goal = Goal(turns, f'goal {i}')
        goal.turn.make_way = event.set
        asked[goal] = event
        turns.line_up(goal.turn)
        goals.append(goal)
    threads = [
        threading.Thread(target=run, args=(goal,)) for goal in random.sample(goals, len(goals))
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(10.0)
        assert not thread.is_alive()
    assert set(at_a_time) == {1}
    assert moved[-1] is goals[-1]
    assert [goal for goal in goals if not goal.turn.successor] == [goals[-1]]
    assert moved == sorted(moved, key=goals.index)
