# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Reverse messages, against the bytes of the manufacturer's library."""

import json
from pathlib import Path

import numpy as np
import pytest
from wire_decoding import decode_reverse

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.protocol.framing import to_fixed
from ur_cartesian_driver.protocol.program.reverse import (
    buffered_servo,
    ControlMode,
    FeedTarget,
    keepalive,
    ReverseMessage,
    stop,
    trajectory,
    TrajectoryAction,
)

GOLDEN = json.loads((Path(__file__).parent / 'golden' / 'reverse_messages.json').read_text())


def requested(case):
    """Return the wish for a timeout [ms]; seconds are float32, cut to whole milliseconds."""
    if 'timeout_ms' in case:
        return case['timeout_ms']
    return int(np.float32(case['timeout_s_float32']) * np.float32(1000))


def is_ours(case):
    """Return whether the driver sends such a message; its timeouts exceed a controller step."""
    modes = (ControlMode.IDLE, ControlMode.STOPPED, ControlMode.UNINITIALIZED)
    return (case['call'] == 'trajectory_control' or case.get('control_mode') in modes) and not (
        0 < requested(case) < case['step_time_ms']
    )


CASES = [case for case in GOLDEN['cases'] if is_ours(case)]
SENT = [case for case in CASES if not case['refused']]
REFUSED = [case for case in CASES if case['refused']]


def case_id(case):
    name = case.get('mode_name') or f'{case["call"]} {case["action_name"]}'
    return f'{name} {case.get("timeout_ms", case.get("timeout_s_float32"))} {case.get("note", "")}'


def message_of(case):
    """Return our message for a call of the library."""
    timeout = requested(case)
    if case['call'] == 'trajectory_control':
        return trajectory(TrajectoryAction(case['action']), case.get('point_number', 0), timeout)
    mode = ControlMode(case['control_mode'])
    if not any(case['values'] or ()):
        if mode is ControlMode.STOPPED:
            return stop()
        if mode is ControlMode.IDLE:
            return keepalive(timeout)
    a, b, c, d, e, f = (to_fixed(v, 'value') for v in case['values'] or (0.0,) * 6)
    if mode is ControlMode.STOPPED:
        timeout = stop().read_timeout
    return ReverseMessage(read_timeout=timeout, mode=mode, payload=(a, b, c, d, e, f))


def test_all_actions_and_modes_of_the_library_that_we_send_are_covered():
    assert {case.get('action') for case in SENT} == {*TrajectoryAction, None}
    assert {case['ints'][7] for case in SENT} == {
        ControlMode.STOPPED,
        ControlMode.IDLE,
        ControlMode.FORWARD,
    }


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


@pytest.mark.parametrize('case', REFUSED, ids=case_id)
def test_what_the_library_refuses_is_refused(case):
    with pytest.raises(LocalProtocolError, match=case['mode_name']):
        message_of(case)


@pytest.mark.parametrize(
    'make',
    [
        lambda: keepalive(-1),
        lambda: trajectory(TrajectoryAction.START, 2**31),
        lambda: trajectory(TrajectoryAction.NOOP, feed=FeedTarget(2200.0, 1.0)),
        lambda: ReverseMessage(read_timeout=-1, mode=ControlMode.IDLE),
        lambda: ReverseMessage(read_timeout=2**31, mode=ControlMode.IDLE),
    ],
)
def test_no_invalid_message_can_be_made(make):
    with pytest.raises(LocalProtocolError):
        make()


@pytest.mark.parametrize(
    'message',
    [
        keepalive(1000),
        buffered_servo(200),
        stop(),
        trajectory(TrajectoryAction.START, 7, 200, takes_offsets=True, feed=FeedTarget(0.5, 2.0)),
        trajectory(TrajectoryAction.CANCEL, mode=ControlMode.BUFFERED_SERVO),
    ],
)
def test_each_word_has_its_place(message):
    assert decode_reverse(message.encode()) == message
