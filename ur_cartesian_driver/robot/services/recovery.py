# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Brings a stopped robot back to READY, step by step, by the tables in `recovery_steps`."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping

from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.protocol.client_interfaces import primary_messages as primary
from ur_cartesian_driver.robot.link import RobotLink
from ur_cartesian_driver.robot.services.dashboard_connection import (
    is_too_early,
    unavailable_reason,
)
from ur_cartesian_driver.robot.services.dashboard_service import (
    DashboardService,
    EFFECT_TIMEOUT,
    EXPECTED_EFFECTS,
    ExpectedEffect,
)
from ur_cartesian_driver.robot.services.polling import (
    describe_modes,
    POLL_PERIOD,
    wait_for_state,
)
from ur_cartesian_driver.robot.services.recovery_steps import (
    next_step,
    NextStep,
    RecoverySituation,
    RecoveryStep,
    STEP_NAMES,
)
from ur_cartesian_driver.robot.services.service_calls import (
    DashboardCall,
    failed,
    ServiceAnswer,
    succeeded,
)

#: Longest wait for the robot while it allows no step [s].
STEP_TIMEOUT = 35.0
#: The same, for a robot that has not been connected since the recovery began [s].
DISCONNECTED_TIMEOUT = 2.0
#: Time in which the reports of a robot may contradict each other after a change [s].
SETTLING_TIMEOUT = 0.3
#: Period and longest total time of the attempts to unlock, while they come too early [s].
UNLOCK_RETRY_PERIOD, UNLOCK_TIMEOUT = 0.5, 6.0

#: Dashboard commands of the steps of a recovery; the last command is the step itself.
STEP_COMMANDS: Mapping[RecoveryStep, tuple[str, ...]] = {
    RecoveryStep.UNLOCK: ('close safety popup', 'close popup', 'unlock protective stop'),
    RecoveryStep.RESTART_SAFETY: ('close safety popup', 'restart safety'),
    RecoveryStep.POWER_ON: ('power on',),
    RecoveryStep.RELEASE_BRAKES: ('brake release',),
    RecoveryStep.STOP_PROGRAM: ('stop',),
    RecoveryStep.PLAY: ('close popup', 'play'),
}
#: Commands to the primary interface, for steps whose dashboard command the robot lacks.
PRIMARY_COMMANDS: Mapping[RecoveryStep, primary.PrimaryCommand] = {
    RecoveryStep.UNLOCK: primary.PrimaryCommand.UNLOCK_PROTECTIVE_STOP,
    RecoveryStep.POWER_ON: primary.PrimaryCommand.POWER_ON,
    RecoveryStep.RELEASE_BRAKES: primary.PrimaryCommand.RUN,
    RecoveryStep.STOP_PROGRAM: primary.PrimaryCommand.STOP_PROGRAM,
}


class RecoveryRunner:
    """Runs one recovery at a time."""

    def __init__(
        self,
        link: RobotLink,
        dashboard: DashboardService,
        send_program: Callable[[], Awaitable[ServiceAnswer]],
        *,
        headless: bool,
    ) -> None:
        """
        Prepare.

        :param send_program: uploads the robot program and waits until it has connected.
        :param headless: the driver uploads the program; else a program on the robot requests it.
        """
        self._link, self._dashboard = link, dashboard
        self._send_program, self._headless = send_program, headless
        self._is_running = False

    async def run(self, *, may_unlock: bool) -> ServiceAnswer:
        """
        Recover until READY, or until a person has to act; the text lists the steps done.

        :param may_unlock: whether a person takes responsibility for unlocking a protective stop.
        """
        if self._is_running:
            return failed('A recovery is running already.')
        self._is_running = True
        try:
            return await self._step_by_step(may_unlock)
        finally:
            self._is_running = False

    async def _step_by_step(self, may_unlock: bool) -> ServiceAnswer:
        done: list[str] = []
        remote = await self._dashboard.remote_control()

        def situation() -> RecoverySituation:
            return self._situation(remote, may_unlock)

        loop = asyncio.get_running_loop()
        last_step_time = loop.time()
        was_connected = False
        while True:
            was_connected = was_connected or self._link.robot is not None
            upcoming = await self._settled_step(situation)
            if upcoming.step is RecoveryStep.DONE:
                return succeeded(_report(done, upcoming.text))
            if upcoming.step is RecoveryStep.OPERATOR:
                return failed(_report(done, upcoming.text))
            if upcoming.step is RecoveryStep.WAIT:
                timeout = STEP_TIMEOUT if was_connected else DISCONNECTED_TIMEOUT
                if loop.time() - last_step_time > timeout:
                    return failed(_report(done, upcoming.text or describe_modes(self._link)))
                await asyncio.sleep(POLL_PERIOD)
                continue
            if STEP_NAMES[upcoming.step] in done:
                return failed(
                    _report(done, f'An operator has to act: {describe_modes(self._link)}')
                )
            try:
                answer = await self._do(upcoming.step)
            except (OSError, DriverError) as error:
                answer = failed(str(error))
            if not answer.ok:
                return failed(
                    _report(done, f'Could not {STEP_NAMES[upcoming.step]}: {answer.text}')
                )
            done.append(STEP_NAMES[upcoming.step])
            last_step_time = loop.time()

    async def _settled_step(self, situation: Callable[[], RecoverySituation]) -> NextStep:
        """
        Return the next step; before one for a person, wait for reports that make it unnecessary.

        Sockets and robot state show a change at different times, and a program that has just been
        started has not connected yet.
        """
        loop = asyncio.get_running_loop()
        upcoming = next_step(situation())
        end = loop.time() + SETTLING_TIMEOUT
        while upcoming.step is RecoveryStep.OPERATOR and loop.time() < end:
            await asyncio.sleep(POLL_PERIOD)
            upcoming = next_step(situation())
        return upcoming

    def _situation(self, remote: bool | None, may_unlock: bool) -> RecoverySituation:
        link = self._link
        return RecoverySituation(
            connection=link.status.state,
            message=link.status.message,
            robot=link.robot,
            program_connected=link.program.connected,
            headless=self._headless,
            remote_control=remote,
            may_unlock=may_unlock,
        )

    async def _do(self, step: RecoveryStep) -> ServiceAnswer:
        """Carry out one step and wait for its effect."""
        if step is RecoveryStep.SEND_PROGRAM:
            return await self._send_program()
        version = self._link.version
        *before, command = STEP_COMMANDS[step]
        if (
            version is not None
            and unavailable_reason(command, version)
            and step in PRIMARY_COMMANDS
        ):
            return await self._do_without_dashboard(step, EXPECTED_EFFECTS[command])
        for line in before:
            await self._dashboard.request(DashboardCall(command=line))
        answer = await self._dashboard.request(DashboardCall(command=command))
        end = asyncio.get_running_loop().time() + UNLOCK_TIMEOUT
        while (
            not answer.ok
            and is_too_early(command, answer.text)
            and asyncio.get_running_loop().time() < end
        ):
            await asyncio.sleep(UNLOCK_RETRY_PERIOD)
            answer = await self._dashboard.request(DashboardCall(command=command))
        if (
            answer.ok
            and step is RecoveryStep.PLAY
            and not await wait_for_state(
                self._link, lambda _: self._link.program.connected, EFFECT_TIMEOUT
            )
        ):
            return failed(
                'the program runs, but did not reach its External Control node within '
                f'{EFFECT_TIMEOUT:g} s.'
            )
        return answer

    async def _do_without_dashboard(
        self, step: RecoveryStep, effect: ExpectedEffect
    ) -> ServiceAnswer:
        # The robot refuses an unlock until 5 s after the stop. The wait for the effect is as
        # long, so the second attempt comes late enough.
        for _ in range(2):
            if not self._link.control.send_primary(
                PRIMARY_COMMANDS[step],
                lambda: self._link.robot is not None and not effect.is_reached(self._link.robot),
            ):
                return failed('there is no connection to the primary interface of the robot.')
            if await wait_for_state(self._link, effect.is_reached, effect.timeout):
                return succeeded('')
        return failed(f'the robot is not {effect.target_mode}; {describe_modes(self._link)}')


def _report(done: list[str], text: str) -> str:
    """Return a sentence, followed by the steps done."""
    return f'{text} Done: {", ".join(done)}.' if done else text
