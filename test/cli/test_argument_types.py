# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Arguments that cannot be meant are refused before a command begins, each with one sentence."""

import os

import pytest

from ur_cartesian_driver.cli import parser
from ur_cartesian_driver.cli.argument_types import output_file

NO_FOLDER = 'nodir/file cannot be written: there is no folder nodir'


def refusal(words, capsys):
    """Return the last line of the errors with which the parser refuses a command line."""
    with pytest.raises(SystemExit):
        parser().parse_args(words)
    return capsys.readouterr().err.splitlines()[-1]


@pytest.mark.parametrize(
    ('words', 'option'),
    [
        (['sweep', 'square', '-o'], '-o/--output'),
        (['check-robot', '--robot-ip', 'localhost', '--report'], '--report'),
        (['demo', '--picture'], '--picture'),
        (['sweep', 'square', '--picture'], '--picture'),
        (['identify', 'REC', '-o'], '-o/--output'),
        (['export', 'REC', '-o'], '-o/--output'),
        (['plot', 'REC', '-o'], '-o/--output'),
        (['import', 'a.nc', '-o'], '-o/--output'),
        (['show', 'square', '-o'], '-o/--output'),
        (['teach', '-o'], '-o/--output'),
        (['calibration', '-o'], '-o/--output'),
        (['send', 'square', '--record'], '--record'),
        (['valve', 'v', '--output', 'standard_digital', '2', '--lead-file'], '--lead-file'),
    ],
)
def test_a_file_that_cannot_be_written_is_refused_before_the_work(
    words, option, capsys, monkeypatch, tmp_path
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'folder').mkdir()
    for name, sentence in (
        ('nodir/file', NO_FOLDER),
        ('folder', "'folder' is a folder; name a f"),
    ):
        assert f'error: argument {option}: {sentence}' in refusal([*words, name], capsys)


def test_a_file_is_checked_without_a_change(monkeypatch, tmp_path):
    old, new = tmp_path / 'old', tmp_path / 'new'
    old.write_text('points of yesterday')
    os.mkfifo(tmp_path / 'pipe')  # opening it would wait for a reader
    for name in (*map(str, (old, new, tmp_path / 'pipe')), '/dev/full', 'here'):
        assert output_file(name) == name
    assert old.read_text() == 'points of yesterday'
    assert not new.exists()


def test_a_folder_without_permission_is_named(capsys, monkeypatch):
    monkeypatch.setattr(os, 'access', lambda *_: False)  # root may write everywhere
    sentence = 'table.csv cannot be written: no permission to write .'
    assert refusal(['sweep', 'square', '-o', 'table.csv'], capsys).endswith(sentence)
    sentence = f'{"n" * 300} cannot be written: File name too long'
    assert refusal(['sweep', 'square', '-o', 'n' * 300], capsys).endswith(sentence)


@pytest.mark.parametrize('words', [['demo'], ['sweep', 'square']])
def test_a_picture_of_an_unknown_format_is_refused_before_the_work(words, capsys):
    pytest.importorskip('matplotlib')
    last = refusal([*words, '--picture', 'p.foo'], capsys)
    assert "p.foo has the suffix '.foo', but a picture is written as" in last
    assert 'png' in last
    assert parser().parse_args([*words, '--picture', 'p.PNG']).picture == 'p.PNG'


@pytest.mark.parametrize(
    ('words', 'sentence'),
    [
        (['import', 'a.nc', '--scale', '2e6'], '2e6 is above 1000000'),
        (['import', 'a.nc', '--scale', '0'], '0 is not above 0'),
        (['import', 'a.nc', '--scale', 'nan'], 'nan is not above 0'),
        (['import', 'a.nc', '--speed', 'abc'], "'abc' is no number"),
        (['sweep', 'square', '--monte-carlo', 'abc'], "'abc' is no whole number"),
        (['append', '--replace-from-point', '1.5'], "'1.5' is no whole number"),
        (
            ['sweep', 'square', '--rz', '0,90,3'],
            '90 is not within -50 and 50 rad; give radians, not degrees',
        ),
        (['sweep', 'square', '--x', '0,90,3'], '90 is not within -50 and 50 m'),
        (['sweep', 'square', '--x', '0,nan,3'], 'nan is not within -50 and 50 m'),
        (['sweep', 'square', '--x', '0,0.1,0'], "'0,0.1,0' has the count 0; give 1 or more"),
        (
            ['validate', 'square', '--joints', '0,-90,90,0,0,0'],
            '-90 is not within -25.1327 and 25.1327 rad; give radians, not degrees',
        ),
        (['validate', 'square', '--tcp', '0,0,10,0,0,0'], '10 is not within -5 and 5 m'),
    ],
)
def test_a_number_is_refused_with_its_bound_and_unit(words, sentence, capsys):
    assert refusal(words, capsys).endswith(f': {sentence}')


@pytest.mark.parametrize('name', ['bad name', '', '1st', 'a//b', 'a/1b', 'ärm'])
def test_a_name_that_no_node_can_have_is_refused(name, capsys):
    assert f'{name!r} is no name of a node' in refusal(['send', 'x', '--driver', name], capsys)


@pytest.mark.parametrize('name', ['ur_cartesian_driver', 'left/driver', '/cell/left/driver_2'])
def test_a_name_of_a_node_is_taken(name):
    assert parser().parse_args(['recover', '--driver', name]).driver == name
