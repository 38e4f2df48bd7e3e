# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Tables as scanners, spreadsheets and offline programming write them."""

from math import pi, sin
import re

from broken_files import broken, goal_or_sentence
from checkout import CHECKOUT, needs_checkout
import numpy as np
import pytest
from random_cases import cases, random_of
from random_tables import random_table

from ur_cartesian_driver.importing import BrokenFile, import_file, ImportOptions, ToolOrientation

#: As the export of a line scanner with normals: comments first, then units.
SCANNER = """# scanner export, 2026-03-04
# sensor 0001
x [mm],y [mm],z [mm],nx,ny,nz,intensity
100.0,20.0,5.0,0.0,0.0,1.0,812
110.0,20.0,5.5,0.0,0.5,0.8660254,790

120.0,20.0,6.0,0,0,2,801
"""

#: As a German spreadsheet saves it: semicolons, decimal commas, a mark for UTF-8.
SPREADSHEET = '\ufeffX (mm);Y (mm);Z (mm);Speed (mm/min)\r\n1,5;0;0;600\r\n2,5;0;0;1200\r\n'

#: As a log in SI units, with quaternions and times.
LOG = 'time,x_m,y_m,z_m,qx,qy,qz,qw\n0.5,0,0,0,0,0,0,1\n1.5,0.1,0,0,0,0,0.6,0.8\n'

TIMES_LEFT_OUT = 'the times of the points: left out, because the option speed replaces them'


def imported(tmp_path, text, **options):
    file = tmp_path / 'points.csv'
    file.write_bytes(text.encode())
    return import_file(file, ImportOptions(**options))


def poses(found):
    return np.array(found.goal.waypoints.poses)


def tool_axes(found):
    """Return where x and z of the tool point."""
    x, y, z, w = poses(found)[:, 3:].T
    ex = np.stack((1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)), axis=1)
    ez = np.stack((2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)), axis=1)
    return ex, ez


def test_a_scanner_with_normals(tmp_path):
    found = imported(tmp_path, SCANNER)
    assert found.lines.tolist() == [4, 5, 7]
    assert poses(found)[:, 0] == pytest.approx([0.1, 0.11, 0.12])
    _, ez = tool_axes(found)
    assert ez == pytest.approx(
        np.array([[0.0, 0.0, -1.0], [0.0, -0.5, -0.8660254], [0.0, 0.0, -1.0]]), abs=1e-7
    )
    assert [r.text() for r in found.remarks] == [
        "line 3: column 'intensity': a path has no such quantity",
        'the arm stops at 2 inner points: give a blend or a corner if it should not',
    ]


def test_normals_all_around_give_right_angles(tmp_path):
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(300, 3))
    text = 'x [m],y [m],z [m],nx,ny,nz\n' + '\n'.join(
        f'{i / 1000},0,0,{a},{b},{c}' for i, (a, b, c) in enumerate(normals.tolist())
    )
    ex, ez = tool_axes(imported(tmp_path, text, orientation=ToolOrientation.NORMALS))
    unit = normals / np.linalg.norm(normals, axis=1)[:, None]
    assert ez == pytest.approx(-unit, abs=1e-9)
    assert np.einsum('ij,ij->i', ex, ez) == pytest.approx(0.0, abs=1e-9)


def test_a_spreadsheet_with_decimal_commas(tmp_path):
    found = imported(tmp_path, SPREADSHEET)
    assert poses(found)[:, 0] == pytest.approx([0.0015, 0.0025])
    assert found.goal.segments.velocities.tolist() == pytest.approx([0.01, 0.02])


def test_a_log_with_times(tmp_path):
    found = imported(tmp_path, LOG)
    assert found.goal.waypoints.times.tolist() == [0.0, 1.0]
    assert poses(found)[1, 3:] == pytest.approx([0.0, 0.0, 0.6, 0.8])
    slower = imported(tmp_path, LOG, speed=0.05)
    assert slower.goal.segments.velocities.tolist() == [0.05, 0.05]
    assert not slower.goal.waypoints.times.any()
    assert slower.remarks[0].text() == TIMES_LEFT_OUT


def test_angles_about_three_axes(tmp_path):
    found = imported(
        tmp_path, 'x [m],y [m],z [m],roll [deg],pitch [deg],yaw [deg]\n0,0,0,0,0,90\n'
    )
    assert poses(found)[0, 3:] == pytest.approx([0.0, 0.0, sin(pi / 4), sin(pi / 4)])


def test_scale_unit_frame_and_origin(tmp_path):
    from ur_cartesian_driver.motion.geometry.pose import Pose

    found = imported(
        tmp_path,
        'x,y,z\n1,2,3\n',
        unit='in',
        scale=2.0,
        frame='part',
        origin=Pose.from_rotation_vector((1.0, 0.0, 0.0, 0.0, 0.0, pi / 2)),
    )
    assert poses(found)[0, :3] == pytest.approx([1.0 - 0.1016, 0.0508, 0.1524])
    assert found.goal.frame_id == 'part'


def test_points_on_one_place_are_said(tmp_path):
    rows = '0,0,0\n0,0,0\n0.000001,0,0\n0.1,0,0\n'
    found = imported(tmp_path, 'x [m],y [m],z [m]\n' + rows)
    assert found.lines.tolist() == [2, 5]
    assert 'lines 3-4: a point: it is where the one before is' in [
        remark.text() for remark in found.remarks
    ]


@pytest.mark.parametrize(
    ('text', 'line', 'part'),
    [
        ('', 0, 'empty'),
        ('x [mm],y [mm]\n', 1, "'z' is missing"),
        ('x,y,z\n1,2,3\n', 1, 'has no unit'),
        ('x [yd],y [mm],z [mm]\n', 1, "unit 'yd'"),
        ('x [m],y [m],z [m],qx,qy\n', 1, "'qz' is missing"),
        ('x [m],y [m],z [m],X [mm]\n', 1, 'have the same name; rename one'),
        ('x [m],y [m],z [m]\n0,0,0\n0,zero,0\n', 3, "'zero' is no number"),
        ('x [m],y [m],z [m]\n0,0,0\n\n0,0\n', 4, '2 columns'),
        ('x [m],y [m],z [m]\n0,0,nan\n', 2, "'nan' is no number"),
        ('x [m],y [m],z [m],qx,qy,qz,qw\n0,0,0,0,0,0,0\n', 2, 'length 0'),
        ('x [m],y [m],z [m],nx,ny,nz\n0,0,0,0,0,0\n', 2, 'normal is zero'),
        ('x [m],y [m],z [m]\n100,0,0\n', 2, 'check the unit'),
        ('x [m],y [m],z [m]\n', 0, 'no point'),
        ('\0\xff', 0, 'missing|binary'),
    ],
)
def test_a_broken_file_is_one_sentence_with_its_line(tmp_path, text, line, part):
    with pytest.raises(BrokenFile, match=part) as caught:
        imported(tmp_path, text)
    assert caught.value.line in (line, 1 if '\0' in text else line)
    assert '\n' not in str(caught.value)


def test_a_long_header_is_shown_with_dots(tmp_path):
    with pytest.raises(BrokenFile) as caught:
        imported(tmp_path, 'x [mm],' + 99 * '.9' + '\n')
    shown = f"'x [mm], {54 * '.9'}....'"
    assert str(caught.value) == f"line 1: the column 'y' is missing; the header is {shown}."


@needs_checkout
def test_the_table_of_the_page_is_read(tmp_path):
    page = (CHECKOUT / 'doc' / 'importing.md').read_text(encoding='utf-8')
    table = page.split('### Tables')[1].split('```\n')[1]
    found = imported(tmp_path, table)
    assert poses(found)[1] == pytest.approx([0.1105, 0.02, 0.0052, 0.0, 1.0, 0.0, 0.0])
    assert found.goal.waypoints.times.tolist() == [0.0, 0.25]


# ---- numpy as the judge -------------------------------------------------------------------------


def matrices(quaternions):
    """Return rotation matrices (n, 3, 3) of quaternions (n, 4), by the textbook's formula."""
    x, y, z, w = quaternions.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def turned(vector):
    """Return exp([v]x) by Rodrigues' formula."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / max(angle, 1e-12)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def expected_rotations(table, values):
    if table.orientation == 'quaternion':
        return matrices(values / np.linalg.norm(values, axis=1)[:, None])
    if table.orientation == 'rotation vector':
        return np.array([turned(row) for row in values])
    ex, ey, ez = np.eye(3)
    return np.array([turned(c * ez) @ turned(b * ey) @ turned(a * ex) for a, b, c in values])


@pytest.mark.random
def test_random_tables_are_read_as_numpy_reads_them(tmp_path):
    file = tmp_path / 'a.csv'
    turns = timed = 0
    for i in range(cases(3000)):
        table = random_table(random_of('tables', i))
        file.write_bytes(table.data())
        found = import_file(file)
        actual = poses(found)
        assert actual[:, :3] == pytest.approx(table.read(table.names['position']), abs=1e-12)
        if table.names['orientation']:
            values = table.read(table.names['orientation'])
            rotations = matrices(actual[:, 3:])
            if table.orientation == 'normal':
                against = -values / np.linalg.norm(values, axis=1)[:, None]
                assert rotations[:, :, 2] == pytest.approx(against, abs=1e-9)
            else:
                assert rotations == pytest.approx(expected_rotations(table, values), abs=1e-9)
            turns += len(actual)
        if table.names['time']:
            times = table.read(table.names['time'])[:, 0]
            expected = times - times[0]
            assert found.goal.waypoints.times == pytest.approx(expected, abs=1e-6)
            timed += 1
    assert turns > cases(3000) * 4
    assert timed > cases(3000) // 4


@pytest.mark.random
def test_broken_tables_become_goals_as_numpy_reads_them_or_sentences(tmp_path):
    file = tmp_path / 'a.csv'
    goals = sentences = judged = 0
    files = [SCANNER, SPREADSHEET.lstrip('\ufeff'), LOG]
    for i in range(cases(10_000)):
        random = random_of('broken tables', i)
        table = None
        if random.random() < 0.5:
            table = random_table(random)
        base = table.text if table else random.choice(files)
        text = broken([*[base] * 9, *files], random)
        found = goal_or_sentence(file, text)
        if isinstance(found, str):
            sentences += 1
            continue
        goals += 1
        judged += agrees_with_numpy(found, text, base, table)
    assert goals > cases(10_000) // 20
    assert sentences > cases(10_000) // 2
    assert judged > cases(10_000) // 40


def agrees_with_numpy(found, text, base, table):
    """Compare the points of a goal with numpy's reading of their lines, if the header is whole."""
    if table is None:
        head = {SCANNER: 3, LOG: 1}.get(base, 1)
        delimiter, columns, factor = {
            SCANNER: (',', (0, 1, 2), 1e-3),
            LOG: (',', (1, 2, 3), 1.0),
        }.get(base, (';', (0, 1, 2), 1e-3))
        comma = delimiter == ';'
    else:
        head, delimiter, comma = table.head, table.delimiter, table.has_decimal_commas
        columns, factors = zip(
            *(table.columns[name] for name in table.names['position']), strict=True
        )
        factor = factors[0]
    lines, whole = (re.split(r'\r\n|\r|\n', each) for each in (text, base))
    if lines[:head] != whole[:head]:
        return False
    for line, pose in zip(found.lines.tolist(), poses(found), strict=True):
        assert line > head
        row = np.loadtxt(
            [lines[line - 1]],
            delimiter=delimiter,
            usecols=columns,
            converters=lambda cell: float(cell.replace(',', '.') if comma else cell),
            quotechar='"',
            comments=None,
        )
        assert pose[:3] == pytest.approx(row * factor, abs=1e-9)
    return True
