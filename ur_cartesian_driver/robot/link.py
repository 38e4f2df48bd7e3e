# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The link to one robot: its sockets joined to the codecs, kept up by itself.

Order of things: RTDE is dialled first (it tells the software's version and streams the state),
then we listen on our own ports, then the primary interface is dialled (it tells model, geometry
and errors, and takes the robot program), then the robot program calls us: trajectory, script
command, reverse. What was dialled is dialled again when it breaks. Power, brakes and programs are
never started again by ourselves: the program is uploaded once, on the first connection, and never
over a program that runs.

Events (:mod:`~ur_cartesian_driver.motion.events`) go to one callback, in the order in which they
happened, on the event loop.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
import logging
from types import MappingProxyType
from typing import TypeVar

from ur_cartesian_driver.kinematics.robots import Geometry, MODELS
from ur_cartesian_driver.motion.errors import DriverError, ProtocolError
from ur_cartesian_driver.motion.events import Event, LinkLost, StateReceived, TrajectoryEnded
from ur_cartesian_driver.motion.state import (
    RobotMode,
    RobotState,
    RobotStatus,
    RuntimeState,
    SafetyMode,
)
from ur_cartesian_driver.program import as_program, ProgramSettings, render
from ur_cartesian_driver.protocol import primary, reverse, script_sender
from ur_cartesian_driver.protocol.reverse import TrajectoryAction
from ur_cartesian_driver.protocol.rtde import (
    ControllerVersion,
    DataReceived,
    Ready,
    RtdeClient,
    RtdeEvent,
)
from ur_cartesian_driver.protocol.trajectory import ResultDecoder
from ur_cartesian_driver.robot.lifecycle import after, Change, ConnectionState
from ur_cartesian_driver.robot.state_recipe import OPTIONAL, REQUIRED, robot_state
from ur_cartesian_driver.robot.transport import BACK_OFF, Connection, dial, Listener

T = TypeVar('T')

#: A robot that streams nothing for that long is lost [s].
RTDE_SILENCE = 1.0
#: How long the robot may take to tell its model on the primary interface [s].
REPORT_TIMEOUT = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkSettings:
    """How to reach the robot; see ``driver.DriverConfig`` for the meaning of each."""

    robot_ip: str
    ur_type: str
    rtde_port: int
    primary_port: int
    reverse_port: int
    script_sender_port: int
    trajectory_port: int
    script_command_port: int
    bind_address: str
    reverse_ip: str
    allowed_peers: tuple[str, ...]
    headless_mode: bool
    robot_receive_timeout: float
    keepalive_period: float
    rtde_frequency: float
    stop_deceleration: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkStatus:
    """How far the link is."""

    state: ConnectionState = ConnectionState.DISCONNECTED
    message: str = ''
    last_error: str = ''
    robot_model: str = ''
    polyscope_version: str = ''
    program_connected: bool = False
    calibration_known: bool = False
    has_state: bool = False
    ports: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))


class RobotLink:
    """The only owner of the driver's sockets; used from one event loop."""

    def __init__(self, settings: LinkSettings, *, on_event: Callable[[Event], None],
                 on_status: Callable[[LinkStatus], None],
                 on_geometry: Callable[[Geometry], None],
                 on_log: Callable[[int, str], None]) -> None:
        """
        Prepare; :meth:`run` connects.

        :param on_status: the status changed.
        :param on_geometry: the robot told its calibrated geometry.
        :param on_log: a line for the log, with its level.
        """
        self._settings = settings
        self._on_event, self._on_status = on_event, on_status
        self._on_geometry, self._on_log = on_geometry, on_log
        self._status = LinkStatus(message=f'Connecting to the robot at {settings.robot_ip}.')
        self._version: ControllerVersion | None = None
        self._latest: RobotState | None = None
        self._last_packet = 0.0
        self._uploaded = False
        self._program = ''
        self._rtde: Connection | None = None
        self._primary: Connection | None = None
        self._report = asyncio.Event()
        self._configuration: primary.ConfigurationData | None = None
        self._results = ResultDecoder()
        self._requests = script_sender.RequestDecoder()
        self._action = TrajectoryAction.NOOP
        self._busy = False
        self._listeners = {
            'trajectory_port': self._listener(
                'trajectory_port', self._on_trajectory_data),
            'script_command_port': self._listener('script_command_port', _ignore),
            'reverse_port': self._listener('reverse_port', _ignore),
            'script_sender_port': Listener(
                'script_sender_port', on_open=_ignore_connection, on_data=self._on_request,
                on_closed=_ignore_text, on_refused=self._warn),
        }

    # ---- commands -----------------------------------------------------------------------------

    def send_control(self, action: TrajectoryAction, count: int) -> None:
        """Send a trajectory action on the reverse socket."""
        self._send_reverse(reverse.trajectory(action, count, self._read_timeout()))

    def send_points(self, data: bytes) -> None:
        """Send points on the trajectory socket."""
        connection = self._listeners['trajectory_port'].connection
        if connection is not None:
            connection.send(data)

    def set_busy(self, busy: bool) -> None:
        """Say whether a goal runs: its keepalives are another message."""
        self._busy = busy
        self._change(Change.GOAL_STARTED if busy else Change.GOAL_ENDED)

    def stop_program(self, reason: str) -> None:
        """End the robot program, so that nothing of it can resume."""
        self._on_log(logging.WARNING, f'the robot program is stopped: {reason}')
        if self._primary is not None:
            self._primary.send(primary.command(primary.Command.STOP_PROGRAM))
        connection = self._listeners['reverse_port'].connection
        if connection is not None:
            connection.send(reverse.stop().encode())

    def upload_program(self) -> None:
        """Upload the robot program; it replaces whatever program runs."""
        if self._primary is None or not self._program:
            self._warn('the robot program cannot be sent, the robot is not connected')
            return
        self._uploaded = True
        self._primary.send(primary.upload(as_program(self._program)))

    def not_ready(self) -> str:
        """Return why no goal can run now; empty when one can."""
        if self._status.state is ConnectionState.READY:
            return ''
        return self._status.message or f'The connection is {self._status.state.name}.'

    def close(self) -> None:
        """Close everything; the robot program stops the arm, at the latest when we hang up."""
        self._send_reverse(reverse.stop())
        for listener in self._listeners.values():
            listener.close()
        for connection in (self._primary, self._rtde):
            if connection is not None:
                connection.close()

    # ---- life ---------------------------------------------------------------------------------

    async def run(self) -> None:
        """Connect, and connect again, until cancelled."""
        attempt = 0
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._keep_alive())
            while True:
                try:
                    await self._session()
                    attempt = 0
                except (OSError, DriverError) as error:
                    self._lost(str(error))
                await asyncio.sleep(BACK_OFF[min(attempt, len(BACK_OFF) - 1)])
                attempt += 1

    async def _session(self) -> None:
        """Serve one RTDE connection from its first to its last byte."""
        closed = asyncio.get_running_loop().create_future()
        client = RtdeClient(outputs=(*REQUIRED, *OPTIONAL), optional_outputs=OPTIONAL,
                            frequency=self._settings.rtde_frequency)
        ready: asyncio.Future[Ready] = asyncio.get_running_loop().create_future()
        names: list[str] = []

        def on_data(data: bytes) -> None:
            try:
                events = client.feed(data)
            except ProtocolError as error:
                _fail(ready, error)
                connection.abort(str(error))
                return
            connection.send(client.data_to_send())
            for event in events:
                if isinstance(event, Ready):
                    names[:] = event.outputs.names
                    _succeed(ready, event)
                self._on_rtde(event, names)

        def on_closed(reason: str) -> None:
            _fail(ready, OSError(f'RTDE: {reason}'))
            _succeed(closed, reason)

        connection = await dial(self._settings.robot_ip, self._settings.rtde_port, on_data,
                                on_closed)
        self._rtde = connection
        try:
            self._change(Change.ROBOT_ANSWERED)
            connection.send(client.start())
            async with asyncio.timeout(REPORT_TIMEOUT):
                self._version = (await ready).controller_version
                await self._listen(connection.local_address)
            await self._with_primary(closed)
        except TimeoutError:
            raise OSError(
                f'{self._settings.robot_ip} port {self._settings.rtde_port} does not answer as '
                'an RTDE server: is it a robot?') from None
        finally:
            self._rtde = None
            connection.close()

    async def _with_primary(self, rtde_closed: asyncio.Future[str]) -> None:
        """Hold the primary connection as long as RTDE is there, and watch RTDE's pulse."""
        primary_task = asyncio.create_task(self._hold_primary())
        watch = asyncio.create_task(self._watch_pulse())
        try:
            done, _ = await asyncio.wait(
                {primary_task, watch, rtde_closed}, return_when=asyncio.FIRST_COMPLETED)
            reason = done.pop().result()
        finally:
            for task in (primary_task, watch):
                task.cancel()
        self._lost(f'RTDE: {reason}')

    async def _watch_pulse(self) -> str:
        """Return when the robot was silent for too long."""
        loop = asyncio.get_running_loop()
        self._last_packet = loop.time()
        while loop.time() - self._last_packet < RTDE_SILENCE:  # noqa: ASYNC110 - a pulse
            await asyncio.sleep(RTDE_SILENCE / 10.0)
        return f'the robot sent nothing for {RTDE_SILENCE:g} s'

    async def _hold_primary(self) -> str:
        """Keep the primary connection up; it returns only when the robot must not be moved."""
        attempt = 0
        while True:
            closed = asyncio.get_running_loop().create_future()
            frames = primary.PrimaryDecoder()
            try:
                self._primary = await dial(
                    self._settings.robot_ip, self._settings.primary_port,
                    lambda data, frames=frames: self._on_primary_data(frames, data),  # type: ignore[misc]
                    lambda reason, closed=closed: _succeed(closed, reason))  # type: ignore[misc]
                await self._check_robot()
                attempt = 0
                self._warn(f'primary interface: {await closed}')
            except OSError as error:
                self._warn(f'primary interface: {error}')
            finally:
                if self._primary is not None:
                    self._primary.close()
                self._primary = None
            await asyncio.sleep(BACK_OFF[min(attempt, len(BACK_OFF) - 1)])
            attempt += 1

    async def _check_robot(self) -> None:
        """Wait for the robot's report of itself; take it, or refuse the robot."""
        try:
            async with asyncio.timeout(REPORT_TIMEOUT):
                await self._report.wait()
        except TimeoutError:
            raise OSError('the robot does not report its configuration') from None
        assert self._configuration is not None
        assert self._version is not None
        models = model_names(self._configuration.robot_type, self._version.major)
        expected = self._settings.ur_type
        self._update(robot_model=expected if expected in models else ' or '.join(models),
                     polyscope_version=str(self._version))
        if expected not in models:
            self._change(Change.ROBOT_REFUSED)
            self._update(message=(
                f"The robot is a {' or '.join(models)}, but ur_type is {expected}; set ur_type to "
                'the model that is there.'))
            return
        self._change(Change.ROBOT_ACCEPTED)
        self._start_program_once()

    def _start_program_once(self) -> None:
        """Upload the program on the first connection, if nothing else runs on the robot."""
        state = self._latest
        if self._uploaded or not self._settings.headless_mode or state is None:
            return
        if state.robot_mode is not RobotMode.RUNNING:
            return
        if state.robot_status & RobotStatus.PROGRAM_RUNNING:
            self._warn('another program runs on the robot; stop it, then resend the robot program')
            self._uploaded = True
            return
        self.upload_program()

    async def _listen(self, local_address: str) -> None:
        """Open our ports (once), and render the program with them."""
        s = self._settings
        host = s.bind_address or local_address
        allowed = frozenset(s.allowed_peers or (s.robot_ip, self._peer_address()))
        for name, listener in self._listeners.items():
            if listener.port == 0:
                await listener.open(host, getattr(s, name), allowed)
        ports = {name: listener.port for name, listener in self._listeners.items()}
        self._update(ports=MappingProxyType(ports))
        assert self._version is not None
        v = self._version
        self._program = render(ProgramSettings(
            host=s.reverse_ip or host, reverse_port=ports['reverse_port'],
            trajectory_port=ports['trajectory_port'],
            script_command_port=ports['script_command_port'],
            version=(v.major, v.minor, v.bugfix), stop_deceleration=s.stop_deceleration))

    def _peer_address(self) -> str:
        """Return the robot's address as a number, where robot_ip is a name."""
        return self._rtde.peer_address if self._rtde is not None else self._settings.robot_ip

    async def _keep_alive(self) -> None:
        """Send the message that keeps the robot program running, at a steady pace."""
        loop = asyncio.get_running_loop()
        due = loop.time()
        while True:
            if self._busy:
                self.send_control(TrajectoryAction.NOOP, 0)
            else:
                self._send_reverse(reverse.keepalive(self._read_timeout()))
            due = max(due + self._settings.keepalive_period, loop.time())
            await asyncio.sleep(due - loop.time())

    # ---- what comes in ------------------------------------------------------------------------

    def _on_rtde(self, event: RtdeEvent, names: list[str]) -> None:
        if not isinstance(event, DataReceived):
            return
        state = robot_state(dict(zip(names, event.values, strict=True)))
        before, self._latest = self._latest, state
        self._last_packet = asyncio.get_running_loop().time()
        if before is None or _mode_of(before) != _mode_of(state) or not self._status.has_state:
            self._update(has_state=True)
            self._follow_safety(state)
        self._on_event(StateReceived(state=state))

    def _follow_safety(self, state: RobotState) -> None:
        """Turn the robot's modes into a change of the connection, and into what is needed."""
        self._change(Change.ROBOT_STOPPED if _is_stopped(state) else Change.ROBOT_FREE)
        if self._status.state is ConnectionState.CONNECTED:
            if self._status.program_connected:
                self._change(Change.PROGRAM_CONNECTED)
            else:
                self._start_program_once()

    def _on_primary_data(self, frames: primary.PrimaryDecoder, data: bytes) -> None:
        try:
            packages = frames.feed(data)
        except ProtocolError as error:
            if self._primary is not None:
                self._primary.abort(str(error))
            return
        for frame in packages:
            if isinstance(frame, primary.RobotState):
                for package in frame.packages:
                    self._on_package(package)
            else:
                self._on_message(frame)

    def _on_package(self, package: primary.StatePackage) -> None:
        """Take what a state frame tells: who the robot is."""
        match package:
            case primary.ConfigurationData():
                self._configuration = package
                self._report.set()
            case primary.KinematicsInfo() if not self._status.calibration_known:
                self._update(calibration_known=True)
                self._on_geometry(Geometry(
                    a=package.a, d=package.d, alpha=package.alpha, theta=package.theta))

    def _on_message(self, message: primary.Frame) -> None:
        """Take what the robot has to say about errors."""
        match message:
            case primary.ErrorCodeMessage(level=level) if (
                    primary.ReportLevel.WARNING <= level <= primary.ReportLevel.CRITICAL_FAULT):
                self._error(f'the robot reports {message.label} {message.text}'.rstrip())
            case primary.RuntimeExceptionMessage():
                self._error(f'the robot program failed in line {message.line}, column '
                            f'{message.column}: {message.text}')
            case primary.TextMessage():
                self._on_log(logging.INFO, f'robot: {message.text}')

    def _on_trajectory_data(self, data: bytes) -> None:
        try:
            for result in self._results.feed(data):
                self._on_event(TrajectoryEnded(result=result))
        except ProtocolError as error:
            connection = self._listeners['trajectory_port'].connection
            if connection is not None:
                connection.abort(str(error))

    def _on_request(self, data: bytes) -> None:
        """Answer the External Control URCap that asks for the program."""
        connection = self._listeners['script_sender_port'].connection
        try:
            wanted = self._requests.feed(data)
        except ProtocolError as error:
            self._warn(f'script_sender_port: {error}')
            self._requests = script_sender.RequestDecoder()
            if connection is not None:
                connection.abort(str(error))
            return
        for _ in range(wanted):
            if connection is not None:
                connection.send(script_sender.reply(self._program))

    # ---- the program's sockets ----------------------------------------------------------------

    def _listener(self, name: str, on_data: Callable[[bytes], None]) -> Listener:
        return Listener(name, on_open=self._on_program_connection, on_data=on_data,
                        on_closed=lambda reason: self._on_program_closed(name, reason),
                        on_refused=self._warn)

    def _on_program_connection(self, connection: Connection) -> None:
        names = ('trajectory_port', 'script_command_port', 'reverse_port')
        if all(self._listeners[name].connection is not None for name in names):
            self._results = ResultDecoder()
            self._update(program_connected=True)
            self._change(Change.PROGRAM_CONNECTED)

    def _on_program_closed(self, name: str, reason: str) -> None:
        """Take the loss of one of the program's sockets as the loss of all of them."""
        self._on_event(LinkLost(link='program', reason=f'{name}: {reason}'))
        for listener in self._listeners.values():
            if listener.connection is not None and listener.name != 'script_sender_port':
                listener.connection.close('the robot program hung up on another socket')
        if self._status.program_connected:
            self._update(program_connected=False)
            self._change(Change.PROGRAM_LOST)

    def _send_reverse(self, message: reverse.ReverseMessage) -> None:
        connection = self._listeners['reverse_port'].connection
        if connection is not None and self._status.program_connected:
            connection.send(message.encode())

    def _read_timeout(self) -> int:
        return round(1000.0 * self._settings.robot_receive_timeout)

    # ---- status -------------------------------------------------------------------------------

    def _lost(self, reason: str) -> None:
        """Take note that the robot is gone, or never was there."""
        if self._status.has_state:
            self._on_event(LinkLost(link='RTDE', reason=reason))
        self._latest = None
        self._report.clear()
        self._update(has_state=False, calibration_known=False,
                     last_error=reason, message=f'No connection to the robot: {reason}.')
        self._change(Change.ROBOT_LOST)

    def _change(self, change: Change) -> None:
        state = after(self._status.state, change)
        if state is not self._status.state:
            self._update(state=state)

    def _update(self, **changes: object) -> None:
        status = replace(self._status, **changes)  # type: ignore[arg-type]
        if status.state not in (ConnectionState.DISCONNECTED, ConnectionState.REFUSED):
            status = replace(status, message=self._needed(status))
        if status != self._status:
            self._status = status
            self._on_status(status)

    def _needed(self, status: LinkStatus) -> str:
        """Return the sentence that says what is needed before a goal can run."""
        state = self._latest
        if status.state is ConnectionState.CONNECTING:
            return 'The robot answers; waiting for its report of itself.'
        if state is not None and status.state is ConnectionState.STOPPED:
            return _stopped_sentence(state)
        if status.state is ConnectionState.CONNECTED:
            if state is not None and state.robot_mode is not RobotMode.RUNNING:
                return (f'The arm is in mode {state.robot_mode.name}; switch it on and release '
                        'its brakes, then start the robot program.')
            if self._settings.headless_mode:
                return ('The robot program does not run; resend it (headless_mode) when the arm '
                        'may move.')
            return ('The robot program does not run; play a program with the External Control '
                    'node on the pendant.')
        return ''

    def _error(self, text: str) -> None:
        self._update(last_error=text)
        self._on_log(logging.ERROR, text)

    def _warn(self, text: str) -> None:
        self._on_log(logging.WARNING, text)


def model_names(robot_type: int, software_major: int) -> list[str]:
    """Return the models that report this type: a UR7e says that it is a UR5."""
    names = [name for name, model in MODELS.items() if model.wire_type == robot_type
             and (model.series == 'CB3') == (software_major < 5)]
    return names or [f'robot of the unknown type {robot_type}']


def _mode_of(state: RobotState) -> tuple[RobotMode, SafetyMode, RuntimeState]:
    return state.robot_mode, state.safety_mode, state.runtime_state


def _is_stopped(state: RobotState) -> bool:
    return state.safety_mode not in (SafetyMode.NORMAL, SafetyMode.REDUCED)


def _stopped_sentence(state: RobotState) -> str:
    mode = state.safety_mode.name.replace('_', ' ').lower()
    if state.safety_mode is SafetyMode.PROTECTIVE_STOP:
        return (f'The robot is in a {mode}; remove the cause, unlock it, then start the robot '
                'program again.')
    return (f'The safety system reports {mode}; clear it on the robot, then start the robot '
            'program again.')


def _succeed(future: asyncio.Future[T], value: T) -> None:
    if not future.done():
        future.set_result(value)


def _fail(future: asyncio.Future[Ready], error: Exception) -> None:
    if not future.done():
        future.set_exception(error)


def _ignore(_: bytes) -> None:
    """Take no notice of bytes that mean nothing to us."""


def _ignore_text(_: str) -> None:
    """Take no notice."""


def _ignore_connection(_: Connection) -> None:
    """Take no notice."""
