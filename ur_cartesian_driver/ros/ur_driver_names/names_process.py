# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A process for the node with the UR driver's names; it ends with the driver's process.

In this process the node takes no time from the driver's executor, and its defects stop no arm.
"""

from __future__ import annotations

from collections.abc import Sequence
import subprocess
import sys

#: How long the process may take to end [s].
END_TIMEOUT = 5.0


class NamesProcess:
    """The process, from its construction to :meth:`close`."""

    def __init__(self, driver: str, arguments: Sequence[str]) -> None:
        """
        Start the process.

        :param driver: the full name of the driver's node.
        :param arguments: the arguments of the driver's command: remappings and parameters; the
            driver's own parameters have no effect.
        """
        own = ['--ros-args', '-r', '__node:=ur_driver_names', '-p', f'driver:={driver}', '--']
        module = f'{__package__}.names_node'
        self._process = subprocess.Popen(
            [sys.executable, '-m', module, '--with-parent', *own, *arguments],
            # It is closed when the driver ends, for whatever reason; then the process ends, too.
            stdin=subprocess.PIPE,
            # Ctrl-C reaches the driver alone, whose goals still get their results.
            start_new_session=True,
        )

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(END_TIMEOUT)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
