# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Outputs that switch on the path: where the tool is then, in which order, and after a stop.

The position of the tool comes from the controller, cycle by cycle, and so does the middle of a
blend: the point of that path nearest to the waypoint. Nothing is taken from the plan.
"""

from math import cos, hypot, radians, sin
from random import Random

import numpy as np
import pytest
from robot_cell import run_cell
from robot_in_memory import RobotInMemory

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    IOCommand,
    OutputKind,
    Segment,
    Waypoint,
)
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.both_arms]

HOME = (0.3, -1.4, 1.5, -1.6, -1.5, 0.2)
TOOL = Pose((0.0, 0.02, 0.12))
OPTIONS = PlanningOptions()
SPEED = 0.25
STEP = 0.002
ARM = Arm(robot_model('ur5e'))
#: From the command to the place, at the worst [m].
BOUND = 0.002


def wandering(count, seed=1):
    """Return points [m] of a path with corners of 8 to 150 degrees, in a square of 20 cm."""
    random, points, x, y, heading = Random(seed), [], 0.0, 0.0, 0.0
    while len(points) < count:
        turn = heading + radians(random.choice((-1, 1)) * random.uniform(8.0, 150.0))
        far = random.uniform(0.03, 0.05)
        if max(abs(x + far * cos(turn)), abs(y + far * sin(turn))) < 0.1:
            heading, x, y = turn, x + far * cos(turn), y + far * sin(turn)
            points.append((x, y, 0.02 * sin(len(points))))
    return points


def beside(home, offset):
    return Pose(tuple(a + b for a, b in zip(home.position, offset, strict=True)), home.quaternion)


def command(waypoint, pin, value, offset=0.0):
    return IOCommand(
        waypoint=waypoint,
        offset=offset,
        output=OutputKind.STANDARD_DIGITAL,
        pin=pin,
        value=float(value),
    )


def blended(home, points, **changes):
    """Return the goal along points, at full speed, with one switch in each of its corners."""
    random = Random(2)
    return Goal(
        waypoints=tuple(Waypoint(pose=beside(home, point)) for point in points),
        segments=tuple(
            Segment(
                velocity=SPEED,
                acceleration=4.0,
                blend_radius=0.0 if k == len(points) - 1 else random.uniform(0.006, 0.012),
            )
            for k in range(len(points))
        ),
        io_commands=tuple(command(k, k % 8, k // 8 % 2 == 0) for k in range(len(points) - 1)),
        **changes,
    )


class Watched:
    """Records the cycle of each change of an output, and all positions of the tool."""

    def __init__(self, controller):
        self._outputs = controller.io.digital_out.standard
        self._outputs[:] = [False] * 8
        self._before = [False] * 8
        self.changes, self.path = [], []

    def __call__(self, controller):
        self.path.append(controller.motion.T_base_tcp.position)
        for pin, (a, b) in enumerate(zip(self._before, self._outputs, strict=True)):
            if a != b:
                self.changes.append((len(self.path) - 1, pin, b))
        self._before = list(self._outputs)


def middles(path, points, cycles):
    """Return the positions on the path nearest to each point, near a cycle (n, 3) [m]."""
    found = []
    for point, cycle in zip(points, cycles, strict=True):
        a = path[max(cycle - 60, 0) : cycle + 60]
        step = np.diff(a, axis=0)
        along = ((point - a[:-1]) * step).sum(axis=1) / np.maximum((step**2).sum(axis=1), 1e-300)
        feet = a[:-1] + np.clip(along, 0.0, 1.0)[:, None] * step
        found.append(feet[np.argmin(np.linalg.norm(feet - point, axis=1))])
    return np.array(found)


def distances(count, slider=1.0):
    """Run a path with corners; return how far from their middles the output switched [m]."""
    robot = RobotInMemory('ur5e')
    state = robot.place(HOME, TOOL)
    goal = blended(state.actual_tcp_pose, wandering(count + 1))
    made = plan(goal, state, ARM, OPTIONS)
    assert sum(len(segment.outputs) for segment in made.segments) == count
    watched = Watched(robot.controller)
    robot.controller.set_slider(slider)
    records = list(made.instructions)
    run = robot.run(records, on_cycle=watched)
    assert not run.failure
    assert [change[1:] for change in watched.changes] == [
        (wanted.pin, bool(wanted.value)) for wanted in goal.io_commands
    ]
    cycles = [change[0] for change in watched.changes]
    path = np.array(watched.path)
    corners = [np.array(point.pose.position) for point in goal.waypoints[:-1]]
    return np.linalg.norm(path[cycles] - middles(path, corners, cycles), axis=1), path, cycles


@pytest.mark.parametrize('slider', [1.0, 0.37])
def test_a_dozen_corners(slider):
    apart, path, cycles = distances(12, slider)
    assert apart.max() < BOUND
    # The tool did not stop for them.
    speed = np.linalg.norm(np.diff(path, axis=0), axis=1) / STEP
    assert speed[cycles[0] : cycles[-1]].min() > 0.2 * SPEED * slider


@pytest.mark.exhaustive
def test_a_thousand_corners():
    apart, path, cycles = distances(1000)
    speed = np.linalg.norm(path[cycles] - path[np.array(cycles) - 1], axis=1) / STEP
    print(
        f'\nmean {1e3 * apart.mean():.3f} mm, worst {1e3 * apart.max():.3f} mm, at '
        f'{speed.mean():.3f} m/s and at most {speed.max():.3f} m/s'
    )
    assert speed.max() > 0.9 * SPEED
    assert apart.mean() < 0.25 * BOUND
    assert apart.max() < BOUND


def test_outputs_along_a_spline_switch_at_points_and_after_them():
    robot = RobotInMemory('ur5e')
    state = robot.place(HOME, TOOL)
    home, speed = state.actual_tcp_pose, 0.2
    waypoints = tuple(
        Waypoint(
            pose=beside(home, (0.1 * sin(0.5 * k), 0.05 - 0.05 * cos(1.0 * k), 0.0)),
            time=0.4 * k,
            twist=(0.0,) * 6
            if k == 12
            else (speed * 0.6 * cos(0.5 * k), speed * 0.6 * sin(1.0 * k), 0.0, 0.0, 0.0, 0.0),
        )
        for k in range(1, 13)
    )
    goal = Goal(
        waypoints=waypoints,
        execution=ExecutionMode.SPLINE,
        io_commands=tuple(
            command(k, k % 8, k < 8, offset=0.0 if k % 2 else 0.123) for k in range(11)
        ),
    )
    made = plan(goal, state, ARM, PlanningOptions(max_tool_speed=1.0))
    watched = Watched(robot.controller)
    run = robot.run(list(made.instructions), on_cycle=watched)
    assert not run.failure
    assert [change[1] for change in watched.changes] == [k % 8 for k in range(11)]
    for (cycle, *_), wanted in zip(watched.changes, goal.io_commands, strict=True):
        time = waypoints[wanted.waypoint].time + wanted.offset
        place = [
            np.interp(time, made.reference.time, made.reference.poses[:, axis])
            for axis in range(3)
        ]
        assert hypot(*(a - b for a, b in zip(watched.path[cycle], place, strict=True))) < 0.001
        assert (cycle + 1) * STEP == pytest.approx(time, abs=5 * STEP)


def standing(cell):
    return [value for value in cell.robot.controller.io.digital_out.standard]


def test_the_driver_switches_outputs_and_waits_for_the_last():
    """With sockets, and the robot loop: what comes after the end belongs to the goal."""

    async def scenario(cell):
        state = cell.memory.read()
        home = state.actual_tcp_pose
        goal = Goal(
            waypoints=(
                Waypoint(pose=beside(home, (0.0, 0.03, 0.0)), time=0.5),
                Waypoint(pose=beside(home, (0.0, 0.0, 0.03)), time=1.0),
            ),
            io_commands=(
                command(0, 1, 1),
                command(0, 2, 1, offset=0.2),
                command(1, 3, 1, offset=1.5),
            ),
            goal_time_tolerance=0.3,
        )
        begun = cell.loop.time()
        motion = cell.owner.start(plan(goal, state, ARM, OPTIONS))
        await cell.until(lambda: motion.outcome is not None, 10.0)
        assert motion.outcome.succeeded, motion.outcome.text
        assert standing(cell)[1:4] == [True] * 3
        assert 2.4 < motion.ended_at - begun < 2.8

    run_cell(scenario)


@pytest.mark.parametrize('when', ['on the way', 'after the end'])
def test_a_cancel_drops_outputs_that_were_not_yet_due(when):
    async def scenario(cell):
        state = cell.memory.read()
        home = state.actual_tcp_pose
        goal = Goal(
            waypoints=(
                Waypoint(pose=beside(home, (0.0, 0.05, 0.0)), time=0.8),
                Waypoint(pose=home, time=1.6),
            ),
            segments=(Segment(blend_radius=0.01), Segment()),
            io_commands=(
                command(0, 1, 1),
                command(0, 2, 1, offset=0.5),
                command(1, 3, 1, offset=3.0),
            ),
        )
        motion = cell.owner.start(plan(goal, state, ARM, OPTIONS))
        await cell.until(lambda: standing(cell)[1 if when == 'on the way' else 2], 5.0)
        if when == 'after the end':
            await cell.until(cell.at_rest, 3.0)
            await cell.sleep(0.5)
        cell.owner.cancel()
        await cell.until(lambda: motion.outcome is not None, 3.0)
        assert motion.outcome.code is ErrorCode.CANCELLED
        assert standing(cell)[1:4] == [True, when == 'after the end', False]
        again = cell.owner.start(
            plan(
                Goal(
                    waypoints=(Waypoint(pose=beside(home, (0.0, 0.02, 0.0))), Waypoint(pose=home))
                ),
                cell.memory.read(),
                ARM,
                OPTIONS,
            )
        )
        await cell.until(lambda: again.outcome is not None, 10.0)
        assert again.outcome.succeeded
        assert standing(cell)[1:4] == [True, when == 'after the end', False]

    run_cell(scenario)
