# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``ur-cartesian identify``: files in, a table and a twin out, or a sentence."""

from random import Random

from hidden_arm import Laws, Program
import numpy as np
import pytest
from synthetic_recording import only_file, record

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.motion.twin.twin_file import read_twin


@pytest.fixture(scope='module')
def laws():
    return Laws.drawn(Random(7))


@pytest.fixture(scope='module')
def folder(laws, tmp_path_factory):
    """Return a folder with a recording of two joint moves, and the program behind it."""
    program = Program(laws=laws, random=Random(7), cycle=0.008)
    program.movej([0.9, 0.2, 0.0, 0.0, 0.0, 0.1])
    program.movej([0.1, 0.0, 0.0, 0.0, 0.0, 0.0], a=1.0, v=0.5)
    samples = program.record('moves')
    path = tmp_path_factory.mktemp('arm')
    titles = ['timestamp', *(f'target_q_{i}' for i in range(6)), 'runtime_state']
    rows = np.column_stack([samples.time, samples.target_q, samples.runtime_state])
    np.savetxt(path / 'moves.csv', rows, header=' '.join(titles), comments='', fmt='%.17g')
    (path / 'calls.script').write_text('def moves():\n  movej(a)\n  movej(b, a=1, v=0.5)\nend\n')
    return path


def test_the_laws_are_printed_and_written(folder, laws, capsys):
    twin = str(folder / 'twin.yaml')
    calls = str(folder / 'calls.script')
    words = ['--commands', calls, '-o', twin, '--model', 'ur3', '--date', '2026-11-27']
    assert main(['identify', str(folder / 'moves.csv'), *words]) == 0
    printed = capsys.readouterr().out
    assert printed.startswith('2 moves: 2 joint moves.\n')
    assert 'not identified: no recording has actual_q; record' in printed
    found = read_twin(twin)
    assert found.arm.model == 'ur3'
    assert found.files == ('moves.csv',)
    assert found.estimates['start_time'].value == pytest.approx(laws.start_time, abs=1e-4)
    low, high = found.estimates['timed_joint_speed'].interval
    assert low == pytest.approx(laws.timed_joint_speed, rel=1e-4)
    assert high == pytest.approx(laws.timed_joint_speed, rel=1e-4)
    assert 'with t' not in found.not_identified['turn_ratio']


def test_our_own_recordings_name_their_arm(laws, tmp_path, capsys):
    program = Program(laws=laws, random=Random(8), cycle=0.008)
    program.movej([0.9, 0.2, 0.0, 0.0, 0.0, 0.1], a=1.0, v=0.5)
    samples = program.record('moves')
    rows = zip(
        samples.time.tolist(), samples.target_q.tolist(), samples.actual_q.tolist(), strict=True
    )
    packets = [
        RobotState(
            timestamp=time,
            target_q=tuple(target),
            actual_q=tuple(actual),
            actual_tcp_pose=Pose(),
            target_tcp_pose=Pose(),
        )
        for time, target, actual in rows
    ]
    record(tmp_path / 'recordings', packets)
    recording, twin = str(only_file(tmp_path / 'recordings')), tmp_path / 'twin.yaml'
    assert main(['identify', recording, '-o', str(twin)]) == 0
    found = read_twin(twin)
    assert found.arm.model == 'ur5e'
    assert found.estimates['start_time'].value == pytest.approx(laws.start_time, abs=1e-3)
    capsys.readouterr()
    assert main(['identify', recording, '--model', 'ur10e']) == 1
    assert 'is of another arm: model ur5e, not ur10e' in capsys.readouterr().err


@pytest.mark.parametrize(
    ('calls', 'words', 'said'),
    [
        (
            'movej(a)',
            [],
            'motions in calls.script: 1, moves in the recordings: 2;',
        ),
        ('movej(a)\nmovel(b)', [], 'says movel for move 2, but the recording moves.csv shows a'),
        ('movej(a)\nmovej(b)', ['-o', 'twin.yaml'], 'the recordings do not name their arm'),
    ],
)
def test_what_does_not_fit_is_refused(folder, tmp_path, monkeypatch, capsys, calls, words, said):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'calls.script').write_text(calls)
    arguments = ['identify', str(folder / 'moves.csv'), '--commands', 'calls.script', *words]
    assert main(arguments) == 1
    assert said in capsys.readouterr().err
    assert not (tmp_path / 'twin.yaml').exists()


@pytest.mark.parametrize(
    ('words', 'said'),
    [
        (['--date', 'monday'], 'monday is no date; write it as YYYY-MM-DD'),
        (['--software', 'new'], 'new is no version; write it like 5.21'),
        (['--model', 'ur5ee'], "invalid choice: 'ur5ee'"),
    ],
)
def test_options_that_cannot_be_are_refused(folder, capsys, words, said):
    with pytest.raises(SystemExit):
        main(['identify', str(folder / 'moves.csv'), *words])
    assert said in capsys.readouterr().err
