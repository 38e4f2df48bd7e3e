# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Each name of the table of columns has the effect that the table says."""

import re

import numpy as np
import pytest

from ur_cartesian_driver.importing import (
    BrokenFile,
    import_file,
    ImportOptions,
    ToolOrientation,
    Treatment,
)
from ur_cartesian_driver.importing.tables.column_names import TERMS

#: What a table with the columns of a topic leads to: cells of a row, and the pose of its point.
HALF = 0.5**0.5
POINT = ('0.1', '0.2', '0.3')
DOWN = (HALF, HALF, 0.0, 0.0)
CELLS = {
    'position': (POINT, (0.1, 0.2, 0.3, *DOWN)),
    'pose of a robot, in m and rad': (
        (*POINT, '0', '1.5707963267948966', '0'),
        (0.1, 0.2, 0.3, 0.0, HALF, 0.0, HALF),
    ),
    'pose of `rostopic echo -p`, in m': (
        (*POINT, '0', '0.6', '0', '0.8'),
        (0.1, 0.2, 0.3, 0.0, 0.6, 0.0, 0.8),
    ),
    'pose of our [exports](recordings.md#for-other-programs)': (
        (*POINT, '0', '0.6', '0', '0.8'),
        (0.1, 0.2, 0.3, 0.0, 0.6, 0.0, 0.8),
    ),
    'orientation: quaternion': (('0', '0.6', '0', '0.8'), (0, 0, 0, 0.0, 0.6, 0.0, 0.8)),
    'orientation: rotation vector': (
        ('0', '1.5707963267948966', '0'),
        (0, 0, 0, 0.0, HALF, 0.0, HALF),
    ),
    'orientation: turns about the fixed axes x, then y, then z': (
        ('90', '90', '0'),
        (0, 0, 0, 0.5, 0.5, -0.5, 0.5),
    ),
    'normal of the surface': (('0', '0', '-2'), (0, 0, 0, 0.0, HALF, 0.0, HALF)),
}
UNITS = {
    'position': ' [m]',
    'orientation: turns about the fixed axes x, then y, then z': ' [deg]',
    'speed': ' [mm/s]',
    'radius of the blend': ' [mm]',
}


def imported(tmp_path, header, rows, **options):
    file = tmp_path / 'a.csv'
    file.write_text('\n'.join([';'.join(header), *(';'.join(row) for row in rows)]) + '\n')
    return import_file(file, ImportOptions(**options))


def named(term):
    """Return the titles of a term; q{xyz} is short for three."""
    names = []
    for name in term.name.split(', '):
        axes = re.findall(r'{(\w+)}', name)
        names += [re.sub(r'{\w+}', axis, name) for axis in axes[0]] if axes else [name]
    return [name + UNITS.get(term.topic, '') for name in names]


def remarks(found):
    return [remark.text() for remark in found.remarks]


@pytest.mark.parametrize(
    'term', [term for term in TERMS.values() if term.topic in CELLS], ids=lambda term: term.name
)
def test_columns_of_poses_are_honoured(tmp_path, term):
    assert term.treatment is Treatment.HONOURED
    titles = named(term)
    cells, pose = CELLS[term.topic]
    if 'position' not in term.topic and 'pose' not in term.topic:
        titles, cells = ['x [m]', 'y [m]', 'z [m]', *titles], ('0', '0', '0', *cells)
    found = imported(tmp_path, titles, [cells])
    expected = np.array(pose)
    if term.topic == 'normal of the surface':
        # Against the normal: the tool's z up, its x along y of the frame.
        expected[3:] = (0.0, 0.0, HALF, HALF)
    actual = np.array(found.goal.waypoints.poses[0])
    assert actual[:3] == pytest.approx(expected[:3])
    assert abs(actual[3:] @ expected[3:]) == pytest.approx(1.0)


@pytest.mark.parametrize(
    'term',
    [t for t in TERMS.values() if t.topic not in CELLS and t.treatment is Treatment.HONOURED],
    ids=lambda term: term.name,
)
def test_other_columns_that_are_honoured(tmp_path, term):
    effects = {
        'time': (['7'], ['9'], lambda goal: goal.waypoints.times.tolist() == [0.0, 2.0]),
        'time in two columns': (
            ['1700000007', '0'],
            ['1700000009', '500000000'],
            lambda goal: goal.waypoints.times.tolist() == [0.0, 2.5],
        ),
        'speed': (['5'], ['6'], lambda goal: goal.segments.velocities.tolist() == [0.005, 0.006]),
        'radius of the blend': (
            ['5'],
            ['0'],
            lambda goal: goal.segments.blend_radii.tolist() == [0.005, 0.0],
        ),
    }
    first, second, holds = effects[term.topic]
    header = ['x [m]', 'y [m]', 'z [m]', *named(term)]
    found = imported(tmp_path, header, [['0', '0', '0', *first], ['0.1', '0', '0', *second]])
    assert holds(found.goal)


@pytest.mark.parametrize(
    'term',
    [term for term in TERMS.values() if term.treatment is Treatment.LEFT_OUT],
    ids=lambda term: term.name,
)
def test_columns_that_are_left_out_are_said(tmp_path, term):
    titles = named(term)
    header = ['x [m]', 'y [m]', 'z [m]', *(name.split(' [')[0] for name in titles)]
    found = imported(tmp_path, header, [['0', '0', '0', *(['1'] * len(titles))]])
    said = next(text for text in remarks(found) if text.startswith('line 1: column'))
    assert term.reason in said
    numbered = f'{titles[0]!r} to {titles[-1]!r}'
    assert all(repr(name) in said for name in header[3:]) or numbered in said


@pytest.mark.parametrize(
    'term',
    [term for term in TERMS.values() if term.treatment is Treatment.REFUSED],
    ids=lambda term: term.name,
)
def test_orientations_that_cannot_be_read_for_sure_are_refused(tmp_path, term):
    titles = named(term)
    header, row = ['x [m]', 'y [m]', 'z [m]', *titles], ['0', '0', '0', *(['1'] * len(titles))]
    with pytest.raises(BrokenFile, match=f'^line 1: columns .*{term.reason}'):
        imported(tmp_path, header, [row])
    found = imported(tmp_path, header, [row], orientation=ToolOrientation.DOWN)
    assert any('the tool is to point down' in text for text in remarks(found))
    oriented = imported(tmp_path, [*header, 'Rx', 'Ry', 'Rz'], [[*row, '0', '0', '0']])
    assert any("the orientation comes from 'Rx', 'Ry', 'Rz'" in text for text in remarks(oriented))


@pytest.mark.parametrize(
    'title',
    ['x [mm]', 'X (MM)', 'x_mm', 'x/mm', 'x in mm', 'x, mm', 'x{millimeter}', '  X  [ mm ] '],
)
def test_a_unit_is_found_in_a_title(tmp_path, title):
    found = imported(tmp_path, [title, 'Pos Y [mm]'.replace('Pos ', ''), 'z [mm]'], ['123'])
    assert np.array(found.goal.waypoints.poses)[0, :3] == pytest.approx([0.001, 0.002, 0.003])


@pytest.mark.parametrize(
    ('unit', 'factor'),
    [
        ('um', 1e-6),
        ('\u00b5m', 1e-6),
        ('\u03bcm', 1e-6),
        ('micron', 1e-6),
        ('cm', 1e-2),
        ('Meters', 1.0),
        ('in', 0.0254),
        ('"', 0.0254),
        ('ft', 0.3048),
    ],
)
def test_units_of_lengths(tmp_path, unit, factor):
    found = imported(tmp_path, [f'{axis} [{unit}]' for axis in 'xyz'], ['123'])
    expected = [factor, 2 * factor, 3 * factor]
    assert np.array(found.goal.waypoints.poses)[0, :3] == pytest.approx(expected)


@pytest.mark.parametrize(
    ('title', 'factor'),
    [
        ('speed [m/s]', 1.0),
        ('v (m/min)', 1 / 60),
        ('Feed [mm/min]', 1e-3 / 60),
        ('velocity_mm_s', 1e-3),
        ('Feed rate [mm/sec]', 1e-3),
        ('speed mm_per_s', 1e-3),
        ('speed [in/min]', 0.0254 / 60),
    ],
)
def test_units_of_speeds(tmp_path, title, factor):
    found = imported(tmp_path, ['x [m]', 'y [m]', 'z [m]', title], ['1234'])
    assert found.goal.segments.velocities.tolist() == pytest.approx([4 * factor])


@pytest.mark.parametrize('unit', ['deg', '\u00b0', 'Degrees'])
def test_units_of_angles(tmp_path, unit):
    angles = [f'{name} [{unit}]' for name in ('Yaw', 'Roll', 'Pitch')]
    found = imported(
        tmp_path, ['x [m]', 'y [m]', 'z [m]', *angles], [['0', '0', '0', '90', '0', '0']]
    )
    quaternion = np.array(found.goal.waypoints.poses)[0, 3:]
    assert quaternion == pytest.approx([0.0, 0.0, HALF, HALF])


@pytest.mark.parametrize(
    ('extra', 'sentence'),
    [
        (['qx', 'qy'], "columns 'qx', 'qy': the column 'qz' is missing; name them"),
        (['Quat 1', 'Quat 2'], "columns 'Quat 1', 'Quat 2': the name is not known; name them"),
        (['HeadingDeg'], "column 'HeadingDeg': the name is not known; name them"),
        *(
            (titles, 'columns .*: the name is not known')
            for titles in (
                ['orn_x', 'orn_y', 'orn_z', 'orn_w'],
                ['tool_ori_x', 'tool_ori_y', 'tool_ori_z', 'tool_ori_w'],
                ['angle_axis_x', 'angle_axis_y', 'angle_axis_z'],
                ['tool_rx', 'tool_ry', 'tool_rz'],
                ['tcp_pose_3', 'tcp_pose_4', 'tcp_pose_5'],
                ['theta [deg]', 'tilt [deg]'],
                ['lead_deg', 'tilt_deg'],
            )
        ),
        (['nx', 'ny'], "columns 'nx', 'ny': the column 'nz' is missing"),
        (['yaw'], "column 'yaw': the column 'roll' is missing"),
        (
            ['rx [deg]', 'ry [deg]', 'rz [deg]'],
            "'rx \\[deg\\]' can be a part of a rotation vector",
        ),
        (['roll', 'pitch', 'yaw'], "the column 'roll' has no unit; write roll \\[deg\\]"),
        (['speed'], "the column 'speed' has no unit; write speed \\[mm/s\\]"),
        (['speed [kn]'], "the unit 'kn' of 'speed \\[kn\\]' is none of"),
        (['X [mm]'], "columns 'x \\[m\\]', 'X \\[mm\\]' have the same name; rename one"),
    ],
)
def test_a_column_that_cannot_be_meant_is_refused(tmp_path, extra, sentence):
    with pytest.raises(BrokenFile, match=f'^line 1: .*{sentence}'):
        imported(tmp_path, ['x [m]', 'y [m]', 'z [m]', *extra], ['1' * (3 + len(extra))])


@pytest.mark.parametrize('forces', [['Fx', 'Fy', 'Fz'], ['fx [N]', 'fy [N]', 'fz (N)']])
def test_torques_are_no_positions(tmp_path, forces):
    names = ['time', *forces, 'Tx', 'Ty', 'Tz']
    with pytest.raises(BrokenFile, match="columns 'Tx', 'Ty', 'Tz' can be torques"):
        imported(tmp_path, names, [['1'] * 7], unit='mm')
    found = imported(tmp_path, [*names, 'x', 'y', 'z'], [['1'] * 7 + ['2'] * 3], unit='m')
    assert found.goal.waypoints.poses[0][:3] == pytest.approx([2.0, 2.0, 2.0])


@pytest.mark.parametrize(
    ('extra', 'said'),
    [
        (['qx', 'qy', 'qz', 'qw', 'rx', 'ry', 'rz'], "columns 'rx', 'ry', 'rz': the orientation"),
        (['time', 'header.stamp'], "column 'time': the time comes from 'header.stamp'"),
        (['tx', 'ty', 'tz'], "columns 'tx', 'ty', 'tz': the position comes from"),
        (['qx', 'qy', 'qz', 'qw', 'yaw'], "column 'yaw': the orientation comes from 'qx', 'qy'"),
        (['rx', 'ry', 'rz'], "columns 'rx', 'ry', 'rz': no unit: read as a rotation vector [rad]"),
        (['q0', 'q1', 'q3', 'q4', 'q5'], "columns 'q0', 'q1', 'q3' to 'q5': a path has no such"),
        (['joint_1 [deg]', 'J2 [deg]'], "columns 'joint_1 [deg]', 'J2 [deg]': a path has no such"),
        (['Zeit'], "column 'Zeit': a path has no such quantity, or its name is not known"),
        (['', 'note'], 'column 4 without a name: a path has no such quantity'),
    ],
)
def test_a_second_column_for_the_same_is_said(tmp_path, extra, said):
    cells = ['1' if name == 'qw' else '0' for name in extra]
    found = imported(tmp_path, ['x [m]', 'y [m]', 'z [m]', *extra], [['0', '0', '0', *cells]])
    assert any(f'line 1: {said}' in text for text in remarks(found))


def test_paths_of_names_count_by_their_ends(tmp_path):
    header = [
        *(f'/robot/tcp_pose/pose/position/{axis} [m]' for axis in 'xyz'),
        *(f'/robot/tcp_pose/pose/orientation/{axis}' for axis in 'xyzw'),
        '__time',
        '/robot/tcp_pose/header/stamp',
        '/robot/wrench/force/x',
    ]
    rows = [
        ['0.1', '0.2', '0.3', '0', '0.6', '0', '0.8', '5', '1700000000.25', '1'],
        ['0.2', '0.2', '0.3', '0', '0.6', '0', '0.8', '9', '1700000001.75', '1'],
    ]
    found = imported(tmp_path, header, rows)
    assert np.array(found.goal.waypoints.poses)[0] == pytest.approx(
        [0.1, 0.2, 0.3, 0, 0.6, 0, 0.8]
    )
    assert found.goal.waypoints.times.tolist() == [0.0, 1.5]
    assert any("'/robot/wrench/force/x'" in text for text in remarks(found))


def test_x_y_z_w_that_can_be_a_quaternion_are_refused(tmp_path):
    text = r"^line 1: columns 'x', 'y', 'z', 'w' can be a quaternion; name them qx, qy, qz, qw"
    for header in (['px', 'py', 'pz', *'xyzw'], [*'xyzw'], ['px', 'py', 'pz', *'xyzw', *'abc']):
        with pytest.raises(BrokenFile, match=text):
            imported(tmp_path, header, ['0' * len(header)], unit='m')
    two = ['px', 'py', 'pz', *'xyzw']
    with pytest.raises(BrokenFile, match=text):
        imported(tmp_path, two, ['0' * 7], unit='m', orientation=ToolOrientation.DOWN)
    found = imported(
        tmp_path, [*'xyzw', 'rx', 'ry', 'rz'], [['1', '2', '3', '9', '0', '0', '0']], unit='mm'
    )
    assert np.array(found.goal.waypoints.poses)[0, :3] == pytest.approx([0.001, 0.002, 0.003])


def test_position_and_orientation_of_two_bodies_are_not_joined(tmp_path):
    def header(position, orientation):
        names = [f'{position}/{axis} [m]' for axis in 'xyz']
        return [*names, *(f'{orientation}/{axis}' for axis in 'xyzw')]

    row = ['0.1', '0.2', '0.3', '0', '0.6', '0', '0.8']
    two = header('/ee/position', '/imu/orientation')
    with pytest.raises(
        BrokenFile,
        match=r"^line 1: columns '/ee/position/z \[m\]', '/imu/orientation/w' are of different",
    ):
        imported(tmp_path, two, [row])
    found = imported(tmp_path, two, [row], orientation=ToolOrientation.DOWN)
    assert any('the tool is to point down' in text for text in remarks(found))
    for one in (
        header('/ee/position', '/ee/orientation'),
        header('/ee/pose/position', '/ee/orientation'),
        header('/tf/translation', '/tf/rotation'),
        header('position', 'orientation'),
    ):
        found = imported(tmp_path, one, [row])
        assert np.array(found.goal.waypoints.poses)[0] == pytest.approx([float(n) for n in row])
