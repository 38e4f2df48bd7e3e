# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The RTDE connection of streamed set-points: opened for a goal, closed behind it.

Inputs belong to the client that asked for them, so they are held no longer than they are needed.
What the robot program reports of the set-points comes on the same connection, so the packets that
every other goal waits for stay as they are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from ur_cartesian_driver.motion.servo import ServoFeedback
from ur_cartesian_driver.motion.state import RuntimeState
from ur_cartesian_driver.protocol.registers import SERVO_INPUTS, SERVO_OUTPUTS
from ur_cartesian_driver.protocol.rtde import RtdeClient, Values
from ur_cartesian_driver.robot.rtde_connection import RtdeConnection

OUTPUTS = ('timestamp', 'speed_scaling', 'runtime_state', *SERVO_OUTPUTS)


class ServoConnection(RtdeConnection):
    """Used once, from one event loop: run it, write to it, close it."""

    def __init__(self, on_feedback: Callable[[ServoFeedback], None]) -> None:
        """
        Prepare a connection.

        :param on_feedback: a packet came in.
        """
        super().__init__(RtdeClient(outputs=OUTPUTS, inputs=SERVO_INPUTS), self._on_row)
        self._on_feedback = on_feedback
        self._is_open = True

    async def run(self, host: str, port: int, on_end: Callable[[str], None]) -> None:
        """
        Open it, and serve until it ends or is closed.

        :param on_end: it could not be opened, or was lost, and why; not after
            :meth:`close`.
        """
        try:
            await self.open(host, port)
            # Whoever has closed it meanwhile could not hang up yet.
            reason = await self.ended() if self._is_open else ''
        except OSError as error:
            reason = str(error)
        finally:
            super().close()
        if self._is_open:
            self._is_open = False
            on_end(reason)

    def write_row(self, values: Sequence[float]) -> None:
        """Write all inputs in their order, if the connection is there."""
        if self._is_open and self._inputs:
            self._connection.send(self._inputs[0].pack(values))

    def close(self) -> None:
        """Hang up, behind what was written."""
        self._is_open = False
        super().close()

    def _on_row(self, _: Sequence[str], values: Values) -> None:
        if self._is_open:
            self._on_feedback(feedback_of(values))


def feedback_of(values: tuple[Any, ...]) -> ServoFeedback:
    """Return a packet with the values of :data:`OUTPUTS`."""
    timestamp, scaling, state, mode, sequence, lag, done, repeats, skipped, size, over = values
    return ServoFeedback(
        timestamp=timestamp, speed_scaling=scaling, playing=state == RuntimeState.PLAYING,
        mode=mode, last_sequence=sequence, lag=lag, setpoints_done=done, repeats=repeats,
        skipped=skipped, buffer_size=size, overflows=over)
