# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Scripts of others run beside the robot program, or in its place; in virtual time."""

from dataclasses import replace

import pytest
from robot_cell import PRIMARY, run_cell

from ur_cartesian_driver.driver.ipc.channel import CallAnswered, CallRobot
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.services.service_calls import MAX_SCRIPT_LENGTH, RunScriptCall
from ur_cartesian_driver.urscript import parse

pytestmark = [pytest.mark.acceptance]

ARM = Arm(robot_model('ur5e'))
OUTPUT = 'sec gripper():\n  set_standard_digital_out(2, True)\nend\n'
MOTION = (
    'def other():\n  movej(get_actual_joint_positions() + [0.1, 0, 0, 0, 0, 0], a=5, v=2)\nend\n'
)
ENDLESS = 'def other():\n  while True:\n    sync()\n  end\nend\n'


async def run(cell, script, within=3.0, **options):
    """Run a script, and return the answer."""
    answers, take = [], cell.owner._handle

    def handle(notice):
        if isinstance(notice, CallAnswered):
            answers.append(notice.answer)
        take(notice)

    cell.owner._handle = handle
    cell.owner.send(CallRobot(number=1, call=RunScriptCall(script=script, **options)))
    await cell.until(lambda: answers, within)
    cell.owner._handle = take
    return answers[0]


def start(cell):
    """Start a line of 0.1 m."""
    state = cell.memory.read()
    x, y, z = state.actual_tcp_pose.position
    there = replace(state.actual_tcp_pose, position=(x, y + 0.1, z))
    return cell.owner.start(
        plan(Goal(waypoints=(Waypoint(pose=there),)), state, ARM, PlanningOptions())
    )


def is_on(cell):
    return cell.robot.controller.io.digital_out.standard[2]


def test_a_secondary_program_runs_beside_a_goal():
    async def scenario(cell):
        motion = start(cell)
        await cell.sleep(0.1)
        answer = await run(cell, OUTPUT)
        assert answer.ok, answer.text
        assert is_on(cell)
        await cell.until(lambda: motion.outcome, 5.0)
        assert motion.outcome.succeeded, motion.outcome.text

    run_cell(scenario, allow_scripts=True)


def test_a_primary_program_moves_the_arm_and_ours_comes_back():
    async def scenario(cell):
        q = cell.memory.read().actual_q
        answer = await run(cell, MOTION, within=5.0)
        assert answer.ok, answer.text
        assert cell.memory.read().actual_q[0] == pytest.approx(q[0] + 0.1, abs=1e-4)
        motion = start(cell)
        await cell.until(lambda: motion.outcome, 5.0)
        assert motion.outcome.succeeded, motion.outcome.text

    run_cell(scenario, allow_scripts=True)


def test_a_primary_program_that_does_not_end_is_stopped():
    async def scenario(cell):
        answer = await run(cell, ENDLESS, within=6.0, timeout=1.0)
        assert answer.text == 'The script was sent, and it took longer than 1 s and was stopped.'
        assert cell.owner.status.state is ConnectionState.READY

    run_cell(scenario, allow_scripts=True)


def test_a_primary_program_that_ours_replaces_has_not_been_run():
    async def scenario(cell):
        cell.loop.call_later(0.5, cell.resend)
        answer = await run(cell, ENDLESS, timeout=60.0)
        assert not answer.ok
        assert answer.text.endswith('the robot program was sent again before it had ended.')
        assert cell.is_ready()
        assert (await run(cell, OUTPUT)).ok

    run_cell(scenario, allow_scripts=True)


@pytest.mark.parametrize(
    ('script', 'reason'),
    [
        ('sec a():\n  fly()\nend\n', 'fly'),
        ('sec a():\n  x = [1, 2][3]\nend\n', 'a secondary program failed: Runtime error (2:'),
        ('sec a():\n  sleep(1)\nend\n', 'sleep takes time'),
        ('def a():\n  x = [1, 2][3]\nend\n', 'the robot program failed in line 2'),
        ('def a():\n  x = = 1\nend\n', 'The script was not sent: line 2: a value is missing'),
        ('set_tcp(p[0,0,0,0,0,0])\n', "line 1: a program begins with 'def' or 'sec'"),
    ],
)
def test_what_is_wrong_with_a_script_is_the_answer(script, reason):
    async def scenario(cell):
        answer = await run(cell, script, within=5.0)
        assert not answer.ok
        assert reason in answer.text
        assert not answer.text.endswith('..')
        assert cell.owner.status.state is ConnectionState.READY

    run_cell(scenario, allow_scripts=True)


def test_a_primary_program_is_refused_during_a_goal_which_goes_on():
    async def scenario(cell):
        motion = start(cell)
        await cell.sleep(0.1)
        answer = await run(cell, MOTION)
        assert answer.text == 'The script was not sent: a goal is running; cancel it first.'
        await cell.until(lambda: motion.outcome, 5.0)
        assert motion.outcome.succeeded

    run_cell(scenario, allow_scripts=True)


def test_nothing_is_run_without_permission():
    async def scenario(cell):
        answer = await run(cell, OUTPUT)
        assert answer.text.startswith('The parameter allow_scripts is false')
        assert not is_on(cell)

    run_cell(scenario)


def test_a_robot_in_local_control_takes_no_script():
    async def scenario(cell):
        answer = await run(cell, MOTION)
        assert 'it needs headless_mode' in answer.text
        answer = await run(cell, OUTPUT)
        assert 'read-only when the robot is in local' in answer.text

    run_cell(scenario, headless=False, allow_scripts=True)


def test_a_primary_program_that_the_robot_does_not_begin_was_not_run():
    async def scenario(cell):
        cell.loop.freeze(PRIMARY)
        answer = await run(cell, MOTION, within=5.0)
        assert answer.text == 'The script was sent, but the robot did not begin it.'
        assert not answer.ok

    run_cell(scenario, allow_scripts=True)


def test_a_primary_program_that_ends_at_once_was_run():
    async def scenario(cell):
        answer = await run(cell, 'def other():\nend\n', within=5.0)
        assert answer.ok, answer.text

    run_cell(scenario, allow_scripts=True)


def test_a_long_script_is_parsed_outside_of_the_robot_loop(monkeypatch):
    in_thread = []

    async def to_thread(function, *arguments):
        in_thread.append(function)
        return function(*arguments)

    monkeypatch.setattr('asyncio.to_thread', to_thread)

    async def scenario(cell):
        answer = await run(cell, OUTPUT + '# long\n' * 1000, within=3.0)
        assert answer.ok, answer.text
        assert in_thread == [parse]

    run_cell(scenario, allow_scripts=True)


@pytest.mark.parametrize(
    'options',
    [{'script': ' '}, {'script': 'x', 'timeout': 1e4}, {'script': '#' * (MAX_SCRIPT_LENGTH + 1)}],
)
def test_calls_that_cannot_be_meant(options):
    with pytest.raises(LocalProtocolError, match=r'script|timeout'):
        RunScriptCall(**options)
