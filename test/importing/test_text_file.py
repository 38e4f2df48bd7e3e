# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Encodings of files, and the characters that end a line in none of the formats."""

import pytest

from ur_cartesian_driver.importing import BrokenFile, import_file
from ur_cartesian_driver.importing.text_file import file_lines, file_text

#: What str.splitlines() takes for the end of a line, beside CR and LF.
NO_LINE_ENDS = ['\x0b', '\x0c', '\x1c', '\x1d', '\x1e', '\x85', '\u2028', '\u2029']
#: For each format: a file with a character in it, and a fault in its last line but one.
FILES = {
    'a.csv': ('# comment{}end\nx [m],y [m],z [m]\n0,0,0\n0,0,far\n1,1,1\n', 4),
    'a.nc': ('(comment{}end)\nG21 G90\nG1 X1 Y1 Z1 F100\nG1 XX\nM2\n', 4),
    'a.script': ('# comment{}end\nmovej([0, -1.5, 1.5, 0, 0, 0])\n\na = = 2\n', 4),
    'a.yaml': ('frame: "a{}b"\nposes:\n- position:\n    x: far\n    y: 0.0\n', 4),
}


@pytest.mark.parametrize('character', NO_LINE_ENDS, ids=ascii)
def test_only_cr_and_lf_end_lines(character):
    assert file_lines(f'a{character}b\nc\rd\r\ne') == [f'a{character}b', 'c', 'd', 'e']
    assert file_lines(f'{character}\n') == [character]


@pytest.mark.parametrize('character', ['\x0c', '\x85', '\u2028', '\u2029'], ids=ascii)
@pytest.mark.parametrize('name', FILES)
def test_a_fault_is_named_by_its_line_whatever_comes_before(tmp_path, name, character):
    if name == 'a.yaml' and character == '\x0c':
        character = '\u2028'  # no character of a message
    text, line = FILES[name]
    (tmp_path / name).write_text(text.format(character), encoding='utf-8')
    with pytest.raises(BrokenFile, match=f'^line {line}: '):
        import_file(tmp_path / name)


@pytest.mark.parametrize(
    'encoding', ['utf-8', 'utf-8-sig', 'utf-16', 'utf-32', 'cp1252', 'utf-16-le', 'utf-16-be']
)
def test_a_file_is_read_by_its_mark(tmp_path, encoding):
    text = 'x [\u00b5m] \u00e9\n'
    mark = '\ufeff' if encoding in ('utf-16-le', 'utf-16-be') else ''
    (tmp_path / 'a.csv').write_bytes((mark + text).encode(encoding))
    assert file_text(tmp_path / 'a.csv') == text


@pytest.mark.parametrize(
    ('data', 'sentence'),
    [
        (b'\xff\xfex\x00\x00', 'the file begins as utf-16, and is not'),
        (b'\xff\xfe\x00\xd8', 'the file begins as utf-16, and is not'),
        (b'\xff\xfe\x00\x00x', 'the file begins as utf-32, and is not'),
        (b'\xef\xbb\xbf\xff', 'the file begins as utf-8-sig, and is not'),
        (b'x\x00y\x00', 'this is a binary file, and no text'),
    ],
)
def test_a_file_that_is_no_text_is_refused(tmp_path, data, sentence):
    (tmp_path / 'a.csv').write_bytes(data)
    with pytest.raises(BrokenFile, match=f'^{sentence}'):
        import_file(tmp_path / 'a.csv')


@pytest.mark.parametrize('end', ['\x1a', '\x1a\x1a\x1a'])
def test_a_mark_at_the_end_of_a_text_is_no_part_of_it(tmp_path, end):
    (tmp_path / 'a.nc').write_bytes(b'G21 G90\r\nG1 X1 Y1 Z1 F100\r\n' + end.encode())
    assert len(import_file(tmp_path / 'a.nc').goal.waypoints) == 1
    (tmp_path / 'b.nc').write_bytes(f'G21 G90\n{end}\nG1 X1 Y1 Z1 F100\n'.encode())
    with pytest.raises(BrokenFile, match=r'^line 2: '):
        import_file(tmp_path / 'b.nc')


@pytest.mark.parametrize('end', ['\n', '\r\n', '\r'])
@pytest.mark.parametrize('name', ['a.csv', 'a.yaml'])
def test_lines_count_the_same_with_all_ends(tmp_path, name, end):
    text, line = FILES[name]
    (tmp_path / name).write_bytes(text.format(' ').replace('\n', end).encode())
    with pytest.raises(BrokenFile, match=f'^line {line}: '):
        import_file(tmp_path / name)


def test_where_no_point_is_left_the_refusal_has_all_remarks(tmp_path):
    (tmp_path / 'a.csv').write_text('Scan 1\nx [m],y [m],z [m],intensity,radius\n# none\n')
    with pytest.raises(BrokenFile) as caught:
        import_file(tmp_path / 'a.csv')
    assert str(caught.value) == (
        'there is no point of a path in the file; left out: line 1: text before the header: it is '
        "no part of the table; line 2: column 'radius': name it blend if the arm is to pass the "
        "point; line 2: column 'intensity': a path has no such quantity."
    )
    (tmp_path / 'a.yaml').write_text(
        'header:\n  stamp: {sec: 1, nanosec: 0}\n  frame_id: map\nposes: []\n---\nposes: []\n'
    )
    with pytest.raises(BrokenFile) as caught:
        import_file(tmp_path / 'a.yaml')
    assert str(caught.value) == (
        'there is no point of a path in the file; left out: line 6: another message: only the '
        'first one of a file is read; line 2: stamp: a goal begins when it is sent.'
    )
