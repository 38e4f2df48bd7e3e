# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The values written to RTDE inputs, and the reports of their effects."""

from itertools import product

import pytest

from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.goal.output_names import OUTPUTS
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.protocol.rtde.rtde_fields import INPUT_TYPES, OUTPUT_TYPES
from ur_cartesian_driver.robot.services import rtde_input_writer
from ur_cartesian_driver.robot.services.service_calls import SetOutputCall, SetSpeedSliderCall

DIGITAL = [
    SetOutputCall(kind=kind, pin=pin, value=value)
    for kind, value in product(list(OutputKind)[:3], (0.0, 1.0))
    for pin in range(OUTPUTS[kind][1])
]
ANALOG = [
    SetOutputCall(kind=OutputKind.STANDARD_ANALOG, pin=pin, value=0.5, domain=domain)
    for pin, domain in product((0, 1), AnalogDomain)
]


@pytest.mark.parametrize(
    'input_write',
    [
        rtde_input_writer.speed_slider_write(SetSpeedSliderCall(fraction=0.5)),
        *map(rtde_input_writer.output_write, (*DIGITAL[:1], *ANALOG[:1])),
    ],
    ids=lambda w: w.outputs[0],
)
def test_the_names_exist(input_write):
    assert set(input_write.inputs) <= set(INPUT_TYPES)
    assert set(input_write.outputs) <= set(OUTPUT_TYPES)


def test_each_digital_output_has_a_mask_and_a_bit_of_its_own():
    seen = set()
    for call in DIGITAL:
        input_write = rtde_input_writer.output_write(call)
        (mask_name, mask), (name, value) = input_write.inputs.items()
        assert mask_name == f'{name}_mask'
        assert value == (mask if call.value else 0)
        seen.add((name, mask, call.value))
    assert len(seen) == len(DIGITAL) == 36


def test_the_effect_is_that_very_bit():
    for call in DIGITAL:
        input_write = rtde_input_writer.output_write(call)
        (bit,) = [
            i
            for i in range(18)
            if input_write.done(
                {'actual_digital_output_bits': 1 << i if call.value else ~(1 << i)}
            )
        ]
        first = {
            OutputKind.STANDARD_DIGITAL: 0,
            OutputKind.CONFIGURABLE_DIGITAL: 8,
            OutputKind.TOOL_DIGITAL: 16,
        }[call.kind]
        assert bit == first + call.pin


@pytest.mark.parametrize('call', ANALOG, ids=lambda call: f'{call.domain.name} {call.pin}')
def test_an_analog_output_is_there_in_its_domain_only(call):
    input_write = rtde_input_writer.output_write(call)
    half = {AnalogDomain.CURRENT: 0.012, AnalogDomain.VOLTAGE: 5.0}[call.domain]
    right, wrong = call.domain << (2 + call.pin), (1 - call.domain) << (2 + call.pin)
    shown = f'standard_analog_output{call.pin}'
    assert input_write.done({shown: half, 'analog_io_types': right})
    assert not input_write.done({shown: half, 'analog_io_types': wrong})
    assert not input_write.done({shown: 0.9 * half, 'analog_io_types': right})


def test_a_slider_may_be_off_by_what_the_pendant_rounds():
    input_write = rtde_input_writer.speed_slider_write(SetSpeedSliderCall(fraction=0.333))
    assert input_write.done({'target_speed_fraction': 0.33})
    assert not input_write.done({'target_speed_fraction': 0.35})
