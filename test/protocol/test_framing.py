# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Fixed-point numbers and bounded buffers."""

from contextlib import suppress
import math

from hypothesis import given
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.framing import (
    FIXED_POINT,
    FrameBuffer,
    hex_text,
    LineBuffer,
    RecordDecoder,
    to_fixed,
)


@pytest.mark.parametrize(
    ('value', 'raw'),
    [
        (0.0, 0),
        (-0.0, 0),
        (1.0, 1_000_000),
        (0.0000005, 1),
        (-0.0000005, -1),
        (0.0000025, 3),
        (math.nextafter(0.0000005, 0.0), 0),
        (-2147.483648, -2147483648),
        (2147.483647, 2147483647),
    ],
)
def test_ties_round_away_from_zero(value, raw):
    assert to_fixed(value, 'x') == raw


@pytest.mark.parametrize(
    'value', [math.nan, math.inf, -math.inf, 2147.4836475, -2147.4836486, 1e300]
)
def test_what_does_not_fit_is_refused_with_field_value_and_bound(value):
    with pytest.raises(LocalProtocolError) as error:
        to_fixed(value, 'target[3]')
    for part in ('target[3]', repr(value), '2147.483647'):
        assert part in str(error.value)


@given(st.floats(-2147.483648, 2147.483647))
def test_a_fixed_point_number_is_within_half_a_unit(value):
    assert abs(to_fixed(value, 'x') / FIXED_POINT - value) <= 0.5 / FIXED_POINT + 1e-12


@given(st.integers(-(2**31), 2**31 - 1))
def test_every_word_round_trips_through_its_value(raw):
    assert to_fixed(raw / FIXED_POINT, 'x') == raw


@pytest.mark.parametrize('value', [2**31, -(2**31) - 1])
def test_a_raw_word_beyond_int32_is_refused(value):
    with pytest.raises(LocalProtocolError, match='count'):
        to_fixed(value, 'count', scale=1)


def frames():
    return FrameBuffer(2, 3, 100, 'test frame')


BUFFERS = [lambda: RecordDecoder(4, 'record', bytes), frames, lambda: LineBuffer(50)]
STREAMS = [b'abcdefgh', b'\x00\x03a\x00\x05abc\x00\x03z', b'one\r\ntwo\n\n']


@pytest.mark.parametrize(('make', 'stream'), list(zip(BUFFERS, STREAMS, strict=True)))
def test_byte_by_byte_decodes_as_all_at_once(make, stream):
    at_once = make().feed(stream)
    buffer = make()
    assert [unit for i in range(len(stream)) for unit in buffer.feed(stream[i : i + 1])] == at_once
    assert len(at_once) >= 2
    assert buffer.feed(b'') == []


@pytest.mark.parametrize(('make', 'stream'), list(zip(BUFFERS, STREAMS, strict=True)))
def test_an_end_inside_a_unit_is_an_error(make, stream):
    buffer = make()
    buffer.feed(stream[:-2])
    with pytest.raises(RemoteProtocolError, match='ended inside'):
        buffer.feed(b'')


@pytest.mark.parametrize('size', [0, 2, 101, 65535])
def test_an_impossible_size_is_refused_at_once_with_the_bytes(size):
    head = size.to_bytes(2, 'big')
    with pytest.raises(RemoteProtocolError, match=head.hex()):
        frames().feed(head)


def test_a_line_without_end_is_refused():
    buffer = LineBuffer(50)
    buffer.feed(b'x' * 50)
    with pytest.raises(RemoteProtocolError, match='longer than 50'):
        buffer.feed(b'x')


def test_odd_bytes_in_a_text_are_shown_as_escapes():
    assert LineBuffer().feed(b'Temp\xc3\xa9rature \xff\n') == ['Temp\u00e9rature \\xff']


def test_a_long_quotation_is_truncated():
    assert len(hex_text(bytes(10_000))) < 130
    assert '10000 bytes' in hex_text(bytes(10_000))


@given(st.lists(st.binary(max_size=200)))
def test_random_bytes_raise_only_remote_errors_and_are_not_kept(chunks):
    for make in BUFFERS:
        buffer = make()
        with suppress(RemoteProtocolError):
            for chunk in chunks:
                buffer.feed(chunk)
                held = getattr(buffer, '_rest', b'') or getattr(buffer, '_buffer', b'')
                assert len(held) <= 100
