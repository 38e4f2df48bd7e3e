# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""RTDE packages, client and server: against recorded connections and against each other."""

from contextlib import suppress
import json
import math
from pathlib import Path
import struct

from hypothesis import given
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol import registers
from ur_cartesian_driver.protocol.rtde import (
    Acknowledgement,
    ControllerVersion,
    Data,
    DataReceived,
    DataType,
    decode_reply,
    decode_request,
    FieldsNotFound,
    ForeignPackage,
    INPUT_TYPES,
    InputsInUse,
    InputsReply,
    OUTPUT_TYPES,
    OutputsReply,
    PackageType,
    Ready,
    Recipe,
    RequestProtocolVersion,
    RtdeClient,
    RtdeFrameBuffer,
    RtdeState,
    SetupInputs,
    SetupOutputs,
    TextMessage,
)
from ur_cartesian_driver.protocol.rtde_server import InputReceived, RtdeServer

GOLDEN = json.loads((Path(__file__).parent / 'golden' / 'rtde_handshake.json').read_text())
CONNECTIONS = ['handshake', 'handshake_protocol_v1', 'handshake_with_types']
PACKAGES = GOLDEN['data_packages']['packages']
VERSION = ControllerVersion(major=5, minor=21, bugfix=0)


def frames(direction):
    return [
        pytest.param(frame, GOLDEN[name]['protocol_version'] if i > 3 else 2, id=f'{name} {i}')
        for name in CONNECTIONS for i, frame in enumerate(GOLDEN[name]['frames'])
        if frame['direction'] == direction]


def meaning(package):
    """Return a package as the fields that the recording names."""
    names = {'names': list, 'types': list}
    return {name: names.get(name, lambda x: x)(value)
            for name in type(package).__slots__
            if (value := getattr(package, name)) is not None and name != 'type'}


@pytest.mark.parametrize(('frame', 'version'), frames('client_to_controller'))
def test_requests_of_the_library_are_read_and_written(frame, version):
    data = bytes.fromhex(frame['hex'])
    request = decode_request(data, version)
    assert request.encode() == data
    if isinstance(request, Data):
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
    if not isinstance(reply, Data):
        assert meaning(reply) == frame['fields']


def tuples(values):
    return {name: tuple(v) if isinstance(v, list) else v for name, v in values.items()}


@pytest.mark.parametrize('package', PACKAGES, ids=lambda p: p['name'])
def test_data_packages_have_the_bytes_of_the_library(package):
    data = bytes.fromhex(package['hex'])
    recipe = Recipe(package['recipe'], [DataType[name] for name in package['types']],
                    package['fields']['recipe_id'])
    assert recipe.named(recipe.unpack(data[3:])) == tuples(package['fields']['values'])
    assert recipe.pack_named(tuples(package['fields']['values'])) == data


@pytest.mark.parametrize('name', CONNECTIONS)
def test_streamed_and_written_values_are_those_recorded(name):
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
    """Play the controller of a recording to our client; return the events and what it sent."""
    connection = GOLDEN[name]
    client = RtdeClient(connection['output_recipe'], connection['input_recipe'],
                        frequency=connection['frequency'], **options)
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
        for piece in [reply[i:i + 1] for i in range(len(reply))] if in_pieces else [reply]:
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
    assert [recipe.names for recipe in ready.inputs] == [tuple(connection['input_recipe'])]
    values = [frame['fields']['values'] for frame in connection['frames']
              if frame['type_char'] == 'U' and frame['direction'] == 'controller_to_client']
    assert [ready.outputs.named(e.values) for e in events[1:]] == [tuples(v) for v in values]
    # Each request has the bytes that the library sent; it pauses between, we do not.
    library = [frame['hex'] for frame in connection['frames']
               if frame['direction'] == 'client_to_controller']
    assert set(request.hex() for request in sent) <= set(library)
    assert [chr(request[2]) for request in sent] == (
        ['V', 'V', 'v', 'O', 'I', 'S'] if ready.protocol_version == 1
        else ['V', 'v', 'O', 'I', 'S'])


def test_the_tables_hold_all_names():
    assert len(OUTPUT_TYPES) == 406
    assert len({**OUTPUT_TYPES, **INPUT_TYPES}) == 419
    assert all(OUTPUT_TYPES.get(name, t) is t for name, t in INPUT_TYPES.items())


def test_the_registers_of_the_servo_exist():
    assert registers.field(registers.POINTS_BEGUN) == 'output_int_register_26'
    assert registers.six_fields(registers.InputDouble.DESIRED_JOINT_POSITIONS) == tuple(
        f'input_double_register_{i}' for i in range(24, 30))
    assert all(name in INPUT_TYPES for name in registers.SERVO_INPUTS)
    assert len(set(registers.SERVO_INPUTS)) == 4 + 6 + 6 + 1
    assert all(name in OUTPUT_TYPES for name in registers.SERVO_OUTPUTS)


class Link:
    """A client and a server joined by nothing but their bytes."""

    def __init__(self, client, *, taken=None, version=VERSION, **options):
        self.client = client
        self.server = RtdeServer(version, set() if taken is None else taken, **options)
        self.events = []
        self.received = []
        self.to_server(client.start())

    def to_server(self, data):
        self.received += self.server.feed(data)
        if answer := self.server.data_to_send():
            self.to_client(answer)

    def to_client(self, data):
        self.events += self.client.feed(data)
        if request := self.client.data_to_send():
            self.to_server(request)


def test_a_whole_connection():
    link = Link(RtdeClient(['timestamp', 'actual_q'], ['input_int_register_24'], frequency=125.0,
                           input_groups=[['speed_slider_mask', 'speed_slider_fraction']]))
    (ready,) = link.events
    assert isinstance(ready, Ready)
    assert (ready.protocol_version, ready.controller_version) == (2, VERSION)
    (output,) = link.server.outputs
    assert output.frequency == ready.frequency == 125.0
    assert output.recipe == ready.outputs
    assert link.server.streaming
    values = (1.0, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    link.to_client(output.recipe.pack(values))
    assert link.events[1:] == [DataReceived(values)]
    registers_recipe, slider = ready.inputs
    link.to_server(slider.pack((1, 0.25)))
    link.to_server(registers_recipe.pack((-7,)))
    assert link.received == [InputReceived(recipe=slider, values=(1, 0.25)),
                             InputReceived(recipe=registers_recipe, values=(-7,))]


def test_all_names_can_be_streamed_at_once():
    link = Link(RtdeClient(list(OUTPUT_TYPES)))
    (ready,) = link.events
    assert ready.frequency == 500.0
    recipe = link.server.outputs[0].recipe
    link.to_client(recipe.pack(recipe.zeros()))
    assert link.events[1].values == recipe.zeros()
    assert ready.outputs.unpack(bytes(len(recipe.pack(recipe.zeros())) - 3)) == recipe.zeros()


def test_optional_outputs_that_are_unknown_are_left_out():
    known = {name: t for name, t in OUTPUT_TYPES.items()
             if name not in ('payload', 'actual_current_as_torque')}
    link = Link(RtdeClient(['timestamp', 'payload', 'actual_q', 'actual_current_as_torque'],
                           optional_outputs=['payload', 'actual_current_as_torque', 'actual_q']),
                output_types=known)
    (ready,) = link.events
    assert ready.outputs.names == ('timestamp', 'actual_q')
    assert ready.missing == ('payload', 'actual_current_as_torque')
    assert [output.recipe.names for output in link.server.outputs] == [('timestamp', 'actual_q')]


def test_needed_outputs_that_are_unknown_are_named():
    with pytest.raises(FieldsNotFound, match=r'outputs payload_x.*5\.21\.0\.0') as error:
        Link(RtdeClient(['timestamp', 'payload_x', 'payload'], optional_outputs=['payload']))
    assert error.value.names == ('payload_x',)


def test_a_recipe_of_nothing_but_unknown_optional_outputs_is_an_error():
    with pytest.raises(FieldsNotFound):
        Link(RtdeClient(['x'], optional_outputs=['x']))


def test_unknown_inputs_are_named():
    with pytest.raises(FieldsNotFound, match='inputs input_x'):
        Link(RtdeClient(['timestamp'], ['input_x']))


def test_inputs_of_another_client_are_named_and_free_again_after_its_end():
    taken = set()
    first = Link(RtdeClient(['timestamp'], ['speed_slider_mask']), taken=taken)
    with pytest.raises(InputsInUse, match='speed_slider_mask') as error:
        Link(RtdeClient(['timestamp'], ['input_int_register_24', 'speed_slider_mask']),
             taken=taken)
    assert error.value.names == ('speed_slider_mask',)
    first.server.close()
    again = Link(RtdeClient(['timestamp'], ['input_int_register_24', 'speed_slider_mask']),
                 taken=taken)
    assert again.client.state is RtdeState.READY
    assert not first.server.streaming


def test_a_client_may_write_an_input_through_several_recipes_but_two_clients_may_not():
    taken = set()
    one, two = RtdeServer(VERSION, taken), RtdeServer(VERSION, taken)
    both = ('input_int_register_1', 'input_int_register_2')
    for names in (both[:1], both):
        one.feed(SetupInputs(names=names).encode())
    two.feed(SetupInputs(names=both).encode())
    replies = [decode_reply(f) for f in RtdeFrameBuffer().feed(
        one.data_to_send() + two.data_to_send())]
    assert [(reply.recipe_id, reply.types) for reply in replies] == [
        (1, ('INT32',)), (2, ('INT32', 'INT32')), (0, ('IN_USE', 'IN_USE'))]
    (event,) = one.feed(struct.pack('>HBBii', 12, ord('U'), 2, 5, 6))
    assert event.recipe.named(event.values) == dict(zip(both, (5, 6), strict=True))
    one.close()
    assert not taken


def test_a_list_of_names_may_end_with_a_comma_as_some_clients_write_it():
    controller = server()
    for kind, head, names in ((b'O', struct.pack('>d', 125.0), b'timestamp,actual_q,'),
                              (b'I', b'', b'input_int_register_1,')):
        controller.feed(struct.pack('>H', 3 + len(head + names)) + kind + head + names)
    replies = [decode_reply(f) for f in RtdeFrameBuffer().feed(controller.data_to_send())]
    assert [reply.types for reply in replies] == [('DOUBLE', 'VECTOR6D'), ('INT32',)]


def test_an_old_controller_is_asked_for_125_hz():
    old = ControllerVersion(major=3, minor=15, bugfix=8)
    assert Link(RtdeClient(['timestamp']), version=old).events[0].frequency == 125.0
    with pytest.raises(LocalProtocolError, match='125 Hz'):
        Link(RtdeClient(['timestamp'], frequency=500.0), version=old)


@pytest.mark.parametrize('options', [
    {'outputs': []}, {'outputs': ['timestamp', 'timestamp']},
    {'outputs': ['timestamp'], 'frequency': 501.0}, {'outputs': ['timestamp'], 'frequency': -1.0},
    {'outputs': ['timestamp'], 'frequency': math.nan},
    {'outputs': ['timestamp'], 'inputs': ['a'], 'input_groups': [['a']]}])
def test_an_impossible_wish_is_refused_at_once(options):
    with pytest.raises(LocalProtocolError):
        RtdeClient(**options)


def test_a_client_serves_one_connection():
    client = RtdeClient(['timestamp'])
    client.start()
    with pytest.raises(LocalProtocolError):
        client.start()


TEXT = TextMessage(text='Fieldbus', source='PROFINET', level=2)
ACCEPTED = {k: Acknowledgement(type=k, accepted=True) for k in (
    PackageType.REQUEST_PROTOCOL_VERSION, PackageType.CONTROL_PACKAGE_START)}
REFUSED = Acknowledgement(type=PackageType.REQUEST_PROTOCOL_VERSION, accepted=False)
V, S = PackageType.REQUEST_PROTOCOL_VERSION, PackageType.CONTROL_PACKAGE_START
OUTPUTS = OutputsReply(types=('DOUBLE',))
STEPS = [ACCEPTED[V], VERSION, OUTPUTS, ACCEPTED[S]]


def started(steps, outputs=('timestamp',)):
    """Return a client that was fed some replies, and its events."""
    client = RtdeClient(list(outputs))
    client.start()
    return client, [event for step in steps for event in client.feed(step.encode())]


@pytest.mark.parametrize('place', range(5))
def test_text_messages_are_welcome_at_any_time(place):
    client, events = started([*STEPS[:place], *[TEXT] * 10, *STEPS[place:]])
    assert client.state is RtdeState.READY
    assert events.count(TEXT) == 10


@pytest.mark.parametrize('place', range(4))
def test_five_foreign_packages_are_borne_in_each_state_and_no_more(place):
    foreign = InputsReply(types=('DOUBLE',))
    client, events = started([*STEPS[:place], *[foreign] * 5, *STEPS[place:]])
    assert client.state is RtdeState.READY
    assert events.count(ForeignPackage(package=foreign)) == 5
    with pytest.raises(RemoteProtocolError, match='out of turn'):
        started([*STEPS[:place], *[foreign] * 6])


def test_data_before_the_reply_to_start_counts_as_reply():
    recipe = Recipe(['timestamp'], [DataType.DOUBLE])
    data = decode_reply(recipe.pack((40.0,)))
    client, events = started([*STEPS[:3], data, data, ACCEPTED[S], data])
    assert client.state is RtdeState.READY
    assert [type(event) for event in events] == [Ready, *[DataReceived] * 3]


def test_a_controller_that_stops_short_is_an_error_that_says_where():
    client, _ = started(STEPS[:2])
    with pytest.raises(RemoteProtocolError, match='types of the outputs'):
        client.feed(b'')
    with pytest.raises(RemoteProtocolError, match='broken'):
        client.feed(b'')


def test_the_end_of_the_data_is_no_error_between_packages():
    client, _ = started(STEPS)
    assert client.feed(b'') == []


@pytest.mark.parametrize(('steps', 'text'), [
    ([REFUSED, REFUSED], 'neither version 2 nor version 1'),
    ([*STEPS[:2], OutputsReply(types=('DOUBLE', 'DOUBLE'))], '2 types to 1'),
    ([*STEPS[:3], Acknowledgement(type=S, accepted=False)], 'refused to start'),
    ([*STEPS, Data(payload=b'\1' + bytes(9))], '01000000000000000000'),
    ([*STEPS, Data(payload=b'\1' + bytes(7))], 'has 9 bytes, but 8'),
])
def test_what_a_controller_must_not_say(steps, text):
    with pytest.raises(RemoteProtocolError, match=text):
        started(steps)


def test_a_type_that_is_stated_is_believed_more_than_the_table():
    _, events = started([*STEPS[:2], OutputsReply(types=('UINT32',)), ACCEPTED[S]])
    assert events[0].outputs.types == (DataType.UINT32,)


def test_a_field_unknown_to_us_can_be_streamed_if_its_type_is_stated():
    _, events = started(STEPS, outputs=['brand_new'])
    assert events[0].outputs.types == (DataType.DOUBLE,)
    with pytest.raises(RemoteProtocolError, match='brand_new'):
        started([*STEPS[:2], OutputsReply(types=('brand_new',))], outputs=['brand_new'])


def server(**options):
    return RtdeServer(VERSION, set(), **options)


def test_a_client_may_have_several_output_recipes_with_frequencies_of_their_own():
    controller = server()
    controller.feed(SetupOutputs(names=('timestamp',), frequency=10.0).encode()
                    + SetupOutputs(names=('nonsense',), frequency=10.0).encode()
                    + SetupOutputs(names=('actual_q',), frequency=9999.0).encode()
                    + SetupOutputs(names=('robot_mode',), frequency=math.nan).encode())
    assert [(o.recipe.recipe_id, o.recipe.names, o.frequency) for o in controller.outputs] == [
        (1, ('timestamp',), 10.0), (2, ('actual_q',), 500.0), (3, ('robot_mode',), 500.0)]
    replies = [decode_reply(f) for f in RtdeFrameBuffer().feed(controller.data_to_send())]
    assert [reply.recipe_id for reply in replies] == [1, 0, 2, 3]
    assert replies[1].types == ('NOT_FOUND',)


def test_in_version_1_there_is_one_output_recipe_without_id():
    controller = server()
    controller.feed(RequestProtocolVersion(version=1).encode()
                    + SetupOutputs(names=('timestamp',)).encode()
                    + SetupOutputs(names=('actual_q',)).encode())
    (output,) = controller.outputs
    assert len(output.recipe.pack(((0.0,) * 6,))) == 3 + 48
    assert controller.data_to_send().endswith(b'OVECTOR6D')


def test_a_client_with_one_recipe_may_give_it_any_id():
    controller = server()
    controller.feed(SetupInputs(names=('input_int_register_24',)).encode())
    for number in (0, 1, 200):
        (event,) = controller.feed(Data(payload=bytes([number]) + b'\0\0\0\x05').encode())
        assert event.values == (5,)


def test_with_several_recipes_the_id_counts():
    controller = server()
    for number in (24, 25):
        controller.feed(SetupInputs(names=(f'input_int_register_{number}',)).encode())
    (event,) = controller.feed(Data(payload=b'\2\0\0\0\x05').encode())
    assert event.recipe.names == ('input_int_register_25',)
    with pytest.raises(RemoteProtocolError, match='recipe 3'):
        controller.feed(Data(payload=b'\3\0\0\0\x05').encode())


def test_start_and_pause():
    controller = server()
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
        server().feed(Data(payload=bytes(5)).encode())


def test_the_number_of_recipes_is_bounded():
    controller = server()
    request = SetupOutputs(names=('timestamp',), frequency=1.0).encode()
    controller.feed(request * 255)
    with pytest.raises(RemoteProtocolError, match='255'):
        controller.feed(request)


@pytest.mark.parametrize('version', [1, 2])
def test_text_messages_of_both_versions(version):
    text = TEXT if version == 2 else TextMessage(text='Fieldbus', level=2)
    assert decode_reply(text.encode(version), version) == text
    assert decode_request(text.encode(version), version) == text
    if version == 2:
        assert text.encode().hex() == '00164d' + '08' + b'Fieldbus'.hex() + '08' + (
            b'PROFINET'.hex() + '02')


@pytest.mark.parametrize('make', [
    lambda: TextMessage(text='x' * 256).encode(), lambda: SetupInputs(names=('a,b',)).encode(),
    lambda: SetupInputs(names=('',)).encode(),
    lambda: SetupInputs(names=('x' * 100,) * 700).encode(),
    lambda: RequestProtocolVersion(version=65536).encode(),
    lambda: TextMessage(text='', level=256).encode(),
    lambda: ControllerVersion(major=-1, minor=0, bugfix=0).encode(),
    lambda: InputsReply(types=('BOOL',), recipe_id=256).encode()])
def test_what_does_not_fit_a_package_is_refused(make):
    with pytest.raises(LocalProtocolError):
        make()


MIXED = Recipe(['speed_slider_mask', 'external_force_torque', 'input_bit_register_64'],
               [DataType.UINT32, DataType.VECTOR6D, DataType.BOOL])
SIX = (0.0,) * 6


@pytest.mark.parametrize(('values', 'text'), [
    ((-1, SIX, True), 'speed_slider_mask is -1'), ((1.5, SIX, True), 'speed_slider_mask is 1.5'),
    ((1, SIX[1:], True), 'external_force_torque'), ((1, 1.0, True), 'external_force_torque'),
    ((1, SIX), '2 values do not fill'), ((10 ** 400, SIX, True), 'UINT32')])
def test_a_value_that_cannot_be_packed_is_named(values, text):
    with pytest.raises(LocalProtocolError, match=text):
        MIXED.pack(values)


def test_two_wrong_lengths_do_not_make_a_right_one():
    recipe = Recipe(['a', 'b'], [DataType.VECTOR3D, DataType.VECTOR3D])
    with pytest.raises(LocalProtocolError, match='a is'):
        recipe.pack(((1.0, 2.0), (3.0, 4.0, 5.0, 6.0)))


def test_values_by_name_must_be_complete():
    with pytest.raises(LocalProtocolError, match=r'missing: .*external_force_torque'):
        MIXED.pack_named({'speed_slider_mask': 1})
    with pytest.raises(LocalProtocolError, match='surplus: x'):
        MIXED.pack_named({**MIXED.named(MIXED.zeros()), 'x': 1})


@pytest.mark.parametrize('data_type', list(DataType))
def test_a_recipe_of_one_field_gives_one_value(data_type):
    recipe = Recipe(['x'], [data_type])
    values = ((1,) * data_type.length,) if data_type.length > 1 else (1,)
    assert recipe.unpack(recipe.pack(values)[3:]) == values


INTEGERS = {'B': (0, 255), 'I': (0, 2 ** 32 - 1), 'Q': (0, 2 ** 64 - 1),
            'i': (-2 ** 31, 2 ** 31 - 1)}


def values_of(data_type):
    code = data_type.codes[0]
    single = (st.booleans() if code == '?' else st.floats(allow_nan=False) if code == 'd'
              else st.integers(*INTEGERS[code]))
    return single if data_type.length == 1 else st.tuples(*[single] * data_type.length)


@given(st.lists(st.sampled_from(DataType), min_size=1, max_size=8).flatmap(
    lambda types: st.tuples(st.just(types), st.tuples(*map(values_of, types)))),
    st.none() | st.integers(0, 255))
def test_values_come_back_as_they_were(types_and_values, recipe_id):
    types, values = types_and_values
    recipe = Recipe([f'x{i}' for i in range(len(types))], types, recipe_id)
    data = recipe.pack(values)
    assert struct.unpack('>H', data[:2]) == (len(data),)
    assert recipe.unpack(data[3:]) == values
    assert recipe.unpack_frame(data) == (values if len(types) > 1 else None)
    assert recipe.unpack_frame(data + b'\0') is None
    assert recipe.unpack_frame(data[:2] + b'M' + data[3:]) is None


def test_a_package_that_comes_alone_needs_no_feeding():
    names = ('timestamp', 'speed_scaling')
    client, _ = started([STEPS[0], VERSION, OutputsReply(types=('DOUBLE', 'DOUBLE')), STEPS[3]],
                        names)
    data = Recipe(names, [DataType.DOUBLE] * 2).pack((1.0, 2.0))
    assert client.values_in(data) == (1.0, 2.0)
    assert client.values_in(data + data) is None
    assert client.feed(data + data[:5]) == [DataReceived((1.0, 2.0))]
    assert client.values_in(data) is None  # these bytes belong to the package that is not whole
    assert client.feed(data[5:]) == [DataReceived((1.0, 2.0))]
    assert client.values_in(data) == (1.0, 2.0)


def test_before_the_start_nothing_is_a_package_of_values():
    client, _ = started(STEPS[:3], ('timestamp',))
    assert client.values_in(Recipe(['timestamp'], [DataType.DOUBLE]).pack((1.0,))) is None


def framed(kind, payload):
    return (len(payload) + 3).to_bytes(2, 'big') + bytes([kind]) + payload


RANDOM_FRAMES = st.lists(
    st.binary(max_size=40) | st.builds(framed, st.sampled_from(PackageType),
                                       st.binary(max_size=40)), max_size=20)


@given(RANDOM_FRAMES, st.integers(0, 4))
def test_random_bytes_from_a_controller_raise_nothing_but_a_remote_error(chunks, place):
    client, _ = started(STEPS[:place])
    with suppress(RemoteProtocolError):
        for chunk in chunks:
            client.feed(chunk or b'\0')
            assert len(client.data_to_send()) < 200


@given(RANDOM_FRAMES)
def test_random_bytes_from_a_client_raise_nothing_but_a_remote_error(chunks):
    controller = server()
    controller.feed(SetupInputs(names=('input_int_register_24',)).encode())
    with suppress(RemoteProtocolError):
        for chunk in chunks:
            controller.feed(chunk or b'\0')
            assert len(controller.data_to_send()) < 10_000
