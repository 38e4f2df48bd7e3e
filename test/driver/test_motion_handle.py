# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The handle of a motion, which its owner holds."""

import logging
from math import nan
from threading import Event, Thread
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from ur_cartesian_driver.driver.ipc.channel import SetFeedOverride, SetPathOffset
from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
from ur_cartesian_driver.driver.motion_handle import ActiveMotion
from ur_cartesian_driver.driver.reported_robot import ReportedRobot
from ur_cartesian_driver.motion.errors import ErrorCode, InvalidGoal
from ur_cartesian_driver.motion.events import Outcome
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.robot.connection_status import ConnectionStatus


class PlanWithReport:
    """A plan whose report somebody counts."""

    T_flange_tcp = None
    offset_band: Any = None
    made = 0

    def short_report(self):
        self.made += 1
        return ('point 0: LINEAR -> MOVEL',)


class PlanWithBand(PlanWithReport):
    offset_band = SimpleNamespace(timeout=0.5)


def test_an_offset_is_sent_in_plain_numbers():
    sent: list[Any] = []
    plan: Any = PlanWithBand()
    motion = ActiveMotion(7, plan, None, sent.append).motion
    motion.set_path_offset(across=cast('float', np.float32(0.5)), age=0.1)
    assert sent == [SetPathOffset(motion=7, offset=(0.0, 0.5, 0.0), age=0.1)]
    assert type(sent[0].offset[1]) is float


@pytest.mark.parametrize(
    ('plan', 'values', 'text'),
    [
        (PlanWithReport, {}, 'path_offset is not set in the running goal; set its limits'),
        (PlanWithBand, {'across': nan}, 'across is nan; it must be finite'),
        (PlanWithBand, {'normal': 'near'}, "normal is 'near'"),
        (PlanWithBand, {'age': -1}, 'age is -1.0; it must be finite, and at least 0'),
        (PlanWithBand, {'age': 0.6}, 'age is 0.600 s, path_offset.timeout is 0.5 s'),
    ],
)
def test_an_offset_that_cannot_be_followed_is_refused(plan, values, text):
    motion = ActiveMotion(7, plan(), None, lambda request: pytest.fail('was sent')).motion
    with pytest.raises(InvalidGoal, match=text):
        motion.set_path_offset(**values)


def test_a_feed_is_sent_even_if_it_is_an_invalid_signal():
    sent: list[Any] = []
    motion = ActiveMotion(7, cast('Any', PlanWithReport()), None, sent.append).motion
    motion.feed_problem = None
    motion.set_feed_override(cast('float', np.float32(0.5)), age=0.1)
    motion.set_feed_override(2)
    assert sent == [
        SetFeedOverride(motion=7, fraction=0.5, age=0.1),
        SetFeedOverride(motion=7, fraction=2.0, age=0.0),
    ]
    assert type(sent[0].fraction) is float
    with pytest.raises(InvalidGoal, match="fraction is 'fast'"):
        motion.set_feed_override(cast('float', 'fast'))


def test_a_goal_without_feed_override_takes_none():
    motion = ActiveMotion(7, cast('Any', PlanWithReport()), None, print).motion
    with pytest.raises(InvalidGoal, match='feed_override is not set in the running goal; set its'):
        motion.set_feed_override(0.5)


def test_a_motion_can_be_cancelled_before_the_report_of_its_plan_is_made():
    plan: Any = PlanWithReport()
    sent: list[Any] = []
    active = ActiveMotion(7, plan, None, sent.append)
    active.motion.cancel()
    assert [request.motion for request in sent] == [7]
    assert plan.made == 0


def test_an_error_of_a_callback_goes_to_the_log_of_its_driver(caplog):
    log = logging.getLogger('left_arm')

    def fail(progress):
        raise KeyError('nothing here')

    active = ActiveMotion(7, cast('Any', PlanWithReport()), fail, print, log)
    active.report(cast('Any', None))
    robot = ReportedRobot(DriverConfig(robot_ip='127.0.0.1'), PlanningOptions(), log)
    robot.status_listeners.append(fail)
    robot.set_status(ConnectionStatus())
    assert [record.name for record in caplog.records] == ['left_arm', 'left_arm']
    assert 'a callback of the driver failed with KeyError' in caplog.text


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
        def short_report(self):
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
