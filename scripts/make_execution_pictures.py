# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Draw the pictures of the pages on goals from recordings of the goals that they show.

Simulated controller and robot loop run in virtual time, and the date is left out of the titles, so
that the pictures are the same each time::

    python scripts/make_execution_pictures.py [NAME ...]
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from math import nan
from pathlib import Path
import sys
import tempfile
from typing import Any

CHECKOUT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(CHECKOUT / 'test' / 'support'))

#: Cycle of the simulated controller, and time between two samples [s].
CYCLE = 0.008
#: Number of colours: enough for lines, and the file is a quarter as large.
COLOURS = 64


@dataclass(frozen=True, kw_only=True)
class Picture:
    """A scenario for a cell in virtual time, and the title of its picture."""

    title: str
    happens: Callable[[Any], Coroutine[None, None, Any]]


def a_goal(
    name: str, *faults: str, execution: str = '', input_after: float = nan, arm: Any = None
) -> Callable[[Any], Coroutine[None, None, Any]]:
    """
    Return the scenario that runs an example and returns its outcome.

    :param faults: as on the command line of ``ur-cartesian sim``.
    :param execution: name of the execution mode; empty = as in the file.
    :param input_after: time from the start until all digital inputs switch on [s]; NaN = never.
    :param arm: the ArmSetup, which is needed to offset the path.
    """

    async def happens(cell: Any) -> Any:
        import example_goals

        from ur_cartesian_driver.cli.commands import goal_file
        from ur_cartesian_driver.kinematics.chain import Arm
        from ur_cartesian_driver.kinematics.robot_models import robot_model
        from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
        from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
        from ur_cartesian_driver.planning import plan
        from ur_cartesian_driver.ros.client import load_goal
        from ur_cartesian_driver.ros.messages.goal_conversion import goal_from_message
        from ur_cartesian_driver.sim.faults.fault_parser import parse_fault

        state = cell.memory.read()
        goal = goal_from_message(
            load_goal(goal_file(name)), Frames(), now=0, snapshot=ArmSnapshot.of(state)
        )
        cell.robot.inject(*map(parse_fault, faults))
        if execution:
            goal = replace(goal, execution=ExecutionMode[execution])
        motion = cell.owner.start(
            plan(goal, state, Arm(robot_model(cell.robot.config.model)), example_goals.OPTIONS),
            arm=arm,
        )
        if input_after > 0.0:
            await cell.sleep(input_after)
            cell.robot.controller.io.digital_in.standard[:] = [True] * 8
        await cell.until(lambda: motion.outcome is not None, 120.0)
        return motion.outcome

    return happens


async def a_late_producer(cell: Any) -> Any:
    """Run a circle whose points are appended half a second ahead, once too late."""
    from append_goals import AppendMotion, circle

    from ur_cartesian_driver.motion.geometry.vectors import ZERO6
    from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
    from ur_cartesian_driver.motion.goal.goal import Goal

    home = cell.memory.read().actual_tcp_pose
    motion = AppendMotion(
        cell,
        Goal(waypoints=tuple(circle(home, 1, 10)), keep_open=True, execution=ExecutionMode.SPLINE),
    )

    def is_time_to_append(late: bool) -> bool:
        if not motion.motion.progress:
            return False
        return motion.progress.awaiting_points if late else motion.progress.time_remaining < 0.5

    while motion.points < 80:
        late = motion.points == 40
        await motion.until(partial(is_time_to_append, late))
        if late:
            await cell.sleep(0.6)
        points = circle(home, motion.points + 1, 10)
        last = motion.points == 70
        if last:
            points[-1] = replace(points[-1], time=points[-1].time + 0.1, twist=ZERO6)
        await motion.append(points, last=last)
    return await motion.ended()


async def a_replanner(cell: Any) -> Any:
    """Follow a circle on tails that are replaced ten times a second."""
    from append_goals import AppendMotion
    from replanner import Readings, replan, Replanner

    from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode

    home = cell.memory.read().actual_tcp_pose
    motion = AppendMotion(cell, Replanner(home).goal(ExecutionMode.SERVO))
    readings = Readings(cell, 20.0)
    await readings.connect()
    await replan(cell, motion, readings, 10.0, 6.0)
    return motion.outcome


async def a_press(cell: Any) -> list[tuple[float, ...]]:
    """Grind a part with a step, lower than the path; return rows of time, heights [mm], force."""
    from ur_cartesian_driver.sim.motion.contact.contact_bodies import ContactBody
    from ur_cartesian_driver.sim.rtde_output_values import COMPUTED

    controller, rows = cell.robot.controller, []
    x, y, z = cell.memory.read().actual_tcp_pose.position
    controller.contact.bodies = (
        ContactBody('plane', (x, y, z - 0.032), (0.0, 0.0, 1.0), friction=0.1),
        ContactBody('box', (x + 0.1, y + 0.1, z - 0.041), (0.12, 0.2, 0.02), friction=0.1),
    )
    running = asyncio.ensure_future(a_goal('grind')(cell))
    while not running.done():
        heights = controller.motion.T_base_tcp, controller.actual.T_base_tcp
        rows.append(
            (
                cell.loop.time(),
                *(1e3 * (pose.position[2] - z) for pose in heights),
                COMPUTED['actual_TCP_force'](controller)[2],
            )
        )
        await cell.sleep(CYCLE)
    assert running.result().succeeded, running.result()
    return rows


def draw_press() -> Path:
    """Draw how the tool gives way, and its force; return the file of the picture."""
    from matplotlib import pyplot
    import numpy as np
    from robot_cell import run_cell

    drawing = CHECKOUT / 'doc' / 'execution_press.png'
    time, path, tool, force = np.array(run_cell(a_press)).T
    figure, (heights, forces) = pyplot.subplots(2, 1, sharex=True, figsize=(9.0, 4.2))
    heights.plot(time - time[0], path, color='#9aa5b1', label='path of the program')
    heights.plot(time - time[0], tool, color='#c8372d', label='tool')
    heights.set(xlim=(1.0, 4.6), ylim=(-36.0, -24.0), ylabel='height [mm]')
    heights.legend(loc='upper center')
    heights.set_title('20 N on a part with a step, lower than the path (presses)')
    forces.plot(time - time[0], force, color='#1f77b4')
    forces.set_ylabel('force on the tool [N]')
    forces.set_xlabel('time [s]')
    figure.tight_layout()
    figure.savefig(drawing, dpi=100)
    compress(drawing)
    return drawing


async def a_tracked_seam(cell: Any, execution: str) -> list[tuple[float, ...]]:
    """Follow a seam that is bent by 5 mm; on the way back, the sensor jumps between two values."""
    from math import pi, sin

    from ur_cartesian_driver.driver.ipc.channel import ArmSetup, SetPathOffset
    from ur_cartesian_driver.kinematics.chain import Arm
    from ur_cartesian_driver.kinematics.robot_models import robot_model

    rows: list[tuple[float, ...]] = []
    x, y, _ = cell.memory.read().actual_tcp_pose.position
    setup = ArmSetup.of(Arm(robot_model(cell.robot.config.model)))
    running = asyncio.ensure_future(a_goal('tracked_seam', execution=execution, arm=setup)(cell))
    asked = nan
    while not running.done():
        place = cell.memory.read().actual_tcp_pose.position
        along = (place[1] - y) / 0.2
        is_back = bool(rows) and rows[-1][0] - rows[0][0] > 5.1
        seen = 0.005 * sin(pi * min(max(1.25 * along, 0.0), 1.0)) ** 2
        if len(rows) % 3 == 0 and cell.owner.motions:
            # Across is -x on the way there, and x on the way back.
            asked = seen if not is_back else 0.005 * (int(rows[-1][0] / 0.7) % 2)
            cell.owner.send(SetPathOffset(motion=1, offset=(0.0, asked, 0.0), age=0.0))
        beside = (x - place[0]) * (-1.0 if is_back else 1.0)
        rows.append((cell.loop.time(), 1e3 * asked, 1e3 * beside))
        await cell.sleep(CYCLE)
    assert running.result().succeeded, running.result()
    return rows


def draw_path_offset() -> Path:
    """Draw the offset from a sensor, and the tool; return the file of the picture."""
    from matplotlib import pyplot
    import numpy as np
    from robot_cell import run_cell

    drawing = CHECKOUT / 'doc' / 'execution_path_offset.png'
    figure, axes = pyplot.subplots(figsize=(9.0, 3.2))
    for execution, color in (('PRIMITIVES', '#1f77b4'), ('SERVO', '#c8372d')):
        rows = run_cell(partial(a_tracked_seam, execution=execution))
        time, asked, beside = np.array(rows).T
        if execution == 'PRIMITIVES':
            axes.plot(time - time[0], asked, color='#9aa5b1', label='offset that came')
        axes.plot(time - time[0], beside, color=color, label=f'tool, {execution}')
    axes.set(xlabel='time [s]', ylabel='across the path [mm]')
    axes.set_title('A seam bent by 5 mm; then a sensor that jumps (path_offset)')
    axes.legend(loc='upper right', bbox_to_anchor=(0.5, 1.0))
    figure.tight_layout()
    figure.savefig(drawing, dpi=100)
    compress(drawing)
    return drawing


#: The ways past a corner that are compared: label, colour, and what the path asks for.
CORNERS = (
    ('blends of lines, 1.3 mm', '#1f77b4', {'blend': 1.3e-3}),
    ('blends of PROCESS, 1.3 mm', '#9aa5b1', {'blend': 1.3e-3, 'motion': 'process'}),
    ('rounded corners, 0.5 mm', '#c8372d', {'corner_deviation': 5e-4}),
)
#: The zigzag: directions and length of its segments [m], speed [m/s] and acceleration [m/s^2].
ZIGZAG = ((0, 1), (1, 0), (0, 1), (1, 0), (0, 1))
SIDE, SPEED, ACCELERATION = 0.02, 0.1, 1.0
#: A cycle of an e-Series [s].
SHORT_CYCLE = 0.002


async def a_zigzag(cell: Any, options: dict[str, Any]) -> list[tuple[float, ...]]:
    """Follow a zigzag; return the tool position from its start [m] in each cycle."""
    import example_goals

    from ur_cartesian_driver.kinematics.chain import Arm
    from ur_cartesian_driver.kinematics.robot_models import robot_model
    from ur_cartesian_driver.path import Path as ToolPath
    from ur_cartesian_driver.planning import plan

    state = cell.memory.read()
    start = state.actual_tcp_pose
    path = ToolPath(start).at(speed=SPEED, acceleration=ACCELERATION)
    for x, y in ZIGZAG:
        path = path.by(SIDE * x, SIDE * y, **options)
    arm = Arm(robot_model(cell.robot.config.model))
    motion = cell.owner.start(plan(path.goal(), state, arm, example_goals.OPTIONS))
    rows = []
    while motion.outcome is None:
        place = cell.robot.controller.motion.T_base_tcp.position
        rows.append(tuple(a - b for a, b in zip(place, start.position, strict=True)))
        await cell.sleep(SHORT_CYCLE)
    assert motion.outcome.succeeded, motion.outcome
    return rows


def draw_rounded_corners() -> Path:
    """Draw a zigzag with blends and with rounded corners; return the file of the picture."""
    from matplotlib import pyplot
    import numpy as np
    from robot_cell import run_cell

    drawing = CHECKOUT / 'doc' / 'rounded_corners.png'
    figure, (near, speeds) = pyplot.subplots(1, 2, width_ratios=(1, 2.2), figsize=(10.0, 3.4))
    near.plot([0.0, 0.0, 4.0], [16.0, 20.0, 20.0], color='#dddddd', linewidth=5)
    for label, colour, options in CORNERS:
        happens = partial(a_zigzag, options=options)
        places = 1e3 * np.array(run_cell(happens, robot={'frequency': 1.0 / SHORT_CYCLE}))
        steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
        near.plot(places[:, 0], places[:, 1], color=colour, marker='.', markersize=4)
        speeds.plot(np.cumsum(steps), steps / SHORT_CYCLE, color=colour, label=label)
    near.set(xlim=(-0.4, 2.4), ylim=(17.9, 20.3), aspect='equal')
    near.set(xlabel='x [mm]', ylabel='y [mm]', title='the first corner, a dot every 2 ms')
    speeds.set(ylim=(0.0, 115.0), xlabel='way of the tool [mm]', ylabel='speed [mm/s]')
    speeds.set_title('a zigzag of four corners: 100 mm/s and 1 m/s² asked')
    for axes in (near, speeds):
        axes.grid(alpha=0.3)
    figure.legend(*speeds.get_legend_handles_labels(), loc='lower center', ncols=3, frameon=False)
    figure.tight_layout(rect=(0.0, 0.07, 1.0, 1.0))
    figure.savefig(drawing, dpi=90)
    compress(drawing)
    return drawing


async def a_photo_seam(cell: Any) -> tuple[list[tuple[float, ...]], list[tuple[float, ...]]]:
    """Run a seam with pulses while the slider moves; return rows of the tool, and of pulses."""
    rows: list[tuple[float, ...]] = []
    x, y, _ = cell.memory.read().actual_tcp_pose.position
    happens = a_goal('photo_seam', 'slider 0.4 at 0.13 m', 'slider 1 at 0.17 m')
    running = asyncio.ensure_future(happens(cell))
    while not running.done():
        place = cell.robot.controller.motion.T_base_tcp.position
        rows.append((cell.loop.time(), 1e3 * (place[0] - x), 1e3 * (place[1] - y), place[2]))
        await cell.sleep(SHORT_CYCLE)
    assert running.result().succeeded, running.result()
    pulses = [pulse.pose.position for pulse in cell.owner.pulses]
    return rows, [(1e3 * (place[0] - x), 1e3 * (place[1] - y)) for place in pulses]


def draw_pulses() -> Path:
    """Draw the places of pulses on a seam, and the tool speed; return the file of the picture."""
    from matplotlib import pyplot
    import numpy as np
    from robot_cell import run_cell

    drawing = CHECKOUT / 'doc' / 'outputs_pulses.svg'
    seen, given = run_cell(a_photo_seam, robot={'frequency': 1.0 / SHORT_CYCLE})
    time, *places = np.array(seen).T
    steps = np.linalg.norm(np.diff([places[0], places[1], 1e3 * places[2]], axis=1), axis=0)
    figure, (above, speeds) = pyplot.subplots(1, 2, width_ratios=(1, 1.6), figsize=(10.0, 3.6))
    above.plot(places[0], places[1], color='#9aa5b1', linewidth=1.0, label='tool')
    above.plot(*np.array(given).T, '.', color='#c8372d', markersize=4, label='pulse')
    above.set(aspect='equal', xlabel='x [mm]', ylabel='y [mm]', title='every 2 mm')
    above.legend(loc='upper left')
    speeds.plot(time[1:] - time[0], steps / SHORT_CYCLE, color='#1f77b4')
    seen_at = [int(np.argmin(np.hypot(places[0] - px, places[1] - py))) for px, py in given]
    speeds.vlines(time[seen_at] - time[0], 0.0, 12.0, color='#c8372d', linewidth=0.8)
    speeds.set(xlabel='time [s]', ylabel='speed [mm/s]', ylim=(0.0, None))
    speeds.set_title('the same pulses in time; the speed slider at 40 % for a while')
    for axes in (above, speeds):
        axes.grid(alpha=0.3)
    return save_vectors(figure, drawing)


def draw_beads() -> Path:
    """Draw the errors of the ends of beads without and with a lead; return the picture's file."""
    from matplotlib import pyplot
    import numpy as np

    from ur_cartesian_driver.motion.goal.goal import OutputKind
    from ur_cartesian_driver.motion.goal.leads import Lead
    from ur_cartesian_driver.planning import PlanningOptions

    # The modules of the tests have no types.
    beads: Any = import_module('simulated_valve')
    robot: Any = import_module('robot_in_memory').RobotInMemory('ur5e')
    drawing = CHECKOUT / 'doc' / 'valves_beads.svg'
    valve = Lead(
        name='valve_1',
        output=OutputKind.STANDARD_DIGITAL,
        pin=beads.PIN,
        open=beads.OPEN,
        close=beads.CLOSE,
    )
    options = PlanningOptions(leads=(valve,))
    rows = [
        (1e3 * speed, *(1e3 * beads.errors(robot, beads.Bead(speed, length), lead, options)))
        for lead in ('', 'valve_1')
        for speed in np.linspace(0.01, 0.25, 25)
        for length in (0.03, 0.0303, 0.0306, 0.0309)
    ]
    without, led = np.split(np.array(rows), 2)
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(10.0, 3.2), sharex=True)
    for axes, table, title in (
        (left, without, 'without lead'),
        (right, led, 'with lead: valve_1'),
    ):
        axes.plot(table[:, 0], table[:, 1], '.', color='#1f77b4', label='begins')
        axes.plot(table[:, 0], table[:, 2], '.', color='#c8372d', label='ends')
        axes.set(xlabel='speed [mm/s]', ylabel='behind its place [mm]', title=title)
        axes.grid(alpha=0.3)
    half = 0.5 * beads.CYCLE * np.array([0.0, 250.0])
    for sign in (-1.0, 1.0):
        right.plot([0.0, 250.0], sign * half, color='#9aa5b1')
    right.text(30.0, 0.15, 'half a cycle', color='#6b7682')
    left.legend(loc='upper left')
    for low, high in ((10, 50), (50, 100), (100, 150), (150, 200), (200, 251)):
        for name, table in (('without', without), ('with', led)):
            own = table[(table[:, 0] >= low) & (table[:, 0] < high)]
            begin, end = np.abs(own[:, 1:]).max(axis=0)
            length = np.abs(own[:, 2] - own[:, 1]).max()
            sys.stdout.write(f'{low} to {high} mm/s {name}: {begin:.2f} {end:.2f} {length:.2f}\n')
    return save_vectors(figure, drawing)


def save_vectors(figure: Any, drawing: Path) -> Path:
    """Save a figure as SVG, the same in each run; return its file."""
    from matplotlib import rc_context

    figure.tight_layout()
    with rc_context({'svg.hashsalt': drawing.name}):
        figure.savefig(drawing, metadata={'Date': None, 'Creator': None})
    return drawing


PICTURES = {
    'primitives': Picture(
        title='Lines, an arc and blends (PRIMITIVES); the speed slider at 50 % for a while',
        happens=a_goal('seam', 'slider 0.5 at 0.6 m', 'slider 1 at 0.7 m'),
    ),
    'spline': Picture(
        title='A figure eight with times and twists (SPLINE): no stop, no corner',
        happens=a_goal('figure_eight'),
    ),
    'servo': Picture(
        title='The same by set-points (SERVO); the speed slider at 50 % for a while',
        happens=a_goal(
            'figure_eight', 'slider 0.5 at 0.3 m', 'slider 1 at 0.5 m', execution='SERVO'
        ),
    ),
    'outputs': Picture(
        title='A bead of glue: a valve that opens and closes on the way (io_commands)',
        happens=a_goal('glue'),
    ),
    'waits': Picture(
        title='A seam that begins 0.3 s after its arc burns (input_waits, dwell)',
        happens=a_goal('arc_start', input_after=1.6),
    ),
    'calls': Picture(
        title='A part is picked: close_gripper() returns when it is held (script_calls)',
        happens=a_goal('pick', input_after=1.5),
    ),
    'amounts': Picture(
        title='A bead: the pump follows the speed of the tool (proportional_outputs)',
        happens=a_goal('bead'),
    ),
    'steady': Picture(
        title='A seam at 0.05 m/s around a corner (min_speed_fraction)',
        happens=a_goal('steady'),
    ),
    'stall': Picture(
        title='An arm that is pushed 20 mm aside for 2 s: the motion waits (STALL)',
        happens=a_goal('stall', 'offset pose z 0.02 at 0.05 m for 2 s'),
    ),
    'open': Picture(
        title='Points that come while the arm goes (keep_open); once they come too late',
        happens=a_late_producer,
    ),
    'replaced': Picture(
        title='A circle whose rest is planned anew ten times a second (replace_horizon)',
        happens=a_replanner,
    ),
}


def record(picture: Picture, directory: Path) -> Path:
    """Run the scenario; return the file of its recording."""
    from example_goals import PRELUDE
    from robot_cell import run_cell

    outcome = run_cell(
        picture.happens,
        record_directory=str(directory),
        io_publish_rate=125.0,
        allow_scripts=True,
        script_prelude=str(PRELUDE),
    )
    assert outcome.succeeded, outcome
    (file,) = directory.glob('*.npz')
    return file


def draw(name: str) -> Path:
    """Record a scenario and draw it; return the file of the picture."""
    from ur_cartesian_driver.cli.plots import recording_plot as plot
    from ur_cartesian_driver.driver.recordings.recording import Recording

    drawing = CHECKOUT / 'doc' / f'execution_{name}.png'
    with tempfile.TemporaryDirectory() as directory:
        recording = Recording.load(record(PICTURES[name], Path(directory)))
    plot.draw(recording, drawing, title=PICTURES[name].title)
    compress(drawing)
    return drawing


def compress(drawing: Path) -> None:
    """Reduce the colours of a picture, so that its file is smaller."""
    from PIL import Image

    with Image.open(drawing) as image:
        image.convert('RGB').quantize(COLOURS).save(drawing, optimize=True)


if __name__ == '__main__':
    others = {
        'press': draw_press,
        'path_offset': draw_path_offset,
        'rounded_corners': draw_rounded_corners,
        'pulses': draw_pulses,
        'beads': draw_beads,
    }
    for wanted in sys.argv[1:] or (*PICTURES, *others):
        path = others[wanted]() if wanted in others else draw(wanted)
        sys.stdout.write(f'{path}: {path.stat().st_size / 1000:.0f} kB\n')
