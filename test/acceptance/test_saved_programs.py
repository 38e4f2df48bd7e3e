# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Saved robot programs: each wire dialect with its own program, and with the wrong ones.

The programs are played on the simulated controller, connect to the driver by themselves, and share
nothing with the driver's program or codecs. Everything runs in virtual time.
"""

import asyncio
from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import replace
from math import hypot
from typing import TypeVar, TypeVarTuple

import pytest
from robot_cell import CellMotion, PENDANT_PROGRAM, RobotCell
from saved_program import DIALECTS as NAMES
from saved_program import saved_program
from virtual_network import HOST, VirtualLoop

from ur_cartesian_driver.driver.ipc.channel import StartMotion
from ur_cartesian_driver.execution.goal.motion_job import job_from_plan
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.goal import Goal, Posture, Segment, SegmentType, Waypoint
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.protocol.program.trajectory_points import encode_points
from ur_cartesian_driver.protocol.program.wire_dialects import DIALECTS

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

T = TypeVar('T')
#: What the slow start of a program costs its first motion [s].
START = 0.08
Ts = TypeVarTuple('Ts')
JOINT, LINEAR, CIRCULAR = SegmentType.JOINT, SegmentType.LINEAR, SegmentType.CIRCULAR


class SavedCell(RobotCell):
    """A cell whose robot has a program of its own, and never asks for ours."""

    def __init__(self, loop, program, dialect, turned):
        super().__init__(loop, headless=False, settings={'wire_dialect': dialect})
        self.arm = Arm(robot_model('ur5e'))
        self.dialect = DIALECTS[dialect]
        self._program, self._turned = saved_program(program, HOST), turned
        #: The fastest that the tool was, and the farthest from where it started [m/s], [m].
        self.fastest = self.farthest = 0.0

    async def start_robot(self, config):
        await super().start_robot(replace(config, q=(self._turned, *config.q[1:])))

    async def load_pendant_program(self):
        assert not self.robot.controller.programs.load(PENDANT_PROGRAM, self._program)

    def pose(self, x=0.0, y=0.0, z=0.0):
        """A pose beside the tool."""
        pose = self.memory.read().actual_tcp_pose
        a, b, c = pose.position
        return type(pose)((a + x, b + y, c + z), pose.quaternion)

    def posture(self, pose):
        q = nearest(self.arm, pose, self.q)
        return Posture(names=JOINT_NAMES, values=q)

    def start_goal(self, *points):
        """Send a goal of (waypoint, segment) as the driver does; return plan and motion."""
        goal = Goal(waypoints=tuple(w for w, _ in points), segments=tuple(s for _, s in points))
        made = plan(
            goal,
            self.memory.read(),
            self.arm,
            PlanningOptions(dialect=self.dialect, max_tool_speed=1.0),
        )
        owner = self.owner
        number = len(owner.motions) + 1
        motion = owner.motions[number] = CellMotion()
        owner.send(
            StartMotion(
                motion=number,
                job=job_from_plan(made),
                points=encode_points((s.primitive for s in made.segments), self.dialect),
            )
        )
        return made, motion

    async def run_goal(self, *points, bound=120.0):
        made, motion = self.start_goal(*points)
        home = self.robot.controller.motion.T_base_tcp

        def ended():
            twist = self.robot.controller.motion.tcp_twist
            here = self.robot.controller.motion.T_base_tcp
            self.fastest = max(self.fastest, hypot(*twist[:3]))
            self.farthest = max(self.farthest, here.distance_to(home))
            return motion.outcome is not None

        await self.until(ended, bound)
        return made, motion.outcome


class OneThreadLoop(VirtualLoop):
    """Does at once what would be done in another thread, whose time is not virtual."""

    def run_in_executor(
        self, executor: Executor | None, func: Callable[[*Ts], T], *args: *Ts
    ) -> asyncio.Future[T]:
        del executor
        future = self.create_future()
        future.set_result(func(*args))
        return future


def run_saved(scenario, program, dialect=None, turned=0.0):
    """Run a scenario in a cell with the program of one dialect and a driver of another."""
    loop = OneThreadLoop()

    async def run():
        cell = SavedCell(loop, program, dialect or program, turned)
        try:
            await cell.start()
            return await scenario(cell)
        finally:
            await cell.close()

    with asyncio.Runner(loop_factory=lambda: loop) as runner:
        return runner.run(run())


# ---- the right program ------------------------------------------------------------------------


@pytest.mark.parametrize('name', NAMES)
def test_each_dialect_runs_joint_moves_lines_blends_and_arcs(name):
    async def scenario(cell):
        corners = [
            cell.pose(y=0.03),
            cell.pose(x=0.03, y=0.03),
            cell.pose(x=0.03),
            cell.pose(x=0.03, y=-0.04),
        ]
        made, outcome = await cell.run_goal(
            (Waypoint(pose=corners[0], posture=cell.posture(corners[0])), Segment(type=JOINT)),
            (Waypoint(pose=corners[1]), Segment(blend_radius=0.01, velocity=0.05)),
            (Waypoint(pose=corners[2], posture=cell.posture(corners[2])), Segment()),
            (
                Waypoint(pose=corners[3], posture=cell.posture(corners[3])),
                Segment(type=CIRCULAR, via=cell.pose(x=0.05, y=-0.02)),
            ),
        )
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome.text
        here = cell.robot.controller.motion.T_base_tcp
        assert here.distance_to(corners[3]) < 1e-5
        assert cell.fastest < 0.2
        # In the times of the plan: a program of that dialect reads the speeds that were meant.
        took = float(outcome.text.split()[-2])
        assert took == pytest.approx(made.duration + START, rel=0.05, abs=0.1)

        begin = cell.loop.time()
        _, outcome = await cell.run_goal(
            (Waypoint(pose=cell.pose(y=0.01), time=0.5), Segment(blend_radius=0.002)),
            (Waypoint(pose=cell.pose(z=0.02), time=1.2504), Segment(type=JOINT)),
        )
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome.text
        assert cell.loop.time() - begin == pytest.approx(1.25, abs=0.1)

    run_saved(scenario, name)


@pytest.mark.parametrize('name', NAMES)
def test_each_dialect_cancels_and_goes_on(name):
    async def scenario(cell):
        _, motion = cell.start_goal(
            *((Waypoint(pose=cell.pose(y=0.1 * (i + 1) / 50)), Segment()) for i in range(50))
        )
        await cell.until(lambda: cell.memory.read().target_tcp_twist[1] > 0.01)
        cell.owner.cancel()
        await cell.until(lambda: motion.outcome is not None)
        assert motion.outcome.code is ErrorCode.CANCELLED
        assert cell.at_rest()
        # All messages of the old goal have been read.
        _, outcome = await cell.run_goal((Waypoint(pose=cell.pose(x=0.02)), Segment()))
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome.text

    run_saved(scenario, name)


def test_two_thousand_points_reach_a_program_that_tells_no_progress():
    """More than four send windows of points: they advance with the position on the path."""

    async def scenario(cell):
        home = cell.pose()
        x, y, z = home.position
        points = [
            (
                Waypoint(
                    pose=type(home)((x + 1e-4 * i, y + 5e-5 * (i % 2), z), home.quaternion),
                    time=0.008 * i,
                ),
                Segment(),
            )
            for i in range(1, 2001)
        ]
        made, outcome = await cell.run_goal(*points)
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome.text
        assert cell.memory.read().points_begun == 0
        assert len(made.segments) == 2000

    run_saved(scenario, '2.10')


# ---- the wrong program ------------------------------------------------------------------------

#: By kind of motion: the segment, and whether the goal has times.
KINDS = {
    'timed line': (Segment(), True),
    'line': (Segment(velocity=0.05), False),
    'timed joint move': (Segment(type=JOINT), True),
    'joint move': (Segment(type=JOINT), False),
}
#: Driver, program: the kinds that this program reads as they were meant, or nearly.
HARMLESS = {
    ('2.0', '2.10'): {*KINDS},
    ('2.10', '2.0'): {'line', 'joint move'},
    ('2.10', '2.12'): {'timed line', 'timed joint move', 'joint move'},
    ('2.0', '2.14'): {'joint move'},
    ('2.14', '2.0'): set(),
    ('2.14', '2.10'): {'timed line'},
}


@pytest.mark.parametrize(
    ('kind', 'driver', 'program', 'turned'),
    [
        *((kind, *pair, 0.0) for kind in KINDS for pair in HARMLESS),
        ('line', '2.14', '2.0', 0.6),
        ('line', '2.14', '2.10', 0.6),
    ],
)
def test_a_wrong_program_makes_no_wild_move(kind, driver, program, turned):
    """
    A program of another dialect ends the goal, unless it does what is meant.

    Where the base is turned the first joint, which an old program takes for the speed, is
    positive.
    """
    segment, timed = KINDS[kind]

    async def scenario(cell):
        target = cell.pose(y=0.05)
        _, outcome = await cell.run_goal(
            (
                Waypoint(pose=target, posture=cell.posture(target), time=1.0 if timed else 0.0),
                segment,
            )
        )
        assert cell.fastest < 0.25
        assert cell.farthest < 0.0501
        if kind in HARMLESS[driver, program]:
            assert outcome.code is ErrorCode.SUCCESSFUL, outcome.text
            assert cell.robot.controller.motion.T_base_tcp.distance_to(target) < 1e-4
        elif outcome.code is ErrorCode.SUCCESSFUL:
            # Its acceleration was the speed: on so short a path it does not become too fast.
            assert (kind, turned > 0.0) == ('line', True)
        elif outcome.code is ErrorCode.EXECUTION_FAILED:
            assert 'wire_dialect' in outcome.text
        else:
            assert outcome.code is ErrorCode.PROGRAM_STOPPED
            assert 'v is' in cell.status.last_error

    run_saved(scenario, program, driver, turned)
