# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The connection to the robot as a table of states and events.

* **DISCONNECTED**: the robot does not answer; the link keeps trying.
* **CONNECTING**: RTDE answers; the robot has not reported its configuration (primary interface).
* **CONNECTED**: the robot reports its state and is the configured model, but accepts no goal: the
  robot program is not connected, has ended or is paused (it would run the goal at some later
  time), the states are too old, or the TCP from before the last goal is not restored yet.
* **READY**: the robot program is connected and accepts goals.
* **EXECUTING**: a goal runs; it may be paused and resumed.
* **STOPPED**: the safety system keeps the arm from moving. Nothing starts by itself from here;
  when the stop is cleared, the state is CONNECTED until a robot program accepts goals.
* **REFUSED**: this driver must not move this robot until the driver's parameters are changed.

Pure: no socket, no clock.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import auto, Enum, IntEnum


class ConnectionState(IntEnum):
    """State of the connection; the numbers of ``DriverStatus.state``."""

    DISCONNECTED = 0
    CONNECTING = 1
    CONNECTED = 2
    READY = 3
    EXECUTING = 4
    STOPPED = 5
    REFUSED = 6


class ConnectionEvent(Enum):
    """Events that change the state of the connection."""

    ROBOT_ANSWERED = auto()
    ROBOT_ACCEPTED = auto()
    ROBOT_REFUSED = auto()
    ROBOT_LOST = auto()
    PROGRAM_CONNECTED = auto()
    PROGRAM_PAUSED = auto()
    PROGRAM_LOST = auto()
    ROBOT_STOPPED = auto()
    STOP_CLEARED = auto()
    GOAL_STARTED = auto()
    GOAL_ENDED = auto()
    TCP_RESTORE_PENDING = auto()


S, E = ConnectionState, ConnectionEvent

#: State -> event -> next state. An event missing in the row of a state leaves the state unchanged.
TRANSITIONS: Mapping[ConnectionState, Mapping[ConnectionEvent, ConnectionState]] = {
    S.DISCONNECTED: {E.ROBOT_ANSWERED: S.CONNECTING},
    S.CONNECTING: {
        E.ROBOT_ACCEPTED: S.CONNECTED,
        E.ROBOT_REFUSED: S.REFUSED,
        E.ROBOT_LOST: S.DISCONNECTED,
    },
    S.CONNECTED: {
        E.PROGRAM_CONNECTED: S.READY,
        E.ROBOT_STOPPED: S.STOPPED,
        E.ROBOT_LOST: S.DISCONNECTED,
    },
    S.READY: {
        E.GOAL_STARTED: S.EXECUTING,
        E.PROGRAM_PAUSED: S.CONNECTED,
        E.PROGRAM_LOST: S.CONNECTED,
        E.TCP_RESTORE_PENDING: S.CONNECTED,
        E.ROBOT_STOPPED: S.STOPPED,
        E.ROBOT_LOST: S.DISCONNECTED,
    },
    S.EXECUTING: {
        E.GOAL_ENDED: S.READY,
        E.PROGRAM_LOST: S.CONNECTED,
        E.TCP_RESTORE_PENDING: S.CONNECTED,
        E.ROBOT_STOPPED: S.STOPPED,
        E.ROBOT_LOST: S.DISCONNECTED,
    },
    S.STOPPED: {
        E.STOP_CLEARED: S.CONNECTED,
        E.ROBOT_LOST: S.DISCONNECTED,
    },
    S.REFUSED: {E.ROBOT_LOST: S.DISCONNECTED},
}


def next_state(state: ConnectionState, event: ConnectionEvent) -> ConnectionState:
    """Return the state after an event."""
    return TRANSITIONS[state].get(event, state)
