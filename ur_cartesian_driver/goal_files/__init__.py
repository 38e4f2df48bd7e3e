# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Goals as files: the YAML of the action, read and written without ROS.

The fields are those of the messages. So what reads a file also reads a message.
"""

from ur_cartesian_driver.goal_files.goal_file import goal_text, GoalFileError, read_goal_file
from ur_cartesian_driver.goal_files.goal_reading import goal_from_fields
from ur_cartesian_driver.goal_files.goal_writing import fields_of_goal

__all__ = ['GoalFileError', 'fields_of_goal', 'goal_from_fields', 'goal_text', 'read_goal_file']
