# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Targets that come late, twice, in the wrong order, or no more."""

from dataclasses import replace
from typing import Any

import pytest

from ur_cartesian_driver.execution.live.live_targets import LiveSettings, LiveTargets
from ur_cartesian_driver.execution.live.online_trajectory import OnlineTrajectoryGenerator
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose

ARM = Arm(robot_model('ur5e'))
HOME = (0.0, -1.57, 1.57, -1.57, -1.57, 0.0)
DT = 0.008
SETTINGS = LiveSettings(max_age=0.2, timeout=1.0)


class Session:
    """A session and the clock of its owner."""

    def __init__(self):
        self.generator = OnlineTrajectoryGenerator(ARM, IDENTITY, HOME, SETTINGS.limits)
        self.now = 100.0
        self.live = LiveTargets(self.generator, SETTINGS)
        self.live.age(self.now)
        self.home = self.generator.T_base_tcp

    def beside(self, y):
        x, y0, z = self.home.position
        return Pose((x, y0 + y, z), self.home.quaternion)

    def add(self, y, age=0.0):
        self.live.set_target(self.beside(y), age, self.now)

    def run(self, seconds):
        for _ in range(round(seconds / DT)):
            self.now += DT
            self.live.age(self.now)
            self.live.next(DT)

    @property
    def y(self):
        return self.generator.T_base_tcp.position[1] - self.home.position[1]


@pytest.fixture
def session():
    return Session()


def test_a_stale_target_stops_the_arm_and_a_fresh_one_continues(session):
    session.add(0.3)
    session.run(0.2)
    assert session.generator.linear[1] > 0.15
    session.run(0.3)
    assert session.generator.at_rest
    assert 0.01 < session.y < 0.15
    assert not session.live.done
    for _ in range(20):
        session.add(0.3)
        session.run(0.1)
    assert session.y == pytest.approx(0.3, abs=1e-9)
    assert session.live.pauses == 1
    assert 'stopped once' in ' '.join(session.live.report)


def test_the_age_counts_from_the_stamp(session):
    session.add(0.3, age=0.15)
    session.run(0.064)
    assert session.generator.target is None, 'it was 0.15 s old when it came'
    for age in (0.25, float('nan')):
        session.add(0.1, age=age)
        assert session.generator.target is None
    assert session.live.freshness.dropped == 2


def test_the_newest_stamp_wins_whatever_comes_last(session):
    session.add(0.02, age=0.01)
    session.add(0.3, age=0.1)
    session.add(0.3, age=0.01)
    assert session.generator.target == session.beside(0.02)
    assert (session.live.freshness.accepted, session.live.freshness.dropped) == (1, 2)


def test_an_arm_that_has_arrived_is_not_stopped_by_the_age(session):
    session.add(0.002)
    session.run(0.5)
    assert session.y == pytest.approx(0.002, abs=1e-9)
    assert session.live.pauses == 0


def test_the_session_ends_when_no_target_came_for_long(session):
    session.add(0.01)
    session.run(0.9)
    assert not session.live.done
    session.run(0.2)
    assert session.live.done


@pytest.mark.parametrize(
    ('count', 'said'),
    [(0, '0 targets were followed'), (1, '1 target was followed'), (2, '2 targets were followed')],
)
def test_targets_are_counted_in_the_report(session, count, said):
    for _ in range(count):
        session.add(0.1)
        session.run(0.01)
    assert session.live.report[0] == said


def test_it_does_not_end_before_the_arm_rests(session):
    session.run(0.9)
    session.add(0.3)
    session.live.age(session.now + 2.0)
    session.live.next(DT)
    session.run(0.1)
    for _ in range(100):
        if session.live.done:
            assert session.generator.at_rest
        session.run(DT)
        session.live.age(session.now + 2.0)
    assert session.live.done


def test_each_reason_of_a_stop_is_reported_once(session):
    for i in range(30):
        x, y, z = session.home.position
        session.live.set_target(
            Pose((x - 0.45 - 1e-3 * (i % 3), y, z), session.home.quaternion), 0.0, session.now
        )
        session.run(0.1)
    assert session.live.generator.blocked
    why = [line for line in session.live.report if line.startswith('the arm was stopped: ')]
    assert len(why) in (1, 2), 'reach, singularity'


def test_no_time_gives_no_step(session):
    session.add(0.3)
    assert session.live.next(0.0) == HOME


@pytest.mark.parametrize('field', ['max_age', 'timeout'])
def test_times_are_positive(field):
    zero: dict[str, Any] = {field: 0.0}
    with pytest.raises(ValueError, match=field):
        replace(SETTINGS, **zero)


def test_a_stop_soon_after_another_is_warned_of_if_it_lasts(session):
    def texts(after):
        session.now += after
        return [warning.text.rpartition(': ')[2] for warning in session.live.age(session.now)]

    session.generator.blocked = 'a limit'
    assert texts(0.0) == ['a limit']
    session.generator.blocked = ''
    assert texts(0.1) == []
    session.generator.blocked = 'another limit'
    assert texts(0.1) == []
    assert texts(2.0) == ['another limit']
    for reason in ('', 'a third limit', ''):
        session.generator.blocked = reason
        assert texts(0.1) == []
    assert texts(2.0) == []
