# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""G61 and G64 say how far the path may be beside the corners of a program."""

from math import pi

from gcode_programs import imported, positions, remarks
import numpy as np
import pytest

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest

#: A square of 10 mm; what is asked of the first, the second and the third corner is filled in.
SQUARE = 'G21 G90\nG1 X0 Y0 Z0 F600\n{}\nX10\n{}\nY10\n{}\nX0\n'
#: Its corners [mm].
CORNERS = [[0, 0, 0], [10, 0, 0], [10, 10, 0], [0, 10, 0]]
SMALL = 'a corner of 0.01 mm: less than 0.02 mm, '


def corners(found):
    """The corner of the goal, and those of its points where they differ [mm]."""
    own = 1e3 * found.goal.segments.corner_deviations
    return 1e3 * found.goal.corner_deviation, own.round(6).tolist()


def square(tmp_path, first='', second='', third='', **options):
    return imported(tmp_path, SQUARE.format(first, second, third), **options)


def test_g64_rounds_the_points_that_follow_until_g61(tmp_path):
    found = square(tmp_path, 'G64 P0.1', 'G64 P0.05', 'G61')
    assert corners(found) == (0.0, [0.0, 0.1, 0.05, 0.0])
    assert remarks(found) == []
    assert positions(found) == pytest.approx(np.array(CORNERS))
    assert not found.goal.segments.blend_radii.any()
    assert corners(square(tmp_path, 'G64 P0.1', 'G61.1')) == (0.0, [0.0, 0.1, 0.0, 0.0])


def test_g64_acts_before_the_motion_of_its_line(tmp_path):
    found = imported(tmp_path, 'G21\nG0 X0 Y0 Z0\nG64 P0.1 G1 X10 F600\nG61 Y10\n')
    assert corners(found) == (0.0, [0.0, 0.1, 0.0])


def test_g64_holds_for_travels_arcs_and_helices(tmp_path):
    found = imported(
        tmp_path,
        'G21 G17 G64 P0.1\nG0 X0 Y0 Z0\nG2 X20 I10 F600\nG2 X0 I-10 Z1\nG1 X5\n',
    )
    assert len(found.goal.waypoints) > 10
    assert (found.goal.segments.corner_deviations == 1e-4).all()


@pytest.mark.parametrize(
    ('begin', 'expected'),
    [
        ('G20\nG64 P0.004', 0.1016),
        ('G64 P0.004 G20', 0.1016),
        ('G20 G17 G54 G64 P0.004 M6 T1', 0.1016),
        ('G54 P0.1 G64 G21', 0.1),
        ('G20\nG64 P0.004\nG21', 0.1016),
    ],
)
def test_p_is_in_the_unit_of_its_line(tmp_path, begin, expected):
    found = imported(tmp_path, f'{begin}\nG1 X0 Y0 Z0 F10\nX1\n')
    assert corners(found) == (0.0, pytest.approx([expected] * 2))
    assert not any('G64' in text for text in remarks(found))


def test_p_before_the_unit_is_in_the_unit_that_follows(tmp_path):
    found = imported(tmp_path, 'G64 P0.004\nG20\nG1 X0 Y0 Z0 F10\nX1\n')
    assert corners(found) == (0.0, pytest.approx([0.1016] * 2))
    said = 'line 1: G64 before G20 and G21: its P is in the unit that follows'
    assert remarks(found) == [said]
    found = imported(tmp_path, 'G64 P0.1\nG1 X0 Y0 Z0 F10\nX1\n', unit='mm')
    assert corners(found) == (0.0, pytest.approx([0.1] * 2))
    assert remarks(found) == []


def test_a_scale_holds_for_p(tmp_path):
    assert corners(square(tmp_path, 'G64 P0.1', scale=2.0)) == (0.0, [0.0, 0.2, 0.2, 0.2])


@pytest.mark.parametrize('code', ['G64', 'G64 P0'])
def test_without_p_the_option_says_how_far(tmp_path, code):
    left_out = 'line 5: G64: without P it bounds nothing; the option corner does'
    found = square(tmp_path, 'G64 P0.1', code)
    assert corners(found) == (0.0, [0.0, 0.1, 0.0, 0.0])
    assert remarks(found) == [left_out]
    found = square(tmp_path, 'G64 P0.1', code, corner=5e-5)
    assert corners(found) == (0.05, [0.0, 0.1, 0.0, 0.0])
    assert remarks(found) == []


def test_g61_stops_in_spite_of_the_option(tmp_path):
    found = square(tmp_path, '', 'G61', 'G64 P0.1', corner=5e-5)
    # The corner of a goal holds at all its points, so that none could be a stop.
    assert corners(found) == (0.0, [0.05, 0.05, 0.0, 0.1])
    said = [note.text() for note in found.remarks]
    assert 'the arm stops at 1 inner points: the file says so' in said


def test_a_program_that_stops_everywhere_has_no_corners(tmp_path):
    found = imported(tmp_path, 'G21 G61\nG1 X0 Y0 Z0 F600\nX1\nX2\n', corner=5e-5)
    assert corners(found) == (0.0, [0.0] * 3)
    said = [note.text() for note in found.remarks]
    assert 'the arm stops at 2 inner points: the file says so' in said


def test_q_is_left_out(tmp_path):
    found = square(tmp_path, 'G64 P0.1 Q0.2')
    assert corners(found) == (0.0, [0.0, 0.1, 0.1, 0.1])
    assert remarks(found) == ['line 3: G64 Q: the option simplify merges points']


def test_a_corner_that_is_too_small_is_none_and_one_too_large_is_smaller(tmp_path):
    found = square(tmp_path, 'G64 P0.01', 'G64 P0.1', 'G64 P200')
    assert corners(found) == (0.0, [0.0, 0.0, 0.1, 100.0])
    assert remarks(found) == [
        f'line 4: {SMALL}the arm stops there',
        'line 8: a corner of 200 mm: made smaller, 100 mm',
    ]
    found = square(tmp_path, 'G64 P0.01', corner=5e-5)
    assert corners(found) == (0.05, [0.0] * 4)
    assert remarks(found) == [f'lines 4, 6, 8: {SMALL}the option corner takes its place']


def test_a_blend_takes_their_place(tmp_path):
    found = square(tmp_path, 'G64 P0.1', 'G61', blend=1e-3)
    assert corners(found) == (0.0, [0.0] * 4)
    assert found.goal.segments.blend_radii.tolist() == [0.001, 0.001, 0.001, 0.0]
    assert remarks(found) == [
        'line 3: G64: the option blend says where the tool stops',
        'line 5: G61: the option blend says where the tool stops',
    ]


def test_simplify_keeps_the_points_where_corners_change(tmp_path):
    text = 'G21 G90\nG1 X0 Y0 Z0 F600\nG64 P0.1\nX1\nX2\nG64 P0.05\nX3\nX4\n'
    found = imported(tmp_path, text, simplify=1e-4)
    assert positions(found)[:, 0].tolist() == pytest.approx([0.0, 2.0, 4.0])
    assert corners(found) == (0.0, [0.0, 0.1, 0.05])


def test_a_lift_has_the_corners_of_its_contours(tmp_path):
    text = 'G21 G64 P0.1\nG1 X0 Y0 Z0 F600\nX1\nG28\nG64 P0.05\nG0 X2 Y0 Z0\nG1 X3\n'
    found = imported(tmp_path, text, lift=0.01)
    assert corners(found) == (0.0, [0.1, 0.1, 0.05, 0.05, 0.05, 0.05])


def test_the_plan_is_within_the_corners(tmp_path):
    arm = Arm(robot_model('ur5e'))
    state = state_at_rest(arm, (0.0, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0))
    found = square(tmp_path, 'G64 P0.1', 'G61', origin=Pose((-0.45, -0.1, 0.3)))
    planned = plan(found.goal, state, arm, PlanningOptions(self_collision='off'))
    path = 1e3 * (planned.reference.poses[:, :3] - (-0.45, -0.1, 0.3))
    beside = [np.linalg.norm(path - point, axis=1).min() for point in np.array(CORNERS)]
    # Before G64 and after G61 the arm stops.
    assert beside[0] == pytest.approx(0.0, abs=1e-3)
    assert 0.05 < beside[1] <= 0.1
    assert beside[2:] == pytest.approx([0.0, 0.0], abs=1e-3)
