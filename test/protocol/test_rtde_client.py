# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The RTDE client, against the server and against made-up controllers."""

from contextlib import suppress
import math

from hypothesis import given
from hypothesis import strategies as st
import pytest
from random_frames import RANDOM_FRAMES

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.protocol.program import registers
from ur_cartesian_driver.protocol.rtde.rtde_client import (
    DataReceived,
    FieldsNotFound,
    HandshakeDone,
    InputsInUse,
    RtdeClientCodec,
    RtdeState,
)
from ur_cartesian_driver.protocol.rtde.rtde_fields import DataType, INPUT_TYPES, OUTPUT_TYPES
from ur_cartesian_driver.protocol.rtde.rtde_packages import (
    Acknowledgement,
    ControllerVersion,
    DataPackage,
    decode_reply,
    PackageType,
    RtdeTextMessage,
    SetupInputsReply,
    SetupOutputsReply,
)
from ur_cartesian_driver.protocol.rtde.rtde_recipe import Recipe
from ur_cartesian_driver.protocol.rtde.rtde_server import InputReceived, RtdeServerCodec

VERSION = ControllerVersion(major=5, minor=21, bugfix=0)


def test_the_tables_hold_all_names():
    assert len(OUTPUT_TYPES) == 406
    assert len({**OUTPUT_TYPES, **INPUT_TYPES}) == 419
    assert all(OUTPUT_TYPES.get(name, t) is t for name, t in INPUT_TYPES.items())


def test_the_registers_of_the_servo_exist():
    assert (
        registers.register_name(registers.OutputInteger.POINTS_BEGUN) == 'output_int_register_26'
    )
    assert registers.six_register_names(registers.InputDouble.DESIRED_JOINT_POSITIONS) == tuple(
        f'input_double_register_{i}' for i in range(24, 30)
    )
    assert all(name in INPUT_TYPES for name in registers.SERVO_INPUTS)
    assert len(set(registers.SERVO_INPUTS)) == 4 + 6 + 6 + 2
    assert all(name in OUTPUT_TYPES for name in registers.SERVO_OUTPUTS)


class Link:
    """A client and a server joined by nothing but their bytes."""

    def __init__(self, client, *, taken=None, version=VERSION, **options):
        self.client = client
        self.server = RtdeServerCodec(version, set() if taken is None else taken, **options)
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
    link = Link(
        RtdeClientCodec(
            ['timestamp', 'actual_q'],
            ['speed_slider_mask', 'speed_slider_fraction'],
            frequency=125.0,
        )
    )
    (ready,) = link.events
    assert isinstance(ready, HandshakeDone)
    assert (ready.protocol_version, ready.controller_version) == (2, VERSION)
    output = link.server.output
    assert output.frequency == ready.frequency == 125.0
    assert output.recipe == ready.outputs
    assert link.server.streaming
    values = (1.0, (1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    link.to_client(output.recipe.pack(values))
    assert link.events[1:] == [DataReceived(values)]
    assert ready.inputs.names == ('speed_slider_mask', 'speed_slider_fraction')
    link.to_server(ready.inputs.pack((1, 0.25)))
    assert link.received == [InputReceived(recipe=ready.inputs, values=(1, 0.25))]


def test_all_names_can_be_streamed_at_once():
    link = Link(RtdeClientCodec(list(OUTPUT_TYPES)))
    (ready,) = link.events
    assert ready.frequency == 500.0
    recipe = link.server.output.recipe
    link.to_client(recipe.pack(recipe.zeros()))
    assert link.events[1].values == recipe.zeros()
    assert ready.outputs.unpack(bytes(len(recipe.pack(recipe.zeros())) - 3)) == recipe.zeros()


def test_optional_outputs_that_are_unknown_are_left_out():
    known = {
        name: t
        for name, t in OUTPUT_TYPES.items()
        if name not in ('payload', 'actual_current_as_torque')
    }
    link = Link(
        RtdeClientCodec(
            ['timestamp', 'payload', 'actual_q', 'actual_current_as_torque'],
            optional_outputs=['payload', 'actual_current_as_torque', 'actual_q'],
        ),
        output_types=known,
    )
    (ready,) = link.events
    assert ready.outputs.names == ('timestamp', 'actual_q')
    assert ready.missing == ('payload', 'actual_current_as_torque')
    assert link.server.output.recipe.names == ('timestamp', 'actual_q')


def test_required_outputs_that_are_unknown_are_named():
    with pytest.raises(FieldsNotFound, match=r'outputs payload_x.*5\.21\.0\.0') as error:
        Link(RtdeClientCodec(['timestamp', 'payload_x', 'payload'], optional_outputs=['payload']))
    assert error.value.names == ('payload_x',)


def test_a_recipe_of_nothing_but_unknown_optional_outputs_is_an_error():
    with pytest.raises(FieldsNotFound):
        Link(RtdeClientCodec(['x'], optional_outputs=['x']))


def test_unknown_inputs_are_named():
    with pytest.raises(FieldsNotFound, match='inputs input_x'):
        Link(RtdeClientCodec(['timestamp'], ['input_x']))


def test_inputs_of_another_client_are_named_and_free_again_after_its_end():
    taken = set()
    first = Link(RtdeClientCodec(['timestamp'], ['speed_slider_mask']), taken=taken)
    with pytest.raises(InputsInUse, match='speed_slider_mask') as error:
        Link(
            RtdeClientCodec(['timestamp'], ['input_int_register_24', 'speed_slider_mask']),
            taken=taken,
        )
    assert error.value.names == ('speed_slider_mask',)
    first.server.close()
    again = Link(
        RtdeClientCodec(['timestamp'], ['input_int_register_24', 'speed_slider_mask']), taken=taken
    )
    assert again.client.state is RtdeState.READY
    assert not first.server.streaming


def test_an_old_controller_is_asked_for_125_hz():
    old = ControllerVersion(major=3, minor=15, bugfix=8)
    assert Link(RtdeClientCodec(['timestamp']), version=old).events[0].frequency == 125.0
    with pytest.raises(LocalProtocolError, match='125 Hz'):
        Link(RtdeClientCodec(['timestamp'], frequency=500.0), version=old)


@pytest.mark.parametrize(
    'options',
    [
        {'outputs': []},
        {'outputs': ['timestamp', 'timestamp']},
        {'outputs': ['timestamp'], 'frequency': 501.0},
        {'outputs': ['timestamp'], 'frequency': -1.0},
        {'outputs': ['timestamp'], 'frequency': math.nan},
        {'outputs': ['timestamp'], 'inputs': ['a', 'a']},
    ],
)
def test_an_impossible_request_is_refused_at_once(options):
    with pytest.raises(LocalProtocolError):
        RtdeClientCodec(**options)


def test_a_client_serves_one_connection():
    client = RtdeClientCodec(['timestamp'])
    client.start()
    with pytest.raises(LocalProtocolError):
        client.start()


TEXT = RtdeTextMessage(text='Fieldbus', source='PROFINET', level=2)
ACCEPTED = {
    k: Acknowledgement(type=k, accepted=True)
    for k in (PackageType.REQUEST_PROTOCOL_VERSION, PackageType.CONTROL_PACKAGE_START)
}
REFUSED = Acknowledgement(type=PackageType.REQUEST_PROTOCOL_VERSION, accepted=False)
V, S = PackageType.REQUEST_PROTOCOL_VERSION, PackageType.CONTROL_PACKAGE_START
OUTPUTS = SetupOutputsReply(types=('DOUBLE',))
STEPS = [ACCEPTED[V], VERSION, OUTPUTS, ACCEPTED[S]]


def started(steps, outputs=('timestamp',)):
    """Return a client that was fed some replies, and its events."""
    client = RtdeClientCodec(list(outputs))
    client.start()
    return client, [event for step in steps for event in client.feed(step.encode())]


@pytest.mark.parametrize('place', range(5))
def test_text_messages_are_accepted_at_any_time(place):
    client, events = started([*STEPS[:place], *[TEXT] * 10, *STEPS[place:]])
    assert client.state is RtdeState.READY
    assert events.count(TEXT) == 10


@pytest.mark.parametrize('versions', [[ACCEPTED[V]], [REFUSED, ACCEPTED[V]]])
def test_a_text_of_version_1_is_accepted_before_a_version_is_agreed(versions):
    client = RtdeClientCodec(['timestamp'])
    client.start()
    (text,) = client.feed(b'\0\x0cM\2Fieldbus')
    assert (text.text, text.level) == ('Fieldbus', 2)
    for step in [*versions, VERSION]:
        client.feed(step.encode())
    assert client.state is RtdeState.OUTPUTS


@pytest.mark.parametrize('place', range(4))
def test_five_unexpected_packages_are_tolerated_in_each_state(place):
    foreign = SetupInputsReply(types=('DOUBLE',))
    client, events = started([*STEPS[:place], *[foreign] * 5, *STEPS[place:]])
    assert client.state is RtdeState.READY
    assert [type(event) for event in events] == [HandshakeDone]
    with pytest.raises(RemoteProtocolError, match='unexpected RTDE packages'):
        started([*STEPS[:place], *[foreign] * 6])


def test_data_before_the_reply_to_start_counts_as_reply():
    recipe = Recipe(['timestamp'], [DataType.DOUBLE])
    data = decode_reply(recipe.pack((40.0,)))
    client, events = started([*STEPS[:3], data, data, ACCEPTED[S], data])
    assert client.state is RtdeState.READY
    assert [type(event) for event in events] == [HandshakeDone, *[DataReceived] * 3]


def test_an_early_end_is_an_error_that_names_the_state():
    client, _ = started(STEPS[:2])
    with pytest.raises(RemoteProtocolError, match='types of the outputs'):
        client.feed(b'')
    with pytest.raises(RemoteProtocolError, match='broken'):
        client.feed(b'')


def test_an_end_between_data_packages_is_not_an_error():
    client, _ = started(STEPS)
    assert client.feed(b'') == []


@pytest.mark.parametrize(
    ('steps', 'text'),
    [
        ([REFUSED, REFUSED], 'neither version 2 nor version 1'),
        ([*STEPS[:2], SetupOutputsReply(types=('DOUBLE', 'DOUBLE'))], '2 types for 1'),
        ([*STEPS[:3], Acknowledgement(type=S, accepted=False)], 'refused to start'),
        ([*STEPS, DataPackage(payload=b'\1' + bytes(9))], '01000000000000000000'),
        ([*STEPS, DataPackage(payload=b'\1' + bytes(7))], 'has 9 bytes, but 8'),
    ],
)
def test_invalid_replies_of_a_controller_are_errors(steps, text):
    with pytest.raises(RemoteProtocolError, match=text):
        started(steps)


def test_a_stated_type_overrides_the_table():
    _, events = started([*STEPS[:2], SetupOutputsReply(types=('UINT32',)), ACCEPTED[S]])
    assert events[0].outputs.types == (DataType.UINT32,)


def test_a_field_unknown_to_us_can_be_streamed_if_its_type_is_stated():
    _, events = started(STEPS, outputs=['brand_new'])
    assert events[0].outputs.types == (DataType.DOUBLE,)
    with pytest.raises(RemoteProtocolError, match='brand_new'):
        started([*STEPS[:2], SetupOutputsReply(types=('brand_new',))], outputs=['brand_new'])


def test_a_single_data_package_is_decoded_without_feed():
    names = ('timestamp', 'speed_scaling')
    client, _ = started(
        [STEPS[0], VERSION, SetupOutputsReply(types=('DOUBLE', 'DOUBLE')), STEPS[3]], names
    )
    data = Recipe(names, [DataType.DOUBLE] * 2).pack((1.0, 2.0))
    assert client.values_in(data) == (1.0, 2.0)
    assert client.values_in(data + data) is None
    assert client.feed(data + data[:5]) == [DataReceived((1.0, 2.0))]
    assert client.values_in(data) is None  # these bytes belong to the package that is not whole
    assert client.feed(data[5:]) == [DataReceived((1.0, 2.0))]
    assert client.values_in(data) == (1.0, 2.0)


def test_before_the_start_no_package_has_values():
    client, _ = started(STEPS[:3], ('timestamp',))
    assert client.values_in(Recipe(['timestamp'], [DataType.DOUBLE]).pack((1.0,))) is None


@given(RANDOM_FRAMES, st.integers(0, 4))
def test_random_bytes_from_a_controller_raise_nothing_but_a_remote_error(chunks, place):
    client, _ = started(STEPS[:place])
    with suppress(RemoteProtocolError):
        for chunk in chunks:
            client.feed(chunk or b'\0')
            assert len(client.data_to_send()) < 200


@pytest.mark.parametrize(
    ('text', 'numbers'),
    [
        ('5.21.0.1', (5, 21, 0, 1)),
        ('3.15', (3, 15, 0, 0)),
        ('URSoftware 5.12.4.1101661 (Aug 10 2022)', (5, 12, 4, 1101661)),
    ],
)
def test_a_version_is_found_in_a_text(text, numbers):
    version = ControllerVersion.parse(text)
    assert (*version.release, version.build) == numbers
    assert ControllerVersion.parse(str(version)) == version


@pytest.mark.parametrize('text', ['', '5', 'PolyScope X'])
def test_a_text_without_a_version_is_refused(text):
    with pytest.raises(ValueError, match='has no version like'):
        ControllerVersion.parse(text)
