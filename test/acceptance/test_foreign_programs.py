# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A robot program that speaks the wire and nothing of ours gets no goal that only ours can execute.

The foreign program is the newest of the saved programs. Everything runs in virtual time.
"""

import pytest
from robot_cell import CABLE, PENDANT_PROGRAM, run_cell
from saved_program import saved_program
from virtual_network import HOST

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, IOCommand, OutputKind, Waypoint
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.protocol.program.registers import PROGRAM_VERSION
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.services.service_calls import WatchContactCall

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

ARM = Arm(robot_model('ur5e'))
OUTPUT = IOCommand(waypoint=0, offset=0.0, output=OutputKind.STANDARD_DIGITAL, pin=3, value=1.0)


async def run_goal(cell, **fields):
    """Run a goal of one point, 2 cm beside the tool; return its outcome."""
    state = cell.memory.read()
    x, y, z = state.actual_tcp_pose.position
    target = Pose((x, y + 0.02, z), state.actual_tcp_pose.quaternion)
    goal = Goal(waypoints=(Waypoint(pose=target, time=1.0),), **fields)
    motion = cell.owner.start(plan(goal, state, ARM, PlanningOptions(allow_tcp_change=True)))
    await cell.until(lambda: motion.outcome)
    return motion.outcome


async def play(cell, text):
    """Have the pendant play a program in the place of the one that runs."""
    cell.robot.inject('stop')
    await cell.until(lambda: cell.status.state is ConnectionState.CONNECTED)
    assert not cell.robot.controller.programs.load(PENDANT_PROGRAM, text)
    cell.robot.play_program()
    await cell.until(cell.is_ready)


def registers(cell):
    """Return version, number and count, which identify the program on the robot."""
    return tuple(cell.robot.controller.io.outputs.integers[32:35])


async def check_refusal(cell, needs, **fields):
    """Check that a goal is refused in one sentence, before anything moves."""
    before = cell.q
    outcome = await run_goal(cell, **fields)
    assert outcome.code is ErrorCode.ROBOT_NOT_READY
    assert outcome.text == (
        f"The goal has {needs}, for which the robot has to run this driver's program, and "
        'the running program has not identified itself as ours; call resend_robot_program '
        '(headless_mode), or play a program whose External Control node fetches it from here.'
    )
    assert cell.q == before
    assert cell.robot.controller.io.digital_out.standard[3] is False
    assert not cell.status.program_is_own


def test_a_foreign_program_executes_what_it_can_and_nothing_else():
    """Also where ours ran before it and left its registers behind."""

    async def scenario(cell):
        assert cell.status.program_is_own
        left_behind = registers(cell)
        assert left_behind[0] == PROGRAM_VERSION
        await play(cell, saved_program('2.14', HOST))
        await check_refusal(cell, 'outputs (io_commands)', io_commands=(OUTPUT,))
        await check_refusal(
            cell, 'another TCP than the robot has', T_flange_controlled=Pose((0.0, 0.0, 0.01))
        )
        assert registers(cell) == left_behind
        call = cell.owner.call(WatchContactCall())
        await cell.until(lambda: call in cell.owner.call_answers)
        refusal = cell.owner.call_answers[call]
        assert not refusal.ok
        assert refusal.text.startswith('This is a watch for contact, for which the robot has to ')
        outcome = await run_goal(cell)
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome.text

    run_cell(scenario, headless=False)


def test_our_program_is_known_again_on_each_connection():
    async def scenario(cell):
        text = await cell.fetch_program()
        for _ in range(2):
            outcome = await run_goal(cell, io_commands=(OUTPUT,))
            assert outcome.code is ErrorCode.SUCCESSFUL, outcome.text
            assert cell.robot.controller.io.digital_out.standard[3] is True
            cell.robot.controller.io.digital_out.standard[3] = False
            shown = registers(cell)
            await play(cell, text)
            await cell.until(lambda: cell.status.program_is_own)
            assert registers(cell) == (*shown[:2], shown[2] + 1)

    run_cell(scenario, headless=False)


@pytest.mark.parametrize('register', ['version', 'number'])
def test_our_program_of_another_driver_is_foreign(register):
    """It shows itself, with the number of the driver that made it, or with an older version."""

    async def scenario(cell):
        text, (version, number, _) = await cell.fetch_program(), registers(cell)
        old = {
            'version': f'PROGRAM_VERSION = {version}\n',
            'number': f'PROGRAM_NUMBER = {number}\n',
        }
        new = {'version': 'PROGRAM_VERSION = 0\n', 'number': f'PROGRAM_NUMBER = {number ^ 1}\n'}
        assert text.count(old[register]) == 1
        await play(cell, text.replace(old[register], new[register]))
        await check_refusal(cell, 'outputs (io_commands)', io_commands=(OUTPUT,))

    run_cell(scenario, headless=False)


def test_a_program_that_started_while_the_cable_was_cut_is_not_replaced():
    """The robot sent no state in which no program ran, and our sockets look connected."""

    async def scenario(cell):
        cell.loop.cut_cable(CABLE)
        await cell.until(lambda: not cell.robot.controller.programs.running)
        cell.robot.run_script('def other():\n  while True:\n    sync()\n  end\nend\n')
        await cell.until(lambda: cell.status.state is ConnectionState.DISCONNECTED)
        cell.loop.cut_cable(())
        await cell.until(lambda: cell.status.message.startswith('Another program runs'), 5.0)
        cell.resend()
        await cell.until(lambda: any('another program runs' in line for line in cell.owner.log))
        await cell.sleep(0.5)
        assert cell.robot.state().program == 'other'
        assert cell.robot.controller.programs.running

    run_cell(scenario)
