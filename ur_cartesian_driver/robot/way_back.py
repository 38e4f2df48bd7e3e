# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goes the way of a stopped robot back, one step of the tables of recovery after the other."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Mapping

from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.protocol import primary
from ur_cartesian_driver.robot.calls import Answer, Dashboard, no, yes
from ur_cartesian_driver.robot.dashboard_calls import (
    DashboardCalls,
    Effect,
    EFFECT_TIMEOUT,
    EFFECTS,
)
from ur_cartesian_driver.robot.dashboard_client import POLYSCOPE_X, TOO_EARLY
from ur_cartesian_driver.robot.recovery import Next, next_step, Situation, Step, WORDS
from ur_cartesian_driver.robot.robot_view import LOOK, modes, Robot, until

#: How long a robot may be on its way without another step [s].
STEP_TIMEOUT = 35.0
#: The same for a robot that is not connected, and never was meanwhile [s].
LOST_TIMEOUT = 2.0
#: How long the reports of a robot may contradict each other after a change [s].
SETTLING = 0.3
#: How often an unlock that came too early is repeated [s].
REPEAT = 0.5

#: Dashboard commands of the steps of a recovery; the last one does it.
COMMANDS: Mapping[Step, tuple[str, ...]] = {
    Step.UNLOCK: ('close safety popup', 'close popup', 'unlock protective stop'),
    Step.RESTART_SAFETY: ('close safety popup', 'restart safety'),
    Step.POWER_ON: ('power on',),
    Step.RELEASE_BRAKES: ('brake release',),
    Step.STOP_PROGRAM: ('stop',),
    Step.PLAY: ('close popup', 'play'),
}
#: The same through the primary interface, where there is no dashboard.
PRIMARY: Mapping[Step, primary.Command] = {
    Step.UNLOCK: primary.Command.UNLOCK_PROTECTIVE_STOP,
    Step.POWER_ON: primary.Command.POWER_ON,
    Step.RELEASE_BRAKES: primary.Command.RUN,
    Step.STOP_PROGRAM: primary.Command.STOP_PROGRAM,
}


class WayBack:
    """One at a time."""

    def __init__(
        self,
        robot: Robot,
        dashboard: DashboardCalls,
        send_program: Callable[[], Awaitable[Answer]],
        *,
        headless: bool,
    ) -> None:
        """
        Prepare.

        :param send_program: uploads the robot program and waits until it has called.
        :param headless: that is how the program comes; else a program on the robot asks for it.
        """
        self._robot, self._dashboard = robot, dashboard
        self._send_program, self._headless = send_program, headless
        self._under_way = False

    async def go(self) -> Answer:
        """Go it to its end, or to where a person has to act; the text tells what was done."""
        if self._under_way:
            return no('A recovery is under way already.')
        self._under_way = True
        try:
            return await self._step_by_step()
        finally:
            self._under_way = False

    async def _step_by_step(self) -> Answer:
        done: list[str] = []
        remote = await self._dashboard.remote_control()
        loop = asyncio.get_running_loop()
        moved_on = loop.time()
        while True:
            following = await self._settled(remote)
            if following.step is Step.DONE:
                return yes(_report(done, following.text))
            if following.step is Step.PERSON:
                return no(_report(done, following.text))
            if following.step is Step.WAIT:
                # A robot that was never there will not come by waiting.
                lost = self._robot.robot is None and not done
                if loop.time() - moved_on > (LOST_TIMEOUT if lost else STEP_TIMEOUT):
                    return no(_report(done, following.text or modes(self._robot)))
                await asyncio.sleep(LOOK)
                continue
            if WORDS[following.step] in done:
                return no(_report(done, f'The robot needs a person: {modes(self._robot)}'))
            try:
                answer = await self._do(following.step)
            except (OSError, DriverError) as error:
                answer = no(str(error))
            if not answer.ok:
                return no(_report(done, f'Could not {WORDS[following.step]}: {answer.text}'))
            done.append(WORDS[following.step])
            moved_on = loop.time()

    async def _settled(self, remote: bool | None) -> Next:
        """
        Return the next step; one for a person only when it stays so.

        Sockets and reports of the robot tell of a change one after the other, and a program that
        has just been started has not called yet.
        """
        loop = asyncio.get_running_loop()
        following = next_step(self._situation(remote))
        end = loop.time() + SETTLING
        while following.step is Step.PERSON and loop.time() < end:
            await asyncio.sleep(LOOK)
            following = next_step(self._situation(remote))
        return following

    def _situation(self, remote: bool | None) -> Situation:
        robot = self._robot
        return Situation(
            connection=robot.status.state,
            message=robot.status.message,
            robot=robot.robot,
            program_connected=robot.program_connected,
            headless=self._headless,
            remote_control=remote,
        )

    async def _do(self, step: Step) -> Answer:
        """Do one step and wait until it is done."""
        if step is Step.SEND_PROGRAM:
            return await self._send_program()
        version = self._robot.version
        *before, command = COMMANDS[step]
        if version is not None and version.major >= POLYSCOPE_X and step in PRIMARY:
            return await self._do_without_dashboard(step, EFFECTS[command])
        for line in before:
            await self._dashboard.ask(Dashboard(command=line))
        answer = await self._dashboard.ask(Dashboard(command=command))
        while not answer.ok and TOO_EARLY in answer.text:
            await asyncio.sleep(REPEAT)
            answer = await self._dashboard.ask(Dashboard(command=command))
        if (
            answer.ok
            and step is Step.PLAY
            and not await until(
                self._robot, lambda _: self._robot.program_connected, EFFECT_TIMEOUT
            )
        ):
            return no(
                'it plays, but has not come to its External Control node within '
                f'{EFFECT_TIMEOUT:g} s.'
            )
        return answer

    async def _do_without_dashboard(self, step: Step, effect: Effect) -> Answer:
        for _ in range(2):  # an unlock is refused for 5 s after the stop
            if not self._robot.send_primary(PRIMARY[step]):
                return no('there is no connection to the primary interface of the robot.')
            if await until(self._robot, effect.seen, effect.timeout):
                return yes('')
        return no(f'the robot is not {effect.words}; {modes(self._robot)}')


def _report(done: list[str], text: str) -> str:
    """Return a sentence with what was done before."""
    return f'{text} Done: {", ".join(done)}.' if done else text
