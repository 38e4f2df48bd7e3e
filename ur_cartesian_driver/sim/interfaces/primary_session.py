# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
One client of an interface that accepts scripts: primary, secondary or real-time.

All three interfaces accept programs and commands, but send different data; apart from the
greeting, the data goes to all clients. In local control, input is refused; a client that connected
in local control is refused even afterwards. Each interface has a read-only twin: a second port
that sends the same data and ignores all input.
"""

from __future__ import annotations

from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.interfaces.primary_commands import execute_command
from ur_cartesian_driver.sim.interfaces.primary_stream import version_frame
from ur_cartesian_driver.sim.interfaces.tcp_server import ClientSession
from ur_cartesian_driver.sim.programs.script_upload import UploadDecoder


class ScriptSession(ClientSession):
    """Executes programs and commands; `primary_stream` and `realtime_stream` make the states."""

    def __init__(self, controller: Controller) -> None:
        """Wait for programs."""
        self._controller = controller
        self._may_send = controller.takes_scripts
        self._uploads = UploadDecoder()

    def feed(self, data: bytes) -> bytes:
        """Execute complete programs; answers go to all clients."""
        for item in self._uploads.feed(data):
            may_send = self._may_send and self._controller.takes_scripts
            execute_command(self._controller, item, may_send=may_send)
        return b''


class PrimarySession(ScriptSession):
    """A client of the primary or secondary interface, which first sends the version."""

    def open(self) -> bytes:
        """Return the version message, for which clients wait at the start."""
        return version_frame(self._controller)


class ReadOnlySession(ClientSession):
    """A client of the read-only twin of an interface."""

    def __init__(self, greeting: bytes) -> None:
        """
        Ignore the client's messages.

        :param greeting: the first bytes that the interface sends.
        """
        self._greeting = greeting

    def open(self) -> bytes:
        """Return the greeting of the interface."""
        return self._greeting

    def feed(self, data: bytes) -> bytes:
        """Ignore the data."""
        return b''
