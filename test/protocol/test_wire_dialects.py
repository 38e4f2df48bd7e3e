# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Points as older robot programs read them.

The library's own bytes (golden/trajectory_points.json) are those of 2.14. Arcs and splines never
changed but for the time scale, so they are golden for all dialects; the moves of before 2.12, and
how the programs of that time read an arc, are written here word by word.
"""

from dataclasses import replace
import json
from pathlib import Path
import struct

from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from wire_decoding import decode_point

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import ZERO6
from ur_cartesian_driver.motion.plan.primitive import (
    MoveC,
    MoveJ,
    MoveL,
    MoveP,
    OptimoveJ,
    OptimoveL,
    Spline,
)
from ur_cartesian_driver.protocol.program.point_fields import MotionType
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction
from ur_cartesian_driver.protocol.program.trajectory_points import (
    encode_numbers,
    encode_points,
)
from ur_cartesian_driver.protocol.program.wire_dialects import DIALECTS, NEWEST_DIALECT

GOLDEN = json.loads((Path(__file__).parent / 'golden' / 'trajectory_points.json').read_text())
SENT = [case for case in GOLDEN['cases'] if case['hex'] and case['type'] is not None]
#: A primitive can be read from these: an unknown arc mode, or nothing of an optimove, is none.
READABLE = [
    case
    for case in SENT
    if case.get('mode', 0) in (0, 1)
    and not case['note'].startswith('fraction above zero that encodes as 0')
]
UNCHANGED = [case for case in SENT if case['type'] in (3, 51)]
Q = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
POSE = Pose((0.1, 0.2, 0.3))
MICRO = 1_000_000


def encode_point(primitive, dialect=NEWEST_DIALECT):
    return encode_points([primitive], dialect)


def words(primitive, dialect):
    return struct.unpack('>21i', encode_point(primitive, DIALECTS[dialect]))


def fields_of(case):
    if case['type'] == 51:
        return (
            *case['target'],
            *case['target_velocities'],
            *(case['target_accelerations'] or ZERO6),
            case['duration'],
            case['ints'][19],
            51,
        )
    return (
        *case['target'],
        *case['via'],
        case['velocity'],
        case['acceleration'],
        case['mode'],
        0,
        0,
        0,
        0,
        case['blend_radius'],
        3,
    )


def words_of(case, name):
    """Return the words of an arc or spline as the library numbers them: 12 = the velocity."""
    fields, dialect = fields_of(case), DIALECTS[name]
    dialect.check_fields(fields)
    words = list(struct.unpack('>21i', encode_numbers(np.array([fields]), dialect)))
    if case['type'] == MotionType.MOVEC and not dialect.supports_q_near:
        words[12:14] = words[13], words[12]  # programs before 2.12 read them swapped
    return words


def test_the_newest_is_the_last():
    assert list(DIALECTS) == ['2.0', '2.10', '2.12', '2.14']
    assert list(DIALECTS.values())[-1] is NEWEST_DIALECT
    assert set(MotionType) == NEWEST_DIALECT.motion_types


@pytest.mark.parametrize('case', READABLE, ids=lambda case: f'{case["name"]} {case["note"]}')
def test_the_points_of_2_12_are_those_of_2_14(case):
    point = decode_point(bytes.fromhex(case['hex']))
    assert encode_point(point, DIALECTS['2.12']) == encode_point(point)


@pytest.mark.parametrize('name', ['2.10', '2.12'])
@pytest.mark.parametrize('case', UNCHANGED, ids=lambda case: f'{case["name"]} {case["note"]}')
def test_arcs_and_splines_have_the_words_of_the_library_since_2_10(case, name):
    assert words_of(case, name) == case['ints']


@pytest.mark.parametrize(
    'case',
    [case for case in UNCHANGED if not 0.0 < case.get('duration', 0.0) < 0.0005],
    ids=lambda case: f'{case["name"]} {case["note"]}',
)
def test_before_2_10_only_duration_and_blend_differ(case):
    fields = fields_of(case)
    old = words_of(case, '2.0')
    assert old[:18] == case['ints'][:18]
    assert abs(old[18] - 1000.0 * fields[18]) <= 0.5
    assert (
        old[19] == case['ints'][19]
        if case['type'] == 51
        else (abs(old[19] - 1000.0 * fields[19]) <= 0.5)
    )


#: Primitive, words 6-17, duration and blend as they were meant.
MOVES = [
    (MoveJ(target=Q, velocity=0.7, acceleration=0.9, duration=1.5, blend_radius=0.02), 0, 1.5),
    (MoveL(target=POSE, velocity=0.7, acceleration=0.9, duration=1.5, blend_radius=0.02), 1, 1.5),
    (MoveP(target=POSE, velocity=0.7, acceleration=0.9, blend_radius=0.02), 2, 0.0),
    (OptimoveJ(target=Q, velocity=0.7, acceleration=0.9, blend_radius=0.02), 4, 0.0),
    (OptimoveL(target=POSE, velocity=0.7, acceleration=0.9, blend_radius=0.02), 5, 0.0),
]


@pytest.mark.parametrize(
    ('name', 'scale', 'move', 'kind', 'duration'),
    [
        (name, scale, *move)
        for name, scale, kinds in (('2.0', 1000, 3), ('2.10', MICRO, 5))
        for move in MOVES[:kinds]
    ],
    ids=lambda x: x if isinstance(x, str) else type(x).__name__,
)
def test_moves_repeat_velocity_and_acceleration_before_2_12(name, scale, move, kind, duration):
    sent = words(move, name)
    assert sent[6:12] == (700_000,) * 6
    assert sent[12:18] == (900_000,) * 6
    assert sent[18:] == (round(duration * scale), round(0.02 * scale), kind)
    back = decode_point(struct.pack('>21i', *sent), DIALECTS[name])
    assert (back.velocity, back.acceleration, back.blend_radius) == (0.7, 0.9, 0.02)


@pytest.mark.parametrize(
    ('name', 'speeds'),
    [
        ('2.0', (900_000, 700_000)),
        ('2.10', (900_000, 700_000)),
        ('2.12', (700_000, 900_000)),
        ('2.14', (700_000, 900_000)),
    ],
)
def test_programs_before_2_12_read_the_acceleration_of_an_arc_first(name, speeds):
    """Published programs do: their movec takes word 12 for a and word 13 for v."""
    arc = MoveC(target=POSE, via=POSE, velocity=0.7, acceleration=0.9)
    sent = words(arc, name)
    assert sent[12:14] == speeds
    back = decode_point(struct.pack('>21i', *sent), DIALECTS[name])
    assert (back.velocity, back.acceleration) == (0.7, 0.9)
    with pytest.raises(LocalProtocolError, match='velocity is 3000000'):
        encode_point(replace(arc, velocity=3e6), DIALECTS[name])


@pytest.mark.parametrize(
    ('name', 'primitive', 'what'),
    [
        ('2.0', OptimoveJ(target=Q), r'OPTIMOVEJ \(motion type 4\)'),
        ('2.0', MoveJ(target=POSE), 'MOVEJ_POSE'),
        ('2.10', MoveJ(target=POSE), 'MOVEJ_POSE'),
        ('2.10', MoveL(target=Q), 'MOVEL_JOINT'),
        ('2.10', MoveC(target=Q, via=Q), 'MOVEC_JOINT'),
        ('2.10', MoveL(target=POSE, q_near=Q), 'q_near'),
    ],
)
def test_what_a_dialect_does_not_have_is_refused_with_its_name(name, primitive, what):
    with pytest.raises(LocalProtocolError, match=f'{what} .*wire dialect {name}'):
        encode_points([primitive], DIALECTS[name])


BOUNDS = [
    ('2.0', {'duration': 2_147_483.7}, 'duration', '2147483.647'),
    ('2.0', {'duration': 0.0004}, 'duration', '0.001'),
    ('2.10', {'duration': 2147.49}, 'duration', '2147.483647'),
    ('2.14', {'duration': 4e-7}, 'duration', '1e-06'),
    ('2.0', {'blend_radius': 3e6}, 'blend_radius', '2147483.647'),
    ('2.10', {'blend_radius': 3e6}, 'blend_radius', '2147.483647'),
    ('2.0', {'velocity': 3e6}, 'velocity', '2147.483647'),
    ('2.10', {'acceleration': -1.0}, 'acceleration', 'negative'),
]


@pytest.mark.parametrize(('name', 'values', 'field', 'bound'), BOUNDS)
def test_the_error_names_field_value_bound_and_dialect(name, values, field, bound):
    line = MoveL(target=POSE, **values)
    with pytest.raises(LocalProtocolError) as error:
        encode_points([line], DIALECTS[name])
    for part in (field, repr(*values.values()), bound):
        assert part in str(error.value)
    if field == 'duration':
        assert f'wire dialect {name}' in str(error.value)


def test_the_longest_durations_fit():
    for name, longest in (('2.0', 2_147_483.647), ('2.10', 2147.483647)):
        assert words(MoveL(target=POSE, duration=longest), name)[18] == 2**31 - 1


@pytest.mark.parametrize('name', DIALECTS)
@given(st.floats(0.001, 2000.0), st.floats(0.0, 2.0), st.floats(0.0, 10.0))
def test_points_round_trip_within_half_a_unit(name, duration, blend, v):
    line = MoveL(
        target=POSE, velocity=v, acceleration=2.0 * v, duration=duration, blend_radius=blend
    )
    dialect = DIALECTS[name]
    data = encode_point(line, dialect)
    back = decode_point(data, dialect)
    half = 0.5 / dialect.time_scale + 1e-9
    assert back.duration == pytest.approx(duration, rel=0.0, abs=half)
    assert back.blend_radius == pytest.approx(blend, rel=0.0, abs=half)
    assert back.velocity == pytest.approx(v, rel=0.0, abs=0.5e-6 + 1e-9)


@given(st.floats(0.0, 2.0))
def test_a_radius_is_never_rounded_up(radius):
    whole = DIALECTS['2.0'].round_down_radius(radius)
    assert radius - 0.001 < whole <= radius + 1e-9
    assert words(MoveP(target=POSE, blend_radius=whole), '2.0')[19] == round(whole * 1000)
    assert NEWEST_DIALECT.round_down_radius(radius) == radius


def test_all_dialects_have_splines():
    for name in DIALECTS:
        assert words(Spline(target=Q, velocities=ZERO6, duration=1.0), name)[19:] == (1, 51)


@pytest.mark.parametrize('action', TrajectoryAction)
@pytest.mark.parametrize('name', DIALECTS)
def test_only_the_newest_has_streams(name, action):
    if name == '2.14' or 'STREAM' not in action.name:
        DIALECTS[name].check_action(action)
    else:
        with pytest.raises(LocalProtocolError, match=f'{action.name} .*{name}'):
            DIALECTS[name].check_action(action)
