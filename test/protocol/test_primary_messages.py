# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Primary frames, against recorded ones as the manufacturer's library reads them."""

from contextlib import suppress
import json
from pathlib import Path
import struct
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.client_interfaces.primary_messages import (
    decode_frame,
    encode_command,
    encode_message,
    encode_program,
    encode_state,
    ErrorCodeMessage,
    KeyMessage,
    PrimaryCommand,
    PrimaryDecoder,
    RawFrame,
    RawMessage,
    ReportLevel,
    RobotStateFrame,
    RuntimeExceptionMessage,
    SafetyModeMessage,
    TextMessage,
    VersionMessage,
)
from ur_cartesian_driver.protocol.client_interfaces.primary_state import (
    AdditionalInfo,
    CalibrationData,
    CartesianInfo,
    ConfigurationData,
    ForceModeData,
    ImmiData,
    JointData,
    KinematicsInfo,
    MasterboardData,
    RawSubPackage,
    RobotModeData,
    SAFETY_DATA,
    ToolCommunication,
    ToolData,
    ToolModeInfo,
)

GOLDEN = json.loads((Path(__file__).parent / 'golden' / 'primary_frames.json').read_text())
FRAMES = GOLDEN['frames']
RECORDED = FRAMES[0]
ORDER = [0, 1, 4, 5, 9, 3, 2, 6, 7, 8, 10, 11, 12]
SIZES = [47, 251, 101, 225, 53, 75, 37, 445, 61, 9, 43, 26, 8]

#: ``ConfigurationData.robot_type`` of the recorded robot.
UR5 = 1

KINDS = {
    'robot_mode_data': RobotModeData,
    'kinematics_info': KinematicsInfo,
    'masterboard_data': MasterboardData,
    'configuration_data': ConfigurationData,
    'raw_state': RawSubPackage,
    'text_message': TextMessage,
    'version_message': VersionMessage,
    'safety_mode_message': SafetyModeMessage,
    'error_code_message': ErrorCodeMessage,
    'key_message': KeyMessage,
    'runtime_exception_message': RuntimeExceptionMessage,
    'raw_message': RawMessage,
}
#: Our names where they differ from the library's.
NAMES = {
    'is_real_robot_connected': 'real_robot_connected',
    'robot_voltage_48v': 'robot_voltage_48v',
    'is_real_robot_enabled': 'real_robot_enabled',
    'is_robot_power_on': 'power_on',
    'is_emergency_stopped': 'emergency_stopped',
    'is_protective_stopped': 'protective_stopped',
    'is_program_running': 'program_running',
    'is_program_paused': 'program_paused',
    'dh_theta': 'theta',
    'dh_a': 'a',
    'dh_d': 'd',
    'dh_alpha': 'alpha',
    'calibration_status': 'status',
    'joint_position_limits_min_max': 'position_limits',
    'joint_motion_limits_speed_acceleration': 'motion_limits',
    'master_io_current': 'io_current',
    'master_board_temperature': 'temperature',
    'in_reduced_mode': 'reduced_mode',
    'operational_mode_selector_input': 'operational_mode_selector',
    'three_position_enabling_device_input': 'three_position_enabling_device',
    'project_name': 'project',
    'major_version': 'major',
    'minor_version': 'minor',
    'svn_version': 'bugfix',
    'build_number': 'build',
    'build_date': 'date',
    'message_code': 'code',
    'message_argument': 'argument',
    'safety_mode_type': 'safety_mode',
    'report_data_type': 'data_type',
    'report_data': 'data',
    'report_level': 'level',
    'line_number': 'line',
    'column_number': 'column',
}
#: Computed by the library, or lengths, or read in another form below.
OTHERS = {
    'kind',
    'reserved',
    'calibration_hash',
    'message_type',
    'sub_type',
    'title_length',
    'project_name_length',
    'report_level_name',
    'immi_interface_installed',
    'immi_input_bits',
    'immi_output_bits',
    'immi_voltage_24v',
    'immi_current',
}
PAIRS = {
    'analog_input_range': 'analog_input_range',
    'analog_input': 'analog_input',
    'analog_output_domain': 'analog_output_domain',
    'analog_output': 'analog_output',
}


def expected(entry):
    """Return the library's values under our names."""
    values = {}
    for name, value in entry.items():
        stem, _, digit = name.rpartition('_')
        if stem in PAIRS and digit in '01':
            values.setdefault(stem, [0, 0])[int(digit)] = value
        elif name not in OTHERS and not (
            name.startswith('reserved') and (entry['kind'] == 'configuration_data')
        ):
            values[NAMES.get(name, name)] = value
    return values


def listed(value):
    return [listed(v) for v in value] if isinstance(value, tuple) else value


@pytest.mark.parametrize('frame', FRAMES, ids=lambda f: f['name'])
def test_frames_are_read_as_by_the_library(frame):
    content = decode_frame(bytes.fromhex(frame['hex']))
    assert frame['lenient']['parsed']
    if frame['frame_type'] not in (16, 20):
        assert isinstance(content, RawFrame)
        assert content.frame_type == frame['frame_type']
        return
    packages = content.packages if isinstance(content, RobotStateFrame) else [content]
    assert len(packages) == len(frame['decoded'])
    for package, entry in zip(packages, frame['decoded'], strict=True):
        assert type(package) is KINDS[entry['kind']]
        for name in ('message_type', 'sub_type'):
            assert getattr(package, name, None) == entry.get(name, getattr(package, name, None))
        for name, value in expected(entry).items():
            mine = listed(getattr(package, name))
            if name == 'data' and isinstance(mine, float):
                (mine,) = struct.unpack('<f', struct.pack('>f', mine))  # see the next test
            assert mine == (
                pytest.approx(value, rel=1e-8, abs=0.0)
                if isinstance(value, float | int)
                else value
            ), name


def test_a_float_datum_is_big_endian_although_the_library_swaps_it():
    body = struct.pack('>iiBIf', 0, 0, 3, 3, 1.5)
    assert decode_frame(message(5, body)).data == 1.5


@pytest.mark.parametrize(
    'frame', [f for f in FRAMES if f['frame_type'] in (16, 20)], ids=lambda f: f['name']
)
def test_encoded_frames_equal_the_received_ones(frame):
    data = bytes.fromhex(frame['hex'])
    content: Any = decode_frame(data)
    written = (
        encode_state(content.packages)
        if isinstance(content, RobotStateFrame)
        else encode_message(content)
    )
    # What we do not keep: a surplus, or the reserved byte that older frames lack.
    changed = {
        'configuration_payload_446_surplus',
        'kinematics_oversized',
        'robot_mode_without_reserved',
        'robot_mode_nonzero_flag_bytes',
    }
    assert (written == data) is (frame['name'] not in changed and frame['size_matches'])
    if frame['name'] not in changed:
        assert written[4:] == data[4:]


def test_the_immi_interface_is_read():
    (frame,) = [f for f in FRAMES if f['name'] == 'masterboard_with_immi']
    (board,) = decode_frame(bytes.fromhex(frame['hex'])).packages
    assert board.immi == ImmiData(
        input_bits=286335522, output_bits=858997828, voltage_24v=24.0, current=0.75
    )


@pytest.mark.parametrize(
    ('name', 'reserved'),
    [
        ('configuration_payload_440', 0),
        ('configuration_payload_442', 1),
        ('configuration_payload_444', 2),
        ('configuration_payload_446_surplus', 2),
    ],
)
def test_configuration_of_newer_software_is_longer(name, reserved):
    (frame,) = [f for f in FRAMES if f['name'] == name]
    (configuration,) = decode_frame(bytes.fromhex(frame['hex'])).packages
    assert isinstance(configuration, ConfigurationData)
    assert len(configuration.reserved) == reserved
    words = [frame['decoded'][0][f'reserved_{i + 1}'] for i in range(reserved)]
    assert list(configuration.reserved) == words


CLASSES: dict[int, Any] = {
    1: JointData,
    2: ToolData,
    4: CartesianInfo,
    7: ForceModeData,
    8: AdditionalInfo,
    9: CalibrationData,
    11: ToolCommunication,
    12: ToolModeInfo,
}


def test_the_recorded_ur5e_is_read_and_written_to_the_byte():
    data = bytes.fromhex(RECORDED['hex'])
    packages = decode_frame(data).packages
    assert [package.sub_type for package in packages] == ORDER
    full = [CLASSES[p.sub_type].decode(p.body) if p.sub_type in CLASSES else p for p in packages]
    assert encode_state(full) == data
    found = {type(package): package for package in full}
    joints, tool = found[JointData], found[ToolData]
    assert joints.q_actual == pytest.approx((-1.6007, -1.7271, -2.203, -0.808, 1.5951, -0.031))
    assert joints.q_target == joints.q_actual
    assert joints.mode == (253,) * 6
    assert joints.temperature == (25.5, 25.0, 24.5, 24.0, 23.5, 23.5)
    assert tool.mode == 253
    assert found[CartesianInfo].tcp_pose[:3] == pytest.approx(
        (-0.14397, -0.43562, 0.20203), abs=1e-4
    )
    assert found[ToolCommunication].baud_rate == 115200
    assert found[ConfigurationData].robot_type == UR5


def full_state():
    six = (0.0,) * 6
    pairs = ((-6.28, 6.28),) * 6
    return [
        RobotModeData(),
        JointData(q_actual=six, q_target=six),
        CartesianInfo(tcp_pose=six),
        KinematicsInfo(theta=six, a=six, d=six, alpha=six),
        CalibrationData(),
        MasterboardData(),
        ToolData(),
        ConfigurationData(
            position_limits=pairs,
            motion_limits=pairs,
            a=six,
            d=six,
            alpha=six,
            theta=six,
            robot_type=UR5,
        ),
        ForceModeData(),
        AdditionalInfo(),
        SAFETY_DATA,
        ToolCommunication(),
        ToolModeInfo(),
    ]


def test_a_simulated_state_has_the_sizes_and_the_order_of_a_ur5e():
    data = encode_state(full_state())
    start, sizes, order = 5, [], []
    while start < len(data):
        size, kind = struct.unpack_from('>IB', data, start)
        sizes.append(size)
        order.append(kind)
        start += size
    assert (order, sizes, len(data)) == (ORDER, SIZES, 1386)
    assert struct.unpack_from('>iB', data) == (1386, 16)
    assert RECORDED['length'] == 1386


@pytest.mark.parametrize('package', full_state(), ids=lambda p: type(p).__name__)
def test_a_sub_package_round_trips_also_with_surplus_bytes(package):
    if not isinstance(package, RawSubPackage):
        assert type(package).decode(package.encode()) == package
        if not isinstance(package, ConfigurationData):
            assert type(package).decode(package.encode() + b'more') == package


@pytest.mark.parametrize('package', full_state(), ids=lambda p: type(p).__name__)
def test_a_sub_package_that_is_too_short_is_refused_with_its_bytes(package):
    if isinstance(package, RawSubPackage):
        return
    optional = {RobotModeData: 1, MasterboardData: 3}.get(type(package), 0)
    body = package.encode()[: -1 - optional]
    with pytest.raises(RemoteProtocolError, match=body[:20].hex()):
        type(package).decode(body)


def test_the_masterboard_of_older_software_has_no_selector():
    board = MasterboardData(robot_current=1.5, safety_mode=2)
    assert MasterboardData.decode(board.encode()[:-3]) == board


def test_frames_are_read_from_a_stream_in_pieces():
    whole = [f for f in FRAMES if f['size_matches'] and f['length'] < 200]
    stream = b''.join(bytes.fromhex(f['hex']) for f in whole)
    at_once = PrimaryDecoder().feed(stream)
    decoder = PrimaryDecoder()
    pieces = [f for i in range(len(stream)) for f in decoder.feed(stream[i : i + 1])]
    assert pieces == at_once
    assert len(at_once) == len(whole) > 60
    assert decoder.feed(b'') == []


def state(*packages):
    body = b''.join(packages)
    return struct.pack('>iB', 5 + len(body), 16) + body


def message(kind, content):
    body = struct.pack('>QbB', 0, -2, kind) + content
    return struct.pack('>iB', 5 + len(body), 20) + body


@pytest.mark.parametrize(
    'data',
    [
        struct.pack('>iB', 4, 16),
        struct.pack('>iB', -1, 16),
        struct.pack('>iB', 1 << 21, 16),
        state(b'\0\0\0\4\0'),
        state(b'\0\0\0\6\0'),
        state(b'\0\0'),
        state(b'\0\0\0\5\0'),
        state(b'\0\0\0\5\5'),
        struct.pack('>iB', 5, 20),
        message(3, b''),
        message(3, b'\x09URC'),
        message(3, b'\xffURControl' + bytes(10)),
        message(5, bytes(16)),
        message(6, bytes(19)),
        message(7, bytes(8) + b'\x05abcd'),
        message(10, bytes(7)),
    ],
    ids=bytes.hex,
)
def test_an_invalid_frame_is_refused(data):
    with pytest.raises(RemoteProtocolError):
        PrimaryDecoder().feed(data)


def test_an_end_inside_a_frame_is_an_error():
    decoder = PrimaryDecoder()
    decoder.feed(bytes.fromhex(RECORDED['hex'])[:100])
    with pytest.raises(RemoteProtocolError, match='ended inside'):
        decoder.feed(b'')


@pytest.mark.parametrize(
    'make',
    [
        lambda: encode_message(TextMessage(text='x' * 4091)),
        lambda: encode_message(KeyMessage(title='x' * 256)),
        lambda: encode_message(VersionMessage(major=256, minor=0)),
        lambda: encode_message(VersionMessage(major=5, minor=0, project='x' * 128)),
        lambda: encode_state([RobotModeData(robot_mode=200)]),
        lambda: encode_state([MasterboardData(temperature=1e300)]),
        lambda: encode_state([RawSubPackage(sub_type=99, body=bytes(4091))]),
    ],
)
def test_what_clients_cannot_read_is_not_sent(make):
    with pytest.raises(LocalProtocolError):
        make()


def test_an_error_has_the_label_of_the_manuals():
    error = ErrorCodeMessage(code=209, argument=0, level=ReportLevel.WARNING)
    assert error.label == 'C209A0'
    (golden,) = [f for f in FRAMES if f['name'] == 'error_code_C209A0']
    assert decode_frame(bytes.fromhex(golden['hex'])).label == 'C209A0'


TEXT = st.text(max_size=40)
INT32 = st.integers(-(2**31), 2**31 - 1)
HEAD = {'timestamp': st.integers(0, 2**64 - 1), 'source': st.integers(-128, 127)}
BYTE = st.integers(0, 255)
MESSAGES = st.one_of(
    st.builds(TextMessage, **HEAD, text=TEXT),
    st.builds(
        VersionMessage,
        **HEAD,
        project=st.text(max_size=30),
        major=BYTE,
        minor=BYTE,
        bugfix=INT32,
        build=INT32,
        date=TEXT,
    ),
    st.builds(
        SafetyModeMessage,
        **HEAD,
        code=INT32,
        argument=INT32,
        safety_mode=BYTE,
        data_type=st.just(2),
        data=INT32,
    ),
    st.builds(ErrorCodeMessage, **HEAD, code=INT32, argument=INT32, level=INT32, text=TEXT),
    st.builds(KeyMessage, **HEAD, code=INT32, argument=INT32, title=TEXT, text=TEXT),
    st.builds(RuntimeExceptionMessage, **HEAD, line=BYTE, column=BYTE, text=TEXT),
    st.builds(
        RawMessage,
        **HEAD,
        message_type=st.sampled_from([1, 2, 9, 200]),
        content=st.binary(max_size=20),
    ),
)


@given(st.lists(MESSAGES, max_size=5))
def test_messages_round_trip(messages):
    assert PrimaryDecoder().feed(b''.join(map(encode_message, messages)) or b'') == messages


@given(
    st.lists(
        st.binary(min_size=1, max_size=60)
        | st.builds(message, st.sampled_from([0, 3, 5, 6, 7, 10]), st.binary(max_size=40))
        | st.builds(state, st.binary(max_size=100))
    )
)
def test_random_bytes_raise_nothing_but_a_remote_error(chunks):
    decoder = PrimaryDecoder()
    with suppress(RemoteProtocolError):
        for chunk in chunks:
            decoder.feed(chunk)


def test_commands_and_programs_end_with_a_line_feed():
    assert encode_command(PrimaryCommand.STOP_PROGRAM) == b'stop program\n'
    assert encode_program('def f():\nend') == b'def f():\nend\n'
