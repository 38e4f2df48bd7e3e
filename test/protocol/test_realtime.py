# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The real-time packet: places and sizes as published."""

from dataclasses import fields, replace
import struct
from typing import Any

import pytest
from realtime_packets import PLACES, read_packet, size_of

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.protocol.client_interfaces.realtime import (
    packet_size,
    PACKET_SIZES,
    RealtimeData,
)


def numbered() -> RealtimeData:
    """Return a packet in which no two numbers are the same."""
    values: dict[str, Any] = {}
    number = 0
    for field in fields(RealtimeData):
        old = getattr(RealtimeData(time=0.0), field.name)
        count = len(old) if isinstance(old, tuple) else 1
        items = tuple(float(number + i) for i in range(1, count + 1))
        values[field.name] = items if isinstance(old, tuple) else items[0]
        number += count
    return RealtimeData(**values)


@pytest.mark.parametrize('name', PLACES)
def test_each_field_is_where_the_tables_say(name):
    count = size_of(name)
    values = tuple(float(-1 - i) for i in range(count))
    changes: dict[str, Any] = {name: values if count > 1 else values[0]}
    data = replace(RealtimeData(time=0.0), **changes)
    packet = data.encode(1220)
    assert struct.unpack_from(f'>{count}d', packet, PLACES[name]) == values
    assert packet.count(b'\xbf\xf0' + bytes(6)) == 1  # -1.0, once


@pytest.mark.parametrize(
    ('version', 'size'),
    [
        ((3, 2, 0, 0), 1060),
        ((3, 4), 1060),
        ((3, 5), 1108),
        ((3, 12), 1116),
        ((3, 15, 8, 0), 1140),
        ((5, 0), 1108),
        ((5, 3), 1108),
        ((5, 4), 1116),
        ((5, 9), 1140),
        ((5, 10), 1220),
        ((5, 21, 0, 0), 1220),
        ((10, 8), 1220),
    ],
)
def test_the_size_follows_from_the_version_of_the_software(version, size):
    packet = numbered().encode(packet_size(version))
    assert len(packet) == size
    assert struct.unpack_from('>i', packet) == (size,)


@pytest.mark.parametrize('size', sorted(PACKET_SIZES))
def test_an_older_packet_is_the_front_of_a_newer_one(size):
    packet = numbered().encode(size)
    assert packet[4:] == numbered().encode(1220)[4:size]


def test_all_fields_are_read_from_a_packet():
    read, data = read_packet(numbered().encode(1220)), numbered()
    for name in PLACES:
        assert getattr(read, name) == getattr(data, name)


def test_an_unknown_packet_size_is_refused():
    with pytest.raises(LocalProtocolError, match='1221'):
        RealtimeData(time=0.0).encode(1221)
