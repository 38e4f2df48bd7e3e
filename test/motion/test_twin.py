# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The table of laws, and twins as files: written, read again, and refused with a sentence."""

from dataclasses import fields
from random import Random
import re

import pytest
import yaml

from ur_cartesian_driver.motion.twin.laws import ArmFigures, ASSUMED_LAWS, LAWS, MotionLaws
from ur_cartesian_driver.motion.twin.twin import ArmIdentity, Estimate, Twin
from ur_cartesian_driver.motion.twin.twin_file import (
    read_twin,
    twin_from_text,
    twin_text,
    TwinFileError,
)

ARM = ArmIdentity(model='ur5e', serial_number='20235501234', software='5.21.0', motion_version=1)
TWIN = Twin(
    arm=ARM,
    date='2026-11-27',
    files=('moves.csv', 'day 2: stops.mcap'),
    estimates={
        'start_time': Estimate(
            value=0.158,
            interval=(0.154, 0.162),
            evidence='12 starts of programs',
            left_over='0.4 ms',
        ),
        'blend_shape': Estimate(value='parabola'),
        'lag': Estimate(value=1e-5, interval=(0.0, 1e-3)),
    },
    not_identified={'blend_begin': 'no blends in the files; record some moves with r'},
)
TEXT = twin_text(TWIN)


def test_each_law_has_an_assumed_value_that_it_can_have():
    assert set(LAWS) == {each.name for kind in (MotionLaws, ArmFigures) for each in fields(kind)}
    for name, law in LAWS.items():
        assert law.name == name
        assert law.assumed is None or not law.problem(law.assumed)
        assert law.choices or law.low < law.high


def test_what_was_not_measured_is_assumed():
    assert TWIN.laws == MotionLaws(start_time=0.158)
    assert TWIN.arm_figures == {'lag': 1e-5}
    assert Twin(arm=ARM, date='2026-11-27').laws == ASSUMED_LAWS


def test_a_twin_is_written_and_read_again(tmp_path):
    (tmp_path / 'twin.yaml').write_text(TEXT, encoding='utf-8')
    assert read_twin(tmp_path / 'twin.yaml') == TWIN


def test_the_file_has_a_paragraph_for_each_law():
    paragraphs = TEXT.split('\n\n')
    assert [p.splitlines()[1] for p in paragraphs[1:]] == [
        'start_time:',
        'blend_begin:',
        'blend_shape:',
        'lag:',
    ]
    assert paragraphs[1].splitlines()[0] == (
        '# Time within which the first path of a program gets up to speed [s]; recorded on arms: '
        '0.16.'
    )
    assert yaml.safe_load(TEXT)['start_time']['interval'] == [0.154, 0.162]


@pytest.mark.parametrize(
    ('old', 'new', 'words'),
    [
        (TEXT, '', 'twin.yaml is empty'),
        (TEXT, 'a: [', 'line 1: this is not YAML'),
        (TEXT, 'a: \0', 'this is not YAML'),
        (TEXT, '[' * 100_000, 'nested too deeply'),
        (TEXT, '- 1', 'line 1: the file must have fields'),
        (TEXT, 'timestamp,actual_q_0\n0.0,1.0', 'line 1: the file must have fields'),
        (TEXT, 'arm: {model: ur5e}', 'line 1: this is no twin: it has no field twin'),
        ('twin: 1', 'twin: 2', 'line 2: twin is 2, a format that is not known'),
        ('twin: 1', 'twin: [1]', 'line 2: twin must be one value'),
        (TEXT, TEXT[: TEXT.index('date')], 'line 2: date is missing, so the file may be cut'),
        ('model: ur5e, ', '', 'line 3: arm has no model'),
        ('5.21.0', 'five', 'line 3: five is no version; write it like'),
        ('motion_version: 1', 'motion_version: 3', 'line 3: motion_version of arm is 3'),
        ('2026-11-27\nf', '27.11.2026\nf', 'line 4: 27.11.2026 is no date; write it as'),
        ('start_time:', 'start_tim:', 'line 8: start_tim is no law of motion; start_time is pr'),
        ('start_time:', 'x:', 'line 8: x is no law of motion; known are'),
        ('value: 0.158', 'values: 0.158', 'line 9: values is no field of start_time; value is'),
        ('value: 0.158', 'value: abc', 'line 9: the value of start_time is abc, which is no'),
        ('value: 0.158', 'value: .nan', 'line 9: the value of start_time is .nan, which is no'),
        ('value: 0.158', 'value: nan', 'line 9: start_time is nan; it must be a number from 0 to'),
        ('value: 0.158', 'value: 3', 'line 9: start_time is 3.0; it must be a number from 0 to 2'),
        ('value: 0.158', 'value: [1]', 'line 9: value of start_time must be one value'),
        ('unit: s\n', 'unit: ms\n', 'line 10: start_time has the unit ms; give it in s'),
        ('  unit: s\n', '', 'line 9: start_time has no unit; give it in s'),
        ('[0.154, 0.162]', '[0.16, 0.162]', 'line 11: start_time has the interval 0.16 to 0.162,'),
        ('[0.154, 0.162]', '[nan, 0.162]', 'line 11: start_time has the interval nan to 0.162'),
        ('[0.154, 0.162]', '0.1', 'line 11: the interval of start_time must be two numbers'),
        ('  interval: [0.154, 0.162]\n', '', 'line 9: start_time has no interval'),
        ('value: parabola', 'value: circle', 'blend_shape is circle; it must be parabola or'),
        ('lag:', 'start_time:', 'start_time is given twice'),
        ('\nlag:', '\n? [a]\n: b\nlag:', 'a field of the file has no name'),
        ('  not_identified', '  value: 1\n  not_identified', 'is not identified, so it can'),
    ],
)  # fmt: skip
def test_a_file_that_is_no_twin_is_refused_with_its_line(old, new, words):
    assert old in TEXT
    with pytest.raises(TwinFileError) as error:
        twin_from_text(TEXT.replace(old, new, 1), 'twin.yaml')
    text = str(error.value)
    assert words in text
    assert text.startswith('twin.yaml')
    assert text.endswith('.')


def damaged(seed):
    random, text = Random(seed), TEXT
    for _ in range(random.randint(1, 4)):
        at = random.randrange(len(text))
        cut = random.randint(0, 20)
        put = random.choice(['', ':', '\n', '- ', '{', '\x07', "'", '1'])
        text = text[:at] + put + text[at + cut :]
    return text


def test_a_damaged_file_is_read_or_refused_with_a_sentence():
    read, refusals = 0, []
    for seed in range(300):
        try:
            twin = twin_from_text(damaged(seed), 'twin.yaml')
        except TwinFileError as error:
            refusals.append(str(error))
        else:
            assert twin_from_text(twin_text(twin), 'twin.yaml') == twin
            read += 1
    assert read > 20
    assert len(refusals) > 150
    for refusal in refusals:
        assert re.fullmatch(r'twin\.yaml[^\n]*\.', refusal)
        assert 'Node(' not in refusal


def test_a_file_that_is_no_text_is_refused(tmp_path):
    (tmp_path / 'twin.yaml').write_bytes(b'\xff\xfe\x00')
    with pytest.raises(TwinFileError, match='no text in UTF-8'):
        read_twin(tmp_path / 'twin.yaml')


@pytest.mark.parametrize(
    ('robot', 'words'),
    [
        (ARM, ''),
        (ArmIdentity(), ''),
        (ArmIdentity(model='ur5e', software='5.21.0.1234'), ''),
        (ArmIdentity(model='ur10e'), 'model ur5e, not ur10e'),
        (ArmIdentity(serial_number='2'), 'serial number 20235501234, not 2'),
        (ArmIdentity(software='5.21.1'), 'software 5.21.0, not 5.21.1'),
        (ArmIdentity(motion_version=2), 'motion version 1, not 2'),
        (
            ArmIdentity(software='5.22.0', motion_version=2),
            'software 5.21.0, not 5.22.0 and motion version 1, not 2',
        ),
    ],
)
def test_another_arm_is_named(robot, words):
    assert ARM.differences(robot) == words
