# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The robot fetches the program from the script sender."""

from contextlib import suppress

from hypothesis import given
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.motion.errors import RemoteProtocolError
from ur_cartesian_driver.protocol.program.script_sender import reply, REQUEST, RequestDecoder


def test_the_bytes():
    assert REQUEST == b'request_program\n'
    assert reply('textmsg("\u00e9")') == b'textmsg("\xc3\xa9")\n'


def test_requests_are_counted_when_joined_or_in_pieces():
    assert RequestDecoder().feed(REQUEST * 3) == 3
    decoder = RequestDecoder()
    assert sum(decoder.feed(bytes([byte])) for byte in REQUEST * 2) == 2
    assert decoder.feed(b'') == 0


@pytest.mark.parametrize('data', [b'request_programs\n', b'GET / HTTP/1.1\r\n', REQUEST + b'x'])
def test_anything_else_is_refused_with_its_bytes(data):
    with pytest.raises(RemoteProtocolError, match=data.hex()):
        RequestDecoder().feed(data)


def test_an_end_inside_a_request_is_an_error():
    decoder = RequestDecoder()
    decoder.feed(REQUEST[:-1])
    with pytest.raises(RemoteProtocolError):
        decoder.feed(b'')


@given(st.lists(st.binary(min_size=1, max_size=20)))
def test_random_bytes_raise_nothing_but_a_remote_error(chunks):
    decoder = RequestDecoder()
    with suppress(RemoteProtocolError):
        for chunk in chunks:
            decoder.feed(chunk)
