# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Script commands, against the bytes of the manufacturer's library."""

import json
from pathlib import Path
import struct
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.motion.goal.goal import OutputKind, SafeOutput
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.protocol.program.script_command import (
    encode,
    EndToolContactCommand,
    SafeOutputsAction,
    ScriptCommand,
    SetGravityCommand,
    SetPayloadCommand,
    SetSafeOutputsCommand,
    SetTargetPayloadCommand,
    SetTcpOffsetCommand,
    StartToolContactCommand,
    TcpPersistence,
    ToolContactResult,
    ToolContactResultDecoder,
    ZeroFtSensorCommand,
)

GOLDEN = json.loads((Path(__file__).parent / 'golden' / 'script_commands.json').read_text())
CLASSES: dict[str, Any] = {
    'zero_ftsensor': ZeroFtSensorCommand,
    'set_payload': SetPayloadCommand,
    'start_tool_contact': StartToolContactCommand,
    'end_tool_contact': EndToolContactCommand,
    'set_gravity': SetGravityCommand,
    'set_tcp_offset': SetTcpOffsetCommand,
    'set_target_payload': SetTargetPayloadCommand,
}
SENT = [case for case in GOLDEN['cases'] if case['command'] in CLASSES]


def case_id(case):
    return f'{case["command"]} {case["robot_version"]}'


@pytest.mark.parametrize('case', SENT, ids=case_id)
def test_bytes_are_those_of_the_library(case):
    args = {
        name: tuple(value) if isinstance(value, list) else value
        for name, value in case['args'].items()
    }
    assert encode(CLASSES[case['command']](**args)).hex() == case['hex']


def test_all_commands_that_the_driver_sends_are_covered():
    ours = {ScriptCommand.SET_SAFE_OUTPUTS, ScriptCommand.SET_TOOL_VOLTAGE}
    assert {cls.command for cls in CLASSES.values()} == set(ScriptCommand) - ours
    assert {case['command'] for case in SENT if not case['refused']} == set(CLASSES)


def test_safe_outputs_have_their_words():
    outputs = (
        SafeOutput(output=OutputKind.STANDARD_DIGITAL, pin=3, value=0.0),
        SafeOutput(output=OutputKind.CONFIGURABLE_DIGITAL, pin=7, value=1.0),
        SafeOutput(output=OutputKind.TOOL_DIGITAL, pin=1, value=0.0),
        SafeOutput(
            output=OutputKind.STANDARD_ANALOG, pin=1, value=0.25, domain=AnalogDomain.VOLTAGE
        ),
    )
    command = SetSafeOutputsCommand(action=SafeOutputsAction.ARM, token=2**31 - 1, outputs=outputs)
    words = struct.unpack('>28i', encode(command))
    assert words[:3] == (100, 1, 2**31 - 1)
    assert words[3:21] == (*(-1, -1, -1, 0), *(-1,) * 11, 1, -1, 0)
    assert words[21:] == (-1, 0, 250_000, 1, 0, 0, 0)


@pytest.mark.parametrize(
    ('command', 'text'),
    [
        (SetPayloadCommand(mass=float('nan')), 'mass is nan'),
        (SetPayloadCommand(mass=1.0, cog=(0.0, 3000.0, 0.0)), r'cog\[1\] is 3000'),
    ],
)
def test_a_value_out_of_range_is_refused_with_its_name(command, text):
    with pytest.raises(LocalProtocolError, match=text):
        encode(command)


@given(st.tuples(*[st.floats(-2147, 2147)] * 6), st.floats(0, 100), st.floats(0, 2147))
def test_values_are_rounded_to_the_nearest_unit(six, mass, time):
    command = SetTargetPayloadCommand(mass=mass, cog=six[:3], inertia=six, transition_time=time)
    number, *words = struct.unpack('>28i', encode(command))
    assert number == ScriptCommand.SET_TARGET_PAYLOAD
    assert [word / 1e6 for word in words] == pytest.approx(
        [mass, *six[:3], *six, time, *[0.0] * 16], abs=0.5e-6 + 1e-9, rel=0.0
    )


@pytest.mark.parametrize(
    ('result', 'text'),
    [(ToolContactResult.SUCCESS, '00000000'), (ToolContactResult.CANCELED, '00000001')],
)
def test_results_of_a_tool_contact(result, text):
    assert ToolContactResultDecoder().feed(bytes.fromhex(text) * 2) == [result, result]
    with pytest.raises(RemoteProtocolError, match='00000002'):
        ToolContactResultDecoder().feed(b'\0\0\0\2')


@pytest.mark.parametrize('persistence', list(TcpPersistence))
def test_the_persistence_of_a_tcp_is_a_word_that_other_programs_ignore(persistence):
    plain = encode(SetTcpOffsetCommand(offset=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6)))
    command = SetTcpOffsetCommand(offset=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6), persistence=persistence)
    sent = encode(command)
    assert sent[:28] == plain[:28]
    assert struct.unpack('>21i', sent[28:]) == (persistence, *(0,) * 20)
