# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""RTDE packages and recipes: values there and back, and what fits no package."""

import struct

from hypothesis import given
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.protocol.rtde.rtde_fields import DataType
from ur_cartesian_driver.protocol.rtde.rtde_packages import (
    ControllerVersion,
    decode_reply,
    decode_request,
    RequestProtocolVersion,
    RtdeTextMessage,
    SetupInputs,
    SetupInputsReply,
)
from ur_cartesian_driver.protocol.rtde.rtde_recipe import Recipe

TEXT = RtdeTextMessage(text='Fieldbus', source='PROFINET', level=2)


@pytest.mark.parametrize('version', [1, 2])
def test_text_messages_of_both_versions(version):
    text = TEXT if version == 2 else RtdeTextMessage(text='Fieldbus', level=2)
    assert decode_reply(text.encode(version), version) == text
    assert decode_request(TEXT.encode(), version) == TEXT
    if version == 2:
        assert text.encode().hex() == '00164d' + '08' + b'Fieldbus'.hex() + '08' + (
            b'PROFINET'.hex() + '02'
        )


@pytest.mark.parametrize(
    'make',
    [
        lambda: RtdeTextMessage(text='x' * 256).encode(),
        lambda: SetupInputs(names=('a,b',)).encode(),
        lambda: SetupInputs(names=('',)).encode(),
        lambda: SetupInputs(names=('x' * 100,) * 700).encode(),
        lambda: RequestProtocolVersion(version=65536).encode(),
        lambda: RtdeTextMessage(text='', level=256).encode(),
        lambda: ControllerVersion(major=-1, minor=0, bugfix=0).encode(),
        lambda: SetupInputsReply(types=('BOOL',), recipe_id=256).encode(),
    ],
)
def test_what_does_not_fit_a_package_is_refused(make):
    with pytest.raises(LocalProtocolError):
        make()


MIXED = Recipe(
    ['speed_slider_mask', 'external_force_torque', 'input_bit_register_64'],
    [DataType.UINT32, DataType.VECTOR6D, DataType.BOOL],
)
SIX = (0.0,) * 6


@pytest.mark.parametrize(
    ('values', 'text'),
    [
        ((-1, SIX, True), 'speed_slider_mask is -1'),
        ((1.5, SIX, True), 'speed_slider_mask is 1.5'),
        ((1, SIX[1:], True), 'external_force_torque'),
        ((1, 1.0, True), 'external_force_torque'),
        ((1, SIX), 'cannot take 2 values'),
        ((10**400, SIX, True), 'UINT32'),
    ],
)
def test_the_error_names_a_value_that_cannot_be_packed(values, text):
    with pytest.raises(LocalProtocolError, match=text):
        MIXED.pack(values)


def test_wrong_lengths_with_the_right_sum_are_refused():
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


INTEGERS = {'B': (0, 255), 'I': (0, 2**32 - 1), 'Q': (0, 2**64 - 1), 'i': (-(2**31), 2**31 - 1)}


def values_of(data_type):
    code = data_type.codes[0]
    single = (
        st.booleans()
        if code == '?'
        else st.floats(allow_nan=False)
        if code == 'd'
        else st.integers(*INTEGERS[code])
    )
    return single if data_type.length == 1 else st.tuples(*[single] * data_type.length)


@given(
    st.lists(st.sampled_from(DataType), min_size=1, max_size=8).flatmap(
        lambda types: st.tuples(st.just(types), st.tuples(*map(values_of, types)))
    ),
    st.none() | st.integers(0, 255),
)
def test_recipe_values_round_trip(types_and_values, recipe_id):
    types, values = types_and_values
    recipe = Recipe([f'x{i}' for i in range(len(types))], types, recipe_id)
    data = recipe.pack(values)
    assert struct.unpack('>H', data[:2]) == (len(data),)
    assert recipe.unpack(data[3:]) == values
    assert recipe.unpack_frame(data) == (values if len(types) > 1 else None)
    assert recipe.unpack_frame(data + b'\0') is None
    assert recipe.unpack_frame(data[:2] + b'M' + data[3:]) is None
