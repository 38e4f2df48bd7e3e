# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Carries out what the owner of a driver asks a robot for beside motions.

Each call goes the way that the robot has for it: the dashboard, a single command to the robot
program, or RTDE inputs. It is done when the robot reports that it is, and ends within
:data:`BOUND` whatever the robot does, or within :data:`RECOVERY_BOUND`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import dist, isnan
from typing import Protocol

from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.motion.pose import angle_between, normalize, Pose
from ur_cartesian_driver.motion.signals import Signals
from ur_cartesian_driver.motion.state import RobotMode, RobotState, RuntimeState, SafetyMode
from ur_cartesian_driver.protocol import primary, script_command
from ur_cartesian_driver.protocol.rtde import ControllerVersion
from ur_cartesian_driver.robot import rtde_inputs
from ur_cartesian_driver.robot.calls import (
    Answer,
    Call,
    Dashboard,
    DashboardLine,
    Recover,
    SendProgram,
    SetOutput,
    SetPayload,
    SetSpeedSlider,
    SetTcp,
    ZeroFtSensor,
)
from ur_cartesian_driver.robot.dashboard_client import (
    DashboardClient,
    explain,
    POLYSCOPE_X,
    TOO_EARLY,
    why_not_available,
)
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.recovery import Next, next_step, Situation, Step, WORDS
from ur_cartesian_driver.robot.settings import LinkSettings
from ur_cartesian_driver.robot.status import DriverStatus

#: No call takes longer [s], but Recover, which takes several steps.
BOUND = 40.0
RECOVERY_BOUND = 120.0
#: How long the robot may take to do what it is asked for [s]: powering up takes a while.
POWER_TIMEOUT = 30.0
EFFECT_TIMEOUT = 5.0
SETTING_TIMEOUT = 1.0
#: How long a robot may be on its way without another step, in a recovery [s].
STEP_TIMEOUT = 35.0
#: The same for a robot that is not connected, and never was meanwhile [s].
LOST_TIMEOUT = 2.0
#: How long the reports of a robot may contradict each other after a change [s].
SETTLING = 0.3
#: How often an effect is looked for, and an unlock that came too early repeated [s].
LOOK, REPEAT = 0.02, 0.5
#: How far a TCP may be from the one that was set [m], [rad]: it goes through 32-bit integers.
TCP_TOLERANCE = 1e-5
#: The same of mass and centre of gravity [kg, m].
PAYLOAD_TOLERANCE = 1e-4

_FREE = (SafetyMode.NORMAL, SafetyMode.REDUCED)


class Robot(Protocol):
    """What is known of a robot, and the ways to it that belong to others."""

    @property
    def robot(self) -> RobotState | None:
        """What it reported last; None = it is not connected."""

    @property
    def status(self) -> DriverStatus:
        """How far the connection is."""

    @property
    def version(self) -> ControllerVersion | None:
        """Its software; None = it never answered."""

    @property
    def signals(self) -> Signals | None:
        """Its inputs, outputs and payload; None = not reported yet."""

    @property
    def program_connected(self) -> bool:
        """Whether the robot program holds its sockets."""

    @property
    def tcp_owed(self) -> bool:
        """Whether the TCP of a goal is still to be put back."""

    def send_primary(self, command: primary.Command) -> bool:
        """Send a command to the primary interface; False = there is no connection."""

    def send_command(self, data: bytes) -> bool:
        """Send a single command to the robot program; False = it is not there."""

    def upload_program(self) -> None:
        """Upload the robot program."""


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
        lambda r: r.robot_mode in (RobotMode.IDLE, RobotMode.RUNNING), POWER_TIMEOUT, 'IDLE'),
    'power off': Effect(
        lambda r: r.robot_mode is RobotMode.POWER_OFF, EFFECT_TIMEOUT, 'POWER_OFF'),
    'brake release': Effect(
        lambda r: r.robot_mode is RobotMode.RUNNING, POWER_TIMEOUT, 'RUNNING'),
    'unlock protective stop': Effect(
        lambda r: r.safety_mode is not SafetyMode.PROTECTIVE_STOP, EFFECT_TIMEOUT, 'unlocked'),
    'restart safety': Effect(
        lambda r: r.safety_mode not in (SafetyMode.VIOLATION, SafetyMode.FAULT), POWER_TIMEOUT,
        'restarted'),
    'play': Effect(
        lambda r: r.runtime_state is RuntimeState.PLAYING, EFFECT_TIMEOUT, 'PLAYING'),
    'pause': Effect(
        lambda r: r.runtime_state is RuntimeState.PAUSED, EFFECT_TIMEOUT, 'PAUSED'),
    'stop': Effect(
        lambda r: r.runtime_state is RuntimeState.STOPPED, EFFECT_TIMEOUT, 'STOPPED'),
}

#: Dashboard commands that only ask: also a robot that must not be moved answers them.
QUESTIONS = frozenset({
    'running', 'robotmode', 'safetymode', 'safetystatus', 'get loaded program', 'isProgramSaved',
    'programState', 'PolyscopeVersion', 'version', 'getUserRole', 'get operational mode',
    'is in remote control', 'get serial number', 'get robot model'})

#: Dashboard commands that change how the arm moves, or where it is thought to be.
DISTURBING = frozenset({'load', 'load installation', 'restart safety'})

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


class CallDesk:
    """Answers calls, from one event loop; several at a time, but one recovery."""

    def __init__(self, settings: LinkSettings, dashboard_port: int, robot: Robot) -> None:
        """Prepare; nothing is sent before the first call."""
        self._settings = settings
        self._robot = robot
        self._dashboard = DashboardClient(settings.robot_ip, dashboard_port)
        self._recovering = False
        self._settings_under_way = 0

    @property
    def is_setting(self) -> bool:
        """Tell whether something that a goal counts on is being set right now."""
        return self._settings_under_way > 0

    async def answer(self, call: Call) -> Answer:
        """Carry out a call; what goes wrong is an answer too."""
        bound = RECOVERY_BOUND if isinstance(call, Recover) else BOUND
        try:
            async with asyncio.timeout(bound):
                return self._refusal(call) or await self._carry_out(call)
        except TimeoutError:
            return _no(f'The robot has not done it within {bound:g} s.')
        except (OSError, DriverError) as error:
            return _no(f"{str(error).rstrip('.')}.")

    async def _carry_out(self, call: Call) -> Answer:
        match call:
            case Dashboard():
                return await self._ask_dashboard(call)
            case DashboardLine():
                return await self._ask_raw(call)
            case SetTcp() | SetPayload():
                return await self._set(call)
            case ZeroFtSensor():
                return self._command(script_command.ZeroFtSensor()) or _yes(
                    'The robot program was told to zero the force sensor.')
            case SetOutput():
                return await self._write(rtde_inputs.output(call), 'The output is set.')
            case SetSpeedSlider():
                return await self._write(
                    rtde_inputs.speed_slider(call),
                    f'The speed slider is at {call.fraction:.0%}.')
            case SendProgram():
                return await self._send_program()
            case Recover():
                return await self._recover()

    def _refusal(self, call: Call) -> Answer | None:
        """Refuse what must not be done now."""
        status = self._robot.status
        if isinstance(call, Dashboard) and call.command in QUESTIONS:
            return None
        if status.state is ConnectionState.REFUSED:
            return _no(status.message)
        if isinstance(call, SetTcp) and self._robot.tcp_owed:
            return _no('The TCP that a goal has lent is being put back; try again when the status '
                       'is READY.')
        if status.state is ConnectionState.EXECUTING and (
                isinstance(call, SetTcp | SetPayload | SendProgram)
                or (isinstance(call, Dashboard) and call.command in DISTURBING)):
            return _no('A goal is running, and this would disturb it; wait for its end or cancel '
                       'it, then try again.')
        return None

    # ---- dashboard ----------------------------------------------------------------------------

    async def _ask_dashboard(self, call: Dashboard) -> Answer:
        version = self._robot.version
        if version is not None and (reason := why_not_available(call.command, version)):
            return _no(reason)
        reply = await self._dashboard.ask(call.command, call.argument)
        if not reply.ok:
            return _no(explain(call.command, reply.text, self._robot.robot,
                               await self._remote_control()))
        effect = EFFECTS.get(call.command)
        if effect is not None and not await self._until(effect.seen, effect.timeout):
            return _no(f'The robot answers {reply.text!r}, but is not {effect.words} after '
                       f'{effect.timeout:g} s: {self._modes()}')
        return _yes(reply.value or reply.text)

    async def _ask_raw(self, call: DashboardLine) -> Answer:
        version = self._robot.version
        if version is not None and (reason := why_not_available('quit', version)):
            return _no(reason)
        return _yes(await self._dashboard.ask_raw(call.line))

    async def _remote_control(self) -> bool | None:
        """Return whether clients may control the robot; None = it cannot be known."""
        version = self._robot.version
        if version is None or why_not_available('is in remote control', version):
            return None
        try:
            reply = await self._dashboard.ask('is in remote control')
        except (OSError, DriverError):
            return None
        return {'true': True, 'false': False}.get(reply.value or '')

    # ---- robot program ------------------------------------------------------------------------

    def _command(self, command: script_command.Command) -> Answer | None:
        """Send a command to the robot program; an answer only if it cannot be sent."""
        robot = self._robot.robot
        if robot is not None and robot.runtime_state is not RuntimeState.PLAYING:
            return _no(f'The robot program does not read commands now, it is '
                       f'{robot.runtime_state.name}. {self._robot.status.message}'.rstrip())
        if not self._robot.send_command(script_command.encode(command)):
            return _no('The robot program does not run, and it is what does this. '
                       f'{self._robot.status.message}'.rstrip())
        return None

    async def _set(self, call: SetTcp | SetPayload) -> Answer:
        """Set something; no goal begins meanwhile."""
        self._settings_under_way += 1
        try:
            return await (self._set_tcp(call) if isinstance(call, SetTcp)
                          else self._set_payload(call))
        finally:
            self._settings_under_way -= 1

    async def _set_tcp(self, call: SetTcp) -> Answer:
        wanted = Pose(call.T_flange_tcp.position, normalize(call.T_flange_tcp.quaternion))

        def seen(robot: RobotState) -> bool:
            there = robot.T_flange_tcp
            return (dist(there.position, wanted.position) < TCP_TOLERANCE
                    and angle_between(there.quaternion, wanted.quaternion) < TCP_TOLERANCE)

        refusal = self._command(script_command.SetTcpOffset(offset=wanted.rotation_vector()))
        if refusal is not None:
            return refusal
        if await self._until(seen, SETTING_TIMEOUT):
            return _yes('The TCP is set.')
        return _no(f'The robot does not report the new TCP within {SETTING_TIMEOUT:g} s.')

    async def _set_payload(self, call: SetPayload) -> Answer:
        refusal = self._command(script_command.SetPayload(mass=call.mass, cog=call.cog))
        if refusal is not None:
            return refusal
        signals = self._robot.signals
        if signals is None or isnan(signals.payload):
            return _yes('The payload was sent; the software of the robot does not report it.')
        if await self._until(lambda _: self._carries(call), SETTING_TIMEOUT):
            return _yes('The payload is set.')
        return _no(f'The robot does not report the new payload within {SETTING_TIMEOUT:g} s.')

    def _carries(self, call: SetPayload) -> bool:
        signals = self._robot.signals
        return signals is not None and dist(
            (signals.payload, *signals.payload_cog), (call.mass, *call.cog)) < PAYLOAD_TOLERANCE

    async def _send_program(self) -> Answer:
        if not self._settings.headless_mode:
            return _no('The parameter headless_mode is false: play a program with External '
                       'Control on the pendant.')
        if self._robot.robot is None:
            return _no(self._robot.status.message)
        self._robot.upload_program()
        if await self._until(lambda _: self._robot.status.state is ConnectionState.READY,
                             EFFECT_TIMEOUT):
            return _yes('The robot program runs.')
        return _no(f'The robot program has not called within {EFFECT_TIMEOUT:g} s. '
                   f'{self._robot.status.message}'.rstrip())

    # ---- RTDE inputs --------------------------------------------------------------------------

    async def _write(self, writing: rtde_inputs.Writing, success: str) -> Answer:
        if await rtde_inputs.write(self._settings.robot_ip, self._settings.rtde_port, writing):
            return _yes(success)
        return _no('The robot took the value, but does not report it within '
                   f'{rtde_inputs.EFFECT_TIMEOUT:g} s.')

    # ---- recovery -----------------------------------------------------------------------------

    async def _recover(self) -> Answer:
        if self._recovering:
            return _no('A recovery is under way already.')
        self._recovering = True
        try:
            return await self._step_by_step()
        finally:
            self._recovering = False

    async def _step_by_step(self) -> Answer:
        done: list[str] = []
        remote = await self._remote_control()
        loop = asyncio.get_running_loop()
        moved_on = loop.time()
        while True:
            following = await self._settled(remote)
            if following.step is Step.DONE:
                return _yes(_report(done, following.text))
            if following.step is Step.PERSON:
                return _no(_report(done, following.text))
            if following.step is Step.WAIT:
                # A robot that was never there will not come by waiting.
                lost = self._robot.robot is None and not done
                if loop.time() - moved_on > (LOST_TIMEOUT if lost else STEP_TIMEOUT):
                    return _no(_report(done, following.text or self._modes()))
                await asyncio.sleep(LOOK)
                continue
            if WORDS[following.step] in done:
                return _no(_report(done, f'The robot needs a person: {self._modes()}'))
            answer = await self._do(following.step)
            if not answer.ok:
                return _no(_report(done, f'Could not {WORDS[following.step]}: {answer.text}'))
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
            connection=robot.status.state, message=robot.status.message, robot=robot.robot,
            program_connected=robot.program_connected, headless=self._settings.headless_mode,
            remote_control=remote)

    async def _do(self, step: Step) -> Answer:
        """Do one step and wait until it is done."""
        if step is Step.SEND_PROGRAM:
            return await self._send_program()
        version = self._robot.version
        *before, command = COMMANDS[step]
        if version is not None and version.major >= POLYSCOPE_X and step in PRIMARY:
            return await self._do_without_dashboard(step, EFFECTS[command])
        for line in before:
            await self._ask_dashboard(Dashboard(command=line))
        answer = await self._ask_dashboard(Dashboard(command=command))
        while not answer.ok and TOO_EARLY in answer.text:
            await asyncio.sleep(REPEAT)
            answer = await self._ask_dashboard(Dashboard(command=command))
        if answer.ok and step is Step.PLAY and not await self._until(
                lambda _: self._robot.program_connected, EFFECT_TIMEOUT):
            return _no('it plays, but has not come to its External Control node within '
                       f'{EFFECT_TIMEOUT:g} s.')
        return answer

    async def _do_without_dashboard(self, step: Step, effect: Effect) -> Answer:
        for _ in range(2):  # an unlock is refused for 5 s after the stop
            if not self._robot.send_primary(PRIMARY[step]):
                return _no('there is no connection to the primary interface of the robot.')
            if await self._until(effect.seen, effect.timeout):
                return _yes('')
        return _no(f'the robot is not {effect.words}; {self._modes()}')

    # ---- what comes of it ---------------------------------------------------------------------

    async def _until(self, seen: Callable[[RobotState], bool], within: float) -> bool:
        """Wait until the robot reports something; a robot that is lost may come back."""
        loop = asyncio.get_running_loop()
        end = loop.time() + within
        while loop.time() < end:
            robot = self._robot.robot
            if robot is not None and seen(robot):
                return True
            await asyncio.sleep(LOOK)
        return False

    def _modes(self) -> str:
        robot = self._robot.robot
        if robot is None:
            return f'{self._robot.status.message}'
        return (f'robot mode {robot.robot_mode.name}, safety mode {robot.safety_mode.name}, '
                f'program {robot.runtime_state.name}.')


def _yes(text: str) -> Answer:
    return Answer(ok=True, text=text)


def _no(text: str) -> Answer:
    return Answer(ok=False, text=text)


def _report(done: list[str], text: str) -> str:
    """Return a sentence with what was done before."""
    return f'{text} Done: {", ".join(done)}.' if done else text
