# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Draw pictures of plans for doc/free_axis.md and doc/execution.md.

::

    python scripts/make_path_pictures.py
"""

from __future__ import annotations

from pathlib import Path
import sys
from typing import Any

from matplotlib.figure import Figure
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from ur_cartesian_driver.cli.commands import goal_file
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.pose import IDENTITY, rotate
from ur_cartesian_driver.motion.robot_state import RobotState
from ur_cartesian_driver.path import mm, PathPlace
from ur_cartesian_driver.path import Path as ToolPath
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest

DOC = Path(__file__).resolve().parents[1] / 'doc'
ARM = Arm(robot_model('ur5e'))
HOME = (0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0)
#: Enough for lines, and the file is a third as large.
COLOURS = 64
GREY, RED, BLUE = '#bbbbbb', '#c83c32', '#1e6edc'


def robot() -> RobotState:
    """Return the state of a ur5e at home."""
    return state_at_rest(ARM, HOME, IDENTITY)


def places(path: ToolPath) -> NDArray[np.float64]:
    """Return where the tool goes (n, 3) [mm]."""
    return 1e3 * plan(path.goal(), robot(), ARM, PlanningOptions()).reference.poses[:, :3]


def draw_free_axis() -> Figure:
    """Draw the axis x of the tool around a pipe: as given, and as chosen."""
    goal = ToolPath.load(goal_file('round_pipe')).goal()
    chosen = plan(goal, robot(), ARM, PlanningOptions()).goal
    figure = Figure(figsize=(10, 4.2), layout='constrained')
    left, right = figure.subplots(1, 2, width_ratios=(1, 1.3))
    turns = []
    for points, colour, label in (
        (goal.waypoints, GREY, 'as given'),
        (chosen.waypoints, RED, 'as chosen'),
    ):
        seam = [point.pose for point in points[:-1]]
        x = 1e3 * np.array([pose.position[:2] for pose in seam])
        ahead = np.array([rotate(pose.quaternion, (1.0, 0.0, 0.0))[:2] for pose in seam])
        left.quiver(*x.T, *ahead.T, color=colour, label=label, width=0.006, scale=9.0)
        turns.append(np.degrees(np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))))
    left.plot(*x.T, color='black', linewidth=1.0)
    left.set(aspect='equal', xlabel='x [mm]', ylabel='y [mm]', title='axis x of the tool')
    left.margins(0.25)
    left.legend(loc='center')
    for turn, colour, label in zip(turns, (GREY, RED), ('as given', 'as chosen'), strict=True):
        right.plot(turn - turn[0], color=colour, label=label, marker='.')
    right.set(xlabel='point', ylabel='[°]', title='turned since the first point')
    right.grid(alpha=0.3)
    right.legend()
    return figure


def draw_taken_up_again() -> Figure:
    """Draw a seam that was stopped, and the goal that is left of it."""
    seam = ToolPath.load(goal_file('seam'))
    stopped = PathPlace(point=4, fraction=0.5)
    whole = plan(seam.goal(), robot(), ARM, PlanningOptions())
    row = whole.reference
    done = (row.point < stopped.point) | (
        (row.point == stopped.point) & (row.fraction <= stopped.fraction)
    )
    first = 1e3 * row.poses[done, :3]
    rest = places(seam.resumed(stopped, overlap=mm(20), approach=mm(40)))
    figure = Figure(figsize=(10, 4.2), layout='constrained')
    above, aside = figure.subplots(1, 2)
    for axes, (i, j), names in ((above, (0, 1), 'xy'), (aside, (1, 2), 'yz')):
        whole_path = 1e3 * row.poses[:, :3]
        axes.plot(whole_path[:, i], whole_path[:, j], color=GREY, linewidth=5, label='the goal')
        axes.plot(first[:, i], first[:, j], color=BLUE, label='done until it was stopped')
        axes.plot(rest[:, i], rest[:, j], color=RED, linestyle='--', label='goal that is left')
        axes.plot(first[-1, i], first[-1, j], 'x', color='black', label='stopped')
        axes.set(aspect='equal', xlabel=f'{names[0]} [mm]', ylabel=f'{names[1]} [mm]')
        axes.grid(alpha=0.3)
    figure.legend(*above.get_legend_handles_labels(), loc='outside upper center', ncols=4)
    return figure


PICTURES: dict[str, Any] = {
    'free_axis': draw_free_axis,
    'execution_taken_up_again': draw_taken_up_again,
}

if __name__ == '__main__':
    for name, draw in PICTURES.items():
        draw().savefig(DOC / f'{name}.png', dpi=90, metadata={'Software': None})
        with Image.open(DOC / f'{name}.png') as image:
            image.convert('RGB').quantize(COLOURS).save(DOC / f'{name}.png', optimize=True)
        sys.stdout.write(f'{name}.png: {(DOC / f"{name}.png").stat().st_size / 1000:.0f} kB\n')
