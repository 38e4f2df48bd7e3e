# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Prints of thousands of short moves with rounded corners, from the file to the finished goal.

The command imports the file, the goal is planned, and the simulated robot carries it out in
virtual time. Places, speeds and outputs that RTDE and the controller report are compared with what
the file says, by the geometry of its own generator.
"""

from dataclasses import replace

from curve_distance import distances, places_along
import numpy as np
import pytest
from robot_cell import CYCLE, run_cell
import sliced_prints

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.goal_files import goal_from_fields, read_goal_file
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

ARM = Arm(robot_model('ur5e'))
#: Where the origin of the files is in the base [m].
ORIGIN = (-0.5, -0.2, 0.25)
OPTIONS = PlanningOptions(self_collision='off')
#: Acceleration that the goals use [m/s^2]; the largest jerk [m/s^3].
ACCELERATION, JERK = OPTIONS.linear_acceleration, OPTIONS.max_linear_jerk
#: How far the arm may be beside the path of the set-points [m].
BESIDE = 2e-5
#: servoj's filter rounds off another 0.8 mm for each m/s^2 (doc/servo.md); here 0.5 m/s^2.
SERVO_BESIDE = 4e-4
#: It also keeps a speed later than the set-points do [s].
SERVO_LAG = 0.1
#: How far the chords between two packets of RTDE are beside the path of the tool [m].
CHORD = 3e-5
#: The curvature of the file is measured over this length [m].
WINDOW = 3e-3
#: Neither a bend nor a point of the file limits the speed if it takes less than this part of the
#: acceleration, and turns by less than this angle [rad].
EASY_PART, EASY_TURN = 0.2, 0.1

#: Name of the print: the deviation that is asked for [mm], by --corner or by G64 P; outputs.
PRINTS = {
    'vase': (0.05, ('M106 S255=standard:0:1', 'M107=standard:0:0')),
    'part': (0.1, ('M3=standard:0:1', 'M5=standard:0:0')),
    'bead': (0.2, ('M3=standard:0:1', 'M5=standard:0:0')),
}


def goal_of(folder, name, outputs, execution):
    """Return the print, and the goal that the command makes of it."""
    made = getattr(sliced_prints, name)()
    file, goal = folder / f'{name}.gcode', folder / 'goal.yaml'
    file.write_text(made.text)
    origin = ','.join(map(str, (*ORIGIN, 0, 0, 0)))
    # The corners of the file win over the option.
    corner = 0.05 if 'G64 P' in made.text else PRINTS[name][0]
    status = main(
        [
            *('import', str(file), '-o', str(goal), f'--origin={origin}', f'--corner={corner}mm'),
            *(f'--output-of={each}' for each in outputs),
        ]
    )
    assert status == 0
    return made, replace(goal_from_fields(read_goal_file(goal)), execution=execution)


def carried_out(goal):
    """Return the plan; for each packet of RTDE the place (n, 3), the speed and the output."""

    async def scenario(cell):
        planned = plan(goal, cell.memory.read(), ARM, OPTIONS)
        motion = cell.owner.start(planned)
        states, outputs = [], []
        digital = cell.robot.controller.io.digital_out.standard

        def watch():
            before = len(states)
            cell.collect(states)
            outputs.extend([bool(digital[0])] * (len(states) - before))
            return motion.outcome

        await cell.until(watch, bound=600.0)
        assert motion.outcome.succeeded, motion.outcome.text
        places = np.array([state.actual_tcp_pose.position for state in states])
        speeds = np.linalg.norm([state.actual_tcp_twist[:3] for state in states], axis=1)
        return planned, places, speeds, np.array(outputs)

    return run_cell(scenario)


class FilePath:
    """The curve of a file in the base, and where its speed can be kept."""

    def __init__(self, made):
        curve = made.curve / 1e3 + ORIGIN
        apart = np.linalg.norm(np.diff(curve, axis=0, prepend=np.inf), axis=1) > 1e-7
        self.curve, self.speeds = curve[apart], 1e-3 * np.array(made.speeds)[apart][1:]
        self.lengths = np.linalg.norm(np.diff(self.curve, axis=0), axis=1)
        #: Length of the path to each place [m].
        self.s = np.concatenate(((0.0,), np.cumsum(self.lengths)))
        rows = np.cumsum(apart) - 1
        #: Rows of the places at which the output switches, and its values.
        self.switches = [(int(rows[row]), value) for row, value in made.switches]

    def first_row(self, tool, near):
        """Return the first row at which the tool is at the beginning of the file's curve."""
        return int(np.argmax(np.linalg.norm(tool - self.curve[0], axis=1) < near))

    def clear_ways(self):
        """
        Return for each side (n,) the places before and behind it at which a limit binds [m], and
        the distance from them at which the tool has the speed of the file [m].

        A limit binds where the file bends sharply or asks for another speed, and at its ends.
        """
        ways = np.diff(self.curve, axis=0) / self.lengths[:, None]
        turns = np.arccos(np.clip(np.einsum('ij,ij->i', ways[:-1], ways[1:]), -1.0, 1.0))
        inner, total = self.s[1:-1], np.concatenate(((0.0,), np.cumsum(turns)))
        around = np.searchsorted(inner, [inner - 0.5 * WINDOW, inner + 0.5 * WINDOW])
        bend = (total[around[1]] - total[around[0]]) / WINDOW
        speed = np.maximum(self.speeds[:-1], self.speeds[1:])
        binds = (turns > EASY_TURN) | (speed**2 * bend > EASY_PART * ACCELERATION)
        binds |= np.diff(self.speeds) != 0.0
        places = np.concatenate(((0.0,), inner[binds], self.s[-1:]))
        after = np.searchsorted(places, self.s[:-1], side='right')
        # The ramp, twice as long as with the full acceleration, and the rise of that.
        reach = (
            self.speeds**2 / ACCELERATION + self.speeds * 4.0 * ACCELERATION / JERK + 0.5 * WINDOW
        )
        return places[after - 1], places[np.minimum(after, len(places) - 1)], reach

    def locate(self, tool):
        """Return the side (n,) on which each place of the tool is, and the way to it (n,) [m]."""
        sides = np.array([side for side, _ in places_along(self.curve, tool, WINDOW)])
        begin, way = self.curve[sides], np.diff(self.curve, axis=0)[sides]
        share = np.einsum('ij,ij->i', tool - begin, way) / self.lengths[sides] ** 2
        return sides, self.s[sides] + np.clip(share, 0.0, 1.0) * self.lengths[sides]

    def check_shape(self, tool, bound):
        """See that the tool was nowhere beside the file's curve, and missed no part of it."""
        assert distances(tool, [self.curve]).max() < bound
        assert distances(self.curve, [tool]).max() < bound + CHORD

    def check_speed(self, tool, speeds, lag=0.0):
        """See that the tool had the file's speed, within 1 %, wherever no limit binds."""
        sides, s = self.locate(tool)
        before, behind, reach = (each[sides] for each in self.clear_ways())
        free = (s - before > reach + lag * self.speeds[sides]) & (behind - s > reach)
        assert free.sum() > 400
        assert np.abs(speeds[free] / self.speeds[sides[free]] - 1.0).max() < 0.01

    def check_outputs(self, tool, levels, deviation):
        """See that the output switched as often as in the file, and within two cycles."""
        sides, s = self.locate(tool)
        rows = np.flatnonzero(np.diff(levels, prepend=False))
        assert levels[rows].tolist() == [value for _, value in self.switches]
        off = np.abs(s[rows] - self.s[[place for place, _ in self.switches]])
        assert (off < 2.0 * CYCLE * self.speeds[sides[rows]] + 2.0 * deviation).all()


@pytest.mark.parametrize('name', PRINTS)
def test_a_print_is_carried_out_as_the_file_says(tmp_path, name):
    deviation, outputs = PRINTS[name]
    made, goal = goal_of(tmp_path, name, outputs, ExecutionMode.SPLINE)
    assert made.moves >= 1000
    planned, tool, speeds, levels = carried_out(goal)
    durations = planned.rows.durations
    assert len(durations) < 50.0 * durations.sum()
    assert durations[:-1].min() >= 0.02 > CYCLE
    path = FilePath(made)
    begun = path.first_row(tool, 1e-3 * deviation)
    tool, speeds, levels = tool[begun:], speeds[begun:], levels[begun:]
    path.check_shape(tool, 1e-3 * deviation + BESIDE)
    path.check_speed(tool, speeds)
    path.check_outputs(tool, levels, 1e-3 * deviation)


def test_a_print_is_carried_out_as_set_points(tmp_path):
    deviation, _ = PRINTS['vase']
    made, goal = goal_of(tmp_path, 'vase', (), ExecutionMode.SERVO)
    _, tool, speeds, _ = carried_out(goal)
    path = FilePath(made)
    begun = path.first_row(tool, 1e-3 * deviation + SERVO_BESIDE)
    path.check_shape(tool[begun:], 1e-3 * deviation + SERVO_BESIDE)
    path.check_speed(tool[begun:], speeds[begun:], SERVO_LAG)
