# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Reverse messages, against the bytes of the manufacturer's library."""

from contextlib import suppress
import json
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.framing import from_fixed, to_fixed
from ur_cartesian_driver.protocol.program.reverse import (
    ControlMode,
    DEFAULT_STEP_TIME,
    FreedriveAction,
    keepalive,
    MESSAGE_SIZE,
    read_timeout_for,
    REALTIME_MODES,
    ReverseDecoder,
    ReverseMessage,
    stop,
    trajectory,
    TrajectoryAction,
)

GOLDEN = json.loads((Path(__file__).parent / 'golden' / 'reverse_messages.json').read_text())
CASES = GOLDEN['cases']
SENT = [case for case in CASES if not case['refused']]
REFUSED = [case for case in CASES if case['refused']]


def freedrive(action, read_timeout, step_time):
    return ReverseMessage(
        read_timeout=read_timeout_for(ControlMode.FREEDRIVE, read_timeout, step_time),
        mode=ControlMode.FREEDRIVE,
        payload=(action, 0, 0, 0, 0, 0),
    )


def fixed_six(values):
    a, b, c, d, e, f = (to_fixed(value, f'value {i}') for i, value in enumerate(values, 1))
    return a, b, c, d, e, f


def setpoint(mode, values, read_timeout=20, step_time=DEFAULT_STEP_TIME):
    return ReverseMessage(
        read_timeout=read_timeout_for(mode, read_timeout, step_time),
        mode=mode,
        payload=fixed_six(values),
    )


def case_id(case):
    name = case.get('mode_name') or f'{case["call"]} {case["action_name"]}'
    return f'{name} {case.get("timeout_ms", case.get("timeout_s_float32"))} {case.get("note", "")}'


def requested(case):
    """Return the wish for a timeout [ms]; seconds are float32, cut to whole milliseconds."""
    if 'timeout_ms' in case:
        return case['timeout_ms']
    return int(np.float32(case['timeout_s_float32']) * np.float32(1000))


def message_of(case):
    """Return our message for a call of the library."""
    timeout, step = requested(case), case['step_time_ms']
    if case['call'] == 'trajectory_control':
        return trajectory(
            TrajectoryAction(case['action']), case.get('point_number', 0), timeout, step
        )
    if case['call'] == 'freedrive':
        return freedrive(FreedriveAction(case['action']), timeout, step)
    mode = ControlMode(case['control_mode'])
    empty = not any(case['values'] or ())
    if mode is ControlMode.STOPPED and empty:
        return stop()
    if mode is ControlMode.IDLE and empty:
        return keepalive(timeout, step)
    if mode in REALTIME_MODES and case['values'] is not None:
        return setpoint(mode, case['values'], timeout, step)
    return ReverseMessage(
        read_timeout=read_timeout_for(mode, timeout, step),
        mode=mode,
        payload=fixed_six(case['values'] or (0.0,) * 6),
    )


@pytest.mark.parametrize('case', SENT, ids=case_id)
def test_bytes_are_those_of_the_library(case):
    message = message_of(case)
    if case.get('keepalive_count') is not None:
        # The library's deprecated setting overrides word 0; we do not have it.
        message = ReverseMessage(
            read_timeout=20 * case['keepalive_count'], mode=message.mode, payload=message.payload
        )
    pattern = case['hex'] or case['hex_pattern']
    text = message.encode().hex()
    assert len(text) == len(pattern)
    assert all(b in (a, 'x') for a, b in zip(text, pattern, strict=True))


@pytest.mark.parametrize('case', SENT, ids=case_id)
def test_reading_gives_the_words(case):
    data = bytes.fromhex((case['hex'] or case['hex_pattern']).replace('x', '7'))
    message = ReverseMessage.decode(data)
    assert message.encode() == data
    defined = [
        (a, b)
        for a, b in zip(
            (message.read_timeout, *message.payload, message.mode), case['ints'], strict=True
        )
        if b is not None
    ]
    assert all(a == b for a, b in defined)
    assert len(defined) >= 2


@pytest.mark.parametrize('case', REFUSED, ids=case_id)
def test_what_the_library_refuses_is_refused(case):
    with pytest.raises(LocalProtocolError, match=case['mode_name']):
        message_of(case)


def test_all_messages_of_the_library_are_read_from_one_stream_in_pieces():
    stream = b''.join(bytes.fromhex(case['hex']) for case in SENT if case['hex'])
    at_once = ReverseDecoder().feed(stream)
    decoder = ReverseDecoder()
    assert [m for i in range(len(stream)) for m in decoder.feed(stream[i : i + 1])] == at_once
    assert b''.join(message.encode() for message in at_once) == stream
    assert decoder.feed(b'') == []


@pytest.mark.parametrize(
    ('mode', 'wish', 'step', 'word'),
    [
        (ControlMode.SERVOJ, 0, 2, 2),
        (ControlMode.SERVOJ, 1, 8, 8),
        (ControlMode.TORQUE, 5000, 2, 200),
        (ControlMode.SPEEDL, 20, 2, 20),
        (ControlMode.IDLE, 0, 2, 0),
        (ControlMode.IDLE, 1, 8, 8),
        (ControlMode.FORWARD, 100_000, 2, 100_000),
        (ControlMode.STOPPED, 5000, 2, 100),
    ],
)
def test_a_real_time_mode_never_lasts_more_than_200_ms_without_a_message(mode, wish, step, word):
    assert read_timeout_for(mode, wish, step) == word


@pytest.mark.parametrize(
    'make',
    [
        lambda: keepalive(-1),
        lambda: setpoint(ControlMode.SERVOJ, (0.0, float('nan'), 0.0, 0.0, 0.0, 0.0)),
        lambda: setpoint(ControlMode.TORQUE, (0.0, 0.0, 2200.0, 0.0, 0.0, 0.0)),
        lambda: trajectory(TrajectoryAction.START, 2**31),
        lambda: ReverseMessage(read_timeout=-1, mode=ControlMode.IDLE),
        lambda: ReverseMessage(read_timeout=2**31, mode=ControlMode.IDLE),
    ],
)
def test_no_invalid_message_can_be_made(make):
    with pytest.raises(LocalProtocolError):
        make()


@pytest.mark.parametrize(
    'text',
    [
        '00' * 31,
        '00' * 33,
        '00' * 28 + '00000009',
        '00' * 28 + '00000007',
        '00' * 28 + 'ffffffff',
        'ffffffff' + '00' * 28,
    ],
)
def test_an_invalid_message_is_refused_with_its_bytes(text):
    with pytest.raises(RemoteProtocolError, match=text):
        ReverseMessage.decode(bytes.fromhex(text))


@given(
    st.sampled_from(sorted(REALTIME_MODES)),
    st.tuples(*[st.floats(-2147.0, 2147.0)] * 6),
    st.integers(0, 10_000),
)
def test_a_set_point_round_trips_within_half_a_unit(mode, values, timeout):
    message = setpoint(mode, values, timeout)
    back = ReverseMessage.decode(message.encode())
    assert back == message
    received = [from_fixed(word) for word in back.payload]
    assert received == pytest.approx(values, abs=0.5e-6 + 1e-9, rel=0.0)


@given(st.binary(min_size=MESSAGE_SIZE, max_size=3 * MESSAGE_SIZE))
def test_random_bytes_raise_nothing_but_a_remote_error(data):
    with suppress(RemoteProtocolError):
        ReverseDecoder().feed(data)
