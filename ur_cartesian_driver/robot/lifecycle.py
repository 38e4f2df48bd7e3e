# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The connection to the robot as a table: where it is, and what brings it further.

* **DISCONNECTED**: the robot does not answer; dialled again by itself.
* **CONNECTING**: RTDE answers; the primary interface and the robot's report of itself are missing.
* **CONNECTED**: the robot reports its state and is the one that was configured; the robot program
  is not connected to us, or has ended, or is paused: then it would run a goal that it is sent now
  at some later time; or the TCP that a goal had set is still to be put back.
* **READY**: the robot program is connected and takes goals.
* **EXECUTING**: a goal runs; it may be paused and resumed.
* **STOPPED**: a person, another client or the safety system stopped the robot. Nothing starts by
  itself from here; the way out is a program that connects again.
* **REFUSED**: this driver must not move this robot, until somebody changes its parameters.

Pure: no socket, no clock.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import auto, Enum, IntEnum
from types import MappingProxyType


class ConnectionState(IntEnum):
    """Where the connection is; the numbers of ``DriverStatus.state``."""

    DISCONNECTED = 0
    CONNECTING = 1
    CONNECTED = 2
    READY = 3
    EXECUTING = 4
    STOPPED = 5
    REFUSED = 6


class ConnectionEvent(Enum):
    """What happened to the connection."""

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

#: A change that a state does not name leaves it as it is.
TRANSITIONS: Mapping[ConnectionState, Mapping[ConnectionEvent, ConnectionState]] = (
    MappingProxyType(
        {
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
    )
)


def next_state(state: ConnectionState, event: ConnectionEvent) -> ConnectionState:
    """Return the state after a change."""
    return TRANSITIONS[state].get(event, state)
