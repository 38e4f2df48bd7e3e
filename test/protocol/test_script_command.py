# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Script commands, against the bytes of the manufacturer's library."""

from contextlib import suppress
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
from ur_cartesian_driver.protocol.framing import encode_result
from ur_cartesian_driver.protocol.program.script_command import (
    COMMAND_SIZE,
    decode,
    encode,
    EndForceModeCommand,
    EndToolContactCommand,
    FtRtdeInputEnableCommand,
    SafeOutputsAction,
    ScriptCommand,
    ScriptCommandDecoder,
    SetFrictionCompensationCommand,
    SetFrictionScalesCommand,
    SetGravityCommand,
    SetPayloadCommand,
    SetSafeOutputsCommand,
    SetTargetPayloadCommand,
    SetTcpOffsetCommand,
    SetToolVoltageCommand,
    StartForceModeCommand,
    StartToolContactCommand,
    TcpPersistence,
    ToolContactResult,
    ToolContactResultDecoder,
    ZeroFtSensorCommand,
)

GOLDEN = json.loads((Path(__file__).parent / 'golden' / 'script_commands.json').read_text())
SENT = [case for case in GOLDEN['cases'] if not case['refused']]
REFUSED = [case for case in GOLDEN['cases'] if case['refused']]
CLASSES: dict[str, Any] = {
    'zero_ftsensor': ZeroFtSensorCommand,
    'set_payload': SetPayloadCommand,
    'set_tool_voltage': SetToolVoltageCommand,
    'start_force_mode': StartForceModeCommand,
    'end_force_mode': EndForceModeCommand,
    'start_tool_contact': StartToolContactCommand,
    'end_tool_contact': EndToolContactCommand,
    'set_friction_compensation': SetFrictionCompensationCommand,
    'ft_rtde_input_enable': FtRtdeInputEnableCommand,
    'set_gravity': SetGravityCommand,
    'set_tcp_offset': SetTcpOffsetCommand,
    'set_friction_scales': SetFrictionScalesCommand,
    'set_target_payload': SetTargetPayloadCommand,
}
#: Our names where they differ from the recorded ones.
NAMES = {
    'selection_vector': 'selection',
    'damping_factor': 'damping',
    'gain_scaling_factor': 'gain_scaling',
    'sensor_measuring_offset': 'sensor_offset',
    'viscous_scale': 'viscous',
    'coulomb_scale': 'coulomb',
}


def case_id(case):
    return f'{case["command"]} {case["robot_version"]}'


def command_of(case):
    return CLASSES[case['command']](
        **{
            NAMES.get(name, name): tuple(value) if isinstance(value, list) else value
            for name, value in case['args'].items()
        }
    )


def version_of(case):
    return tuple(int(part) for part in case['robot_version'].split('.'))


@pytest.mark.parametrize('case', SENT, ids=case_id)
def test_bytes_are_those_of_the_library(case):
    command = command_of(case)
    assert encode(command, version_of(case)).hex() == case['hex']
    assert encode(command).hex() == case['hex']


@pytest.mark.parametrize('case', SENT, ids=case_id)
def test_reading_gives_back_the_command_and_the_bytes(case):
    command = decode(bytes.fromhex(case['hex']))
    assert type(command) is CLASSES[case['command']]
    assert encode(command).hex() == case['hex']


@pytest.mark.parametrize('case', REFUSED, ids=case_id)
def test_a_command_that_the_software_lacks_is_refused(case):
    with pytest.raises(LocalProtocolError, match=case['robot_version']):
        encode(command_of(case), version_of(case))


def test_all_commands_are_covered():
    ours = {ScriptCommand.SET_SAFE_OUTPUTS}
    assert {cls.command for cls in CLASSES.values()} == set(ScriptCommand) - ours
    assert {case['command'] for case in SENT} == set(CLASSES)


def test_safe_outputs_come_back_from_their_words():
    outputs = (
        SafeOutput(output=OutputKind.STANDARD_DIGITAL, pin=3, value=0.0),
        SafeOutput(output=OutputKind.CONFIGURABLE_DIGITAL, pin=7, value=1.0),
        SafeOutput(output=OutputKind.TOOL_DIGITAL, pin=1, value=0.0),
        SafeOutput(
            output=OutputKind.STANDARD_ANALOG, pin=1, value=0.25, domain=AnalogDomain.VOLTAGE
        ),
    )
    command = SetSafeOutputsCommand(action=SafeOutputsAction.ARM, token=2**31 - 1, outputs=outputs)
    assert decode(encode(command)) == command
    words = struct.unpack('>28i', encode(command))
    assert words[:3] == (100, 1, 2**31 - 1)
    assert words[3:21] == (*(-1, -1, -1, 0), *(-1,) * 11, 1, -1, 0)
    assert words[21:25] == (-1, 0, 250_000, 1)


SIX = (0.0,) * 6
FORCE: dict[str, Any] = {
    'task_frame': SIX,
    'selection': (False,) * 6,
    'wrench': SIX,
    'type': 2,
    'limits': SIX,
}


@pytest.mark.parametrize(
    ('make', 'text'),
    [
        (lambda: SetToolVoltageCommand(voltage=5), 'voltage is 5'),
        (lambda: StartForceModeCommand(**{**FORCE, 'type': 4}), 'type is 4'),
        (lambda: StartForceModeCommand(**FORCE, damping=1.1), 'damping is 1.1'),
        (lambda: StartForceModeCommand(**FORCE, gain_scaling=-0.1), 'gain_scaling is -0.1'),
        (lambda: encode(SetPayloadCommand(mass=float('nan'))), 'mass is nan'),
        (lambda: encode(SetPayloadCommand(mass=1.0, cog=(0.0, 3000.0, 0.0))), r'cog\[1\] is 3000'),
        (
            lambda: encode(SetFrictionScalesCommand(viscous=SIX, coulomb=(float('nan'),) * 6)),
            r'coulomb\[0\] is nan',
        ),
    ],
)
def test_a_value_out_of_range_is_refused_with_its_name(make, text):
    with pytest.raises(LocalProtocolError, match=text):
        make()


@pytest.mark.parametrize(
    'words',
    [
        [13],
        [-1],
        [2, 5_000_000],
        [2, 500_000],
        [3, *[0] * 18, 4_000_000],
        [3, *[0] * 18, 1_500_000],
    ],
)
def test_an_invalid_command_is_refused_with_its_bytes(words):
    data = struct.pack('>28i', *words, *[0] * (28 - len(words)))
    with pytest.raises(RemoteProtocolError, match=data[:40].hex()):
        decode(data)


@pytest.mark.parametrize('size', [0, 111, 113])
def test_another_size_is_refused(size):
    with pytest.raises(RemoteProtocolError, match='112 bytes'):
        decode(bytes(size))


def test_commands_are_read_from_a_stream_in_pieces():
    stream = b''.join(bytes.fromhex(case['hex']) for case in SENT)
    at_once = ScriptCommandDecoder().feed(stream)
    decoder = ScriptCommandDecoder()
    assert [c for i in range(len(stream)) for c in decoder.feed(stream[i : i + 1])] == at_once
    assert len(at_once) == len(SENT)


@given(st.tuples(*[st.floats(-2147, 2147)] * 6), st.floats(0, 100), st.floats(0, 2147))
def test_values_round_trip_within_half_a_unit(six, mass, time):
    command = SetTargetPayloadCommand(mass=mass, cog=six[:3], inertia=six, transition_time=time)
    back = decode(encode(command))
    assert (back.mass, *back.cog, *back.inertia, back.transition_time) == pytest.approx(
        (mass, *six[:3], *six, time), abs=0.5e-6 + 1e-9, rel=0.0
    )


@given(st.binary(min_size=COMMAND_SIZE, max_size=COMMAND_SIZE), st.sampled_from(ScriptCommand))
def test_random_bytes_raise_nothing_but_a_remote_error(data, command):
    with suppress(RemoteProtocolError):
        decode(struct.pack('>i', command) + data[4:])
    with suppress(RemoteProtocolError):
        ScriptCommandDecoder().feed(data)


@pytest.mark.parametrize(
    ('result', 'text'),
    [(ToolContactResult.SUCCESS, '00000000'), (ToolContactResult.CANCELED, '00000001')],
)
def test_results_of_a_tool_contact(result, text):
    assert encode_result(result).hex() == text
    assert ToolContactResultDecoder().feed(bytes.fromhex(text) * 2) == [result, result]
    with pytest.raises(RemoteProtocolError, match='00000002'):
        ToolContactResultDecoder().feed(b'\0\0\0\2')


@pytest.mark.parametrize('persistence', list(TcpPersistence))
def test_the_persistence_of_a_tcp_is_a_word_that_other_programs_ignore(persistence):
    plain = encode(SetTcpOffsetCommand(offset=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6)))
    command = SetTcpOffsetCommand(offset=(0.1, 0.2, 0.3, 0.4, 0.5, 0.6), persistence=persistence)
    sent = encode(command)
    assert decode(sent) == command
    assert sent[:28] == plain[:28]
    assert struct.unpack('>21i', sent[28:]) == (persistence, *(0,) * 20)
