# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
r"""
The script sender, from which the External Control URCap fetches the robot program.

::

    robot -> driver   request_program\n                 (16 bytes)
    driver -> robot   the program, and one more \n

The connection stays open and the robot may ask again. The reply contains no length: when the
External Control node finds nothing more to read, it takes the lines that have arrived. So the
reply must be sent without a pause.
"""

from __future__ import annotations

from ur_cartesian_driver.motion.errors import RemoteProtocolError
from ur_cartesian_driver.protocol.framing import hex_text, truncated_stream

#: Request of the robot.
REQUEST = b'request_program\n'


class RequestDecoder:
    """Counts the requests that the robot sends."""

    def __init__(self) -> None:
        """Start empty."""
        self._rest = b''

    def feed(self, data: bytes) -> int:
        """
        Take bytes from the robot (``b''`` = end of stream) and return the number of requests.

        :raises RemoteProtocolError: the bytes are not requests, or the stream ended inside one.
        """
        if not data:
            if self._rest:
                raise truncated_stream('program request', self._rest)
            return 0
        data = self._rest + data
        count, rest = divmod(len(data), len(REQUEST))
        if data != REQUEST * count + REQUEST[:rest]:
            raise RemoteProtocolError(
                f'Expected {REQUEST!r}, but the robot sent {hex_text(data)}.'
            )
        self._rest = data[count * len(REQUEST) :]
        return count


def reply(program: str) -> bytes:
    """Return the bytes that answer a request."""
    return program.encode() + b'\n'
