# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Goals that follow the twin of the arm that executes them, and of one that it is not.

The robot moves by the laws of the twin. Goals run in virtual time.
"""

from dataclasses import replace
from itertools import pairwise

from fault_goals import BLEND, BlendGoal, OPTIONS, square_plan
from joint_trace import JointTrace
import pytest
from robot_cell import run_cell
from twin_errors import measured_twin, true_twin
from waiting import wait_for

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, Waypoint
from ur_cartesian_driver.motion.twin.twin import ArmIdentity
from ur_cartesian_driver.motion.twin.twin_file import twin_text

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

TRUE = true_twin(
    3, 'ur5e', blend_begin=0.6, blend_speed_ratio=1.4, idle_between_moves=0.03, start_time=0.16
)


def goal_class(twin, blend=BLEND):
    """Return a goal of three lines whose plan follows a twin."""

    class TwinGoal(BlendGoal):
        def plan_from(self, start):
            self.assumed = square_plan(start.state, blend=blend)
            return square_plan(start.state, options=replace(OPTIONS, twin=twin), blend=blend)

    return TwinGoal


async def run(cell, kind):
    """Run a goal; return it, its trace, and how long the joints moved [s]."""
    goal, trace = kind(cell), JointTrace(cell)
    goal.send()
    await trace.until(lambda: goal.motion.outcome, 10.0)
    moving = [i for i, (a, b) in enumerate(pairwise(trace.rows)) if a != b]
    return goal, trace, (moving[-1] - moving[0] + 1) * cell.robot.controller.cycle


@pytest.mark.parametrize('imperfect', ['', '1'])
@pytest.mark.parametrize('blend', [BLEND, 0.0], ids=['blends', 'stops'])
def test_a_goal_by_the_twin_of_the_arm_takes_the_planned_time_and_path(blend, imperfect):
    async def scenario(cell):
        twin = measured_twin(TRUE, 1, error=0.005)
        await run(cell, goal_class(twin, blend))  # the first motion of the program is slow
        await cell.until(lambda: cell.robot.controller.motion.steady)
        goal, trace, took = await run(cell, goal_class(twin, blend))
        assert goal.motion.outcome.succeeded, goal.motion.outcome
        # As goals without a twin: a few cycles.
        assert took == pytest.approx(goal.plan.duration, abs=0.01)
        assert trace.max_path_deviation(goal) < 2e-4
        # By the assumed laws, time and monitor would be farther off.
        assert took > goal.assumed.duration + 0.025
        tolerance, wider = (
            each.reference.blend_tolerance.max() for each in (goal.plan, goal.assumed)
        )
        assert tolerance < 0.1 * wider or not blend

    run_cell(scenario, robot={'twin': TRUE}, imperfect=imperfect)


def test_an_arm_that_is_not_that_of_the_twin_ends_the_goal_if_its_blends_are_far_off():
    """A twin is trusted as far as its intervals: beyond, the arm executes another motion."""

    async def scenario(cell):
        small = true_twin(3, 'ur5e', blend_begin=0.1, blend_speed_ratio=1.0)
        goal, trace, _ = await run(cell, goal_class(small))
        assert trace.max_path_deviation(goal) > 0.003
        assert goal.motion.outcome.code is ErrorCode.EXECUTION_FAILED

    run_cell(scenario)


@pytest.mark.parametrize(
    ('serial_number', 'allowed', 'words'),
    [
        ('20000000000', False, 'planned as measured on this arm, 2026-11-27: blend_begin 0.6'),
        ('20235501234', False, 'serial number 20235501234, not 20000000000; the plan does not'),
        ('20235501234', True, 'planned as measured on another arm, 2026-11-27: blend_begin 0.6'),
    ],
)
def test_the_driver_compares_the_twin_with_the_robot(
    make_driver, tmp_path, serial_number, allowed, words
):
    arm = ArmIdentity(
        model='ur5e', serial_number=serial_number, software='5.21.0', motion_version=1
    )
    file = tmp_path / 'twin.yaml'
    file.write_text(twin_text(replace(TRUE, arm=arm)))
    driver = make_driver({'twin_file': str(file), 'allow_other_twin': allowed})
    driver.wait_ready(30.0)
    wait_for(lambda: driver.status.serial_number and driver.status.motion_version)
    pose = driver.state.actual_tcp_pose
    x, y, z = pose.position
    goal = Goal(
        waypoints=(
            Waypoint(pose=replace(pose, position=(x, y + 0.05, z))),
            Waypoint(pose=replace(pose, position=(x + 0.05, y + 0.05, z))),
        ),
        segments=(Segment(blend_radius=0.01), Segment()),
    )
    assert any(words in line for line in driver.plan(goal).report)
