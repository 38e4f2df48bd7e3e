# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The states of a goal while the robot program runs it, and the table of transitions.

Events are first turned into signals (:class:`GoalSignal`). :data:`TRANSITIONS` gives, for each
state and signal, the next state and, where it is decided there, the code of the outcome.

* **ARMING**: every goal begins here. Where it moves another frame than the robot's TCP, the
  message that sets the TCP there is on the wire: nothing moves before the robot reports it, and
  itself where the plan begins. Set-points need the robot's inputs and the answer of its program.
  Where nothing has to be prepared, ARMED follows at once.
* **MOVING**: the robot program runs points. The result SUCCESS leads to SETTLING. Whatever stops
  the arm by itself (safety, connection) ends the goal at once, because the robot program would
  read nothing that we send; our own reasons to stop (cancel, preemption, tolerance) lead to
  CANCELLING.
* **RUNNING_OUT**: no more points were appended in time to an open goal (keep_open). The ending,
  which brings the arm to rest at the last known point or behind it, is on the wire, with the
  number of records. Points that come now wait for the SUCCESS of the program: they continue from
  rest.
* **AWAITING_POINTS**: the arm is at rest there, and the program has no trajectory. APPENDED starts
  the next one; NO_MORE_POINTS, sent when the client closes the goal, leads to SETTLING. Without
  either the goal ends after ``keep_open_timeout`` (TIMEOUT), as CANCELLED: it was abandoned, and
  nothing failed.
* **SETTLING**: the program has reported the last point as reached. The arm has to be at rest
  inside the goal tolerance, within the goal's time tolerance. Where the controller's target is
  elsewhere, the program left something out (DEVIATION).
* A goal that ends where the tool touches (CONTACT) has succeeded without SETTLING: the program has
  moved the arm to where that was.
* **CANCELLING**: CANCEL is on the wire. The program brakes, discards the points that it has not
  run and answers CANCELED. A SUCCESS in this state means that the last point was reached before
  the program read the CANCEL; it is no answer, CANCELED still follows.
* **COMING_TO_REST**: the program has answered; the arm is coming to rest.
* **RESTORING**: the outcome is decided, and nothing moves; the original TCP is on the wire. The
  outcome waits until the robot reports that TCP, so the next goal finds it. Goals that changed no
  TCP pass through at once.
* **PROGRAM_LOST**: the robot program is gone. Often it ends because of the safety system, the
  power or the whole controller, and any of these may be reported first: so for a moment a deeper
  reason still replaces this one.
* **ENDED**: the outcome is out. Later events are ignored.

Nearly every state has a deadline (:mod:`~.timeouts`). Where no answer comes in CANCELLING or
COMING_TO_REST, the robot program is ended. A paused program reads nothing: where the arm is at
rest, the goal ends with the code that was decided (UNANSWERED); where it still moves, that is a
failure (TIMEOUT). A TCP that is not set in time ends the goal before it begins; one that is not
restored in time, or not at all because the robot stopped, is left to whoever carries out the
commands (``temporary_tcp`` of the machine). MOVING and RUNNING_OUT have no deadline, because a
speed slider at zero is no error; but where the arm stands for ``STANDSTILL_TIMEOUT`` and nothing
holds it, a command or a result was lost (STANDSTILL). RTDE packets that are too old, or stop, show
nothing of the motion any more: the goal is cancelled (STALE), and ends as one whose connection was
lost.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import auto, Enum
from typing import TypeAlias

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.motion.state.robot_state import (
    RobotMode,
    RobotState,
    RuntimeState,
    SafetyStatus,
)


class GoalState(Enum):
    """State of a goal."""

    ARMING = auto()
    MOVING = auto()
    RUNNING_OUT = auto()
    AWAITING_POINTS = auto()
    SETTLING = auto()
    CANCELLING = auto()
    COMING_TO_REST = auto()
    RESTORING = auto()
    PROGRAM_LOST = auto()
    ENDED = auto()


class GoalSignal(Enum):
    """What an event means to a goal."""

    SUCCESS = auto()
    CANCELED = auto()
    FAILURE = auto()
    CONTACT = auto()
    CANCEL = auto()
    PREEMPT = auto()
    VIOLATION = auto()
    DEVIATION = auto()
    STANDSTILL = auto()
    STALE = auto()
    PROTECTIVE_STOP = auto()
    EMERGENCY_STOP = auto()
    PROGRAM_STOPPED = auto()
    CONNECTION_LOST = auto()
    STARVING = auto()
    APPENDED = auto()
    NO_MORE_POINTS = auto()
    ARMED = auto()
    SETTLED = auto()
    RESTORED = auto()
    AT_REST = auto()
    TIMEOUT = auto()
    UNANSWERED = auto()


#: What an event means, with a clause for the outcome's text; None = nothing.
Meaning: TypeAlias = tuple[GoalSignal | None, str]
NO_MEANING: Meaning = (None, '')
#: What is wrong with a motion, with a clause for the outcome's text.
Fault: TypeAlias = tuple[GoalSignal, str]

#: In which a goal begins; where nothing has to be armed, ARMED follows at once.
INITIAL_STATE = GoalState.ARMING
#: In these the robot program runs points of the goal.
RUNNING_STATES = frozenset({GoalState.MOVING, GoalState.RUNNING_OUT})

#: In these a goal that must not go on after a pause ends.
INTERRUPTIBLE_STATES = RUNNING_STATES | {GoalState.AWAITING_POINTS, GoalState.SETTLING}

#: In these a goal ends when the states of the robot are too old to monitor it.
MONITORED_STATES = INTERRUPTIBLE_STATES | {GoalState.ARMING}

#: Signals that stop the arm in every state but ENDED, and the code with which the goal ends where
#: none is decided yet.
STOP_SIGNALS: Mapping[GoalSignal, ErrorCode] = {
    GoalSignal.PROTECTIVE_STOP: ErrorCode.PROTECTIVE_STOP,
    GoalSignal.EMERGENCY_STOP: ErrorCode.EMERGENCY_STOP,
    GoalSignal.PROGRAM_STOPPED: ErrorCode.PROGRAM_STOPPED,
    GoalSignal.CONNECTION_LOST: ErrorCode.CONNECTION_LOST,
}


@dataclass(frozen=True, slots=True)
class Transition:
    """The next state, and the code of the outcome where it is decided here."""

    state: GoalState
    code: ErrorCode | None = None


#: After these the robot program is paused or reads nothing, but has not ended.
STOP_PROGRAM_AFTER = frozenset(
    {
        GoalSignal.PROTECTIVE_STOP,
        GoalSignal.EMERGENCY_STOP,
        GoalSignal.UNANSWERED,
        GoalSignal.STANDSTILL,
    }
)


def _end(code: ErrorCode) -> Transition:
    return Transition(GoalState.ENDED, code)


def _decide(code: ErrorCode) -> Transition:
    return Transition(GoalState.RESTORING, code)


_ON_STOP = {signal: _end(code) for signal, code in STOP_SIGNALS.items()} | {
    GoalSignal.PROGRAM_STOPPED: Transition(GoalState.PROGRAM_LOST, ErrorCode.PROGRAM_STOPPED)
}


def _ignore(state: GoalState, *signals: GoalSignal) -> dict[GoalSignal, Transition]:
    return {signal: Transition(state) for signal in signals}


#: Results of the robot program.
_RESULTS = (GoalSignal.SUCCESS, GoalSignal.CANCELED, GoalSignal.FAILURE, GoalSignal.CONTACT)
#: Requests of users; the first of them decides how the goal ends.
_USER_STOPS = (GoalSignal.CANCEL, GoalSignal.PREEMPT)
_ON_USER_STOP = {
    GoalSignal.CANCEL: _decide(ErrorCode.CANCELLED),
    GoalSignal.PREEMPT: _decide(ErrorCode.PREEMPTED),
}

#: How a trajectory that runs is stopped, or ends by itself.
_WHILE_RUNNING: Mapping[GoalSignal, Transition] = {
    **_ON_STOP,
    GoalSignal.CANCELED: _decide(ErrorCode.EXECUTION_FAILED),
    GoalSignal.FAILURE: _decide(ErrorCode.EXECUTION_FAILED),
    GoalSignal.CONTACT: _decide(ErrorCode.SUCCESSFUL),
    GoalSignal.CANCEL: Transition(GoalState.CANCELLING, ErrorCode.CANCELLED),
    GoalSignal.PREEMPT: Transition(GoalState.CANCELLING, ErrorCode.PREEMPTED),
    GoalSignal.VIOLATION: Transition(GoalState.CANCELLING, ErrorCode.PATH_TOLERANCE_VIOLATED),
    GoalSignal.DEVIATION: Transition(GoalState.CANCELLING, ErrorCode.EXECUTION_FAILED),
    GoalSignal.STANDSTILL: _end(ErrorCode.EXECUTION_FAILED),
    GoalSignal.STALE: Transition(GoalState.CANCELLING, ErrorCode.CONNECTION_LOST),
}

#: What each signal means in each state. STARVING, APPENDED, NO_MORE_POINTS, ARMED, SETTLED,
#: RESTORED, AT_REST, TIMEOUT and UNANSWERED cannot happen in the states that do not list them.
TRANSITIONS: Mapping[GoalState, Mapping[GoalSignal, Transition]] = {
    GoalState.ARMING: {
        **_ON_STOP,
        # Of a goal before this one.
        **_ignore(GoalState.ARMING, *_RESULTS),
        GoalSignal.ARMED: Transition(GoalState.MOVING),
        **_ON_USER_STOP,
        GoalSignal.STALE: _decide(ErrorCode.CONNECTION_LOST),
        GoalSignal.TIMEOUT: _decide(ErrorCode.ROBOT_NOT_READY),
    },
    GoalState.MOVING: {
        **_WHILE_RUNNING,
        GoalSignal.SUCCESS: Transition(GoalState.SETTLING),
        GoalSignal.STARVING: Transition(GoalState.RUNNING_OUT),
    },
    GoalState.RUNNING_OUT: {
        **_WHILE_RUNNING,
        GoalSignal.SUCCESS: Transition(GoalState.AWAITING_POINTS),
    },
    GoalState.AWAITING_POINTS: {
        **_ON_STOP,
        **_ignore(GoalState.AWAITING_POINTS, *_RESULTS),
        GoalSignal.APPENDED: Transition(GoalState.MOVING),
        GoalSignal.NO_MORE_POINTS: Transition(GoalState.SETTLING),
        **_ON_USER_STOP,
        GoalSignal.DEVIATION: _decide(ErrorCode.EXECUTION_FAILED),
        GoalSignal.STALE: _decide(ErrorCode.CONNECTION_LOST),
        GoalSignal.TIMEOUT: _decide(ErrorCode.CANCELLED),
    },
    GoalState.SETTLING: {
        **_ON_STOP,
        **_ignore(GoalState.SETTLING, *_RESULTS),
        **_ON_USER_STOP,
        GoalSignal.DEVIATION: _decide(ErrorCode.EXECUTION_FAILED),
        GoalSignal.STALE: _decide(ErrorCode.CONNECTION_LOST),
        GoalSignal.SETTLED: _decide(ErrorCode.SUCCESSFUL),
        GoalSignal.TIMEOUT: _decide(ErrorCode.GOAL_TOLERANCE_VIOLATED),
    },
    GoalState.CANCELLING: {
        **_ON_STOP,
        **_ignore(GoalState.CANCELLING, GoalSignal.SUCCESS, GoalSignal.FAILURE),
        **_ignore(GoalState.CANCELLING, GoalSignal.CONTACT, *_USER_STOPS),
        GoalSignal.CANCELED: Transition(GoalState.COMING_TO_REST),
        GoalSignal.UNANSWERED: Transition(GoalState.ENDED),
        GoalSignal.TIMEOUT: _end(ErrorCode.EXECUTION_FAILED),
    },
    GoalState.COMING_TO_REST: {
        **_ON_STOP,
        **_ignore(GoalState.COMING_TO_REST, *_RESULTS, *_USER_STOPS),
        GoalSignal.AT_REST: Transition(GoalState.RESTORING),
        GoalSignal.TIMEOUT: _end(ErrorCode.EXECUTION_FAILED),
    },
    GoalState.RESTORING: {
        **{signal: Transition(GoalState.ENDED) for signal in STOP_SIGNALS},
        **_ignore(GoalState.RESTORING, *_RESULTS, *_USER_STOPS),
        GoalSignal.RESTORED: Transition(GoalState.ENDED),
        GoalSignal.TIMEOUT: Transition(GoalState.ENDED),
    },
    GoalState.PROGRAM_LOST: {
        **_ON_STOP,
        **_ignore(GoalState.PROGRAM_LOST, *_RESULTS, *_USER_STOPS, GoalSignal.PROGRAM_STOPPED),
        GoalSignal.TIMEOUT: Transition(GoalState.ENDED),
    },
    GoalState.ENDED: {},
}


#: The robot program's result of a trajectory, with a clause for the outcome's text.
RESULT_SIGNALS: Mapping[TrajectoryResult, tuple[GoalSignal, str]] = {
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
    TrajectoryResult.NO_CONTACT: (
        GoalSignal.FAILURE,
        'the tool touched nothing, but its press requires contact',
    ),
}


_EMERGENCY_STOPS = int(
    SafetyStatus.EMERGENCY_STOPPED
    | SafetyStatus.ROBOT_EMERGENCY_STOPPED
    | SafetyStatus.SYSTEM_EMERGENCY_STOPPED
)
#: As plain numbers, because every packet is checked and operations on flags are slow.
_SAFETY_STOPS = _EMERGENCY_STOPS | int(
    SafetyStatus.PROTECTIVE_STOPPED
    | SafetyStatus.SAFEGUARD_STOPPED
    | SafetyStatus.VIOLATION
    | SafetyStatus.FAULT
)
NO_STOP = SafetyStatus(0)
#: Below this target speed of each joint the arm is at rest [rad/s].
REST_SPEED = 1e-3
#: Below this measured speed it may ring [rad/s]. Recorded arms ring above 0.001 rad/s for up to
#: 0.6 s after their target has stopped, above 0.005 rad/s for up to 0.3 s.
RINGING_SPEED = 0.05
#: Stops after which the robot continues its program once somebody unlocks and plays it.
RESUMABLE_STOPS = SafetyStatus.PROTECTIVE_STOPPED | SafetyStatus.SAFEGUARD_STOPPED


def is_at_rest(state: RobotState) -> bool:
    """Tell whether the target of the arm stands; the arm itself may still ring a little."""
    return (
        max(map(abs, state.target_qd)) < REST_SPEED
        and max(map(abs, state.actual_qd)) < RINGING_SPEED
    )


def detect_stop(
    state: RobotState, ignored_stops: SafetyStatus = NO_STOP
) -> tuple[GoalSignal, str] | None:
    """
    Return why the robot cannot go on by itself, or None when it can.

    :param ignored_stops: safety stops that do not end the goal.
    """
    safety = int(state.safety_status) & _SAFETY_STOPS & ~int(ignored_stops)
    if safety:
        return _safety_stop(safety, state)
    if state.robot_mode is not RobotMode.RUNNING:
        return GoalSignal.PROGRAM_STOPPED, (
            f'the arm left the mode RUNNING and is in {state.robot_mode.name}'
        )
    if state.runtime_state in (RuntimeState.STOPPING, RuntimeState.STOPPED):
        return GoalSignal.PROGRAM_STOPPED, 'the robot program was stopped'
    return None


def _safety_stop(safety: int, state: RobotState) -> tuple[GoalSignal, str]:
    """Return the meaning of a safety stop."""
    if safety & _EMERGENCY_STOPS:
        return GoalSignal.EMERGENCY_STOP, 'an emergency stop cut the power of the arm'
    if safety & SafetyStatus.PROTECTIVE_STOPPED:
        return GoalSignal.PROTECTIVE_STOP, 'the robot made a protective stop'
    if safety & SafetyStatus.SAFEGUARD_STOPPED:
        return GoalSignal.PROTECTIVE_STOP, 'the robot made a safeguard stop'
    return (
        GoalSignal.PROTECTIVE_STOP,
        f'the safety system reports {state.safety_mode.name.lower()}',
    )
