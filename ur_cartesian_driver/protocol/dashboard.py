# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The dashboard: one line asks, one line answers.

The server greets with one line. Then each command, a line of text, gets exactly one line in
return, in order; there is nothing else that joins the two. A command that is refused is answered
by a sentence for people, so success is recognised by the shape of the answer (:data:`SHAPES`).

Which commands there are depends on the software: CB3 robots count to 3, e-Series robots from 5.
PolyScope X has no dashboard.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
import re
from types import MappingProxyType

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.framing import LineBuffer

BANNER = 'Connected: Universal Robots Dashboard Server'
#: Longest line in either direction [bytes].
LONGEST_LINE = 8192
#: Most commands that may wait for their answers.
MOST_PENDING = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """
    A command and what its success looks like.

    :param reply: the answer, with ``{}`` for the part that tells something.
    :param takes: whether a text follows the command.
    :param cb3: first software of a CB3 robot that has it; None = none has.
    :param e_series: the same of an e-Series robot.
    """

    reply: str
    takes: bool = False
    cb3: tuple[int, int] | None = (0, 0)
    e_series: tuple[int, int] | None = (5, 0)

    def pattern(self) -> re.Pattern[str]:
        """Return what matches the whole answer; group 1 is the telling part."""
        before, telling, after = self.reply.partition('{}')
        return re.compile(re.escape(before) + ('(.*)' if telling else '') + re.escape(after))

    def available(self, version: tuple[int, int]) -> bool:
        """Tell whether software of a version has the command."""
        least = self.cb3 if version < (5, 0) else self.e_series
        return least is not None and version >= least


#: All commands of the dashboard that we know.
SHAPES: Mapping[str, Shape] = MappingProxyType(
    {
        'load': Shape(reply='Loading program: {}', takes=True, cb3=(1, 4)),
        'play': Shape(reply='Starting program', cb3=(1, 4)),
        'pause': Shape(reply='Pausing program', cb3=(1, 4)),
        'stop': Shape(reply='Stopped', cb3=(1, 4)),
        'quit': Shape(reply='Disconnected', cb3=(1, 4)),
        'shutdown': Shape(reply='Shutting down', cb3=(1, 4)),
        'running': Shape(reply='Program running: {}', cb3=(1, 6)),
        'robotmode': Shape(reply='Robotmode: {}', cb3=(1, 6)),
        'safetymode': Shape(reply='Safetymode: {}', cb3=(3, 0)),
        'safetystatus': Shape(reply='Safetystatus: {}', cb3=None, e_series=(5, 4)),
        'get loaded program': Shape(reply='Loaded program: {}', cb3=(1, 6)),
        'popup': Shape(reply='showing popup', takes=True, cb3=(1, 6)),
        'close popup': Shape(reply='closing popup', cb3=(1, 6)),
        'close safety popup': Shape(reply='closing safety popup', cb3=(3, 1)),
        'addToLog': Shape(reply='Added log message', takes=True, cb3=(1, 8)),
        'isProgramSaved': Shape(reply='{}', cb3=(1, 8)),
        'programState': Shape(reply='{}', cb3=(1, 8)),
        'PolyscopeVersion': Shape(reply='URSoftware {}', cb3=(1, 8)),
        'version': Shape(reply='{}', cb3=None),
        'setUserRole': Shape(reply='Setting user role: {}', takes=True, cb3=(3, 1), e_series=None),
        'getUserRole': Shape(reply='{}', cb3=(3, 1), e_series=None),
        'power on': Shape(reply='Powering on', cb3=(3, 0)),
        'power off': Shape(reply='Powering off', cb3=(3, 0)),
        'brake release': Shape(reply='Brake releasing', cb3=(3, 0)),
        'unlock protective stop': Shape(reply='Protective stop releasing', cb3=(3, 1)),
        'restart safety': Shape(reply='Restarting safety', cb3=(3, 7), e_series=(5, 1)),
        'load installation': Shape(reply='Loading installation: {}', takes=True, cb3=(3, 2)),
        'set operational mode': Shape(reply='Operational mode {}', takes=True, cb3=None),
        'get operational mode': Shape(reply='{}', cb3=None, e_series=(5, 6)),
        'clear operational mode': Shape(
            reply='No longer controlling the operational mode. {}', cb3=None
        ),
        'is in remote control': Shape(reply='{}', cb3=None, e_series=(5, 6)),
        'get serial number': Shape(reply='{}', cb3=(3, 12), e_series=(5, 6)),
        'get robot model': Shape(reply='{}', cb3=(3, 12), e_series=(5, 6)),
        'generate flight report': Shape(
            reply='Flight Report generated with id: {}', takes=True, cb3=(3, 13), e_series=(5, 8)
        ),
        'generate support file': Shape(
            reply='Completed successfully: {}', takes=True, cb3=(3, 13), e_series=(5, 8)
        ),
        'saveLog': Shape(reply='Log saved to disk', cb3=(3, 13), e_series=(5, 8)),
    }
)

#: Answers that have no words of their own, by the forms that are possible.
_FORMS: Mapping[str, re.Pattern[str]] = MappingProxyType(
    {
        'running': re.compile('true|false'),
        'isProgramSaved': re.compile(r'(?:true|false)(?: .*)?'),
        'programState': re.compile(r'(?:STOPPED|PLAYING|PAUSED)(?: .*)?'),
        'version': re.compile(r'\d+(?:\.\d+){1,3}'),
        'getUserRole': re.compile('PROGRAMMER|OPERATOR|NONE|LOCKED|RESTRICTED'),
        'get operational mode': re.compile('NONE|MANUAL|AUTOMATIC'),
        'is in remote control': re.compile('true|false'),
        'get serial number': re.compile(r'20\d+'),
        'get robot model': re.compile('UR.*'),
    }
)
#: Longest first, so that ``load installation`` is not taken for ``load``.
_NAMES = sorted(SHAPES, key=len, reverse=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """A command with its text."""

    name: str
    argument: str = ''

    def __post_init__(self) -> None:
        """Check that it is one line of a command that exists."""
        shape = SHAPES.get(self.name)
        if shape is None:
            raise LocalProtocolError(f'{self.name!r} is not a command of the dashboard.')
        if '\n' in self.argument or '\r' in self.argument:
            raise LocalProtocolError(
                f'{self.name} takes one line of text, but it got {self.argument!r}.'
            )
        if bool(self.argument) != shape.takes:
            raise LocalProtocolError(
                f'{self.name} takes {"a" if shape.takes else "no"} text, but it got '
                f'{self.argument!r}.'
            )

    def encode(self) -> bytes:
        """Return the line."""
        return (f'{self.name} {self.argument}' if self.argument else self.name).encode() + b'\n'


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """
    An answer and the command that it belongs to.

    :param text: the line.
    :param value: its telling part when the command succeeded ('' if there is none), else None.
    """

    request: Request
    text: str
    value: str | None

    @property
    def ok(self) -> bool:
        """Tell whether the command succeeded."""
        return self.value is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class Greeting:
    """The first line of the server."""

    text: str


def parse_reply(request: Request, line: str) -> Reply:
    """Return what an answer means."""
    match = SHAPES[request.name].pattern().fullmatch(line.rstrip())
    value = None if match is None else ''.join(match.groups())
    form = _FORMS.get(request.name)
    if value is not None and form is not None and not form.fullmatch(value):
        value = None
    return Reply(request=request, text=line, value=value)


class DashboardClient:
    """The asking side: joins answers to commands by their order."""

    def __init__(self) -> None:
        """Wait for the greeting."""
        self._lines = LineBuffer(LONGEST_LINE)
        self._pending: deque[Request] = deque()
        self._greeted = False

    def send(self, name: str, argument: str = '') -> bytes:
        """
        Return the line of a command and remember that it wants an answer.

        :raises LocalProtocolError: there is no such command, or too many wait for an answer.
        """
        request = Request(name=name, argument=argument)
        if len(self._pending) >= MOST_PENDING:
            raise LocalProtocolError(
                f'{MOST_PENDING} dashboard commands wait for an answer; connect anew.'
            )
        self._pending.append(request)
        return request.encode()

    def feed(self, data: bytes) -> list[Greeting | Reply]:
        """
        Take bytes from the server (none at all = its end) and return the answers in them.

        :raises RemoteProtocolError: an answer to nothing, a line that is too long or cut off, or
            the end while a command waits.
        """
        events: list[Greeting | Reply] = []
        lines = self._lines.feed(data)
        if not data and self._pending:
            raise RemoteProtocolError(
                f'The dashboard closed the connection instead of answering '
                f'{self._pending[0].name!r}.'
            )
        for line in lines:
            if not self._greeted:
                self._greeted = True
                events.append(Greeting(text=line))
            elif self._pending:
                events.append(parse_reply(self._pending.popleft(), line))
            else:
                raise RemoteProtocolError(f'The dashboard said {line!r:.100} without being asked.')
        return events


class DashboardServer:
    """The answering side: reads commands; answer with :func:`success` or in free words."""

    def __init__(self) -> None:
        """Start empty."""
        self._lines = LineBuffer(LONGEST_LINE)

    def feed(self, data: bytes) -> list[Request | str]:
        """
        Take bytes from a client (none at all = its end) and return its commands.

        A line that is no command is returned as it is; it wants an answer too
        (:func:`not_understood`).

        :raises RemoteProtocolError: a line is too long, or the stream ended inside one.
        """
        return [parse_request(line.strip()) for line in self._lines.feed(data)]


def parse_request(line: str) -> Request | str:
    """Return the command of a line, or the line when it is none."""
    for name in _NAMES:
        if line == name or line.startswith(name + ' '):
            try:
                return Request(name=name, argument=line[len(name) :].strip())
            except LocalProtocolError:
                return line
    return line


def encode_line(text: str) -> bytes:
    """Return a line as bytes."""
    return text.encode() + b'\n'


def success(request: Request, value: str | None = None) -> bytes:
    """
    Return the answer that says a command succeeded.

    :param value: the telling part; None = the text that came with the command.
    """
    return encode_line(
        SHAPES[request.name].reply.replace('{}', request.argument if value is None else value)
    )


def not_understood(line: str) -> bytes:
    """Return the answer to a line that is no command."""
    return encode_line(f"could not understand: '{line}'")
