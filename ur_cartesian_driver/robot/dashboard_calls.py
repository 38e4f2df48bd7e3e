# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Commands of the dashboard as calls: possible, done, and seen to be done."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.motion.state import RobotMode, RobotState, RuntimeState, SafetyMode
from ur_cartesian_driver.robot.calls import Answer, Dashboard, DashboardLine, no, yes
from ur_cartesian_driver.robot.dashboard_client import DashboardClient, explain, why_not_available
from ur_cartesian_driver.robot.robot_view import modes, Robot, until

#: How long the robot may take to do what it is asked for [s]: powering up takes a while.
POWER_TIMEOUT = 30.0
EFFECT_TIMEOUT = 5.0


@dataclass(frozen=True, slots=True)
class Effect:
    """How it is seen that the robot has done something."""

    seen: Callable[[RobotState], bool]
    timeout: float
    #: What it shall be, for the sentence that says that it is not.
    words: str


#: Dashboard commands that take a while, by what they lead to.
EFFECTS: Mapping[str, Effect] = {
    'power on': Effect(
        lambda r: r.robot_mode in (RobotMode.IDLE, RobotMode.RUNNING), POWER_TIMEOUT, 'IDLE'
    ),
    'power off': Effect(
        lambda r: r.robot_mode is RobotMode.POWER_OFF, EFFECT_TIMEOUT, 'POWER_OFF'
    ),
    'brake release': Effect(lambda r: r.robot_mode is RobotMode.RUNNING, POWER_TIMEOUT, 'RUNNING'),
    'unlock protective stop': Effect(
        lambda r: r.safety_mode is not SafetyMode.PROTECTIVE_STOP, EFFECT_TIMEOUT, 'unlocked'
    ),
    'restart safety': Effect(
        lambda r: r.safety_mode not in (SafetyMode.VIOLATION, SafetyMode.FAULT),
        POWER_TIMEOUT,
        'restarted',
    ),
    'play': Effect(lambda r: r.runtime_state is RuntimeState.PLAYING, EFFECT_TIMEOUT, 'PLAYING'),
    'pause': Effect(lambda r: r.runtime_state is RuntimeState.PAUSED, EFFECT_TIMEOUT, 'PAUSED'),
    'stop': Effect(lambda r: r.runtime_state is RuntimeState.STOPPED, EFFECT_TIMEOUT, 'STOPPED'),
}


class DashboardCalls:
    """The dashboard of a robot, from one event loop; several calls at a time."""

    def __init__(self, host: str, port: int, robot: Robot) -> None:
        """Prepare; every call connects by itself."""
        self._client = DashboardClient(host, port)
        self._robot = robot

    async def ask(self, call: Dashboard) -> Answer:
        """Give a command, and wait until the robot has done it."""
        version = self._robot.version
        if version is not None and (reason := why_not_available(call.command, version)):
            return no(reason)
        reply = await self._client.ask(call.command, call.argument)
        if not reply.ok:
            return no(
                explain(call.command, reply.text, self._robot.robot, await self.remote_control())
            )
        effect = EFFECTS.get(call.command)
        if effect is not None and not await until(self._robot, effect.seen, effect.timeout):
            return no(
                f'The robot answers {reply.text!r}, but is not {effect.words} after '
                f'{effect.timeout:g} s: {modes(self._robot)}'
            )
        return yes(reply.value or reply.text)

    async def ask_raw(self, call: DashboardLine) -> Answer:
        """Send any line and return the one that comes back."""
        version = self._robot.version
        if version is not None and (reason := why_not_available('quit', version)):
            return no(reason)
        return yes(await self._client.ask_raw(call.line))

    async def remote_control(self) -> bool | None:
        """Return whether clients may control the robot; None = it cannot be known."""
        version = self._robot.version
        if version is None or why_not_available('is in remote control', version):
            return None
        try:
            reply = await self._client.ask('is in remote control')
        except (OSError, DriverError):
            return None
        return {'true': True, 'false': False}.get(reply.value or '')
