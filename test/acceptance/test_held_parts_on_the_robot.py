# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A part is led along a fixed tool, in virtual time, whatever happens on the way.

RTDE's target joints are turned into poses of the fixed tool on the part by pinocchio, on a URDF
that the tests write; the path on the part is the tests' own. ``INTERRUPTIONS`` is the number of
places at which it is interrupted.
"""

from dataclasses import dataclass, replace
import os
import runpy
from typing import Any

from checkout import CHECKOUT, needs_checkout
from curve_distance import distances
from held_part_goals import origin_pose
import numpy as np
from plain_clients import RtdeRecorder
import pytest
from random_cases import random_of
from recorded_goal import SETUP
from robot_cell import CYCLE, RTDE, run_cell
from urdf_arm import urdf_of, UrdfArm
from virtual_network import HOST
import yaml

from ur_cartesian_driver.driver.ipc.channel import SetPathOffset
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import (
    multiply,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    IOCommand,
    OutputKind,
    PathOffset,
    SafeOutput,
    Segment,
    SegmentType,
    Tolerance,
    Waypoint,
)
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.path import Frames, Path, resume, StaticFrame
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.resources import share_path

pytest.importorskip('pinocchio')
pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

PLACES = int(os.environ.get('INTERRUPTIONS', '2'))
SPLINE, SERVO = ExecutionMode.SPLINE, ExecutionMode.SERVO
ARM = Arm(robot_model('ur5e'))
OPTIONS = PlanningOptions(self_collision='off')
Q = (0.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0)
PART = (0.03, -0.02, 0.1, 0.3, -0.2, 0.5)
DEVIATION, SPEED, PIN, ON, OFF = 5e-4, 0.04, 2, 0, 3
#: How far the tool may be beside the set-points [m]: servoj's filter cuts corners.
BESIDE = {SPLINE: 2e-5, SERVO: 1e-3}
#: Where the path leads from its start on the part [m], and how the tool is turned there [rad].
OFFSETS = np.array([[0.03, 0, 0], [0.03, 0.03, 0], [0.06, 0.03, 0.01], [0.06, 0, 0.01], [0, 0, 0]])
TURNS = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.4), (0.0, 0.1, 0.4), (0.0, 0.0, 0.2), (0.0, 0.0, 0.0)]
#: How close the path and its places are followed: RTDE says it once in a cycle [m].
CLOSE = SPEED * CYCLE + 2e-4
START = Pose((0.04, 0.02, -0.01), quaternion_from_rotation_vector((2.8, 0.3, 0.2)))


def _tool():
    T = ARM.forward(Q) @ origin_pose(PART) @ START
    R = T.matrix()
    return (
        *T.position,
        float(np.arctan2(R[2, 1], R[2, 2])),
        float(np.arcsin(-R[2, 0])),
        float(np.arctan2(R[1, 0], R[0, 0])),
    )


TOOL = _tool()
FRAME = MovingFrame(T_flange_frame=origin_pose(PART), T_base_tool=origin_pose(TOOL))
URDF = UrdfArm(urdf_of(ARM.geometry, {'part': ('tool0', PART), 'tool': ('base', TOOL)}))


def edges(execution=SPLINE, **fields):
    """Return the edges of a part, with a turn from corner to corner, and an output along them."""
    poses = [
        Pose(
            tuple((np.array(START.position) + offset).tolist()),
            multiply(quaternion_from_rotation_vector(turn), START.quaternion),
        )
        for offset, turn in zip(OFFSETS, TURNS, strict=True)
    ]
    return Goal(
        frame_id='part',
        controlled_frame='belt',
        moving_frame=FRAME,
        waypoints=tuple(Waypoint(pose=pose) for pose in poses),
        segments=(Segment(type=SegmentType.LINEAR, velocity=SPEED),) * len(poses),
        corner_deviation=DEVIATION,
        execution=execution,
        path_tolerance=Tolerance(position=(0.004,) * 3),
        io_commands=(switch(ON, 1.0), switch(OFF, 0.0)),
        safe_outputs=(
            SafeOutput(output=OutputKind.STANDARD_DIGITAL, pin=PIN, value=0.0, restore=True),
        ),
        **fields,
    )


def switch(waypoint, value):
    return IOCommand(
        waypoint=waypoint,
        offset=0.0,
        output=OutputKind.STANDARD_DIGITAL,
        pin=PIN,
        value=value,
    )


def programmed():
    """Return the corners (n, 3) of the path on the part."""
    return np.concatenate([[np.zeros(3)], OFFSETS]) + START.position


@dataclass
class Bench:
    """The robot, and the readings of it."""

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

    def readings(self):
        """Return the places of the tool on the part (n, 3), and whether the output was on (n,)."""
        q = np.array([row.target_q for row in self.recorder.rows])
        on = np.array([bool(row.digital_outputs & (1 << PIN)) for row in self.recorder.rows])
        return URDF.relative('tool', 'part', q)[:, :3, 3], on


def check(bench, execution):
    """See that the tool was on the path on the part, all of it, and the output on along it."""
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


@pytest.mark.parametrize('execution', [SPLINE, SERVO])
def test_the_path_on_the_part_is_kept_while_the_slider_moves(execution):
    async def body(cell):
        random, bench = random_of('held slider', execution.name), await Bench(cell).connect()
        motion = await bench.begin(edges(execution))
        while motion.outcome is None:
            cell.robot.set_speed_slider(random.choice([0.2, 0.5, 1.0]))
            for _ in range(random.randint(20, 80)):
                await cell.sleep(CYCLE)
        assert (await bench.end(motion)).code is ErrorCode.SUCCESSFUL
        check(bench, execution)
        # Feedback is relative to the part: the tool is on the path, not where the flange is.
        last = motion.progress[-1]
        assert last.actual_pose.distance_to(bench.made.goal.waypoints[-1].pose) < 1e-3
        assert last.desired_pose.distance_to(bench.made.goal.waypoints[-1].pose) < 1e-3

    run_cell(body)


def test_a_pause_at_a_corner_leaves_the_path_on_the_part_as_it_is():
    async def body(cell):
        bench = await Bench(cell).connect()
        motion = await bench.begin(edges())
        await cell.until(lambda: motion.progress and motion.progress[-1].waypoint >= 2, 60.0)
        cell.robot.inject('pause')
        await cell.until(lambda: cell.memory.read().runtime_state is RuntimeState.PAUSED)
        cell.robot.inject('play')
        assert (await bench.end(motion)).code is ErrorCode.SUCCESSFUL
        places, _ = bench.readings()
        assert distances(places, [programmed()]).max() < DEVIATION + BESIDE[SPLINE]

    run_cell(body)


@pytest.mark.parametrize('execution', [SPLINE, SERVO])
@pytest.mark.timeout(1200)
def test_an_interrupted_path_on_the_part_is_whole(execution):
    async def body(cell):
        random, bench = random_of('held stops', execution.name), await Bench(cell).connect()
        goal = edges(execution)
        for k in range(PLACES):
            motion = await bench.begin(goal)
            stop_at = bench.made.duration * random.uniform(0.15, 0.9)
            await cell.until(
                lambda at=stop_at, of=motion: of.progress and of.progress[-1].time >= at, 60.0
            )
            cell.owner.cancel()
            stopped = (await bench.end(motion)).stopped
            first, on = bench.readings()
            left = resume(goal, stopped, overlap=0.005, approach=0.01)
            outcome = await bench.end(bench.start(left.goal))
            assert outcome.code is ErrorCode.SUCCESSFUL, (k, stop_at, stopped, outcome)
            second, on2 = bench.readings()
            glued = np.vstack([first[on], second[on2]])
            wanted = np.linspace(0.0, 1.0, 100)[:, None]
            for a, b in zip(programmed()[ON + 1 : OFF + 1], programmed()[ON + 2 :], strict=False):
                along = (a + wanted * (b - a))[2:-2]
                near = np.linalg.norm(along[:, None] - glued, axis=2).min(axis=1)
                assert near.max() < CLOSE + DEVIATION + BESIDE[execution], (k, stop_at, stopped)
            # The output is on nowhere else.
            assert distances(glued, [programmed()]).max() < DEVIATION + BESIDE[execution]
            assert not on2[-1]

    run_cell(body)


def test_an_offset_moves_the_tool_in_the_frame_of_the_part():
    side = 0.003

    async def body(cell):
        bench = await Bench(cell).connect()
        goal = replace(
            edges(SERVO, path_offset=PathOffset(limits=(0.0, 0.005, 0.0), timeout=60.0)),
            waypoints=edges().waypoints[:1],
            segments=(replace(edges().segments[0], velocity=0.01),),
            io_commands=(),
        )
        motion = await bench.begin(goal)
        await cell.until(lambda: motion.progress and motion.progress[-1].time > 0.1, 20.0)
        cell.owner.send(
            SetPathOffset(motion=len(cell.owner.motions), offset=(0.0, side, 0.0), age=0.0)
        )
        assert (await bench.end(motion)).code is ErrorCode.SUCCESSFUL
        places, _ = bench.readings()
        off = distances(places, [programmed()[:2]])
        assert off.max() == pytest.approx(side, abs=2e-4)
        assert off[-1] < 3e-4

    run_cell(body)


@pytest.mark.parametrize('name', ['polish_rim', 'glue_contour', 'deburr_ring'])
@needs_checkout
def test_the_examples_lead_their_parts(name):
    """In a file and in Python: the same goal, carried out as it says."""
    module = runpy.run_path(str(CHECKOUT / 'examples' / f'{name}.py'))
    frames = Frames(static_frames=module['FRAMES'])
    goal = module[name](None).goal(frames)
    file = share_path() / 'config' / 'examples' / 'held_part' / f'{name}.yaml'
    parameters = yaml.safe_load((share_path() / 'config' / 'held_part.yaml').read_text())
    listed = parameters['/**']['ros__parameters']['static_frames']
    from_file = Path.load(file).goal(Frames(static_frames=map(StaticFrame.parse, listed)))
    assert from_file.frame_id == goal.frame_id
    for point, other in zip(from_file.waypoints, goal.waypoints, strict=True):
        assert point.pose.distance_to(other.pose) < 1e-9
    for a, b in (
        (from_file.moving_frame.T_base_tool, goal.moving_frame.T_base_tool),
        (from_file.moving_frame.T_flange_frame, goal.moving_frame.T_flange_frame),
    ):
        assert a.distance_to(b) < 1e-6
        assert a.angle_to(b) < 1e-6

    async def body(cell):
        bench = await Bench(cell).connect()
        motion = await bench.begin(from_file)
        outcome = await bench.end(motion)
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        seen = motion.progress[-1].actual_pose
        assert seen.distance_to(goal.waypoints[-1].pose) < 1e-4
        assert seen.angle_to(goal.waypoints[-1].pose) < 1e-3

    run_cell(body)
