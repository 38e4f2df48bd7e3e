# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The robot loop's end of the pipe, which sends notifications to the owner."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from ur_cartesian_driver.driver.ipc.channel import (
    LogMessage,
    LoopHeartbeat,
    MotionProgress,
    Notification,
    pack,
    ServoProgress,
    SignalsChanged,
)

#: Notifications that are soon out of date: they are dropped while more than :data:`MAX_UNREAD`
#: bytes wait for an owner that does not read, because the owner may hang for days.
DROPPABLE = (LoopHeartbeat, LogMessage, MotionProgress, ServoProgress, SignalsChanged)
MAX_UNREAD = 1 << 20


class OwnerPipe:
    """Sends notifications without waiting for the owner."""

    def __init__(self, writer: asyncio.StreamWriter, before_send: Callable[[], None]) -> None:
        """
        Begin with no dropped notification.

        :param before_send: called before each notification is sent.
        """
        self._writer, self._before_send = writer, before_send
        #: The newest inputs and outputs, if they were dropped.
        self._withheld_signals: SignalsChanged | None = None

    def send(self, notification: Notification) -> None:
        """Send a notification, or drop it if it may be dropped and the owner does not read."""
        self._before_send()
        if self._writer.is_closing():
            return
        is_dropped = (
            isinstance(notification, DROPPABLE)
            and self._writer.transport.get_write_buffer_size() > MAX_UNREAD
        )
        if isinstance(notification, SignalsChanged):
            self._withheld_signals = notification if is_dropped else None
        if not is_dropped:
            self._writer.write(pack(notification))

    def resend_signals(self) -> None:
        """Send the newest inputs and outputs again, if they were dropped."""
        if self._withheld_signals is not None:
            self.send(self._withheld_signals)

    def log(self, level: int, text: str) -> None:
        """Send a line for the owner's log."""
        self.send(LogMessage(level=level, text=text))
