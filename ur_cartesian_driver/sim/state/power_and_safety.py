# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Power and safety of the simulated arm, as two state machines.

Power goes up step by step, POWER_OFF -> POWER_ON -> IDLE -> RUNNING. The last two steps take time,
so a command only sets the mode to reach. Power goes off at once.

The controller carries out the demands of the safety system: a protective stop brakes the arm on
its path and pauses the program, an emergency stop does the same and then cuts the power (a
category 1 stop), a violation or fault cuts the power at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum
from math import ceil

from ur_cartesian_driver.motion.state.rtde_state import RobotMode, SafetyMode, SafetyStatus


class SafetyEvent(Enum):
    """An event that the safety system reacts to."""

    PROTECTIVE_STOP = 'protective stop'
    #: Unlock by pendant or dashboard, refused until the unlock delay has passed.
    UNLOCK = 'unlock protective stop'
    #: Unlock by a line on the primary interface or by the Robot API, without the unlock delay.
    UNLOCK_BY_LINE = 'set unlock protective stop'
    EMERGENCY_STOP = 'emergency stop'
    RELEASE = 'release the emergency stop'
    SAFEGUARD_STOP = 'safeguard stop'
    SAFEGUARD_RESET = 'reset the safeguard stop'
    VIOLATION = 'violation'
    FAULT = 'fault'
    RESTART = 'restart safety'


_STOP_TRANSITIONS = {
    SafetyEvent.PROTECTIVE_STOP: SafetyMode.PROTECTIVE_STOP,
    SafetyEvent.SAFEGUARD_STOP: SafetyMode.SAFEGUARD_STOP,
    SafetyEvent.EMERGENCY_STOP: SafetyMode.ROBOT_EMERGENCY_STOP,
    SafetyEvent.VIOLATION: SafetyMode.VIOLATION,
    SafetyEvent.FAULT: SafetyMode.FAULT,
}
_POWER_CUT_TRANSITIONS = {
    event: _STOP_TRANSITIONS[event]
    for event in (SafetyEvent.EMERGENCY_STOP, SafetyEvent.VIOLATION, SafetyEvent.FAULT)
}

#: Safety mode -> event -> next safety mode; an event that is not in the table is refused.
SAFETY_TRANSITIONS: Mapping[SafetyMode, Mapping[SafetyEvent, SafetyMode]] = {
    SafetyMode.NORMAL: _STOP_TRANSITIONS,
    SafetyMode.REDUCED: _STOP_TRANSITIONS,
    SafetyMode.PROTECTIVE_STOP: {
        **_POWER_CUT_TRANSITIONS,
        SafetyEvent.UNLOCK: SafetyMode.NORMAL,
        SafetyEvent.UNLOCK_BY_LINE: SafetyMode.NORMAL,
    },
    SafetyMode.SAFEGUARD_STOP: {
        **_POWER_CUT_TRANSITIONS,
        SafetyEvent.SAFEGUARD_RESET: SafetyMode.NORMAL,
    },
    SafetyMode.ROBOT_EMERGENCY_STOP: {SafetyEvent.RELEASE: SafetyMode.NORMAL},
    SafetyMode.VIOLATION: {SafetyEvent.RESTART: SafetyMode.NORMAL},
    SafetyMode.FAULT: {SafetyEvent.RESTART: SafetyMode.NORMAL},
}

#: The status bits that RTDE reports in addition to the safety mode.
STATUS_BITS: Mapping[SafetyMode, SafetyStatus] = {
    SafetyMode.NORMAL: SafetyStatus.NORMAL_MODE,
    SafetyMode.REDUCED: SafetyStatus.REDUCED_MODE,
    SafetyMode.PROTECTIVE_STOP: SafetyStatus.PROTECTIVE_STOPPED
    | SafetyStatus.STOPPED_DUE_TO_SAFETY,
    SafetyMode.RECOVERY: SafetyStatus.RECOVERY_MODE,
    SafetyMode.SAFEGUARD_STOP: SafetyStatus.SAFEGUARD_STOPPED | SafetyStatus.STOPPED_DUE_TO_SAFETY,
    SafetyMode.ROBOT_EMERGENCY_STOP: SafetyStatus.ROBOT_EMERGENCY_STOPPED
    | SafetyStatus.EMERGENCY_STOPPED
    | SafetyStatus.STOPPED_DUE_TO_SAFETY,
    SafetyMode.VIOLATION: SafetyStatus.VIOLATION | SafetyStatus.STOPPED_DUE_TO_SAFETY,
    SafetyMode.FAULT: SafetyStatus.FAULT | SafetyStatus.STOPPED_DUE_TO_SAFETY,
}

#: Modes in which the arm may move.
OPERATIONAL = frozenset({SafetyMode.NORMAL, SafetyMode.REDUCED})
#: Modes in which the power of the motors is cut, at the latest when the arm stands still.
POWERLESS = frozenset(
    {
        SafetyMode.ROBOT_EMERGENCY_STOP,
        SafetyMode.SYSTEM_EMERGENCY_STOP,
        SafetyMode.VIOLATION,
        SafetyMode.FAULT,
    }
)

_POWER_SEQUENCE = (RobotMode.POWER_OFF, RobotMode.POWER_ON, RobotMode.IDLE, RobotMode.RUNNING)


class SafetySystem:
    """The safety mode, and the time at which it began."""

    def __init__(self, unlock_delay: float) -> None:
        """
        Begin in NORMAL.

        :param unlock_delay: time after a protective stop during which an unlock is refused [s].
        """
        self.mode = SafetyMode.NORMAL
        self._unlock_delay = unlock_delay
        self._since = 0.0

    def step(self, event: SafetyEvent, now: float) -> str:
        """
        Process an event; return the reason for a refusal, else an empty string.

        :param now: the controller's clock [s].
        """
        target = SAFETY_TRANSITIONS.get(self.mode, {}).get(event)
        if target is None:
            return f'{event.value} is not possible in safety mode {self.mode.name}'
        wait = self._unlock_delay - (now - self._since)
        if event is SafetyEvent.UNLOCK and wait > 1e-9:
            return (
                f'a protective stop cannot be unlocked for {self._unlock_delay:g} s after it '
                f'happened; wait another {ceil(10.0 * wait - 1e-6) / 10.0:g} s'
            )
        self.mode, self._since = target, now
        return ''


class ArmPower:
    """The power of the arm: the present robot mode and the commanded robot mode."""

    def __init__(self, mode: RobotMode, power_on_time: float, brake_release_time: float) -> None:
        """Begin in a robot mode; the steps to IDLE and to RUNNING take these times [s]."""
        self.mode = mode
        self._goal = mode
        self._times = {
            RobotMode.POWER_OFF: 0.0,
            RobotMode.POWER_ON: power_on_time,
            RobotMode.IDLE: brake_release_time,
        }
        self._since = 0.0

    def on(self, now: float) -> None:
        """Go to IDLE; an arm that is RUNNING stays RUNNING."""
        self._raise_goal(RobotMode.IDLE, now)

    def release_brakes(self, now: float) -> None:
        """Go to RUNNING, through the modes between."""
        self._raise_goal(RobotMode.RUNNING, now)

    def off(self) -> None:
        """Cut the power at once."""
        self.mode = self._goal = RobotMode.POWER_OFF

    def _raise_goal(self, goal: RobotMode, now: float) -> None:
        if self.mode == self._goal:
            self._since = now
        self._goal = max(self._goal, goal)

    def step(self, now: float) -> None:
        """Go one mode towards the commanded one, if the time of the present mode is over."""
        if self.mode < self._goal and now - self._since >= self._times[self.mode]:
            self.mode, self._since = _POWER_SEQUENCE[_POWER_SEQUENCE.index(self.mode) + 1], now
