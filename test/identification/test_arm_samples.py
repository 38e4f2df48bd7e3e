# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Recordings are read whoever wrote them, and refused with a sentence."""

import gzip

import numpy as np
import pytest

from ur_cartesian_driver.identification.arm_samples import read_samples
from ur_cartesian_driver.identification.recorded_calls import (
    MotionCommand,
    read_commands,
    SetPoints,
)

NAMES = ['timestamp', *(f'target_q_{i}' for i in range(6)), *(f'actual_q_{i}' for i in range(6))]
ROWS = np.column_stack([0.002 * np.arange(60), np.tile(0.1 * np.arange(12), (60, 1))])


def text(delimiter=' ', names=NAMES, rows=ROWS):
    return '\n'.join(delimiter.join(map(str, row)) for row in [names, *rows]) + '\n'


@pytest.mark.parametrize('delimiter', [' ', ',', ';', '\t'])
def test_text_is_read_with_any_delimiter(tmp_path, delimiter):
    path = tmp_path / 'moves.csv'
    path.write_text(text(delimiter))
    samples = read_samples(path)
    assert (samples.time == ROWS[:, 0]).all()
    assert (samples.target_q == ROWS[:, 1:7]).all()
    assert (samples.actual_q == ROWS[:, 7:]).all()
    assert samples.target_pose is samples.runtime_state is None
    assert samples.cycle == pytest.approx(0.002)


def test_a_mark_of_utf_8_is_no_part_of_a_title(tmp_path):
    """Excel writes one."""
    path, packed = tmp_path / 'moves.csv', tmp_path / 'moves.csv.gz'
    path.write_text(text(','), encoding='utf-8-sig')
    packed.write_bytes(gzip.compress(text(',').encode('utf-8-sig')))
    assert len(read_samples(path).time) == len(read_samples(packed).time) == len(ROWS)


def test_packed_text_and_titles_with_units_are_read(tmp_path):
    names = ['time [s]', *(f'target_q_{i} [rad]' for i in range(6))]
    names += [f'target_TCP_pose_{i}' for i in range(6)]
    rows = ROWS.copy()
    rows[:, 7:] = 0.1, 0.2, 0.3, 0.0, 0.0, np.pi
    path = tmp_path / 'moves.csv.gz'
    path.write_bytes(gzip.compress(text(',', names, rows).encode()))
    samples = read_samples(path)
    assert samples.actual_q is None
    assert samples.target_pose[7] == pytest.approx([0.1, 0.2, 0.3, 0, 0, 1, 0])


def test_a_packet_that_was_written_twice_counts_once(tmp_path):
    path = tmp_path / 'moves.csv'
    path.write_text(text(rows=np.repeat(ROWS, 2, axis=0)))
    assert len(read_samples(path).time) == len(ROWS)


def test_a_column_that_the_robot_did_not_report_is_none(tmp_path):
    rows = ROWS.copy()
    rows[:, 7:] = np.nan
    path = tmp_path / 'moves.csv'
    path.write_text(text(rows=rows))
    assert read_samples(path).actual_q is None


def hole():
    rows = ROWS.copy()
    rows[7, 9] = np.nan
    return text(rows=rows)


def mixed():
    rows = ROWS.copy()
    rows[30:, 0] -= 1.0
    return text(rows=rows)


@pytest.mark.parametrize(
    ('content', 'words'),
    [
        ('', 'is empty'),
        ('\n', 'is empty'),
        ('a b\n1 2\n', 'has no column timestamp: record the RTDE outputs'),
        (text(names=['time', 'x', *NAMES[2:]]), 'has no column target_q_0'),
        (text(rows=ROWS[:0]), 'is too short: it has 0 packets, 50 are needed'),
        (text(rows=ROWS[:9]), 'is too short: it has 9 packets, 50 are needed'),
        (text()[:-100] + '\n', 'is damaged below its titles: '),
        (text().replace('0.1', 'x', 1), 'is damaged below its titles: could not convert'),
        (text().replace('0.1 ', 'nan ', 1), 'packet 1 has no number in target_q'),
        (hole(), 'is damaged: packet 8 has no number in actual_q; remove that packet'),
        (mixed(), 'is mixed up: time goes back from 0.058 s to -0.940 s at packet 31'),
        (text(rows=np.repeat(ROWS[:1], 99, axis=0)), 'is damaged: its time stands still'),
    ],
)
@pytest.mark.filterwarnings('error')
def test_what_is_no_recording_is_refused(tmp_path, content, words):
    path = tmp_path / 'moves.csv'
    path.write_text(content)
    with pytest.raises(ValueError, match=r'moves\.csv') as error:
        read_samples(path)
    assert words in str(error.value)


@pytest.mark.parametrize(
    ('name', 'content', 'words'),
    [
        ('a.csv.gz', gzip.compress(text().encode(), mtime=0)[:-200], 'unpacking it fails'),
        ('b.csv.gz', text().encode(), 'unpacking it fails'),
        ('c.csv', b'\xff\xfe\x00', 'neither ours nor text'),
        ('d.npz', b'PK', 'no recording'),
    ],
)
def test_what_is_no_text_is_refused(tmp_path, name, content, words):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=words):
        read_samples(tmp_path / name)


def test_the_calls_of_a_program_are_read():
    found = read_commands(
        'def program():\n  movej([0, 1], a=1.4, v=1.05)\n  movel(p[1, 2], t = 4) # slow\nend', 'x'
    )
    assert found == [
        MotionCommand(name='movej', a=1.4, v=1.05),
        MotionCommand(name='movel', t=4.0),
    ]


@pytest.mark.parametrize(
    ('call', 'found'),
    [
        ('movej([0, 1], 1.4, 1.05)', {'a': 1.4, 'v': 1.05}),
        ('movej([0, 1], 1.4, 1.05, 0, 0.01)', {'a': 1.4, 'v': 1.05, 'r': 0.01}),
        ('movej(f(2, a=1), 1.4, v=1.05)', {'a': 1.4, 'v': 1.05}),
        ('movej(q=[a, v], t=3)', {'t': 3.0}),
        ('movej(p[0,\n1], # a=9\n a=1)', {'a': 1.0}),
        ('movej(x, a=+2, r=0)', {'a': 2.0}),
        ('textmsg("movej(a=1)")\nmovej(x)', {}),
    ],
)
def test_arguments_are_bound_as_the_controller_does(call, found):
    assert read_commands(call, 'x') == [MotionCommand(name='movej', **found)]


def test_calls_of_servoj_in_a_row_are_one_motion():
    """Until a stop, or another motion, comes between."""
    line = 'servoj([0, 0, 0, 0, 0, {}], t=0.04, lookahead_time=0.06, gain=500)'
    lines = [line.format(0.1), 'sleep(1)', line.format(-0.2), 'stopj(2)', line.format(0.3)]
    found = read_commands('\n'.join([*lines, 'movej(x)', 'servoj([1,2,3,4,5,6], 0, 0, 1)']), 'x')
    first, second, move, third = [each.set_points for each in found]
    assert [each.name for each in found] == ['servoj', 'servoj', 'movej', 'servoj']
    assert first == SetPoints(
        targets=((0, 0, 0, 0, 0, 0.1), (0, 0, 0, 0, 0, -0.2)),
        times=(0.04, 0.04),
        lookahead_time=0.06,
        gain=500.0,
        is_stopped=True,
    )
    assert (second.times, second.is_stopped) == ((0.04,), False)
    assert move is None
    assert third == SetPoints(targets=((1, 2, 3, 4, 5, 6),), times=(1.0,))


ZEROS = '[0, 0, 0, 0, 0, 0]'


@pytest.mark.parametrize(
    ('content', 'words'),
    [
        ('sleep(1)', 'moves.script has no call of movej, movel or servoj; write one a line'),
        ('servoj(q, t=1)', 'line 1: q of servoj is no list of six plain numbers; write the'),
        ('servoj([1, 2, 3], t=1)', 'line 1: q of servoj is no list of six plain numbers'),
        (f'servoj({ZEROS})', 'line 1: servoj leaves t out; write the time that it had'),
        (f'servoj({ZEROS}, t=0)', 'line 1: t of servoj is 0; it must be more than 0'),
        (f'servoj({ZEROS}, t=1, gain=x)', 'gain of servoj is no plain number'),
        (
            f'servoj({ZEROS}, t=1)\nservoj({ZEROS}, t=1, gain=500)',
            'line 2: servoj has another lookahead_time or gain than the call before; record',
        ),
        (f'while x:\n servoj({ZEROS}, t=1)\nend', 'line 2: servoj stands in a loop, a branch'),
        ('movel(there, a=fast)', 'line 1: a of movel is no plain number; write the number that'),
        ('movel(there, 1, 0.2 + x)', 'moves.script, line 1: v of movel is no plain number'),
        ('\nmovej(q, v=-1)', 'moves.script, line 2: v of movej is -1; it must be more than 0'),
        ('movej(q, a=0)', 'line 1: a of movej is 0; it must be more than 0'),
        ('movej(q, 1, 1, -1)', 'line 1: t of movej is -1; it must be 0 or more'),
        ('movej(q, x=1)', 'line 1: movej has no argument x; it has q, a, v, t, r'),
        ('movej(q, 1, 1, 1, 1, 1)', 'line 1: movej has no argument number 6'),
        ('while True:\n  movej(q)\nend', 'line 2: movej stands in a loop, a branch or a function'),
        ('def f():\n def g():\n movel(p)\n end\n g()\n g()\nend', 'line 3: movel stands in a'),
        (
            'def move():\n movej(q)\nend\ndef program():\n move()\n move()\nend',
            'line 2: movej stands in a loop, a branch or a function',
        ),
        ('movej(q, r=-1)', 'line 1: r of movej is -1; it must be 0 or more'),
        ('movej(q', 'moves.script, line 1: this is no call of URScript'),
    ],
)
def test_what_is_no_call_is_refused(content, words):
    with pytest.raises(ValueError, match=words):
        read_commands(content, 'moves.script')
