# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The link to one robot: joins its interfaces into one connection that reconnects by itself.

The link first connects to RTDE (which reports the version of the software and streams the state),
opens its own ports, connects to the primary interface (which reports model, geometry and errors,
and accepts the robot program), and then waits for the robot program to connect.

Commands go through :mod:`~.program.program_control`. The arm is powered and the program is started
automatically on the first connection only (:mod:`~.program.auto_start`).

Events (:mod:`~ur_cartesian_driver.motion.events`) go to one callback, in the order in which they
happened, on the event loop. The status that an event causes is reported before the event, so a
goal never ends while a lost robot is still READY.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
import logging
from math import inf, isfinite
from typing import NoReturn

from ur_cartesian_driver.kinematics.robot_models import DhTable, JointLimits, MODELS
from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.motion.events import (
    ContactWatchChanged,
    Event,
    LinkLost,
    StateReceived,
    TrajectoryEnded,
)
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.state.io_signals import Signals
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.motion.state.state_age import explain_age, StaleStates
from ur_cartesian_driver.program import PROGRAM_NAME
from ur_cartesian_driver.protocol.client_interfaces.primary_state import ConfigurationData
from ur_cartesian_driver.protocol.program.reverse import NO_OVERRIDE
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.robot.connection_status import (
    ConnectionStatus,
    is_paused,
    is_stopped,
    motion_version_text,
    required_action,
    timestamped,
)
from ur_cartesian_driver.robot.event_log import EventLog, mode_changes
from ur_cartesian_driver.robot.lifecycle import ConnectionEvent, ConnectionState
from ur_cartesian_driver.robot.link_settings import LinkSettings
from ur_cartesian_driver.robot.link_status import LinkStatus
from ur_cartesian_driver.robot.primary_client import PrimaryCallbacks, PrimaryClient
from ur_cartesian_driver.robot.program.contact_watch import ContactWatch
from ur_cartesian_driver.robot.program.program_control import ProgramControl
from ur_cartesian_driver.robot.program.program_sockets import ProgramCallbacks, ProgramSockets
from ur_cartesian_driver.robot.rtde.signal_stream import SignalStream
from ur_cartesian_driver.robot.rtde.state_stream import StateStream
from ur_cartesian_driver.robot.transport import Backoff

#: Time after the loss of the program in which other connections may report the cause [s].
CAUSE_TIMEOUT = 0.1


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkCallbacks:
    """Callbacks to the owner of a link; all are called on the event loop."""

    #: The robot's newest state; called before any status or event that follows from this state, so
    #: the owner has a state when READY is reported.
    state: Callable[[RobotState], None]
    #: An event for the running goal.
    event: Callable[[Event], None]
    #: The status changed.
    status: Callable[[ConnectionStatus], None]
    #: The robot reported its calibrated geometry.
    geometry: Callable[[DhTable], None]
    #: The robot reported the limits of its joints; called before the robot is accepted.
    limits: Callable[[JointLimits], None]
    #: A line for the log: its level and its text.
    log: Callable[[int, str], None]
    #: Inputs, outputs or tool changed.
    signals: Callable[[Signals], None] = lambda _: None


class RobotLink:
    """Owns all sockets of the driver to the robot; use it from one event loop."""

    def __init__(
        self, settings: LinkSettings, callbacks: LinkCallbacks, *, may_upload: bool = True
    ) -> None:
        """
        Create the interfaces; :meth:`run` connects them.

        :param may_upload: whether the first connection may start the robot program. The driver
            passes True in its first robot loop, and in a later loop if the program ran when the
            previous loop was lost.
        """
        self._settings, self._callbacks = settings, callbacks
        self._status = LinkStatus(
            f'Connecting to the robot at {settings.robot_ip}.',
            self._required_action,
            callbacks.status,
            callbacks.log,
        )
        #: Software version of the robot; None = the robot has never answered.
        self.version: ControllerVersion | None = None
        #: The robot's newest state; None = the robot is not connected.
        self.robot: RobotState | None = None
        #: Time of the newest state [s].
        self._state_time = inf
        #: Tells whether the newest state is too old.
        self._stale = StaleStates(settings.max_state_age)
        #: The robot's inputs, outputs and tool; None = not reported yet.
        self.signals: Signals | None = None
        #: Whether the robot was in remote control when last asked; None = never asked.
        self._remote_control: bool | None = None
        self._explain_timer: asyncio.TimerHandle | None = None
        self._primary = PrimaryClient(
            PrimaryCallbacks(
                configuration=self._on_configuration,
                geometry=self._on_kinematics,
                error=self._on_robot_error,
                connection_error=self._status.error,
                failures=self._warn,
                text=self._on_robot_text,
            )
        )
        self.program = ProgramSockets(
            settings,
            ProgramCallbacks(
                connected=self._on_program_connected,
                lost=self._on_program_lost,
                result=lambda result: callbacks.event(TrajectoryEnded(result=result)),
                contact=lambda result: self.contact_watch.take(result),
                warning=self._warn,
            ),
        )
        self.contact_watch = ContactWatch(
            self.program,
            lambda active: callbacks.event(ContactWatchChanged(is_active=active)),
        )
        self.event_log = EventLog(
            asyncio.get_running_loop().time, self.program, settings.robot_receive_timeout
        )
        self.control = ProgramControl(
            settings,
            self.program,
            self._primary,
            self._status,
            self.event_log,
            robot=lambda: self.robot,
            warn=self._warn,
            may_upload=may_upload,
        )

    @property
    def status(self) -> ConnectionStatus:
        """The state of the connection, and the next step before a goal can run."""
        return self._status.current

    async def run(self) -> None:
        """Connect, and reconnect after every loss, until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self.program.keep_alive())
            tasks.create_task(self._stay_connected())

    def close(self) -> None:
        """Close all ports; the robot program then loses its sockets and stops the arm."""
        self._cancel_explanation()
        self.program.close()

    def explain(self, text: str) -> None:
        """Set the last error of the status: a sentence, and the events that led to it."""
        self._cancel_explanation()
        self._status.update(
            last_error=timestamped(f'{text} {"; ".join(self.event_log.event_chain())}.')
        )

    def _cancel_explanation(self) -> None:
        if self._explain_timer is not None:
            self._explain_timer.cancel()
            self._explain_timer = None

    def report_error(self, text: str) -> None:
        """Set the last error of the status to a sentence, and log it."""
        self._status.error(text)

    def set_serial_number(self, serial_number: str) -> None:
        """Set the serial number of the robot."""
        self._status.update(serial_number=serial_number)

    # ---- calls of the owner -------------------------------------------------------------------

    def note_remote_control(self, remote: bool) -> None:
        """
        Note whether clients may control the robot.

        On a change, the primary interface reconnects: the robot decides when a client connects
        whether the client may send.
        """
        if self._remote_control not in (None, remote):
            self._primary.reconnect()
        self._remote_control = remote

    def set_executing(self, busy: bool) -> None:
        """
        Set whether a goal runs.

        This changes the status and the kind of the keepalives, and ends a feed override.
        """
        self.program.is_executing = busy
        self.program.feed = NO_OVERRIDE
        if busy:
            self._status.apply(ConnectionEvent.GOAL_STARTED)
        else:
            self._status.apply(
                ConnectionEvent.GOAL_ENDED if self._takes_goals() else ConnectionEvent.PROGRAM_LOST
            )

    def set_tcp_restore_pending(self, pending: bool) -> None:
        """Set whether the TCP still has to be restored; no goal starts before that."""
        if pending == self.control.tcp_restore_pending:
            return
        self.control.tcp_restore_pending = pending
        if pending:
            self._status.apply(ConnectionEvent.TCP_RESTORE_PENDING)
        else:
            self._review_state()

    # ---- connection ---------------------------------------------------------------------------

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
        Serve one RTDE connection from its first to its last byte; return the reason of its end.

        :raises OSError: the robot cannot be reached, or one of our ports is taken.
        :raises DriverError: the robot program cannot be made from the settings.
        """
        settings = self._settings
        stream = StateStream(
            settings.rtde_frequency,
            settings.max_state_age,
            self._on_state,
            lower_registers=settings.lower_registers,
            on_text=lambda text: self._callbacks.log(logging.WARNING, f'robot (RTDE): {text}'),
        )
        try:
            self.version = await stream.open(settings.robot_ip, settings.rtde_port)
            self._status.apply(ConnectionEvent.ROBOT_ANSWERED)
            await self._listen(stream, self.version)
            async with asyncio.TaskGroup() as tasks:
                others = [tasks.create_task(other) for other in self._other_connections()]
                reason = await stream.ended()
                for task in others:
                    task.cancel()
            return reason
        finally:
            stream.close()

    def _other_connections(self) -> list[Coroutine[None, None, NoReturn]]:
        """Return the connections to keep while RTDE is connected: primary port and signals."""
        s = self._settings
        connections = [self._primary.stay_connected(s.robot_ip, s.primary_port)]
        if s.io_publish_rate > 0.0:
            signals = SignalStream(self._on_signals, self._warn)
            connections.append(signals.stay_connected(s.robot_ip, s.rtde_port, s.io_publish_rate))
        return connections

    async def _listen(self, stream: StateStream, version: ControllerVersion) -> None:
        """Open our ports unless they are open, and render the robot program for them."""
        s = self._settings
        host = s.bind_address or stream.local_address
        await self.program.open(
            host, frozenset(s.allowed_peers or (s.robot_ip, stream.peer_address))
        )
        if s.runs_own_program:
            self.program.render(s.reverse_ip or host, version)
        self._status.update(ports=self.program.ports)

    # ---- callbacks of the interfaces ----------------------------------------------------------

    def _on_state(self, robot: RobotState) -> None:
        before, self.robot = self.robot, robot
        self._callbacks.state(robot)
        changes = () if before is None else mode_changes(before, robot)
        # The goal gets the state before all else, because it may have to cancel at once. Only if a
        # mode has changed, the status changes first.
        status_may_change = before is None or bool(changes)
        if not status_may_change:
            self._callbacks.event(StateReceived(state=robot))
        self.event_log.note_report(robot)
        for change in changes:
            self.event_log.note(change)
        self.control.tracker.observe(robot)
        if self.control.tracker.is_own and not self.status.program_is_own:
            self._status.update(program_is_own=True, motion_version=robot.motion_version)
            self._callbacks.log(logging.INFO, motion_version_text(robot.motion_version))
        self._state_time = asyncio.get_running_loop().time() - robot.state_age
        self.check_age()
        if status_may_change:
            self._review_state()
            self._callbacks.event(StateReceived(state=robot))

    def check_age(self) -> None:
        """Accept goals only while the newest state is young enough; to be called regularly."""
        now = asyncio.get_running_loop().time()
        if self._stale.update(now - self._state_time, now):
            self._review_state()

    def _on_signals(self, signals: Signals) -> None:
        self.signals = signals
        self._callbacks.signals(signals)

    def _on_configuration(self, configuration: ConfigurationData) -> None:
        """Accept the robot, or refuse it if it is another model."""
        if self._status.state is not ConnectionState.CONNECTING:
            return
        assert self.version is not None
        models = model_names(configuration.robot_type, self.version.major)
        expected = self._settings.ur_type
        found = ' or '.join(models) or f'robot of the unknown type {configuration.robot_type}'
        if expected in models:
            self._callbacks.limits(
                JointLimits(
                    position=configuration.position_limits,
                    speed=vector6(speed for speed, _ in configuration.motion_limits),
                )
            )
            self._status.apply(
                ConnectionEvent.ROBOT_ACCEPTED,
                robot_model=expected,
                polyscope_version=str(self.version),
            )
            self._review_state()
        else:
            self._status.apply(
                ConnectionEvent.ROBOT_REFUSED,
                robot_model=found,
                polyscope_version=str(self.version),
                message=f'The robot is a {found}, but ur_type is {expected}; correct ur_type.'
                if models
                else f'The robot reports the type {configuration.robot_type}, which this driver '
                'does not know; a newer version may.',
            )

    def _on_kinematics(self, geometry: DhTable) -> None:
        if not (self.status.calibration_known or self.status.state is ConnectionState.REFUSED):
            self._callbacks.geometry(geometry)
            self._status.update(calibration_known=True)

    def _on_robot_error(self, text: str) -> None:
        """Log an error that the robot reports, and set it as the last error of the status."""
        self.event_log.note(text, is_robot_error=True)
        self._status.error(text)

    def _on_robot_text(self, text: str) -> None:
        """Log a text that the robot reports; if our program wrote it, note it as an event, too."""
        self._callbacks.log(logging.INFO, f'robot: {text}')
        program, _, said = text.partition(': ')
        if program == PROGRAM_NAME and said:
            self.event_log.note(f'the robot program says: {said}')

    def _on_program_connected(self) -> None:
        self.event_log.note('the robot program has connected')
        self.control.tracker.program_connected()
        self._status.update(program_running=True)
        self._review_state()

    def _on_program_lost(self, reason: str) -> None:
        age = self.event_log.keepalive_age()
        since = f', {age:.3f} s after the last keepalive was sent' if isfinite(age) else ''
        self.event_log.note(f'{reason}{since}')
        if self._explain_timer is None:
            self._explain_timer = asyncio.get_running_loop().call_later(
                CAUSE_TIMEOUT, self.explain, 'The robot program is gone.'
            )
        self.control.tracker.program_lost()
        self.control.tcp_setter.program_lost()
        self.contact_watch.program_lost(reason)
        self._status.apply(
            ConnectionEvent.PROGRAM_LOST,
            program_running=False,
            program_is_own=False,
            motion_version=0,
        )
        self._callbacks.event(LinkLost(link='program', reason=reason))

    def _on_robot_lost(self, reason: str, status_text: str) -> None:
        """
        Handle the loss of the robot, or a failed attempt to connect.

        :param reason: reason of the loss, for the outcome of the running goal.
        :param status_text: the reason with the name of the interface, for the status.
        """
        self.event_log.note(status_text)
        self._cancel_explanation()  # the loss of the robot explains the loss of the program
        last_error = (
            timestamped(status_text, self.status.last_error)
            if self.robot is None
            else timestamped(f'The robot is gone. {"; ".join(self.event_log.event_chain())}.')
        )
        before, self.robot, self.signals = self.robot, None, None
        self._state_time = inf
        # It is unknown now whether the program is paused and needs no keepalives: send them.
        self.program.is_paused = False
        self.control.tracker.robot_lost()
        self._status.apply(
            ConnectionEvent.ROBOT_LOST,
            calibration_known=False,
            program_is_own=False,
            motion_version=0,
            serial_number='',
            last_error=last_error,
            message=f'No connection to the robot: {status_text.rstrip(".")}.',
        )
        if before is not None:
            self._callbacks.event(LinkLost(link='RTDE', reason=reason))

    # ---- status -------------------------------------------------------------------------------

    def _review_state(self) -> None:
        """Derive the state of the connection from the robot's state and its program."""
        robot = self.robot
        if robot is None:
            return
        self._status.apply(
            ConnectionEvent.ROBOT_STOPPED if is_stopped(robot) else ConnectionEvent.STOP_CLEARED
        )
        self.control.auto_start.review(
            robot, self.status, program_connected=self.program.connected
        )
        self.program.is_paused = is_paused(robot)
        if not self._takes_goals():
            self._status.apply(ConnectionEvent.PROGRAM_PAUSED)
        elif not self.control.tcp_restore_pending:
            self._status.apply(ConnectionEvent.PROGRAM_CONNECTED)
            if self.program.is_executing:  # a stop is over, and has not ended the goal
                self._status.apply(ConnectionEvent.GOAL_STARTED)

    def _takes_goals(self) -> bool:
        """Return whether the robot program reads messages, and the robot's states are fresh."""
        return self.control.tracker.reads(self.robot) and not self._stale.age

    def _required_action(self, state: ConnectionState) -> str:
        return required_action(
            state,
            self.robot,
            program_connected=self.program.connected,
            headless_mode=self._settings.headless_mode,
            stale=explain_age(self._stale.age, self._settings.max_state_age)
            if self._stale.age
            else '',
            tcp_restore_pending=self.control.tcp_restore_pending,
            program_is_ending=self.control.tracker.is_ending,
            foreign_program=self.control.tracker.foreign_program_runs(self.robot),
        )

    def _warn(self, text: str) -> None:
        self._callbacks.log(logging.WARNING, text)


def model_names(robot_type: int, software_major: int) -> list[str]:
    """
    Return the models that report this type; for example, a UR7e reports the type of a UR5.

    The list is empty for a type that this driver does not know.
    """
    return [
        name
        for name, model in MODELS.items()
        if model.wire_type == robot_type and (model.series == 'CB3') == (software_major < 5)
    ]
