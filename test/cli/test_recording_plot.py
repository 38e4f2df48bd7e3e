# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The command that draws recordings."""

import sys

import pytest
from synthetic_recording import only_file, outputs, packet, record

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.driver.recordings.recording_folder import newest_recording
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState


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


def test_without_matplotlib_one_sentence_says_so(tmp_path, monkeypatch, capsys):
    record(tmp_path, [packet(0)])
    monkeypatch.setitem(sys.modules, 'matplotlib', None)
    assert main(['plot', str(tmp_path)]) == 1
    assert capsys.readouterr().err == (
        'ur-cartesian plot: no picture without matplotlib; install it (extra `plot`)\n'
    )


def test_the_newest_recording_of_a_directory_has_the_name_of_one(tmp_path):
    """A recording that was renamed to keep it is none of the newest."""
    older = tmp_path / '20260102-030405-006_spline_12_points.npz'
    newer = tmp_path / '20260302-030405-006_primitives_2_points_2.npz'
    for file in (older, newer, tmp_path / 'seam_12_points.npz', tmp_path / 'z_points.part'):
        file.touch()
    assert newest_recording(tmp_path) == newer
    assert newest_recording(older) == older
    running = tmp_path / '20260402-030405-006_spline_3_points.part'
    running.mkdir()
    assert newest_recording(running) == running
    newer.unlink()
    assert newest_recording(tmp_path) == older
    older.unlink()
    assert newest_recording(tmp_path) == running
    running.rmdir()
    with pytest.raises(OSError, match='there is no recording in'):
        newest_recording(tmp_path)


def test_a_directory_without_recordings_is_named(tmp_path, capsys):
    assert main(['plot', str(tmp_path)]) == 1
    assert str(tmp_path) in capsys.readouterr().err
