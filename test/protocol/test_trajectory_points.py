# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Trajectory points and results, against the bytes of the manufacturer's library."""

from dataclasses import replace
import json
from pathlib import Path
import struct

from hypothesis import given, settings
from hypothesis import strategies as st
import numpy as np
import pytest
from wire_decoding import decode_point

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import ZERO6
from ur_cartesian_driver.motion.goal.goal import ArcMode, ContactEnd, InputKind, OutputKind
from ur_cartesian_driver.motion.plan.primitive import (
    AwaitInput,
    BeginPress,
    CallFunction,
    ChangePayload,
    EndPress,
    LeadLaw,
    MoveC,
    MoveJ,
    MoveL,
    MoveP,
    OptimoveJ,
    OptimoveL,
    PressLaw,
    PulseLaw,
    SpeedLaw,
    Spline,
    SwitchOutput,
    Wait,
)
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.protocol.framing import FIXED_POINT, to_fixed
from ur_cartesian_driver.protocol.program.point_fields import (
    motion_type,
    MotionType,
    PointField,
    SplineKind,
    to_fields,
)
from ur_cartesian_driver.protocol.program.trajectory_points import (
    encode_numbers,
    encode_points,
    TrajectoryResultDecoder,
)
from ur_cartesian_driver.protocol.program.wire_dialects import NEWEST_DIALECT

GOLDEN = json.loads((Path(__file__).parent / 'golden' / 'trajectory_points.json').read_text())
#: The library overflows where these say so; we refuse.
OVERFLOWS = [case for case in GOLDEN['cases'] if case.get('undefined_words')]
TYPED = [case for case in GOLDEN['cases'] if case['type'] is not None and case not in OVERFLOWS]
SENT = [case for case in TYPED if not case['refused']]
REFUSED = [case for case in TYPED if case['refused']]


def encode_point(primitive):
    return encode_points([primitive])


def encode_fields(fields):
    NEWEST_DIALECT.check_fields(fields)
    return encode_numbers(np.array([fields]))


def case_id(case):
    return f'{case["name"]} {case.get("note", "")}'


def fields_of(case):
    """Build the 21 numbers of a case from the rules of the format, not by the code under test."""
    if case['type'] == 51:
        quintic = case['target_accelerations'] is not None
        third = case['target_accelerations'] or ZERO6
        return (
            *case['target'],
            *case['target_velocities'],
            *third,
            case['duration'],
            2 if quintic else 1,
            51,
        )
    near = case.get('q_near')
    arc = 'via' in case
    second = case['via'] if arc else near or ZERO6
    flag = case['mode'] if arc else float(near is not None)
    return (
        *case['target'],
        *second,
        case['velocity'],
        case['acceleration'],
        flag,
        0,
        0,
        0,
        case['duration'],
        case['blend_radius'],
        case['type'],
    )


CLASSES = {
    0: MoveJ,
    6: MoveJ,
    1: MoveL,
    7: MoveL,
    2: MoveP,
    8: MoveP,
    4: OptimoveJ,
    12: OptimoveJ,
    5: OptimoveL,
    13: OptimoveL,
}


def primitive_of(case):
    """Build the primitive of a case."""
    if case['type'] == 51:
        return Spline(
            target=tuple(case['target']),
            velocities=tuple(case['target_velocities']),
            accelerations=case['target_accelerations'] and tuple(case['target_accelerations']),
            duration=case['duration'],
        )
    common = {
        'target': position(case, 'target'),
        'velocity': case['velocity'],
        'acceleration': case['acceleration'],
        'blend_radius': case['blend_radius'],
    }
    if 'via' in case:
        return MoveC(via=position(case, 'via'), mode=case['mode'], **common)
    cls = CLASSES[case['type']]
    if cls in (MoveJ, MoveL):
        common['duration'] = case['duration']
    near = case.get('q_near')
    return cls(q_near=near and tuple(near), **common)


def position(case, what):
    numbers = tuple(case[what])
    return Pose.from_rotation_vector(numbers) if case[f'{what}_kind'] == 'pose' else numbers


@pytest.mark.parametrize('case', SENT, ids=case_id)
def test_bytes_are_those_of_the_library(case):
    assert encode_fields(fields_of(case)).hex() == case['hex']


@pytest.mark.parametrize('case', SENT, ids=case_id)
def test_primitives_give_the_same_words_as_the_library(case):
    """Poses pass through a quaternion: equal rotations, and a tie may round to either side."""
    primitive = primitive_of(case)
    assert motion_type(primitive) == case['type']
    words = struct.unpack('>21i', encode_point(primitive))
    rotations = [
        range(start + 3, start + 6)
        for start, what in ((0, 'target'), (6, 'via'))
        if case.get(f'{what}_kind') == 'pose'
    ]
    loose = {index for block in rotations for index in block}
    for index in set(range(21)) - loose:
        assert words[index] == case['ints'][index]
    for block in rotations:
        mine, theirs = (
            (0.0, 0.0, 0.0, *(w[i] * 1e-6 for i in block)) for w in (words, case['ints'])
        )
        angle = Pose.from_rotation_vector(mine).angle_to(Pose.from_rotation_vector(theirs))
        assert angle < 2e-6


@pytest.mark.parametrize('case', REFUSED, ids=case_id)
def test_what_the_library_refuses_is_refused(case):
    with pytest.raises(LocalProtocolError):
        encode_fields(fields_of(case))
    with pytest.raises(LocalProtocolError, match='Point 0'):
        encode_points([primitive_of(case)])


@pytest.mark.parametrize('case', OVERFLOWS, ids=case_id)
def test_what_overflows_in_the_library_is_refused(case):
    name = f'target[{case["undefined_words"][0]}]'
    with pytest.raises(LocalProtocolError, match='Point 1: ' + name.replace('[', r'\[')):
        encode_points([MoveJ(target=ZERO6), primitive_of(case)])


def test_something_else_than_a_primitive_is_refused():
    (case,) = [case for case in GOLDEN['cases'] if case['type'] is None]
    assert case['refused']
    with pytest.raises(LocalProtocolError, match='not a motion primitive'):
        encode_point(object())


@pytest.mark.parametrize('case', GOLDEN['legacy_calls'], ids=case_id)
def test_float32_scalars_of_older_calls_give_the_same_words(case):
    case = dict(case)
    for name in ('acceleration', 'velocity', 'duration', 'blend_radius'):
        if name in case:
            case[name] = float(np.float32(case[name]))
    if case['refused']:
        with pytest.raises(LocalProtocolError):
            encode_fields(fields_of(case))
    else:
        assert encode_fields(fields_of(case)).hex() == case['hex']


def test_many_points_are_encoded_as_single_points_are():
    sent = [case for case in SENT if not case['note'].startswith('other mode')]
    primitives = [primitive_of(case) for case in sent] * 60
    assert len(primitives) > 2 * 4096
    assert encode_points(iter(primitives)) == b''.join(map(encode_point, primitives))


def test_no_points_are_no_bytes():
    assert encode_points([]) == b''


PULSE_LAW = PulseLaw(
    slot=0,
    output=OutputKind.STANDARD_DIGITAL,
    pin=2,
    distance=0.002,
    phase=0.0,
    width=0.004,
    count=1,
)
FIELD_ERRORS = [
    (MoveJ(target=(0.0, 0.0, float('nan'), 0.0, 0.0, 0.0)), 'target[2] is nan'),
    (MoveL(target=Pose(), q_near=(0.0, 0.0, 0.0, 0.0, 9e9, 0.0)), 'words 6-11[4]'),
    (MoveL(target=Pose(), velocity=float('inf')), 'velocity is inf'),
    (MoveL(target=Pose(), blend_radius=-0.1), 'blend_radius is -0.1'),
    (MoveL(target=Pose(), duration=2147.4836471), 'duration is 2147.4836471'),
    (MoveL(target=ZERO6, q_near=ZERO6), 'only poses can have a q_near'),
    (OptimoveL(target=Pose(), velocity=1.5), 'velocity is 1.5'),
    (
        Spline(target=ZERO6, velocities=(0.0, 3e3, 0.0, 0.0, 0.0, 0.0), duration=1.0),
        'velocities[1] is 3000.0',
    ),
    (
        Spline(target=ZERO6, velocities=ZERO6, accelerations=(float('nan'),) * 6, duration=1.0),
        'accelerations[0] is nan',
    ),
    (
        SwitchOutput(output=OutputKind.STANDARD_DIGITAL, pin=0, value=1.0, delay=-0.1),
        'delay is -0.1',
    ),
    (SwitchOutput(output=OutputKind.STANDARD_ANALOG, pin=0, value=float('nan')), 'value is nan'),
    (SpeedLaw(gain=3e3), 'gain is 3000.0'),
    (LeadLaw(lead=0.1, distance=3e3, speeds=(0.1,) * 12), 'distance is 3000.0'),
    (LeadLaw(lead=0.1, distance=0.1, speeds=(0.1,) * 8 + (3e3,) * 4), 'speeds[8] is 3000.0'),
    (replace(PULSE_LAW, distance=3.0), 'distance [mm] is 3000.0'),
    (replace(PULSE_LAW, phase=3e3), 'phase is 3000.0'),
    (Wait(duration=-1.0), 'duration is -1.0 s'),
    (Wait(duration=3e3), 'duration is 3000.0 s'),
    (
        AwaitInput(
            input=InputKind.STANDARD_ANALOG, pin=0, threshold=3e3, below=False, timeout=1.0
        ),
        'threshold is 3000.0',
    ),
    (
        AwaitInput(
            input=InputKind.STANDARD_ANALOG, pin=0, threshold=0.5, below=False, timeout=-1.0
        ),
        'timeout is -1.0 s',
    ),
    (ChangePayload(mass=3e3, center_of_gravity=(0.0, 0.0, 0.0)), 'mass is 3000.0'),
    (ChangePayload(mass=1.0, center_of_gravity=(0.0, 3e3, 0.0)), 'center_of_gravity[1] is'),
    (
        ChangePayload(mass=1.0, center_of_gravity=(0.0, 0.0, 0.0), transition_time=-0.5),
        'transition_time is -0.5 s',
    ),
    (CallFunction(number=1, arguments=(0.0, 0.0, 3e3, 0.0, 0.0, 0.0)), 'arguments[2] is 3000.0'),
    (CallFunction(number=3000), 'number is 3000'),
    (
        PressLaw(wrench=ZERO6, limits=(3e3,) * 6, damping=0.1, gain_scaling=1.0),
        'limits[0] is 3000.0',
    ),
    (PressLaw(wrench=ZERO6, limits=ZERO6, damping=0.1, gain_scaling=3e3), 'gain_scaling is'),
    (BeginPress(T_base_task=Pose((0.0, 0.0, 3e3)), compliant=ZERO6), 'T_base_task[2] is 3000.0'),
    (BeginPress(T_base_task=Pose(), compliant=(3e3,) * 6), 'compliant[0] is 3000.0'),
]


@pytest.mark.parametrize(('primitive', 'text'), FIELD_ERRORS, ids=lambda x: str(x)[:30])
def test_the_error_names_the_field(primitive, text):
    with pytest.raises(LocalProtocolError) as error:
        encode_points([primitive])
    assert text in str(error.value)


def test_the_spline_kind_follows_from_the_accelerations():
    cubic = Spline(target=ZERO6, velocities=ZERO6, duration=1.0)
    quintic = Spline(target=ZERO6, velocities=ZERO6, accelerations=ZERO6, duration=1.0)
    assert to_fields(cubic)[19] == SplineKind.CUBIC
    assert to_fields(quintic)[19] == SplineKind.QUINTIC
    assert decode_point(encode_point(cubic)) == cubic
    assert decode_point(encode_point(quintic)) == quintic


def test_the_fields_have_the_indices_that_the_robot_program_reads():
    near = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    line = struct.unpack(
        '>21i',
        encode_point(
            MoveL(
                target=Pose((7.0, 0.0, 0.0)),
                q_near=near,
                velocity=1.0,
                acceleration=2.0,
                duration=3.0,
                blend_radius=4.0,
            )
        ),
    )
    places = {
        PointField.TARGET: 7.0,
        PointField.SECOND: 0.1,
        PointField.VELOCITY: 1.0,
        PointField.ACCELERATION: 2.0,
        PointField.HAS_Q_NEAR: 1.0,
        PointField.DURATION: 3.0,
        PointField.BLEND: 4.0,
    }
    assert {place: line[place] / 1e6 for place in places} == places
    assert line[PointField.TYPE] == MotionType.MOVEL
    arc = struct.unpack(
        '>21i', encode_point(MoveC(target=Pose(), via=Pose((8.0, 0.0, 0.0)), mode=ArcMode.FIXED))
    )
    assert (arc[PointField.ARC_MODE], arc[PointField.SECOND]) == (1_000_000, 8_000_000)


def test_the_fields_of_an_output_have_the_indices_that_the_robot_program_reads():
    words = struct.unpack(
        '>21i',
        encode_point(
            SwitchOutput(
                output=OutputKind.STANDARD_ANALOG,
                pin=1,
                value=0.25,
                domain=AnalogDomain.VOLTAGE,
                trigger_pose=Pose((7.0, 0.0, 0.0)),
                trigger_direction=(0.0, 0.6, 0.8, 0.0, 0.0, 0.0),
                starts_beyond=True,
                delay=4.0,
            )
        ),
    )
    places = {
        PointField.TARGET: 7.0,
        PointField.SECOND + 1: 0.6,
        PointField.OUTPUT_KIND: 3.0,
        PointField.OUTPUT_PIN: 1.0,
        PointField.OUTPUT_VALUE: 0.25,
        PointField.OUTPUT_DOMAIN: 1.0,
        PointField.HAS_TRIGGER_POSE: 1.0,
        PointField.STARTS_BEYOND: 1.0,
        PointField.DURATION: 4.0,
    }
    assert {place: words[place] / 1e6 for place in places} == places
    assert words[PointField.TYPE] == MotionType.SWITCH_OUTPUT == 200


def vector(limit):
    return st.tuples(*[st.floats(-limit, limit)] * 6)


JOINTS = vector(6.3)
POSES = st.builds(
    lambda v: Pose.from_rotation_vector((*v[:3], *(x * 0.28 for x in v[3:]))), vector(6.3)
)
POSITIVE = st.floats(0.0, 2000.0)
DURATION = st.just(0.0) | st.floats(1e-6, 2000.0)
FRACTION = st.floats(1e-6, 1.0)
SPEEDS = {'velocity': POSITIVE, 'acceleration': POSITIVE, 'blend_radius': POSITIVE}
FRACTIONS = {'velocity': FRACTION, 'acceleration': FRACTION, 'blend_radius': POSITIVE}
NEAR = {'target': POSES, 'q_near': st.none() | JOINTS}


def kinds(cls, **values):
    return st.builds(cls, **NEAR, **values) | st.builds(cls, target=JOINTS, **values)


PRIMITIVES = st.one_of(
    kinds(MoveJ, **SPEEDS, duration=DURATION),
    kinds(MoveL, **SPEEDS, duration=DURATION),
    kinds(MoveP, **SPEEDS),
    kinds(OptimoveJ, **FRACTIONS),
    kinds(OptimoveL, **FRACTIONS),
    st.builds(
        MoveC, target=POSES | JOINTS, via=POSES | JOINTS, **SPEEDS, mode=st.sampled_from(ArcMode)
    ),
    st.builds(
        Spline,
        target=JOINTS,
        velocities=JOINTS,
        accelerations=st.none() | JOINTS,
        duration=DURATION,
    ),
    st.builds(
        SwitchOutput,
        output=st.sampled_from(OutputKind),
        pin=st.integers(0, 7),
        value=FRACTION,
        domain=st.sampled_from(AnalogDomain),
        trigger_pose=st.none() | POSES,
        trigger_direction=vector(1.0),
        starts_beyond=st.booleans(),
        delay=DURATION,
    ),
    st.builds(
        SwitchOutput,
        output=st.just(OutputKind.STANDARD_ANALOG),
        pin=st.integers(0, 1),
        value=FRACTION,
        follows_speed=st.just(True),
    ),
    st.builds(
        SwitchOutput,
        output=st.just(OutputKind.STANDARD_DIGITAL),
        pin=st.integers(0, 7),
        value=st.just(1.0),
        begins_pulses=st.just(True),
    ),
    st.builds(
        PulseLaw,
        slot=st.integers(0, 3),
        output=st.sampled_from(OutputKind),
        pin=st.integers(0, 7),
        distance=FRACTION,
        phase=FRACTION,
        width=FRACTION,
        count=st.integers(0, 1_000_000),
    ),
    st.builds(SpeedLaw, gain=FRACTION, offset=FRACTION, maximum=FRACTION, filter_time=FRACTION),
    st.builds(Wait, duration=DURATION),
    st.builds(
        AwaitInput,
        input=st.sampled_from(InputKind),
        pin=st.integers(0, 7),
        threshold=FRACTION,
        below=st.booleans(),
        timeout=DURATION,
        go_on=st.booleans(),
    ),
    st.builds(
        ChangePayload, mass=POSITIVE, center_of_gravity=st.tuples(FRACTION, FRACTION, FRACTION)
    ),
    st.builds(CallFunction, number=st.integers(0, 99), arguments=vector(2147.0)),
    st.builds(
        PressLaw,
        wrench=vector(100.0),
        limits=vector(1.0),
        damping=FRACTION,
        gain_scaling=FRACTION,
        zero_sensor=st.booleans(),
        contact=st.sampled_from(ContactEnd),
    ),
    st.builds(BeginPress, T_base_task=POSES, compliant=vector(1.0), follows_tool=st.booleans()),
    st.just(EndPress()),
)


@given(PRIMITIVES)
def test_points_round_trip_within_half_a_unit(primitive):
    back = decode_point(encode_point(primitive))
    assert motion_type(back) is motion_type(primitive)
    numbers, again = to_fields(primitive), to_fields(back)
    assert np.allclose(numbers, again, rtol=0.0, atol=0.5e-6 + 1e-9)


@settings(max_examples=50)
@given(st.lists(PRIMITIVES, max_size=4))
def test_vectorized_encoding_gives_the_bytes_of_single_numbers(primitives):
    expected = b''
    for primitive in primitives:
        fields = to_fields(primitive)
        scales = [*[FIXED_POINT] * 19, 1 if fields[20] == MotionType.SPLINE else FIXED_POINT, 1]
        words = (to_fixed(*numbers) for numbers in zip(fields, 'x' * 21, scales, strict=True))
        expected += struct.pack('>21i', *words)
    assert encode_points(primitives) == expected


RESULTS = [
    (TrajectoryResult.SUCCESS, '00000000'),
    (TrajectoryResult.CANCELED, '00000001'),
    (TrajectoryResult.FAILURE, '00000002'),
    (TrajectoryResult.INPUT_MISSING, '00000003'),
    (TrajectoryResult.CONTACT, '00000004'),
    (TrajectoryResult.NO_CONTACT, '00000005'),
    (TrajectoryResult.TOUCHED, '00000006'),
]


@pytest.mark.parametrize(('result', 'text'), RESULTS)
def test_results(result, text):
    assert TrajectoryResultDecoder().feed(bytes.fromhex(text)) == [result]


def test_results_are_read_when_joined_or_in_pieces():
    """The library loses two results in one segment; a stream has no segments."""
    stream = b''.join(bytes.fromhex(text) for _, text in RESULTS)
    assert TrajectoryResultDecoder().feed(stream) == [result for result, _ in RESULTS]
    decoder = TrajectoryResultDecoder()
    assert [r for i in range(len(stream)) for r in decoder.feed(stream[i : i + 1])] == [
        result for result, _ in RESULTS
    ]
    assert decoder.feed(b'') == []


@pytest.mark.parametrize('text', ['00000007', 'ffffffff', '7fffffff'])
def test_an_unknown_result_is_refused_with_its_bytes(text):
    with pytest.raises(RemoteProtocolError, match=text):
        TrajectoryResultDecoder().feed(bytes.fromhex(text))


def test_an_end_inside_a_result_is_an_error():
    decoder = TrajectoryResultDecoder()
    decoder.feed(b'\x00')
    with pytest.raises(RemoteProtocolError):
        decoder.feed(b'')
