# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Messages as ``ros2 topic echo`` and ``rostopic echo`` print them, and as objects."""

import copy
from math import pi
import re
import sys
from types import SimpleNamespace as Fields

from broken_files import broken, goal_or_sentence
import numpy as np
import pytest
from random_cases import cases, random_of
import yaml

from ur_cartesian_driver.importing import (
    BrokenFile,
    import_file,
    import_message,
    ImportOptions,
    Treatment,
)
from ur_cartesian_driver.importing.messages.message_terms import TERMS
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.goal import SegmentType

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


def imported(tmp_path, text, **options):
    file = tmp_path / 'echo.yaml'
    file.write_text(text)
    return import_file(file, ImportOptions(**options))


def remarks(found):
    return [remark.text() for remark in found.remarks]


def echo(*messages, flow_style=False):
    """Return messages as ros2 topic echo prints them: it leaves the layout to PyYAML."""
    return ''.join(
        yaml.dump(m, sort_keys=False, default_flow_style=flow_style, width=sys.maxsize) + '---\n'
        for m in messages
    )


def header(sec=0, frame='base'):
    return {'stamp': {'sec': sec, 'nanosec': 250_000_000}, 'frame_id': frame}


def pose(x, w=0.8):
    return {
        'position': dict(zip('xyz', (x, 0.2, 0.3), strict=True)),
        'orientation': dict(zip('xyzw', (0.0, (1 - w * w) ** 0.5, 0.0, w), strict=True)),
    }


def stamped(x, sec=0, frame='base'):
    return {'header': header(sec, frame), 'pose': pose(x)}


def with_covariance(x, sec=0):
    covariance = [float(i) for i in range(36)]
    return {'header': header(sec), 'pose': {'pose': pose(x), 'covariance': covariance}}


def joint_trajectory(times=(1, 2)):
    return {
        'header': header(3, 'base_link'),
        'joint_names': [f'ur5e_{JOINT_NAMES[i]}' for i in ORDER],
        'points': [
            {
                'positions': [HOME[i] + 0.1 * time for i in ORDER],
                'velocities': [0.1] * 6,
                'accelerations': [],
                'effort': [],
                'time_from_start': {'sec': time, 'nanosec': 500_000_000},
            }
            for time in times
        ],
    }


TWIST = {'linear': {'x': 0.1, 'y': 0.0, 'z': 0.0}, 'angular': {'x': 0.0, 'y': 0.0, 'z': 0.0}}
NO_JOINTS = {'joint_names': [], 'points': []}
#: For each message of the table: what echo prints of it.
MESSAGES = {
    'nav_msgs/Path': [{'header': header(), 'poses': [stamped(0.1, 1), stamped(0.2, 2)]}],
    'geometry_msgs/PoseArray': [{'header': header(), 'poses': [pose(0.1), pose(0.2)]}],
    'trajectory_msgs/JointTrajectory': [joint_trajectory()],
    'moveit_msgs/RobotTrajectory': [
        {'joint_trajectory': joint_trajectory(), 'multi_dof_joint_trajectory': NO_JOINTS}
    ],
    'moveit_msgs/DisplayTrajectory': [
        {
            'model_id': 'ur5e',
            'trajectory': [
                {'joint_trajectory': joint_trajectory(), 'multi_dof_joint_trajectory': NO_JOINTS}
            ],
            'trajectory_start': {'joint_state': {'name': ['a'], 'position': [1.0]}},
        }
    ],
    'control_msgs/FollowJointTrajectory': [
        {'trajectory': joint_trajectory(), 'goal_tolerance': [], 'path_tolerance': []}
    ],
    'moveit_msgs/ExecuteTrajectory': [{'trajectory': {'joint_trajectory': joint_trajectory()}}],
    'geometry_msgs/Pose': [pose(0.1), pose(0.2)],
    'geometry_msgs/PoseStamped': [stamped(0.1, 1), stamped(0.2, 2)],
    'geometry_msgs/PoseWithCovarianceStamped': [with_covariance(0.1, 1), with_covariance(0.2, 2)],
    'nav_msgs/Odometry': [
        {
            'header': header(sec),
            'child_frame_id': 'tool0',
            'pose': {'pose': pose(x), 'covariance': [0.0] * 36},
            'twist': {'twist': TWIST, 'covariance': [0.0] * 36},
        }
        for x, sec in ((0.1, 1), (0.2, 2))
    ],
    'ur_cartesian_driver/FollowCartesianTrajectory': [
        {'trajectory': {'header': header(), 'points': [], 'controlled_frame': ''}}
    ],
    'cartesian_control_msgs/CartesianTrajectory': [
        {'header': header(), 'points': [], 'controlled_frame': ''}
    ],
    'trajectory_msgs/MultiDOFJointTrajectory': [
        {
            'header': header(),
            'joint_names': [f'a_{name}' for name in JOINT_NAMES],
            'points': [{'transforms': [], 'velocities': []}],
        }
    ],
    'visualization_msgs/Marker': [
        {'header': header(), 'ns': '', 'id': 0, 'pose': pose(0.1), 'points': []}
    ],
    'visualization_msgs/MarkerArray': [{'markers': []}],
    'tf2_msgs/TFMessage': [{'transforms': []}],
    'geometry_msgs/TransformStamped': [
        {'header': header(), 'child_frame_id': 'tool0', 'transform': {}}
    ],
    'sensor_msgs/JointState': [
        {'header': header(), 'name': ['a'], 'position': [0.1], 'velocity': [], 'effort': []}
    ],
    'geometry_msgs/PointStamped': [{'header': header(), 'point': {'x': 0.1, 'y': 0.0, 'z': 0.0}}],
    'geometry_msgs/Point': [{'x': 0.1, 'y': 0.0, 'z': 0.0}],
    'geometry_msgs/TwistStamped': [{'header': header(), 'twist': TWIST}],
    'geometry_msgs/Twist': [TWIST],
    'geometry_msgs/WrenchStamped': [{'header': header(), 'wrench': {}}],
    'geometry_msgs/PolygonStamped': [{'header': header(), 'polygon': {'points': []}}],
    'sensor_msgs/PointCloud2': [{'header': header(), 'height': 1, 'width': 0, 'point_step': 16}],
}
#: For each field that is left out: a message that has it.
FIELDS = {
    'header.seq': ('nav_msgs/Path', 'seq', lambda m: m['header'].update(seq=5)),
    'stamp': ('nav_msgs/Path', 'stamp', lambda m: None),
    'covariance': ('geometry_msgs/PoseWithCovarianceStamped', 'covariance', lambda m: None),
    'twist': ('nav_msgs/Odometry', 'twist', lambda m: None),
    'child_frame_id': ('nav_msgs/Odometry', 'child_frame_id', lambda m: None),
    'header': ('trajectory_msgs/JointTrajectory', 'header', lambda m: None),
    'velocities': ('trajectory_msgs/JointTrajectory', 'velocities', lambda m: None),
    'accelerations': (
        'trajectory_msgs/JointTrajectory',
        'accelerations',
        lambda m: m['points'][0].update(accelerations=[1.0] * 6),
    ),
    'effort': (
        'trajectory_msgs/JointTrajectory',
        'effort',
        lambda m: m['points'][1].update(effort=[1.0] * 6),
    ),
    'trajectory_start': ('moveit_msgs/DisplayTrajectory', 'trajectory_start', lambda m: None),
    'model_id': ('moveit_msgs/DisplayTrajectory', 'model_id', lambda m: None),
    'multi_dof_joint_trajectory': (
        'moveit_msgs/RobotTrajectory',
        'multi_dof_joint_trajectory',
        lambda m: m.update(multi_dof_joint_trajectory={'joint_names': ['a'], 'points': []}),
    ),
}
#: What messages show of the fields that are honoured.
HONOURED_FIELDS = {
    'poses': ('nav_msgs/Path', lambda found: len(found.goal.waypoints) == 2),
    'header.frame_id': ('nav_msgs/Path', lambda found: found.goal.frame_id == 'base'),
    'header.stamp': (
        'nav_msgs/Path',
        lambda found: found.goal.waypoints.times.tolist() == [0.0, 1.0],
    ),
    'pose.position': (
        'nav_msgs/Path',
        lambda found: poses(found)[1, :3].tolist() == [0.2, 0.2, 0.3],
    ),
    'pose.orientation': (
        'nav_msgs/Path',
        lambda found: poses(found)[1, 3:] == pytest.approx([0.0, 0.6, 0.0, 0.8]),
    ),
    'joint_names': (
        'trajectory_msgs/JointTrajectory',
        lambda found: found.goal.waypoints.postures[0].names == JOINT_NAMES,
    ),
    'positions': (
        'trajectory_msgs/JointTrajectory',
        lambda found: (
            found.goal.waypoints.postures[1].values
            == pytest.approx([value + 0.2 for value in HOME])
        ),
    ),
    'time_from_start': (
        'trajectory_msgs/JointTrajectory',
        lambda found: found.goal.waypoints.times.tolist() == [1.5, 2.5],
    ),
}


def poses(found):
    return np.array(found.goal.waypoints.poses)


def test_a_path(tmp_path):
    found = imported(tmp_path, PATH)
    assert poses(found)[:, 0].tolist() == [0.1, 0.2]
    assert poses(found)[0, 3:].tolist() == [0.0, 1.0, 0.0, 0.0]
    assert found.goal.frame_id == 'map'
    assert found.lines.tolist() == [7, 22]


def test_directives_of_yaml_shift_no_line(tmp_path):
    found = imported(tmp_path, f'%YAML 1.1\n---\n{PATH}')
    assert poses(found).tolist() == poses(imported(tmp_path, PATH)).tolist()
    assert found.lines.tolist() == [9, 24]


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


@pytest.mark.parametrize('part', ['position', 'orientation'])
def test_a_field_within_a_pose_is_said(tmp_path, part):
    text = echo(*MESSAGES['nav_msgs/Path']).replace(
        f'    {part}:\n', f'    {part}:\n      unit: mm\n'
    )
    lines = [i for i, line in enumerate(text.split('\n'), 1) if 'unit' in line]
    assert f'lines {lines[0]}, {lines[1]}: unit: a path has no such field' in (
        remarks(imported(tmp_path, text))
    )


def test_joints_in_degrees_are_refused(tmp_path):
    text = echo(joint_trajectory()).replace(f'- {HOME[2] + 0.2}\n', '- 90.0\n', 1)
    line = text.split('\n').index('  - 90.0') + 1
    with pytest.raises(BrokenFile, match=f'^line {line}: a joint position is 90 rad; give it in'):
        imported(tmp_path, text)
    found = imported(tmp_path, text.replace('90.0', '6.25'))
    assert found.goal.waypoints.postures[1].values[2] == 6.25


def test_tolerances_of_a_goal_for_a_controller_are_said(tmp_path):
    goal = copy.deepcopy(MESSAGES['control_msgs/FollowJointTrajectory'][0])
    goal['goal_time_tolerance'] = {'sec': 1, 'nanosec': 0}
    assert any(
        'goal_time_tolerance: a path has no such field' in text
        for text in remarks(imported(tmp_path, echo(goal)))
    )


def straight_line_of_joints(count=40, length=0.2):
    """Return a trajectory that echo prints, of a line along y, and the line's ends."""
    arm = Arm(robot_model('ur5e'))
    begin, q, points = arm.forward(HOME), vector6(HOME), []
    for i in range(count + 1):
        y = begin.position[1] + length * i / count
        end = Pose((begin.position[0], y, begin.position[2]), begin.quaternion)
        q = nearest(arm, end, q)
        ramp = 2.0 * (i / count) ** 0.5  # times as of a motion that speeds up
        time = {'sec': int(1.0 + ramp), 'nanosec': round(1e9 * (ramp % 1.0))}
        points.append({'positions': list(q), 'time_from_start': time})
    text = yaml.safe_dump({'joint_names': list(JOINT_NAMES), 'points': points})
    return text, begin, end


def test_a_straight_line_of_joints_becomes_a_line_of_the_tool(tmp_path):
    text, begin, end = straight_line_of_joints()
    found = imported(tmp_path, text, lines=True, simplify=1e-4, speed=0.1)
    assert poses(found) == pytest.approx(np.array([begin.row(), end.row()]), abs=1e-6)
    assert found.goal.segments.types.tolist() == [SegmentType.JOINT, SegmentType.LINEAR]
    assert found.goal.segments.velocities.tolist() == [0.0, 0.1]
    assert list(found.goal.waypoints.postures) == [0]
    kept = imported(tmp_path, text, lines=True)
    assert kept.goal.segments.types.tolist() == [SegmentType.JOINT] + [SegmentType.LINEAR] * 40
    assert kept.goal.waypoints.times[[0, -1]].tolist() == [1.0, 3.0]


def test_a_message_of_rclpy():
    messages = pytest.importorskip('geometry_msgs.msg')
    array = messages.PoseArray()
    array.header.frame_id = 'part'
    array.header.stamp.sec = 5
    for x in (0.1, 0.2):
        one = messages.Pose()
        one.position.x, one.orientation.y, one.orientation.w = x, 0.6, 0.8
        array.poses.append(one)
    found = import_message(array)
    assert poses(found)[:, 0].tolist() == [0.1, 0.2]
    assert poses(found)[0, 3:] == pytest.approx([0.0, 0.6, 0.0, 0.8])
    assert found.goal.frame_id == 'part'
    assert found.lines.tolist() == [1, 2]
    assert 'stamp: a goal begins when it is sent' in remarks(found)
    with pytest.raises(BrokenFile, match='this is a geometry_msgs/Twist: it has no path'):
        import_message(messages.Twist())
    one = messages.PoseWithCovarianceStamped()
    one.pose.pose.position.z = 0.3
    one.pose.covariance[7] = 1.0
    found = import_message(one)
    assert poses(found)[0, :3].tolist() == [0.0, 0.0, 0.3]
    assert 'covariance: a goal has no such field' in remarks(found)


def test_a_message_in_python():
    point = Fields(x=0.1, y=0.2, z=0.3)
    turn = Fields(x=1.0, y=0.0, z=0.0, w=0.0)
    message = Fields(
        header=Fields(frame_id='part'), poses=[Fields(position=point, orientation=turn)]
    )
    found = import_message(message)
    assert poses(found)[0].tolist() == [0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0]
    assert found.goal.frame_id == 'part'


@pytest.mark.parametrize('term', TERMS.values(), ids=TERMS)
@pytest.mark.parametrize('flow_style', [False, True])
def test_each_term_is_treated_as_the_table_says(tmp_path, term, flow_style):
    if term.name in FIELDS:
        assert term.treatment is Treatment.LEFT_OUT
        name, field, change = FIELDS[term.name]
        messages = copy.deepcopy(MESSAGES[name])
        change(messages[0])
        said = remarks(imported(tmp_path, echo(*messages, flow_style=flow_style)))
        assert any(re.fullmatch(rf'lines? .*: {field}: {term.reason}', text) for text in said)
    elif term.name in HONOURED_FIELDS:
        name, holds = HONOURED_FIELDS[term.name]
        assert holds(imported(tmp_path, echo(*MESSAGES[name], flow_style=flow_style)))
    elif term.treatment is Treatment.HONOURED:
        found = imported(tmp_path, echo(*MESSAGES[term.name], flow_style=flow_style))
        assert len(found.goal.waypoints) == 2
        if 'joint' not in echo(*MESSAGES[term.name]):
            assert poses(found)[:, 0].tolist() == [0.1, 0.2]
    else:
        sentence = f'^line 1: this is a {term.name}: {term.reason}'
        if 'MultiDOF' in term.name:
            sentence = sentence.replace('line 1', r'line \d+')
        with pytest.raises(BrokenFile, match=sentence):
            imported(tmp_path, echo(*MESSAGES[term.name], flow_style=flow_style))


def test_a_stream_of_poses_is_a_path(tmp_path):
    stream = [stamped(0.1 + 0.01 * i, sec=1_700_000_000 + i, frame='map') for i in range(5)]
    found = imported(tmp_path, echo(*stream))
    assert poses(found)[:, 0] == pytest.approx([0.1, 0.11, 0.12, 0.13, 0.14])
    assert found.goal.waypoints.times.tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert found.goal.frame_id == 'map'
    assert found.lines.tolist() == [1 + 16 * i for i in range(5)]


@pytest.mark.parametrize('kept', [0.02, 0.3, 0.6, 0.9, 0.99])
def test_a_stream_that_was_cut_off_ends_with_its_last_whole_message(tmp_path, kept):
    whole = echo(stamped(0.1, 1), stamped(0.2, 2))
    last = echo(stamped(0.3, 3)).removesuffix('---\n')
    found = imported(tmp_path, whole + last[: int(kept * len(last))])
    assert poses(found)[:, 0].tolist() == [0.1, 0.2]
    assert 'line 33: the last message: it is cut off' in remarks(found)


def test_a_broken_message_within_a_stream_refuses_it(tmp_path):
    text = echo(stamped(0.1, 1), stamped(0.2, 2), stamped(0.3, 3))
    with pytest.raises(BrokenFile, match=r'^line 24: the field z is missing'):
        imported(
            tmp_path,
            text.replace('    z: 0.3\n', '', 2).replace('y: 0.2\n', 'y: 0.2\n    z: 0\n', 1),
        )


def test_messages_of_another_kind_are_said(tmp_path):
    found = imported(tmp_path, echo(stamped(0.1), TWIST, stamped(0.2)))
    assert len(found.goal.waypoints) == 2
    assert 'line 17: another message: it is no pose as the first one is' in remarks(found)
    path = MESSAGES['nav_msgs/Path'][0]
    found = imported(tmp_path, '---\n' + echo(path, path))
    assert 'line 39: another message: only the first one of a file is read' in remarks(found)
    assert found.lines.tolist() == [8, 23]


def test_a_message_that_echo_has_lost_is_said(tmp_path):
    lost = 'A message was lost!!!\n\ttotal count change:1\n\ttotal count: 1---\n'
    found = imported(tmp_path, echo(stamped(0.1)) + lost + echo(stamped(0.2)))
    assert poses(found)[:, 0].tolist() == [0.1, 0.2]
    assert found.lines.tolist() == [1, 20]
    assert 'line 17: a message: ros2 topic echo has lost it' in remarks(found)


#: As rostopic echo of ROS 1 prints a Path: other indents and names, a sequence number, and a blank
#: behind each colon.
ROS_1_POSE = """  -
    header:
      seq: 3
      stamp:
        secs: {secs}
        nsecs: 500000000
      frame_id: ''
    pose:
      position:
        x: {x}
        y: -1e-05
        z: 0.25
      orientation:
        x: 0.0
        y: 6e-01
        z: 0.0
        w: 8e-01
"""
ROS_1 = (
    'header:\n  seq: 12\n  stamp:\n    secs: 0\n    nsecs:         0\n  frame_id: "map"\nposes:\n'
    + ROS_1_POSE.format(x=1e-05, secs=5)
    + ROS_1_POSE.format(x=0.2, secs=6)
).replace(':\n', ': \n')


def test_a_path_of_ros_1(tmp_path):
    found = imported(tmp_path, ROS_1 + '---\n')
    assert poses(found)[:, :3].tolist() == [[1e-05, -1e-05, 0.25], [0.2, -1e-05, 0.25]]
    assert poses(found)[0, 3:] == pytest.approx([0.0, 0.6, 0.0, 0.8])
    assert found.goal.waypoints.times.tolist() == [0.0, 1.0]
    assert found.goal.frame_id == 'map'
    assert 'lines 2, 10, 27: seq: a goal has no such field' in remarks(found)


@pytest.mark.parametrize('name', ['_x', '__class__', 'line', 'fields', '5', 'a b'])
def test_a_field_with_a_strange_name_is_said(tmp_path, name):
    found = imported(tmp_path, echo({**stamped(0.1), name: 1.5}))
    assert f'line 16: {name}: a path has no such field' in remarks(found)


def test_a_joint_trajectory_with_one_point_keeps_its_time(tmp_path):
    goal = imported(tmp_path, echo(joint_trajectory(times=(2,)))).goal
    assert goal.waypoints.times.tolist() == [2.5]
    assert goal.waypoints.postures[0].values == pytest.approx([value + 0.2 for value in HOME])


@pytest.mark.parametrize(
    ('options', 'sentence'),
    [
        ({'frame': 'part'}, 'joint positions have no frame; give no frame, tool, origin or scale'),
        ({'scale': 2.0}, 'joint positions have no frame; give no frame, tool, origin or scale'),
    ],
)
def test_joint_positions_have_no_frame(tmp_path, options, sentence):
    with pytest.raises(BrokenFile, match=f'^line 1: {sentence}'):
        imported(tmp_path, echo(joint_trajectory()), **options)


def test_a_frame_that_changes_is_refused(tmp_path):
    path = {'header': header(), 'poses': [stamped(0.1), stamped(0.2, frame='part')]}
    with pytest.raises(
        BrokenFile, match=r"^line 22: its frame is 'part', but the path is in 'base'"
    ):
        imported(tmp_path, echo(path))
    with pytest.raises(
        BrokenFile, match=r"^line 17: its frame is 'part', but the path is in 'base'"
    ):
        imported(tmp_path, echo(stamped(0.1), stamped(0.2, frame='part')))


@pytest.mark.parametrize(
    ('change', 'sentence'),
    [
        (
            lambda text: text.replace('\n---', "\n- '...'\n---"),
            'line 37: poses goes on, but ros2 topic echo has cut it; echo it with --full-length.',
        ),
        (
            lambda text: (
                text.split('poses:')[0]
                + "poses: '<sequence type: geometry_msgs/msg/PoseStamped, length: 2>'\n"
            ),
            'line 6: poses was not printed; echo it without --no-arr.',
        ),
        (lambda text: text.replace('x: 0.2', 'x: .nan'), "line 29: x is '.nan', but must be a"),
        (lambda text: text.replace('x: 0.2', 'x: -.inf'), "line 29: x is '-.inf', but must be a"),
        (lambda text: text.replace('x: 0.2', 'x: nan'), "line 29: x is 'nan', but must be a"),
        (lambda text: text.replace('x: 0.2', 'x:'), "line 29: x is '', but must be a finite"),
        (lambda text: text.replace('x: 0.2', "x: '0.2'"), "line 29: x is '0.2', but must be"),
        (lambda text: text.replace('x: 0.2', 'y: 0.2'), "line 30: the field 'y' occurs twice."),
        (lambda text: text.replace('x: 0.2', 'x: *x'), 'line 29: a message has no references (*)'),
        (
            lambda text: text.replace('x: 0.2', 'x: &a 0.2\n      k: *a'),
            'line 30: a message has no references (*)',
        ),
        (
            lambda text: text.replace('  position:\n', '  position:\n\t'),
            'line 14: the line is indented with a tab',
        ),
        (
            lambda text: text.replace('x: 0.2', 'x: \x07'),
            "line 29: the character '\\x07' is not allowed",
        ),
        (
            lambda text: text.replace('x: 0.2', 'x: [1]'),
            'line 29: x is none, but must be a finite',
        ),
        (lambda text: text[: text.index('orientation')], 'line 13: the field orientation is'),
        (
            lambda text: text[: text.index('orientation') + 5],
            'line 17: the text is not output of ros2',
        ),
        (
            lambda text: text.replace(' sec: 2', ' sec: two'),
            "line 24: sec is 'two', but must be a",
        ),
        (
            lambda text: text.replace('frame_id: base', 'frame_id: [a]'),
            'line 5: frame_id is no text',
        ),
        (
            lambda text: text.replace('frame_id: base', 'frame_id: 5'),
            'line 5: frame_id is no text; put it into quotes.',
        ),
        (lambda text: '- ' * 60 + 'a\n', 'line 1: it is nested too deeply.'),
        (lambda text: '{' * 60, 'line 1: '),
        (lambda text: '? [a]\n: 1\n', 'line 1: a field has no name.'),
        (lambda text: "'': 1\n", 'line 1: a field has no name.'),
        (lambda text: 'poses: 5\n', 'line 1: poses is no list.'),
        (lambda text: 'poses: [5]\n', 'line 1: a mapping of position, orientation is missing.'),
        (
            lambda text: 'header: 5\nposes: []\n',
            'line 1: a mapping of stamp, frame_id is missing.',
        ),
        (lambda text: '\n\n5\n', 'line 3: the text is not a message: it has no fields.'),
        (lambda text: 'a: 1\n--- {b: 2}\n', 'line 1: two messages follow each other'),
        (lambda text: '---\n---\n', 'the file is empty; ros2 topic echo prints messages into it.'),
    ],
)
def test_a_message_that_cannot_be_read_is_said_in_words_of_messages(tmp_path, change, sentence):
    text = change(echo(*MESSAGES['nav_msgs/Path']))
    with pytest.raises(BrokenFile) as caught:
        imported(tmp_path, text)
    assert str(caught.value).startswith(sentence)
    assert 'YAML' not in str(caught.value)


def test_characters_that_yaml_counts_as_line_ends_shift_no_line(tmp_path):
    text = echo(*MESSAGES['nav_msgs/Path']).replace(
        'frame_id: base', "frame_id: 'a\u2028b\x85c'", 1
    )
    text = text.replace('frame_id: base', "frame_id: ''").replace('x: 0.2', 'x: far')
    with pytest.raises(BrokenFile, match=r"^line 29: x is 'far'"):
        imported(tmp_path, text)


@pytest.mark.random
def test_random_messages_are_read_as_pyyaml_reads_them(tmp_path):
    """PyYAML's own loader, and a walk through its dicts, is the judge."""
    points = 0
    for i in range(cases(1000)):
        random = random_of('messages', i)
        quaternions = random.random() < 0.5
        items: list[dict] = [
            {
                'position': {axis: random.uniform(-1, 1) for axis in 'xyz'},
                'orientation': dict(
                    zip('xyzw', (0.6, 0.0, 0.0, 0.8) if quaternions else (0, 0, 0, 0), strict=True)
                ),
            }
            for _ in range(random.randint(1, 8))
        ]
        if random.random() < 0.5:
            items = [{'header': header(5 + k), 'pose': item} for k, item in enumerate(items)]
        messages = items if random.random() < 0.5 else [{'header': header(), 'poses': items}]
        text = echo(*messages, flow_style=random.random() < 0.3)
        documents = [m for m in yaml.safe_load_all(text) if m is not None]
        listed = documents[0].get('poses', documents)
        expected = [
            [float(item.get('pose', item)['position'][axis]) for axis in 'xyz'] for item in listed
        ]
        found = imported(tmp_path, text)
        assert poses(found)[:, :3].tolist() == expected
        points += len(expected)
    assert points > cases(1000) * 2


@pytest.mark.random
def test_broken_messages_become_goals_or_sentences(tmp_path):
    file = tmp_path / 'a.yaml'
    files = [
        PATH,
        ARRAY,
        JOINTS,
        ROS_1,
        echo(*MESSAGES['geometry_msgs/PoseStamped']),
        echo(*MESSAGES['moveit_msgs/DisplayTrajectory']),
        echo(*MESSAGES['nav_msgs/Odometry'], flow_style=True),
    ]
    goals = sentences = 0
    for i in range(cases(10_000)):
        text = broken(files, random_of('broken messages', i))
        found = goal_or_sentence(file, text)
        if isinstance(found, str):
            sentences += 1
            continue
        goals += 1
        # Each coordinate of a goal is a number in the text, unless FK makes it from joints.
        if not found.goal.waypoints.postures:
            numbers = {float(n) for n in re.findall(r'[-+.\deE]+', text) if is_number(n)}
            assert set(poses(found)[:, :3].ravel().tolist()) <= numbers
    assert goals > cases(10_000) // 20
    assert sentences > cases(10_000) // 2


def is_number(text):
    try:
        float(text)
    except ValueError:
        return False
    return True


@pytest.mark.parametrize(
    ('text', 'line', 'part'),
    [
        ('', 0, 'the file is empty'),
        ('- 1\n', 1, 'not a message'),
        ('a: [1\nb: 2\n', 2, 'not output of ros2 topic echo, or is cut off'),
        ('a: 1\n', 1, 'neither a Path'),
        (PATH.replace('x: 0.2', 'x: far'), 29, "'far'"),
        (PATH.replace('      z: 0.0\n    or', '    or', 1), 14, 'field z is missing'),
        (PATH.replace('y: 1.0', 'y: 3.0', 1), 7, 'length 3'),
        (JOINTS.replace('left_elbow', 'left_knee'), 7, 'has 0 of elbow_joint'),
        (JOINTS.replace('  - 0.1\n', '', 1), 14, '5 positions'),
        (HEADER + 'poses: []\n', 0, 'no point'),
    ],
)
def test_a_broken_file_is_one_sentence_with_its_line(tmp_path, text, line, part):
    with pytest.raises(BrokenFile, match=part) as caught:
        imported(tmp_path, text)
    assert caught.value.line == line
    assert '\n' not in str(caught.value)


def test_a_speed_leaves_joint_motions_their_times(tmp_path):
    text, _, _ = straight_line_of_joints(4)
    found = imported(tmp_path, text, speed=0.1)
    assert found.goal.waypoints.times[[0, -1]].tolist() == [1.0, 3.0]
    assert 'the option speed: left out, because joint motions have none' in [
        remark.text() for remark in found.remarks
    ]
    assert not imported(tmp_path, text, speed=0.1, lines=True).goal.waypoints.times.any()
