# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Files of each format become goals that can be planned; two are carried out by the simulator."""

from dataclasses import replace
from math import pi
from pathlib import Path

from curve_distance import distances
import numpy as np
import pytest
from robot_in_memory import RobotInMemory
from synthetic_recording import only_file, packet, record

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.goal_files import goal_from_fields, read_goal_file
from ur_cartesian_driver.importing import (
    BrokenFile,
    import_file,
    ImportOptions,
    ToolOrientation,
)
from ur_cartesian_driver.importing.imported_goal import goal_of_path
from ur_cartesian_driver.importing.imported_path import PathCollector
from ur_cartesian_driver.importing.tables.csv_file import collect_csv
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.goal.goal import InputKind, InputWait, Posture, SegmentType
from ur_cartesian_driver.planning import plan, PlanningOptions

HOME = (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
ARM = Arm(robot_model('ur5e'))
#: What other programs have written.
FOREIGN = Path(__file__).parent / 'files'
#: Where the part lies, in front of the arm.
PART = Pose((-0.45, -0.1, 0.3))

FILES = {
    'a.csv': 'x [mm],y [mm],z [mm]\n0,0,0\n100,0,0\n100,100,20\n',
    'a.nc': 'G21 G90\nG0 X0 Y0 Z20\nG1 Z0 F1200\nG1 X60\nG3 X100 Y40 I0 J40\nG1 Y100\n',
    'a.dxf': '0 SECTION 2 ENTITIES 0 LINE 8 0 10 0 20 0 11 80 21 0 '
    '0 CIRCLE 8 0 10 50 20 50 40 30 0 ENDSEC 0 EOF'.replace(' ', '\n'),
    'a.yaml': 'poses:\n'
    + ''.join(
        f'- position: {{x: {x}, y: 0.0, z: 0.0}}\n'
        '  orientation: {x: 0.0, y: 0.0, z: 0.0, w: 1.0}\n'
        for x in (0.0, 0.05)
    ),
    'a.script': 'movej([0.1, -1.5, 1.5, -1.5, -1.5, 0])\n'
    'movel(pose_trans(get_actual_tcp_pose(), p[0, 0, 0.05, 0, 0, 0]), v=0.1, r=0.01)\n'
    'movel(pose_trans(get_actual_tcp_pose(), p[0.05, 0, 0, 0, 0, 0]), v=0.1)\n',
}

TIMES_LEFT_OUT = 'the times of the points: left out, because the option speed replaces them'


def options_for(name):
    origin = IDENTITY if name.endswith('.script') else PART
    return ImportOptions(origin=origin, unit='mm', blend=0.005, speed=0.1)


@pytest.fixture(scope='module')
def robot():
    return RobotInMemory('ur5e')


def planned(goal, robot):
    return plan(goal, robot.place(HOME, IDENTITY), ARM, PlanningOptions(self_collision='off'))


@pytest.mark.parametrize('name', FILES)
def test_a_file_of_each_format_is_planned(tmp_path, robot, name):
    (tmp_path / name).write_text(FILES[name])
    found = import_file(tmp_path / name, options_for(name))
    assert len(planned(found.goal, robot).segments) == len(found.goal.waypoints)


def test_a_program_with_stops_is_planned(tmp_path, robot):
    """Outputs around a wait, rests, a time, and turns of the tool and of a joint on the spot."""
    (tmp_path / 'stops.script').write_text(
        'movej([0.1, -1.5, 1.5, -1.5, -1.5, 0])\nset_digital_out(1, True)\n'
        'while not get_digital_in(3): sync() end\nsleep(0.5)\nset_digital_out(1, False)\n'
        'movel(pose_trans(get_actual_tcp_pose(), p[0, 0, 0.05, 0, 0, 0]), t=2)\n'
        'set_analog_out(0, 0.4)\nsleep(1)\n'
        'movel(pose_trans(get_actual_tcp_pose(), p[0, 0, 0, 0, 0, 0.5]))\n'
        'q = get_joint_positions()\nmovej([q[0], q[1], q[2], q[3], q[4], q[5] + d2r(360)])\n'
    )
    goal = import_file(tmp_path / 'stops.script').goal
    segments = planned(goal, robot).segments
    assert len(segments) == len(goal.waypoints) + 3  # the wait, and two rests
    assert float(segments[3].duration) == pytest.approx(2.0, abs=1e-6)


@pytest.mark.parametrize('name', ['a.csv', 'a.nc', 'a.yaml'])
def test_the_corners_of_a_file_are_rounded(tmp_path, robot, name):
    (tmp_path / name).write_text(FILES[name])
    options = replace(options_for(name), blend=0.0, corner=1e-4)
    goal = import_file(tmp_path / name, options).goal
    assert goal.corner_deviation == 1e-4
    assert not goal.segments.corner_deviations.any()
    assert not goal.segments.blend_radii.any()
    places = planned(goal, robot).reference.poses[:, :3]
    off = distances(goal.waypoints.poses[:-1, :3], [places])
    assert (off > 1e-6).all()
    assert (off <= 1e-4).all()


def test_only_lines_and_arcs_have_corners(tmp_path):
    (tmp_path / 'a.script').write_text(FILES['a.script'])
    with pytest.raises(BrokenFile) as caught:
        import_file(tmp_path / 'a.script', ImportOptions(corner=1e-4))
    assert str(caught.value) == (
        'line 1: the motion is JOINT, and only lines and arcs have rounded corners; give a blend '
        'in place of corner.'
    )


def test_a_corner_takes_the_place_of_blends_in_the_file(tmp_path):
    (tmp_path / 'a.csv').write_text('x [mm],y [mm],z [mm],blend [mm]\n0,0,0,0\n9,0,0,2\n9,9,0,0\n')
    found = import_file(tmp_path / 'a.csv', ImportOptions(corner=1e-4))
    assert not found.goal.segments.blend_radii.any()
    assert 'line 3: blend: its corner is rounded in its place' in said(found)


def test_a_corner_takes_the_place_of_times(tmp_path):
    (tmp_path / 'a.csv').write_text(TIMED)
    found = import_file(tmp_path / 'a.csv', ImportOptions(corner=1e-4))
    assert not found.goal.waypoints.times.any()
    assert (
        'the times of the points: a path with rounded corners has speeds in their place'
        in said(found)
    )


def test_a_format_can_have_corners():
    into = PathCollector()
    for line, (x, corner) in enumerate(((0.0, None), (0.1, 2e-4), (0.2, 0.0), (0.3, None)), 1):
        into.add(line, (x, 0.0, 0.0), corner=corner)
    found = goal_of_path(into.path(), ImportOptions(), into.remarks)
    assert found.goal.segments.corner_deviations.tolist() == [0.0, 2e-4, 0.0, 0.0]
    assert 'the arm stops at 2 inner points: give a corner if it should not' in said(found)
    found = goal_of_path(into.path(), ImportOptions(blend=0.01), into.remarks)
    assert not found.goal.segments.corner_deviations.any()
    assert 'lines 2-3: a corner: the option blend takes its place' in said(found)


@pytest.mark.parametrize('name', ['a.nc', 'a.script'])
def test_an_imported_path_is_carried_out(tmp_path, robot, name):
    (tmp_path / name).write_text(FILES[name])
    goal = import_file(tmp_path / name, options_for(name)).goal
    ran = robot.run([segment.primitive for segment in planned(goal, robot).segments])
    assert ran.failure == ''
    places = np.array([pose.position for pose in ran.poses])
    radii = np.array(goal.segments.blend_radii)
    for pose, radius in zip(np.array(goal.waypoints.poses), radii, strict=True):
        assert np.linalg.norm(places - pose[:3], axis=1).min() < radius + 1e-4


def collected(*points):
    """Return what was collected: positions, rests [s], and whether the arm waits there."""
    into = PathCollector()
    for line, (position, dwell, waits, lift) in enumerate(points, 1):
        into.add(line, position, dwell=dwell or None, lift=lift)
        if waits:
            into.wait(
                InputWait(
                    waypoint=0, input=InputKind.STANDARD_DIGITAL, pin=3, value=1.0, timeout=5.0
                )
            )
    return into


@pytest.mark.parametrize(
    'options',
    [{}, {'simplify': 1e-3}, {'blend': 0.01}, {'lift': 0.02}],
    ids=['plain', 'simplified', 'with blends', 'lifted'],
)
def test_rests_and_waits_stay_at_their_points(options):
    into = collected(
        ((0.0, 0.0, 0.0), 0.0, False, False),
        ((0.01, 0.0, 0.0), 0.5, False, False),
        ((0.02, 0.0, 0.0), 0.0, False, False),
        ((0.02, 0.0, 0.0), 0.0, False, False),
        ((0.03, 0.0, 0.0), 0.0, True, False),
        ((0.04, 0.0, 0.0), 0.0, False, True),
        ((0.05, 0.0, 0.0), 0.25, False, False),
    )
    goal = goal_of_path(into.path(), ImportOptions(**options), into.remarks).goal
    x = np.array(goal.waypoints.poses)[:, 0]
    rests = {round(x[row], 6): dwell for row, dwell in enumerate(goal.segments.dwells) if dwell}
    assert rests == {0.01: 0.5, 0.05: 0.25}
    (wait,) = goal.input_waits
    assert x[wait.waypoint] == pytest.approx(0.03)
    stops = [row for row in range(len(x)) if round(x[row], 6) in (0.01, 0.03)]
    assert not goal.segments.blend_radii[stops].any()


def test_a_turn_of_a_joint_on_the_spot_stays():
    into = PathCollector()
    for line, turn in enumerate((0.0, 0.0, 2.0 * pi), 1):
        posture = Posture(names=('wrist_3_joint',), values=(turn,))
        into.add(line, (0.0, 0.0, 0.0), SegmentType.JOINT, posture=posture)
    goal = goal_of_path(into.path(), ImportOptions(), into.remarks).goal
    assert [goal.waypoints.postures[row].values for row in (0, 1)] == [(0.0,), (2.0 * pi,)]
    assert len(goal.waypoints) == 2


def test_a_recording_becomes_a_path(tmp_path, robot):
    record(tmp_path, [packet(i) for i in range(100)])
    found = import_file(only_file(tmp_path), ImportOptions(simplify=1e-3))
    assert 1 <= len(found.goal.waypoints) <= 3
    assert found.goal.waypoints.postures[0].names


def test_a_broken_recording_is_refused(tmp_path):
    (tmp_path / 'a.npz').write_bytes(b'none')
    with pytest.raises(BrokenFile, match='no file of NumPy arrays'):
        import_file(tmp_path / 'a.npz')
    np.savez(tmp_path / 'b.npz', positions=np.zeros((3, 3)))
    with pytest.raises(BrokenFile, match='it has no array'):
        import_file(tmp_path / 'b.npz')


@pytest.mark.parametrize(
    ('column', 'row', 'value', 'why'),
    [
        ('actual_pose', 5, np.nan, 'a number is missing'),
        ('actual_pose', 6, 0.0, 'its quaternion is none'),
        ('time', 7, -1.0, 'it is earlier than the packet before'),
    ],
)
def test_a_broken_packet_is_named(tmp_path, column, row, value, why):
    record(tmp_path, [packet(i) for i in range(20)])
    file = only_file(tmp_path)
    with np.load(file) as arrays:
        changed = dict(arrays)
    changed[column][row] = value
    np.savez(file, **changed)
    with pytest.raises(BrokenFile, match=f'^packet {row + 1}: {why}') as caught:
        import_file(file)
    assert caught.value.line == row + 1


#: Two lines of 100 mm; the tool rests for 2 s at the corner, where two rows say the same.
TIMED = """t [s],x [mm],y [mm],z [mm]
60.5,0,0,0
61.5,100,0,0
63.5,100,0,0
64.5,100,100,0
"""


def said(found):
    return [remark.text() for remark in found.remarks]


def test_times_begin_at_the_first_point(tmp_path):
    (tmp_path / 'a.csv').write_text(TIMED)
    found = import_file(tmp_path / 'a.csv')
    assert found.goal.waypoints.times.tolist() == [0.0, 1.0, 4.0]
    assert found.goal.segments.dwells.tolist() == [0.0, 2.0, 0.0]
    assert (
        'the first point is at time 0: the arm has to be there; else give approach_time'
        in said(found)
    )


def test_an_approach_gets_its_time(tmp_path, robot):
    (tmp_path / 'a.csv').write_text(TIMED)
    options = ImportOptions(approach_time=5.0, blend=0.005, origin=PART)
    found = import_file(tmp_path / 'a.csv', options)
    assert found.goal.waypoints.times.tolist() == [5.0, 6.0, 9.0]
    assert found.goal.segments.blend_radii.tolist() == [0.005, 0.0, 0.0]
    assert not any('time 0' in text for text in said(found))
    assert planned(found.goal, robot).duration == pytest.approx(9.0, abs=0.01)


def test_the_command_takes_an_approach_time(tmp_path, capsys):
    (tmp_path / 'a.csv').write_text(TIMED)
    goal = tmp_path / 'goal.yaml'
    command = ['import', str(tmp_path / 'a.csv'), '-o', str(goal), '--approach-time', '5']
    assert main(command) == 0
    times = goal_from_fields(read_goal_file(goal)).waypoints.times
    assert times.tolist() == [5.0, 6.0, 9.0]


def test_a_rest_before_the_first_motion_is_left_out(tmp_path):
    rows = TIMED.replace('61.5,', '61.5,0,0,0\n62.5,').replace('63.5', '64.5')
    (tmp_path / 'a.csv').write_text(rows.replace('64.5,100,100', '65.5,100,100'))
    found = import_file(tmp_path / 'a.csv')
    assert found.goal.waypoints.times.tolist() == [0.0, 1.0, 4.0]
    assert 'a rest of 1 s at the first point: it is left out' in said(found)


@pytest.mark.parametrize(
    ('second', 'line'), [('60.5', 3), ('60.4', 3), ('61.5', None), ('63.6', 4)]
)
def test_times_that_do_not_rise_are_said_with_their_line(tmp_path, second, line):
    (tmp_path / 'a.csv').write_text(
        TIMED.replace('61.5,', f'{second},').replace('63.5,100', '63.5,99')
    )
    found = import_file(tmp_path / 'a.csv')
    expected = f'the times of the points: they do not rise at line {line}'
    assert (expected in said(found)) == (line is not None)
    assert found.goal.waypoints.times.any() == (line is None)


def test_a_gap_in_the_times_is_said(tmp_path):
    rows = [f'{0.1 * i + 30 * (i > 20):.1f},{i},0,0' for i in range(40)]
    (tmp_path / 'a.csv').write_text('t,x [mm],y [mm],z [mm]\n' + '\n'.join(rows))
    found = import_file(tmp_path / 'a.csv')
    assert 'line 23: a gap of 30.1 s: the motion to this point takes that long' in said(found)


@pytest.mark.parametrize('speed', [None, 0.05])
def test_of_times_and_speeds_one_counts_and_the_other_is_said(tmp_path, speed):
    text = TIMED.replace(' [s]', '').replace('\n', ',20\n').replace('z [mm],20', 'z [mm],v [mm/s]')
    (tmp_path / 'a.csv').write_text(text)
    found = import_file(tmp_path / 'a.csv', ImportOptions(speed=speed))
    if speed is None:
        assert found.goal.waypoints.times.any()
        assert not found.goal.segments.velocities.any()
        assert 'the speeds of the points: their times are kept' in said(found)
    else:
        assert found.goal.segments.velocities.tolist() == [0.05] * 3
        assert "line 1: column 'v [mm/s]': a speed is given" in said(found)
        assert TIMES_LEFT_OUT in said(found)


def test_a_recording_of_rtde_begins_at_time_0(tmp_path):
    """The manufacturer's recorder counts from the start of the controller."""
    found = import_file(FOREIGN / 'ur_rtde.csv')
    rows = np.genfromtxt(FOREIGN / 'ur_rtde.csv', delimiter=',', names=True)
    times = found.goal.waypoints.times
    assert rows['timestamp'][0] == 62.56
    assert times[0] == 0.0
    # The rest before the motion is left out; from there on times follow the robot's clock.
    clock = rows['timestamp'][found.lines - 2]
    assert np.diff(times[1:]) == pytest.approx(np.diff(clock[1:]), abs=1e-9)


def test_an_unknown_format_is_refused(tmp_path):
    with pytest.raises(BrokenFile, match='give one of csv'):
        import_file(tmp_path / 'a.step')


def test_the_command_writes_a_goal_file_and_says_what_was_left_out(tmp_path, capsys):
    (tmp_path / 'a.nc').write_text('G21 M8\n' + FILES['a.nc'])
    goal = tmp_path / 'goal.yaml'
    status = main(['import', str(tmp_path / 'a.nc'), '-o', str(goal), '--blend', '1mm'])
    assert status == 0
    assert 'line 1: M8: no output is given for it' in capsys.readouterr().err
    direct = import_file(tmp_path / 'a.nc', ImportOptions(blend=0.001)).goal
    assert goal_from_fields(read_goal_file(goal)).waypoints == direct.waypoints


def test_a_long_goal_is_written_packed_and_read_exactly(tmp_path):
    rows = '\n'.join(f'G1 X{i / 7:.5f} Y{i % 2} Z0 F600' for i in range(300))
    (tmp_path / 'a.nc').write_text(f'G21\n{rows}\n')
    goal = tmp_path / 'goal.yaml'
    assert main(['import', str(tmp_path / 'a.nc'), '-o', str(goal), '--blend', '1mm']) == 0
    assert 'packed:' in goal.read_text()
    direct = import_file(tmp_path / 'a.nc', ImportOptions(blend=0.001)).goal
    read = goal_from_fields(read_goal_file(goal))
    assert read.waypoints == direct.waypoints
    assert (read.segments.blend_radii == direct.segments.blend_radii).all()


def test_the_command_takes_a_corner_or_a_blend(tmp_path, capsys):
    (tmp_path / 'a.nc').write_text(FILES['a.nc'].replace('G1 X60', 'G64 P0.1 G1 X60'))
    goal = tmp_path / 'goal.yaml'
    command = ['import', str(tmp_path / 'a.nc'), '-o', str(goal), '--corner', '0.05mm']
    assert main(command) == 0
    read = goal_from_fields(read_goal_file(goal))
    assert read.corner_deviation == pytest.approx(5e-5)
    assert read.segments.corner_deviations.tolist() == pytest.approx([0.0, 0.0, 1e-4, 1e-4, 1e-4])
    assert main([*command, '--blend', '1mm']) == 1
    assert 'blend and corner are two ways past a point; give one of them' in (
        capsys.readouterr().err
    )
    assert main([*command[:-1], '0.01mm']) == 1
    assert 'corner is 1e-05 m, but must be 0 (corners as they are) or from 2e-05 to 0.1 m' in (
        capsys.readouterr().err
    )


def test_the_command_ends_with_one_sentence_for_a_broken_file(tmp_path, capsys):
    (tmp_path / 'a.csv').write_text('x,y,z\n')
    assert main(['import', str(tmp_path / 'a.csv')]) == 1
    assert 'a.csv: line 1: the column' in capsys.readouterr().err


@pytest.mark.parametrize('length', ['1', '1 km', 'mm', '-1mm'])
def test_a_length_without_a_unit_is_refused(length, capsys):
    for option in ('--blend', '--corner'):
        with pytest.raises(SystemExit):
            main(['import', 'a.csv', option, length])
        assert option in capsys.readouterr().err


def corners(points):
    """The smallest box around points, x and y [mm]."""
    return (1e3 * np.concatenate((points[:, :2].min(axis=0), points[:, :2].max(axis=0)))).round(2)


@pytest.mark.parametrize(
    ('name', 'count', 'box'),
    [
        ('openscad.dxf', 54, (0, 0, 60, 40)),
        ('potrace.dxf', 30, (6, 7, 59, 41)),
        ('prusaslicer.gcode', 104, (94, 94, 106, 106)),
        ('ur_rtde.csv', 3, (-491.9, -133.3, -461.9, -83.3)),
        ('urx.script', 13, (-500, -150, -400, -50)),
    ],
)
def test_files_of_other_programs(name, count, box):
    simplify = 1e-4 if name.endswith('.csv') else 0.0
    options = ImportOptions(unit='mm', orientation=ToolOrientation.DOWN, simplify=simplify)
    found = import_file(FOREIGN / name, options)
    assert len(found.goal.waypoints) == count
    assert corners(np.array(found.goal.waypoints.poses)) == pytest.approx(box, abs=1.0)


def test_a_recording_of_ur_rtde_is_exact(tmp_path):
    goal = import_file(FOREIGN / 'ur_rtde.csv').goal
    assert goal.waypoints[-1].pose.position == pytest.approx((-0.4619, -0.0833, 0.4879), abs=1e-6)
    assert goal.waypoints[-1].pose.angle_to(ARM.forward(HOME)) < 1e-5
    spaced = (FOREIGN / 'ur_rtde.csv').read_text().replace(',', ' ')  # as the client of UR has it
    file = tmp_path / 'spaced.csv'
    file.write_text(spaced)
    into = PathCollector()
    collect_csv(file, ImportOptions(), into)
    assert len(into) == 113


def test_a_program_of_urx_keeps_speed_and_blends():
    segments = import_file(FOREIGN / 'urx.script').goal.segments
    assert (segments.types == SegmentType.PROCESS).all()
    assert segments.velocities.tolist() == [0.05] * 13
    assert segments.blend_radii.tolist() == [0.004] * 12 + [0.0]
