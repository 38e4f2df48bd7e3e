# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The arm between the driver and the pendant's program, in virtual time."""

from dataclasses import replace

import pytest
from robot_cell import PENDANT_PROGRAM, run_cell

from ur_cartesian_driver.driver.ipc.channel import CallAnswered, CallRobot
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

pytestmark = [pytest.mark.acceptance]

ARM = Arm(robot_model('ur5e'))
#: A program of the pendant with a motion of its own behind the node.
MOTION_BEHIND_NODE = ProgramTree(
    (
        ExternalControlNode(),
        ScriptText(
            'set_standard_digital_out(3, True)\n'
            'movej(get_target_joint_positions() + [0.1, 0, 0, 0, 0, 0], a=5, v=2)'
        ),
    ),
    loops=True,
)


def start(cell, dy):
    """Start a line of a goal, and return its motion."""
    state = cell.memory.read()
    x, y, z = state.actual_tcp_pose.position
    there = replace(state.actual_tcp_pose, position=(x, y + dy, z))
    made = plan(Goal(waypoints=(Waypoint(pose=there),)), state, ARM, PlanningOptions())
    return cell.owner.start(made)


async def call(cell):
    """Hand the arm back, and return the answer."""
    answers, take = [], cell.owner._handle

    def handle(notice):
        if isinstance(notice, CallAnswered):
            answers.append(notice.answer)
        take(notice)

    cell.owner._handle = handle
    cell.owner.send(CallRobot(number=1, call=HandBackCall()))
    await cell.until(lambda: answers, 3.0)
    cell.owner._handle = take
    return answers[0]


def test_the_pendants_program_goes_on_and_brings_the_arm_back():
    async def scenario(cell):
        motion = start(cell, 0.05)
        refused = await call(cell)
        assert (refused.ok, refused.text[:18]) == (False, 'A goal is running,')
        await cell.until(lambda: motion.outcome, 5.0)
        assert motion.outcome.code is ErrorCode.SUCCESSFUL
        q, io = cell.q, cell.robot.controller.io
        answer = await call(cell)
        assert answer.ok, answer
        assert 'behind its External Control node' in answer.text
        assert not cell.is_ready()
        await cell.until(cell.is_ready, 3.0)
        assert io.digital_out.standard[3] is True
        assert cell.q[0] - q[0] == pytest.approx(0.1, abs=1e-6)
        assert cell.count_connected_programs() == 2
        motion = start(cell, -0.05)
        await cell.until(lambda: motion.outcome, 5.0)
        assert motion.outcome.code is ErrorCode.SUCCESSFUL

    run_cell(scenario, headless=False, robot={'programs': {PENDANT_PROGRAM: MOTION_BEHIND_NODE}})


def test_headless_there_is_nothing_behind_the_program():
    async def scenario(cell):
        q = cell.q
        answer = await call(cell)
        assert answer.text == (
            'The robot program has ended; resend_robot_program starts it again.'
        )
        await cell.sleep(1.0)
        again = await call(cell)
        assert not again.ok
        assert again.text.startswith('The driver does not control the arm.')
        cell.resend()
        await cell.until(cell.is_ready, 3.0)
        assert cell.q == q

    run_cell(scenario)


def test_a_paused_program_is_not_told():
    async def scenario(cell):
        cell.robot.controller.programs.pause()
        await cell.sleep(0.1)
        answer = await call(cell)
        assert (answer.ok, answer.text[:28]) == (False, 'The robot program is PAUSED ')
        cell.robot.play_program()
        await cell.until(cell.is_ready)

    run_cell(scenario)
