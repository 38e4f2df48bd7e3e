# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Slider and pause cost time, and change nothing else of the tool's path.

Slowed, paused and resumed, the tool stays on its path, no joint jumps, and a cancel while it is
slowed brakes as any other.
"""

from fault_goals import BlendGoal, GOALS
from fault_modes import APPEND, SERVO, SPLINE
from joint_trace import JointTrace
import pytest
from robot_cell import run_cell

from ur_cartesian_driver.motion.errors import ErrorCode

pytestmark = pytest.mark.slow

KINDS = {
    'PRIMITIVES': BlendGoal,
    **{mode.name: GOALS[mode.name] for mode in (SPLINE, SERVO, APPEND)},
}
#: Interventions in the middle of a goal, and how long they last [s].
DONE = {
    'slower and faster': [('slider 0.3', 0.1), ('slider 1', 0.2)],
    'to zero and up again': [('slider 0', 0.3), ('slider 1', 0.2)],
    'pause and play': [('pause', 0.3), ('play', 0.2)],
}
#: By execution mode: how far the tool may be off its path [m], and which accelerations a joint
#: may see [rad/s^2]. A program that pauses as the arm comes to a corner does not begin the blend.
#: servoj itself cuts bends, by lookahead^2 / 2 - 1 / gain times the acceleration of the tool: at
#: the defaults by 0.8 mm for each m/s^2, 1.4 mm on this half circle.
BOUNDS = {
    'PRIMITIVES': (0.005, 12.0),
    'SPLINE': (0.0002, 12.0),
    'SERVO': (0.0016, 15.0),
    'Appendable goals': (0.0002, 12.0),
}
#: A paused program calls no speedj or servoj any more, and the simulated controller then brakes as
#: hard as the last one was allowed to. As it goes on, servoj pulls by its gain times the lookahead
#: times the speed before.
PAUSED = {'SPLINE': 41.0, 'SERVO': 21.0, 'Appendable goals': 41.0}
MIDDLE = {
    'PRIMITIVES': 'mid-segment',
    'SPLINE': 'between points',
    'SERVO': 'between points',
    'Appendable goals': 'moving',
}


@pytest.mark.exhaustive
@pytest.mark.parametrize('what', DONE)
@pytest.mark.parametrize('kind', KINDS)
def test_a_tool_that_is_slowed_stays_on_its_path(kind, what):
    async def scenario(cell):
        goal, trace = KINDS[kind](cell), JointTrace(cell)
        goal.send()
        await trace.until(lambda: goal.is_in(MIDDLE[kind]), 2.0)
        goal.send_remaining_points(MIDDLE[kind])
        for fault, seconds in DONE[what]:
            cell.robot.inject(fault)
            over = cell.loop.time() + seconds
            await trace.until(lambda over=over: cell.loop.time() >= over, 1.0)
        await trace.until(lambda: goal.motion.outcome, 3.0)
        assert goal.motion.outcome.succeeded, goal.motion.outcome
        off, (_, strongest) = trace.max_path_deviation(goal), trace.max_speed_and_acceleration()
        farthest, most = BOUNDS[kind]
        assert off < farthest
        assert strongest < (PAUSED.get(kind, most) if what == 'pause and play' else most)

    run_cell(scenario)


@pytest.mark.exhaustive
@pytest.mark.parametrize('slider', ['1', '0.5'])
@pytest.mark.parametrize('kind', KINDS)
def test_a_cancel_brakes_and_is_no_protective_stop(kind, slider):
    async def scenario(cell):
        goal, trace = KINDS[kind](cell), JointTrace(cell)
        cell.robot.inject(f'slider {slider}')
        goal.send()
        await trace.until(lambda: goal.is_in(MIDDLE[kind]), 3.0)
        cell.owner.cancel()
        await trace.until(lambda: goal.motion.outcome, 0.4)
        assert goal.motion.outcome.code is ErrorCode.CANCELLED
        await trace.until(cell.at_rest, 0.05)
        assert cell.is_ready()
        assert trace.max_speed_and_acceleration()[1] < BOUNDS[kind][1]

    run_cell(scenario)
