# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The ports for the robot: three sockets of the robot program, and the script sender.

The robot program connects to the trajectory port, the script command port and the reverse port,
in this order, and is connected when it holds all three. A program that has lost one of them has
ended or is about to end. So the other sockets are closed, and the next program finds all ports
free.

The script sender is separate: an External Control node requests the robot program from it.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from math import inf
import secrets
from typing import NoReturn

from ur_cartesian_driver.motion.errors import ProtocolError
from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.program import ProgramSettings, render
from ur_cartesian_driver.protocol.framing import INT32_MAX
from ur_cartesian_driver.protocol.program import reverse, script_sender
from ur_cartesian_driver.protocol.program.reverse import ControlMode, TrajectoryAction
from ur_cartesian_driver.protocol.program.script_command import (
    ToolContactResult,
    ToolContactResultDecoder,
)
from ur_cartesian_driver.protocol.program.trajectory_points import TrajectoryResultDecoder
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.robot.link_settings import LinkSettings
from ur_cartesian_driver.robot.transport import ignore, TcpConnection, TcpListener

_HAS_OLDER_PROGRAM = 'wire_dialect is set to an older program; play that one on the pendant'


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramCallbacks:
    """Callbacks of the program sockets; called on the event loop."""

    #: A robot program holds all its sockets.
    connected: Callable[[], None]
    #: The robot program lost its sockets; the text is the reason.
    lost: Callable[[str], None]
    #: The robot program reported the end of a trajectory.
    result: Callable[[TrajectoryResult], None]
    #: The robot program reported the end of its watch for contact.
    contact: Callable[[ToolContactResult], None]
    #: A client was rejected; the text is the reason.
    warning: Callable[[str], None]


class ProgramSockets:
    """The connections of the robot program; sends its messages and keepalives."""

    def __init__(self, settings: LinkSettings, listener: ProgramCallbacks) -> None:
        """Prepare; :meth:`open` listens."""
        self._settings = settings
        self._listener = listener
        #: The robot program, for the script sender; empty = the robot runs a saved program.
        self.text = ''
        #: Random number, not 0, by which we recognise our program.
        self.program_number = 1 + secrets.randbelow(INT32_MAX)
        #: Whether a goal runs; keepalives are then NOOP actions of its trajectory.
        self.is_executing = False
        #: The feed override of the running goal; every message of a trajectory repeats it.
        self.feed = reverse.NO_OVERRIDE
        #: Whether the goal uses the buffered servo; each keepalive then repeats the message that
        #: enters it.
        self.servo = False
        #: Whether the program is paused, and so reads nothing. Keepalives pause, too, because
        #: otherwise the resumed program might have an hour of them to read before a START.
        self.is_paused = False
        #: Whether the robot reports that no program runs. A client that still holds the sockets is
        #: then dead, for instance because a cable was cut, and another client may replace it.
        self.ended = False
        self.connected = False
        #: The longest pause between two keepalives since this number was last set to 0 [s].
        self.max_keepalive_gap = 0.0
        #: Time of the last keepalive to a connected program [s].
        self.last_keepalive = -inf
        #: The address at which the ports are open.
        self._host = ''
        self._read_timeout = round(1000.0 * settings.robot_receive_timeout)
        self._results = TrajectoryResultDecoder()
        self._contacts = ToolContactResultDecoder()
        self._requests = script_sender.RequestDecoder()
        self._trajectory = self._program_port('trajectory_port', self._on_results)
        self._commands = self._program_port('script_command_port', self._on_contacts)
        self._reverse = self._program_port('reverse_port', ignore)
        self._sender = TcpListener(
            'script_sender_port',
            on_open=self._on_sender_open,
            on_data=self._on_request,
            on_closed=ignore,
            on_refused=listener.warning,
        )
        self._program_ports = (self._trajectory, self._commands, self._reverse)

    def _program_port(self, name: str, on_data: Callable[[bytes], None]) -> TcpListener:
        return TcpListener(
            name,
            on_open=self._on_open,
            on_data=on_data,
            on_closed=partial(self._on_closed, name),
            on_refused=self._listener.warning,
            is_taken=lambda: self.connected and not self.ended,
        )

    @property
    def ports(self) -> Mapping[str, int]:
        """The open ports, by the name of their parameter."""
        return {port.name: port.port for port in (*self._program_ports, self._sender)}

    async def open(self, host: str, allowed: frozenset[str]) -> None:
        """
        Listen on all ports that are not open yet.

        :param host: our address; if it has changed, all ports move to it.
        :param allowed: addresses that may connect.
        :raises OSError: a port is taken; the text names the parameter to change.
        """
        if host != self._host:
            self.drop(f'the address of the driver is {host} now')
            for port in (*self._program_ports, self._sender):
                port.close()
            self._host = host
        for port in (*self._program_ports, self._sender):
            if port.is_open:
                port.allow(allowed)
            else:
                await port.open(host, getattr(self._settings, port.name), allowed)

    @property
    def missing_program(self) -> str:
        """Why the driver has no program for the robot, as a clause; '' = it has one."""
        if self.text:
            return ''
        if not self._settings.runs_own_program:
            return _HAS_OLDER_PROGRAM
        return 'it cannot be made from the settings; the status of the driver says why'

    def render(self, host: str, version: ControllerVersion) -> None:
        """
        Render the robot program for the open ports.

        :param host: the address at which the robot reaches us.
        :raises DriverError: the program cannot be made from the settings.
        """
        s, ports = self._settings, self.ports
        self.text = render(
            ProgramSettings(
                host=host,
                reverse_port=ports['reverse_port'],
                trajectory_port=ports['trajectory_port'],
                script_command_port=ports['script_command_port'],
                number=self.program_number,
                version=version.release,
                stop_deceleration=s.stop_deceleration,
                servoj_gain=s.servoj_gain,
                servoj_lookahead_time=s.servoj_lookahead_time,
                servo_buffer_depth=s.servo_buffer_depth,
                allow_freedrive=s.allow_freedrive,
                lower_registers=s.lower_registers,
                motion_version=s.motion_version,
                prelude=s.prelude,
            )
        )

    def close(self) -> None:
        """Tell the robot program to stop the arm and end, and close all ports."""
        self.send_stop()
        for port in (*self._program_ports, self._sender):
            port.close()

    # ---- to the robot program -----------------------------------------------------------------

    def send_control(
        self, action: TrajectoryAction, count: int, *, takes_offsets: bool = False
    ) -> None:
        """Send a trajectory action."""
        self._settings.dialect.check_action(action)
        mode = ControlMode.BUFFERED_SERVO if self.servo else ControlMode.FORWARD
        self._send(
            reverse.trajectory(
                action,
                count,
                self._read_timeout,
                takes_offsets=takes_offsets,
                mode=mode,
                feed=self.feed,
            )
        )

    def set_feed(self, feed: reverse.FeedTarget) -> None:
        """Send a feed override now and with every later message of the goal."""
        self.feed = feed
        self.send_control(TrajectoryAction.NOOP, 0)

    def send_points(self, data: bytes) -> None:
        """Send trajectory points."""
        if self._trajectory.connection is not None:
            self._trajectory.connection.send(data)

    def send_command(self, data: bytes) -> bool:
        """Send a single command; return False if no robot program is connected."""
        return (
            self.connected
            and self._commands.connection is not None
            and self._commands.connection.send(data)
        )

    def drop(self, reason: str) -> None:
        """Close the sockets of the robot program, and report its loss if it was connected."""
        for port in self._program_ports:
            port.disconnect()
        if self.connected:
            self.connected = False
            self._listener.lost(reason)

    def send_stop(self) -> None:
        """Ask the robot program to stop the arm and to end."""
        self._send(reverse.stop())

    async def keep_alive(self) -> NoReturn:
        """Send keepalives at a steady rate until cancelled."""
        loop = asyncio.get_running_loop()
        due = last = loop.time()
        was_paused = False
        while True:
            last, before = loop.time(), last
            self.max_keepalive_gap = max(self.max_keepalive_gap, last - before)
            # One keepalive is still sent in a pause, for the read that was waiting when it began.
            if not (self.is_paused and was_paused):
                self._send_keepalive()
            was_paused = self.is_paused
            due = max(due + self._settings.keepalive_period, loop.time())
            await asyncio.sleep(due - loop.time())

    def send_servo(self, on: bool) -> None:
        """Have the program enter the buffered servo, or leave it and stop the arm."""
        self.servo = on
        self._send(
            reverse.buffered_servo(self._read_timeout)
            if on
            else reverse.keepalive(self._read_timeout)
        )

    def _send_keepalive(self) -> None:
        if self.servo:
            self.send_servo(True)
        elif self.is_executing:
            self.send_control(TrajectoryAction.NOOP, 0)
        else:
            self._send(reverse.keepalive(self._read_timeout))
        if self.connected:
            self.last_keepalive = asyncio.get_running_loop().time()

    def _send(self, message: reverse.ReverseMessage) -> None:
        if self.connected and self._reverse.connection is not None:
            self._reverse.connection.send(message.encode())

    # ---- from the robot -----------------------------------------------------------------------

    def _on_open(self, connection: TcpConnection) -> None:
        if self.connected:
            self.connected = False
            self._listener.lost('another robot program connects')
        called = [port.connection for port in self._program_ports].index(connection)
        for port in self._program_ports[called + 1 :]:
            port.disconnect()  # a foreign client, or a program that died while connecting
        if connection is self._trajectory.connection:
            self._results = TrajectoryResultDecoder()
        if connection is self._commands.connection:
            self._contacts = ToolContactResultDecoder()
        if all(port.connection is not None for port in self._program_ports):
            self.connected = True
            self._listener.connected()

    def _on_closed(self, name: str, reason: str) -> None:
        """Treat the loss of one socket as the loss of the program."""
        self.drop(f'{name}: {reason}')

    def _on_results(self, data: bytes) -> None:
        try:
            for result in self._results.feed(data):
                self._listener.result(result)
        except ProtocolError as error:
            assert self._trajectory.connection is not None
            self._trajectory.connection.abort(str(error))

    def _on_contacts(self, data: bytes) -> None:
        try:
            for result in self._contacts.feed(data):
                self._listener.contact(result)
        except ProtocolError as error:
            assert self._commands.connection is not None
            self._commands.connection.abort(str(error))

    def _on_sender_open(self, _: TcpConnection) -> None:
        self._requests = script_sender.RequestDecoder()

    def _on_request(self, data: bytes) -> None:
        """Answer the External Control node that asks for the program."""
        connection = self._sender.connection
        assert connection is not None
        try:
            wanted = self._requests.feed(data)
        except ProtocolError as error:
            self._sender.warn_limited(str(error))
            connection.abort(str(error))
            return
        if not self.text:
            self._sender.warn_limited(
                f'the robot requests a robot program, but there is none: {self.missing_program}'
            )
            return
        for _ in range(wanted):
            if not connection.send_at_once(script_sender.reply(self.text)):
                return
