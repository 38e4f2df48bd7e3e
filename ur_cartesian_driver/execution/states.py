# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The states of a goal on its way through the robot program, and what leads from one to another.

Events are first turned into signals (:class:`Signal`); :data:`TRANSITIONS` says what a signal
means in the present state: the next state and how the goal ends, if it does.

* **ARMING**: the goal moves another frame than the robot's TCP, and the message that sets the TCP
  there is on the wire. Nothing moves before the robot reports it, and itself where the plan
  begins. Goals about the TCP itself begin in MOVING.
* **MOVING**: the robot program runs points. The result SUCCESS leads to SETTLING; whatever stops
  the arm by itself (safety, connection) ends the goal at once, because nothing that we could send
  would be read; a reason of ours to stop (cancel, preemption, tolerance)
  leads to STOPPING.
* **CLOSING**: of a goal that can be continued (keep_open) no more points came in time. What takes
  the arm to rest at the last known point, or behind it, is on the wire, and the number of its
  records. Points that come now wait for the SUCCESS of the program: they go on from rest.
* **WAITING**: the arm is at rest there, and the program has no trajectory. EXTENDED starts the
  next one; LAST, the word that no points will come, leads to SETTLING. Without either the goal
  ends after ``keep_open_timeout`` (LATE), as CANCELLED: it was given up, and nothing failed.
* **SETTLING**: the program says that the last point is reached. The arm has to be inside the goal
  tolerance and at rest, within the goal's time tolerance. Where the controller's own target is
  elsewhere, the program left something out (DEVIATION).
* **STOPPING**: CANCEL is on the wire. The program brakes, discards the points that it has not run
  and answers CANCELED. A SUCCESS in this state means that the last point was reached before the
  program read the CANCEL; it is no answer, CANCELED still follows.
* **HALTING**: the program has answered; the arm is coming to rest.
* **RESTORING**: how the goal ends is decided, and nothing moves; the TCP of before is on the wire.
  The outcome waits until the robot reports it, so the next goal finds it. Goals that changed no
  TCP pass through at once.
* **ENDING**: the robot program is gone. Programs end because the safety system, the power or the
  whole controller has gone as well, and which of them we hear of first is chance: so for a
  moment a deeper reason still counts.
* **ENDED**: the outcome is out. Later events mean nothing.

Everything has a bound: an answer that does not come in STOPPING or HALTING ends the goal after
``STOP_BOUND`` by ending the robot program. A program that somebody has paused reads nothing: the
arm stands, and the goal ends as it was to end (UNANSWERED); an arm that still moves is a failure
(LATE). A TCP that is not set in time ends the goal before it began; one that is not back in time,
or not at the end because the robot stopped, is the business of whoever carries out the commands
(the ``loan`` of the machine). MOVING and CLOSING have none, because a speed slider at zero is no
error; but an arm that stands for ``STALL_BOUND`` while nothing holds it waits for something that
will not come: a command or a result was lost (STALLED). RTDE packets that stop coming are a lost
connection.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import auto, Enum
from types import MappingProxyType

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.motion.state import RobotMode, RobotState, RuntimeState, SafetyStatus


class State(Enum):
    """Where a goal is."""

    ARMING = auto()
    MOVING = auto()
    CLOSING = auto()
    WAITING = auto()
    SETTLING = auto()
    STOPPING = auto()
    HALTING = auto()
    RESTORING = auto()
    ENDING = auto()
    ENDED = auto()


class Signal(Enum):
    """What an event means to a goal."""

    SUCCESS = auto()
    CANCELED = auto()
    FAILURE = auto()
    CANCEL = auto()
    PREEMPT = auto()
    VIOLATION = auto()
    DEVIATION = auto()
    STALLED = auto()
    PROTECTIVE_STOP = auto()
    EMERGENCY_STOP = auto()
    PROGRAM_STOPPED = auto()
    CONNECTION_LOST = auto()
    STARVING = auto()
    EXTENDED = auto()
    LAST = auto()
    ARMED = auto()
    SETTLED = auto()
    RESTORED = auto()
    AT_REST = auto()
    LATE = auto()
    UNANSWERED = auto()


#: In these the robot program runs points of the goal.
UNDER_WAY = frozenset({State.MOVING, State.CLOSING})

#: What stops the arm in every state but ENDED, and the code that the goal ends with where none is
#: decided yet.
STOPS: Mapping[Signal, ErrorCode] = MappingProxyType(
    {
        Signal.PROTECTIVE_STOP: ErrorCode.PROTECTIVE_STOP,
        Signal.EMERGENCY_STOP: ErrorCode.EMERGENCY_STOP,
        Signal.PROGRAM_STOPPED: ErrorCode.PROGRAM_STOPPED,
        Signal.CONNECTION_LOST: ErrorCode.CONNECTION_LOST,
    }
)


@dataclass(frozen=True, slots=True)
class Step:
    """The next state, and the code of the outcome where it is decided here."""

    state: State
    code: ErrorCode | None = None


#: After these the robot program is paused or deaf, and not ended.
PAUSES = frozenset(
    {Signal.PROTECTIVE_STOP, Signal.EMERGENCY_STOP, Signal.UNANSWERED, Signal.STALLED}
)


def _ends(code: ErrorCode) -> Step:
    return Step(State.ENDED, code)


def _judged(code: ErrorCode) -> Step:
    return Step(State.RESTORING, code)


_STOPS = {signal: _ends(code) for signal, code in STOPS.items()} | {
    Signal.PROGRAM_STOPPED: Step(State.ENDING, ErrorCode.PROGRAM_STOPPED)
}


def _stays(state: State, *signals: Signal) -> dict[Signal, Step]:
    return {signal: Step(state) for signal in signals}


#: What people ask for; the first of them says how the goal ends.
_WISHES = (Signal.CANCEL, Signal.PREEMPT)

#: What a trajectory that runs is stopped by, or ends by itself with.
_RUNS: Mapping[Signal, Step] = MappingProxyType(
    {
        **_STOPS,
        Signal.CANCELED: _judged(ErrorCode.EXECUTION_FAILED),
        Signal.FAILURE: _judged(ErrorCode.EXECUTION_FAILED),
        Signal.CANCEL: Step(State.STOPPING, ErrorCode.CANCELLED),
        Signal.PREEMPT: Step(State.STOPPING, ErrorCode.PREEMPTED),
        Signal.VIOLATION: Step(State.STOPPING, ErrorCode.PATH_TOLERANCE_VIOLATED),
        Signal.DEVIATION: Step(State.STOPPING, ErrorCode.EXECUTION_FAILED),
        Signal.STALLED: _ends(ErrorCode.EXECUTION_FAILED),
    }
)

#: What each signal means in each state. STARVING, EXTENDED, LAST, ARMED, SETTLED, RESTORED,
#: AT_REST, LATE and UNANSWERED are about the state they are given for: not possible in the others.
TRANSITIONS: Mapping[State, Mapping[Signal, Step]] = MappingProxyType(
    {
        State.ARMING: {
            **_STOPS,
            # Of a goal before this one.
            **_stays(State.ARMING, Signal.SUCCESS, Signal.CANCELED, Signal.FAILURE),
            Signal.ARMED: Step(State.MOVING),
            Signal.CANCEL: _judged(ErrorCode.CANCELLED),
            Signal.PREEMPT: _judged(ErrorCode.PREEMPTED),
            Signal.LATE: _judged(ErrorCode.ROBOT_NOT_READY),
        },
        State.MOVING: {
            **_RUNS,
            Signal.SUCCESS: Step(State.SETTLING),
            Signal.STARVING: Step(State.CLOSING),
        },
        State.CLOSING: {
            **_RUNS,
            Signal.SUCCESS: Step(State.WAITING),
        },
        State.WAITING: {
            **_STOPS,
            **_stays(State.WAITING, Signal.SUCCESS, Signal.CANCELED, Signal.FAILURE),
            Signal.EXTENDED: Step(State.MOVING),
            Signal.LAST: Step(State.SETTLING),
            Signal.CANCEL: _judged(ErrorCode.CANCELLED),
            Signal.PREEMPT: _judged(ErrorCode.PREEMPTED),
            Signal.DEVIATION: _judged(ErrorCode.EXECUTION_FAILED),
            Signal.LATE: _judged(ErrorCode.CANCELLED),
        },
        State.SETTLING: {
            **_STOPS,
            **_stays(State.SETTLING, Signal.SUCCESS, Signal.CANCELED, Signal.FAILURE),
            Signal.CANCEL: _judged(ErrorCode.CANCELLED),
            Signal.PREEMPT: _judged(ErrorCode.PREEMPTED),
            Signal.DEVIATION: _judged(ErrorCode.EXECUTION_FAILED),
            Signal.SETTLED: _judged(ErrorCode.SUCCESSFUL),
            Signal.LATE: _judged(ErrorCode.GOAL_TOLERANCE_VIOLATED),
        },
        State.STOPPING: {
            **_STOPS,
            **_stays(State.STOPPING, Signal.SUCCESS, Signal.FAILURE, *_WISHES),
            Signal.CANCELED: Step(State.HALTING),
            Signal.UNANSWERED: Step(State.ENDED),
            Signal.LATE: _ends(ErrorCode.EXECUTION_FAILED),
        },
        State.HALTING: {
            **_STOPS,
            **_stays(State.HALTING, Signal.SUCCESS, Signal.CANCELED, Signal.FAILURE, *_WISHES),
            Signal.AT_REST: Step(State.RESTORING),
            Signal.LATE: _ends(ErrorCode.EXECUTION_FAILED),
        },
        State.RESTORING: {
            **{signal: Step(State.ENDED) for signal in STOPS},
            **_stays(State.RESTORING, Signal.SUCCESS, Signal.CANCELED, Signal.FAILURE, *_WISHES),
            Signal.RESTORED: Step(State.ENDED),
            Signal.LATE: Step(State.ENDED),
        },
        State.ENDING: {
            **_STOPS,
            **_stays(
                State.ENDING,
                Signal.SUCCESS,
                Signal.CANCELED,
                Signal.FAILURE,
                *_WISHES,
                Signal.PROGRAM_STOPPED,
            ),
            Signal.LATE: Step(State.ENDED),
        },
        State.ENDED: {},
    }
)


#: What the robot program says of a trajectory, with a clause for the outcome's text.
RESULTS: Mapping[TrajectoryResult, tuple[Signal, str]] = MappingProxyType(
    {
        TrajectoryResult.SUCCESS: (Signal.SUCCESS, ''),
        TrajectoryResult.CANCELED: (
            Signal.CANCELED,
            'the robot program cancelled the trajectory by itself',
        ),
        TrajectoryResult.FAILURE: (
            Signal.FAILURE,
            'the robot program reported a failure; its log on the pendant says why',
        ),
    }
)


_EMERGENCY = int(
    SafetyStatus.EMERGENCY_STOPPED
    | SafetyStatus.ROBOT_EMERGENCY_STOPPED
    | SafetyStatus.SYSTEM_EMERGENCY_STOPPED
)
#: In plain numbers, as this is looked at in every packet and operations on flags are slow.
_STOPPED = _EMERGENCY | int(
    SafetyStatus.PROTECTIVE_STOPPED
    | SafetyStatus.SAFEGUARD_STOPPED
    | SafetyStatus.VIOLATION
    | SafetyStatus.FAULT
)
NO_STOP = SafetyStatus(0)
#: Stops after which a robot goes on with its program, where somebody unlocks and plays it.
HOLDS = SafetyStatus.PROTECTIVE_STOPPED | SafetyStatus.SAFEGUARD_STOPPED


def stop_in(state: RobotState, borne: SafetyStatus = NO_STOP) -> tuple[Signal, str] | None:
    """
    Return why the robot cannot go on by itself, or None when it can.

    :param borne: stops of the safety system that are not taken for a reason.
    """
    safety = int(state.safety_status) & _STOPPED & ~int(borne)
    if safety:
        return _safety_stop(safety, state)
    if state.robot_mode is not RobotMode.RUNNING:
        return Signal.PROGRAM_STOPPED, (
            f'the arm left the mode RUNNING and is in {state.robot_mode.name}'
        )
    if state.runtime_state in (RuntimeState.STOPPING, RuntimeState.STOPPED):
        return Signal.PROGRAM_STOPPED, 'the robot program was stopped'
    return None


def _safety_stop(safety: int, state: RobotState) -> tuple[Signal, str]:
    """Return what a stop of the safety system means."""
    if safety & _EMERGENCY:
        return Signal.EMERGENCY_STOP, 'an emergency stop cut the power of the arm'
    if safety & SafetyStatus.PROTECTIVE_STOPPED:
        return Signal.PROTECTIVE_STOP, 'the robot made a protective stop'
    if safety & SafetyStatus.SAFEGUARD_STOPPED:
        return Signal.PROTECTIVE_STOP, 'the robot made a safeguard stop'
    return Signal.PROTECTIVE_STOP, f'the safety system reports {state.safety_mode.name.lower()}'
