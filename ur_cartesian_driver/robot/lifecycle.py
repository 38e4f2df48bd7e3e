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


class Change(Enum):
    """What happened to the connection."""

    ROBOT_ANSWERED = auto()
    ROBOT_ACCEPTED = auto()
    ROBOT_REFUSED = auto()
    ROBOT_LOST = auto()
    PROGRAM_CONNECTED = auto()
    PROGRAM_PAUSED = auto()
    PROGRAM_LOST = auto()
    ROBOT_STOPPED = auto()
    ROBOT_FREE = auto()
    GOAL_STARTED = auto()
    GOAL_ENDED = auto()
    TCP_OWED = auto()


S, C = ConnectionState, Change

#: A change that a state does not name leaves it as it is.
TRANSITIONS: Mapping[ConnectionState, Mapping[Change, ConnectionState]] = MappingProxyType(
    {
        S.DISCONNECTED: {C.ROBOT_ANSWERED: S.CONNECTING},
        S.CONNECTING: {
            C.ROBOT_ACCEPTED: S.CONNECTED,
            C.ROBOT_REFUSED: S.REFUSED,
            C.ROBOT_LOST: S.DISCONNECTED,
        },
        S.CONNECTED: {
            C.PROGRAM_CONNECTED: S.READY,
            C.ROBOT_STOPPED: S.STOPPED,
            C.ROBOT_LOST: S.DISCONNECTED,
        },
        S.READY: {
            C.GOAL_STARTED: S.EXECUTING,
            C.PROGRAM_PAUSED: S.CONNECTED,
            C.PROGRAM_LOST: S.CONNECTED,
            C.TCP_OWED: S.CONNECTED,
            C.ROBOT_STOPPED: S.STOPPED,
            C.ROBOT_LOST: S.DISCONNECTED,
        },
        S.EXECUTING: {
            C.GOAL_ENDED: S.READY,
            C.PROGRAM_LOST: S.CONNECTED,
            C.TCP_OWED: S.CONNECTED,
            C.ROBOT_STOPPED: S.STOPPED,
            C.ROBOT_LOST: S.DISCONNECTED,
        },
        S.STOPPED: {
            C.ROBOT_FREE: S.CONNECTED,
            C.ROBOT_LOST: S.DISCONNECTED,
        },
        S.REFUSED: {C.ROBOT_LOST: S.DISCONNECTED},
    }
)


def after(state: ConnectionState, change: Change) -> ConnectionState:
    """Return the state after a change."""
    return TRANSITIONS[state].get(change, state)
