# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A run whose driver reports from a thread of its own, as fast as it can, or fails."""

import threading
from types import SimpleNamespace
from typing import Any

import pytest

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import Outcome
from ur_cartesian_driver.ros.goals.arm_arbiter import ArmArbiter
from ur_cartesian_driver.ros.goals.goal_run import GoalRun

ENDED = Outcome(code=ErrorCode.SUCCESSFUL, text='')


class EagerDriver:
    """Reports progress before ``start`` returns."""

    def __init__(self):
        self.motion = SimpleNamespace(appender=None, result=lambda: ENDED)

    def plan(self, goal):
        return goal

    def renewed(self, plan):
        return plan

    def start(self, plan, on_progress):
        reader = threading.Thread(target=on_progress, args=(0.0,))
        reader.start()
        reader.join(0.1)
        return self.motion


def make_run(driver, outcomes, publish=lambda _: None, show=lambda _: None):
    """Return a run of a goal that waits for nothing."""
    handle = SimpleNamespace(
        goal_id=SimpleNamespace(uuid=bytes(16)),
        request=SimpleNamespace(
            trajectory=SimpleNamespace(
                header=SimpleNamespace(stamp=SimpleNamespace(sec=0, nanosec=0))
            )
        ),
        publish_feedback=publish,
    )
    action: Any = SimpleNamespace(
        goal=lambda *_: 'goal',
        is_validation=lambda _: False,
        resolved=lambda goal, *_: goal,
        feedback_of=lambda *_: lambda progress: progress,
    )
    context: Any = SimpleNamespace(
        now=lambda: 0,
        driver=driver,
        arbiter=ArmArbiter(),
        show=show,
        settings=SimpleNamespace(node=SimpleNamespace(on_new_goal='preempt')),
    )
    run = GoalRun(handle, action, context, lambda _, outcome: outcomes.append(outcome))
    context.arbiter.enqueue(run.arm_request)
    return run


def test_who_gets_the_first_feedback_finds_the_motion():
    driver, found, outcomes = EagerDriver(), [], []
    published = threading.Event()

    def publish(_):
        found.append(run.motion(timeout=0.0))
        published.set()

    run = make_run(driver, outcomes, publish)
    run.thread.start()
    run.thread.join()
    assert published.wait(5.0)
    assert found == [driver.motion]
    assert outcomes == [ENDED]


@pytest.mark.filterwarnings('ignore::pytest.PytestUnhandledThreadExceptionWarning')
def test_a_goal_that_fails_while_the_arm_moves_ends_when_the_arm_is_at_rest():
    driver = EagerDriver()
    events: list[Any] = []

    def fail(_):
        raise OSError('no memory')

    driver.motion.cancel = lambda: events.append('cancelled')
    driver.motion.result = lambda: events.append('at rest')
    run = make_run(driver, events, show=fail)
    run.thread.start()
    run.thread.join()
    assert events[:-1] == ['cancelled', 'at rest']
    assert events[-1].code is ErrorCode.EXECUTION_FAILED
    assert 'OSError: no memory' in events[-1].text


def test_what_is_shown_is_the_plan_that_was_made_again():
    class RenewingDriver(EagerDriver):
        def renewed(self, plan):
            return f'{plan}, planned again'

    driver, shown, outcomes = RenewingDriver(), [], []
    run = make_run(driver, outcomes, show=shown.append)
    run.thread.start()
    run.thread.join()
    assert shown == ['goal, planned again']
