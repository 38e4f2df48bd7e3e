# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The motion version of a robot: reported, set if a parameter says so, restored, and outlived.

Goals with blends, planned by the laws of motion version 1, meet a robot that moves by version 2.
Everything runs in virtual time.
"""

from dataclasses import replace
from math import sqrt

from fault_cell import inject_cause
from fault_goals import BLEND, BlendGoal, GOALS
from fault_modes import SERVO
from joint_trace import JointTrace
import pytest
from robot_cell import run_cell

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.sim.motion.paths.second_motion_version import SecondMotionVersion

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

FIRST, SECOND = ({'polyscope': '5.22', 'motion_version': number} for number in (1, 2))


def version(cell):
    """Return the motion version that the controller has now."""
    return cell.robot.controller.motion.motion_version


async def known(cell):
    """Return the motion version in the status, once the program has shown that it is ours."""
    await cell.until(lambda: cell.status.program_is_own)
    return cell.status.motion_version


@pytest.mark.parametrize(
    ('robot', 'reported', 'logged'),
    [
        ({'polyscope': '5.21'}, 1, 'The robot moves by motion version 1.'),
        ({'model': 'ur5', 'polyscope': '3.15'}, 1, 'The robot moves by motion version 1.'),
        (FIRST, 1, 'The robot moves by motion version 1.'),
        (SECOND, 2, 'The robot moves by motion version 2, but plans are made for version 1'),
        ({'polyscope': '10.14'}, 0, 'The motion version of the robot is unknown'),
    ],
)
def test_the_status_and_the_log_say_by_which_version_the_robot_moves(robot, reported, logged):
    async def scenario(cell):
        assert await known(cell) == reported
        assert [line for line in cell.owner.log if line.startswith(logged)]
        before = version(cell)
        cell.robot.inject('stop')
        await cell.until(lambda: not cell.status.program_is_own)
        assert cell.status.motion_version == 0
        assert version(cell) == before

    run_cell(scenario, robot=robot)


def test_the_version_is_unknown_while_the_robot_is_lost():
    async def scenario(cell):
        assert await known(cell) == 2
        cell.robot.inject('drop rtde')
        await cell.until(lambda: not cell.status.program_is_own)
        assert cell.status.motion_version == 0

    run_cell(scenario, robot=SECOND)


async def hang_up(cell):
    await cell.end_driver()
    await cell.start_driver()


async def hand_back(cell):
    await inject_cause(cell, 'hand back')


async def fall_silent(cell):
    await inject_cause(cell, 'freeze reverse')


async def cut_setpoints(cell):
    """Have the buffered servo end the program, because it gets no set-points."""
    goal = GOALS[SERVO.name](cell)
    goal.send()
    await cell.until(lambda: goal.is_in('between points'), 2.0)
    await inject_cause(cell, 'freeze set-points')
    log = cell.robot.controller.messages.log
    await cell.until(lambda: [line for line in log if 'buffered servo' in line])


@pytest.mark.parametrize('end', [hang_up, hand_back, fall_silent, cut_setpoints])
def test_a_version_that_is_asked_for_is_set_and_set_back(end):
    async def scenario(cell):
        assert await known(cell) == 1
        assert version(cell) == 1
        await end(cell)
        await cell.until(lambda: version(cell) == 2, 5.0)

    run_cell(scenario, robot=SECOND, motion_version=1)


def test_a_version_that_someone_else_has_set_meanwhile_stays():
    async def scenario(cell):
        set_other = 'sec other():\n  motion_version_set(1)\nend\n'
        assert await known(cell) == 2
        cell.robot.controller.programs.submit(set_other)
        await cell.until(lambda: version(cell) == 1)
        await hang_up(cell)
        await cell.until(lambda: not cell.robot.controller.programs.running, 5.0)
        assert version(cell) == 1

    run_cell(scenario, robot=FIRST | {'motion_version': 1}, motion_version=2)


def test_a_killed_program_cannot_set_it_back_but_one_from_the_pendant_does():
    async def scenario(cell):
        assert await known(cell) == 1
        cell.robot.inject('stop')
        await cell.until(lambda: cell.status.state is ConnectionState.CONNECTED)
        assert version(cell) == 1
        await cell.load_pendant_program()
        cell.robot.play_program()
        assert version(cell) == 2

    run_cell(scenario, robot=SECOND, motion_version=1)


def test_without_the_parameter_no_version_is_set():
    async def scenario(cell):
        assert await known(cell) == 2
        await hang_up(cell)
        await cell.until(lambda: not cell.robot.controller.programs.running, 5.0)
        assert version(cell) == 2

    run_cell(scenario, robot=SECOND)


@pytest.mark.parametrize('polyscope', ['5.21', '10.14'])
def test_software_without_versions_is_told_in_a_sentence(polyscope):
    async def scenario(cell):
        await cell.end_driver()
        cell.config = replace(cell.config, motion_version=2)
        await cell.start_driver()
        await cell.until(lambda: 'motion_version' in cell.status.message, 5.0)
        assert cell.status.message.endswith(
            f'motion_version is 2, but the software of the robot, {polyscope}.0, is not known to '
            'have motion versions (PolyScope 5 has them from 5.22 on); set motion_version to 0.'
        )
        assert cell.status.state is ConnectionState.DISCONNECTED

    run_cell(scenario, robot={'polyscope': polyscope})


#: The second version as it may be, and the smallest blend radius that the goal then gets [m].
FIGURES = {
    'as assumed': (SecondMotionVersion(), 0.9 * BLEND),
    'like version 1': (SecondMotionVersion(ramp_rise=0.0, blend_fraction=1.0), BLEND),
    'small blends': (SecondMotionVersion(blend_fraction=0.1), 0.1 * BLEND),
    # 0.1 of 50 mm for two blends: the first had got 5 mm, the second one asks for 13.5.
    'little room': (SecondMotionVersion(blend_share=0.1), 0.005 * 5.0 / (5.0 + 13.5)),
    'slow ramps': (SecondMotionVersion(ramp_rise=0.2), 0.9 * BLEND),
}


@pytest.mark.parametrize(('figures', 'radius'), FIGURES.values(), ids=FIGURES)
def test_a_goal_with_blends_that_are_reduced_stays_within_its_tolerance(figures, radius):
    async def scenario(cell):
        goal, trace = BlendGoal(cell), JointTrace(cell)
        goal.send()
        await trace.until(lambda: goal.motion.outcome, 5.0)
        assert goal.motion.outcome.succeeded, goal.motion.outcome
        # The parabola in a right corner passes it at the radius / sqrt(8).
        off = (BLEND - radius) / sqrt(8.0)
        assert trace.max_path_deviation(goal) == pytest.approx(off, abs=5e-5)

    run_cell(scenario, robot=SECOND | {'second_motion_version': figures})


CLAUSE = (
    '; the robot moves by motion version 2, but the plan follows the laws of version 1 '
    '(motion_version: 1 sets version 1)'
)


@pytest.mark.parametrize('robot', [FIRST, SECOND])
@pytest.mark.parametrize(
    ('phase', 'fault', 'code'),
    [
        ('mid-segment', 'offset pose y 0.01', ErrorCode.PATH_TOLERANCE_VIOLATED),
        ('last point', 'offset pose z 0.002', ErrorCode.GOAL_TOLERANCE_VIOLATED),
    ],
)
def test_a_goal_that_leaves_its_tolerance_says_if_the_versions_differ(phase, fault, code, robot):
    async def scenario(cell):
        goal = BlendGoal(cell)
        goal.send()
        await cell.until(lambda: goal.is_in(phase), 2.0)
        cell.robot.inject(fault)
        await cell.until(lambda: goal.motion.outcome, 3.0)
        assert goal.motion.outcome.code is code
        assert goal.motion.outcome.text.count(CLAUSE) == (robot is SECOND)

    run_cell(scenario, robot=robot)
