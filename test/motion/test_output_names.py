# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Safe outputs are read from texts, or refused with a sentence."""

import pytest

from ur_cartesian_driver.motion.goal.goal import OutputKind, SafeOutput
from ur_cartesian_driver.motion.goal.output_names import parse_safe_outputs
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.planning.options import PlanningOptions


def test_a_text_has_kind_pin_value_domain_and_restore():
    assert parse_safe_outputs(
        ('standard_digital 3 0', ' ', 'Tool_digital 1 1 restore', 'standard_analog 0 0.5 voltage')
    ) == (
        SafeOutput(output=OutputKind.STANDARD_DIGITAL, pin=3, value=0.0),
        SafeOutput(output=OutputKind.TOOL_DIGITAL, pin=1, value=1.0, restore=True),
        SafeOutput(
            output=OutputKind.STANDARD_ANALOG, pin=0, value=0.5, domain=AnalogDomain.VOLTAGE
        ),
    )


@pytest.mark.parametrize(
    ('texts', 'words'),
    [
        (('restore',), 'cannot be read'),
        (('digital 3 0',), 'kind is one of standard_digital, configurable_digital'),
        (('standard_digital 3',), 'cannot be read'),
        (('standard_digital 3 0 voltage',), 'cannot be read'),
        (('standard_digital x 0',), 'cannot be read'),
        (('standard_digital 8 0',), 'the pin of "standard_digital 8 0" is 8'),
        (('tool_digital 0 0.5',), 'a tool digital output takes 0 (off) or 1 (on)'),
        (('standard_analog 0 nan',), 'the value of "standard_analog 0 nan" is nan'),
        (('standard_analog 0 1 ohm',), 'drives "ohm"; write current or voltage'),
        (('tool_digital 0 0', 'tool_digital 0 1'), 'tool digital output 0 is named twice'),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_sentence(texts, words):
    with pytest.raises(ValueError, match=r'^safe_outputs: ') as refusal:
        PlanningOptions(safe_outputs=texts)
    assert words in str(refusal.value)
    assert str(refusal.value).endswith('.')
