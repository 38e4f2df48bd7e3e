# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Goals as files: reads and writes the action's goals as YAML, without ROS.

The fields are named as in the messages, so the same code reads files and messages.
"""

from ur_cartesian_driver.goal_files.goal_file import goal_text, GoalFileError, read_goal_file
from ur_cartesian_driver.goal_files.goal_reading import goal_from_fields
from ur_cartesian_driver.goal_files.goal_writing import fields_of_goal

__all__ = ['GoalFileError', 'fields_of_goal', 'goal_from_fields', 'goal_text', 'read_goal_file']
