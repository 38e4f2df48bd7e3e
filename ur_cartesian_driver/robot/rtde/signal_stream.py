# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Receives inputs, outputs and tool data of the robot through a separate, slow RTDE connection.

In the packets of the robot state, at 500 Hz, these fields would take most of the computing time
for no benefit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import nan
from typing import Any, NoReturn

from ur_cartesian_driver.motion.errors import ProtocolError
from ur_cartesian_driver.motion.state.io_signals import (
    AnalogChannel,
    AnalogDomain,
    DigitalChannels,
    Signals,
)
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec
from ur_cartesian_driver.protocol.rtde.rtde_recipe import RtdeValues
from ur_cartesian_driver.robot.rtde.rtde_connection import RtdeConnection, SILENCE_TIMEOUT
from ur_cartesian_driver.robot.transport import AttemptLog, Backoff

REQUIRED_FIELDS = ('actual_digital_input_bits', 'actual_digital_output_bits')
#: Outputs that old software may lack.
OPTIONAL_FIELDS = (
    'analog_io_types',
    'standard_analog_input0',
    'standard_analog_input1',
    'standard_analog_output0',
    'standard_analog_output1',
    'tool_mode',
    'tool_analog_input_types',
    'tool_analog_input0',
    'tool_analog_input1',
    'tool_output_voltage',
    'tool_output_current',
    'tool_temperature',
    'payload',
    'payload_cog',
    'payload_inertia',
    'target_gravity',
)


class SignalStream:
    """Keeps a separate connection for the signals while the robot is connected."""

    def __init__(
        self, on_signals: Callable[[Signals], None], on_warning: Callable[[str], None]
    ) -> None:
        """
        Prepare; :meth:`stay_connected` connects.

        :param on_signals: called when a signal has changed.
        :param on_warning: called with the reason when the connection was lost.
        """
        self._on_signals = on_signals
        self._attempts = AttemptLog(on_warning, on_warning)
        self._last: Signals | None = None

    async def stay_connected(self, host: str, port: int, frequency: float) -> NoReturn:
        """Keep connected until cancelled."""
        retry = Backoff()
        while True:
            connection = RtdeConnection(
                RtdeClientCodec(
                    outputs=(*REQUIRED_FIELDS, *OPTIONAL_FIELDS),
                    optional_outputs=OPTIONAL_FIELDS,
                    frequency=frequency,
                ),
                self._on_values,
                silence=max(SILENCE_TIMEOUT, 5.0 / frequency),
            )
            try:
                await connection.open(host, port)
                retry.reset()
                reason = await connection.ended()
            except (OSError, ProtocolError) as error:
                reason = str(error)
            finally:
                connection.close()
            self._attempts.failed(f'inputs and outputs are not reported: {reason}')
            await retry.wait()

    def _on_values(self, names: Sequence[str], values: RtdeValues) -> None:
        self._attempts.succeeded()
        now = signals_from_rtde(dict(zip(names, values, strict=True)))
        if now != self._last:
            self._last = now
            self._on_signals(now)


def signals_from_rtde(values: Mapping[str, Any]) -> Signals:
    """Return the signals in one data package, which may lack optional fields."""
    types, tool_types = values.get('analog_io_types', 0), values.get('tool_analog_input_types', 0)

    def pair(name: str, domains: int) -> tuple[AnalogChannel, AnalogChannel]:
        first, second = (
            AnalogChannel(
                domain=AnalogDomain(domains >> i & 1), value=values.get(f'{name}{i}', nan)
            )
            for i in (0, 1)
        )
        return first, second

    return Signals(
        inputs=DigitalChannels.from_bits(values['actual_digital_input_bits']),
        outputs=DigitalChannels.from_bits(values['actual_digital_output_bits']),
        analog_inputs=pair('standard_analog_input', types),
        analog_outputs=pair('standard_analog_output', types >> 2),
        tool_analog_inputs=pair('tool_analog_input', tool_types),
        tool_voltage=values.get('tool_output_voltage', 0),
        tool_current=values.get('tool_output_current', nan),
        tool_temperature=values.get('tool_temperature', nan),
        tool_mode=values.get('tool_mode', 0),
        payload=values.get('payload', nan),
        payload_cog=values.get('payload_cog', (nan,) * 3),
        payload_inertia=values.get('payload_inertia', (nan,) * 6),
        gravity=values.get('target_gravity', (nan,) * 3),
    )
