# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The watch for contact beside messages that come at the same time, for many delays between them.

The threads of the program are switched at random.
"""

import pytest
from robot_in_memory import RobotInMemory

from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.plan.primitive import MoveJ
from ur_cartesian_driver.protocol.program.script_command import (
    EndToolContactCommand,
    StartToolContactCommand,
    ToolContactResult,
)
from ur_cartesian_driver.sim.motion.contact.contact_bodies import ContactBody

HOME = (0.3, -1.4, 1.5, -1.6, -1.5, 0.2)
#: Cycles from the push to the messages; the answer to the push comes within these.
DELAYS = range(0, 46, 2)


def turned(by):
    return MoveJ(target=(HOME[0] + by, *HOME[1:]), velocity=1.0, acceleration=10.0)


@pytest.fixture(params=range(4))
def robot(request):
    return RobotInMemory('ur5e', interleaving_seed=request.param)


def push(robot):
    """Watch an arm at rest, and push its tool with 40 N from the side."""
    controller = robot.controller
    controller.contact.bodies = ()
    robot.place(HOME, IDENTITY)
    step(robot, 40)
    robot.send_command(StartToolContactCommand())
    step(robot, 10)
    robot.ask_to_idle()  # with this message the watch begins
    step(robot, 10)
    assert robot.contact_answers() == robot.late_results(0) == []
    x, y, z = controller.motion.T_base_tcp.position
    controller.contact.bodies = (ContactBody('plane', (x, y - 0.002, z), (0.0, -1.0, 0.0)),)


def step(robot, cycles):
    for _ in range(cycles):
        robot.controller.step()


def assert_takes_trajectories(robot):
    """Check that no point, result or answer of before is left."""
    robot.controller.contact.bodies = ()
    step(robot, 60)
    assert robot.contact_answers() == robot.late_results(0) == []
    run = robot.run([turned(0.02)])
    assert run.failure == ''
    assert run.q == pytest.approx(turned(0.02).target, abs=1e-6)


def test_a_trajectory_that_begins_beside_a_contact_ends_with_it(robot):
    results = set()
    for delay in DELAYS:
        push(robot)
        step(robot, delay)
        early = robot.late_results(0)
        run = robot.run([turned(-0.01), turned(-0.02)])
        answers = robot.contact_answers()
        if run.result is TrajectoryResult.TOUCHED:
            robot.cancel()  # as the driver does: START may have been read after this result
        step(robot, 60)
        answers += robot.contact_answers()
        assert answers == [ToolContactResult.SUCCESS], delay
        if early:  # the contact was over
            assert early == [TrajectoryResult.TOUCHED]
            assert run.result is TrajectoryResult.SUCCESS
        else:
            assert run.result is TrajectoryResult.TOUCHED
            assert robot.late_results(0) == [TrajectoryResult.CANCELED]
        results.add(run.result)
        assert_takes_trajectories(robot)
    assert results == {TrajectoryResult.TOUCHED, TrajectoryResult.SUCCESS}


def test_an_end_beside_a_contact_has_one_answer(robot):
    answers = set()
    for delay in DELAYS:
        push(robot)
        step(robot, delay)
        robot.send_command(EndToolContactCommand())
        step(robot, 80)
        (answer,) = robot.contact_answers()
        answers.add(answer)
        robot.late_results(0)
        robot.send_command(EndToolContactCommand())  # has no answer any more
        assert_takes_trajectories(robot)
    assert answers == set(ToolContactResult)
