# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Headers and dialects, as programs write them."""

import numpy as np
import pytest

from ur_cartesian_driver.importing import BrokenFile, import_file, ImportOptions

HEADER = 'x [mm],y [mm],z [mm]\n'
POINTS = [[0.001, 0.0025, -0.003], [0.004, 0.005, 0.006]]
#: The same two points in the dialects of programs; each with its remarks about the table.
DIALECTS = {
    'numpy.savetxt, header of names': '# x y z\n1.0e+00 2.5e+00 -3.0e+00\n4e+00 5e+00 6e+00\n',
    'numpy.savetxt, header with commas': '# x, y, z\n1.0 2.5 -3.0\n4.0 5.0 6.0\n',
    'numpy.savetxt, commas in the rows': '# x y z\n1.0,2.5,-3.0\n4.0,5.0,6.0\n',
    'comments before the header': '# made by hand\n#\nx,y,z\n1,2.5,-3\n4,5,6\n',
    'Excel, German': 'sep=;\r\nX [mm];Y [mm];Z [mm]\r\n1;2,5;-3\r\n4;5;6\r\n',
    'Excel, UTF-16 and tabs': 'x\ty\tz\r\n1\t2,5\t-3\r\n4\t5\t6\r\n'.encode('utf-16'),
    'LabVIEW, tabs to the end': 'x\ty\tz\t\r\n1\t2.5\t-3\t\r\n4\t5\t6\t\r\n',
    'MATLAB, comment by %': '% x y z\n   1.0000   2.5000  -3.0000\n   4.0000   5.0000   6.0000\n',
    'CloudCompare': '//X Y Z\n1.0 2.5 -3.0\n4.0 5.0 6.0\n',
    'aligned by blanks': '      x       y     z\n    1.0     2.5  -3.0\n    4.0     5.0   6.0\n',
    'names with blanks inside': 'Pos X   Pos Y   Pos Z\n1.0     2.5     -3.0\n4.0  5.0   6.0\n',
    'units behind blanks': 'x [mm] y [mm] z [mm]\n1.0 2.5 -3.0 \n4.0 5.0 6.0 \n',
    'names in quotes': '"x" "y" "z"\n1.0 2.5 -3.0\n4.0 5.0 6.0\n',
    'units in a second line': 'x;y;z\nmm;mm;mm\n1;2,5;-3\n4;5;6\n',
    'units in brackets in a second line': 'x,y,z\n[mm],[mm],[mm]\n1,2.5,-3\n4,5,6\n',
    'Unix recorder with a delimiter at the end': 'x,y,z,\n1,2.5,-3,\n4,5,6,\n',
    'delimiter only at the end of rows': 'x,y,z\n1,2.5,-3,\n4,5,6,\n',
    'quotes around numbers': '"x","y","z"\n"1","2.5","-3"\n"4","5","6"\n',
    'quotes around decimal commas': '"x","y","z"\n"1","2,5","-3"\n"4","5","6"\n',
    'blanks behind commas': 'x, y, z\n1, 2.5, -3\n4, "5", 6\n',
    'a mark of UTF-8': '\ufeffx,y,z\n1,2.5,-3\n4,5,6\n',
    'blank lines and comments in between': 'x,y,z\n\n1,2.5,-3\n# turn\n\n4,5,6\n\n',
    'old ends of lines': 'x,y,z\r1,2.5,-3\r4,5,6',
    'CR LF twice': 'x,y,z\r\n\r\n1,2.5,-3\r\n\r\n4,5,6\r\n\r\n',
    'Excel, rows of empty cells at the end': 'x;y;z\n1;2,5;-3\n4;5;6\n;;\n;;\n',
    'quotes and semicolons below a comment': '# x y z\n"1";"2,5";"-3"\n"4";"5";"6"\n',
    'a line of a character that is blank': 'x,y,z\n\u2028\n1,2.5,-3\n\x0c\n4,5,6\n\x85',
    'signs and exponents': 'x,y,z\n+1.,.25e1,-3E0\n4e0,0.5E+1,6\n',
}


def imported(tmp_path, text, **options):
    file = tmp_path / 'a.csv'
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return import_file(file, ImportOptions(**options))


@pytest.mark.parametrize('dialect', DIALECTS)
def test_a_dialect_is_read(tmp_path, dialect):
    found = imported(tmp_path, DIALECTS[dialect], unit='mm')
    assert np.array(found.goal.waypoints.poses)[:, :3] == pytest.approx(np.array(POINTS))
    assert not any('column' in remark.what or 'header' in remark.what for remark in found.remarks)


def test_text_before_the_header_is_said(tmp_path):
    text = 'Format Version,1.23\nTake,"a, b"\n\nFrame,Time (Seconds),X (mm),Y (mm),Z (mm)\n'
    found = imported(tmp_path, text + '0,0.5,1,2,3\n1,1.0,2,2,3\n')
    assert found.lines.tolist() == [5, 6]
    assert found.goal.waypoints.times.tolist() == [0.0, 0.5]
    assert found.remarks[0].text() == (
        'lines 1-2: text before the header: it is no part of the table'
    )


def test_a_number_alone_is_no_row(tmp_path):
    # As Vicon Nexus writes the trajectories of markers: their rate comes before the header.
    text = 'Trajectories\n100\n,,Arm:M1,,\nFrame,Sub Frame,X,Y,Z\n,,mm,mm,mm\n'
    found = imported(tmp_path, text + '1,0,1,2.5,-3\n2,0,4,5,6\n')
    assert np.array(found.goal.waypoints.poses)[:, :3] == pytest.approx(np.array(POINTS))
    assert found.remarks[0].text() == (
        'lines 1-3: text before the header: it is no part of the table'
    )


def test_three_columns_without_a_header_need_a_unit(tmp_path):
    found = imported(tmp_path, '1 2.5 -3\n4 5 6\n', unit='mm')
    assert np.array(found.goal.waypoints.poses)[:, :3] == pytest.approx(np.array(POINTS))
    assert found.lines.tolist() == [1, 2]
    assert found.remarks[0].text() == 'no header: the columns are x, y and z [mm]'


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        ('1,2,3\n', "line 1: no line before it names the columns; write one, such as 'x [mm],y"),
        ('2\n1 2 3\n4 5 6\n', 'line 1: no line before it names the columns'),
        ('\n1 2 3 4 5 6\n', "line 2: no line before it .*'x [mm],y [mm],z [mm],rx [rad],ry"),
        ('# scan\n1;2;3;0;0;0;1;\n', "line 2: no line .*'x [mm],y [mm],z [mm],qx,qy,qz,qw'"),
        ('1700000000,5,map,1,2,3,0,0,0,1\n', 'line 1: no line before it names the columns'),
        ('a;b\n1;2\n', "line 1: the column 'x' is missing; the header is 'a, b'"),
        ('x y\n1 2\n', "line 1: the column 'z' is missing; the header is 'x, y'"),
        ('# nothing\n', 'the file is empty; its first line has to name the columns'),
        ('sep=;\n', 'the file is empty; its first line has to name the columns'),
        (HEADER + '1,2\n', 'line 2: it has 2 columns, but the header has 3'),
        (HEADER + '1\n', 'line 2: it has 1 column, but the header has 3'),
        (HEADER + '1,2,3\n1,2,3,4\n', 'line 3: it has 4 columns, but the header has 3'),
        (HEADER + '1,2,3\n\n1,2,3,,\n', 'line 4: it has 5 columns, but the header has 3'),
        (
            HEADER + '1,5,2,5,3,5\n',
            'line 2: it has 6 .*; numbers with decimal commas need semicolons',
        ),
        (HEADER + '"1,2,3\n', 'line 2: its quotation marks do not enclose whole cells'),
        (HEADER + '"1"1,2,3\n', 'line 2: its quotation marks do not enclose whole cells'),
        (
            'ply\nformat ascii 1.0\n1 2 3\n',
            "line 1: the column 'x' is missing; the header is 'ply'",
        ),
    ],
)
def test_a_table_without_a_shape_is_refused(tmp_path, text, sentence):
    pattern = sentence.replace('[', r'\[').replace(']', r'\]')
    with pytest.raises(BrokenFile, match=f'^{pattern}') as caught:
        imported(tmp_path, text)
    assert '\n' not in str(caught.value)


def test_a_header_counts_more_than_a_comment_before_a_title(tmp_path):
    found = imported(tmp_path, '# x y z\nMy path\nx [mm];y [mm];z [mm]\n1;2.5;-3\n4;5;6\n')
    assert np.array(found.goal.waypoints.poses)[:, :3] == pytest.approx(np.array(POINTS))
    assert found.remarks[0].text() == 'line 2: text before the header: it is no part of the table'
