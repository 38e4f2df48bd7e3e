# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Outputs that have to be safe: pauses, whoever holds the inputs, and which goals need them.

The fault matrix has an output of this kind in each of its cells; here are the other cases. The
outputs are read from the controller. Everything runs in virtual time.
"""

import pytest
from robot_cell import RTDE, run_cell
from virtual_network import HOST

from ur_cartesian_driver.driver.ipc.channel import ArmSetup
from ur_cartesian_driver.driver.live_session import live_setup, stationary_job, stationary_plan
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    IOCommand,
    OutputKind,
    SafeOutput,
    Segment,
    Waypoint,
)
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec
from ur_cartesian_driver.robot.rtde.rtde_connection import RtdeConnection

pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.both_arms]

ARM = Arm(robot_model('ur5e'))
GLUE, VALVE = OutputKind.STANDARD_DIGITAL, OutputKind.CONFIGURABLE_DIGITAL
TOOL, ANALOG = OutputKind.TOOL_DIGITAL, OutputKind.STANDARD_ANALOG
ALL_KINDS = (
    SafeOutput(output=GLUE, pin=3, value=0.0),
    SafeOutput(output=GLUE, pin=7, value=1.0),
    SafeOutput(output=VALVE, pin=1, value=0.0),
    SafeOutput(output=TOOL, pin=1, value=0.0),
    SafeOutput(output=ANALOG, pin=0, value=0.0),
    SafeOutput(output=ANALOG, pin=1, value=0.25, domain=AnalogDomain.VOLTAGE),
)
MODES = (ExecutionMode.PRIMITIVES, ExecutionMode.SPLINE, ExecutionMode.SERVO)


def start_goal(cell, outputs, *, options=None, execution=ExecutionMode.PRIMITIVES, **fields):
    """Start a goal of one second and 5 cm."""
    state = cell.memory.read()
    x, y, z = state.actual_tcp_pose.position
    target = Pose((x, y + 0.05, z), state.actual_tcp_pose.quaternion)
    goal = Goal(
        waypoints=(Waypoint(pose=target, time=1.0),),
        execution=execution,
        safe_outputs=outputs,
        **fields,
    )
    return cell.owner.start(plan(goal, state, ARM, options or PlanningOptions()))


async def moving(cell):
    await cell.until(lambda: cell.memory.read().target_tcp_twist[1] > 0.03)


def switch_all_on(cell):
    """Put every output of ``ALL_KINDS`` where it is not safe."""
    io = cell.robot.controller.io
    io.digital_out.standard[3], io.digital_out.standard[7] = True, False
    io.digital_out.configurable[1] = io.digital_out.tool[1] = True
    io.analog_out_voltage[:] = [False, True]
    io.set_analog_out(0, 0.8)
    io.set_analog_out(1, 0.8)


def all_values(cell):
    """Return the outputs of ``ALL_KINDS``; analog ones in A and V."""
    io = cell.robot.controller.io
    return (
        io.digital_out.standard[3],
        io.digital_out.standard[7],
        io.digital_out.configurable[1],
        io.digital_out.tool[1],
        *(round(value, 6) for value in io.analog_out),
    )


SAFE = (False, True, False, False, 0.004, 2.5)


@pytest.mark.parametrize('execution', MODES, ids=lambda mode: mode.name)
@pytest.mark.parametrize('end', ['cancel', 'protective_stop', 'stop'])
def test_outputs_of_every_kind_become_safe(end, execution):
    """By the robot program, and by the driver where that is paused or gone."""

    async def scenario(cell):
        switch_all_on(cell)
        motion = start_goal(cell, ALL_KINDS, execution=execution)
        await moving(cell)
        assert all_values(cell) != SAFE
        if end == 'cancel':
            cell.owner.cancel()
        else:
            cell.robot.inject(end)
        await cell.until(lambda: motion.outcome)
        assert all_values(cell) == SAFE
        assert 'may not have been set' not in motion.outcome.text

    run_cell(scenario)


@pytest.mark.parametrize('execution', MODES, ids=lambda mode: mode.name)
def test_a_cancelled_goal_is_safe_before_the_arm_stands(execution):
    async def scenario(cell):
        switch_all_on(cell)
        start_goal(cell, ALL_KINDS, execution=execution)
        await moving(cell)
        cell.owner.cancel()
        await cell.until(lambda: all_values(cell) == SAFE, 0.1)
        assert not cell.at_rest()

    run_cell(scenario)


@pytest.mark.parametrize('execution', MODES, ids=lambda mode: mode.name)
def test_a_goal_that_succeeds_leaves_its_outputs_alone(execution):
    async def scenario(cell):
        switch_all_on(cell)
        before = all_values(cell)
        motion = start_goal(cell, ALL_KINDS, execution=execution)
        await cell.until(lambda: motion.outcome)
        assert motion.outcome.code is ErrorCode.SUCCESSFUL, motion.outcome
        await cell.sleep(0.5)
        cell.robot.inject('stop')
        await cell.sleep(0.5)
        assert all_values(cell) == before

    run_cell(scenario)


@pytest.mark.parametrize('execution', MODES, ids=lambda mode: mode.name)
@pytest.mark.parametrize('restore', [True, False])
def test_a_pause_makes_outputs_safe_and_only_those_that_may_be_are_restored(restore, execution):
    async def scenario(cell):
        outputs = cell.robot.controller.io.digital_out.standard
        outputs[3] = True
        glue = SafeOutput(output=GLUE, pin=3, value=0.0, restore=restore)
        motion = start_goal(cell, (glue,), execution=execution)
        await moving(cell)
        cell.robot.inject('pause')
        await cell.until(lambda: not outputs[3])
        await cell.sleep(1.0)
        assert not motion.outcome
        cell.robot.play_program()
        await cell.until(lambda: motion.outcome)
        assert outputs[3] is restore
        if restore:
            assert motion.outcome.code is ErrorCode.SUCCESSFUL, motion.outcome
        else:
            assert motion.outcome.code is ErrorCode.EXECUTION_FAILED
            assert motion.outcome.text.startswith(
                'A pause has changed the standard digital output 3, which safe_outputs does not '
                'name as one to be restored'
            )

    run_cell(scenario)


def test_an_output_that_a_goal_switches_where_the_arm_coasts_into_a_pause_is_not_restored():
    """The place at which it goes off lies where the arm brakes: off it stays."""

    async def scenario(cell):
        outputs = cell.robot.controller.io.digital_out.standard
        state = cell.memory.read()
        (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
        goal = Goal(
            waypoints=tuple(
                Waypoint(pose=Pose((x, y + dy, z), turned)) for dy in (0.01, 0.06, 0.12)
            ),
            segments=(Segment(velocity=0.1, acceleration=1.0, blend_radius=0.004),) * 3,
            io_commands=tuple(
                IOCommand(waypoint=k, offset=0.0, output=GLUE, pin=3, value=value)
                for k, value in ((0, 1.0), (1, 0.0))
            ),
            safe_outputs=(SafeOutput(output=GLUE, pin=3, value=0.0, restore=True),),
        )
        motion = cell.owner.start(plan(goal, state, ARM, PlanningOptions()))

        def at():
            return cell.memory.read().actual_tcp_pose.position[1] - y

        await cell.until(lambda: at() > 0.059)
        assert outputs[3]
        for _ in range(2):  # before the first one is over for the driver
            cell.robot.inject('pause')
            await cell.until(lambda: not outputs[3])
            await cell.until(lambda: cell.memory.read().runtime_state is RuntimeState.PAUSED)
            cell.robot.play_program()
            await cell.until(lambda: cell.memory.read().runtime_state is RuntimeState.PLAYING)
        assert 0.06 < at() < 0.1
        seen = []

        def ended():
            seen.append(bool(outputs[3]))
            return motion.outcome

        await cell.until(ended)
        assert motion.outcome.succeeded, motion.outcome
        assert not seen[-1]
        assert sum(seen) <= 2

    run_cell(scenario)


def test_a_pause_that_changes_nothing_ends_nothing():
    async def scenario(cell):
        motion = start_goal(cell, (SafeOutput(output=GLUE, pin=3, value=0.0),))
        await moving(cell)
        cell.robot.inject('pause')
        await cell.sleep(0.5)
        cell.robot.play_program()
        await cell.until(lambda: motion.outcome)
        assert motion.outcome.code is ErrorCode.SUCCESSFUL, motion.outcome

    run_cell(scenario)


def test_where_neither_way_works_result_and_status_say_so():
    """Another client holds the inputs of one kind; the other kind is made safe all the same."""

    async def scenario(cell):
        switch_all_on(cell)
        guest = RtdeConnection(
            RtdeClientCodec(
                outputs=('timestamp',),
                inputs=('standard_digital_output_mask', 'standard_digital_output'),
            ),
            lambda *_: None,
        )
        await guest.open(HOST, RTDE)
        motion = start_goal(cell, ALL_KINDS[:3])
        await moving(cell)
        cell.robot.inject('protective_stop')
        await cell.until(lambda: motion.outcome)
        assert all_values(cell)[:3] == (True, False, False)
        assert motion.outcome.code is ErrorCode.PROTECTIVE_STOP
        sentence = (
            'The standard digital output 3 and standard digital output 7 may not have been set'
        )
        assert sentence in motion.outcome.text
        assert sentence in cell.status.last_error
        assert 'configurable' not in motion.outcome.text
        guest.close()
        await cell.until(lambda: all_values(cell)[:3] == SAFE[:3])

    run_cell(scenario)


def test_waiting_outputs_are_switched_off_but_not_on():
    """They are due on the second segment, 0.4 s after the robot program has read them."""

    async def scenario(cell):
        state = cell.memory.read()
        outputs = cell.robot.controller.io.digital_out.standard
        outputs[0] = True
        x, y, z = state.actual_tcp_pose.position
        quaternion = state.actual_tcp_pose.quaternion
        goal = Goal(
            waypoints=tuple(
                Waypoint(pose=Pose((x, y + d, z), quaternion), time=time)
                for d, time in ((0.02, 0.5), (0.07, 1.5))
            ),
            io_commands=tuple(
                IOCommand(waypoint=0, offset=0.4, output=GLUE, pin=pin, value=value)
                for pin, value in ((0, 0.0), (1, 1.0))
            ),
        )
        motion = cell.owner.start(plan(goal, state, ARM, PlanningOptions()))
        await cell.until(lambda: cell.memory.read().points_begun == 2)
        await moving(cell)
        assert outputs[:2] == [True, False]
        cell.owner.cancel()
        await cell.until(lambda: motion.outcome)
        assert outputs[:2] == [False, False]

    run_cell(scenario)


def test_a_live_session_has_the_outputs_of_the_parameter():
    async def scenario(cell):
        switch_all_on(cell)
        state = cell.memory.read()
        motion = cell.owner.run(
            b'',
            stationary_job(stationary_plan(state, ALL_KINDS)),
            arm=ArmSetup.of(ARM),
            live=live_setup(ARM, state.target_q, PlanningOptions()),
        )
        await cell.until(lambda: motion.progress)
        assert all_values(cell) != SAFE
        cell.owner.cancel()
        await cell.until(lambda: motion.outcome)
        assert all_values(cell) == SAFE

    run_cell(scenario)


def test_the_parameter_holds_for_every_goal_unless_the_goal_says_otherwise():
    options = PlanningOptions(safe_outputs=('standard_digital 3 0', 'standard_digital 4 0', ''))

    async def scenario(cell):
        outputs = cell.robot.controller.io.digital_out.standard
        outputs[3] = outputs[4] = True
        own = SafeOutput(output=GLUE, pin=4, value=1.0)
        motion = start_goal(cell, (own,), options=options)
        await moving(cell)
        cell.owner.cancel()
        await cell.until(lambda: motion.outcome)
        assert outputs[3:5] == [False, True]

    run_cell(scenario)
