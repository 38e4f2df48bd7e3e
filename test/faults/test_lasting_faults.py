# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Effects of faults that last: queues, dead connections, and their detection."""

from fault_cell import inject_cause, perform
from fault_goals import BlendGoal, planned
import pytest
import robot_cell
from robot_cell import CYCLE, run_cell

from ur_cartesian_driver.execution.monitoring.standstill import STANDSTILL_TIMEOUT
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.goal import IOCommand, OutputKind, Tolerance
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.protocol.program.reverse import MESSAGE_SIZE
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.primary_client import SILENCE_TIMEOUT

pytestmark = pytest.mark.slow


def unread(cell):
    """Number of messages on the reverse socket that the robot program has not read."""
    (end,) = cell.loop.open_ends(robot_cell.REVERSE)
    return len(end.protocol.incoming) // MESSAGE_SIZE


def test_a_pause_leaves_no_queue_behind_which_a_goal_would_wait():
    async def scenario(cell):
        cell.robot.pause_program()
        await cell.sleep(5.0)
        assert 1 <= unread(cell) <= 3, 'one for the pending read, and no more'
        await perform(cell, 'play')
        await cell.until(cell.is_ready)
        goal = BlendGoal(cell)
        goal.send()
        await cell.until(lambda: not cell.at_rest(), 0.1)
        await cell.until(lambda: goal.motion.outcome)
        assert goal.motion.outcome.succeeded, goal.motion.outcome

    run_cell(scenario)


@pytest.mark.parametrize('fault', ['half_open primary', 'drop primary for 1 s'])
def test_a_stop_is_followed_up_also_when_the_primary_interface_was_dead(fault):
    """Nothing else can end a program that is paused by a protective stop."""

    async def scenario(cell):
        await inject_cause(cell, fault)
        await cell.sleep(2.0 * SILENCE_TIMEOUT + 0.5)
        goal = BlendGoal(cell)
        await goal.bring_to('mid-segment')
        cell.robot.protective_stop()
        await cell.until(lambda: goal.motion.outcome, 0.2)
        await cell.until(lambda: cell.robot.state().runtime_state is RuntimeState.STOPPED, 0.5)
        await cell.until(lambda: cell.status.state is ConnectionState.STOPPED)

    run_cell(scenario)


def test_a_robot_is_not_ready_right_after_its_cable_was_unplugged():
    """The sockets of a program that has ended behind a cut cable look as if it was there."""

    async def scenario(cell):
        await inject_cause(cell, 'freeze all')
        await cell.until(lambda: cell.status.state is ConnectionState.DISCONNECTED)
        statuses = len(cell.owner.statuses)
        await cell.sleep(1.5)
        states = {status.state for status in cell.owner.statuses[statuses:]}
        assert ConnectionState.READY not in states
        assert ConnectionState.CONNECTED in states
        assert not cell.status.program_running
        assert 'resend' in cell.status.message

    run_cell(scenario)


def test_an_owner_that_hangs_up_stops_the_arm_and_the_program():
    async def scenario(cell):
        await BlendGoal(cell).bring_to('mid-segment')
        cell.owner.hang_up()
        assert await cell.until(cell.at_rest, 0.5) > 0.0
        await cell.until(lambda: cell.robot.state().runtime_state is RuntimeState.STOPPED, 0.5)

    run_cell(scenario)


def test_resend_during_a_goal_is_refused_and_the_goal_goes_on():
    async def scenario(cell):
        goal = BlendGoal(cell)
        await goal.bring_to('mid-segment')
        cell.resend()
        await cell.until(lambda: goal.motion.outcome)
        assert goal.motion.outcome.succeeded, goal.motion.outcome
        assert any('a goal is running' in line for line in cell.owner.log)

    run_cell(scenario)


def test_an_output_long_after_the_end_is_waited_for():
    """The arm is at rest until then, and no message was lost."""

    async def scenario(cell):
        late = IOCommand(
            waypoint=0,
            offset=2.0 * STANDSTILL_TIMEOUT,
            pin=1,
            value=1.0,
            output=OutputKind.STANDARD_DIGITAL,
        )
        motion = cell.owner.start(
            planned(cell.memory.read(), ((0.0, 0.01, 0.0),), 0.1, 1.0, io_commands=(late,))
        )
        await cell.until(lambda: motion.outcome, 3.0 * STANDSTILL_TIMEOUT)
        assert motion.outcome.succeeded, motion.outcome
        assert cell.robot.controller.io.digital_out.standard[1]

    run_cell(scenario)


@pytest.mark.parametrize('moment', ['before', 'after'])
def test_a_cancel_and_a_protective_stop_at_the_same_time_end_in_the_stop(moment):
    async def scenario(cell):
        goal = BlendGoal(cell)
        await goal.bring_to('mid-segment')
        if moment == 'before':
            cell.owner.cancel()
        cell.robot.protective_stop()
        if moment == 'after':
            cell.owner.cancel()
        await cell.until(lambda: goal.motion.outcome, 0.3)
        assert goal.motion.outcome.code is ErrorCode.PROTECTIVE_STOP

    run_cell(scenario)


#: Longest time from a push to standstill: the bound of the age, and braking [s].
REACTION = 0.3
#: Data rate of the robot's states [bytes/s].
NEEDED = 732 / CYCLE


@pytest.mark.parametrize('share', [0.9, 0.5, 0.1])
def test_on_a_congested_link_a_push_is_noticed_in_time_or_the_arm_has_stopped(share):
    """States queue up and come as regularly as ever, each older than the one before."""

    async def scenario(cell):
        begin = cell.memory.read()
        slow = planned(
            begin,
            ((0.0, 0.2, 0.0),),
            0.03,
            1.0,
            path_tolerance=Tolerance(position=(0.004,) * 3),
        )
        motion = cell.owner.start(slow)
        await cell.until(lambda: not cell.at_rest(), 0.2)
        await inject_cause(cell, f'throttle rtde {share * NEEDED:.0f}')
        await cell.sleep(2.5)
        await inject_cause(cell, 'offset pose z 0.01')
        await cell.until(cell.at_rest, REACTION)
        await cell.until(lambda: motion.outcome, 3.0)
        assert motion.outcome.code is ErrorCode.CONNECTION_LOST, motion.outcome
        refused = cell.owner.start(planned(begin, ((0.0, 0.01, 0.0),), 0.5, 1.0))
        await cell.until(lambda: refused.outcome, 0.1)
        assert refused.outcome.code is ErrorCode.ROBOT_NOT_READY
        assert 'max_state_age' in refused.outcome.text
        cell.robot.clear_faults()
        await cell.until(cell.is_ready, 3.0)
        assert cell.memory.read().state_age < 0.01
        following = cell.owner.start(planned(cell.memory.read(), ((0.0, 0.01, 0.0),), 0.5, 1.0))
        await cell.until(lambda: following.outcome)
        assert following.outcome.succeeded, following.outcome

    run_cell(scenario)
