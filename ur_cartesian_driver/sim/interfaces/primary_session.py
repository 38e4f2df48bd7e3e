# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
One client of an interface that takes scripts: primary, secondary, real-time.

All three take programs and commands. What they send differs; apart from the greeting, it goes to
all clients. Whether a client may send is decided when it connects, and not again. Each has a
read-only twin, which sends the same and ignores its input.
"""

from __future__ import annotations

from ur_cartesian_driver.sim.controller import Controller
from ur_cartesian_driver.sim.interfaces.primary_commands import execute_command
from ur_cartesian_driver.sim.interfaces.primary_stream import version_frame
from ur_cartesian_driver.sim.interfaces.tcp_server import ClientSession
from ur_cartesian_driver.sim.programs.script_upload import UploadDecoder


class ScriptSession(ClientSession):
    """Executes programs and commands; the first state comes in the cycle of the connection."""

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
    """A client of the primary or secondary interface, which begin with the version."""

    def open(self) -> bytes:
        """Introduce the controller: clients wait for this before anything else."""
        return version_frame(self._controller)


class ReadOnlySession(ClientSession):
    """A client of a read-only twin."""

    def __init__(self, greeting: bytes) -> None:
        """
        Ignore the client's messages.

        :param greeting: the first bytes of the interface.
        """
        self._greeting = greeting

    def open(self) -> bytes:
        """Begin as the interface does."""
        return self._greeting

    def feed(self, data: bytes) -> bytes:
        """Ignore it."""
        return b''
