# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
G-code of printers, a plotter, a router and a lathe, from the file to the finished goal.

The command imports the file, the goal is planned, and the simulated robot carries it out in
virtual time. The positions that RTDE reports are compared with the curve that the file describes,
written down here by hand.
"""

from math import atan2, cos, hypot, pi, sin
from pathlib import Path

from curve_distance import places_along
import numpy as np
import pytest
from robot_cell import run_cell

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.goal_files import goal_from_fields, read_goal_file
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

FILES = Path(__file__).parents[1] / 'importing' / 'files' / 'gcode'
ARM = Arm(robot_model('ur5e'))
#: Where the origin of the files is in the base [m].
ORIGIN = (-0.55, -0.2, 0.25)
#: How near the tool is to the curve [m]; the blends have a radius of 0.5 mm.
NEAR = 6e-4
#: A report can miss a side that is so short [m].
SHORT = 3e-3


def arc(start, end, centre, sense, axes=(0, 1)):
    """Places of an arc, 2 degrees apart; sense 1 = from the first of the axes to the second."""
    a, b = axes
    first = atan2(start[b] - centre[1], start[a] - centre[0])
    last = atan2(end[b] - centre[1], end[a] - centre[0])
    sweep = sense * (last - first) % (2 * pi) or 2 * pi
    radius = hypot(start[a] - centre[0], start[b] - centre[1])
    places = []
    for angle in np.linspace(first, first + sense * sweep, 2 + int(sweep / 0.035)):
        place = list(start)
        place[a], place[b] = centre[0] + radius * cos(angle), centre[1] + radius * sin(angle)
        places.append(tuple(place))
    return places


#: [mm]
CURVES = {
    'prusaslicer_mk3s.gcode': [
        *((60, -3, 0.2), (100, -3, 0.2), (100, -3, 0.4), (115, 95, 0.4), (115, 95, 0.2)),
        *((135, 95, 0.2), (135, 115, 0.2), (115, 115, 0.2), (115, 95.45, 0.2), (115, 97, 0.2)),
    ],
    'cura_ender3.gcode': [
        *((0.1, 20, 0.3), (0.1, 200, 0.3), (0.4, 200, 0.3), (0.4, 20, 0.3), (0.4, 20, 2)),
        *((105, 105, 0.2), (125, 105, 0.2), (125, 125, 0.2), (105, 125, 0.2), (105, 105, 0.2)),
        *((105.2, 105.2, 0.2), (105.2, 105.2, 0.4), (110.2, 110.2, 0.4), (110.2, 110.2, 10.4)),
        (0, 220, 10.4),
    ],
    'orcaslicer_p1s.gcode': [
        *((128, 118, 0.6), (128, 118, 0.2), (138, 118, 0.2)),
        *arc((138, 118, 0.2), (138, 138, 0.2), (138, 128), 1),
        *((118, 138, 0.2), (118, 118.2, 0.2)),
    ],
    'plotter_m280.gcode': [
        *((10, 10, 0), (50, 10, 0), (50, 40, 0), (10, 10, 0), (60, 20, 0), (80, 20, 0), (0, 0, 0)),
    ],
    'vcarve_mm.tap': [
        *((0, 0, 20.32), (10, 10, 5.08), (10, 10, -1.5), (60, 10, -1.5)),
        *arc((60, 10, -1.5), (70, 20, -1.5), (60, 20), 1),
        *((70, 50, -1.5), (10, 50, -1.5), (10, 10, -1.5), (10, 10, 20.32), (0, 0, 20.32)),
    ],
    # X is a diameter; G3 in the plane from Z to X.
    'lathe_linuxcnc.ngc': [
        *((21, 0, 2), (18, 0, 2), (18, 0, -20)),
        *arc((18, 0, -20), (20, 0, -22), (-22, 18), 1, axes=(2, 0)),
        *((22, 0, -22), (22, 0, 2), (15, 0, 2), (15, 0, -8), (17, 0, -10), (22, 0, -10)),
        (30, 0, 20),
    ],
}
OUTPUTS = {
    'plotter_m280.gcode': ('M280 S40=standard:0:0', 'M280 S90=standard:0:1'),
    'vcarve_mm.tap': ('M3=standard:0:1', 'M5=standard:0:0'),
}
#: Between which corners output 0 is on.
ON = {'plotter_m280.gcode': {0, 1, 2, 4}, 'vcarve_mm.tap': set(range(200))}


def goal_of(folder, name):
    """The goal that the command makes of a file."""
    goal = folder / 'goal.yaml'
    options = [f'--output-of={each}' for each in OUTPUTS.get(name, ())]
    origin = ','.join(map(str, (*ORIGIN, 0, 0, 0)))
    status = main(
        [
            *('import', str(FILES / name), '-o', str(goal), f'--origin={origin}'),
            *('--blend=0.5mm', '--speed=0.15', '--travel-speed=0.3', *options),
        ]
    )
    assert status == 0
    return goal_from_fields(read_goal_file(goal))


@pytest.mark.parametrize('name', CURVES)
def test_a_file_is_carried_out_where_it_leads(tmp_path, name):
    goal = goal_of(tmp_path, name)
    curve = np.array(CURVES[name]) / 1e3 + ORIGIN
    curve = curve[np.linalg.norm(np.diff(curve, axis=0, prepend=np.inf), axis=1) > 1e-6]

    async def scenario(cell):
        state = cell.memory.read()
        motion = cell.owner.start(plan(goal, state, ARM, PlanningOptions(self_collision='off')))
        positions, outputs = [], []
        digital = cell.robot.controller.io.digital_out.standard

        def watch():
            positions.append(cell.memory.read().actual_tcp_pose.position)
            outputs.append(bool(digital[0]))
            return motion.outcome

        await cell.until(watch, bound=120.0)
        assert motion.outcome.succeeded, motion.outcome.text
        return np.array(positions), outputs

    positions, outputs = run_cell(scenario)
    begun = int(np.argmax(np.linalg.norm(positions - curve[0], axis=1) < NEAR))
    assert begun > 0
    sides = places_along(curve, positions[begun:], SHORT)
    assert max(off for _, off in sides) < NEAR
    # Every side of the curve is passed, to its end.
    lengths = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    assert {side for side, _ in sides} >= set(np.flatnonzero(lengths > SHORT).tolist())
    assert positions[-1] == pytest.approx(curve[-1], abs=1e-4)
    if name in ON:
        middles = [
            (side, on)
            for (side, _), on, position in zip(
                sides, outputs[begun:], positions[begun:], strict=True
            )
            if min(np.linalg.norm(position - curve[side : side + 2], axis=1)) > SHORT
        ]
        assert len({side for side, _ in middles}) >= 6
        assert all(on == (side in ON[name]) for side, on in middles)
