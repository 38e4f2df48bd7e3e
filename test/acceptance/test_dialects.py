# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Robot programs of other ages: each dialect with its own program, and with the wrong ones.

The programs are played on the simulated controller, dial the driver by themselves, and share
nothing with the driver's program or codecs. Everything runs in virtual time.
"""

import asyncio
from math import hypot

import pytest
from robot_cell import HOST, Motion, PENDANT_PROGRAM, RobotCell
from saved_program import DIALECTS as NAMES
from saved_program import saved_program
from virtual_network import VirtualLoop

from ur_cartesian_driver.driver.api import order_of
from ur_cartesian_driver.driver.channel import StartMotion
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.kinematics.robots import JOINT_NAMES, robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal import Goal, Posture, Segment, SegmentType, Waypoint
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.protocol.dialects import DIALECTS
from ur_cartesian_driver.protocol.trajectory import encode_points

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

JOINT, LINEAR, CIRCULAR = SegmentType.JOINT, SegmentType.LINEAR, SegmentType.CIRCULAR


class SavedCell(RobotCell):
    """A cell whose robot has a program of its own, and never asks for ours."""

    def __init__(self, loop, program, dialect):
        super().__init__(loop, headless=False, settings={'wire_dialect': dialect})
        self.arm = Arm(robot_model('ur5e'))
        self.dialect = DIALECTS[dialect]
        self._program = saved_program(program, HOST)
        #: The fastest that the tool was, and the farthest from where it started [m/s], [m].
        self.fastest = self.farthest = 0.0

    async def load_pendant_program(self):
        assert not self.robot.controller.programs.load(PENDANT_PROGRAM, self._program)

    def pose(self, x=0.0, y=0.0, z=0.0):
        """A pose beside where the tool stands."""
        pose = self.memory.read().actual_tcp_pose
        a, b, c = pose.position
        return type(pose)((a + x, b + y, c + z), pose.quaternion)

    def posture(self, pose):
        q = nearest(self.arm, pose, self.q)
        return Posture(names=JOINT_NAMES, values=q)

    def start_goal(self, *points):
        """Send a goal of (waypoint, segment) as the driver does; return plan and motion."""
        goal = Goal(waypoints=tuple(w for w, _ in points), segments=tuple(s for _, s in points))
        made = plan(goal, self.memory.read(), self.arm,
                    PlanningOptions(dialect=self.dialect, max_tool_speed=1.0))
        owner = self.owner
        number = len(owner.motions) + 1
        motion = owner.motions[number] = Motion()
        owner.send(StartMotion(motion=number, order=order_of(made, self.dialect),
                               points=encode_points((s.primitive for s in made.segments),
                                                    self.dialect)))
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


def run_saved(scenario, program, dialect=None):
    """Run a scenario in a cell with the program of one dialect and a driver of another."""
    loop = VirtualLoop()

    async def run():
        cell = SavedCell(loop, program, dialect or program)
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
        corners = [cell.pose(y=0.03), cell.pose(x=0.03, y=0.03), cell.pose(x=0.03),
                   cell.pose(x=0.03, y=-0.04)]
        made, outcome = await cell.run_goal(
            (Waypoint(pose=corners[0], posture=cell.posture(corners[0])), Segment(type=JOINT)),
            (Waypoint(pose=corners[1]), Segment(blend_radius=0.01, velocity=0.05)),
            (Waypoint(pose=corners[2], posture=cell.posture(corners[2])), Segment()),
            (Waypoint(pose=corners[3], posture=cell.posture(corners[3])),
             Segment(type=CIRCULAR, via=cell.pose(x=0.05, y=-0.02))))
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome.text
        here = cell.robot.controller.motion.T_base_tcp
        assert here.distance_to(corners[3]) < 1e-5
        assert cell.fastest < 0.2
        # In the times of the plan: a program of that dialect reads the speeds that were meant.
        assert float(outcome.text.split()[-2]) == pytest.approx(made.duration, rel=0.05, abs=0.1)

        begin = cell.loop.time()
        _, outcome = await cell.run_goal(
            (Waypoint(pose=cell.pose(y=0.01), time=0.5), Segment(blend_radius=0.002)),
            (Waypoint(pose=cell.pose(z=0.02), time=1.2504), Segment(type=JOINT)))
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome.text
        assert cell.loop.time() - begin == pytest.approx(1.25, abs=0.1)
    run_saved(scenario, name)
