# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The states of a goal while the robot program runs it, and the table of transitions.

:data:`TRANSITIONS` gives for each state and signal (:class:`~.outcome_codes.GoalSignal`) the next
state, and the error code if the signal decides the outcome of the goal.

* **ARMING**: every goal begins here. If it moves a frame other than the robot's TCP, the command
  that sets the TCP has been sent: nothing moves until the robot reports that TCP and is at the
  start of the plan. Motions through RTDE registers also wait for the robot's inputs and for the
  answer of the robot program; goals with safe outputs wait until the program has confirmed these.
  If there is nothing to prepare, ARMED follows at once.
* **MOVING**: the robot program runs points. Its result SUCCESS leads to SETTLING. A cause that
  stops the arm by itself (safety, connection) ends the goal at once, because the robot program
  would not read our CANCEL; our own reasons to stop (cancel, preemption, tolerance, a change of
  the cell) lead to CANCELLING.
* **RUNNING_OUT**: no more points came in time for an open goal (keep_open). The ending, which
  brings the arm to rest at or after the last known point, has been sent, and so has the number of
  all records. Points that come now wait for the program's SUCCESS, and are executed from rest.
* **AWAITING_POINTS**: the arm rests after the ending, and the program has no trajectory. APPENDED
  starts the next trajectory; NO_MORE_POINTS (the client closed the goal) leads to SETTLING. If
  neither comes within ``keep_open_timeout``, the goal was abandoned, and ends as CANCELLED.
* **SETTLING**: the program has reported the last point as reached. The arm has to come to rest
  inside the goal tolerance, within the goal's time tolerance. If the controller's target is not
  at the last point, the program skipped motions (DEVIATION).
* A goal that ends when the tool touches (CONTACT) succeeds without SETTLING: the program has
  moved the arm back to the place of contact. If a contact watch outside of the goal stops the arm
  (TOUCHED), the goal fails, even at rest between or after its trajectories. It is cancelled, too,
  because the program may have read START just after the contact, and would run the trajectory.
* **CANCELLING**: CANCEL has been sent. The program brakes, discards the points that it has not
  run and answers CANCELED. A SUCCESS in this state means that the last point was reached before
  the program read CANCEL; this is not the answer to CANCEL: CANCELED still follows.
* **COMING_TO_REST**: the program has answered CANCELED; the arm is coming to rest.
* **RESTORING**: the outcome is decided, and nothing moves; the command that restores the original
  TCP has been sent. The outcome waits until the robot reports that TCP, so that the next goal
  finds it, and until the program confirms the safe outputs. A goal that set no TCP and has no safe
  outputs ends at once.
* **PROGRAM_LOST**: the robot program is gone. Often the cause is a safety stop, a power cut or a
  dead controller, and all of these may be reported in any order; so for ``CAUSE_TIMEOUT`` a deeper
  reason can still replace the end of the program.
* **ENDED**: the outcome has been reported. Later events are ignored.

Nearly every state has a deadline (:mod:`~.missed_deadlines`). If CANCEL is not answered in time,
or the arm does not come to rest after the answer, the driver ends the robot program. A paused
program cannot answer: if the arm is at rest, the goal ends with the code already decided
(UNANSWERED); if the arm may still move, the goal fails (UNCONFIRMED). If the TCP is not set in
time, the goal ends before anything moves; if the original TCP is not restored in time, the owner
of the sockets restores it later (``temporary_tcp`` of the machine).
MOVING and RUNNING_OUT have no deadline, because a speed slider at zero is no error; but if the arm
stands still for ``STANDSTILL_TIMEOUT`` and nothing holds it, a command or a result was lost
(STANDSTILL). If RTDE packets are too old or stop coming, the motion cannot be monitored: the goal
is cancelled (STALE), and ends with the code for a lost connection.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import auto, Enum
from typing import NamedTuple

from ur_cartesian_driver.execution.goal.outcome_codes import Fault, GoalSignal
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RobotState,
    RuntimeState,
    SafetyMode,
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


#: The state in which a goal begins; if nothing has to be armed, ARMED follows at once.
INITIAL_STATE = GoalState.ARMING
#: States in which the robot program runs points of the goal.
RUNNING_STATES = frozenset({GoalState.MOVING, GoalState.RUNNING_OUT})
#: States in which a goal ends if it must not go on after a pause.
INTERRUPTIBLE_STATES = RUNNING_STATES | {GoalState.AWAITING_POINTS, GoalState.SETTLING}
#: States in which a goal ends when the robot's reports are too old to monitor it.
MONITORED_STATES = INTERRUPTIBLE_STATES | {GoalState.ARMING}

#: Signals after which the robot program is paused or reads nothing, but has not ended. Unless it
#: is stopped, the old motion would go on once somebody unlocks the arm and plays the program.
STOP_PROGRAM_AFTER = frozenset(
    {
        GoalSignal.PROTECTIVE_STOP,
        GoalSignal.EMERGENCY_STOP,
        GoalSignal.UNANSWERED,
        GoalSignal.UNCONFIRMED,
        GoalSignal.STANDSTILL,
    }
)


class Transition(NamedTuple):
    """The next state, and the error code if the transition decides the outcome."""

    state: GoalState
    code: ErrorCode | None = None


def _to(state: GoalState, *signals: GoalSignal) -> dict[GoalSignal, Transition]:
    """Return table entries for signals that leave the outcome as it is."""
    return {signal: Transition(state) for signal in signals}


def _decide(state: GoalState, *signals: GoalSignal) -> dict[GoalSignal, Transition]:
    """Return table entries for signals that decide the outcome."""
    return {signal: Transition(state, signal.code) for signal in signals}


_STOPS = (GoalSignal.PROTECTIVE_STOP, GoalSignal.EMERGENCY_STOP, GoalSignal.CONNECTION_LOST)
_RESULTS = (
    GoalSignal.SUCCESS,
    GoalSignal.CANCELED,
    GoalSignal.FAILURE,
    GoalSignal.CONTACT,
    GoalSignal.TOUCHED,
)
#: Stops that users, or the owner of the goal, ask for.
_REQUESTED_STOPS = (GoalSignal.CANCEL, GoalSignal.PREEMPT, GoalSignal.COLLISION)

#: Transitions if the arm stops by itself: this deeper reason replaces an outcome that is decided
#: but still waits for the stop.
_ON_STOP = {
    **_decide(GoalState.ENDED, *_STOPS),
    **_decide(GoalState.PROGRAM_LOST, GoalSignal.PROGRAM_STOPPED),
}
_WHILE_RUNNING = {
    **_ON_STOP,
    **_decide(GoalState.RESTORING, GoalSignal.CANCELED, GoalSignal.FAILURE, GoalSignal.CONTACT),
    **_decide(GoalState.CANCELLING, *_REQUESTED_STOPS, GoalSignal.VIOLATION, GoalSignal.DEVIATION),
    **_decide(GoalState.CANCELLING, GoalSignal.STALE, GoalSignal.TOUCHED),
    **_decide(GoalState.ENDED, GoalSignal.STANDSTILL),
}

#: The transition of each signal in each state. Signals that a state does not list cannot happen
#: there. Of several user requests the first decides; a result that a state ignores belongs to an
#: earlier goal, or is not the awaited answer.
TRANSITIONS: Mapping[GoalState, Mapping[GoalSignal, Transition]] = {
    GoalState.ARMING: {
        **_ON_STOP,
        **_to(GoalState.ARMING, *_RESULTS),
        **_to(GoalState.MOVING, GoalSignal.ARMED),
        **_decide(GoalState.RESTORING, *_REQUESTED_STOPS, GoalSignal.STALE, GoalSignal.NOT_READY),
        **_decide(GoalState.RESTORING, GoalSignal.TOUCHED),
    },
    GoalState.MOVING: {
        **_WHILE_RUNNING,
        **_to(GoalState.SETTLING, GoalSignal.SUCCESS),
        **_to(GoalState.RUNNING_OUT, GoalSignal.STARVING),
    },
    GoalState.RUNNING_OUT: {
        **_WHILE_RUNNING,
        **_to(GoalState.AWAITING_POINTS, GoalSignal.SUCCESS),
    },
    GoalState.AWAITING_POINTS: {
        **_ON_STOP,
        **_to(GoalState.AWAITING_POINTS, *_RESULTS),
        **_to(GoalState.MOVING, GoalSignal.APPENDED),
        **_to(GoalState.SETTLING, GoalSignal.NO_MORE_POINTS),
        **_decide(GoalState.RESTORING, *_REQUESTED_STOPS, GoalSignal.DEVIATION, GoalSignal.STALE),
        **_decide(GoalState.RESTORING, GoalSignal.ABANDONED, GoalSignal.TOUCHED),
    },
    GoalState.SETTLING: {
        **_ON_STOP,
        **_to(GoalState.SETTLING, *_RESULTS),
        **_decide(GoalState.RESTORING, *_REQUESTED_STOPS, GoalSignal.DEVIATION, GoalSignal.STALE),
        **_decide(GoalState.RESTORING, GoalSignal.SETTLED, GoalSignal.NOT_SETTLED),
        **_decide(GoalState.RESTORING, GoalSignal.TOUCHED),
    },
    GoalState.CANCELLING: {
        **_ON_STOP,
        **_to(GoalState.CANCELLING, *_RESULTS, *_REQUESTED_STOPS),
        **_to(GoalState.COMING_TO_REST, GoalSignal.CANCELED),
        **_to(GoalState.ENDED, GoalSignal.UNANSWERED),
        **_decide(GoalState.ENDED, GoalSignal.UNCONFIRMED),
    },
    GoalState.COMING_TO_REST: {
        **_ON_STOP,
        **_to(GoalState.COMING_TO_REST, *_RESULTS, *_REQUESTED_STOPS),
        **_to(GoalState.RESTORING, GoalSignal.AT_REST),
        **_decide(GoalState.ENDED, GoalSignal.UNCONFIRMED),
    },
    GoalState.RESTORING: {
        **_to(GoalState.RESTORING, *_RESULTS, *_REQUESTED_STOPS),
        **_to(GoalState.ENDED, *_STOPS, GoalSignal.PROGRAM_STOPPED),
        **_to(GoalState.ENDED, GoalSignal.RESTORED, GoalSignal.TIMEOUT),
    },
    GoalState.PROGRAM_LOST: {
        **_decide(GoalState.ENDED, *_STOPS),
        **_to(GoalState.PROGRAM_LOST, *_RESULTS, *_REQUESTED_STOPS, GoalSignal.PROGRAM_STOPPED),
        **_to(GoalState.ENDED, GoalSignal.TIMEOUT),
    },
    GoalState.ENDED: {},
}


# These are plain numbers because every packet is checked and operations on flags are slow.
_EMERGENCY_STOPS = int(
    SafetyStatus.EMERGENCY_STOPPED
    | SafetyStatus.ROBOT_EMERGENCY_STOPPED
    | SafetyStatus.SYSTEM_EMERGENCY_STOPPED
)
_SAFETY_STOPS = _EMERGENCY_STOPS | int(
    SafetyStatus.PROTECTIVE_STOPPED
    | SafetyStatus.SAFEGUARD_STOPPED
    | SafetyStatus.VIOLATION
    | SafetyStatus.FAULT
)
NO_STOP = SafetyStatus(0)
#: Stops after which the robot goes on once somebody unlocks it and plays its program.
RESUMABLE_STOPS = SafetyStatus.PROTECTIVE_STOPPED | SafetyStatus.SAFEGUARD_STOPPED
#: Modes of newer safety functions, with the kind of stop of each. UR does not document whether the
#: safety status has the bit of that stop, too.
_STOP_OF_MODE = {
    SafetyMode.AUTOMATIC_MODE_SAFEGUARD_STOP: SafetyStatus.SAFEGUARD_STOPPED,
    SafetyMode.SYSTEM_THREE_POSITION_ENABLING_STOP: SafetyStatus.SAFEGUARD_STOPPED,
    SafetyMode.TP_THREE_POSITION_ENABLING_STOP: SafetyStatus.SAFEGUARD_STOPPED,
    SafetyMode.IMMI_SAFEGUARD_STOP: SafetyStatus.SAFEGUARD_STOPPED,
    SafetyMode.PROFISAFE_AUTOMATIC_MODE_SAFEGUARD_STOP: SafetyStatus.SAFEGUARD_STOPPED,
    SafetyMode.PROFISAFE_SAFEGUARD_STOP: SafetyStatus.SAFEGUARD_STOPPED,
    SafetyMode.SAFETY_API_SAFEGUARD_STOP: SafetyStatus.SAFEGUARD_STOPPED,
    SafetyMode.IMMI_EMERGENCY_STOP: SafetyStatus.EMERGENCY_STOPPED,
    SafetyMode.PROFISAFE_EMERGENCY_STOP: SafetyStatus.EMERGENCY_STOPPED,
}
#: An arm is at rest if the target speed of every joint is below this [rad/s].
REST_SPEED = 1e-3
#: An arm at rest may ring with measured joint speeds below this [rad/s]. Recorded arms ring above
#: 0.001 rad/s for up to 0.6 s after their target has stopped, above 0.005 rad/s for up to 0.3 s.
RINGING_SPEED = 0.05


def is_at_rest(state: RobotState) -> bool:
    """Return whether the arm's target stands still; the arm itself may still ring a little."""
    return (
        max(map(abs, state.target_qd)) < REST_SPEED
        and max(map(abs, state.actual_qd)) < RINGING_SPEED
    )


def detect_stop(state: RobotState, ignored_stops: SafetyStatus = NO_STOP) -> Fault | None:
    """
    Return the reason why the robot cannot go on by itself; None = it can.

    :param ignored_stops: safety stops that do not end the goal.
    """
    safety = int(state.safety_status) & _SAFETY_STOPS
    if state.safety_mode in _STOP_OF_MODE:
        safety |= int(_STOP_OF_MODE[state.safety_mode])
    safety &= ~int(ignored_stops)
    if safety:
        return _safety_stop(safety, state)
    if state.robot_mode is not RobotMode.RUNNING:
        mode = state.robot_mode.name
        return GoalSignal.PROGRAM_STOPPED, f'the arm left the mode RUNNING and is in {mode}'
    if state.runtime_state in (RuntimeState.STOPPING, RuntimeState.STOPPED):
        return GoalSignal.PROGRAM_STOPPED, 'the robot program was stopped'
    return None


def _safety_stop(safety: int, state: RobotState) -> Fault:
    """Return the signal of the most severe of several safety stops."""
    if safety & _EMERGENCY_STOPS:
        return GoalSignal.EMERGENCY_STOP, 'an emergency stop cut the power of the arm'
    if safety & SafetyStatus.PROTECTIVE_STOPPED:
        return GoalSignal.PROTECTIVE_STOP, 'the robot made a protective stop'
    if safety & SafetyStatus.SAFEGUARD_STOPPED:
        return GoalSignal.PROTECTIVE_STOP, 'the robot made a safeguard stop'
    mode = state.safety_mode.name.lower()
    return GoalSignal.PROTECTIVE_STOP, f'the safety system reports {mode}'
