# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Messages of the controller to all clients of the primary interface, and the log."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable

from ur_cartesian_driver.motion.state.rtde_state import SafetyMode
from ur_cartesian_driver.protocol.client_interfaces.primary_messages import (
    ErrorCodeMessage,
    KeyMessage,
    PrimaryMessage,
    RawMessage,
    ReportLevel,
    RuntimeExceptionMessage,
    SafetyModeMessage,
    TextMessage,
)
from ur_cartesian_driver.sim.state.controller_state import Popup

#: Bound on the number of messages to be sent, and on the number of log lines.
_MAX_LOG_LINES = 10_000
#: Longest text in a message [bytes]: a frame must stay below 4092.
_MAX_TEXT_LENGTH = 4000

_POPUP, _REQUEST = 2, 9
#: Timestamp of the version message, as recorded on four robots (software 3.5 to 5.1), and of the
#: exception of a program that does not compile, as recorded in URSim (5.4).
NO_TIMESTAMP = 2**64 - 1


class ControllerMessages:
    """Collects messages; the primary stream takes them once per cycle."""

    def __init__(self, now: Callable[[], float]) -> None:
        """
        Begin with no messages.

        :param now: the controller's clock [s].
        """
        self._now = now
        self.pending: deque[PrimaryMessage] = deque(maxlen=_MAX_LOG_LINES)
        #: Called with code and argument of each error.
        self.on_error: Callable[[int, int], None] | None = None
        #: Texts of programs, and errors; one per line.
        self.log: deque[str] = deque(maxlen=_MAX_LOG_LINES)

    def take(self) -> list[PrimaryMessage]:
        """Return the messages since the last call."""
        messages = list(self.pending)
        self.pending.clear()
        return messages

    def note(self, text: str) -> None:
        """Write to the log only."""
        self.log.append(text)

    def text(self, text: str) -> None:
        """Send a text of a program or of the controller, and write it to the log."""
        self.log.append(text)
        self.pending.append(TextMessage(timestamp=self._stamp(), text=_cut(text)))

    def key(self, title: str, text: str) -> None:
        """Report that a program has started, stopped or failed."""
        self.pending.append(KeyMessage(timestamp=self._stamp(), title=title, text=_cut(text)))

    def exception(self, line: int, column: int, text: str, *, at_start: bool = False) -> None:
        """
        Report an error that stops a program; line and column begin at 1.

        :param at_start: whether the program has not started, because it does not compile.
        """
        self.log.append(f'{line}:{column}: {text}')
        self.pending.append(
            RuntimeExceptionMessage(
                timestamp=NO_TIMESTAMP if at_start else self._stamp(),
                line=max(0, line),
                column=max(0, column),
                text=_cut(text),
            )
        )

    def error(self, code: int, argument: int, text: str) -> None:
        """Send an error code as a warning, as the robot does even for a protective stop."""
        message = ErrorCodeMessage(
            timestamp=self._stamp(),
            code=code,
            argument=argument,
            level=ReportLevel.WARNING,
            text=_cut(text),
        )
        self.log.append(f'{message.label}: {text}')
        self.pending.append(message)
        if self.on_error is not None:
            self.on_error(code, argument)

    def safety_mode(self, mode: SafetyMode) -> None:
        """Send a new safety mode to the clients."""
        self.pending.append(SafetyModeMessage(timestamp=self._stamp(), safety_mode=mode))

    def popup(self, popup: Popup) -> None:
        """
        Report that a window is shown.

        The body is: u32 number and u32 type of the request, u8 each for warning, error and
        blocking, u8 length of the title, title, text. Six published clients read this layout.
        """
        title = _cut(popup.title, 255).encode(errors='replace')
        flags = bytes([popup.warning, popup.error, popup.blocking])
        self.pending.append(
            RawMessage(
                message_type=_POPUP,
                timestamp=self._stamp(),
                content=bytes(8)
                + flags
                + bytes([len(title)])
                + title
                + _cut(popup.text, _MAX_TEXT_LENGTH - 255).encode(errors='replace'),
            )
        )

    def request(self, kind: int, text: str) -> None:
        """
        Report that a window requests a value.

        The body is: u32 number of the request (0), u32 type of the value, text. Three published
        clients read this layout; the numbers of the types are assumed.

        :param kind: the type of the value; 0 = boolean, 1 = integer, 2 = float, 3 = string.
        """
        self.pending.append(
            RawMessage(
                message_type=_REQUEST,
                timestamp=self._stamp(),
                content=bytes(4) + kind.to_bytes(4, 'big') + _cut(text).encode(errors='replace'),
            )
        )

    def _stamp(self) -> int:
        return round(self._now() * 1e6)


def _cut(text: str, length: int = _MAX_TEXT_LENGTH) -> str:
    """Return the text, cut to ``length`` bytes of UTF-8 (at most four bytes per character)."""
    if len(text) <= length // 4:
        return text
    return text.encode(errors='replace')[:length].decode(errors='ignore')
