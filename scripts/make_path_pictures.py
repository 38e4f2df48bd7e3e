# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Draw pictures of plans for doc/free_axis.md, doc/execution.md and doc/moveit.md.

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
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, robot_model
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, rotate
from ur_cartesian_driver.motion.goal.joint_goal import JointGoal, JointPoint
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.path import mm, PathPlace
from ur_cartesian_driver.path import Path as ToolPath
from ur_cartesian_driver.planning import plan, plan_joint_goal, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest

DOC = Path(__file__).resolve().parents[1] / 'doc'
ARM = Arm(robot_model('ur5e'))
HOME = (0.0, -np.pi / 2, np.pi / 2, -np.pi / 2, -np.pi / 2, 0.0)
#: Number of colours: enough for lines, and the file is a third as large.
COLOURS = 64
GREY, RED, BLUE = '#bbbbbb', '#c83c32', '#1e6edc'


def robot() -> RobotState:
    """Return the state of a UR5e at rest in HOME."""
    return state_at_rest(ARM, HOME, IDENTITY)


def places(path: ToolPath) -> NDArray[np.float64]:
    """Return the planned positions of the tool (n, 3) [mm]."""
    return 1e3 * plan(path.goal(), robot(), ARM, PlanningOptions()).reference.poses[:, :3]


def draw_free_axis() -> Figure:
    """Draw the axis x of the tool around a pipe: as given, and as chosen by the planner."""
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


def draw_resumed_seam() -> Figure:
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


def draw_moveit() -> Figure:
    """Draw the motion of a joint through points that have positions only."""
    state, times = robot(), (0.8, 1.6, 2.2, 3.0)
    turns = (0.1, 0.16, 0.1, 0.18)
    plan_of_joints = plan_joint_goal(
        JointGoal(
            joint_names=JOINT_NAMES,
            points=tuple(
                JointPoint(time=time, positions=(state.actual_q[0] + turn, *state.actual_q[1:]))
                for time, turn in zip(times, turns, strict=True)
            ),
        ),
        state,
        Arm(robot_model('ur5e')),
        PlanningOptions(max_tool_speed=1.0),
    )
    spline = plan_of_joints.joint_spline
    t = np.linspace(0.0, spline.duration, 400)
    q, qd, _ = spline.rows(t)
    x, y = np.append(0.0, times), np.append(0.0, turns)
    figure = Figure(figsize=(10, 3.2), layout='constrained')
    position, velocity = figure.subplots(1, 2)
    position.plot(x, y, color=GREY, linewidth=4, label='straight lines')
    position.plot(t, q[:, 0] - state.actual_q[0], color=BLUE, label='this driver')
    position.plot(x, y, 'o', color='black', label='points')
    velocity.step(
        x, np.append(np.diff(y) / np.diff(x), 0.0), where='post', color=GREY, linewidth=4
    )
    velocity.plot(t, qd[:, 0], color=BLUE)
    for axes, name in ((position, 'position [rad]'), (velocity, 'velocity [rad/s]')):
        axes.set(xlabel='time [s]', ylabel=name)
        axes.grid(alpha=0.3)
    figure.legend(*position.get_legend_handles_labels(), loc='outside upper center', ncols=3)
    return figure


PICTURES: dict[str, Any] = {
    'free_axis': draw_free_axis,
    'execution_resumed': draw_resumed_seam,
    'moveit': draw_moveit,
}

if __name__ == '__main__':
    for name, draw in PICTURES.items():
        draw().savefig(DOC / f'{name}.png', dpi=90, metadata={'Software': None})
        with Image.open(DOC / f'{name}.png') as image:
            image.convert('RGB').quantize(COLOURS).save(DOC / f'{name}.png', optimize=True)
        sys.stdout.write(f'{name}.png: {(DOC / f"{name}.png").stat().st_size / 1000:.0f} kB\n')
