# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals and plans are plain immutable values, with the numbers of the interfaces."""

from dataclasses import FrozenInstanceError, replace
import pickle
import re

import numpy as np
import pytest

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import Outcome
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    ArcMode,
    Goal,
    OutputKind,
    Posture,
    Segment,
    SegmentType,
    Tolerance,
    Waypoint,
)
from ur_cartesian_driver.motion.plan.plan import Plan, PlannedSegment, ReferencePath
from ur_cartesian_driver.motion.plan.primitive import MoveL
from ur_cartesian_driver.resources import share_path

ZEROS = (0.0,) * 6


def reference(m=3, poses=None, point=None, time=None):
    return ReferencePath(
        poses=np.zeros((m, 7)) if poses is None else poses,
        point=np.zeros(m, np.int32) if point is None else point,
        time=np.zeros(m) if time is None else time,
    )


def planned(waypoint, duration):
    return PlannedSegment(
        primitive=MoveL(target=IDENTITY),
        waypoint=waypoint,
        length=0.1,
        angle=0.0,
        duration=duration,
        joints=ZEROS,
        report_line=f'segment {waypoint}: MOVEL, 0.1 m',
    )


def goal(n=2):
    return Goal(waypoints=tuple(Waypoint(pose=IDENTITY) for _ in range(n)))


def plan():
    return Plan(
        goal=goal(),
        segments=(planned(0, 1.5), planned(1, 0.25)),
        reference=reference(),
        start=ZEROS,
        remarks=('jerk is ignored',),
    )


def constants_of(interface, prefix):
    """Read the constants ``uint8 PREFIX_NAME=1`` of a message or action file."""
    text = (share_path() / interface).read_text()
    return {
        name: int(value)
        for name, value in re.findall(rf'^\w+ {prefix}(\w+)\s*=\s*(-?\d+)', text, re.M)
    }


@pytest.mark.parametrize('value', [goal(), Posture(), Segment(), Tolerance(), planned(0, 1.0)])
def test_values_cannot_be_changed(value):
    field = next(iter(type(value).__dataclass_fields__))
    with pytest.raises(FrozenInstanceError):
        setattr(value, field, None)


def test_equal_goals_are_equal_and_travel():
    assert goal() == goal()
    assert goal() != goal(3)
    assert pickle.loads(pickle.dumps(goal())) == goal()
    assert hash(goal()) == hash(goal())


def test_a_goal_of_bare_poses_asks_for_nothing_special():
    plain = goal()
    assert plain.segments == ()
    assert plain.execution is ExecutionMode.AUTO
    assert plain.age is None
    assert not plain.keep_open
    assert not plain.waypoints[0].posture


@pytest.mark.parametrize('posture', [Posture(names=('elbow_joint',)), Posture(values=(1.0,))])
def test_a_malformed_posture_still_is_a_preference(posture):
    assert posture


@pytest.mark.parametrize(
    'wrong',
    [{'poses': np.zeros((3, 6))}, {'point': np.zeros(2, np.int32)}, {'time': np.zeros((3, 1))}],
)
def test_a_path_of_unequal_columns_is_refused(wrong):
    with pytest.raises(ValueError, match='shapes differ'):
        reference(**wrong)


def test_a_path_cannot_be_written_to():
    path = reference()
    for array in (path.poses, path.point, path.time):
        assert not array.flags.writeable


def test_the_duration_of_a_plan_is_the_sum_of_its_segments():
    assert plan().duration == 1.75
    assert replace(plan(), segments=()).duration == 0


def test_the_report_has_a_line_for_each_segment_then_the_remarks():
    assert plan().report == (
        'segment 0: MOVEL, 0.1 m',
        'segment 1: MOVEL, 0.1 m',
        'jerk is ignored',
    )


@pytest.mark.parametrize('code', ErrorCode)
def test_only_success_is_a_success(code):
    assert Outcome(code=code, text='').succeeded == (code == 0)


@pytest.mark.parametrize(
    ('interface', 'enum', 'prefix'),
    [
        ('msg/MotionSegment.msg', SegmentType, ''),
        ('msg/MotionSegment.msg', ArcMode, 'ARC_'),
        ('msg/IOCommand.msg', OutputKind, ''),
        ('action/FollowCartesianTrajectory.action', ExecutionMode, 'EXECUTION_'),
        ('action/FollowCartesianTrajectory.action', ErrorCode, ''),
    ],
)
def test_the_numbers_are_those_of_the_interfaces(interface, enum, prefix):
    constants = constants_of(interface, prefix)
    assert {member.name: member.value for member in enum}.items() <= constants.items()
