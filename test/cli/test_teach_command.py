# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Taken points are not lost where their file cannot be written; the arm is in the acceptance."""

import pytest

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.cli.teach_command import save
from ur_cartesian_driver.path import DOWN, Path


def test_a_file_that_cannot_be_written_is_refused_before_the_robot_is_connected(tmp_path, capsys):
    file = tmp_path / 'missing' / 'path.yaml'
    with pytest.raises(SystemExit, match='2'):
        main(['teach', '-o', str(file), '--wait', '0'])
    assert capsys.readouterr().err.endswith(
        f'ur-cartesian teach: error: argument -o/--output: {file} cannot be written: there is no '
        f'folder {file.parent}\n'
    )


def test_a_file_that_is_checked_stays_as_it_is(tmp_path, capsys):
    old, new = tmp_path / 'old.yaml', tmp_path / 'new.yaml'
    old.write_text('points of yesterday')
    for file in (old, new):
        assert main(['teach', '-o', str(file), '--wait', '0', '--rtde-port', '1']) == 1
    assert old.read_text() == 'points of yesterday'
    assert not new.exists()


def test_the_last_lesson_is_not_replaced_without_being_named(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'path.yaml').write_text('points of yesterday')
    assert main(['teach', '--wait', '0', '--rtde-port', '1']) == 1
    assert 'path.yaml exists already; name the file by -o' in capsys.readouterr().err
    assert (tmp_path / 'path.yaml').read_text() == 'points of yesterday'


def test_points_whose_file_cannot_be_written_are_printed(capsys):
    path = Path((-0.5, 0.1, 0.4), DOWN).by(dy=0.1).by(dx=0.1)
    with pytest.raises(OSError, match='/dev/full cannot be written: No space left on device; the'):
        save(path, '/dev/full')
    assert Path.from_yaml(capsys.readouterr().out).poses == path.poses
