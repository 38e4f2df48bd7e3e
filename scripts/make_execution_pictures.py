# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Draw the pictures of doc/execution.md from recordings of the goals that the page shows.

Simulated controller and robot loop run in virtual time, so the pictures are the same each time but
for the date in their titles, which is left out::

    python scripts/make_execution_pictures.py [NAME ...]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
import sys
import tempfile
from typing import Any

CHECKOUT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(CHECKOUT / 'test' / 'support'))

#: So many colours are enough for lines, and make a picture a quarter as large.
COLOURS = 64


@dataclass(frozen=True, kw_only=True)
class Picture:
    """A goal, what happens to it, and what the picture is called."""

    goal: str
    title: str
    #: As on the command line of ``ur-cartesian sim``.
    faults: Sequence[str] = ()
    #: Instead of the goal's own.
    execution: str = ''


PICTURES = {
    'primitives': Picture(
        goal='seam', faults=('slider 0.5 at 0.6 m', 'slider 1 at 0.7 m'),
        title='Lines, an arc and blends (PRIMITIVES); the speed slider at 50 % for a while'),
    'spline': Picture(
        goal='figure_eight',
        title='A figure eight with times and twists (SPLINE): no stop, no corner'),
}


def record(picture: Picture, directory: Path) -> Path:
    """Run the goal of a picture and return its recording."""
    from robot_cell import run_cell

    from ur_cartesian_driver.cli.commands import goal_file
    from ur_cartesian_driver.kinematics.chain import Arm
    from ur_cartesian_driver.kinematics.robots import robot_model
    from ur_cartesian_driver.motion.goal import ExecutionMode
    from ur_cartesian_driver.planning import plan, PlanningOptions
    from ur_cartesian_driver.ros.client import load_goal
    from ur_cartesian_driver.ros.convert import goal_from_message
    from ur_cartesian_driver.ros.frames import Frames, Stand
    from ur_cartesian_driver.sim.fault_text import parse_fault

    async def scenario(cell: Any) -> None:
        state = cell.memory.read()
        goal = goal_from_message(load_goal(goal_file(picture.goal)), Frames(), now=0,
                                 stand=Stand.of(state))
        if picture.execution:
            goal = replace(goal, execution=ExecutionMode[picture.execution])
        cell.robot.inject(*map(parse_fault, picture.faults))
        motion = cell.owner.start(plan(
            goal, state, Arm(robot_model(cell.robot.config.model)), PlanningOptions()))
        await cell.until(lambda: motion.outcome is not None, 120.0)
        assert motion.outcome.succeeded, motion.outcome

    run_cell(scenario, record_directory=str(directory))
    (file,) = directory.glob('*.npz')
    return file


def draw(name: str) -> Path:
    """Record and draw; return the file of the picture."""
    from PIL import Image

    from ur_cartesian_driver.cli import plot
    from ur_cartesian_driver.driver.recording import Recording

    drawing = CHECKOUT / 'doc' / f'execution_{name}.png'
    with tempfile.TemporaryDirectory() as directory:
        recording = Recording.load(record(PICTURES[name], Path(directory)))
    plot.draw(recording, drawing, title=PICTURES[name].title)
    with Image.open(drawing) as image:
        image.convert('RGB').quantize(COLOURS).save(drawing, optimize=True)
    return drawing


if __name__ == '__main__':
    for wanted in sys.argv[1:] or PICTURES:
        path = draw(wanted)
        sys.stdout.write(f'{path}: {path.stat().st_size / 1000:.0f} kB\n')
