# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The signals of a goal, and the error code with which each of them ends the goal.

Every event is turned into one of these signals, or into none. The table of
:mod:`~.goal_transitions` gives the states in which a signal decides the outcome and its code.
"""

from __future__ import annotations

from enum import Enum
from typing import TypeAlias

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import TrajectoryResult


class GoalSignal(Enum):
    """A signal with its meaning, and its code (None = it never decides an outcome)."""

    def __init__(self, meaning: str, code: ErrorCode | None = None) -> None:
        self.meaning, self.code = meaning, code

    # Results of the robot program.
    SUCCESS = 'the last point is reached', None
    CANCELED = 'the trajectory was cancelled', ErrorCode.EXECUTION_FAILED
    FAILURE = 'the robot program failed', ErrorCode.EXECUTION_FAILED
    CONTACT = 'the tool made contact in a goal that ends at contact', ErrorCode.SUCCESSFUL
    TOUCHED = 'a contact watch outside of the goal stopped the arm', ErrorCode.EXECUTION_FAILED
    # Requests of users.
    CANCEL = 'the client cancels', ErrorCode.CANCELLED
    PREEMPT = 'a newer goal takes over', ErrorCode.PREEMPTED
    # Faults of a motion.
    COLLISION = 'the rest of the path would touch', ErrorCode.COLLISION
    VIOLATION = 'the arm is outside the path tolerance', ErrorCode.PATH_TOLERANCE_VIOLATED
    DEVIATION = 'the robot does something other than planned', ErrorCode.EXECUTION_FAILED
    STANDSTILL = 'the arm stands although nothing holds it', ErrorCode.EXECUTION_FAILED
    STALE = 'the newest state of the robot is too old', ErrorCode.CONNECTION_LOST
    # The arm stops by itself.
    PROTECTIVE_STOP = 'the safety system stops the arm', ErrorCode.PROTECTIVE_STOP
    EMERGENCY_STOP = 'an emergency stop cuts the power', ErrorCode.EMERGENCY_STOP
    PROGRAM_STOPPED = 'the robot program ended', ErrorCode.PROGRAM_STOPPED
    CONNECTION_LOST = 'a connection broke', ErrorCode.CONNECTION_LOST
    # Open goals (keep_open).
    STARVING = 'no more points came in time', None
    APPENDED = 'points came while the arm rests', None
    NO_MORE_POINTS = 'the client closed the goal', None
    ABANDONED = 'neither points nor a close came in time', ErrorCode.CANCELLED
    # Beginning and end.
    ARMED = 'the robot is ready for the motion', None
    NOT_READY = 'the robot is not ready in time', ErrorCode.ROBOT_NOT_READY
    SETTLED = 'the arm rests inside the goal tolerance', ErrorCode.SUCCESSFUL
    NOT_SETTLED = 'the arm does not settle in time', ErrorCode.GOAL_TOLERANCE_VIOLATED
    AT_REST = 'the arm has come to rest after a stop', None
    UNANSWERED = 'no answer to CANCEL, but the arm rests', None
    UNCONFIRMED = 'no answer to CANCEL, and the arm may move', ErrorCode.EXECUTION_FAILED
    RESTORED = 'TCP and outputs are as they should be', None
    TIMEOUT = 'a wait that decides no outcome timed out', None


#: The signal of an event (None = the event has no effect), and a clause for the outcome's text.
Meaning: TypeAlias = tuple[GoalSignal | None, str]
NO_MEANING: Meaning = (None, '')
#: The signal of a fault, and a clause for the outcome's text.
Fault: TypeAlias = tuple[GoalSignal, str]

#: The signal of each result of the robot program, with a clause for the outcome's text.
RESULT_SIGNALS: dict[TrajectoryResult, Fault] = {
    TrajectoryResult.SUCCESS: (GoalSignal.SUCCESS, ''),
    TrajectoryResult.CANCELED: (
        GoalSignal.CANCELED,
        'the robot program cancelled the trajectory by itself',
    ),
    TrajectoryResult.FAILURE: (
        GoalSignal.FAILURE,
        'the robot program reported a failure; its log on the pendant says why',
    ),
    TrajectoryResult.INPUT_MISSING: (
        GoalSignal.FAILURE,
        'an input of input_waits did not come in time',
    ),
    TrajectoryResult.CONTACT: (GoalSignal.CONTACT, 'the tool touched'),
    TrajectoryResult.TOUCHED: (
        GoalSignal.TOUCHED,
        'the tool touched something while detect_tool_contact watched, which stops every motion',
    ),
    TrajectoryResult.NO_CONTACT: (
        GoalSignal.FAILURE,
        'the tool touched nothing, but its press requires contact',
    ),
}
