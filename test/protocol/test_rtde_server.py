# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The RTDE server: what a controller does with the packages of any client."""

from contextlib import suppress
import math
import struct

from hypothesis import given
import pytest
from random_frames import RANDOM_FRAMES

from ur_cartesian_driver.motion.errors import RemoteProtocolError
from ur_cartesian_driver.protocol.rtde.rtde_packages import (
    ControllerVersion,
    DataPackage,
    decode_reply,
    RequestProtocolVersion,
    RtdeFrameBuffer,
    SetupInputs,
    SetupOutputs,
)
from ur_cartesian_driver.protocol.rtde.rtde_server import RtdeServerCodec

VERSION = ControllerVersion(major=5, minor=21, bugfix=0)


def server(**options):
    controller = RtdeServerCodec(VERSION, set(), **options)
    controller.feed(RequestProtocolVersion(version=2).encode())
    controller.data_to_send()
    return controller


def test_a_new_output_recipe_takes_the_place_of_the_one_before():
    controller = server()
    for names, frequency in ((('timestamp',), 10.0), (('actual_q',), 9999.0)):
        controller.feed(SetupOutputs(names=names, frequency=frequency).encode())
        assert controller.output.recipe.names == names
        assert controller.output.frequency == min(frequency, 500.0)
    controller.feed(SetupOutputs(names=('robot_mode',), frequency=math.nan).encode())
    assert controller.output.frequency == 500.0
    controller.feed(SetupOutputs(names=('nonsense',), frequency=10.0).encode())
    assert controller.output is None
    replies = [decode_reply(f) for f in RtdeFrameBuffer().feed(controller.data_to_send())]
    assert [reply.recipe_id for reply in replies] == [1, 1, 1, 0]
    assert replies[3].types == ('NOT_FOUND',)


def test_in_version_1_there_is_one_output_recipe_without_id():
    controller = server()
    controller.feed(
        RequestProtocolVersion(version=1).encode()
        + SetupOutputs(names=('timestamp',)).encode()
        + SetupOutputs(names=('actual_q',)).encode()
    )
    assert len(controller.output.recipe.pack(((0.0,) * 6,))) == 3 + 48
    assert controller.data_to_send().endswith(b'OVECTOR6D')


def test_a_client_that_asks_for_no_version_gets_version_1():
    controller = RtdeServerCodec(VERSION, set())
    controller.feed(b'\0\x15Otimestamp,target_q' + b'\0\3S')
    assert controller.data_to_send() == b'\0\x12ODOUBLE,VECTOR6D' + b'\0\4S\1'


def test_a_client_with_one_recipe_may_use_any_id():
    controller = server()
    controller.feed(SetupInputs(names=('input_int_register_24',)).encode())
    for number in (0, 1, 200):
        (event,) = controller.feed(DataPackage(payload=bytes([number]) + b'\0\0\0\x05').encode())
        assert event.values == (5,)


def test_with_several_recipes_the_id_selects_one():
    controller = server()
    for number in (24, 25):
        controller.feed(SetupInputs(names=(f'input_int_register_{number}',)).encode())
    (event,) = controller.feed(DataPackage(payload=b'\2\0\0\0\x05').encode())
    assert event.recipe.names == ('input_int_register_25',)
    with pytest.raises(RemoteProtocolError, match='recipe 3'):
        controller.feed(DataPackage(payload=b'\3\0\0\0\x05').encode())


def test_a_client_without_outputs_cannot_start():
    # Clients of 5.22 report it, and so does an issue of the manufacturer's own client (RTDE #13).
    controller = server()
    inputs = SetupInputs(names=('input_int_register_24',)).encode()
    for request in (b'', inputs, SetupOutputs(names=('nonsense',), frequency=10.0).encode()):
        controller.feed(request)
        controller.data_to_send()
        controller.feed(b'\0\3S')
        assert controller.data_to_send() == b'\0\4S\0'
        assert not controller.streaming
    (event,) = controller.feed(DataPackage(payload=b'\1\0\0\0\x05').encode())
    assert event.values == (5,)


def test_start_and_pause():
    controller = server()
    controller.feed(SetupOutputs(names=('timestamp',), frequency=10.0).encode())
    controller.data_to_send()
    for kind, streaming in ((b'S', True), (b'P', False), (b'S', True)):
        controller.feed(b'\0\3' + kind)
        assert controller.data_to_send() == b'\0\4' + kind + b'\1'
        assert controller.streaming is streaming


def test_an_unknown_protocol_version_is_refused_and_nothing_changes():
    controller = server()
    controller.feed(RequestProtocolVersion(version=3).encode())
    assert controller.data_to_send() == b'\0\4V\0'
    assert controller.protocol_version == 2


def test_inputs_before_their_recipe_are_an_error():
    with pytest.raises(RemoteProtocolError, match='before'):
        server().feed(DataPackage(payload=bytes(5)).encode())


def test_the_number_of_input_recipes_is_bounded():
    controller = server()
    request = SetupInputs(names=('input_int_register_24',)).encode()
    controller.feed(request * 255)
    with pytest.raises(RemoteProtocolError, match='255'):
        controller.feed(request)


def test_a_client_may_write_an_input_through_several_recipes_but_two_clients_may_not():
    taken = set()
    one, two = RtdeServerCodec(VERSION, taken), RtdeServerCodec(VERSION, taken)
    both = ('input_int_register_1', 'input_int_register_2')
    for names in (both[:1], both):
        one.feed(SetupInputs(names=names).encode())
    two.feed(SetupInputs(names=both).encode())
    replies = [
        decode_reply(f) for f in RtdeFrameBuffer().feed(one.data_to_send() + two.data_to_send())
    ]
    assert [(reply.recipe_id, reply.types) for reply in replies] == [
        (1, ('INT32',)),
        (2, ('INT32', 'INT32')),
        (0, ('IN_USE', 'IN_USE')),
    ]
    (event,) = one.feed(struct.pack('>HBBii', 12, ord('U'), 2, 5, 6))
    assert event.recipe.named(event.values) == dict(zip(both, (5, 6), strict=True))
    one.close()
    assert not taken


def test_a_list_of_names_may_end_with_a_comma_as_some_clients_write_it():
    controller = server()
    for kind, head, names in (
        (b'O', struct.pack('>d', 125.0), b'timestamp,actual_q,'),
        (b'I', b'', b'input_int_register_1,'),
    ):
        controller.feed(struct.pack('>H', 3 + len(head + names)) + kind + head + names)
    replies = [decode_reply(f) for f in RtdeFrameBuffer().feed(controller.data_to_send())]
    assert [reply.types for reply in replies] == [('DOUBLE', 'VECTOR6D'), ('INT32',)]


@given(RANDOM_FRAMES)
def test_random_bytes_from_a_client_raise_nothing_but_a_remote_error(chunks):
    controller = server()
    controller.feed(SetupInputs(names=('input_int_register_24',)).encode())
    with suppress(RemoteProtocolError):
        for chunk in chunks:
            controller.feed(chunk or b'\0')
            assert len(controller.data_to_send()) < 10_000
