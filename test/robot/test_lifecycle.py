# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The table of the connection's states."""

import pytest

from ur_cartesian_driver.robot.lifecycle import (
    ConnectionEvent,
    ConnectionState,
    next_state,
    TRANSITIONS,
)

WAY = [
    (ConnectionEvent.ROBOT_ANSWERED, ConnectionState.CONNECTING),
    (ConnectionEvent.ROBOT_ACCEPTED, ConnectionState.CONNECTED),
    (ConnectionEvent.PROGRAM_CONNECTED, ConnectionState.READY),
    (ConnectionEvent.GOAL_STARTED, ConnectionState.EXECUTING),
    (ConnectionEvent.GOAL_ENDED, ConnectionState.READY),
]


def test_the_way_to_a_goal_and_back():
    state = ConnectionState.DISCONNECTED
    for change, expected in WAY:
        state = next_state(state, change)
        assert state is expected


@pytest.mark.parametrize('state', list(ConnectionState))
@pytest.mark.parametrize('change', list(ConnectionEvent))
def test_every_change_has_an_outcome_in_every_state(state, change):
    assert isinstance(next_state(state, change), ConnectionState)
    assert set(TRANSITIONS) == set(ConnectionState)


@pytest.mark.parametrize('state', list(ConnectionState))
def test_every_state_can_come_about_and_has_a_way_to_a_goal(state):
    def reachable(start):
        seen, ahead = set(), {start}
        while ahead:
            seen |= ahead
            ahead = {next_state(s, change) for s in ahead for change in ConnectionEvent} - seen
        return seen

    assert state in reachable(ConnectionState.DISCONNECTED)
    assert ConnectionState.EXECUTING in reachable(state)


@pytest.mark.parametrize('change', list(ConnectionEvent))
def test_a_stopped_robot_takes_goals_only_when_it_is_free_and_its_program_reads(change):
    assert next_state(ConnectionState.STOPPED, change) in (
        ConnectionState.STOPPED,
        ConnectionState.CONNECTED,
        ConnectionState.DISCONNECTED,
    )


@pytest.mark.parametrize('state', list(ConnectionState))
def test_a_lost_robot_is_always_disconnected(state):
    assert next_state(state, ConnectionEvent.ROBOT_LOST) is ConnectionState.DISCONNECTED


@pytest.mark.parametrize('state', list(ConnectionState))
@pytest.mark.parametrize('change', list(ConnectionEvent))
def test_only_the_robot_program_makes_the_driver_ready(state, change):
    if next_state(state, change) is ConnectionState.READY and state is not ConnectionState.READY:
        assert change in (ConnectionEvent.PROGRAM_CONNECTED, ConnectionEvent.GOAL_ENDED)


@pytest.mark.parametrize('change', list(ConnectionEvent))
def test_a_refused_robot_stays_refused_until_it_is_gone(change):
    state = next_state(ConnectionState.REFUSED, change)
    assert (state is ConnectionState.REFUSED) == (change is not ConnectionEvent.ROBOT_LOST)


@pytest.mark.parametrize('state', [ConnectionState.READY, ConnectionState.EXECUTING])
def test_a_tcp_that_is_owed_keeps_goals_away_until_the_program_is_reviewed(state):
    assert next_state(state, ConnectionEvent.TCP_RESTORE_PENDING) is ConnectionState.CONNECTED
    assert (
        next_state(ConnectionState.CONNECTED, ConnectionEvent.GOAL_ENDED)
        is ConnectionState.CONNECTED
    )
