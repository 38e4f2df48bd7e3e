# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The arm waits at a point for an input, or ends there; payloads change where it stands.

Places and times are read from RTDE, the payload from the controller; all in virtual time.
"""

from dataclasses import replace

import pytest
from robot_cell import run_cell

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    InputKind,
    InputWait,
    IOCommand,
    OutputKind,
    PayloadChange,
    SafeOutput,
    Segment,
    Waypoint,
)
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

ARM, OPTIONS = Arm(robot_model('ur5e')), PlanningOptions(max_tool_speed=1.0)
MODES = (ExecutionMode.PRIMITIVES, ExecutionMode.SPLINE, ExecutionMode.SERVO)
#: The torch, and the input that says that its arc burns.
TORCH, ARC = 1, 3
INERTIA = (0.01, 0.02, 0.03, -0.001, 0.002, 0.003)
DIGITAL = InputWait(waypoint=0, input=InputKind.STANDARD_DIGITAL, pin=ARC, value=1.0, timeout=1.0)


def start(cell, execution=ExecutionMode.PRIMITIVES, wait=DIGITAL, **fields):
    """Start a goal that goes 4 cm along y, lights the torch, waits, rests 0.2 s and goes on."""
    state = cell.memory.read()
    (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
    places = [Pose((x, y + 0.04, z), turned), Pose((x + 0.03, y + 0.04, z), turned)]
    goal = Goal(
        waypoints=tuple(
            Waypoint(pose=pose, time=time) for pose, time in zip(places, (0.5, 1.2), strict=True)
        ),
        segments=(Segment(dwell=0.2), Segment()),
        input_waits=(wait,),
        io_commands=(
            IOCommand(
                waypoint=0, offset=0.0, output=OutputKind.STANDARD_DIGITAL, pin=TORCH, value=1.0
            ),
        ),
        execution=execution,
        goal_time_tolerance=0.15,
        **fields,
    )
    motion = cell.owner.start(plan(goal, state, ARM, OPTIONS))
    return motion, lambda k: cell.memory.read().target_tcp_pose.distance_to(places[k]) < 1e-4


def inputs(cell):
    return cell.robot.controller.io.digital_in.standard


def torch(cell):
    return cell.robot.controller.io.digital_out.standard[TORCH]


@pytest.mark.parametrize('execution', MODES, ids=lambda mode: mode.name)
def test_the_arm_goes_on_when_the_input_has_come(execution):
    async def scenario(cell):
        motion, is_at = start(cell, execution)
        await cell.until(lambda: torch(cell))
        await cell.sleep(0.8)
        assert is_at(0)
        inputs(cell)[ARC] = True
        await cell.sleep(0.15)
        assert is_at(0)  # the dwell counts from the input
        gone = await cell.until(lambda: not is_at(0), 0.5)
        assert gone == pytest.approx(0.1, abs=0.08)
        await cell.until(lambda: motion.outcome, 3.0)
        # The wait is no delay of the motion: the tolerance of its time is less.
        assert motion.outcome.succeeded, motion.outcome.text
        assert is_at(1)

    run_cell(scenario)


@pytest.mark.parametrize('execution', MODES, ids=lambda mode: mode.name)
def test_a_wait_at_the_last_point_is_no_delay_either(execution):
    async def scenario(cell):
        motion, is_at = start(cell, execution, replace(DIGITAL, waypoint=1, timeout=5.0))
        await cell.until(lambda: is_at(1), 3.0)
        await cell.sleep(1.5)
        assert not motion.outcome
        inputs(cell)[ARC] = True
        await cell.until(lambda: motion.outcome, 0.5)
        assert motion.outcome.succeeded, motion.outcome.text

    run_cell(scenario)


@pytest.mark.parametrize('execution', MODES, ids=lambda mode: mode.name)
def test_an_input_that_does_not_come_ends_the_goal_by_its_name(execution):
    async def scenario(cell):
        safe = (SafeOutput(output=OutputKind.STANDARD_DIGITAL, pin=TORCH, value=0.0),)
        motion, is_at = start(cell, execution, safe_outputs=safe)
        await cell.until(lambda: torch(cell))
        waited = await cell.until(lambda: motion.outcome, 3.0)
        assert waited == pytest.approx(1.0, abs=0.1)
        assert motion.outcome.code is ErrorCode.EXECUTION_FAILED
        assert motion.outcome.text.startswith(
            'Standard digital input 3 on did not come within 1 s at point 0'
        )
        assert is_at(0)
        assert not torch(cell)
        again, _ = start(cell, execution)
        inputs(cell)[ARC] = True
        await cell.until(lambda: again.outcome, 5.0)
        assert again.outcome.succeeded, again.outcome.text

    run_cell(scenario)


def test_a_goal_may_go_on_without_the_input():
    async def scenario(cell):
        wait = InputWait(
            waypoint=0, input=InputKind.TOOL_DIGITAL, pin=1, value=1.0, timeout=0.5, go_on=True
        )
        motion, is_at = start(cell, wait=wait)
        await cell.until(lambda: is_at(0))
        assert await cell.until(lambda: not is_at(0), 2.0) == pytest.approx(0.75, abs=0.1)
        await cell.until(lambda: motion.outcome, 3.0)
        assert motion.outcome.succeeded, motion.outcome.text

    run_cell(scenario)


@pytest.mark.parametrize('below', [False, True])
@pytest.mark.parametrize('kind', [InputKind.STANDARD_ANALOG, InputKind.TOOL_ANALOG])
def test_the_level_of_an_analog_input_counts(kind, below):
    async def scenario(cell):
        io = cell.robot.controller.io
        levels = io.analog_in if kind is InputKind.STANDARD_ANALOG else io.tool_analog_in
        levels[1] = 6.1 if below else 5.9
        wait = InputWait(waypoint=0, input=kind, pin=1, value=6.0, below=below, timeout=3.0)
        motion, is_at = start(cell, wait=wait)
        await cell.until(lambda: is_at(0))
        await cell.sleep(0.6)
        assert is_at(0)
        levels[1] = 5.9 if below else 6.1
        await cell.until(lambda: motion.outcome, 3.0)
        assert motion.outcome.succeeded, motion.outcome.text

    run_cell(scenario)


@pytest.mark.parametrize('execution', MODES, ids=lambda mode: mode.name)
def test_a_pause_does_not_count_as_waiting(execution):
    async def scenario(cell):
        motion, _ = start(cell, execution)
        await cell.until(lambda: torch(cell))
        cell.robot.inject('pause')
        controller = cell.robot.controller
        await cell.until(lambda: controller.programs.state is RuntimeState.PAUSED)
        await cell.sleep(2.0)
        assert not motion.outcome
        await cell.dashboard('play')
        await cell.sleep(0.5)
        inputs(cell)[ARC] = True
        await cell.until(lambda: motion.outcome, 3.0)
        assert motion.outcome.succeeded, motion.outcome.text

    run_cell(scenario)


@pytest.mark.parametrize('execution', MODES, ids=lambda mode: mode.name)
def test_the_payload_changes_where_the_arm_stands(execution):
    async def scenario(cell):
        payload = PayloadChange(
            waypoint=0,
            mass=1.25,
            center_of_gravity=(0.0, 0.01, 0.06),
            inertia=INERTIA,
            transition_time=0.1,
        )
        before = cell.robot.controller.payload.mass
        motion, is_at = start(cell, execution, payload_changes=(payload,))
        await cell.until(lambda: torch(cell))
        assert cell.robot.controller.payload.mass == before
        inputs(cell)[ARC] = True
        await cell.until(lambda: cell.robot.controller.payload.mass == 1.25, 0.1)
        assert is_at(0)
        await cell.until(lambda: motion.outcome, 3.0)
        assert motion.outcome.succeeded, motion.outcome.text
        assert cell.robot.controller.payload.cog == pytest.approx((0.0, 0.01, 0.06))
        assert cell.robot.controller.payload.inertia == pytest.approx(INERTIA)

    run_cell(scenario)
