# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The real-time packet: places and sizes as published, and both directions of the codec."""

from dataclasses import fields, replace
import struct
from typing import Any

from hypothesis import given
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.client_interfaces.realtime import (
    decode_packet,
    packet_size,
    PACKET_SIZES,
    RealtimeData,
    RealtimeDecoder,
)

#: First byte of a field, from the manufacturer's tables.
PLACES = {
    'time': 4,
    'q_target': 12,
    'qd_target': 60,
    'qdd_target': 108,
    'current_target': 156,
    'moment_target': 204,
    'q_actual': 252,
    'qd_actual': 300,
    'current_actual': 348,
    'current_control': 396,
    'tcp_pose_actual': 444,
    'tcp_speed_actual': 492,
    'tcp_force': 540,
    'tcp_pose_target': 588,
    'tcp_speed_target': 636,
    'digital_input_bits': 684,
    'joint_temperatures': 692,
    'controller_timer': 740,
    'robot_mode': 756,
    'joint_modes': 764,
    'safety_mode': 812,
    'tool_accelerometer': 868,
    'speed_scaling': 940,
    'momentum': 948,
    'main_voltage': 972,
    'robot_voltage': 980,
    'robot_current': 988,
    'joint_voltages': 996,
    'digital_output_bits': 1044,
    'program_state': 1052,
    'elbow_position': 1060,
    'elbow_velocity': 1084,
    'safety_status': 1108,
    'payload_mass': 1140,
    'payload_cog': 1148,
    'payload_inertia': 1172,
}
VECTORS = {
    name: len(getattr(RealtimeData(time=0.0), name))
    for name in PLACES
    if isinstance(getattr(RealtimeData(time=0.0), name), tuple)
}


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
    count = VECTORS.get(name, 1)
    values = tuple(float(-1 - i) for i in range(count))
    changes: dict[str, Any] = {name: values if name in VECTORS else values[0]}
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
    read = decode_packet(packet)
    for name, place in PLACES.items():
        expected = getattr(numbered() if place < size else RealtimeData(time=0.0), name)
        assert getattr(read, name) == expected


def test_appended_fields_of_newer_packets_are_ignored():
    packet = numbered().encode(1220)
    assert decode_packet(struct.pack('>i', 1228) + packet[4:] + bytes(8)) == numbered()


@given(st.lists(st.floats(allow_nan=False, width=64), min_size=12, max_size=12))
def test_packets_round_trip(numbers):
    data = RealtimeData(time=1.5, q_actual=tuple(numbers[:6]), payload_inertia=tuple(numbers[6:]))
    assert decode_packet(data.encode(1220)) == data


@given(st.data())
def test_packets_are_found_in_any_pieces(data):
    stream = b''.join(RealtimeData(time=float(i)).encode(1220) for i in range(3))
    cuts = sorted(data.draw(st.sets(st.integers(1, len(stream) - 1), max_size=6)))
    decoder, read = RealtimeDecoder(), []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        read += [packet.time for packet in decoder.feed(stream[start:end])]
    assert read == [0.0, 1.0, 2.0]


def test_an_unknown_packet_size_is_refused():
    with pytest.raises(LocalProtocolError, match='1221'):
        RealtimeData(time=0.0).encode(1221)
    with pytest.raises(RemoteProtocolError, match='1000000'):
        list(RealtimeDecoder().feed(struct.pack('>i', 1_000_000)))
    with pytest.raises(RemoteProtocolError, match='1219 bytes'):
        decode_packet(numbered().encode(1220)[:-1])
