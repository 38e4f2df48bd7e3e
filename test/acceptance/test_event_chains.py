# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Result and status name the events that led to the end of a goal."""

import pytest
from robot_cell import PRIMARY, REVERSE, RobotCell, run_cell, TRAJECTORY

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]


def ended_by(
    fault, execution=ExecutionMode.PRIMITIVES, time=2.0, before=RobotCell.is_ready, **settings
):
    """
    Run a goal that something ends halfway; return outcome and the last status.

    :param before: what happens half a second before the goal.
    """

    async def scene(cell):
        before(cell)
        await cell.sleep(0.5)
        state = cell.memory.read()
        (x, y, z), turn = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
        made = plan(
            Goal(
                waypoints=(Waypoint(pose=Pose((x, y + 0.2, z), turn), time=time),),
                execution=execution,
            ),
            state,
            Arm(robot_model('ur5e')),
            PlanningOptions(max_tool_speed=1.0, calibration_known=True),
        )
        motion = cell.owner.start(made)
        await cell.until(lambda: not cell.at_rest())
        await fault(cell)
        await cell.until(lambda: motion.outcome is not None, 5.0)
        await cell.until(lambda: motion.outcome.text in cell.status.last_error)
        return motion.outcome, cell.status

    return run_cell(scene, **settings)


def whys(outcome):
    return [line.removeprefix('why: ') for line in outcome.report if line.startswith('why: ')]


async def cut_reverse(cell):
    cell.loop.cut(REVERSE)


async def cut_trajectory(cell):
    cell.loop.cut(TRAJECTORY)


async def freeze_reverse(cell):
    cell.loop.freeze(REVERSE)


async def stop_by_dashboard(cell):
    await cell.dashboard('stop')


async def protective_stop(cell):
    cell.robot.inject('protective_stop')


async def emergency_stop(cell):
    cell.robot.emergency_stop()


async def crash(cell):
    await cell.crash_robot()


async def exception(cell):
    cell.robot.inject('program_fault')


@pytest.mark.parametrize(
    ('fault', 'code', 'links'),
    [
        (cut_reverse, ErrorCode.PROGRAM_STOPPED, ['reverse_port: ', 'program PLAYING -> STOP']),
        (
            cut_trajectory,
            ErrorCode.PROGRAM_STOPPED,
            ['trajectory_port: ', 'program PLAYING -> STOP'],
        ),
        (
            freeze_reverse,
            ErrorCode.PROGRAM_STOPPED,
            [
                'the other side closed',
                'PLAYING -> STOP',
                'the robot program says: the driver was silent for too long',
            ],
        ),
        (
            stop_by_dashboard,
            ErrorCode.PROGRAM_STOPPED,
            ['the other side closed', 'program PLAYING -> STOP'],
        ),
        (
            protective_stop,
            ErrorCode.PROTECTIVE_STOP,
            ['safety mode NORMAL -> PROTECTIVE_STOP', 'the robot reports C'],
        ),
        (emergency_stop, ErrorCode.EMERGENCY_STOP, ['-> ROBOT_EMERGENCY_STOP']),
        (crash, ErrorCode.CONNECTION_LOST, ['RTDE: ']),
    ],
    ids=lambda value: getattr(value, '__name__', ''),
)
def test_the_chain_says_who_did_what_and_when(fault, code, links):
    outcome, status = ended_by(fault)
    assert outcome.code is code, outcome
    chain = whys(outcome)
    print(outcome.text, *chain, status.last_error, sep='\n')
    for link in links:
        assert any(link in line for line in chain), (link, chain)
    assert 'its timeout is 0.2 s; the longest pause between two was 0.02' in chain[-1]
    for line in chain:
        assert line.partition(' before: ')[2] in status.last_error


async def nothing(cell):
    """Do nothing: the fault happens by itself."""


def test_an_arm_that_cannot_follow_its_set_points_is_named_as_the_cause():
    outcome, _ = ended_by(nothing, ExecutionMode.SERVO, 1.0, servo_max_divergence=0.01)
    assert outcome.code is ErrorCode.PROGRAM_STOPPED
    assert any(
        'the robot program says: buffered servo: the arm is farther from a set-point than '
        'the divergence thresholds allow' in line
        for line in whys(outcome)
    ), outcome


def test_what_the_robot_reported_before_the_goal_is_no_cause_of_its_end():
    def fail_beside(cell):
        cell.loop.inject_data(PRIMARY, b'sec other():\n  x = [1][3]\nend\n')

    outcome, _ = ended_by(cut_trajectory, before=fail_beside)
    assert outcome.code is ErrorCode.PROGRAM_STOPPED
    assert 'secondary program' not in outcome.text
    assert any('secondary program failed' in line for line in whys(outcome))
