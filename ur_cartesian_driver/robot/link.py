# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The link to one robot: its interfaces joined into one connection that keeps itself up.

Order of things: RTDE is dialled first (it tells the software's version and streams the state),
then we listen on our own ports, then the primary interface is dialled (it tells model, geometry
and errors, and takes the robot program), then the robot program calls us. What was dialled is
dialled again when it breaks.

Power, brakes and programs are never started again by ourselves, on the first connection only
(:mod:`~.auto_start`).

Events (:mod:`~ur_cartesian_driver.motion.events`) go to one callback, in the order in which they
happened, on the event loop; a status that follows from an event is told before it, so that nobody
who hears that a goal has ended takes a lost robot for a ready one.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
import logging
from math import inf
from typing import NoReturn

from ur_cartesian_driver.kinematics.robot_models import DhTable, MODELS
from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.motion.events import Event, LinkLost, StateReceived, TrajectoryEnded
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.signals import Signals
from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.program import PROGRAM_NAME, ProgramSettings, render, wrap_in_program
from ur_cartesian_driver.protocol.client_interfaces import primary_messages as primary
from ur_cartesian_driver.protocol.client_interfaces.primary_state import ConfigurationData
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction
from ur_cartesian_driver.protocol.program.wire_dialects import NEWEST_DIALECT
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.robot.driver_status import (
    DriverStatus,
    has_ended,
    is_paused,
    is_stopped,
    required_action,
    timestamped,
)
from ur_cartesian_driver.robot.event_log import mode_changes
from ur_cartesian_driver.robot.lifecycle import ConnectionEvent, ConnectionState, next_state
from ur_cartesian_driver.robot.link_event_log import LinkEventLog
from ur_cartesian_driver.robot.link_settings import LinkSettings
from ur_cartesian_driver.robot.primary_client import PrimaryCallbacks, PrimaryClient
from ur_cartesian_driver.robot.program.auto_start import ProgramAutoStart
from ur_cartesian_driver.robot.program.program_sockets import ProgramCallbacks, ProgramSockets
from ur_cartesian_driver.robot.program.tcp_setter import TemporaryTcpSetter
from ur_cartesian_driver.robot.rtde.signal_stream import SignalStream
from ur_cartesian_driver.robot.rtde.state_stream import StateStream
from ur_cartesian_driver.robot.transport import Backoff

#: In these states nobody knows the robot, or it is the wrong one: the reason is the message.
_OUT_OF_REACH = frozenset({ConnectionState.DISCONNECTED, ConnectionState.REFUSED})

#: How long a robot has to wait for its program before the log says so [s]: a program that is on
#: its way there needs nobody's help.
LOG_DELAY = 1.0


#: How long after a loss its reasons are waited for [s]: each comes by a connection of its own.
CAUSE_TIMEOUT = 0.1


#: How long a program may hold its sockets after the robot has reported its end [s].
DEAD_PROGRAM_TIMEOUT = 0.5


class RobotLink:
    """The only owner of the driver's sockets; used from one event loop."""

    def __init__(
        self,
        settings: LinkSettings,
        *,
        on_state: Callable[[RobotState], None],
        on_event: Callable[[Event], None],
        on_status: Callable[[DriverStatus], None],
        on_geometry: Callable[[DhTable], None],
        on_log: Callable[[int, str], None],
        on_signals: Callable[[Signals], None] = lambda _: None,
        may_upload: bool = True,
    ) -> None:
        """
        Prepare; :meth:`run` connects.

        :param on_state: the robot's newest state, before any status or event that follows from
            it: who hears that the robot is ready can read where it stands.
        :param on_status: the status changed.
        :param on_geometry: the robot told its calibrated geometry.
        :param on_log: a line for the log, with its level.
        :param on_signals: inputs, outputs or tool changed.
        :param may_upload: whether the first connection to the robot is the owner's first.
        """
        self._settings = settings
        self._state_callback, self._on_event, self._on_status = on_state, on_event, on_status
        self._on_geometry, self._on_log = on_geometry, on_log
        self._signals_callback = on_signals
        self._status = DriverStatus(message=f'Connecting to the robot at {settings.robot_ip}.')
        self._version: ControllerVersion | None = None
        self._robot: RobotState | None = None
        self._signals: Signals | None = None
        #: The TCP that a goal had set is still to be put back.
        self._tcp_restore_pending = False
        #: Since when the robot reports that no program runs while one is connected [s].
        self._program_dead_since = inf
        #: The robot program that is connected was told to end.
        self._program_is_ending = False
        #: The program that runs on the robot has called us, even if it has hung up since.
        self._program_is_ours = False
        self._explain_timer: asyncio.TimerHandle | None = None
        self._primary = PrimaryClient(
            PrimaryCallbacks(
                configuration=self._on_configuration,
                geometry=self._on_kinematics,
                error=self._robot_error,
                connection_error=self._error,
                text=self._robot_text,
            )
        )
        self._program = ProgramSockets(
            settings,
            ProgramCallbacks(
                connected=self._on_program_connected,
                lost=self._on_program_lost,
                result=lambda result: self._on_event(TrajectoryEnded(result=result)),
                warning=self._warn,
            ),
        )
        self._event_log = LinkEventLog(self._program, settings.robot_receive_timeout)
        self._tcp_setter = TemporaryTcpSetter(
            self._program, self._primary, headless_mode=settings.headless_mode
        )
        self._auto_start = ProgramAutoStart(
            settings,
            pending=may_upload,
            upload=self.upload_program,
            warn=self._warn,
            power_up=lambda: self.send_primary(primary.PrimaryCommand.RUN),
        )

    # ---- what is known ------------------------------------------------------------------------

    @property
    def robot(self) -> RobotState | None:
        """What the robot reported last; None = it is not connected."""
        return self._robot

    @property
    def signals(self) -> Signals | None:
        """Its inputs, outputs and tool; None = not reported yet."""
        return self._signals

    @property
    def status(self) -> DriverStatus:
        """How far the connection is."""
        return self._status

    @property
    def version(self) -> ControllerVersion | None:
        """The software of the robot; None = it never answered."""
        return self._version

    @property
    def program_connected(self) -> bool:
        """Whether the robot program holds its sockets."""
        return self._program.connected

    @property
    def tcp_restore_pending(self) -> bool:
        """Whether the TCP of a goal is still to be put back."""
        return self._tcp_restore_pending

    def keepalive_gap(self) -> float:
        """Return the longest pause between two keepalives since the last call [s]."""
        return self._event_log.keepalive_gap()

    def event_chain(self) -> tuple[str, ...]:
        """Return what led to what has just ended, the first thing first, and how all stands."""
        return self._event_log.event_chain()

    def robot_error(self) -> str:
        """Return what the robot itself said lately is wrong; empty when it said nothing."""
        return self._event_log.robot_error()

    def explain(self, text: str) -> None:
        """Take something that has ended, and why, for the last error of the status."""
        if self._explain_timer is not None:
            self._explain_timer.cancel()
            self._explain_timer = None
        self._update_status(last_error=timestamped(f'{text} {"; ".join(self.event_chain())}.'))

    def set_serial_number(self, serial_number: str) -> None:
        """Take note of the serial number of the robot."""
        self._update_status(serial_number=serial_number)

    # ---- commands -----------------------------------------------------------------------------

    def send_control(self, action: TrajectoryAction, count: int) -> None:
        """Send a trajectory action to the robot program."""
        self._program.send_control(action, count)
        if action is TrajectoryAction.CANCEL:
            self._event_log.note('the driver sent CANCEL')

    def send_points(self, data: bytes) -> None:
        """Send points to the robot program."""
        self._program.send_points(data)

    def send_servo(self, on: bool) -> None:
        """Have the robot program enter the buffered servo, or leave it and brake."""
        self._program.send_servo(on)
        self._event_log.note('the driver entered the servo' if on else 'the driver left the servo')

    def send_command(self, data: bytes) -> bool:
        """Send a single command to the robot program; False = it is not there."""
        return self._program.send_command(data)

    def send_primary(self, command: primary.PrimaryCommand) -> bool:
        """Send a command to the primary interface; False = there is no connection."""
        return self._primary.send(primary.encode_command(command))

    def set_executing(self, busy: bool) -> None:
        """Say whether a goal runs: its keepalives are another message."""
        self._program.is_executing = busy
        if busy:
            self._apply(ConnectionEvent.GOAL_STARTED)
        else:
            self._apply(
                ConnectionEvent.GOAL_ENDED
                if self._program_reads()
                else ConnectionEvent.PROGRAM_LOST
            )

    def set_temporary_tcp(self, T_flange_tcp: Pose) -> None:
        """Have the robot program set the TCP for the time of a goal."""
        self._tcp_setter.set_temporary(T_flange_tcp)

    def restore_tcp(self, T_flange_tcp: Pose) -> None:
        """Have the TCP put back to what it was before a goal, where the robot is connected."""
        if self._robot is not None:
            self._tcp_setter.restore(T_flange_tcp, self._robot)

    def set_tcp_restore_pending(self, pending: bool) -> None:
        """Say whether the TCP is still to be put back: until it is, no goal is taken."""
        if pending == self._tcp_restore_pending:
            return
        self._tcp_restore_pending = pending
        if pending:
            self._apply(ConnectionEvent.TCP_RESTORE_PENDING)
        else:
            self._review_state()

    def stop_program(self, reason: str) -> None:
        """End the robot program, so that nothing of it can resume."""
        self._warn(f'the robot program is stopped: {reason}')
        self._event_log.note('the driver ended the robot program')
        self._program_is_ending = self._program.connected
        self._primary.send(primary.encode_command(primary.PrimaryCommand.STOP_PROGRAM))
        self._program.send_stop()

    def upload_program(self) -> None:
        """Upload the robot program, in the place of ours, never of somebody else's."""
        if self._status.state in (*_OUT_OF_REACH, ConnectionState.CONNECTING):
            self._warn(f'the robot program is not sent: {self._status.message}')
        elif self._status.state is ConnectionState.EXECUTING:
            self._warn('the robot program is not sent: a goal is running; cancel it first')
        elif self._foreign_program_runs():
            self._warn(
                'the robot program is not sent: another program runs on the robot, maybe '
                'of another driver; let it end, or stop it'
            )
        elif not self._program.text:
            self._warn(
                'the robot program is not sent: wire_dialect says that the robot has an '
                'older one of its own; play that on the pendant'
            )
        elif not self._primary.send(primary.encode_program(wrap_in_program(self._program.text))):
            self._warn(
                'the robot program is not sent: there is no connection to the primary '
                'interface of the robot'
            )
        else:
            self._event_log.note('the driver sent the robot program')

    def _foreign_program_runs(self) -> bool:
        return (
            self._robot is not None
            and not has_ended(self._robot)
            and not self._program.connected
            and not self._program_is_ours
        )

    def not_ready(self) -> str:
        """Return why no goal can run now; empty when one can."""
        return self._status.not_ready()

    def close(self) -> None:
        """Close everything; the robot program stops the arm, at the latest when we hang up."""
        if self._explain_timer is not None:
            self._explain_timer.cancel()
        self._program.close()

    # ---- life ---------------------------------------------------------------------------------

    async def run(self) -> None:
        """Connect, and connect again, until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._program.keep_alive())
            tasks.create_task(self._stay_connected())

    async def _stay_connected(self) -> NoReturn:
        retry = Backoff()
        while True:
            try:
                reason = await self._serve_connection()
                status_text = f'RTDE: {reason}'
                retry.reset()
            except (OSError, DriverError) as error:
                reason = status_text = str(error)
            self._on_robot_lost(reason, status_text)
            await retry.wait()

    async def _serve_connection(self) -> str:
        """
        Serve one RTDE connection from its first to its last byte and return why it ended.

        :raises OSError: the robot cannot be reached, or one of our ports is taken.
        :raises DriverError: the robot program cannot be made from the settings.
        """
        s = self._settings
        stream = StateStream(s.rtde_frequency, self._on_state)
        try:
            self._version = await stream.open(s.robot_ip, s.rtde_port)
            self._apply(ConnectionEvent.ROBOT_ANSWERED)
            await self._listen(stream, self._version)
            async with asyncio.TaskGroup() as tasks:
                others = [
                    tasks.create_task(self._primary.stay_connected(s.robot_ip, s.primary_port))
                ]
                if s.io_publish_rate > 0.0:
                    others.append(
                        tasks.create_task(
                            SignalStream(self._on_signals, self._warn).stay_connected(
                                s.robot_ip, s.rtde_port, s.io_publish_rate
                            )
                        )
                    )
                reason = await stream.ended()
                for task in others:
                    task.cancel()
            return reason
        finally:
            stream.close()

    async def _listen(self, stream: StateStream, version: ControllerVersion) -> None:
        """Open our ports (once), and render the program with them."""
        s = self._settings
        host = s.bind_address or stream.local_address
        await self._program.open(
            host, frozenset(s.allowed_peers or (s.robot_ip, stream.peer_address))
        )
        ports = self._program.ports
        if s.dialect is NEWEST_DIALECT:  # else the program on the robot is another one
            self._program.text = render(
                ProgramSettings(
                    host=s.reverse_ip or host,
                    reverse_port=ports['reverse_port'],
                    trajectory_port=ports['trajectory_port'],
                    script_command_port=ports['script_command_port'],
                    version=(version.major, version.minor, version.bugfix),
                    stop_deceleration=s.stop_deceleration,
                    servoj_gain=s.servoj_gain,
                    servoj_lookahead_time=s.servoj_lookahead_time,
                    servo_buffer_depth=s.servo_buffer_depth,
                    allow_freedrive=s.allow_freedrive,
                )
            )
        self._update_status(ports=ports)

    # ---- what comes in ------------------------------------------------------------------------

    def _on_state(self, robot: RobotState) -> None:
        before, self._robot = self._robot, robot
        self._state_callback(robot)
        if before is not None and _modes(before) == _modes(robot):
            # No status follows from it, and what the event leads to, a CANCEL maybe, goes first.
            self._on_event(StateReceived(state=robot))
            self._event_log.note_report(robot)
            self._track_program(robot)
            return
        self._event_log.note_report(robot)
        for change in () if before is None else mode_changes(before, robot):
            self._event_log.note(change)
        self._track_program(robot)
        self._review_state()
        self._on_event(StateReceived(state=robot))

    def _on_signals(self, signals: Signals) -> None:
        self._signals = signals
        self._signals_callback(signals)

    def _track_program(self, robot: RobotState) -> None:
        self._drop_dead_program(robot)
        if has_ended(robot):
            self._program_is_ours = False
        elif self._program.connected:
            self._program_is_ours = True

    def _drop_dead_program(self, robot: RobotState) -> None:
        """Hang up on a program that has ended without a word."""
        self._program.ended = has_ended(robot)
        if not (self._program.connected and self._program.ended):
            self._program_dead_since = inf
        else:
            self._program_dead_since = min(self._program_dead_since, robot.timestamp)
            if robot.timestamp - self._program_dead_since > DEAD_PROGRAM_TIMEOUT:
                self._program.drop('the robot reports that no program runs')

    def _on_configuration(self, configuration: ConfigurationData) -> None:
        """Take the robot's report of itself: accept the robot, or refuse it."""
        if self._status.state is not ConnectionState.CONNECTING:
            return
        assert self._version is not None
        models = model_names(configuration.robot_type, self._version.major)
        expected = self._settings.ur_type
        found = ' or '.join(models)
        if expected in models:
            self._apply(
                ConnectionEvent.ROBOT_ACCEPTED,
                robot_model=expected,
                polyscope_version=str(self._version),
            )
            self._review_state()
        else:
            self._apply(
                ConnectionEvent.ROBOT_REFUSED,
                robot_model=found,
                polyscope_version=str(self._version),
                message=f'The robot is a {found}, but ur_type is {expected}; set ur_type to the '
                'model that is there.',
            )

    def _on_kinematics(self, geometry: DhTable) -> None:
        if not self._status.calibration_known:
            self._on_geometry(geometry)
            self._update_status(calibration_known=True)

    def _on_program_connected(self) -> None:
        self._event_log.note('the robot program has connected')
        self._program_is_ending = False
        self._update_status(program_running=True)
        self._review_state()

    def _on_program_lost(self, reason: str) -> None:
        self._event_log.note(
            f'{reason}, {self._event_log.timing().keepalive:.3f} s after the last sign '
            'of life that it was sent'
        )
        if self._explain_timer is None:
            self._explain_timer = asyncio.get_running_loop().call_later(
                CAUSE_TIMEOUT, self.explain, 'The robot program is gone.'
            )
        self._tcp_setter.program_lost()
        self._apply(ConnectionEvent.PROGRAM_LOST, program_running=False)
        self._on_event(LinkLost(link='program', reason=reason))

    def _on_robot_lost(self, reason: str, status_text: str) -> None:
        """Take note that the robot is gone, or never was there; people are told by whom."""
        self._event_log.note(status_text)
        changes = (
            timestamped(status_text, self._status.last_error)
            if self._robot is None
            else timestamped(f'The robot is gone. {"; ".join(self.event_chain())}.')
        )
        before, self._robot, self._signals = self._robot, None, None
        self._program.is_paused = False  # nobody knows; too many messages are better than none
        self._apply(
            ConnectionEvent.ROBOT_LOST,
            calibration_known=False,
            last_error=changes,
            message=f'No connection to the robot: {status_text.rstrip(".")}.',
        )
        if before is not None:
            self._on_event(LinkLost(link='RTDE', reason=reason))

    # ---- status -------------------------------------------------------------------------------

    def _review_state(self) -> None:
        """Bring the connection's state in line with what robot and program are now."""
        robot = self._robot
        if robot is None:
            return
        self._apply(
            ConnectionEvent.ROBOT_STOPPED if is_stopped(robot) else ConnectionEvent.STOP_CLEARED
        )
        self._auto_start.review(robot, self._status, program_connected=self._program.connected)
        self._program.is_paused = is_paused(robot)
        if not self._program_reads():
            self._apply(ConnectionEvent.PROGRAM_PAUSED)
        elif not self._tcp_restore_pending:
            self._apply(ConnectionEvent.PROGRAM_CONNECTED)
            if self._program.is_executing:  # after a stop that the goal has outlived
                self._apply(ConnectionEvent.GOAL_STARTED)

    def _program_reads(self) -> bool:
        """Tell whether the robot program would act now on what it is sent."""
        robot = self._robot
        return (
            robot is not None
            and self._program.connected
            and not self._program_is_ending
            and not is_paused(robot)
            and not has_ended(robot)
        )

    def _apply(self, change: ConnectionEvent, **changes: object) -> None:
        """Go where the table of the life cycle leads, and tell it with other news."""
        self._update_status(state=next_state(self._status.state, change), **changes)

    def _update_status(self, **changes: object) -> None:
        # Who calls names fields; mypy cannot follow names.
        status = replace(self._status, **changes)  # type: ignore[arg-type]
        if status.state not in _OUT_OF_REACH:
            status = replace(
                status,
                message=required_action(
                    status.state,
                    self._robot,
                    program_connected=self._program.connected,
                    headless_mode=self._settings.headless_mode,
                    tcp_restore_pending=self._tcp_restore_pending,
                    program_is_ending=self._program_is_ending,
                    foreign_program=self._foreign_program_runs(),
                ),
            )
        if status != self._status:
            before, self._status = self._status, status
            self._on_status(status)
            self._log_change(before, status)

    def _log_change(self, before: DriverStatus, now: DriverStatus) -> None:
        """Write what is needed into the log, for those who do not see the status."""
        if now.message and now.message != before.message:
            if now.state is ConnectionState.CONNECTED:
                asyncio.get_running_loop().call_later(LOG_DELAY, self._log_if_still, now.message)
            else:
                self._on_log(logging.INFO, now.message)
        idle = (ConnectionState.READY, ConnectionState.EXECUTING)
        if now.state is ConnectionState.READY and before.state not in idle:
            self._on_log(logging.INFO, 'The robot program is connected: ready for goals.')

    def _log_if_still(self, message: str) -> None:
        if self._status.message == message:
            self._on_log(logging.INFO, message)

    def _robot_error(self, text: str) -> None:
        """Take what the robot says is wrong."""
        self._event_log.note(text, is_robot_error=True)
        self._error(text)

    def _robot_text(self, text: str) -> None:
        """Take a line of the robot's log; what our program says may be why something ends."""
        self._on_log(logging.INFO, f'robot: {text}')
        program, _, said = text.partition(': ')
        if program == PROGRAM_NAME and said:
            self._event_log.note(f'the robot program says: {said}')

    def _error(self, text: str) -> None:
        self._update_status(last_error=timestamped(text))
        self._on_log(logging.ERROR, text)

    def _warn(self, text: str) -> None:
        self._on_log(logging.WARNING, text)


def model_names(robot_type: int, software_major: int) -> list[str]:
    """Return the models that report this type: a UR7e says that it is a UR5."""
    names = [
        name
        for name, model in MODELS.items()
        if model.wire_type == robot_type and (model.series == 'CB3') == (software_major < 5)
    ]
    return names or [f'robot of the unknown type {robot_type}']


def _modes(robot: RobotState) -> tuple[int, int, int]:
    return robot.robot_mode, robot.safety_mode, robot.runtime_state
