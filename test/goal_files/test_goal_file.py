# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A goal file that YAML 1.1 would read otherwise than it is meant is refused."""

import pytest

from ur_cartesian_driver.goal_files import GoalFileError, read_goal_file


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        (
            'frame_id: a\nblend: 1\nframe_id: b',
            'line 3: frame_id occurs twice; remove one of them.',
        ),
        ('trajectory:\n  points:\n  - {a: 1, b: {a: 2}, "a": 3}', 'line 3: a occurs twice; '),
        ('- {a: 1}\n- {x: [b, b], ? {b: 1} : 2, b: 1, a: b, x: 2}', 'line 2: x occurs twice; '),
        *(
            (f'{{x: [1, {text}]}}', f'line 1: {text} is octal or sexagesimal in YAML; write it')
            for text in ('010', '-07', '0_7', '1:30', '+1:30:59.5')
        ),
    ],
)
def test_what_yaml_reads_otherwise_is_refused(text, sentence):
    with pytest.raises(GoalFileError) as refusal:
        read_goal_file(text)
    assert str(refusal.value).startswith(sentence)


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        (
            f'goal_tolerance: {{position_error: {{x: {10**400}}}}}',
            'goal_tolerance.position_error.x is 10000000000000000000..., which is too large for a '
            'number.',
        ),
        (
            f'io_commands: [{{pin: {10**400}}}]',
            f'io_commands[0].pin is 1{"0" * 59}, but must be a whole number from 0 to 255.',
        ),
    ],
)
def test_an_integer_that_is_too_large_is_refused(text, sentence):
    with pytest.raises(GoalFileError) as refusal:
        read_goal_file(text)
    assert str(refusal.value) == sentence


def test_what_is_certain_is_read():
    text = (
        'trajectory:\n  controlled_frame: "010"\n  points:\n'
        '  - {pose: &p {position: {x: 0.5, y: -0.25, z: 0}}}\n  - {pose: *p}\n'
    )
    goal = read_goal_file(text)
    assert goal.trajectory.controlled_frame == '010'
    assert [point.pose.position.x for point in goal.trajectory.points] == [0.5, 0.5]


def test_a_goal_file_in_another_encoding_is_refused(tmp_path):
    file = tmp_path / 'goal.yaml'
    file.write_bytes('frame_id: Düse'.encode('latin-1'))
    with pytest.raises(GoalFileError, match=r'goal.yaml: this is not UTF-8; save it as UTF-8\.$'):
        read_goal_file(file)
