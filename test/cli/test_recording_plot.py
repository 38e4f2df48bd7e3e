# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The command that draws recordings."""

import csv
import sys

import numpy as np
import pytest
from synthetic_recording import only_file, outputs, packet, record

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.driver.recordings.recording import Recording
from ur_cartesian_driver.motion.robot_state import RuntimeState


def busy(i):
    """A packet of a motion in which much happens."""
    return packet(
        i,
        1 + i // 100,
        target_speed_fraction=0.5,
        runtime_state=(RuntimeState.PAUSED if 50 <= i < 80 else RuntimeState.PLAYING),
    )


def switch(recorder, i):
    if i % 40 == 0:
        recorder.add_signals(outputs(i // 40 & 1))
    if i == 120:
        recorder.add_event('cancel', 'preempted by a newer motion')


@pytest.mark.slow
def test_a_motion_in_which_much_happened_and_one_that_was_cut_off_are_drawn(tmp_path, capsys):
    pytest.importorskip('matplotlib')
    record(tmp_path / 'whole', map(busy, range(200)), between=switch)
    assert main(['plot', str(tmp_path / 'whole')]) == 0
    (picture,) = (tmp_path / 'whole').glob('*.png')
    assert picture.read_bytes().startswith(b'\x89PNG')
    assert capsys.readouterr().out == f'picture: {picture}\n'
    record(tmp_path / 'cut', [packet(0)], outcome=None)
    assert main(['plot', str(only_file(tmp_path / 'cut')), '-o', str(tmp_path / 'a.svg')]) == 0
    assert (tmp_path / 'a.svg').read_text().startswith('<?xml')


def test_the_table_has_a_line_for_each_packet(tmp_path, capsys):
    record(tmp_path, map(packet, range(50)))
    file = only_file(tmp_path)
    assert main(['plot', str(file), '--csv', str(tmp_path / 'a.csv')]) == 0
    assert 'picture' not in capsys.readouterr().out
    with open(tmp_path / 'a.csv', encoding='utf-8') as table:
        rows = list(csv.DictReader(table))
    found = Recording.load(file)
    assert [float(row['actual_q_0']) for row in rows] == found.actual_q[:, 0].tolist()
    assert [float(row['target_pose_x']) for row in rows] == found.target_pose[:, 0].tolist()
    np.testing.assert_allclose([float(row['deviation_position']) for row in rows], 0.001)


def test_without_matplotlib_one_sentence_says_so(tmp_path, monkeypatch, capsys):
    record(tmp_path, [packet(0)])
    monkeypatch.setitem(sys.modules, 'matplotlib', None)
    assert main(['plot', str(tmp_path)]) == 1
    assert capsys.readouterr().err == (
        'ur-cartesian plot: no picture without matplotlib; install it (extra `plot`), or use '
        '--csv\n'
    )


def test_a_directory_without_recordings_is_named(tmp_path, capsys):
    assert main(['plot', str(tmp_path)]) == 1
    assert str(tmp_path) in capsys.readouterr().err
