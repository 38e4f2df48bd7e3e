# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The recovery of a stopped robot as tables: from the modes of the robot to the next step.

The safety system comes first, then power and brakes, then the program. Each step follows from the
newest state of the robot, so a step that a person takes meanwhile is not repeated. If a person has
to act, the recovery ends with an instruction.

Pure: no socket, no clock.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import auto, Enum

from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RobotState,
    RuntimeState,
    SafetyMode,
)
from ur_cartesian_driver.robot.lifecycle import ConnectionState


class RecoveryStep(Enum):
    """A step of the recovery."""

    DONE = auto()
    #: The robot changes its state by itself.
    WAIT = auto()
    UNLOCK = auto()
    RESTART_SAFETY = auto()
    POWER_ON = auto()
    RELEASE_BRAKES = auto()
    STOP_PROGRAM = auto()
    SEND_PROGRAM = auto()
    PLAY = auto()
    #: A person has to act.
    OPERATOR = auto()


#: The steps as imperatives, for sentences.
STEP_NAMES: Mapping[RecoveryStep, str] = {
    RecoveryStep.UNLOCK: 'unlock the protective stop',
    RecoveryStep.RESTART_SAFETY: 'restart the safety system',
    RecoveryStep.POWER_ON: 'switch the arm on',
    RecoveryStep.RELEASE_BRAKES: 'release the brakes',
    RecoveryStep.STOP_PROGRAM: 'stop the paused program',
    RecoveryStep.SEND_PROGRAM: 'send the robot program',
    RecoveryStep.PLAY: 'play the loaded program',
}

#: The manufacturer's service note forbids resetting a protective stop automatically.
_LOCKED = (
    'The robot is in a protective stop: look for the cause and remove it, then recover again with '
    'unlock_protective_stop, or unlock it on the pendant.'
)
_GUARD = 'The safeguard stop is active: close the safeguard and reset it.'
_BUTTON = 'The emergency stop is pressed: see that nobody is in danger, then release the button.'
_ENABLE = 'An enabling device is in use: release it, or choose automatic mode.'

#: The step for each safety mode; a sentence = a person has to act, None = no step.
SAFETY_STEPS: Mapping[SafetyMode, RecoveryStep | str | None] = {
    SafetyMode.NORMAL: None,
    SafetyMode.REDUCED: None,
    SafetyMode.PROTECTIVE_STOP: RecoveryStep.UNLOCK,
    SafetyMode.RECOVERY: 'The arm is outside its safety limits: move it back on the pendant.',
    SafetyMode.SAFEGUARD_STOP: _GUARD,
    SafetyMode.SYSTEM_EMERGENCY_STOP: _BUTTON,
    SafetyMode.ROBOT_EMERGENCY_STOP: _BUTTON,
    SafetyMode.VIOLATION: RecoveryStep.RESTART_SAFETY,
    SafetyMode.FAULT: RecoveryStep.RESTART_SAFETY,
    SafetyMode.VALIDATE_JOINT_ID: (
        'A joint has to be identified: follow the instructions on the pendant.'
    ),
    SafetyMode.UNDEFINED_SAFETY_MODE: 'The safety mode is unknown: check the pendant.',
    SafetyMode.AUTOMATIC_MODE_SAFEGUARD_STOP: _GUARD,
    SafetyMode.SYSTEM_THREE_POSITION_ENABLING_STOP: _ENABLE,
    SafetyMode.TP_THREE_POSITION_ENABLING_STOP: _ENABLE,
    SafetyMode.IMMI_EMERGENCY_STOP: _BUTTON,
    SafetyMode.IMMI_SAFEGUARD_STOP: _GUARD,
    SafetyMode.PROFISAFE_WAITING_FOR_PARAMETERS: (
        'The safety system waits for the PROFIsafe controller: start it.'
    ),
    SafetyMode.PROFISAFE_AUTOMATIC_MODE_SAFEGUARD_STOP: _GUARD,
    SafetyMode.PROFISAFE_SAFEGUARD_STOP: _GUARD,
    SafetyMode.PROFISAFE_EMERGENCY_STOP: _BUTTON,
    SafetyMode.SAFETY_API_SAFEGUARD_STOP: _GUARD,
}

#: The step for each robot mode (power and brakes); the values are as in :data:`SAFETY_STEPS`.
POWER_STEPS: Mapping[RobotMode, RecoveryStep | str | None] = {
    RobotMode.NO_CONTROLLER: 'The controller does not run: check the pendant.',
    RobotMode.DISCONNECTED: 'The arm is not connected to its controller: check the pendant.',
    RobotMode.CONFIRM_SAFETY: 'The safety configuration has to be confirmed on the pendant.',
    RobotMode.BOOTING: RecoveryStep.WAIT,
    RobotMode.POWER_OFF: RecoveryStep.POWER_ON,
    RobotMode.POWER_ON: RecoveryStep.WAIT,
    RobotMode.IDLE: RecoveryStep.RELEASE_BRAKES,
    RobotMode.BACKDRIVE: 'The arm is being moved by hand: end that on the pendant.',
    RobotMode.RUNNING: None,
    RobotMode.UPDATING_FIRMWARE: 'The firmware of the arm is being updated: wait for its end.',
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RecoverySituation:
    """
    Input of :func:`next_step`.

    :param message: message of the status: the next step, or the reason why the robot is refused.
    :param robot: newest state of the robot; None = not connected.
    :param program_connected: our program holds its sockets.
    :param headless: the driver uploads the program; else a program on the robot requests it.
    :param remote_control: whether clients may control the robot; None = unknown.
    :param may_unlock: a person takes responsibility for unlocking a protective stop.
    """

    connection: ConnectionState
    message: str = ''
    robot: RobotState | None = None
    program_connected: bool = False
    headless: bool = True
    remote_control: bool | None = None
    may_unlock: bool = False


@dataclass(frozen=True, slots=True)
class NextStep:
    """A step, with a sentence in case the recovery ends with this step."""

    step: RecoveryStep
    text: str = ''


def next_step(situation: RecoverySituation) -> NextStep:
    """Return the next step of the recovery."""
    if situation.connection is ConnectionState.READY:
        return NextStep(RecoveryStep.DONE, 'The robot is ready for goals.')
    if situation.connection is ConnectionState.EXECUTING:
        return _during_a_goal(situation)
    if situation.connection is ConnectionState.REFUSED:
        return NextStep(RecoveryStep.OPERATOR, situation.message)
    if situation.robot is None or situation.connection in (
        ConnectionState.DISCONNECTED,
        ConnectionState.CONNECTING,
    ):
        # Restarting the safety system may break the connection, which comes back by itself.
        return NextStep(RecoveryStep.WAIT, situation.message)
    return _unless_local(_of_robot(situation, situation.robot), situation)


def _during_a_goal(situation: RecoverySituation) -> NextStep:
    robot = situation.robot
    if robot is not None and robot.runtime_state in (RuntimeState.PAUSING, RuntimeState.PAUSED):
        return NextStep(
            RecoveryStep.OPERATOR, 'A goal is paused: resume it on the pendant, or cancel it.'
        )
    return NextStep(RecoveryStep.DONE, 'A goal is running; there is nothing to recover.')


def _of_robot(situation: RecoverySituation, robot: RobotState) -> NextStep:
    for needed in (SAFETY_STEPS[robot.safety_mode], POWER_STEPS[robot.robot_mode]):
        if isinstance(needed, str):
            return NextStep(RecoveryStep.OPERATOR, needed)
        if needed is RecoveryStep.UNLOCK and not situation.may_unlock:
            return NextStep(RecoveryStep.OPERATOR, _LOCKED)
        if needed is not None:
            return NextStep(needed)
    return _of_program(situation, robot.runtime_state)


def _of_program(situation: RecoverySituation, runtime: RuntimeState) -> NextStep:
    match runtime:
        case RuntimeState.STOPPING | RuntimeState.RESUMING:
            return NextStep(RecoveryStep.WAIT)
        case RuntimeState.PAUSING | RuntimeState.PAUSED:
            # If resumed, the program could go on with an old motion.
            return NextStep(RecoveryStep.STOP_PROGRAM)
        case RuntimeState.PLAYING if situation.program_connected:
            return NextStep(RecoveryStep.WAIT)
        case RuntimeState.PLAYING:
            return NextStep(
                RecoveryStep.OPERATOR,
                'Another program runs on the robot: stop it, or let it reach '
                'its External Control node.',
            )
        case RuntimeState.STOPPED:
            return NextStep(RecoveryStep.SEND_PROGRAM if situation.headless else RecoveryStep.PLAY)


def _unless_local(wanted: NextStep, situation: RecoverySituation) -> NextStep:
    """Leave a step to a person if the robot is in local control."""
    if situation.remote_control is False and wanted.step in STEP_NAMES:
        at_hand = (
            ''
            if wanted.step is RecoveryStep.SEND_PROGRAM
            else (f', or {STEP_NAMES[wanted.step]} on the pendant')
        )
        return NextStep(
            RecoveryStep.OPERATOR,
            f'The robot is in local control: switch it to remote control{at_hand}.',
        )
    return wanted
