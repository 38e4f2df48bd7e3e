# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A TCP that was set for a goal: when it is back, and when to try."""

from itertools import pairwise

import pytest

from ur_cartesian_driver.execution.goal.temporary_tcp import (
    MAX_RETRY_PERIOD,
    MIN_RETRY_PERIOD,
    same_tcp,
    SET_TIMEOUT,
    TemporaryTcp,
)
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.state.rtde_state import RobotState

OWN, NOZZLE, THEIRS = (Pose((0.0, 0.0, z)) for z in (0.1, 0.2, 0.3))
REST, MOVING = (0.0,) * 6, (0.1,) + (0.0,) * 5


def robot(T_flange_tcp, qd=REST):
    return RobotState(timestamp=0.0, actual_q=REST, actual_qd=qd, T_flange_tcp=T_flange_tcp)


@pytest.fixture
def temporary_tcp():
    return TemporaryTcp(OWN, NOZZLE)


@pytest.mark.parametrize('after', [OWN, THEIRS])
def test_it_is_over_when_the_robot_has_another_tcp_whoever_set_it(temporary_tcp, after):
    temporary_tcp.observe(robot(NOZZLE), 0.0)
    assert not temporary_tcp.is_restored
    temporary_tcp.observe(robot(after), 0.1)
    assert temporary_tcp.is_restored
    assert not temporary_tcp.is_restore_due(robot(after), 9.0)


def test_a_tcp_that_was_never_seen_is_waited_for(temporary_tcp):
    temporary_tcp.observe(robot(OWN), 5.0)
    temporary_tcp.observe(robot(OWN), 5.0 + SET_TIMEOUT - 0.01)
    assert not temporary_tcp.is_restored
    temporary_tcp.observe(robot(OWN), 5.0 + SET_TIMEOUT)
    assert temporary_tcp.is_restored


def test_a_tcp_that_comes_later_than_expected_is_not_overlooked(temporary_tcp):
    temporary_tcp.observe(robot(OWN), 0.0)
    temporary_tcp.observe(robot(OWN), SET_TIMEOUT)
    temporary_tcp.observe(robot(NOZZLE), SET_TIMEOUT + 0.1)
    assert not temporary_tcp.is_restored
    assert temporary_tcp.is_restore_due(robot(NOZZLE), SET_TIMEOUT + 0.1)


def test_it_is_put_back_at_rest_only(temporary_tcp):
    assert not temporary_tcp.is_restore_due(robot(NOZZLE, qd=MOVING), 0.0)
    assert temporary_tcp.is_restore_due(robot(NOZZLE), 0.0)


def test_tries_become_rare_until_something_changes(temporary_tcp):
    tries = [t / 8 for t in range(800) if temporary_tcp.is_restore_due(robot(NOZZLE), t / 8)]
    pauses = [b - a for a, b in pairwise(tries)]
    assert pauses[0] == pytest.approx(MIN_RETRY_PERIOD, abs=0.125)
    assert pauses == sorted(pauses)
    assert pauses[-1] == pytest.approx(MAX_RETRY_PERIOD, abs=0.125)
    assert not temporary_tcp.is_restore_due(robot(NOZZLE), 100.0)
    temporary_tcp.retry_now()
    assert temporary_tcp.is_restore_due(robot(NOZZLE), 100.0)


@pytest.mark.parametrize(
    ('other', 'expected'),
    [
        (Pose((0.0, 5e-7, 0.2 - 5e-7)), True),
        (Pose((0.0, 0.0, 0.2), quaternion_from_rotation_vector((5e-7, 5e-7, 5e-7))), True),
        (Pose((0.0, 3e-6, 0.2)), False),
        (Pose((0.0, 0.0, 0.2), quaternion_from_rotation_vector((3e-6, 0.0, 0.0))), False),
    ],
)
def test_a_tcp_rounded_by_the_wire_is_the_same(other, expected):
    assert same_tcp(NOZZLE, other) is expected
