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
from math import dist, isnan

from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.motion.pose import angle_between, normalize, Pose
from ur_cartesian_driver.motion.state import RobotState, RuntimeState
from ur_cartesian_driver.protocol import script_command
from ur_cartesian_driver.robot import rtde_inputs
from ur_cartesian_driver.robot.calls import (
    Answer,
    Call,
    Dashboard,
    DashboardLine,
    no,
    Recover,
    SendProgram,
    SetOutput,
    SetPayload,
    SetSpeedSlider,
    SetTcp,
    yes,
    ZeroFtSensor,
)
from ur_cartesian_driver.robot.dashboard_calls import DashboardCalls, EFFECT_TIMEOUT
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.robot_view import Robot, until
from ur_cartesian_driver.robot.settings import LinkSettings
from ur_cartesian_driver.robot.way_back import WayBack

#: No call takes longer [s], but Recover, which takes several steps.
BOUND = 40.0
RECOVERY_BOUND = 120.0
#: How long a setting may take to be reported [s].
SETTING_TIMEOUT = 1.0
#: How far a TCP may be from the one that was set [m], [rad]: it goes through 32-bit integers.
TCP_TOLERANCE = 1e-5
#: The same of mass and centre of gravity [kg, m].
PAYLOAD_TOLERANCE = 1e-4

#: The first software of robots with a force sensor.
E_SERIES = 5

#: Dashboard commands that only ask: also a robot that must not be moved answers them.
QUESTIONS = frozenset(
    {
        'running',
        'robotmode',
        'safetymode',
        'safetystatus',
        'get loaded program',
        'isProgramSaved',
        'programState',
        'PolyscopeVersion',
        'version',
        'getUserRole',
        'get operational mode',
        'is in remote control',
        'get serial number',
        'get robot model',
    }
)

#: Dashboard commands that change how the arm moves, or where it is thought to be.
DISTURBING = frozenset({'load', 'load installation', 'restart safety'})


class CallDesk:
    """Answers calls, from one event loop; several at a time, but one recovery."""

    def __init__(self, settings: LinkSettings, dashboard_port: int, robot: Robot) -> None:
        """Prepare; nothing is sent before the first call."""
        self._settings = settings
        self._robot = robot
        self._dashboard = DashboardCalls(settings.robot_ip, dashboard_port, robot)
        self._way_back = WayBack(
            robot, self._dashboard, self._send_program, headless=settings.headless_mode
        )
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
            return no(f'The robot has not done it within {bound:g} s.')
        except (OSError, DriverError) as error:
            return no(f'{str(error).rstrip(".")}.')

    async def _carry_out(self, call: Call) -> Answer:
        match call:
            case Dashboard():
                return await self._dashboard.ask(call)
            case DashboardLine():
                return await self._dashboard.ask_raw(call)
            case SetTcp() | SetPayload():
                return await self._set(call)
            case ZeroFtSensor():
                return self._zero_ftsensor()
            case SetOutput():
                return await self._write(rtde_inputs.output(call), 'The output is set.')
            case SetSpeedSlider():
                return await self._write(
                    rtde_inputs.speed_slider(call), f'The speed slider is at {call.fraction:.0%}.'
                )
            case SendProgram():
                return await self._send_program()
            case Recover():
                return await self._way_back.go()

    def _refusal(self, call: Call) -> Answer | None:
        """Refuse what must not be done now."""
        status = self._robot.status
        if isinstance(call, Dashboard) and call.command in QUESTIONS:
            return None
        if status.state is ConnectionState.REFUSED:
            return no(status.message)
        if isinstance(call, SetTcp) and self._robot.tcp_owed:
            return no(
                'The TCP that a goal has lent is being put back; try again when the status '
                'is READY.'
            )
        if status.state is ConnectionState.EXECUTING and (
            isinstance(call, SetTcp | SetPayload | SendProgram)
            or (isinstance(call, Dashboard) and call.command in DISTURBING)
        ):
            return no(
                'A goal is running, and this would disturb it; wait for its end or cancel '
                'it, then try again.'
            )
        return None

    # ---- robot program ------------------------------------------------------------------------

    def _command(self, command: script_command.Command) -> Answer | None:
        """Send a command to the robot program; an answer only if it cannot be sent."""
        robot = self._robot.robot
        if robot is not None and robot.runtime_state is not RuntimeState.PLAYING:
            return no(
                f'The robot program does not read commands now, it is '
                f'{robot.runtime_state.name}. {self._robot.status.message}'.rstrip()
            )
        if not self._robot.send_command(script_command.encode(command)):
            return no(
                'The robot program does not run, and it is what does this. '
                f'{self._robot.status.message}'.rstrip()
            )
        return None

    def _zero_ftsensor(self) -> Answer:
        version = self._robot.version
        if version is not None and version.major < E_SERIES:
            return no(
                f'A CB3 robot (software {version}) has no force sensor to be zeroed: '
                'it works forces out from the currents of its joints.'
            )
        return self._command(script_command.ZeroFtSensor()) or yes(
            'The robot program was told to zero the force sensor.'
        )

    async def _set(self, call: SetTcp | SetPayload) -> Answer:
        """Set something; no goal begins meanwhile."""
        self._settings_under_way += 1
        try:
            return await (
                self._set_tcp(call) if isinstance(call, SetTcp) else self._set_payload(call)
            )
        finally:
            self._settings_under_way -= 1

    async def _set_tcp(self, call: SetTcp) -> Answer:
        wanted = Pose(call.T_flange_tcp.position, normalize(call.T_flange_tcp.quaternion))

        def seen(robot: RobotState) -> bool:
            there = robot.T_flange_tcp
            return (
                dist(there.position, wanted.position) < TCP_TOLERANCE
                and angle_between(there.quaternion, wanted.quaternion) < TCP_TOLERANCE
            )

        refusal = self._command(script_command.SetTcpOffset(offset=wanted.rotation_vector()))
        if refusal is not None:
            return refusal
        if await until(self._robot, seen, SETTING_TIMEOUT):
            return yes('The TCP is set.')
        return no(
            f'The robot does not report the new TCP within {SETTING_TIMEOUT:g} s: its '
            'program may not know that command, or its software not report TCPs; set it on '
            'the pendant.'
        )

    async def _set_payload(self, call: SetPayload) -> Answer:
        refusal = self._command(script_command.SetPayload(mass=call.mass, cog=call.cog))
        if refusal is not None:
            return refusal
        signals, rate = self._robot.signals, self._settings.io_publish_rate
        if signals is None:
            return yes(
                'The payload was sent; nothing reports it while inputs and outputs are not '
                'reported (io_publish_rate).'
            )
        if isnan(signals.payload):
            return yes('The payload was sent; the software of the robot does not report it.')
        within = SETTING_TIMEOUT + 1.0 / rate
        if await until(self._robot, lambda _: self._carries(call), within):
            return yes('The payload is set.')
        return no(
            f'The robot does not report the new payload within {within:g} s: its program '
            'may not know that command; set it on the pendant.'
        )

    def _carries(self, call: SetPayload) -> bool:
        signals = self._robot.signals
        return (
            signals is not None
            and dist((signals.payload, *signals.payload_cog), (call.mass, *call.cog))
            < PAYLOAD_TOLERANCE
        )

    async def _send_program(self) -> Answer:
        if not self._settings.headless_mode:
            return no(
                'The parameter headless_mode is false: play a program with External '
                'Control on the pendant.'
            )
        if self._robot.robot is None:
            return no(self._robot.status.message)
        replaces = self._robot.program_connected
        self._robot.upload_program()
        if replaces:  # its predecessor hangs up first
            await until(self._robot, lambda _: not self._robot.program_connected, SETTING_TIMEOUT)
        if await until(
            self._robot,
            lambda _: self._robot.status.state is ConnectionState.READY,
            EFFECT_TIMEOUT,
        ):
            return yes('The robot program runs.')
        needed = self._robot.status.message
        if await self._dashboard.remote_control() is False:
            needed = 'The robot is in local control: switch it to remote control, then try again.'
        return no(
            f'The robot program has not called within {EFFECT_TIMEOUT:g} s. {needed}'.rstrip()
        )

    # ---- RTDE inputs --------------------------------------------------------------------------

    async def _write(self, writing: rtde_inputs.Writing, success: str) -> Answer:
        if await rtde_inputs.write(self._settings.robot_ip, self._settings.rtde_port, writing):
            return yes(success)
        return no(
            'The robot took the value, but does not report it within '
            f'{rtde_inputs.EFFECT_TIMEOUT:g} s; is it in local control, or does something '
            'else set the same?'
        )
