# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A part with a path on it before a fixed tool, in virtual time, and the tool's places on the part.

Pinocchio turns RTDE's target joints into poses of the fixed tool on the part, by a URDF that is
written here; the path on the part is made of numbers alone.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

from curve_distance import distances
from held_part_goals import frame_and_urdf, origin_pose
import numpy as np
from plain_clients import RtdeRecorder
from process_output import is_on, SAFE_OUTPUTS, switch
import pytest
from recorded_goal import SETUP
from robot_cell import CYCLE, RTDE
from virtual_network import HOST

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import (
    multiply,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    Segment,
    SegmentType,
    Tolerance,
    Waypoint,
)
from ur_cartesian_driver.planning import plan, PlanningOptions

SPLINE, SERVO = ExecutionMode.SPLINE, ExecutionMode.SERVO
PRIMITIVES = ExecutionMode.PRIMITIVES

pytest.importorskip('pinocchio')

ARM = Arm(robot_model('ur5e'))
OPTIONS = PlanningOptions(self_collision='off')
Q = (0.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0)
PART = (0.03, -0.02, 0.1, 0.3, -0.2, 0.5)
DEVIATION, SPEED, ON, OFF = 5e-4, 0.04, 0, 3
#: Largest distance of the tool from the set-points [m]: servoj's filter cuts corners.
BESIDE = {PRIMITIVES: 2e-5, SPLINE: 2e-5, SERVO: 1e-3}
#: The corners of the path on the part, from its start [m], and the turns of the tool there [rad].
OFFSETS = np.array([[0.03, 0, 0], [0.03, 0.03, 0], [0.06, 0.03, 0.01], [0.06, 0, 0.01], [0, 0, 0]])
TURNS = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.4), (0.0, 0.1, 0.4), (0.0, 0.0, 0.2), (0.0, 0.0, 0.0)]
NO_TURNS = [(0.0,) * 3] * len(TURNS)
#: Largest distance from the path and its places [m]: RTDE reports once in a cycle.
CLOSE = SPEED * CYCLE + 2e-4
START = Pose((0.04, 0.02, -0.01), quaternion_from_rotation_vector((2.8, 0.3, 0.2)))


FRAME, URDF = frame_and_urdf(ARM, origin_pose(PART), ARM.forward(Q) @ origin_pose(PART) @ START)


def edges(execution=SPLINE, **fields):
    """
    Return a goal along the edges of a part, with turns between corners and an output on the way.

    The controller's own lines (PRIMITIVES) have no turns, and stops in place of rounded corners.
    """
    by_moves = execution is PRIMITIVES
    poses = [
        Pose(
            tuple((np.array(START.position) + offset).tolist()),
            multiply(quaternion_from_rotation_vector(turn), START.quaternion),
        )
        for offset, turn in zip(OFFSETS, NO_TURNS if by_moves else TURNS, strict=True)
    ]
    return Goal(
        frame_id='part',
        controlled_frame='belt',
        moving_frame=FRAME,
        waypoints=tuple(Waypoint(pose=pose) for pose in poses),
        segments=(Segment(type=SegmentType.LINEAR, velocity=SPEED),) * len(poses),
        corner_deviation=0.0 if by_moves else DEVIATION,
        execution=execution,
        path_tolerance=Tolerance(position=(0.004,) * 3),
        io_commands=(switch(ON, 1.0), switch(OFF, 0.0)),
        safe_outputs=SAFE_OUTPUTS,
        **fields,
    )


def programmed():
    """Return the corners (n, 3) of the path on the part."""
    return np.concatenate([[np.zeros(3)], OFFSETS]) + START.position


@dataclass
class Bench:
    """The robot, and its readings."""

    cell: Any

    async def connect(self):
        self.recorder = RtdeRecorder()
        loop = self.cell.loop
        connection, _ = await loop.create_connection(lambda: self.recorder, HOST, RTDE)
        connection.write(self.recorder.codec.requests(1.0 / CYCLE))
        return self

    async def begin(self, goal):
        self.cell.robot.controller.motion.teleport(Q)
        await self.cell.sleep(0.1)
        return self.start(goal)

    def start(self, goal):
        self.made = plan(goal, self.cell.memory.read(), ARM, OPTIONS)
        self.recorder.rows.clear()
        return self.cell.owner.start(self.made, arm=SETUP)

    async def end(self, motion):
        await self.cell.until(lambda: motion.outcome is not None, 120.0)
        await self.cell.until(self.cell.at_rest)
        return motion.outcome

    @property
    def is_on(self):
        """Whether the output is on, by the newest packet."""
        rows = self.recorder.rows
        return bool(rows) and is_on(rows[-1].digital_outputs)

    def readings(self):
        """Return the places of the tool on the part (n, 3), and whether the output was on (n,)."""
        q = np.array([row.target_q for row in self.recorder.rows])
        on = np.array([is_on(row.digital_outputs) for row in self.recorder.rows])
        return URDF.relative('tool', 'part', q)[:, :3, 3], on


def check(bench, execution):
    """Check that the tool was on the whole path on the part, with the output on along it."""
    places, on = bench.readings()
    path = programmed()
    assert distances(places, [path]).max() < DEVIATION + BESIDE[execution]
    for corner in path:
        assert np.linalg.norm(places - corner, axis=1).min() < 2.0 * DEVIATION + BESIDE[execution]
    changes = np.flatnonzero(np.diff(on.astype(int)))
    assert len(changes) == 2
    for row, point in zip(changes.tolist(), (ON, OFF), strict=True):
        assert (
            np.linalg.norm(places[row] - path[point + 1]) < CLOSE + DEVIATION + BESIDE[execution]
        )


def is_covered(corners, places, beside):
    """Return whether the tool was everywhere on a path, except near its corners (n, 3)."""
    parts = np.linspace(0.0, 1.0, 100)[2:-2, None]
    wanted = np.vstack([a + parts * (b - a) for a, b in pairwise(corners)])
    off = np.linalg.norm(wanted[:, None] - places, axis=2).min(axis=1)
    return off.max() < CLOSE + beside
