# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""One client of the interpreter port: it sends statements and gets a line in reply to each."""

from __future__ import annotations

from ur_cartesian_driver.protocol.framing import LineBuffer
from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.interfaces.tcp_server import ClientSession
from ur_cartesian_driver.sim.programs.script_upload import SCRIPT_ENCODING

#: Longest line [bytes]; a line can contain a whole function.
_MAX_LINE_LENGTH = 1024 * 1024


class InterpreterSession(ClientSession):
    """Hands statements over to interpreter mode, which answers each at once or later."""

    def __init__(self, controller: Controller) -> None:
        """Wait for statements."""
        self._interpreter_mode = controller.interpreter_mode
        self._lines = LineBuffer(_MAX_LINE_LENGTH, SCRIPT_ENCODING)
        self._answers: list[str] = []

    def feed(self, data: bytes) -> bytes:
        """Hand over each line; return the answers that are available at once."""
        for line in self._lines.feed(data):
            self._interpreter_mode.receive(line, self._answers.append)
        return self.answers()

    def answers(self) -> bytes:
        """Return the answers since the last call."""
        text = ''.join(f'{answer}\n' for answer in self._answers)
        self._answers.clear()
        # An answer can quote a message of ours, which is not limited to this encoding.
        return text.encode(SCRIPT_ENCODING, 'replace')
