# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The RTDE connection for streamed set-points, open during one goal.

Inputs belong to the client that requested them, so they are held only while they are needed. The
controller frees the inputs of a client (maybe of the goal before) when it finds the connection
closed; until then the request is repeated for a short while.

The feedback of the servo arrives on the same connection, so the packets of other goals stay as
they are.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import Any

from ur_cartesian_driver.motion.effective_speed import EffectiveSpeed
from ur_cartesian_driver.motion.robot_state import RuntimeState
from ur_cartesian_driver.motion.servo_report import ServoFeedback
from ur_cartesian_driver.protocol.program.registers import SERVO_INPUTS, SERVO_OUTPUTS
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec
from ur_cartesian_driver.protocol.rtde.rtde_recipe import RtdeValues
from ur_cartesian_driver.robot.rtde.rtde_connection import RtdeConnection

SERVO_FIELDS = (
    'timestamp',
    'speed_scaling',
    'target_speed_fraction',
    'runtime_state',
    *SERVO_OUTPUTS,
)
#: How long to try to get the inputs, and the pause between two attempts [s].
OPEN_TIMEOUT, RETRY_PERIOD = 0.2, 0.02


class ServoConnection:
    """Used once, from one event loop: run it, write to it, close it."""

    def __init__(self, on_feedback: Callable[[ServoFeedback], None]) -> None:
        """
        Prepare a connection.

        :param on_feedback: a packet came in.
        """
        self._on_feedback = on_feedback
        self._is_open = True
        self._attempt: _Attempt | None = None
        self._effective_speed = EffectiveSpeed()

    async def run(self, host: str, port: int, on_end: Callable[[str], None]) -> None:
        """
        Open it, and serve until it ends or is closed.

        :param on_end: it could not be opened, or was lost, and why; never after
            :meth:`close`.
        """
        loop = asyncio.get_running_loop()
        give_up, reason = loop.time() + OPEN_TIMEOUT, ''
        while self._is_open:
            self._attempt = attempt = _Attempt(self._on_row)
            reason = await attempt.serve(host, port)
            if attempt.has_inputs or loop.time() >= give_up:
                break
            await asyncio.sleep(RETRY_PERIOD)
        if self._is_open:
            self._is_open = False
            on_end(reason)

    def write_row(self, values: Sequence[float]) -> None:
        """Write all inputs in their order, if the connection is there."""
        if self._is_open and self._attempt is not None:
            self._attempt.write_row(values)

    def close(self) -> None:
        """Close, after what was written is sent."""
        self._is_open = False
        if self._attempt is not None:
            self._attempt.close()

    def _on_row(self, _: Sequence[str], values: RtdeValues) -> None:
        if self._is_open:
            self._on_feedback(feedback_from_rtde(values, self._effective_speed))


class _Attempt(RtdeConnection):
    """One connection to the robot, which may refuse the inputs."""

    def __init__(self, on_values: Callable[[Sequence[str], RtdeValues], None]) -> None:
        super().__init__(RtdeClientCodec(outputs=SERVO_FIELDS, inputs=SERVO_INPUTS), on_values)
        self._is_wanted = True

    @property
    def has_inputs(self) -> bool:
        """Whether the robot has given them."""
        return bool(self._inputs)

    async def serve(self, host: str, port: int) -> str:
        """Serve until it ends, and return why."""
        try:
            await self.open(host, port)
            # Whoever has closed it meanwhile could not hang up yet.
            return await self.ended() if self._is_wanted else ''
        except OSError as error:
            return str(error)
        finally:
            self.close()

    def write_row(self, values: Sequence[float]) -> None:
        """Write all inputs in their order, once they are there."""
        if self._inputs:
            self._connection.send(self._inputs[0].pack(values))

    def close(self) -> None:
        """Close, after what was written is sent."""
        self._is_wanted = False
        super().close()


def feedback_from_rtde(values: Sequence[Any], effective_speed: EffectiveSpeed) -> ServoFeedback:
    """
    Return a packet with the values of :data:`SERVO_FIELDS`.

    :param effective_speed: that of the packets before; it takes this one.
    """
    (timestamp, scaling, slider, state, *feedback) = values
    mode, sequence, lag, done, repeats, skipped, size, over = feedback
    return ServoFeedback(
        timestamp=timestamp,
        effective_speed=effective_speed.update(timestamp, scaling, slider, state),
        playing=state == RuntimeState.PLAYING,
        mode=mode,
        last_sequence=sequence,
        lag=lag,
        setpoints_done=done,
        repeats=repeats,
        skipped=skipped,
        buffer_size=size,
        overflows=over,
    )
