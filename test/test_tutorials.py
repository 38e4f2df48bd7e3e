# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The tutorials, followed: the programs that a reader saves run, and print what the pages show."""

import os
import re
from runpy import run_path
import subprocess
import sys

from checkout import CHECKOUT, needs_checkout
from pages import assert_shows, console_examples, save_files, saved_files
import pytest
from robot_cell import run_cell

from ur_cartesian_driver.cli import main, parser
from ur_cartesian_driver.cli.plan_commands import GoalPlanning
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot
from ur_cartesian_driver.path import Frames, Pose, StaticFrame
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.sim.simulator_config import HOME

pytestmark = needs_checkout

DOC = CHECKOUT / 'doc'
SEAM, FILE, NODE = (
    DOC / f'{name}.md' for name in ('tutorial_seam', 'tutorial_file', 'pytest_plugin')
)


def test_what_a_reader_saves_is_known_here():
    """client.py of getting started is run by test_readme.py, the others below."""
    pages = re.findall(r'^(\w+)$', (DOC / 'tutorials.md').read_text('utf-8'), re.MULTILINE)
    assert [name for page in pages for name in saved_files(DOC / f'{page}.md')] == [
        'client.py',
        'first.py',
        'slot.nc',
        'my_cell.py',
        'test_my_cell.py',
    ]


def run_python(*words, folder):
    """Run Python in a folder, and return its output."""
    ended = subprocess.run(
        [sys.executable, *words],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=60,
        check=False,
        cwd=folder,
        # What this run was told does not hold for that one.
        env={name: value for name, value in os.environ.items() if not name.startswith('PYTEST_')},
    )
    assert ended.returncode == 0, ended.stdout
    return ended.stdout


def shown_for(page, *words):
    """Return the output that a page shows for a command, the last one of its block."""
    (shown,) = [shown for commands, shown in console_examples(page) if commands[-1] == [*words]]
    return shown


@pytest.mark.slow
def test_the_first_path_is_planned_and_executed_as_shown(ur_sim, tmp_path):
    address, ports = "robot_ip='127.0.0.1'", ur_sim.ports
    there = f'{address}, rtde_port={ports.rtde}, primary_port={ports.primary}, ' + ', '.join(
        f'{name}_port=0' for name in ('reverse', 'script_sender', 'trajectory', 'script_command')
    )
    program = saved_files(SEAM)['first.py']
    assert address in program
    # Robot and test share this interpreter, which can be busy for longer than 0.2 s.
    there += ', robot_receive_timeout=10.0, max_state_age=0.0'
    (tmp_path / 'first.py').write_text(program.replace(address, there), encoding='utf-8')
    assert_shows(shown_for(SEAM, 'python', 'first.py'), run_python('first.py', folder=tmp_path))


def test_the_seam_of_the_page_is_that_of_the_example():
    (shown,) = re.findall(
        r'^```python\n(from \S+ import deg,.*?)^```$',
        SEAM.read_text('utf-8'),
        re.DOTALL | re.MULTILINE,
    )
    example = (CHECKOUT / 'examples' / 'seam.py').read_text('utf-8')
    code = {line.partition('  #')[0].strip() for line in example.splitlines()}
    lines = [line.partition('  #')[0].strip() for line in shown.splitlines()]
    assert [
        line
        for line in lines
        if line not in code
        and line not in ('seam = (', "Path(frame='part', tool='nozzle')")
        and not line.startswith('from ')
    ] == []


def test_the_margins_of_the_seam_before_and_after_the_part_is_moved_are_those_of_the_page():
    example = run_path(str(CHECKOUT / 'examples' / 'seam.py'))
    page = SEAM.read_text('utf-8')
    (moved,) = re.findall(r'move the part by 5 cm: `Pose\(\((.*?)\)\)`', page)
    part, nozzle = example['FRAMES']
    arm = Arm(robot_model('ur5e'))
    state = state_at_rest(arm, HOME)
    margins = []
    for x, y, z in part.T_parent_frame.position, map(float, moved.split(',')):
        at = StaticFrame('part', 'base', Pose((x, y, z)))
        frames = Frames(static_frames=[at, nozzle])
        goal = example['seam']().goal(frames, ArmSnapshot.of(state))
        report = '\n'.join(plan(goal, state, arm, PlanningOptions()).report)
        margins += re.findall(r'tightest margin: (\S+) rad', report)
    assert f'from {margins[0]} to {margins[1]} rad' in page


@pytest.mark.slow
def test_a_file_becomes_a_goal_and_moves_the_arm_as_shown(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    save_files(FILE, tmp_path)
    *planning, ((send,), ending) = console_examples(FILE)
    assert [words[1] for (words,), _ in planning] == ['import', 'validate', 'show']
    for (words,), shown in planning[:2]:  # test_motion_page.py has pages enough
        assert main(words[1:]) == 0
        printed = capsys.readouterr()
        assert_shows(shown, printed.err + printed.out)
    (validate,) = planning[1][0]
    found = GoalPlanning(parser().parse_args(validate[1:])).plan()
    assert send == ['ur-cartesian', 'send', validate[2]]

    async def scenario(cell):
        motion = cell.owner.start(found)
        await cell.until(lambda: motion.outcome, 20.0)
        return motion.outcome

    outcome = run_cell(scenario)
    assert outcome.succeeded
    assert_shows(ending, f'SUCCEEDED: {outcome.text}')


@pytest.mark.slow
def test_the_test_of_a_node_of_the_readers_own_passes(tmp_path):
    save_files(NODE, tmp_path)
    printed = run_python('-m', 'pytest', 'test_my_cell.py', folder=tmp_path)
    # pytest captures nothing while it prints a dot; what a node logs just then stands behind it.
    dots = re.sub(r'\[INFO\] \[[\d.]+\] .*\n', '', printed)
    assert_shows(shown_for(NODE, 'pytest', 'test_my_cell.py'), dots)
