# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
import re

import pytest

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.goal_files import GoalFileError
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.goal.goal import OutputKind
from ur_cartesian_driver.motion.goal.leads import Lead
from ur_cartesian_driver.ros.client import apply_leads, load_goal


def test_a_goal_reads_as_in_ros2_action_send_goal():
    goal = load_goal(
        '{trajectory: {header: {frame_id: base}, points: [{time_from_start: '
        '{sec: 2}, pose: {position: {x: -0.4, y: 1, z: 1e-3}}, posture: '
        '{posture_joint_names: [elbow_joint], posture_joint_values: [1.5]}}]}, '
        'segments: [{type: 2}], validate_only: true}'
    )
    (point,) = goal.trajectory.points
    assert goal.trajectory.header.frame_id == 'base'
    assert point.time_from_start.sec == 2
    assert (point.pose.position.x, point.pose.position.y, point.pose.position.z) == (-0.4, 1, 1e-3)
    assert list(point.posture.posture_joint_values) == [1.5]
    assert goal.segments[0].type == 2
    assert goal.validate_only


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        ('\n' + '[' * 101, 'line 2: this is nested more than 100 times, too deeply for a goal.'),
        # Newer parsers read this far ahead, and refuse it themselves.
        ('[' * 100_000, ('line 1: this is nested more than 100 times', 'this is not YAML: ')),
        ('a:\n ' + '{a: ' * 100_000, ('line 2: this is nested more', 'this is not YAML: ')),
        ('trajectory: &a {points: [*a]}', 'trajectory.points[0].points is not a field'),
        ('trajectory: {header: {frame_id: 2026-99-99}}', 'a value cannot be read: '),
        ('trajectory: {header: {frame_id: !!int x}}', 'a value cannot be read: '),
        ('trajectory: {points: [', 'this is not YAML: '),
    ],
)
def test_a_text_that_yaml_chokes_on_is_one_sentence(text, sentence):
    with pytest.raises(GoalFileError) as error:
        load_goal(text)
    assert str(error.value).startswith(sentence)
    assert str(error.value).endswith(('.', '?'))
    assert '\n' not in str(error.value)


def test_fields_that_are_not_named_keep_their_defaults():
    (point,) = load_goal('trajectory: {points: [{}]}').trajectory.points
    assert point.pose.orientation.w == 1.0


def test_leads_become_negative_offsets():
    goal = load_goal(
        'io_commands: [{output: 0, pin: 2, value: 1.0, lead: valve_1}, {output: 0, pin: 2}]'
    )
    lead = Lead(name='valve_1', output=OutputKind.STANDARD_DIGITAL, pin=2, open=0.06, close=0.035)
    opens, other = apply_leads(goal, (lead,), 'leads.yaml').io_commands
    assert (opens.lead, opens.offset.sec, opens.offset.nanosec) == ('', -1, 940_000_000)
    assert (other.lead, other.offset.sec, other.offset.nanosec) == ('', 0, 0)
    goal.io_commands[0].lead = 'valve_2'
    with pytest.raises(InvalidGoal, match=r'leads\.yaml has only valve_1'):
        apply_leads(goal, (lead,), 'leads.yaml')


@pytest.mark.parametrize('text', ['', '{}', '# nothing'])
def test_an_empty_text_is_an_empty_goal(text):
    assert load_goal(text) == FollowCartesianTrajectory.Goal()


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        (
            'trajectory: {points: [{}, {pose: {positon: {}}}]}',
            'trajectory.points[1].pose.positon is not a field; did you mean position?',
        ),
        (
            'trajectory: {points: [{}, {pose: {place: {}}}]}',
            'trajectory.points[1].pose.place is not a field; trajectory.points[1].pose '
            'has position, orientation.',
        ),
        (
            'trajectry: {}',
            'trajectry is not a field; did you mean trajectory?',
        ),
        (
            'goal: {}',
            'goal is not a field; a goal has trajectory, path_tolerance,',
        ),
        ('trajectory: {points: {}}', 'trajectory.points is {}, but must be a list.'),
        (
            'trajectory: {points: [1]}',
            'trajectory.points[0] is 1, but must be a mapping of fields.',
        ),
        (
            'trajectory: {header: {frame_id: 1}}',
            'trajectory.header.frame_id is 1, but must be a text; put it in quotes.',
        ),
        (
            'trajectory: {points: [{pose: {position: {x: left}}}]}',
            "trajectory.points[0].pose.position.x is 'left', but must be a number.",
        ),
        (
            'trajectory: {points: [{pose: {position: {x: true}}}]}',
            'trajectory.points[0].pose.position.x is True, but must be a number.',
        ),
        ('execution: 300', 'execution is 300, but must be a whole number from 0 to 255.'),
        (
            'execution: servo',
            "execution is 'servo', but must be a whole number from 0 to 255; SERVO is 3.",
        ),
        (
            'goal_time_tolerance: {sec: 0.5}',
            'goal_time_tolerance.sec is 0.5, but must be a whole number from -2147483648 to '
            '2147483647.',
        ),
        ('validate_only: 1', 'validate_only is 1, but must be true or false.'),
        ('[1, 2]', 'the goal is [1, 2], but must be a mapping of fields.'),
        ('{trajectory: ', 'this is not YAML: '),
    ],
)
def test_what_does_not_fit_is_named_by_its_key(text, sentence):
    with pytest.raises(GoalFileError, match='^' + re.escape(sentence)):
        load_goal(text)


def test_the_name_of_the_file_is_said(tmp_path):
    path = tmp_path / 'goal.yaml'
    path.write_text('points: []')
    with pytest.raises(GoalFileError, match=re.escape(f'{path}: points is not a field')):
        load_goal(path)
