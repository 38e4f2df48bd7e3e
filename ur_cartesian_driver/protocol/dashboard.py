# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The dashboard (port 29999): a command is one line of text, and so is its reply.

The server greets with one line. Then it answers each command with exactly one line, in order;
nothing else links reply and command. The reply to a refused command is a sentence for people, so
success is recognized by the form of the reply (:data:`COMMAND_SPECS`).

The available commands depend on the software: CB3 robots have versions up to 3, e-Series robots
from 5. PolyScope X has no dashboard.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
import re

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.framing import LineBuffer

BANNER = 'Connected: Universal Robots Dashboard Server'
#: Longest line in either direction [bytes].
MAX_LINE_LENGTH = 8192
#: Largest number of commands that wait for their replies.
MAX_PENDING_REQUESTS = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandSpec:
    """
    A command and its reply on success.

    :param reply: the reply on success, with ``{}`` in place of its value.
    :param takes_argument: whether a text follows the command.
    :param argument_is_optional: whether the text may be left out.
    :param cb3: first CB3 software version that has the command; None = no version has it.
    :param e_series: first e-Series version that has the command; None = no version has it.
    """

    reply: str
    takes_argument: bool = False
    argument_is_optional: bool = False
    cb3: tuple[int, int] | None = (0, 0)
    e_series: tuple[int, int] | None = (5, 0)

    def reply_pattern(self) -> re.Pattern[str]:
        """Return a pattern for the whole reply; group 1, if there is one, is the value."""
        before, value, after = self.reply.partition('{}')
        return re.compile(re.escape(before) + ('(.*)' if value else '') + re.escape(after))

    def is_available(self, version: tuple[int, int]) -> bool:
        """Return whether a software version has the command."""
        min_version = self.cb3 if version < (5, 0) else self.e_series
        return min_version is not None and version >= min_version


#: All known dashboard commands.
COMMAND_SPECS: Mapping[str, CommandSpec] = {
    'load': CommandSpec(reply='Loading program: {}', takes_argument=True, cb3=(1, 4)),
    'play': CommandSpec(reply='Starting program', cb3=(1, 4)),
    'pause': CommandSpec(reply='Pausing program', cb3=(1, 4)),
    'stop': CommandSpec(reply='Stopped', cb3=(1, 4)),
    'quit': CommandSpec(reply='Disconnected', cb3=(1, 4)),
    'shutdown': CommandSpec(reply='Shutting down', cb3=(1, 4)),
    'running': CommandSpec(reply='Program running: {}', cb3=(1, 6)),
    'robotmode': CommandSpec(reply='Robotmode: {}', cb3=(1, 6)),
    'safetymode': CommandSpec(reply='Safetymode: {}', cb3=(3, 0)),
    'safetystatus': CommandSpec(reply='Safetystatus: {}', cb3=None, e_series=(5, 4)),
    'get loaded program': CommandSpec(reply='Loaded program: {}', cb3=(1, 6)),
    'popup': CommandSpec(reply='showing popup', takes_argument=True, cb3=(1, 6)),
    'close popup': CommandSpec(reply='closing popup', cb3=(1, 6)),
    'close safety popup': CommandSpec(reply='closing safety popup', cb3=(3, 1)),
    'addToLog': CommandSpec(
        reply='Added log message',
        takes_argument=True,
        argument_is_optional=True,
        cb3=(1, 8),
    ),
    'isProgramSaved': CommandSpec(reply='{}', cb3=(1, 8)),
    'programState': CommandSpec(reply='{}', cb3=(1, 8)),
    'PolyscopeVersion': CommandSpec(reply='URSoftware {}', cb3=(1, 8)),
    'version': CommandSpec(reply='{}', cb3=None),
    'setUserRole': CommandSpec(
        reply='Setting user role: {}', takes_argument=True, cb3=(3, 1), e_series=None
    ),
    'getUserRole': CommandSpec(reply='{}', cb3=(3, 1), e_series=None),
    'power on': CommandSpec(reply='Powering on', cb3=(3, 0)),
    'power off': CommandSpec(reply='Powering off', cb3=(3, 0)),
    'brake release': CommandSpec(reply='Brake releasing', cb3=(3, 0)),
    'unlock protective stop': CommandSpec(reply='Protective stop releasing', cb3=(3, 1)),
    'restart safety': CommandSpec(reply='Restarting safety', cb3=(3, 7), e_series=(5, 1)),
    'load installation': CommandSpec(
        reply='Loading installation: {}', takes_argument=True, cb3=(3, 2)
    ),
    'set operational mode': CommandSpec(
        reply='Operational mode {}', takes_argument=True, cb3=None
    ),
    'get operational mode': CommandSpec(reply='{}', cb3=None, e_series=(5, 6)),
    'clear operational mode': CommandSpec(
        reply='No longer controlling the operational mode. {}', cb3=None
    ),
    'is in remote control': CommandSpec(reply='{}', cb3=None, e_series=(5, 6)),
    'get serial number': CommandSpec(reply='{}', cb3=(3, 12), e_series=(5, 6)),
    'get robot model': CommandSpec(reply='{}', cb3=(3, 12), e_series=(5, 6)),
    'generate flight report': CommandSpec(
        reply='Flight Report generated with id: {}',
        takes_argument=True,
        argument_is_optional=True,
        cb3=(3, 13),
        e_series=(5, 8),
    ),
    'generate support file': CommandSpec(
        reply='Completed successfully: {}', takes_argument=True, cb3=(3, 13), e_series=(5, 8)
    ),
    'saveLog': CommandSpec(reply='Log saved to disk', cb3=(3, 13), e_series=(5, 8)),
}

#: Patterns for the valid values of some replies, mainly of replies that are only a value.
_VALUE_PATTERNS: Mapping[str, re.Pattern[str]] = {
    'running': re.compile('true|false'),
    # The manual for CB robots writes True and False.
    'isProgramSaved': re.compile(r'(?i:true|false)(?: .*)?'),
    'programState': re.compile(r'(?:STOPPED|PLAYING|PAUSED)(?: .*)?'),
    'version': re.compile(r'\d+(?:\.\d+){1,3}'),
    'getUserRole': re.compile('PROGRAMMER|OPERATOR|NONE|LOCKED|RESTRICTED'),
    'get operational mode': re.compile('NONE|MANUAL|AUTOMATIC'),
    'is in remote control': re.compile('true|false'),
    'get serial number': re.compile(r'20\d+'),
    'get robot model': re.compile('UR.*'),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class DashboardRequest:
    """A command with its argument."""

    name: str
    argument: str = ''

    def __post_init__(self) -> None:
        """Refuse an unknown command, and a missing, surplus or multi-line argument."""
        spec = COMMAND_SPECS.get(self.name)
        if spec is None:
            raise LocalProtocolError(f'{self.name!r} is not a dashboard command.')
        if '\n' in self.argument or '\r' in self.argument:
            raise LocalProtocolError(
                f'{self.name} takes one line of text, but it got {self.argument!r}.'
            )
        missing = spec.takes_argument and not self.argument and not spec.argument_is_optional
        if missing or (self.argument and not spec.takes_argument):
            raise LocalProtocolError(
                f'{self.name} takes {"a" if spec.takes_argument else "no"} text, but it got '
                f'{self.argument!r}.'
            )

    def encode(self) -> bytes:
        """Return the line of the command as bytes."""
        return (f'{self.name} {self.argument}' if self.argument else self.name).encode() + b'\n'


@dataclass(frozen=True, slots=True, kw_only=True)
class DashboardReply:
    """
    A reply and the command that it belongs to.

    :param text: the line of the reply.
    :param value: the value in the line, '' if it has none; None = the command failed.
    """

    request: DashboardRequest
    text: str
    value: str | None

    @property
    def ok(self) -> bool:
        """Return whether the command succeeded."""
        return self.value is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class DashboardGreeting:
    """The first line that the server sends."""

    text: str


def parse_reply(request: DashboardRequest, line: str) -> DashboardReply:
    """Return the reply in a line; its value is None if the line does not report success."""
    match = COMMAND_SPECS[request.name].reply_pattern().fullmatch(line.rstrip())
    value = None if match is None else ''.join(match.groups())
    value_pattern = _VALUE_PATTERNS.get(request.name)
    if value is not None and value_pattern is not None and not value_pattern.fullmatch(value):
        value = None
    return DashboardReply(request=request, text=line, value=value)


class DashboardClientCodec:
    """The client: matches replies with commands by their order."""

    def __init__(self) -> None:
        """Start with no pending commands; the greeting of the server comes first."""
        self._lines = LineBuffer(MAX_LINE_LENGTH)
        self._pending: deque[DashboardRequest] = deque()
        self._greeted = False

    def send(self, name: str, argument: str = '') -> bytes:
        """
        Return the line of a command and remember that its reply is due.

        :raises LocalProtocolError: command or argument is invalid, or too many commands wait for
            their replies.
        """
        request = DashboardRequest(name=name, argument=argument)
        if len(self._pending) >= MAX_PENDING_REQUESTS:
            raise LocalProtocolError(
                f'{MAX_PENDING_REQUESTS} dashboard commands wait for a reply; reconnect.'
            )
        self._pending.append(request)
        return request.encode()

    def feed(self, data: bytes) -> list[DashboardGreeting | DashboardReply]:
        """
        Return the greeting and the replies in bytes from the server (``b''`` = end of stream).

        :raises RemoteProtocolError: a line is too long or truncated, a reply came although no
            command waited for one, or the stream ended while a command waited for its reply.
        """
        events: list[DashboardGreeting | DashboardReply] = []
        lines = self._lines.feed(data)
        if not data and self._pending:
            raise RemoteProtocolError(
                f'The dashboard closed the connection instead of answering '
                f'{self._pending[0].name!r}.'
            )
        for line in lines:
            if not self._greeted:
                self._greeted = True
                events.append(DashboardGreeting(text=line))
            elif self._pending:
                events.append(parse_reply(self._pending.popleft(), line))
            else:
                raise RemoteProtocolError(
                    f'The dashboard sent {line!r:.100}, but no command waits for a reply.'
                )
        return events


class DashboardServerCodec:
    """The server: decodes commands; :func:`success` and others encode the replies."""

    def __init__(self, version: tuple[int, int] | None = None) -> None:
        """
        Start empty.

        :param version: only the commands of this software version are accepted; None = all.
        """
        self._lines = LineBuffer(MAX_LINE_LENGTH)
        # Longest names first, so that ``load installation`` is not taken for ``load``.
        self._names = sorted(
            (
                name
                for name, spec in COMMAND_SPECS.items()
                if version is None or spec.is_available(version)
            ),
            key=len,
            reverse=True,
        )

    def feed(self, data: bytes) -> list[DashboardRequest | str]:
        """
        Take bytes from a client (``b''`` = end of stream) and return its commands.

        Capital letters make no difference in the name of a command. A line that is not a command,
        or whose argument is wrong, is returned as text; it needs a reply, too
        (:func:`not_understood`).

        :raises RemoteProtocolError: a line is too long, or the stream ended inside one.
        """
        return [self._request(line.strip()) for line in self._lines.feed(data)]

    def _request(self, line: str) -> DashboardRequest | str:
        words = line.lower()
        for name in self._names:
            if words == (known := name.lower()) or words.startswith(known + ' '):
                with suppress(LocalProtocolError):
                    return DashboardRequest(name=name, argument=line[len(name) :].strip())
        return line


def encode_line(text: str) -> bytes:
    """Return a line as bytes."""
    return text.encode() + b'\n'


def success(request: DashboardRequest, value: str | None = None) -> bytes:
    """
    Return the reply to a command that succeeded.

    :param value: the value in the reply; None = the argument of the command.
    """
    return encode_line(
        COMMAND_SPECS[request.name].reply.replace(
            '{}', request.argument if value is None else value
        )
    )


def not_understood(line: str) -> bytes:
    """Return the reply to a line that is not a command."""
    return encode_line(f'could not understand: "{line}"')
