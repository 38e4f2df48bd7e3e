# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A person plays, stops and pauses a program with External Control, and other things happen.

Sequences are drawn: play, stop, pause, the driver ends and comes back, the network is cut, the arm
is handed back. Then the network is whole and the driver runs, and a person does what the status of
the driver says, until it is READY and a goal ends well. ``RANDOM_SEED=N`` draws other sequences.
"""

from dataclasses import replace
import re

import pytest
from random_cases import cases, random_of, SEED
from robot_cell import CABLE, PENDANT_PROGRAM, RobotCell, run_cell

from ur_cartesian_driver.driver.ipc.channel import CallRobot
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.robot.services.service_calls import HandBackCall
from ur_cartesian_driver.sim.pendant_programs.program_tree import (
    ExternalControlNode,
    ProgramTree,
    ScriptText,
)

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

NODE = ExternalControlNode()
SEQUENCES = cases(200)
ROBOTS = (
    {'model': 'ur5', 'polyscope': '3.15'},
    {'model': 'ur5e', 'polyscope': '5.21'},
    {'model': 'ur10e', 'polyscope': '10.12'},
)
TREES = (
    ProgramTree((NODE,)),
    ProgramTree((ScriptText('sleep(0.1)'), NODE, ScriptText('sleep(0.2)'))),
    ProgramTree((NODE, ScriptText('sleep(0.1)'), NODE, ScriptText('sleep(0.1)')), loops=True),
)


class PendantCell(RobotCell):
    """A robot, a driver that comes and goes, and a person in front of the pendant."""

    def __init__(self, *args, **more):
        super().__init__(*args, **more)
        #: How many drivers there were, and whether the last one runs.
        self.drivers, self.driver_runs = 1, True

    # ---- what happens -------------------------------------------------------------------------

    async def play(self):
        self.robot.controller.programs.play()

    async def stop(self):
        self.robot.stop_program()

    async def pause(self):
        self.robot.controller.programs.pause()

    async def close_window(self):
        self.robot.close_popups()

    async def hand_back(self):
        self.owner.send(CallRobot(number=1, call=HandBackCall()))

    async def end_or_start_driver(self):
        if self.driver_runs:
            await self.end_driver()
        else:
            self.drivers += 1
            await self.start_driver(self.drivers)
        self.driver_runs = not self.driver_runs

    async def cut_or_join_cable(self):
        self.loop.cut_cable(() if self.loop.unreachable else CABLE)

    async def drop_connections(self):
        for port in CABLE:
            self.loop.cut(port)

    async def close(self):
        if not self.driver_runs:
            await self.start_driver(self.drivers)
        await super().close()


ACTIONS = (
    *[PendantCell.play] * 3,
    PendantCell.stop,
    PendantCell.pause,
    PendantCell.close_window,
    PendantCell.hand_back,
    *[PendantCell.end_or_start_driver] * 2,
    *[PendantCell.cut_or_join_cable] * 2,
    PendantCell.drop_connections,
)

#: Sentence of the status -> what a person does who reads it.
REMEDIES = {
    r'The robot program does not run; play a program with the External Control node on the '
    r'pendant\.': [PendantCell.play],
    r'The robot program is paused; play it on the pendant\.': [PendantCell.play],
    r'Another program runs on the robot, .* Let it end, or stop it; then play a program whose '
    r'External Control node calls this computer\.': [
        PendantCell.close_window,
        PendantCell.stop,
        PendantCell.play,
    ],
}


def remedy(cell):
    """Return what a person does now, or None if the status needs nothing, or gets there itself."""
    return next(
        (do for text, do in REMEDIES.items() if re.fullmatch(text, cell.status.message)), None
    )


async def settled(cell):
    """Wait until the state of the driver stays for a second, and says what to do if anything."""
    since, last = cell.loop.time(), None

    def stays():
        nonlocal since, last
        now = cell.status.state, cell.status.message, cell.robot.controller.programs.starting
        if now != last:
            since, last = cell.loop.time(), now
        return cell.loop.time() - since > 1.0 and (cell.is_ready() or remedy(cell) is not None)

    await cell.until(stays, 20.0, 'neither READY nor a sentence that says what to do')


async def run_goal(cell):
    """Run a line of 2 cm; the controller's own target says whether the tool has arrived."""
    state = cell.memory.read()
    x, y, z = state.actual_tcp_pose.position
    there = replace(state.actual_tcp_pose, position=(x, y + 0.02, z))
    arm = Arm(robot_model(cell.robot.config.model))
    made = plan(Goal(waypoints=(Waypoint(pose=there),)), state, arm, PlanningOptions())
    motion = cell.owner.start(made)
    await cell.until(lambda: motion.outcome, 5.0)
    assert motion.outcome.code is ErrorCode.SUCCESSFUL, motion.outcome.text
    assert cell.robot.controller.motion.T_base_tcp.distance_to(there) < 1e-5


@pytest.mark.random
@pytest.mark.parametrize('case', range(SEQUENCES))
def test_whatever_happens_the_driver_is_ready_or_says_what_to_do(case):
    draw = random_of('external control', case)
    steps = [(draw.choice(ACTIONS), draw.uniform(0.0, 1.5)) for _ in range(draw.randint(6, 10))]
    print(f'RANDOM_SEED={SEED}:', *(f'{do.__name__}, {wait:.2f} s;' for do, wait in steps))

    robot = {
        **ROBOTS[case % 3],
        'frequency': 125.0,
        'programs': {PENDANT_PROGRAM: draw.choice(TREES)},
    }

    async def scenario(cell):
        for do, wait in steps:
            if do is not PendantCell.hand_back or cell.driver_runs:
                await do(cell)
            await cell.sleep(wait)
        if cell.loop.unreachable:
            await cell.cut_or_join_cable()
        if not cell.driver_runs:
            await cell.end_or_start_driver()
        followed = []
        await settled(cell)
        while not cell.is_ready():
            assert len(followed) < 4, f'{followed} did not help'
            followed.append(cell.status.message)
            for do in remedy(cell):
                await do(cell)
            await settled(cell)
        print('followed:', followed)
        await run_goal(cell)

    run_cell(scenario, headless=False, robot=robot, cell=PendantCell)
