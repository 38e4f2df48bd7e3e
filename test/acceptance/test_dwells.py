# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The arm rests at points, as long as asked, and whatever happens meanwhile.

Places and times are read from RTDE. Everything runs in virtual time.
"""

import pytest
from robot_cell import CYCLE, run_cell

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    IOCommand,
    OutputKind,
    Segment,
    Tolerance,
    Waypoint,
)
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.both_arms]

ARM, OPTIONS = Arm(robot_model('ur5e')), PlanningOptions(max_tool_speed=1.0)
MODES = (ExecutionMode.PRIMITIVES, ExecutionMode.SPLINE, ExecutionMode.SERVO)
TIMES, DWELL = (0.5, 1.5), 0.5


class Journey:
    """A corner with a dwell in it, and when RTDE has the target of the arm there."""

    def __init__(self, cell, execution=ExecutionMode.PRIMITIVES, times=TIMES, late=0.1, **fields):
        state = cell.memory.read()
        (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
        self.places = [Pose((x, y + 0.04, z), turned), Pose((x + 0.03, y + 0.04, z), turned)]
        self.cell, self.seen = cell, []
        goal = Goal(
            waypoints=tuple(
                Waypoint(pose=pose, time=time)
                for pose, time in zip(self.places, times, strict=True)
            ),
            segments=(Segment(dwell=DWELL), Segment()),
            execution=execution,
            path_tolerance=Tolerance(position=(0.002,) * 3),
            goal_tolerance=Tolerance(position=(0.001,) * 3),
            goal_time_tolerance=late,
            **fields,
        )
        self.plan = plan(goal, state, ARM, OPTIONS)
        self.motion = cell.owner.start(self.plan)

    def look(self):
        return self.cell.collect(self.seen)

    def is_there(self, state, index=0):
        return state.target_tcp_pose.distance_to(self.places[index]) < 1e-4

    async def rests(self):
        await self.cell.until(lambda: self.is_there(self.look()), 5.0)
        # Not in the first cycles, in which it may still arrive.
        await self.cell.sleep(0.3 * DWELL)
        assert self.motion.outcome is None

    async def end(self, bound=10.0):
        return await self.cell.record(self.motion, self.seen, bound)

    def rested(self):
        """Return for how long the target was at the first point [s]."""
        times = [state.timestamp for state in self.seen if self.is_there(state)]
        return times[-1] - times[0]

    def arrival(self):
        """Return when the target was at the last point, from its first movement on [s]."""
        start = self.seen[0].target_tcp_pose
        begun = next(s for s in self.seen if s.target_tcp_pose.distance_to(start) > 1e-7)
        there = next(s for s in self.seen if self.is_there(s, 1))
        return there.timestamp - begun.timestamp


@pytest.mark.parametrize('slider', [1.0, 0.5])
@pytest.mark.parametrize('execution', MODES, ids=lambda mode: mode.name)
def test_the_arm_rests_as_long_as_asked(execution, slider):
    async def scenario(cell):
        cell.robot.set_speed_slider(slider)
        await cell.sleep(2 * CYCLE)
        journey = Journey(cell, execution, late=0.3 if execution is ExecutionMode.SERVO else 0.1)
        outcome = await journey.end()
        assert outcome.succeeded, outcome.text
        streamed = execution is ExecutionMode.SERVO
        dwell = DWELL / slider if streamed else DWELL
        # Within the last tenth of a millimetre the arm is slow; servoj takes a while to get there.
        slow = -0.12 if streamed else 0.05
        assert journey.rested() == pytest.approx(dwell + slow / slider, abs=0.06 / slider)
        motion = TIMES[-1] - DWELL
        arrives = motion / slider + dwell - slow * streamed
        assert journey.arrival() == pytest.approx(arrives, abs=0.1 / slider)
        # Progress is in the controller's time, in which a dwell of the program is real.
        resting = [p.time for p in journey.motion.progress if 0.55 < p.time < 0.95]
        assert len(resting) > 5

    run_cell(scenario)


def test_times_are_the_same_with_speeds():
    async def scenario(cell):
        journey = Journey(cell, times=(0.0, 0.0))
        assert (await journey.end()).succeeded
        assert journey.rested() == pytest.approx(DWELL + 0.02, abs=0.03)

    run_cell(scenario)


def test_outputs_switch_while_the_arm_rests():
    async def scenario(cell):
        outputs = cell.robot.controller.io.digital_out.standard
        begun = {}
        journey = Journey(
            cell,
            io_commands=tuple(
                IOCommand(
                    waypoint=0,
                    offset=offset,
                    output=OutputKind.STANDARD_DIGITAL,
                    pin=pin,
                    value=1.0,
                )
                for pin, offset in enumerate((0.0, 0.2, 0.4, DWELL + 0.2))
            ),
        )

        def watch():
            now = journey.look()
            for pin in range(4):
                if outputs[pin]:
                    begun.setdefault(pin, now)
            return journey.motion.outcome

        await cell.until(watch, 10.0)
        assert journey.motion.outcome.succeeded, journey.motion.outcome.text
        after = [begun[pin].timestamp - begun[0].timestamp for pin in range(4)]
        assert after == pytest.approx([0.0, 0.2, 0.4, DWELL + 0.2], abs=0.03)
        assert [journey.is_there(begun[pin]) for pin in range(4)] == [True] * 3 + [False]

    run_cell(scenario)


@pytest.mark.parametrize('execution', MODES, ids=lambda mode: mode.name)
def test_a_pause_makes_the_rest_longer(execution):
    async def scenario(cell):
        journey = Journey(cell, execution, late=0.3)
        await journey.rests()
        cell.robot.inject('pause')
        controller = cell.robot.controller
        await cell.until(lambda: controller.programs.state is RuntimeState.PAUSED)
        await cell.sleep(1.0)
        assert journey.is_there(journey.look())
        await cell.dashboard('play')
        outcome = await journey.end()
        assert outcome.succeeded, outcome.text
        assert journey.rested() > DWELL + 1.0 - 0.1

    run_cell(scenario)


@pytest.mark.parametrize('execution', MODES, ids=lambda mode: mode.name)
def test_a_cancelled_rest_ends_at_once(execution):
    async def scenario(cell):
        journey = Journey(cell, execution)
        await journey.rests()
        cell.owner.cancel()
        outcome = await journey.end(0.4)
        assert outcome.code is ErrorCode.CANCELLED
        await cell.sleep(2.0 * DWELL)
        assert journey.is_there(journey.look())
        again = Journey(cell, execution, late=0.3)
        assert (await again.end()).succeeded

    run_cell(scenario)
