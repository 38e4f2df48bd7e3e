# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Values of users are converted to the declared types, or refused by field and value."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.declared_types import with_declared_types, WrongType
from ur_cartesian_driver.motion.goal.goal import Goal, Posture, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.goal.goal_columns import goal_table

GOAL = Goal(
    waypoints=(Waypoint(time=1.0, pose=Pose((0.1, 0.2, 0.3))),),
    segments=(Segment(type=SegmentType.LINEAR),),
)


def of_user(value: Any) -> Any:
    """Return a value whose type no checker knows."""
    return value


def test_a_goal_of_numpy_numbers_and_arrays_equals_one_of_floats():
    given = Goal(
        waypoints=of_user(
            [
                Waypoint(
                    time=np.float64(1.0),
                    pose=Pose(
                        *of_user((np.array([0.1, 0.2, 0.3]), [np.int64(0), 0, 0, np.float32(1.0)]))
                    ),
                    twist=of_user(np.zeros(6, dtype=np.float32)),
                )
            ]
        ),
        segments=of_user(np.array([Segment(type=of_user(np.int8(1)))])),
        keep_open=of_user(np.bool_(False)),
    )
    plain = goal_table(given)
    assert plain == goal_table(GOAL)
    assert {type(value) for value in plain.waypoints[0].pose.row()} == {float}
    assert type(plain.waypoints[0].time) is float
    assert type(plain.segments[0].type) is SegmentType


def test_the_arrays_of_a_posture_are_its_tuples():
    posture = Posture(names=of_user(np.array(['elbow_joint'])), values=of_user(np.array([1.5])))
    table = goal_table(replace(GOAL, waypoints=(replace(GOAL.waypoints[0], posture=posture),)))
    assert table.waypoints.postures[0] == Posture(names=('elbow_joint',), values=(1.5,))


def test_plain_values_are_not_copied():
    assert with_declared_types(GOAL, Goal, 'goal') is GOAL


def test_a_class_of_the_user_becomes_the_one_that_the_robot_process_has():
    class MyPose(Pose):
        pass

    plain = with_declared_types(MyPose((0, 1, 2)), Pose, 'pose')
    assert type(plain) is Pose
    assert plain == Pose((0.0, 1.0, 2.0))


@pytest.mark.parametrize(
    ('field', 'value', 'sentence'),
    [
        ('time', 'soon', r"Goal\.waypoints\[0\]\.time is 'soon', which is no number\."),
        ('time', True, r'time is True, which is no number'),
        ('time', None, r'time is None, which is no number'),
        ('time', 1 << 2000, r'time is too large a number'),
        ('pose', (0.1, 0.2, 0.3), r'pose is \(0\.1, 0\.2, 0\.3\), which is no Pose'),
        ('twist', (0.0, 0.0), r'twist has 2 values, but needs 6'),
        ('twist', (0.0,) * 5 + ('x',), r"twist\[5\] is 'x', which is no number"),
        ('twist', 'xxxxxx', r"twist is 'xxxxxx', which is no sequence"),
        ('pose', Pose(of_user((0.1, 0.2, 1j))), r'pose\.position\[2\] is 1j, which is no number'),
    ],
)
def test_a_wrong_value_is_refused_by_name(field, value, sentence):
    goal = replace(GOAL, waypoints=(replace(GOAL.waypoints[0], **{field: value}),))
    with pytest.raises(WrongType, match=sentence):
        goal_table(goal)
