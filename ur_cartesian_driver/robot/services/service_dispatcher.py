# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Carries out the service calls of a driver's owner.

A call uses the dashboard, a single command to the robot program, the primary interface, or RTDE
inputs. It succeeds once the robot reports the effect, if the robot can report it. A call ends
within :data:`CALL_TIMEOUT`, a recovery within :data:`RECOVERY_TIMEOUT`, a script or a report
within :data:`CALL_TIMEOUT` plus its own timeout (:data:`REPORT_TIMEOUTS`); a watch for contact
lasts until it is ended.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from math import dist, isnan

from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.motion.geometry.pose import angle_between, normalize, Pose
from ur_cartesian_driver.motion.geometry.vectors import vector6, ZERO6
from ur_cartesian_driver.motion.state.io_signals import Signals
from ur_cartesian_driver.motion.state.rtde_state import RobotState, RuntimeState
from ur_cartesian_driver.program.render import has_feature
from ur_cartesian_driver.protocol.program import script_command
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.link import RobotLink
from ur_cartesian_driver.robot.link_settings import LinkSettings
from ur_cartesian_driver.robot.program.program_tracker import NEEDS_OWN_PROGRAM
from ur_cartesian_driver.robot.services import rtde_input_writer
from ur_cartesian_driver.robot.services import service_calls as calls
from ur_cartesian_driver.robot.services.dashboard_connection import REPORT_TIMEOUTS
from ur_cartesian_driver.robot.services.dashboard_service import (
    DashboardPorts,
    DashboardService,
    EFFECT_TIMEOUT,
)
from ur_cartesian_driver.robot.services.polling import wait_for_state
from ur_cartesian_driver.robot.services.program_files import ProgramFiles
from ur_cartesian_driver.robot.services.recovery import RecoveryRunner
from ur_cartesian_driver.robot.services.service_calls import (
    failed,
    ServiceAnswer,
    ServiceCall,
    succeeded,
)

#: Longest duration of a call [s].
CALL_TIMEOUT = 40.0
#: Longest duration of a recovery, which has several steps [s].
RECOVERY_TIMEOUT = 120.0
#: Longest wait for the robot to report a setting [s].
SETTING_TIMEOUT = 1.0
#: Largest error of the reported TCP [m, rad], which is rounded to 32-bit integers on the wire.
TCP_TOLERANCE = 1e-5
#: Largest error of the reported payload: mass [kg], centre of gravity [m], inertia [kg m^2].
PAYLOAD_TOLERANCE = 1e-4
#: Largest error of the reported gravity [m/s^2].
GRAVITY_TOLERANCE = 1e-4

#: The first major software version of robots that may have a force sensor.
E_SERIES = 5

#: Dashboard commands that only query: they are allowed even if the robot must not be moved.
QUERY_COMMANDS = frozenset(
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

#: Dashboard commands that disturb a running goal.
INTERFERING_COMMANDS = frozenset(
    {
        'load',
        'load installation',
        'restart safety',
        'set operational mode',
        'clear operational mode',
    }
)


class ServiceDispatcher:
    """Carries out calls on one event loop: several at a time, but only one recovery."""

    def __init__(self, settings: LinkSettings, ports: DashboardPorts, link: RobotLink) -> None:
        """Prepare; nothing is sent before the first call."""
        self._settings = settings
        self._link = link
        self._dashboard = DashboardService(settings.robot_ip, ports, link)
        self._program_files = ProgramFiles(settings.robot_ip, ports.robot_api, link)
        self._recovery = RecoveryRunner(
            link, self._dashboard, self._send_program, headless=settings.headless_mode
        )
        self._run_script = self._refuse_script
        if settings.allow_scripts:
            # Imported here, because most drivers do not need the parser of URScript.
            from ur_cartesian_driver.robot.services.script_runner import ScriptRunner

            self._run_script = ScriptRunner(settings, link, self._send_program).run
        self._pending_settings = 0
        #: Keeps the order: a call that ends a watch waits for an earlier call that begins one.
        self._order_of_watches = asyncio.Lock()

    @property
    def is_changing_settings(self) -> bool:
        """Return whether TCP, payload or gravity is being set."""
        return self._pending_settings > 0

    async def dispatch(self, call: ServiceCall) -> ServiceAnswer:
        """Carry out a call; errors become answers."""
        if isinstance(call, calls.WatchContactCall):
            return self._refusal(call) or await self._execute(call)
        bound = RECOVERY_TIMEOUT if isinstance(call, calls.RecoverCall) else CALL_TIMEOUT
        if isinstance(call, calls.RunScriptCall):
            bound += call.timeout
        elif isinstance(call, calls.DashboardCall):
            bound += REPORT_TIMEOUTS.get(call.command, 0.0)
        try:
            async with asyncio.timeout(bound):
                return self._refusal(call) or await self._execute(call)
        except TimeoutError:
            return failed(f'The robot did not complete the call within {bound:g} s.')
        except (OSError, DriverError) as error:
            return failed(f'{str(error).rstrip(".")}.')

    async def _refuse_script(self, call: calls.RunScriptCall) -> ServiceAnswer:
        return failed('The parameter allow_scripts is false: no scripts of others are run.')

    async def _execute(self, call: ServiceCall) -> ServiceAnswer:
        match call:
            case calls.DashboardCall():
                return await self._dashboard.request(call)
            case calls.DashboardLineCall():
                return await self._dashboard.request_raw(call)
            case (
                calls.ListProgramsCall() | calls.UploadProgramCall() | calls.DownloadProgramCall()
            ):
                return await self._program_files.carry_out(call)
            case calls.SetTcpCall():
                return await self._set(self._set_tcp(call))
            case calls.SetPayloadCall():
                return await self._set(self._set_payload(call))
            case calls.SetGravityCall():
                return await self._set(self._set_gravity(call))
            case calls.ZeroFtSensorCall():
                return self._zero_ftsensor()
            case calls.SetOutputCall():
                return await self._write(
                    rtde_input_writer.output_write(call), 'The output is set.'
                )
            case calls.SetSpeedSliderCall():
                return await self._write(
                    rtde_input_writer.speed_slider_write(call),
                    f'The speed slider is at {call.fraction:.0%}.',
                )
            case calls.WatchContactCall():
                return await self._watch_contact()
            case calls.EndContactWatchCall():
                async with self._order_of_watches:
                    self._link.contact_watch.end()
                return succeeded('The watch for contact is being ended.')
            case calls.SendProgramCall():
                return await self._send_program()
            case calls.HandBackCall():
                return await self._hand_back()
            case calls.RunScriptCall():
                return await self._run_script(call)
            case calls.RecoverCall(unlock_protective_stop=unlock):
                return await self._recovery.run(
                    may_unlock=unlock or self._settings.unlock_protective_stops
                )

    def _refusal(self, call: ServiceCall) -> ServiceAnswer | None:
        """Return the refusal of a call that is not allowed now; None = it is allowed."""
        status = self._link.status
        if isinstance(call, calls.ListProgramsCall | calls.DownloadProgramCall) or (
            isinstance(call, calls.DashboardCall) and call.command in QUERY_COMMANDS
        ):
            return None
        if status.state is ConnectionState.REFUSED:
            return failed(status.message)
        if isinstance(call, calls.SetTcpCall) and self._link.control.tcp_restore_pending:
            return failed(
                'The TCP of the last goal is being restored; try again when the status is READY.'
            )
        if status.state is ConnectionState.EXECUTING and (
            isinstance(call, calls.SettingCall | calls.SendProgramCall | calls.HandBackCall)
            or (isinstance(call, calls.DashboardCall) and call.command in INTERFERING_COMMANDS)
        ):
            return failed(
                'A goal is running, and this would disturb it; wait for its end or cancel '
                'it, then try again.'
            )
        return None

    # ---- robot program ------------------------------------------------------------------------

    def _command(self, command: script_command.AnyScriptCommand) -> ServiceAnswer | None:
        """Send a command to the robot program; return an answer only if it cannot be sent."""
        if refusal := self._paused():
            return refusal
        if not self._link.program.send_command(script_command.encode(command)):
            return failed(
                'This needs the robot program, which does not run. '
                f'{self._link.status.message}'.rstrip()
            )
        return None

    def _paused(self) -> ServiceAnswer | None:
        """Return a refusal if the program is not playing: it would act on a command only later."""
        robot = self._link.robot
        if robot is None or robot.runtime_state is RuntimeState.PLAYING:
            return None
        return failed(
            f'The robot program is {robot.runtime_state.name} and does not read commands. '
            f'{self._link.status.message}'.rstrip()
        )

    def _zero_ftsensor(self) -> ServiceAnswer:
        version = self._link.version
        if version is not None and version.major < E_SERIES:
            return failed(
                f'A CB3 robot (software {version}) has no force sensor to zero: it estimates '
                'forces from the currents of its joints.'
            )
        return self._command(script_command.ZeroFtSensorCommand()) or succeeded(
            'The command to zero the force sensor was sent.'
        )

    async def _watch_contact(self) -> ServiceAnswer:
        """Answer at contact, or when the watch has ended without one."""
        link, version = self._link, self._link.version
        if version is not None and version.major < E_SERIES:
            return failed(
                f'A CB3 robot (software {version}) has no watch for contact: the manufacturer '
                'offers it from the e-Series on.'
            )
        if refusal := self._paused():
            return refusal
        try:
            async with self._order_of_watches:
                is_own = await link.control.tracker.wait_for_identity()
                if not link.program.connected:
                    return failed(
                        f'Only the robot program can watch for contact. {link.status.message}'
                    )
                if not is_own:
                    # Other programs report no result for a goal that contact stops.
                    return failed(f'This is a watch for contact, {NEEDS_OWN_PROGRAM}')
                outcome = link.contact_watch.begin()
            touched = await outcome
        except DriverError as error:
            return failed(str(error))
        if not touched:
            return failed('The watch was ended before the tool touched.')
        if link.robot is None:
            return succeeded('The tool touched.')
        x, y, z = link.robot.actual_tcp_pose.position
        return succeeded(f'The tool touched at x {x:.4f}, y {y:.4f}, z {z:.4f} m in base.')

    async def _set(self, setting: Awaitable[ServiceAnswer]) -> ServiceAnswer:
        """Carry out a change of TCP, payload or gravity; no goal starts meanwhile."""
        self._pending_settings += 1
        try:
            return await setting
        finally:
            self._pending_settings -= 1

    async def _set_tcp(self, call: calls.SetTcpCall) -> ServiceAnswer:
        wanted = Pose(call.T_flange_tcp.position, normalize(call.T_flange_tcp.quaternion))

        def is_reported(robot: RobotState) -> bool:
            there = robot.T_flange_tcp
            return (
                dist(there.position, wanted.position) < TCP_TOLERANCE
                and angle_between(there.quaternion, wanted.quaternion) < TCP_TOLERANCE
            )

        refusal = self._command(
            script_command.SetTcpOffsetCommand(offset=wanted.rotation_vector())
        )
        if refusal is not None:
            return refusal
        if await wait_for_state(self._link, is_reported, SETTING_TIMEOUT):
            return succeeded('The TCP is set.')
        return failed(
            f'The robot does not report the new TCP within {SETTING_TIMEOUT:g} s: its '
            'program may not know the command, or its software may not report the TCP; set it '
            'on the pendant.'
        )

    async def _set_payload(self, call: calls.SetPayloadCall) -> ServiceAnswer:
        inertia = vector6(call.inertia or ZERO6)
        command: script_command.AnyScriptCommand
        if call.is_point_mass:
            command = script_command.SetPayloadCommand(mass=call.mass, cog=call.cog)
        elif not has_feature('target_payload', self._link.status.software()):
            return failed(
                f'The software of the robot ({self._link.status.polyscope_version}) knows neither '
                'inertia nor transition_time, which PolyScope 5 has from 5.10 on; leave both out.'
            )
        else:
            command = script_command.SetTargetPayloadCommand(
                mass=call.mass,
                cog=call.cog,
                inertia=inertia,
                transition_time=call.transition_time,
            )

        def is_reported(signals: Signals) -> bool:
            there = (signals.payload, *signals.payload_cog, *signals.payload_inertia)
            wanted = (call.mass, *call.cog, *inertia)
            return all(
                isnan(a) or abs(a - b) < PAYLOAD_TOLERANCE
                for a, b in zip(there, wanted, strict=True)
            )

        return await self._set_reported(
            'payload', command, lambda signals: signals.payload, is_reported, call.transition_time
        )

    async def _set_gravity(self, call: calls.SetGravityCall) -> ServiceAnswer:
        return await self._set_reported(
            'gravity',
            script_command.SetGravityCommand(gravity=call.gravity),
            lambda signals: signals.gravity[0],
            lambda signals: dist(signals.gravity, call.gravity) < GRAVITY_TOLERANCE,
        )

    async def _set_reported(
        self,
        name: str,
        command: script_command.AnyScriptCommand,
        sample: Callable[[Signals], float],
        is_reported: Callable[[Signals], bool],
        transition: float = 0.0,
    ) -> ServiceAnswer:
        """
        Send a setting, and wait until the packets of inputs and outputs report it.

        :param sample: returns one of the reported numbers, NaN if the robot does not report them.
        :param transition: time over which the controller changes to the setting [s].
        """
        refusal = self._command(command)
        if refusal is not None:
            return refusal
        signals, rate = self._link.signals, self._settings.io_publish_rate
        if signals is None:
            return succeeded(
                f'The {name} was sent, but cannot be confirmed: the robot does not report inputs '
                'and outputs (io_publish_rate).'
            )
        if isnan(sample(signals)):
            return succeeded(
                f'The {name} was sent, but cannot be confirmed: the software of the robot does '
                'not report it.'
            )

        def is_set(_: RobotState) -> bool:
            return (newest := self._link.signals) is not None and is_reported(newest)

        within = SETTING_TIMEOUT + transition + 1.0 / rate
        if await wait_for_state(self._link, is_set, within):
            return succeeded(f'The {name} is set.')
        return failed(
            f'The robot does not report the new {name} within {within:g} s: its program '
            'may not know the command; set it on the pendant.'
        )

    async def _send_program(self) -> ServiceAnswer:
        if not self._settings.headless_mode:
            return failed(
                'The parameter headless_mode is false: play a program with External '
                'Control on the pendant.'
            )
        if self._link.robot is None:
            return failed(self._link.status.message)
        replaces = self._link.program.connected
        self._link.control.upload()
        if replaces:  # the previous program disconnects first
            await wait_for_state(
                self._link, lambda _: not self._link.program.connected, SETTING_TIMEOUT
            )
        if await wait_for_state(
            self._link,
            lambda _: self._link.status.state is ConnectionState.READY,
            EFFECT_TIMEOUT,
        ):
            return succeeded('The robot program runs.')
        needed = self._link.status.message
        if await self._dashboard.remote_control() is False:
            needed = 'The robot is in local control: switch it to remote control, then try again.'
        return failed(
            f'The robot program did not connect within {EFFECT_TIMEOUT:g} s. {needed}'.rstrip()
        )

    async def _hand_back(self) -> ServiceAnswer:
        program = self._link.program
        if not program.connected:
            return failed(
                f'The driver does not control the arm. {self._link.status.message}'.rstrip()
            )
        if refusal := self._paused():
            return refusal
        program.send_stop()
        if not await wait_for_state(self._link, lambda _: not program.connected, SETTING_TIMEOUT):
            return failed(
                f'The robot program has not ended within {SETTING_TIMEOUT:g} s; stop it on the '
                'pendant.'
            )
        if self._settings.headless_mode:
            return succeeded('The robot program has ended; resend_robot_program starts it again.')
        return succeeded(
            'The program of the pendant goes on behind its External Control node; the arm comes '
            'back when it reaches that node again.'
        )

    # ---- RTDE inputs --------------------------------------------------------------------------

    async def _write(
        self, input_write: rtde_input_writer.InputWrite, success: str
    ) -> ServiceAnswer:
        if await rtde_input_writer.write_inputs(
            self._settings.robot_ip, self._settings.rtde_port, input_write
        ):
            return succeeded(success)
        return failed(
            'The robot accepted the value, but did not report it within '
            f'{rtde_input_writer.EFFECT_TIMEOUT:g} s; is it in local control, or does another '
            'client set the same?'
        )
