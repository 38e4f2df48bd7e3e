# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Rounded corners carried out, in virtual time: the same path whatever happens on the way.

The controller's own motion is recorded in every cycle; lines and arcs of the goal are the tests'.
"""

from dataclasses import replace

from curve_distance import arc_points, distances
from fault_goals import ARM, OPTIONS
import numpy as np
import pytest
from robot_cell import CYCLE, run_cell

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    IOCommand,
    OutputKind,
    Segment,
    SegmentType,
    Tolerance,
    Waypoint,
)
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.planning import plan

pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.both_arms]

SPLINE, SERVO = ExecutionMode.SPLINE, ExecutionMode.SERVO
DEVIATION, SPEED = 5e-4, 0.05
#: How far the arm may be beside the set-points: servoj's filter cuts corners, splines do not.
BESIDE = {SPLINE: 2e-5, SERVO: 1e-3}
POINTS = np.array(
    [[0.03, 0, 0], [0.03, 0.02, 0], [0.05, 0.04, 0], [0.05, 0.06, 0.01], [0, 0.06, 0]]
)
VIA = np.array([0.03 + 0.02 * (1.0 - np.sqrt(0.5)), 0.02 + 0.02 * np.sqrt(0.5), 0.0])


def zigzag(state, execution, **fields):
    """Return lines with corners of many angles, and an arc that leaves one along its tangent."""
    here, turned = np.array(state.actual_tcp_pose.position), state.actual_tcp_pose.quaternion

    def pose(offset):
        return Pose(tuple((here + offset).tolist()), turned)

    segments = [Segment(type=SegmentType.LINEAR, velocity=SPEED) for _ in POINTS]
    segments[2] = Segment(type=SegmentType.CIRCULAR, velocity=SPEED, via=pose(VIA))
    return Goal(
        waypoints=tuple(Waypoint(pose=pose(offset)) for offset in POINTS),
        segments=tuple(segments),
        corner_deviation=DEVIATION,
        execution=execution,
        path_tolerance=Tolerance(position=(0.004,) * 3),
        **fields,
    )


def programmed(start):
    """Return points (n, 3) along the programmed path."""
    corners = np.concatenate([[np.zeros(3)], POINTS]) + start
    arc = arc_points(corners[2], VIA + start, corners[3])
    return np.concatenate([corners[:3], arc, corners[4:]])


class Record:
    """The place of the tool, and of the output 0, in every cycle."""

    def __init__(self, cell):
        self.cell, self.places, self.outputs = cell, [], []
        self.start = np.array(cell.memory.read().actual_tcp_pose.position)

    def note(self):
        controller = self.cell.robot.controller
        self.places.append(controller.motion.T_base_tcp.position)
        self.outputs.append(bool(controller.io.digital_out.packed() & 1))
        return True

    async def until(self, condition, bound=120.0):
        end = self.cell.loop.time() + bound
        while not condition():
            assert self.cell.loop.time() < end, self.cell.owner.log
            self.note()
            await self.cell.sleep(CYCLE)

    def check(self, execution):
        """See that the tool was on the rounded path from its start to its end."""
        places, path = np.array(self.places), programmed(self.start)
        assert distances(places, [path]).max() < DEVIATION + BESIDE[execution]
        # The other way round: every point of the goal was passed.
        for corner in POINTS + self.start:
            assert np.linalg.norm(places - corner, axis=1).min() < 2.0 * DEVIATION + 1e-3


def run(execution, scenario, **settings):
    async def body(cell):
        record = Record(cell)
        state = cell.memory.read()
        goal = zigzag(state, execution, **settings)
        await scenario(cell, record, goal, plan(goal, state, ARM, OPTIONS))

    run_cell(body)


@pytest.mark.parametrize('slider', [1.0, 0.5, 0.1])
@pytest.mark.parametrize('execution', [SPLINE, SERVO])
def test_the_path_is_the_same_at_any_slider(execution, slider):
    async def at_slider(cell, record, goal, planned):
        cell.robot.set_speed_slider(slider)
        motion = cell.owner.start(planned)
        await record.until(lambda: motion.outcome)
        assert motion.outcome.code is ErrorCode.SUCCESSFUL
        record.check(execution)
        speeds = np.linalg.norm(np.diff(record.places, axis=0), axis=1) / CYCLE
        assert 0.95 * slider * SPEED < speeds.max() < 1.03 * slider * SPEED

    run(execution, at_slider)


@pytest.mark.parametrize('execution', [SPLINE, SERVO])
def test_the_path_is_the_same_if_the_slider_moves_in_corners(execution):
    async def in_corners(cell, record, goal, planned):
        motion = cell.owner.start(planned)
        for corner, slider in zip(POINTS[:4] + record.start, (0.3, 1.0, 0.1, 0.7), strict=True):
            near = 2.0 * DEVIATION + BESIDE[execution]
            await record.until(
                lambda at=corner, near=near: np.linalg.norm(record_place(cell) - at) < near
            )
            cell.robot.set_speed_slider(slider)
        await record.until(lambda: motion.outcome)
        assert motion.outcome.code is ErrorCode.SUCCESSFUL
        record.check(execution)

    run(execution, in_corners)


def record_place(cell):
    return np.array(cell.robot.controller.motion.T_base_tcp.position)


@pytest.mark.parametrize('corner', range(4))
def test_a_pause_in_a_corner_leaves_the_path_as_it_is(corner):
    async def paused(cell, record, goal, planned):
        motion = cell.owner.start(planned)
        at = POINTS[corner] + record.start
        await record.until(lambda: np.linalg.norm(record_place(cell) - at) < 2.0 * DEVIATION)
        cell.robot.inject('pause')
        await record.until(lambda: cell.memory.read().runtime_state is RuntimeState.PAUSED)
        cell.robot.inject('play')
        await record.until(lambda: motion.outcome)
        assert motion.outcome.code is ErrorCode.SUCCESSFUL
        record.check(SPLINE)

    run(SPLINE, paused)


def test_outputs_switch_where_the_tool_passes_their_points():
    switch = IOCommand(
        waypoint=0, offset=0.0, output=OutputKind.STANDARD_DIGITAL, pin=0, value=1.0
    )
    commands = (switch, replace(switch, waypoint=1, value=0.0), replace(switch, waypoint=3))

    async def switched(cell, record, goal, planned):
        motion = cell.owner.start(planned)
        await record.until(lambda: motion.outcome)
        assert motion.outcome.code is ErrorCode.SUCCESSFUL
        record.check(SPLINE)
        places = np.array(record.places)
        changes = np.flatnonzero(np.diff(np.array(record.outputs, dtype=int)))
        assert len(changes) == len(commands)
        for row, command in zip(changes.tolist(), commands, strict=True):
            corner = POINTS[command.waypoint] + record.start
            nearest = int(np.argmin(np.linalg.norm(places - corner, axis=1)))
            assert abs(row - nearest) <= 2

    run(SPLINE, switched, io_commands=commands)
