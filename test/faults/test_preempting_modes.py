# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Each execution mode preempts each other one, at once, and runs to its end."""

from fault_cell import return_home
from fault_goals import AppendGoal, BlendGoal, FreedriveGoal, GOALS
from joint_trace import JointTrace
import pytest
from robot_cell import run_cell

from ur_cartesian_driver.driver.ipc.channel import CancelMotion
from ur_cartesian_driver.motion.errors import ErrorCode

pytestmark = pytest.mark.slow

#: An arm that is held off its path is not where the next goal could begin, one that rests at a
#: point does not move, nor does one in a function, one that presses stops as PRIMITIVES do, and
#: one whose path has given way, or whose feed is slowed, as without.
KINDS = {'PRIMITIVES': BlendGoal, **GOALS}
LEFT_OUT = (
    'Waiting for the arm',
    'At a point',
    'At a point, SERVO',
    'Waits, SERVO',
    'Scripts',
    'Press',
    'Path offset',
    'Path offset, PRIMITIVES',
    'Replaced tails',
    'Rounded corners',
    'A part in the hand',
    'Feed override',
    'Feed override, SERVO',
)
for left_out in LEFT_OUT:
    del KINDS[left_out]
MIDDLE = {
    'PRIMITIVES': 'mid-segment',
    'SPLINE': 'between points',
    'SERVO': 'between points',
    'Appendable goals': 'moving',
    'Outputs': 'before the trigger pose',
    'Outputs, SERVO': 'before the trigger pose',
    'Pulses': 'between pulses',
    'Freedrive': 'freedrive',
}
#: No joint sees more [rad/s^2], whatever takes the place of what.
STRONGEST = 12.0


async def preempt_motion(cell, trace, first, second):
    """Preempt a goal in the middle of its path, and run the next one."""
    goal = KINDS[first](cell)
    goal.send()
    await trace.until(lambda: goal.is_in(MIDDLE[first]), 2.0)
    cell.owner.send(CancelMotion(motion=len(cell.owner.motions), preempted_by='goal 7'))
    await trace.until(lambda: goal.motion.outcome, 0.4)
    assert goal.motion.outcome.code is ErrorCode.PREEMPTED, (first, goal.motion.outcome)
    following = KINDS[second](cell)
    following.send()
    if isinstance(following, AppendGoal):
        await trace.until(lambda: following.is_in('moving'), 2.0)
        following.send_remaining_points('moving')
    await trace.until(lambda: following.motion.outcome, 4.0)
    outcome = following.motion.outcome
    assert outcome.succeeded, f'{second} after {first}: {outcome}'


@pytest.mark.exhaustive
@pytest.mark.parametrize('first', KINDS)
def test_any_execution_mode_preempts_any_other(first):
    async def scenario(cell):
        home = cell.robot.controller.motion.T_base_tcp.position
        for second in KINDS:
            if KINDS[second] is FreedriveGoal:
                continue
            trace = JointTrace(cell)
            await preempt_motion(cell, trace, first, second)
            assert trace.max_speed_and_acceleration()[1] < STRONGEST, (first, second)
            await return_home(cell, home, f'{second} after {first}')

    run_cell(scenario, allow_freedrive=True)
