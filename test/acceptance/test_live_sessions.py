# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Sessions of live targets in virtual time: the whole robot loop, and the simulated controller."""

import asyncio
from math import cos, hypot, sin

import pytest
from robot_cell import CellMotion, CYCLE, run_cell

from ur_cartesian_driver.driver.ipc.channel import ArmSetup, SetLiveTarget, StartMotion
from ur_cartesian_driver.driver.live_session import live_setup, stationary_job, stationary_plan
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.sim.motion.motion_ownership import FreedriveState

pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.both_arms]

ARM = Arm(robot_model('ur5e'))
#: How often somebody tells a target [s].
PERIOD = 0.02
#: From a set-point to the arm: buffer, network and lookahead of the controller [s].
LAG = 0.35


class Session:
    """A session in a cell, as its owner sees it."""

    def __init__(self, cell, **options):
        self.cell = cell
        self.number = len(cell.owner.motions) + 1
        self.motion = cell.owner.motions[self.number] = CellMotion()
        state = cell.memory.read()
        self.start = state.target_tcp_pose
        plan = stationary_plan(state)
        cell.owner.send(
            StartMotion(
                motion=self.number,
                points=b'',
                job=stationary_job(plan),
                arm=ArmSetup.of(ARM),
                live=live_setup(
                    ARM, state.target_q, PlanningOptions(**{'live_target_timeout': 0.6} | options)
                ),
            )
        )

    def beside(self, x=0.0, y=0.0, z=0.0):
        px, py, pz = self.start.position
        return Pose((px + x, py + y, pz + z), self.start.quaternion)

    def aim(self, x=0.0, y=0.0, z=0.0, age=0.0):
        self.cell.owner.send(
            SetLiveTarget(motion=self.number, T_base_tcp=self.beside(x, y, z), age=age)
        )

    async def lead(self, seconds, offset_at):
        """Send targets for some time, at ``offset_at(t)`` from the start."""
        for i in range(round(seconds / PERIOD)):
            self.aim(*offset_at(i * PERIOD))
            await asyncio.sleep(PERIOD)

    @property
    def tool(self):
        """The controller's place of the tool, relative to the start."""
        pose = ARM.forward(self.cell.q)
        return tuple(a - b for a, b in zip(pose.position, self.start.position, strict=True))

    @property
    def outcome(self):
        return self.motion.outcome

    async def ended(self, bound=3.0):
        await self.cell.until(lambda: self.outcome is not None, bound, 'the end of the session')
        return self.outcome


def test_a_circle_is_followed_and_the_session_ends_without_targets():
    async def scenario(cell):
        session = Session(cell)
        off = []

        def offset_at(t):
            if t > 0.4:
                y, z = session.tool[1:]
                off.append(abs(hypot(y, z - 0.03) - 0.03))
            return (0.0, 0.03 * sin(4.0 * t), 0.03 * (1.0 - cos(4.0 * t)))

        await session.lead(1.6, offset_at)
        # Behind by its braking distance, the tool cuts the circle by some of it.
        assert max(off) < 0.006, max(off)
        assert not cell.at_rest()
        assert session.outcome is None
        outcome = await session.ended()
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        assert 'targets' in outcome.text
        assert any('80 targets were followed' in line for line in outcome.report), outcome
        assert cell.at_rest()
        await cell.until(cell.is_ready)

    run_cell(scenario)


def test_stale_targets_stop_the_arm_smoothly_and_new_ones_resume():
    async def scenario(cell):
        session = Session(cell, live_target_timeout=5.0)
        await session.lead(0.5, lambda t: (0.0, 0.3, 0.0))
        assert not cell.at_rest()
        await cell.until(cell.at_rest, 0.2 + 0.25 + LAG, 'the target is too old')
        before = session.tool[1]
        assert 0.03 < before < 0.25
        await session.lead(0.4, lambda t: (0.0, 0.3, 0.0))
        assert session.tool[1] > before + 0.01
        assert session.outcome is None

    run_cell(scenario)


def test_the_arm_stops_before_a_plane_and_the_session_says_why():
    async def scenario(cell):
        session = Session(cell, workspace_planes=('wall 0 -0.3 0 0 1 0 0.01',))
        await session.lead(1.4, lambda t: (0.0, -0.3, 0.0))
        assert cell.at_rest()
        stood = session.tool[1]
        assert -0.157 < stood < -0.08, stood
        assert any('the workspace plane "wall"' in line for line in cell.owner.log)
        await session.lead(0.4, lambda t: (0.0, 0.0, 0.0))
        assert session.tool[1] > stood + 0.02
        outcome = await session.ended()
        assert any('wall' in line for line in outcome.report), outcome

    run_cell(scenario)


async def _cancel(cell):
    cell.owner.cancel()


async def _protective_stop(cell):
    cell.robot.inject('protective_stop')


async def _hang_up(cell):
    await cell.crash_robot()


@pytest.mark.parametrize(
    ('what', 'code'),
    [
        (_cancel, ErrorCode.CANCELLED),
        (_protective_stop, ErrorCode.PROTECTIVE_STOP),
        (_hang_up, ErrorCode.CONNECTION_LOST),
    ],
)
def test_what_ends_a_goal_ends_a_session(what, code):
    async def scenario(cell):
        session = Session(cell)
        await session.lead(0.3, lambda t: (0.0, 0.3, 0.0))
        assert not cell.at_rest()
        await what(cell)
        outcome = await session.ended()
        assert outcome.code is code, outcome
        await cell.until(cell.at_rest, 1.0)
        session.aim(0.0, 0.3, 0.0)
        await cell.sleep(10 * CYCLE)
        assert cell.at_rest(), 'a target for a session that has ended means nothing'

    run_cell(scenario)


def is_taught(cell):
    return cell.robot.controller.freedrive is FreedriveState.TEACH


def test_a_person_may_guide_the_arm_until_freedrive_ends():
    async def scenario(cell):
        motion = cell.owner.motions[1] = CellMotion()
        plan = stationary_plan(cell.memory.read())
        cell.owner.send(
            StartMotion(motion=1, points=b'', job=stationary_job(plan), freedrive=True)
        )
        if not cell.config.allow_freedrive:
            await cell.until(lambda: motion.outcome is not None, 2.0)
            assert not motion.progress
            return motion.outcome
        await cell.until(lambda: motion.progress)
        assert is_taught(cell)
        await cell.sleep(0.5)
        assert motion.outcome is None
        cell.owner.cancel()
        await cell.until(lambda: motion.outcome is not None)
        assert not is_taught(cell)
        await cell.until(cell.is_ready)
        return motion.outcome

    assert run_cell(scenario, allow_freedrive=True).code is ErrorCode.CANCELLED
    refused = run_cell(scenario)
    assert refused.code is ErrorCode.EXECUTION_FAILED
    assert 'allow_freedrive' in refused.text
