# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The status of a driver, and the sentences about the next step before a goal can run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import datetime, UTC
from math import nan

from ur_cartesian_driver.motion.state.rtde_state import (
    MOVABLE_SAFETY_MODES,
    RobotMode,
    RobotState,
    RuntimeState,
    SafetyMode,
)
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.robot.lifecycle import ConnectionState


@dataclass(frozen=True, slots=True, kw_only=True)
class ConnectionStatus:
    """Progress of the connection, and the next step before a goal can run."""

    state: ConnectionState = ConnectionState.DISCONNECTED
    #: The next step before a goal can run, or the reason why the robot cannot be used, as a
    #: sentence; empty when a goal can run.
    message: str = ''
    #: The last error: its time, what happened, and the events that led to it.
    last_error: str = ''
    #: Model; software version; serial number; each is empty until the robot has reported it.
    robot_model: str = ''
    polyscope_version: str = ''
    serial_number: str = ''
    #: Whether a robot program is connected to us.
    program_running: bool = False
    #: Whether the connected program has proved that this driver rendered it.
    program_is_own: bool = False
    #: The motion version of movej and movel that the connected program reports; 0 = unknown.
    motion_version: int = 0
    calibration_known: bool = False
    #: The open ports, by the names of their parameters.
    ports: Mapping[str, int] = field(default_factory=dict)

    def not_ready(self) -> str:
        """Return the reason why no goal can run now, as a sentence; empty when a goal can run."""
        if self.state is ConnectionState.READY:
            return ''
        return self.message or f'The connection is {self.state.name}.'

    def software(self) -> tuple[int, int, int]:
        """Return major, minor and bugfix of, for example, ``5.21.0.1``; zeros while unknown."""
        if not self.polyscope_version:
            return 0, 0, 0
        return ControllerVersion.parse(self.polyscope_version).release


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkGaps:
    """
    The longest gaps since the last heartbeat of the robot loop [s].

    :param reports: between two states of the robot.
    :param keepalives: between two keepalives for the robot program.
    :param state_age: the largest age of a state of the robot when it was read.
    """

    reports: float = nan
    keepalives: float = nan
    state_age: float = nan


def motion_version_text(version: int) -> str:
    """Return a sentence about the motion version of movej and movel; 0 = unknown."""
    return {
        0: 'The motion version of the robot is unknown; plans are made for version 1.',
        1: 'The robot moves by motion version 1.',
    }.get(
        version,
        f'The robot moves by motion version {version}, but plans are made for version 1: times '
        'and blends will differ (motion_version: 1 sets version 1).',
    )


def timestamped(text: str, before: str = '') -> str:
    """
    Return a text preceded by the present time; an unchanged text keeps its previous time.

    :param before: the timestamped text that the result replaces.
    """
    if before.endswith(f' UTC: {text}'):
        return before
    return f'{datetime.now(UTC):%Y-%m-%d %H:%M:%S} UTC: {text}'


#: Modes from which the arm can be switched on, or its brakes released.
UNPOWERED_MODES = frozenset({RobotMode.POWER_OFF, RobotMode.POWER_ON, RobotMode.IDLE})


def is_stopped(robot: RobotState) -> bool:
    """Return whether the safety system keeps the arm from moving."""
    return robot.safety_mode not in MOVABLE_SAFETY_MODES


def is_paused(robot: RobotState) -> bool:
    """Return whether the program is paused; it then reads nothing until it is resumed."""
    return robot.runtime_state in (RuntimeState.PAUSING, RuntimeState.PAUSED)


def has_ended(robot: RobotState) -> bool:
    """Return whether the robot reports that no program runs, even if its sockets are open."""
    return robot.runtime_state in (RuntimeState.STOPPING, RuntimeState.STOPPED)


def required_action(
    state: ConnectionState,
    robot: RobotState | None,
    *,
    program_connected: bool,
    headless_mode: bool,
    stale: str = '',
    tcp_restore_pending: bool = False,
    program_is_ending: bool = False,
    foreign_program: bool = False,
) -> str:
    """
    Return the next step before a goal can run, as a sentence; empty when one can run.

    :param robot: newest state of the robot; None = none yet.
    :param stale: a sentence if the states of the robot are too old; empty = they are fresh.
    :param tcp_restore_pending: the TCP of the last goal has to be restored.
    :param program_is_ending: our program was told to end but is still connected.
    :param foreign_program: the robot runs a program that has not connected to us.
    """
    if state is ConnectionState.CONNECTING or robot is None:
        return (
            'The robot answers; waiting for its configuration on the primary interface '
            '(primary_port).'
        )
    if state is ConnectionState.STOPPED:
        return _needed_after_stop(robot)
    if state is not ConnectionState.CONNECTED:
        return ''
    if robot.robot_mode is not RobotMode.RUNNING:
        if robot.robot_mode in UNPOWERED_MODES:
            return (
                f'The arm is in mode {robot.robot_mode.name}; switch it on and release its '
                'brakes, then start the robot program.'
            )
        if robot.robot_mode is RobotMode.CONFIRM_SAFETY:
            return 'The robot waits for a person to confirm its safety configuration.'
        return f'The arm is in mode {robot.robot_mode.name}; wait until it can be switched on.'
    if program_connected and not has_ended(robot):
        if stale:
            return stale
        if is_paused(robot):
            return 'The robot program is paused; play it on the pendant.'
        if program_is_ending:
            return (
                'The robot program was told to end but is still connected; if it stays, stop it '
                'on the pendant.'
            )
        if tcp_restore_pending:
            return (
                'The TCP of the last goal is still active and will be restored; if this takes '
                'long, set the right one on the robot.'
            )
        return ''
    return _needed_to_start(headless_mode, foreign_program)


def _needed_to_start(headless_mode: bool, foreign_program: bool) -> str:
    """Return the sentence about starting our program."""
    if foreign_program:
        remedy = (
            'call resend_robot_program'
            if headless_mode
            else 'play a program whose External Control node calls this computer'
        )
        return (
            "Another program runs on the robot, possibly another driver's. Let it end, or "
            f'stop it; then {remedy}.'
        )
    if headless_mode:
        return 'The robot program does not run; call resend_robot_program when the arm may move.'
    return (
        'The robot program does not run; play a program with the External Control node on '
        'the pendant.'
    )


def _needed_after_stop(robot: RobotState) -> str:
    mode = robot.safety_mode.name.replace('_', ' ').lower()
    if robot.safety_mode is SafetyMode.PROTECTIVE_STOP:
        return (
            f'The robot is in a {mode}; remove the cause, unlock it, then start the robot '
            'program again.'
        )
    return (
        f'The safety system reports {mode}; clear it on the robot, then start the robot '
        'program again.'
    )
