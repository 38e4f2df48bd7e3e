# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Start, stop and command the robot program."""

from __future__ import annotations

from collections.abc import Callable

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.program import wrap_in_program
from ur_cartesian_driver.protocol.client_interfaces import primary_messages as primary
from ur_cartesian_driver.protocol.program import reverse
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction
from ur_cartesian_driver.robot.connection_status import has_ended, is_stopped
from ur_cartesian_driver.robot.event_log import EventLog
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.link_settings import LinkSettings
from ur_cartesian_driver.robot.link_status import LinkStatus, OUT_OF_REACH
from ur_cartesian_driver.robot.primary_client import PrimaryClient
from ur_cartesian_driver.robot.program.auto_start import ProgramAutoStart
from ur_cartesian_driver.robot.program.program_sockets import ProgramSockets
from ur_cartesian_driver.robot.program.program_tracker import ProgramTracker
from ur_cartesian_driver.robot.program.tcp_setter import TemporaryTcpSetter


class ProgramControl:
    """
    Commands to the robot program and to the controller that runs it.

    Commands to a connected program go to the sockets that it reads. The primary interface takes
    whole programs and a few commands, also while the program is paused, stuck or gone.
    """

    def __init__(
        self,
        settings: LinkSettings,
        sockets: ProgramSockets,
        primary_client: PrimaryClient,
        status: LinkStatus,
        event_log: EventLog,
        *,
        robot: Callable[[], RobotState | None],
        warn: Callable[[str], None],
        may_upload: bool,
    ) -> None:
        """
        Prepare; nothing is sent.

        :param robot: returns the newest state; None = the robot is not connected.
        :param warn: called with a line for the log.
        :param may_upload: whether the first connection may start the robot program.
        """
        self._sockets, self._primary = sockets, primary_client
        self._status, self._event_log = status, event_log
        self._robot, self._warn = robot, warn
        self.tracker = ProgramTracker(sockets)
        self.tcp_setter = TemporaryTcpSetter(
            sockets, primary_client, headless_mode=settings.headless_mode
        )
        #: Whether the TCP from before the last goal still has to be restored.
        self.tcp_restore_pending = False
        self.auto_start = ProgramAutoStart(
            settings,
            pending=may_upload,
            upload=self.upload,
            warn=warn,
            power_up=lambda: self.send_primary(
                primary.PrimaryCommand.RUN,
                lambda: (state := self._robot()) is not None and not is_stopped(state),
            ),
        )

    def send_control(
        self, action: TrajectoryAction, count: int, *, takes_offsets: bool = False
    ) -> None:
        """Send a trajectory action to the robot program."""
        if action is TrajectoryAction.CANCEL:
            self._note('sent CANCEL')
        self._sockets.send_control(action, count, takes_offsets=takes_offsets)

    def set_feed(self, fraction: float, rate: float) -> None:
        """Ramp the feed to ``fraction`` at ``rate`` [1/s]; it applies until the goal ends."""
        self._sockets.set_feed(reverse.FeedTarget(fraction, rate))

    def send_servo(self, on: bool) -> None:
        """Make the robot program enter the buffered servo, or leave it and brake."""
        self._note('entered the servo' if on else 'left the servo')
        self._sockets.send_servo(on)

    def _note(self, done: str) -> None:
        """Note in the event log what the driver has done to the program, if one is connected."""
        if self._sockets.connected:
            self._event_log.note(f'the driver {done}')

    def send_primary(self, command: primary.PrimaryCommand, is_wanted: Callable[[], bool]) -> bool:
        """
        Send a command to the primary interface; return False if there is no connection.

        :param is_wanted: returns whether the command is still wanted; called before the command
            is sent again, which happens if the first connection was read-only.
        """
        return self._primary.send(primary.encode_command(command), is_wanted)

    def send_script(self, data: bytes, is_wanted: Callable[[], bool]) -> bool:
        """Send a user's script; parameter and result are as in :meth:`send_primary`."""
        is_sent = self._primary.send(data, is_wanted)
        self._event_log.note(f'the driver {"sent" if is_sent else "could not send"} a user script')
        return is_sent

    # ---- the program as a whole ---------------------------------------------------------------

    def upload(self) -> None:
        """Upload the robot program; it may replace our running program, but no foreign one."""
        if refusal := self.upload_refusal():
            self._warn(f'the robot program was not sent: {refusal}')
        elif not self._primary.send(
            primary.encode_program(wrap_in_program(self._sockets.text)),
            lambda: not self.upload_refusal(),
        ):
            self._warn(
                'the robot program was not sent: there is no connection to the primary '
                'interface of the robot'
            )
        else:
            self._event_log.note('the driver sent the robot program')

    def upload_refusal(self) -> str:
        """Return the reason why no program may be sent now; empty = a program may be sent."""
        if self._status.state in (*OUT_OF_REACH, ConnectionState.CONNECTING):
            return self._status.current.message
        if self._status.state is ConnectionState.EXECUTING:
            return 'a goal is running; cancel it first'
        if self.tracker.foreign_program_runs(self._robot()):
            return (
                "another program runs on the robot, possibly another driver's; let it end, or "
                'stop it'
            )
        return self._sockets.missing_program

    def stop(self, reason: str) -> None:
        """End the robot program, so that its motion cannot resume."""
        self._warn(f'the robot program is stopped: {reason}')
        self._note('ended the robot program')
        self.tracker.is_ending = self._sockets.connected
        self.send_primary(primary.PrimaryCommand.STOP_PROGRAM, self._runs_our_program)
        self._sockets.send_stop()

    def _runs_our_program(self) -> bool:
        robot = self._robot()
        return (
            robot is not None
            and not has_ended(robot)
            and not self.tracker.foreign_program_runs(robot)
        )

    # ---- the TCP of a goal --------------------------------------------------------------------

    def set_temporary_tcp(self, T_flange_tcp: Pose) -> None:
        """Make the robot program set the TCP for the duration of a goal."""
        self.tcp_setter.set_temporary(T_flange_tcp)

    def restore_tcp(self, T_flange_tcp: Pose) -> None:
        """Restore the TCP from before a goal, if the robot is connected."""
        if (robot := self._robot()) is not None:
            self.tcp_setter.restore(
                T_flange_tcp,
                robot,
                lambda: (
                    self.tcp_restore_pending
                    and not self.tracker.foreign_program_runs(self._robot())
                ),
            )
