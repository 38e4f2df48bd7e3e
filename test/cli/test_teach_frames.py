# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Frames from touches: of tools that stand in the cell, and of parts in the hand."""

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.cli.teach_command import guide
from ur_cartesian_driver.cli.teach_frames import FixedToolLesson, HeldPartLesson
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.frame_fit import fit_frame
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_roll_pitch_yaw
from ur_cartesian_driver.motion.goal.known_frames import Frames, StaticFrame
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.stop_prediction import state_at_rest

ARM = Arm(robot_model('ur5e'))
TOOL = Pose((-0.5, 0.1, 0.3), quaternion_from_roll_pitch_yaw(0.4, -0.2, 1.0))
PART = Pose((0.02, -0.01, 0.09), quaternion_from_roll_pitch_yaw(-0.3, 0.6, 0.2))
T_FLANGE_TCP = Pose((0.0, 0.0, 0.12))
POINTS = [(0.0, 0.0, 0.0), (0.08, 0.0, 0.0), (0.0, 0.06, 0.0), (0.08, 0.06, 0.02)]


def touching(place, turn=0.0):
    """The robot whose TCP is at a place."""
    pose = Pose(tuple(place), quaternion_from_roll_pitch_yaw(3.0 + turn, 0.1, turn))
    return RobotState(timestamp=0.0, actual_q=(0.0,) * 6, actual_tcp_pose=pose)


def frame_of(line):
    """The frame of a printed row, as the driver reads it."""
    found = StaticFrame.parse(re.fullmatch(r"static_frames: \['(.*)'\]", line)[1])
    assert Frames(static_frames=[found])
    return found


def touch_tool(off=0.0):
    lesson = FixedToolLesson('belt')
    lesson.press('', touching(TOOL.position))
    lesson.press('', touching(np.add(TOOL.position, (off, 0.0, 0.0)), 0.5))
    lesson.press('z', touching(TOOL.apply((0.0, 0.0, -0.05))))
    lesson.press('x', touching(TOOL.apply((0.04, 0.0, -0.01))))
    return lesson


def test_a_fixed_tool_is_found_by_tip_and_axes():
    row, residuals = touch_tool().report()
    found = frame_of(row)
    assert (found.name, found.parent) == ('belt', 'base')
    assert found.T_parent_frame.distance_to(TOOL) < 1e-6
    assert found.T_parent_frame.angle_to(TOOL) < 1e-5
    assert residuals.endswith('2 touches of the tip: 0.00, 0.00 mm; the largest is 0.00 mm')


def test_a_wrong_tcp_shows_in_the_residuals_of_the_tip():
    _, residuals = touch_tool(off=0.002).report()
    assert residuals == (
        'residuals of the 2 touches of the tip: 1.00, 1.00 mm; the largest is 1.00 mm'
    )


def hold(points, off=(0.0, 0.0, 0.0), count=4):
    """Touch the tip with points of a part, one of which is measured beside its place."""
    lesson, rng = HeldPartLesson('box', points, TOOL.position), np.random.default_rng(3)
    for k, point in enumerate(points[:count]):
        at = np.add(point, off if k == 1 else 0.0)
        turned = Pose(TOOL.position, quaternion_from_roll_pitch_yaw(*rng.normal(size=3)))
        T_base_part = turned @ Pose(tuple((-at).tolist()))
        T_base_tcp = T_base_part @ PART.inverse() @ T_FLANGE_TCP
        state = RobotState(
            timestamp=0.0,
            actual_q=(0.0,) * 6,
            actual_tcp_pose=T_base_tcp,
            T_flange_tcp=T_FLANGE_TCP,
        )
        assert lesson.press('', state).startswith(f'point {k + 1} of {len(points)}')
    return lesson


def test_a_part_in_the_hand_is_found_by_points_that_touch():
    row, residuals = hold(POINTS).report()
    found = frame_of(row)
    assert (found.name, found.parent) == ('box', 'tool0')
    assert found.T_parent_frame.distance_to(PART) < 1e-6
    assert found.T_parent_frame.angle_to(PART) < 1e-5
    assert residuals.endswith('the largest is 0.00 mm')
    far = hold(POINTS, off=(0.0, 0.0, 0.004)).report()[1]
    assert 0.5 < float(re.search(r'largest is ([\d.]+) mm', far)[1]) < 4.0


def test_touches_are_undone_and_keys_explained():
    lesson, state = FixedToolLesson('belt'), state_at_rest(ARM, (0.0, -1.5, 1.5, -1.5, -1.5, 0.0))
    assert lesson.press('u', state) == 'there is no touch to undo'
    assert lesson.press('', state) == 'touch 1: tip'
    assert lesson.press('?', state).startswith("'?' means nothing. Enter: the TCP touches the tip")
    assert lesson.press('u', state) == 'undone; 0 left'
    part = hold(POINTS)
    assert part.press('', state) == 'all 4 points have touched; q prints the frame'
    assert part.press('l', state).startswith("'l' means nothing. Enter: the next point")
    assert part.press('u', state) == 'undone; 3 left'


@pytest.mark.parametrize(
    ('make', 'text'),
    [
        (lambda: FixedToolLesson('belt').report(), 'has 0 touches of the tip, 0 behind it and 0'),
        (lambda: HeldPartLesson('box', POINTS[:3], TOOL.position), '--point is given 3 times'),
        (
            lambda: hold(POINTS, count=3).report(),
            'has 3 touches, of 4 points; touch with at',
        ),
        (
            lambda: hold([(0.01 * k, 0.0, 0.0) for k in range(4)]).report(),
            'the points are on a line, so the rotation about it is not determined; give a point',
        ),
    ],
)
def test_too_few_touches_make_no_frame(make, text):
    with pytest.raises(InvalidGoal, match=re.escape(text)):
        make()


def test_a_tool_whose_points_are_on_a_line_has_no_axes():
    lesson = FixedToolLesson('belt')
    for key, along in (('', 0.0), ('', 0.0), ('z', -0.05), ('x', 0.04)):
        lesson.press(key, touching(TOOL.apply((0.0, 0.0, along))))
    with pytest.raises(InvalidGoal, match='or all on a line; touch places farther apart'):
        lesson.report()


def test_random_frames_are_found_whatever_they_are():
    rng = np.random.default_rng(5)
    for _ in range(50):
        T = Pose(
            tuple(rng.normal(size=3).tolist()), quaternion_from_roll_pitch_yaw(*rng.normal(size=3))
        )
        known = rng.normal(size=(5, 3))
        measured = np.array([T.apply(tuple(point)) for point in known.tolist()])
        found, off = fit_frame(known, measured)
        assert found.distance_to(T) < 1e-9
        assert found.angle_to(T) < 1e-7
        assert off.max() < 1e-9


@pytest.mark.parametrize(
    ('arguments', 'text'),
    [
        (['--held-part', 'box'], '--tip is missing: where the points touch; teach --fixed-tool'),
        (['--held-part', 'box', '--tip', '-0.5,0.1,0.3'], '--point is given 0 times'),
    ],
)
def test_what_is_missing_is_said_before_the_robot_is_connected(capsys, arguments, text):
    assert main(['teach', *arguments, '--wait', '0', '--rtde-port', '1']) == 1
    assert text in capsys.readouterr().err


class GuidedArm:
    """A driver whose arm is guided by hand."""

    def __init__(self, states):
        self._states = iter(states)

    @property
    def state(self):
        return next(self._states)

    def start_freedrive(self, on_begin):
        on_begin()
        return SimpleNamespace(
            add_done_callback=lambda call: None,
            done=lambda: False,
            cancel=lambda: None,
            result=lambda timeout: None,
        )


def test_touches_that_make_no_frame_are_lost_only_by_a_second_q():
    lesson, said = FixedToolLesson('belt'), []  # type: FixedToolLesson, list[str]
    states = [
        touching(TOOL.position),
        touching(TOOL.position, 0.5),
        touching(TOOL.apply((0.0, 0.0, -0.05))),
        touching(TOOL.apply((0.04, 0.0, -0.01))),
    ]
    keys = iter(['', '', 'z', 'q', 'x', 'q', 'not read'])
    arm: Any = GuidedArm(states)
    guide(arm, lesson, keys, said.append)
    assert next(keys) == 'not read'
    assert 'has 2 touches of the tip, 1 behind it and 0 towards x' in said[4]
    assert said[4].endswith('Go on, or end without a frame by another q.')
    assert frame_of(lesson.report()[0]).T_parent_frame.distance_to(TOOL) < 1e-6
    keys = iter(['', 'q', 'q', 'not read'])
    arm = GuidedArm(states)
    guide(arm, FixedToolLesson('belt'), keys, said.append)
    assert next(keys) == 'not read'


@pytest.mark.parametrize(
    ('arguments', 'option', 'text'),
    [
        (['--fixed-tool', 'belt', '--speed', '0.1'], '--speed', 'for a path'),
        (['--held-part', 'box', '--blend', '1mm'], '--blend', 'for a path'),
        (['--fixed-tool', 'belt', '-o', 'belt.yaml'], '--output', 'for a path'),
        (['--fixed-tool', 'belt', '--point', '0,0,0'], '--point', 'for a held part'),
        (['--tip', '0,0,0'], '--tip', 'for a held part'),
    ],
)
def test_options_of_another_lesson_are_refused(
    capsys, tmp_path, monkeypatch, arguments, option, text
):
    monkeypatch.chdir(tmp_path)
    assert main(['teach', *arguments, '--wait', '0', '--rtde-port', '1']) == 1
    said = capsys.readouterr().err
    assert option in said
    assert text in said


@pytest.mark.parametrize('wrong', ['1,2', 'x,0,0', '0,0,99'])
def test_a_place_that_is_none_is_refused(capsys, wrong):
    with pytest.raises(SystemExit, match='2'):
        main(['teach', '--held-part', 'box', '--tip', wrong])
    assert '--tip' in capsys.readouterr().err
