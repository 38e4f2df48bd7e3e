# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The commands in the documents print what the documents show.

A block begins with its commands, each after ``$``. The output is compared word by word, without
line breaks; ``...`` stands for anything. ``validate`` runs as it is; ``sim`` and ``send``
run as one cell in virtual time, where only the end of the goal is compared.
"""

from time import monotonic, sleep

from checkout import CHECKOUT, needs_checkout
from pages import assert_shows, console_examples
import pytest
from robot_cell import run_cell
from tracked_files import tracked_files

from ur_cartesian_driver.cli import main, parser
from ur_cartesian_driver.cli.commands import code_text, goal_file
from ur_cartesian_driver.driver import ConnectionState, Driver, DriverConfig
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.resources import share_path
from ur_cartesian_driver.ros.client import load_goal
from ur_cartesian_driver.ros.messages.goal_conversion import goal_from_message
from ur_cartesian_driver.sim import SimulatedRobot
from ur_cartesian_driver.sim.command_line.simulate import simulator_config
from ur_cartesian_driver.sim.faults.fault_values import AfterTime
from ur_cartesian_driver.sim.motion.contact.contact_bodies import ContactBody

pytestmark = needs_checkout

ERRORS = CHECKOUT / 'doc' / 'errors.md'
#: Pages whose commands need files of theirs: test_tutorials.py and test_cell_page.py run them.
FOLLOWED = {'tutorial_file', 'cell'}
#: Codes that no example of one goal and one robot can show.
WITHOUT_EXAMPLE = {ErrorCode.PREEMPTED}


def examples(document, *names):
    """Return the blocks whose first command is one of the names, as words and output."""
    return [
        (commands, shown)
        for commands, shown in console_examples(document)
        if commands and commands[0][:1] == ['ur-cartesian'] and commands[0][1] in names
    ]


def all_examples(*names):
    return [
        pytest.param(commands, shown, id=f'{document.stem}-{" ".join(commands[-1][1:])}')
        for document in tracked_files(CHECKOUT, 'doc/*.md')
        if document.stem not in FOLLOWED
        for commands, shown in examples(document, *names)
        if 'validate' in names or len(commands) == 2
    ]


# ---- without a robot ----------------------------------------------------------------------------


@pytest.mark.parametrize(('commands', 'shown'), all_examples('validate'))
def test_validate_says_what_the_document_shows(commands, shown, capsys):
    ((_, *words),) = commands
    main(words)
    due_outgoing = capsys.readouterr()
    assert_shows(shown, due_outgoing.out + due_outgoing.err)


# ---- with the simulated one ---------------------------------------------------------------------


def sent(cell, words):
    """Return the plan of a goal for the robot of a cell."""
    state = cell.memory.read()
    goal = goal_from_message(
        load_goal(goal_file(words.file)), Frames(), now=0, snapshot=ArmSnapshot.of(state)
    )
    return plan(goal, state, Arm(robot_model(cell.robot.config.model)), PlanningOptions())


def ended(sim, send, cancel_after):
    """Return the outcome of a goal with the faults and contacts of a ``sim`` command."""

    async def scenario(cell):
        cell.robot.inject(*sim.faults)
        cell.robot.controller.contact.bodies = tuple(map(ContactBody.parse, sim.contacts))
        motion = cell.owner.start(sent(cell, send))
        if cancel_after:
            await cell.until(lambda: len(motion.progress) > cancel_after)
            cell.owner.cancel()
        await cell.until(lambda: motion.outcome is not None, 60.0)
        return motion.outcome

    return run_cell(scenario)


def by_a_robot_that_is_not_ready(sim, send):
    """Return the outcome of a goal for a robot that cannot take it."""
    with (
        SimulatedRobot(simulator_config(sim)) as robot,
        Driver(
            DriverConfig(
                rtde_port=robot.ports.rtde,
                primary_port=robot.ports.primary,
                dashboard_port=robot.ports.dashboard,
                reverse_port=0,
                script_sender_port=0,
                trajectory_port=0,
                script_command_port=0,
                robot_loop='thread',
                headless_mode=True,
            )
        ) as driver,
    ):
        deadline = monotonic() + 10.0
        while driver.status.state is not ConnectionState.CONNECTED:
            assert monotonic() < deadline
            sleep(0.01)
        return driver.execute(goal_from_message(load_goal(goal_file(send.file)), Frames(), now=0))


def status_line(code, text):
    """Return the last line of ``send``."""
    if code is ErrorCode.SUCCESSFUL:
        return f'SUCCEEDED: {text}'
    status = 'CANCELED' if code is ErrorCode.CANCELLED else 'ABORTED'
    return f'{status}, {code_text(code)}: {text}'


@pytest.mark.slow
@pytest.mark.parametrize(('commands', 'shown'), all_examples('sim'))
def test_a_goal_ends_as_the_document_shows(commands, shown):
    (_, *sim), (_, *send) = commands
    started = parser().parse_args(
        [*sim, '--rtde-port', '0', '--primary-port', '0', '--dashboard-port', '0']
    )
    request = parser().parse_args(send)
    # A reader needs some time between the commands.
    assert not [fault for fault in started.faults if isinstance(fault.trigger, AfterTime)]
    if started.power_off:
        outcome = by_a_robot_that_is_not_ready(started, request)
    else:
        outcome = ended(started, request, cancel_after=20 if '^C' in shown else None)
    assert_shows(shown.replace('^C', '...'), status_line(outcome.code, outcome.text))


# ---- completeness -------------------------------------------------------------------------------


def test_every_code_has_an_example():
    shown = '\n'.join(output for _, output in examples(ERRORS, 'validate', 'sim'))
    missing = {code for code in ErrorCode if f'{code_text(code)}:' not in shown}
    assert missing == WITHOUT_EXAMPLE | {ErrorCode.SUCCESSFUL}
    assert 'SUCCEEDED: ' in shown


def test_every_goal_for_an_error_is_in_the_document():
    folder = share_path() / 'config' / 'examples' / 'errors'
    used = {
        word
        for commands, _ in examples(ERRORS, 'validate', 'sim')
        for words in commands
        for word in words
        if word.startswith('errors/')
    }
    assert used == {f'errors/{path.stem}' for path in tracked_files(folder, '*.yaml')}
