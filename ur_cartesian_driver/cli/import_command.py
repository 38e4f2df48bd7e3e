# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``ur-cartesian import``: make a goal file from a file of another format."""

from __future__ import annotations

import argparse
from pathlib import Path
import sys

from ur_cartesian_driver.cli.progress import timed
from ur_cartesian_driver.goal_files import fields_of_goal, goal_text
from ur_cartesian_driver.importing import (
    BrokenFile,
    FORMATS,
    import_file,
    ImportOptions,
    ToolOrientation,
)
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.sim.command_line.simulate import calibration
from ur_cartesian_driver.sim.command_line.simulator_options import fields_from

__all__ = ['FORMATS', 'import_goal', 'options_of']

#: Goals with at least this many points are written in flat arrays.
MANY_POINTS = 200


def import_goal(arguments: argparse.Namespace) -> int:
    """Convert a file to a goal, and print the remarks."""
    try:
        with timed('importing'):
            imported = import_file(arguments.file, options_of(arguments), arguments.format)
            goal = imported.goal
            text = goal_text(fields_of_goal(goal, packed=len(goal.waypoints) >= MANY_POINTS))
    except (BrokenFile, ImportError) as error:
        raise ValueError(f'{arguments.file}: {error}') from None
    if arguments.output:
        Path(arguments.output).write_text(text, encoding='utf-8')
    else:
        print(text, end='')
    for remark in imported.remarks:
        print(remark.text(), file=sys.stderr)
    count = len(goal.waypoints)
    target = arguments.output or 'standard output'
    print(f'wrote {count} point{"s" * (count != 1)} to {target}', file=sys.stderr)
    return 0


def options_of(arguments: argparse.Namespace) -> ImportOptions:
    """Return the options of a command line."""
    model = robot_model(arguments.ur_type)
    fields = fields_from(arguments, ImportOptions) | {
        'origin': arguments.origin or IDENTITY,
        'orientation': ToolOrientation(arguments.orientation),
        'tolerance': max(arguments.tolerance, 1e-6),
        'outputs': dict(arguments.output_of),
        'arm': Arm(model, calibration(arguments, model)),
        'T_flange_tcp': arguments.tcp or IDENTITY,
    }
    return ImportOptions(**fields)
