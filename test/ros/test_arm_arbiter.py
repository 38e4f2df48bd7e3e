# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Who may move the arm, whatever the threads of the goals do first."""

from random import Random
import threading

import pytest

from ur_cartesian_driver.ros.goals.arm_arbiter import ArmArbiter, ArmRequest


class Goal:
    """A goal that makes way as soon as it is asked to."""

    def __init__(self, arbiter, name):
        self.arbiter, self.calls = arbiter, 0
        self.arm_request = ArmRequest(name, self._stop)

    def _stop(self):
        self.calls += 1


class RunningGoal(Goal):
    """One that gives the arm back when it has to."""

    def _stop(self):
        super()._stop()
        self.arbiter.release(self.arm_request)


@pytest.fixture
def arbiter():
    return ArmArbiter()


def enqueued(arbiter, *names):
    goals = [RunningGoal(arbiter, name) for name in names]
    for goal in goals:
        arbiter.enqueue(goal.arm_request)
    return goals


def test_a_newer_claim_makes_all_older_goals_give_way_once(arbiter):
    oldest, older, newest = enqueued(arbiter, 'goal 1', 'goal 2', 'goal 3')
    arbiter.preempt(oldest.arm_request)
    assert arbiter.holder
    release_count = arbiter.release_count
    arbiter.preempt(newest.arm_request)
    assert (oldest.arm_request.preempted_by, older.arm_request.preempted_by) == (
        'goal 3',
        'goal 3',
    )
    assert (oldest.calls, older.calls, newest.calls) == (1, 1, 0)
    assert newest.arm_request.preempted == 'goal 1'
    assert arbiter.release_count == release_count + 1
    arbiter.release(newest.arm_request)
    assert not arbiter.holder


def test_an_older_goal_that_passes_after_a_newer_one_is_too_late(arbiter):
    old, new = enqueued(arbiter, 'goal 1', 'goal 2')
    arbiter.preempt(new.arm_request)
    arbiter.preempt(old.arm_request)
    assert old.arm_request.preempted_by == 'goal 2'
    assert not new.arm_request.preempted_by
    arbiter.release(old.arm_request)
    assert arbiter.holder


def test_a_goal_that_is_not_in_line_yet_is_left_alone(arbiter):
    later = RunningGoal(arbiter, 'goal 1')
    (now,) = enqueued(arbiter, 'goal 2')
    arbiter.preempt(now.arm_request)
    assert not later.arm_request.preempted_by
    arbiter.enqueue(later.arm_request)
    arbiter.preempt(later.arm_request)
    assert now.arm_request.preempted_by == 'goal 1'


def test_a_withdrawn_goal_waits_no_longer_and_does_not_get_the_arm(arbiter):
    stubborn, waiting = Goal(arbiter, 'goal 1'), Goal(arbiter, 'goal 2')
    for goal in (stubborn, waiting):
        arbiter.enqueue(goal.arm_request)
    arbiter.preempt(stubborn.arm_request)
    thread = threading.Thread(target=arbiter.preempt, args=(waiting.arm_request,))
    thread.start()
    arbiter.withdraw(waiting.arm_request)
    thread.join(5.0)
    assert not thread.is_alive()
    arbiter.release(waiting.arm_request)
    assert arbiter.holder
    arbiter.release(stubborn.arm_request)
    assert not arbiter.holder


def test_the_arm_is_seized_only_when_it_is_free(arbiter):
    first, second = enqueued(arbiter, 'goal 1', 'goal 2')
    assert arbiter.acquire(first.arm_request)
    assert not arbiter.acquire(second.arm_request)
    arbiter.release(first.arm_request)
    assert arbiter.acquire(second.arm_request)


def test_what_has_the_arm_for_now_makes_way_for_every_goal(arbiter):
    (early,) = enqueued(arbiter, 'goal 1')
    session = RunningGoal(arbiter, 'a session')
    assert arbiter.acquire(session.arm_request, preemptible=True)
    assert not arbiter.acquire(ArmRequest('another session', lambda: None), preemptible=True)
    arbiter.preempt(early.arm_request)
    assert (session.arm_request.preempted_by, session.calls) == ('goal 1', 1)
    assert early.arm_request.preempted == 'a session'
    assert not arbiter.acquire(session.arm_request, preemptible=True), (
        'as long as the goal has the arm'
    )
    arbiter.release(early.arm_request)
    assert arbiter.acquire(session.arm_request, preemptible=True)


def test_nobody_acquires_the_arm_while_a_goal_waits_for_it(arbiter):
    (goal,) = enqueued(arbiter, 'goal 1')
    late, refused = ArmRequest('a later session', lambda: None), []

    def end():
        arbiter.release(session)
        refused.append((arbiter.acquire(late, preemptible=True), arbiter.holder))

    session = ArmRequest('a session', end)
    assert arbiter.acquire(session, preemptible=True)
    arbiter.preempt(goal.arm_request)
    assert refused == [(False, 'goal 1')]
    arbiter.release(goal.arm_request)
    assert arbiter.acquire(late, preemptible=True)


def test_a_goal_whose_predecessor_fails_to_stop_holds_up_nobody(arbiter):
    def fail():
        raise OSError('does not stop')

    (goal,) = enqueued(arbiter, 'goal 1')
    session = ArmRequest('a session', fail)
    assert arbiter.acquire(session, preemptible=True)
    with pytest.raises(OSError, match='does not stop'):
        arbiter.preempt(goal.arm_request)
    for ended in (goal.arm_request, session):
        arbiter.release(ended)
    assert arbiter.acquire(ArmRequest('another session', lambda: None))


@pytest.mark.parametrize('seed', range(5))
def test_one_goal_at_a_time_has_the_arm_and_the_newest_the_last(arbiter, seed):
    random, goals, moved = Random(seed), [], []
    moving, at_a_time, asked = [], [], {}

    def run(goal):
        arbiter.preempt(goal.arm_request)
        if not goal.arm_request.preempted_by:
            moving.append(goal)
            at_a_time.append(len(moving))
            moved.append(goal)
            if goal is not goals[-1]:
                asked[goal].wait(5.0)
            moving.remove(goal)
        arbiter.release(goal.arm_request)

    for i in range(12):
        event = threading.Event()
        goal = Goal(arbiter, f'goal {i}')
        goal.arm_request.on_preempt = event.set
        asked[goal] = event
        arbiter.enqueue(goal.arm_request)
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
    assert [goal for goal in goals if not goal.arm_request.preempted_by] == [goals[-1]]
    assert moved == sorted(moved, key=goals.index)
