# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What the owner of a motion holds."""

from threading import Event, Thread
from typing import Any

from ur_cartesian_driver.driver.motion_handle import ActiveMotion
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import Outcome


class PlanWithReport:
    """A plan whose report somebody counts."""

    T_flange_tcp = None
    made = 0

    @property
    def report(self):
        self.made += 1
        return ('point 0: LINEAR -> MOVEL',)


def test_a_motion_can_be_cancelled_before_the_report_of_its_plan_is_made():
    plan: Any = PlanWithReport()
    sent: list[Any] = []
    active = ActiveMotion(7, plan, None, sent.append)
    active.motion.cancel()
    assert [request.motion for request in sent] == [7]
    assert plan.made == 0


def test_who_waits_for_the_outcome_makes_the_report_meanwhile_and_once():
    plan: Any = PlanWithReport()
    active = ActiveMotion(7, plan, None, print)
    outcomes = []
    waiting = Thread(target=lambda: outcomes.append(active.motion.result()))
    waiting.start()
    while not plan.made:
        assert waiting.is_alive()
    active.end(Outcome(code=ErrorCode.SUCCESSFUL, text='done', report=('late by 1 s',)))
    waiting.join()
    assert outcomes[0].report == ('point 0: LINEAR -> MOVEL', 'late by 1 s')
    assert plan.made == 1


def test_the_end_does_not_wait_for_a_report_that_is_being_made():
    begun, may_end = Event(), Event()

    class SlowReport(PlanWithReport):
        @property
        def report(self):
            begun.set()
            assert may_end.wait(10.0)
            return ('point 0: LINEAR -> MOVEL',)

    plan: Any = SlowReport()
    active = ActiveMotion(7, plan, None, print)
    outcomes = []
    waiting = Thread(target=lambda: outcomes.append(active.motion.result()))
    waiting.start()
    assert begun.wait(10.0)
    active.end(Outcome(code=ErrorCode.CANCELLED, text='cancelled'))  # the driver's reader goes on
    active.end(Outcome(code=ErrorCode.CONNECTION_LOST, text='too late'))
    assert not active.motion.done()
    may_end.set()
    waiting.join()
    assert (outcomes[0].text, outcomes[0].report) == ('cancelled', ('point 0: LINEAR -> MOVEL',))
