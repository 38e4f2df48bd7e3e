# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals as files have the fields of the messages, and lose nothing."""

from dataclasses import replace
from importlib import import_module
import subprocess
import sys

import pytest
from rosidl_parser.definition import AbstractSequence, BasicType, NamespacedType
from tracked_files import tracked_files

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.goal_files import (
    fields_of_goal,
    goal_from_fields,
    goal_text,
    read_goal_file,
)
from ur_cartesian_driver.goal_files.goal_schema import GOAL, message_of, Whole, with_defaults
from ur_cartesian_driver.motion.goal.known_frames import Frames
from ur_cartesian_driver.resources import share_path
from ur_cartesian_driver.ros.messages.goal_conversion import goal_from_message

EXAMPLES = tracked_files(share_path() / 'config' / 'examples', '**/*.yaml')


def schema_of(kind):
    """Return the schema of a generated message."""
    default = kind()
    return {
        name: value_schema(slot, getattr(default, name))
        for name, slot in zip(kind.get_fields_and_field_types(), kind.SLOT_TYPES, strict=True)
    }


def value_schema(slot, default):
    if isinstance(slot, NamespacedType):
        return schema_of(getattr(import_module('.'.join(slot.namespaces)), slot.name))
    if isinstance(slot, AbstractSequence):
        inner = slot.value_type
        zero = {'double': 0.0, 'uint8': 0}.get(getattr(inner, 'typename', ''), '')
        return [value_schema(inner, zero)]
    if isinstance(slot, BasicType) and 'int' in slot.typename:
        assert default == 0
        bits = int(slot.typename.lstrip('uint'))
        sign = slot.typename[0] != 'u'
        return Whole(-(2 ** (bits - 1)) if sign else 0, 2 ** (bits - sign) - 1)
    return default


def test_the_schema_is_that_of_the_action():
    assert schema_of(FollowCartesianTrajectory.Goal) == GOAL


def test_the_fields_have_the_order_of_the_action():
    assert list(GOAL) == list(FollowCartesianTrajectory.Goal.get_fields_and_field_types())


@pytest.mark.parametrize('path', EXAMPLES, ids=lambda path: path.stem)
def test_a_goal_survives_file_and_message(path):
    goal = goal_from_fields(read_goal_file(path))
    fields = fields_of_goal(goal)
    assert goal_from_fields(read_goal_file(goal_text(fields))) == goal
    message = message_of(with_defaults(fields), FollowCartesianTrajectory.Goal)
    assert goal_from_fields(message) == goal
    if goal.frame_id in ('', 'base') and not goal.controlled_frame:
        assert goal_from_message(message, Frames(), now=0) == replace(goal, age=None)


def test_files_are_read_and_written_without_ros():
    lines = (
        'import sys',
        'from pathlib import Path',
        'from ur_cartesian_driver.goal_files import *',
        f'goal = goal_from_fields(read_goal_file(Path({str(EXAMPLES[0])!r})))',
        'goal_text(fields_of_goal(goal))',
        'print([name for name in sys.modules if name.startswith("rclpy")])',
    )
    ended = subprocess.run(
        [sys.executable, '-c', '\n'.join(lines)], capture_output=True, text=True, check=True
    )
    assert ended.stdout == '[]\n'
