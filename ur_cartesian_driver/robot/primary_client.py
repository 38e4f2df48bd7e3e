# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The primary interface: the robot reports its model and errors, and accepts programs.

A goal continues while this connection is lost and established again.

The robot decides when a client connects whether the client may send: a connection made in local
control stays read-only after the switch to remote control, and every request on it is refused with
C210. Nothing else reveals this, so after a refusal the client connects again, and sends the
refused request once more if it is still wanted. The robot drops connections when it is switched
back to local control.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from typing import NoReturn

from ur_cartesian_driver.kinematics.robot_models import DhTable
from ur_cartesian_driver.motion.errors import ProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.client_interfaces import primary_messages as primary
from ur_cartesian_driver.protocol.client_interfaces.primary_state import (
    ConfigurationData,
    KinematicsInfo,
    SubPackage,
)
from ur_cartesian_driver.protocol.framing import to_single_line
from ur_cartesian_driver.robot.transport import AttemptLog, Backoff, dial, TcpConnection

#: Longest wait for the robot's configuration [s].
REPORT_TIMEOUT = 5.0
#: Silence after which a connection is given up [s]: on a dead one, a command to stop the program
#: would be lost. The robot reports its state ten times a second.
SILENCE_TIMEOUT = 1.5
#: Error code of a request on a read-only connection.
READ_ONLY_CODE = 210
#: Beginning of a message's title if a secondary program failed; such a failure stops no other
#: program.
SECONDARY_EXCEPTION = 'SECONDARY_PROGRAM_EXCEPTION'
#: Beginnings of the text of an exception if the robot could not compile a program.
COMPILE_ERRORS = ('compile_error_', 'syntax_error_')
#: Largest age of a repeated request [s], so that a much later switch to remote control
#: does not carry out an old request.
REPEAT_TIMEOUT = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PrimaryCallbacks:
    """Callbacks of the primary client; called on the event loop."""

    #: The robot's configuration, at least once for each connection.
    configuration: Callable[[ConfigurationData], None]
    #: The robot's calibrated geometry, each time it is reported.
    geometry: Callable[[DhTable], None]
    #: The robot reports an error of its own or of its program.
    error: Callable[[str], None]
    #: This connection failed; the text is the reason.
    connection_error: Callable[[str], None]
    #: A text that the robot program wrote.
    text: Callable[[str], None]
    #: This connection failed repeatedly for one reason; the text gives the reason and the count.
    failures: Callable[[str], None] = lambda _: None


@dataclass(frozen=True, slots=True)
class _Request:
    data: bytes
    is_wanted: Callable[[], bool]
    time: float


class PrimaryClient:
    """Keeps one connection to the primary interface, and makes a new one when it breaks."""

    def __init__(self, listener: PrimaryCallbacks) -> None:
        """Prepare; :meth:`stay_connected` connects."""
        self._listener = listener
        self._attempts = AttemptLog(listener.connection_error, listener.failures)
        self._decoder = primary.PrimaryDecoder()
        self._connection: TcpConnection | None = None
        self._has_configuration = self._has_received = False
        #: Requests that a refusal may concern; requests to send on the next connection.
        self._sent: list[_Request] = []
        self._to_send: list[_Request] = []
        #: The connection is being closed in order to connect again.
        self._is_reconnecting = False

    def send(self, data: bytes, is_wanted: Callable[[], bool]) -> bool:
        """
        Send a program or command; return False while there is no connection.

        :param is_wanted: returns whether the request is still wanted and disturbs no other
            program. It is called before the request is sent again, which happens if the first
            connection was read-only.
        """
        request = _Request(data, is_wanted, asyncio.get_running_loop().time())
        if self._is_reconnecting:
            self._to_send.append(request)
            return True
        if self._connection is None or not self._connection.send(data):
            return False
        self._sent = [*self._recent(self._sent), request]
        return True

    def reconnect(self) -> None:
        """Connect again, because the right to send may have changed."""
        if self._connection is not None and not self._is_reconnecting:
            self._is_reconnecting = True
            self._connection.close('to connect again')

    def _recent(self, requests: list[_Request]) -> list[_Request]:
        now = asyncio.get_running_loop().time()
        return [request for request in requests if now - request.time < REPEAT_TIMEOUT]

    def _send_again(self) -> None:
        """Send the requests refused on the last connection, and later ones."""
        self._is_reconnecting = False
        requests, self._sent, self._to_send = self._recent(self._to_send), [], []
        for request in requests:
            if request.is_wanted() and self._connection is not None:
                self._connection.send(request.data)

    def _repeat_refused(self) -> bool:
        """Connect again after a refusal; return False if no request is recent enough to repeat."""
        if not (refused := self._recent(self._sent)):
            return False
        self._to_send += refused
        self._sent = []
        self.reconnect()
        return True

    async def stay_connected(self, host: str, port: int) -> NoReturn:
        """Keep connected until cancelled."""
        retry = Backoff()
        while True:
            try:
                reason = await self._serve_connection(host, port)
                retry.reset()
                if self._is_reconnecting:
                    continue
            except OSError as error:
                reason = str(error)
                self._is_reconnecting = False
            self._attempts.failed(f'primary interface: {reason}')
            await retry.wait()

    async def _serve_connection(self, host: str, port: int) -> str:
        """
        Serve one connection and return the reason of its end.

        :raises OSError: nothing answers, or the other side is not a robot.
        """
        closed: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self._decoder = primary.PrimaryDecoder()
        self._has_configuration = False
        self._connection = TcpConnection(
            # If the link is closed while this method waits, ``closed`` is cancelled, and must not
            # get a result.
            self._on_data,
            lambda reason: None if closed.done() else closed.set_result(reason),
        )
        try:
            await dial(self._connection, host, port)
            self._send_again()
            begin = asyncio.get_running_loop().time()
            while True:
                self._has_received = False
                await asyncio.wait({closed}, timeout=SILENCE_TIMEOUT)
                if closed.done():
                    return closed.result()
                self._check_alive(f'{host} port {port}', asyncio.get_running_loop().time() - begin)
        finally:
            self._connection.close()
            self._connection = None

    def _check_alive(self, where: str, age: float) -> None:
        """
        Check that the connection is alive.

        :param age: age of the connection [s].
        :raises OSError: the connection is dead, or the other side is not a robot.
        """
        if not self._has_configuration and age > REPORT_TIMEOUT:
            raise OSError(f'{where}: the robot does not report its configuration')
        if self._has_configuration and not self._has_received:
            raise OSError(f'{where}: the robot sent nothing for {SILENCE_TIMEOUT:g} s')

    def _on_data(self, data: bytes) -> None:
        self._has_received = True
        try:
            for frame in self._decoder.feed(data):
                if isinstance(frame, primary.RobotStateFrame):
                    for package in frame.packages:
                        self._on_package(package)
                else:
                    self._on_message(frame)
        except ProtocolError as error:
            if self._connection is not None:
                self._connection.abort(str(error))

    def _on_package(self, package: SubPackage) -> None:
        match package:
            case ConfigurationData():
                if not self._has_configuration:
                    self._attempts.succeeded()
                self._has_configuration = True
                self._listener.configuration(package)
            case KinematicsInfo():
                self._listener.geometry(_geometry(package))

    def _on_message(self, message: primary.PrimaryFrame) -> None:
        match message:
            case primary.ErrorCodeMessage(level=level, code=code):
                if code == READ_ONLY_CODE and self._repeat_refused():
                    return
                if primary.ReportLevel.WARNING <= level <= primary.ReportLevel.CRITICAL_FAULT:
                    text = f'the robot reports {message.label} {to_single_line(message.text)}'
                    self._listener.error(text.rstrip())
            case primary.RuntimeExceptionMessage():
                line, column = message.line, message.column
                text = to_single_line(message.text)
                # A program that does not compile never ran, and may be another client's.
                self._listener.error(
                    'the robot cannot compile a program that it was sent: an error in line '
                    f'{line}, column {column}: {text}'
                    if message.text.startswith(COMPILE_ERRORS)
                    else f'the robot program failed in line {line}, column {column}: {text}'
                )
            case primary.KeyMessage(title=title) if title.startswith(SECONDARY_EXCEPTION):
                self._listener.error(f'a secondary program failed: {to_single_line(message.text)}')
            case primary.TextMessage():
                self._listener.text(to_single_line(message.text))


def _geometry(package: KinematicsInfo) -> DhTable:
    """
    Return the calibrated geometry of the arm.

    :raises RemoteProtocolError: no arm can have this geometry.
    """
    try:
        return DhTable(a=package.a, d=package.d, alpha=package.alpha, theta=package.theta)
    except ValueError as error:
        raise RemoteProtocolError(f'The robot reports impossible kinematics: {error}') from error
