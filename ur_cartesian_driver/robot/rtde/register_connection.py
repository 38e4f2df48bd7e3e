# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The RTDE connection for the registers of the robot program, open during one goal.

Inputs belong to the client that requested them, so they are held only while they are needed. The
controller frees the inputs of a client (perhaps of the previous goal) when it finds the connection
closed; until then the request is repeated for a short while.

The program's reports in registers arrive on the same connection, so the packets of the robot
state, which every goal needs, do not contain them.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from ur_cartesian_driver.motion.events import Event, OffsetReceived, ServoReceived
from ur_cartesian_driver.motion.geometry.vectors import vector3
from ur_cartesian_driver.motion.plan.offset_band import OffsetFeedback
from ur_cartesian_driver.motion.state.effective_speed import EffectiveSpeed
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.motion.state.servo_report import ServoFeedback
from ur_cartesian_driver.protocol.program.registers import (
    OFFSET_INPUTS,
    OFFSET_OUTPUTS,
    SERVO_INPUTS,
    SERVO_OUTPUTS,
)
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
#: Time for all attempts to get the inputs [s]; pause between two attempts [s].
OPEN_TIMEOUT, RETRY_PERIOD = 0.2, 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class RegisterExchange:
    """Names of the RTDE outputs and inputs of a connection, and the receiver of the outputs."""

    outputs: tuple[str, ...]
    inputs: tuple[str, ...]
    take: Callable[[RtdeValues], None]


class RegisterConnection:
    """A connection for one goal, used from one event loop: run it, write to it, close it."""

    def __init__(self, exchange: RegisterExchange, *, lower_registers: bool) -> None:
        """
        Prepare a connection.

        :param lower_registers: whether the robot program uses the registers from 0 on.
        """
        self._exchange, self._lower_registers = exchange, lower_registers
        self._is_open = True
        self._attempt: _Attempt | None = None

    async def run(self, host: str, port: int, on_end: Callable[[str], None]) -> None:
        """
        Open the connection, and serve it until it ends or is closed.

        :param on_end: called with the reason if the connection could not be opened, or was lost;
            never after :meth:`close`.
        """
        loop = asyncio.get_running_loop()
        give_up, reason = loop.time() + OPEN_TIMEOUT, ''
        while self._is_open:
            self._attempt = attempt = _Attempt(self._exchange, self._on_row, self._lower_registers)
            reason = await attempt.serve(host, port)
            if attempt.has_inputs or loop.time() >= give_up:
                break
            await asyncio.sleep(RETRY_PERIOD)
        if self._is_open:
            self._is_open = False
            on_end(reason)

    def write_row(self, values: Sequence[float]) -> None:
        """Write all inputs in their order, if the connection is open."""
        if self._is_open and self._attempt is not None:
            self._attempt.write_row(values)

    def close(self) -> None:
        """Close after sending the written inputs."""
        self._is_open = False
        if self._attempt is not None:
            self._attempt.close()

    def _on_row(self, _: Sequence[str], values: RtdeValues) -> None:
        if self._is_open:
            self._exchange.take(values)


class _Attempt(RtdeConnection):
    """One connection to the robot, which may refuse the inputs."""

    def __init__(
        self,
        exchange: RegisterExchange,
        on_values: Callable[[Sequence[str], RtdeValues], None],
        lower_registers: bool,
    ) -> None:
        codec = RtdeClientCodec(exchange.outputs, exchange.inputs, lower_registers=lower_registers)
        super().__init__(codec, on_values)
        self._is_wanted = True

    @property
    def has_inputs(self) -> bool:
        """Whether the robot has granted the inputs."""
        return bool(self._inputs)

    async def serve(self, host: str, port: int) -> str:
        """Serve the connection, and return the reason of its end."""
        try:
            await self.open(host, port)
            # If close() was called before the connection was made, it had nothing to close.
            return await self.ended() if self._is_wanted else ''
        except OSError as error:
            return str(error)
        finally:
            self.close()

    def write_row(self, values: Sequence[float]) -> None:
        """Write all inputs in their order, once they are granted."""
        if self._inputs:
            self._connection.send(self._inputs.pack(values))

    def close(self) -> None:
        """Close after sending the written inputs."""
        self._is_wanted = False
        super().close()


def servo_exchange(on_event: Callable[[Event], None]) -> RegisterExchange:
    """Return the exchange of the buffered servo."""
    effective_speed = EffectiveSpeed()
    return RegisterExchange(
        outputs=SERVO_FIELDS,
        inputs=SERVO_INPUTS,
        take=lambda values: on_event(
            ServoReceived(feedback=feedback_from_rtde(values, effective_speed))
        ),
    )


def offset_exchange(on_event: Callable[[Event], None]) -> RegisterExchange:
    """Return the exchange of a trajectory with path offsets."""

    def take(values: Sequence[Any]) -> None:
        sequence, *numbers = values
        feedback = OffsetFeedback(
            last_sequence=sequence, offset=vector3(numbers[:3]), shift=vector3(numbers[3:])
        )
        on_event(OffsetReceived(feedback=feedback))

    return RegisterExchange(outputs=OFFSET_OUTPUTS, inputs=OFFSET_INPUTS, take=take)


def feedback_from_rtde(values: Sequence[Any], effective_speed: EffectiveSpeed) -> ServoFeedback:
    """
    Return the feedback in a packet with the values of :data:`SERVO_FIELDS`.

    :param effective_speed: updated with all earlier packets, and by this call.
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
