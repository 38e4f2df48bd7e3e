# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Write RTDE inputs of a robot once, and wait for the effect.

Each write uses a connection of its own: inputs belong to the client that requested them until it
disconnects, and fieldbuses and other programs need them back at once. Written values stay set.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isclose
from typing import Any

from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec
from ur_cartesian_driver.protocol.rtde.rtde_recipe import RtdeValue, RtdeValues
from ur_cartesian_driver.robot.rtde.rtde_connection import RtdeConnection
from ur_cartesian_driver.robot.services.service_calls import SetOutputCall, SetSpeedSliderCall

#: Longest wait for the robot to report the effect of a write [s].
EFFECT_TIMEOUT = 1.0

_DIGITAL: Mapping[OutputKind, tuple[str, int]] = {
    OutputKind.STANDARD_DIGITAL: ('standard_digital_output', 0),
    OutputKind.CONFIGURABLE_DIGITAL: ('configurable_digital_output', 8),
    OutputKind.TOOL_DIGITAL: ('tool_digital_output', 16),
}
#: (smallest, largest) value of an analog output: current [A], voltage [V].
RANGES: Mapping[AnalogDomain, tuple[float, float]] = {
    AnalogDomain.CURRENT: (0.004, 0.020),
    AnalogDomain.VOLTAGE: (0.0, 10.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class InputWrite:
    """
    Values to write, and the condition by which their effect is recognised.

    :param inputs: values by the names of RTDE inputs.
    :param outputs: names of the RTDE outputs that show the effect.
    :param done: returns whether the values of these outputs show the effect.
    """

    inputs: Mapping[str, RtdeValue]
    outputs: tuple[str, ...]
    done: Callable[[Mapping[str, Any]], bool]


def speed_slider_write(call: SetSpeedSliderCall) -> InputWrite:
    """Return the write that moves the speed slider."""
    return InputWrite(
        inputs={'speed_slider_mask': 1, 'speed_slider_fraction': call.fraction},
        outputs=('target_speed_fraction',),
        # The pendant shows whole percents.
        done=lambda values: isclose(values['target_speed_fraction'], call.fraction, abs_tol=0.006),
    )


def output_write(call: SetOutputCall) -> InputWrite:
    """Return the write that sets an output."""
    return _analog(call) if call.is_analog else _digital(call)


def joint_write(calls: Sequence[SetOutputCall]) -> InputWrite:
    """Return the write that sets several outputs of one kind at once."""
    writes = [output_write(call) for call in calls]
    inputs: dict[str, RtdeValue] = {}
    for write in writes:
        for name, value in write.inputs.items():  # masks and bits are joined, values are not
            before = inputs.get(name)
            if isinstance(value, int) and isinstance(before, int):
                inputs[name] = before | value
            else:
                inputs[name] = value
    return InputWrite(
        inputs=inputs,
        outputs=tuple(dict.fromkeys(name for write in writes for name in write.outputs)),
        done=lambda values: all(write.done(values) for write in writes),
    )


def value_before(call: SetOutputCall, values: Mapping[str, Any]) -> SetOutputCall:
    """Return the call that sets an output back to the value reported before its write."""
    if not call.is_analog:
        _, first_bit = _DIGITAL[call.kind]
        bit = values['actual_digital_output_bits'] >> (first_bit + call.pin) & 1
        return replace(call, value=float(bit))
    domain = AnalogDomain(values['analog_io_types'] >> (2 + call.pin) & 1)
    low, high = RANGES[domain]
    fraction = (values[f'standard_analog_output{call.pin}'] - low) / (high - low)
    return replace(call, value=min(max(fraction, 0.0), 1.0), domain=domain)


def _digital(call: SetOutputCall) -> InputWrite:
    name, first_bit = _DIGITAL[call.kind]
    return InputWrite(
        inputs={f'{name}_mask': 1 << call.pin, name: round(call.value) << call.pin},
        outputs=('actual_digital_output_bits',),
        done=lambda values: (
            (values['actual_digital_output_bits'] >> (first_bit + call.pin)) & 1
            == round(call.value)
        ),
    )


def _analog(call: SetOutputCall) -> InputWrite:
    low, high = RANGES[call.domain]
    expected = low + call.value * (high - low)
    shown = f'standard_analog_output{call.pin}'
    return InputWrite(
        inputs={
            'standard_analog_output_mask': 1 << call.pin,
            'standard_analog_output_type': call.domain << call.pin,
            f'standard_analog_output_{call.pin}': call.value,
        },
        outputs=(shown, 'analog_io_types'),
        done=lambda values: (
            isclose(values[shown], expected, abs_tol=0.02 * (high - low))
            and values['analog_io_types'] >> (2 + call.pin) & 1 == call.domain
        ),
    )


async def write_inputs(host: str, port: int, input_write: InputWrite) -> bool:
    """
    Write inputs, and return whether the robot reported the effect.

    :raises OSError: there is no connection, or another client holds the inputs.
    """
    return await write_and_compare(host, port, input_write, {})


async def write_and_compare(
    host: str, port: int, input_write: InputWrite, before: dict[str, Any]
) -> bool:
    """
    Write inputs, and return whether the robot reported the effect.

    :param before: receives the outputs before the write. Values from an earlier attempt stay,
        because that attempt may have had an effect.
    :raises OSError: there is no connection, or another client holds the inputs.
    """
    reported, done = asyncio.Event(), asyncio.Event()

    def check(names: Sequence[str], values: RtdeValues) -> None:
        now = dict(zip(names, values, strict=True))
        if not reported.is_set():
            before.update({name: now[name] for name in now if name not in before})
            reported.set()
        if input_write.done(now):
            done.set()

    connection = RtdeConnection(
        RtdeClientCodec(outputs=input_write.outputs, inputs=tuple(input_write.inputs)), check
    )
    try:
        await connection.open(host, port)
        async with asyncio.timeout(EFFECT_TIMEOUT):
            await reported.wait()
            done.clear()
            connection.write(input_write.inputs)
            await done.wait()
    except TimeoutError:
        return False
    finally:
        connection.close()
    return True
