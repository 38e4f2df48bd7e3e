# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
External Control: the URCap of CB3 and PolyScope 5, and the URCapX of PolyScope X.

When a program with such a node is played, the pendant requests the text of the node from a host,
once, before the first line runs. If the request fails, the node shows a window with the reason
(URCap), or does nothing (URCapX). doc/simulation.md has the evidence.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import errno
import logging
import os
from typing import TypeAlias

from ur_cartesian_driver.sim.pendant_programs.program_tree import FetchedScript, ProgramTree

_log = logging.getLogger(__name__)

_BEGIN, _END = '# HEADER_BEGIN', '# HEADER_END'

#: The text from the host, or the error of the request.
HostAnswer: TypeAlias = str | OSError
#: Requests the program from the host; calls its argument with the answer, at once or later.
RequestScript: TypeAlias = Callable[[Callable[[HostAnswer], None]], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestLimits:
    """The time limits of a request to the host [s]."""

    connect: float
    #: Limit for the first byte of the answer; None = no limit.
    answer: float | None
    #: Time after an answer during which it is used again.
    cache: float = 0.0


class UrCap:
    """The node of CB3 and PolyScope 5."""

    limits = RequestLimits(connect=5.0, answer=None)

    def __init__(self, host: str, port: int) -> None:
        """Take the host and the port of the installation."""
        self._host, self._port = host, port

    def problem(self, answer: HostAnswer) -> str:
        """Return a sentence with the reason why there is no program; empty = no problem."""
        if isinstance(answer, str):
            return ''
        return (
            f'The connection to the remote PC at {self._host}:{self._port} could not be '
            f'established. Reason: {self._reason(answer)}'
        )

    def _reason(self, error: OSError) -> str:
        """Return the message of Java's exception for an error."""
        if isinstance(error, TimeoutError) and error.errno is None:
            return 'connect timed out'
        if _is_unknown_host(error):
            return self._host
        return os.strerror(error.errno) if error.errno else str(error)

    def fetched(self, answer: HostAnswer) -> FetchedScript:
        """Return the parts of the fetched script; after a failure, of one that shows a window."""
        if isinstance(answer, str):
            # The URCap reads lines; if the host hangs up without one, it takes Java's null as a
            # line.
            lines = answer.splitlines() or ['null']
            header, control_loop = _split('\n'.join(f' {line}' for line in lines))
            return FetchedScript(header=header, control_loop=control_loop)
        text = self.problem(answer).replace('"', "'")
        return FetchedScript(
            control_loop=f'popup("{text}", "Receive program failed", False, True, blocking=True)'
            '\nsync()'
        )


class UrCapX(UrCap):
    """The node of PolyScope X."""

    limits = RequestLimits(connect=0.1, answer=5.0, cache=2.0)

    def problem(self, answer: HostAnswer) -> str:
        """Return a sentence with the reason why there is no program; empty = no problem."""
        if isinstance(answer, str) and answer.strip():
            return ''
        reason = 'Did not receive any script lines' if isinstance(answer, str) else answer
        return f'Connectivity problem with {self._host}:{self._port}: {self._words(reason)}'

    def _words(self, reason: str | OSError) -> str:
        """Return the message of Python's exception for a failure."""
        if isinstance(reason, TimeoutError) and reason.errno is None:
            return str(reason) or 'timed out'
        if isinstance(reason, OSError) and reason.errno and not _is_unknown_host(reason):
            return f'[Errno {reason.errno}] {os.strerror(reason.errno)}'
        return str(reason)

    def fetched(self, answer: HostAnswer) -> FetchedScript:
        """Return the parts of the fetched script; after a failure, empty parts."""
        text = '' if isinstance(answer, OSError) else answer
        header, control_loop = _split(text)
        return FetchedScript(header=header, control_loop=control_loop, header_first=True)


def _is_unknown_host(error: OSError) -> bool:
    """Return whether a name could not be resolved; only such errors have negative numbers."""
    return (error.errno or 0) < 0


def _split(text: str) -> tuple[str, str]:
    """Return the header with its markers, and the rest; without markers the header is empty."""
    begin = text.find(_BEGIN)
    end = text.find(_END, begin)
    if begin < 0 or end < 0:
        return '', text
    end += len(_END)
    return text[begin:end], text[end:]


def _no_network(then: Callable[[HostAnswer], None]) -> None:
    then(OSError(errno.ENETUNREACH, os.strerror(errno.ENETUNREACH)))


class ExternalControl:
    """Generates programs that have nodes of External Control."""

    def __init__(self, urcap: UrCap, note: Callable[[str], None]) -> None:
        """
        Generate without a network: every request fails until ``request`` is set.

        :param note: writes a line to the log of the pendant.
        """
        self._urcap, self._note = urcap, note
        self.limits = urcap.limits
        self.request: RequestScript = _no_network

    def generate(self, tree: ProgramTree, name: str, then: Callable[[str], None]) -> None:
        """
        Request the script for the nodes from the host, and generate the whole program.

        :param then: called with the URScript when the host has answered.
        """

        def write(answer: HostAnswer) -> None:
            if problem := self._urcap.problem(answer):
                self._note(f'External Control: {problem}')
                _log.warning('External Control: %s', problem)
            then(tree.script(name, self._urcap.fetched(answer)))

        self.request(write)
