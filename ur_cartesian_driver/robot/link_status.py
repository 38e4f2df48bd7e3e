# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The status of a link: its state, the next step before a goal can run, and the last error."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
import logging
from typing import Any

from ur_cartesian_driver.robot.connection_status import ConnectionStatus, timestamped
from ur_cartesian_driver.robot.lifecycle import ConnectionEvent, ConnectionState, next_state
from ur_cartesian_driver.robot.transport import AttemptLog

#: States in which the robot is out of reach or the wrong one; the message is then the reason for
#: the state, not the next step.
OUT_OF_REACH = frozenset({ConnectionState.DISCONNECTED, ConnectionState.REFUSED})
#: The states through which each attempt to connect passes.
ATTEMPTING = frozenset({*OUT_OF_REACH, ConnectionState.CONNECTING})
#: Delay before the next step in the state CONNECTED is logged [s]: a program that is about to
#: connect makes the step unnecessary.
LOG_DELAY = 1.0


class LinkStatus:
    """Changes the status, and reports and logs each change; used from one event loop."""

    def __init__(
        self,
        message: str,
        required_action: Callable[[ConnectionState], str],
        on_status: Callable[[ConnectionStatus], None],
        on_log: Callable[[int, str], None],
    ) -> None:
        """
        Begin disconnected.

        :param required_action: returns, for a state of the connection, the next step before a
            goal can run, as a sentence.
        """
        self._required_action, self._on_status, self._on_log = required_action, on_status, on_log
        self._attempts = AttemptLog(self._log_info, self._log_info)
        self.current = ConnectionStatus(message=message)

    @property
    def state(self) -> ConnectionState:
        """The state of the connection."""
        return self.current.state

    def apply(self, event: ConnectionEvent, **changes: Any) -> None:
        """Change the state by an event, as the life cycle's table says, and other fields, too."""
        self.update(state=next_state(self.state, event), **changes)

    def update(self, **changes: Any) -> None:
        """Change fields of the status, and derive the next step."""
        status = replace(self.current, **changes)
        if status.state not in OUT_OF_REACH:
            status = replace(status, message=self._required_action(status.state))
        if status != self.current:
            before, self.current = self.current, status
            # This comes first, because on_status resumes waiting code at once.
            self._log_change(before, status)
            self._on_status(status)

    def error(self, text: str) -> None:
        """Set the last error to a text, and log it."""
        self.update(last_error=timestamped(text))
        self._on_log(logging.ERROR, text)

    def _log_change(self, before: ConnectionStatus, now: ConnectionStatus) -> None:
        """Log the next step, for users who do not see the status."""
        if now.state not in ATTEMPTING and before.state in ATTEMPTING:
            self._attempts.succeeded()
        if now.message and now.message != before.message:
            if now.state is ConnectionState.CONNECTED:
                asyncio.get_running_loop().call_later(LOG_DELAY, self._log_if_still, now.message)
            elif now.state in ATTEMPTING:
                self._attempts.failed(now.message)
            else:
                self._log_info(now.message)
        accepted = (ConnectionState.READY, ConnectionState.EXECUTING)
        if now.state is ConnectionState.READY and before.state not in accepted:
            self._log_info('The robot program is connected: ready for goals.')

    def _log_info(self, text: str) -> None:
        self._on_log(logging.INFO, text)

    def _log_if_still(self, message: str) -> None:
        if self.current.message == message:
            self._log_info(message)
