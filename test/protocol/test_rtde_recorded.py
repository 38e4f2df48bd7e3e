# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""RTDE packages and the client, against recorded connections of the manufacturer's library."""

import json
from pathlib import Path

import pytest

from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec, RtdeState
from ur_cartesian_driver.protocol.rtde.rtde_fields import DataType, INPUT_TYPES, OUTPUT_TYPES
from ur_cartesian_driver.protocol.rtde.rtde_packages import (
    DataPackage,
    decode_reply,
    decode_request,
    RequestProtocolVersion,
)
from ur_cartesian_driver.protocol.rtde.rtde_recipe import Recipe

GOLDEN = json.loads((Path(__file__).parent / 'golden' / 'rtde_handshake.json').read_text())
CONNECTIONS = ['handshake', 'handshake_protocol_v1', 'handshake_with_types']
PACKAGES = GOLDEN['data_packages']['packages']


def frames(direction):
    return [
        pytest.param(frame, GOLDEN[name]['protocol_version'] if i > 3 else 2, id=f'{name} {i}')
        for name in CONNECTIONS
        for i, frame in enumerate(GOLDEN[name]['frames'])
        if frame['direction'] == direction
    ]


def meaning(package):
    """Return a package as the fields that the recording names."""
    names = {'names': list, 'types': list}
    return {
        name: names.get(name, lambda x: x)(value)
        for name in type(package).__slots__
        if (value := getattr(package, name)) is not None and name != 'type'
    }


@pytest.mark.parametrize(('frame', 'version'), frames('client_to_controller'))
def test_requests_of_the_library_are_read_and_written(frame, version):
    data = bytes.fromhex(frame['hex'])
    request = decode_request(data, version)
    assert request.encode() == data
    if isinstance(request, DataPackage):
        assert request.recipe_id == frame['fields']['recipe_id']
    elif isinstance(request, RequestProtocolVersion):
        assert request.version == frame['fields']['protocol_version']
    else:
        assert meaning(request) == frame['fields']


@pytest.mark.parametrize(('frame', 'version'), frames('controller_to_client'))
def test_replies_are_read_and_written(frame, version):
    data = bytes.fromhex(frame['hex'])
    reply = decode_reply(data, version)
    assert reply.encode() == data
    if not isinstance(reply, DataPackage):
        assert meaning(reply) == frame['fields']


def tuples(values):
    return {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()}


@pytest.mark.parametrize('package', PACKAGES, ids=lambda p: p['name'])
def test_data_packages_have_the_bytes_of_the_library(package):
    data = bytes.fromhex(package['hex'])
    recipe = Recipe(
        package['recipe'],
        [DataType[name] for name in package['types']],
        package['fields']['recipe_id'],
    )
    assert recipe.named(recipe.unpack(data[3:])) == tuples(package['fields']['values'])
    assert recipe.pack_named(tuples(package['fields']['values'])) == data


@pytest.mark.parametrize('name', CONNECTIONS)
def test_streamed_and_written_values_equal_the_recording(name):
    connection = GOLDEN[name]
    outputs, inputs = connection['output_recipe'], connection['input_recipe']
    version = connection['protocol_version']
    read = 0
    for frame in connection['frames']:
        if frame['type_char'] == 'U':
            outgoing = frame['direction'] == 'controller_to_client'
            names, table = (outputs, OUTPUT_TYPES) if outgoing else (inputs, INPUT_TYPES)
            recipe_id = frame['fields'].get('recipe_id')
            assert (recipe_id is None) == (outgoing and version == 1)
            recipe = Recipe(names, [table[n] for n in names], recipe_id)
            data = bytes.fromhex(frame['hex'])
            values = recipe.unpack(data[3:])
            assert recipe.named(values) == tuples(frame['fields']['values'])
            assert recipe.pack(values) == data
            read += 1
    assert read >= 4


def test_every_package_of_the_librarys_writer_is_read():
    calls = GOLDEN['writer_calls']
    names = calls['input_recipe']
    recipe = Recipe(names, [INPUT_TYPES[n] for n in names], 1)
    packages = [package for call in calls['calls'] for package in call['packages']]
    assert len(packages) > 10
    for package in packages:
        data = bytes.fromhex(package['hex'])
        assert recipe.named(recipe.unpack(data[3:])) == tuples(package['fields']['values'])
        assert recipe.pack_named(tuples(package['fields']['values'])) == data


def run_recording(name, in_pieces, **options):
    """Play the controller of a recording to our client; return the client's events and bytes."""
    connection = GOLDEN[name]
    client = RtdeClientCodec(
        connection['output_recipe'],
        connection['input_recipe'],
        frequency=connection['frequency'],
        **options,
    )
    replies = {}
    data = []
    for frame in connection['frames']:
        if frame['direction'] == 'controller_to_client':
            queue = data if frame['type_char'] == 'U' else replies.setdefault(frame['type'], [])
            queue.append(bytes.fromhex(frame['hex']))
    sent = [client.start()]
    events = []
    while client.state is not RtdeState.READY:
        reply = replies[sent[-1][2]].pop(0)
        for piece in [reply[i : i + 1] for i in range(len(reply))] if in_pieces else [reply]:
            events += client.feed(piece)
            if out := client.data_to_send():
                sent.append(out)
    for package in data:
        events += client.feed(package)
    return events, sent


@pytest.mark.parametrize('in_pieces', [False, True])
@pytest.mark.parametrize('name', CONNECTIONS)
def test_the_client_understands_the_recorded_controllers(name, in_pieces):
    events, sent = run_recording(name, in_pieces)
    connection = GOLDEN[name]
    ready = events[0]
    assert ready.protocol_version == connection['protocol_version']
    assert ready.outputs.names == tuple(connection['output_recipe'])
    assert ready.outputs.types == tuple(OUTPUT_TYPES[n] for n in connection['output_recipe'])
    assert ready.inputs.names == tuple(connection['input_recipe'])
    values = [
        frame['fields']['values']
        for frame in connection['frames']
        if frame['type_char'] == 'U' and frame['direction'] == 'controller_to_client'
    ]
    assert [ready.outputs.named(e.values) for e in events[1:]] == [tuples(v) for v in values]
    # Each request has the bytes that the library sent; it pauses between, we do not.
    library = [
        frame['hex']
        for frame in connection['frames']
        if frame['direction'] == 'client_to_controller'
    ]
    assert set(request.hex() for request in sent) <= set(library)
    assert [chr(request[2]) for request in sent] == (
        ['V', 'V', 'v', 'O', 'I', 'S']
        if ready.protocol_version == 1
        else ['V', 'v', 'O', 'I', 'S']
    )
