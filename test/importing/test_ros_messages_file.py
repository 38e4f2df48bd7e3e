# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Messages as ``ros2 topic echo`` prints them, and as objects."""

from math import pi
from types import SimpleNamespace as Fields

import numpy as np
import pytest

from ur_cartesian_driver.importing import BrokenFile, import_file, import_message
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, robot_model
from ur_cartesian_driver.motion.goal import SegmentType

HEADER = 'header:\n  stamp:\n    sec: 3\n    nanosec: 0\n  frame_id: map\n'
POSE = """position:
      x: {x}
      y: 0.2
      z: 0.0
    orientation:
      x: 0.0
      y: 0.0
      z: 0.0
      w: {w}
"""
#: nav_msgs/Path: the header of each pose, 2 spaces in a list that is not indented.
STAMPED = """- header:
    stamp:
      sec: {sec}
      nanosec: 500000000
    frame_id: map
  pose:
    position:
      x: {x}
      y: 0.2
      z: 0.0
    orientation:
      x: 0.0
      y: 1.0
      z: 0.0
      w: 0.0
"""
PATH = HEADER + 'poses:\n' + STAMPED.format(sec=1, x=0.1) + STAMPED.format(sec=2, x=0.2) + '---\n'
ARRAY = (
    HEADER
    + 'poses:\n'
    + ''.join('- ' + POSE.format(x=x, w=1.0).replace('\n    ', '\n  ') for x in (0.1, 0.2))
    + '---\n'
)
HOME = [pi / 2, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0]
#: The order of joint_states of UR's own driver: sorted by name.
ORDER = [2, 1, 0, 3, 4, 5]
JOINTS = (
    HEADER
    + 'joint_names:\n'
    + ''.join(f'- left_{JOINT_NAMES[i]}\n' for i in ORDER)
    + 'points:\n'
    + ''.join(
        '- positions:\n'
        + ''.join(f'  - {HOME[i] + 0.1 * step}\n' for i in ORDER)
        + '  velocities: []\n  accelerations: []\n  effort: []\n'
        + f'  time_from_start:\n    sec: {step}\n    nanosec: 0\n'
        for step in (1, 2)
    )
)


def imported(tmp_path, text):
    file = tmp_path / 'echo.yaml'
    file.write_text(text)
    return import_file(file)


def poses(found):
    return np.array(found.goal.waypoints.poses)


def test_a_path(tmp_path):
    found = imported(tmp_path, PATH)
    assert poses(found)[:, 0].tolist() == [0.1, 0.2]
    assert poses(found)[0, 3:].tolist() == [0.0, 1.0, 0.0, 0.0]
    assert found.goal.frame_id == 'map'
    assert found.lines.tolist() == [7, 22]


def test_an_array_of_poses_whose_orientations_are_not_set(tmp_path):
    found = imported(tmp_path, ARRAY)
    assert poses(found)[:, 0].tolist() == [0.1, 0.2]
    assert poses(found)[0, 3:] == pytest.approx([0.5**0.5, 0.5**0.5, 0.0, 0.0])
    assert any('none of them is set' in remark.why for remark in found.remarks)


def test_a_joint_trajectory(tmp_path):
    found = imported(tmp_path, JOINTS)
    arm = Arm(robot_model('ur5e'))
    for i, step in enumerate((1, 2)):
        q = tuple(value + 0.1 * step for value in HOME)
        assert poses(found)[i] == pytest.approx(arm.forward(q).row())
        assert found.goal.waypoints.postures[i].values == pytest.approx(q)
    assert found.goal.segments.types.tolist() == [SegmentType.JOINT] * 2
    assert found.goal.waypoints.times.tolist() == [1.0, 2.0]


def test_a_message_in_python():
    point = Fields(x=0.1, y=0.2, z=0.3)
    turn = Fields(x=1.0, y=0.0, z=0.0, w=0.0)
    message = Fields(
        header=Fields(frame_id='part'), poses=[Fields(position=point, orientation=turn)]
    )
    found = import_message(message)
    assert poses(found)[0].tolist() == [0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0]
    assert found.goal.frame_id == 'part'


@pytest.mark.parametrize(
    ('text', 'line', 'part'),
    [
        ('', 1, 'no message'),
        ('a: [1\nb: 2\n', 2, 'not YAML'),
        ('a: 1\n', 1, 'neither a Path'),
        (PATH.replace('x: 0.2', 'x: far'), 29, "'far'"),
        (PATH.replace('      z: 0.0\n    or', '    or', 1), 14, 'field z is missing'),
        (PATH.replace('y: 1.0', 'y: 3.0', 1), 7, 'length 3'),
        (JOINTS.replace('left_elbow', 'left_knee'), 7, 'elbow_joint is 0 times'),
        (JOINTS.replace('  - 0.1\n', '', 1), 14, '5 positions'),
        (HEADER + 'poses: []\n', 0, 'no point'),
    ],
)
def test_a_broken_file_is_one_sentence_with_its_line(tmp_path, text, line, part):
    with pytest.raises(BrokenFile, match=part) as caught:
        imported(tmp_path, text)
    assert caught.value.line == line
    assert '\n' not in str(caught.value)
