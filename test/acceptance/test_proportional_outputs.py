# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
An analog output follows the speed of the tool: by its law in each cycle, safe at every end.

Speed and output are those that RTDE reports: nothing is taken from plan or feedback.
"""

import numpy as np
import pytest
from robot_cell import run_cell
from robot_in_memory import RobotInMemory

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, ProportionalOutput, Segment, Waypoint
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.sim.rtde_output_values import COMPUTED

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

ARM, OPTIONS, STEP = Arm(robot_model('ur5e')), PlanningOptions(), 0.002
HOME = (0.3, -1.4, 1.5, -1.6, -1.5, 0.2)
LAW = ProportionalOutput(
    first_waypoint=0, last_waypoint=2, pin=1, domain=AnalogDomain.VOLTAGE, gain=3.0, offset=0.05
)


def bead(state, output, execution=ExecutionMode.PRIMITIVES):
    """Return a run-up, two sides with a rounded corner between them, and a way out."""
    x, y, z = state.actual_tcp_pose.position
    places = [(0.03, 0.0), (0.03, 0.06), (0.09, 0.06), (0.12, 0.06)]
    waypoints = [
        Waypoint(pose=Pose((x + dx, y + dy, z), state.actual_tcp_pose.quaternion))
        for dx, dy in places
    ]
    radii = (0.005, 0.01, 0.005, 0.0)
    return Goal(
        waypoints=tuple(waypoints),
        segments=tuple(
            Segment(velocity=speed, acceleration=1.0, blend_radius=radius)
            for speed, radius in zip((0.2, 0.1, 0.2, 0.1), radii, strict=True)
        ),
        proportional_outputs=(output,),
        execution=execution,
    )


def recorded(output, slider=1.0):
    """Run it; return positions (n, 3), speeds and outputs (n,) by RTDE, and the goal."""
    robot = RobotInMemory('ur5e')
    state = robot.place(HOME, Pose((0.0, 0.02, 0.12)))
    goal = bead(state, output)
    made = plan(goal, state, ARM, OPTIONS)
    robot.controller.io.analog_out_voltage[:] = [True, True]
    robot.controller.io.set_analog_out(1, 0.0)
    robot.controller.set_slider(slider)
    rows = []

    def record(controller):
        pose = COMPUTED['actual_TCP_pose'](controller)
        twist = COMPUTED['actual_TCP_speed'](controller)
        rows.append((*pose[:3], np.hypot.reduce(twist[:3]), controller.io.analog_out[1]))

    run = robot.run(list(made.instructions), on_cycle=record)
    assert not run.failure
    table = np.array(rows)
    return table[:, :3], table[:, 3], table[:, 4] / 10.0, goal


def stretch(positions, goal):
    """Return the cycles in which the tool is nearest to first and last point of the output."""
    return [
        int(np.argmin(np.linalg.norm(positions - goal.waypoints[k].pose.position, axis=1)))
        for k in (0, 2)
    ]


@pytest.mark.parametrize('slider', [1.0, 0.4])
def test_the_output_is_the_law_of_the_measured_speed_in_each_cycle(slider):
    positions, speeds, outputs, goal = recorded(LAW, slider)
    begin, end = stretch(positions, goal)
    inside = slice(begin + 3, end - 3)
    # A program reads the speed of the cycle before.
    wanted = 0.05 + 3.0 * speeds[begin + 2 : end - 4]
    assert np.abs(outputs[inside] - wanted).max() < 1e-6
    assert np.ptp(speeds[inside]) > 0.05 * slider
    assert not outputs[: begin - 3].any()
    assert not outputs[end + 3 :].any()


def test_bounds_cut_and_the_filter_smooths():
    output = ProportionalOutput(
        first_waypoint=0,
        last_waypoint=2,
        pin=1,
        domain=AnalogDomain.VOLTAGE,
        gain=4.0,
        minimum=0.3,
        maximum=0.6,
        filter_time=0.05,
    )
    positions, speeds, outputs, goal = recorded(output)
    begin, end = stretch(positions, goal)
    filtered, wanted = speeds[begin - 1], []
    for speed in speeds[begin : end - 4]:
        filtered += (speed - filtered) * STEP / (0.05 + STEP)
        wanted.append(min(0.6, max(0.3, 4.0 * filtered)))
    assert np.abs(outputs[begin + 10 : end - 3] - wanted[9:]).max() < 0.01
    assert outputs[begin + 3 : end - 3].min() >= 0.3
    assert outputs.max() == pytest.approx(0.6)


def test_a_lead_is_a_way_at_the_planned_speed_whatever_the_slider():
    output = ProportionalOutput(
        first_waypoint=1,
        last_waypoint=2,
        pin=1,
        domain=AnalogDomain.VOLTAGE,
        gain=2.0,
        begin_lead=0.2,
        end_lead=0.1,
    )
    places = []
    for slider in (1.0, 0.4):
        positions, _, outputs, goal = recorded(output, slider)
        switched = np.flatnonzero(outputs)[[0, -1]]
        places.append(positions[switched])
        if slider == 1.0:
            there = [
                np.argmin(np.linalg.norm(positions - goal.waypoints[k].pose.position, axis=1))
                for k in (1, 2)
            ]
            assert (np.array(there) - switched) * STEP == pytest.approx([0.2, 0.1], abs=0.01)
    assert np.linalg.norm(places[0] - places[1], axis=1).max() < 0.001


async def flowing(cell):
    await cell.until(lambda: cell.robot.controller.io.analog_out[1] > 1.5, 5.0)


@pytest.mark.parametrize('end', ['cancel', 'protective_stop', 'stop', 'drop sockets', 'drop rtde'])
def test_it_is_idle_after_every_end(end):
    async def scenario(cell):
        state = cell.memory.read()
        motion = cell.owner.start(plan(bead(state, LAW), state, ARM, OPTIONS))
        await flowing(cell)
        if end == 'cancel':
            cell.owner.cancel()
        else:
            cell.robot.inject(end)
        await cell.until(lambda: motion.outcome, 3.0)
        assert not motion.outcome.succeeded
        await cell.until(lambda: cell.robot.controller.io.analog_out[1] == 0.0, 0.5)
        await cell.sleep(0.3)
        assert cell.robot.controller.io.analog_out[1] == 0.0

    run_cell(scenario)


def test_a_pause_makes_it_idle_and_it_follows_again_afterwards():
    async def scenario(cell):
        state = cell.memory.read()
        motion = cell.owner.start(plan(bead(state, LAW), state, ARM, OPTIONS))
        await flowing(cell)
        cell.robot.inject('pause')
        controller = cell.robot.controller
        await cell.until(lambda: controller.programs.state is RuntimeState.PAUSED)
        await cell.until(lambda: controller.io.analog_out[1] == 0.0, 0.3)
        await cell.dashboard('play')
        await flowing(cell)
        await cell.until(lambda: motion.outcome, 5.0)
        assert motion.outcome.succeeded, motion.outcome.text
        assert controller.io.analog_out[1] == 0.0

    run_cell(scenario)


def test_along_a_spline_it_follows_as_well():
    async def scenario(cell):
        state = cell.memory.read()
        (x, y, z), turned = state.actual_tcp_pose.position, state.actual_tcp_pose.quaternion
        goal = Goal(
            waypoints=tuple(
                Waypoint(
                    pose=Pose((x, y + 0.04 * k, z), turned),
                    time=0.5 * k,
                    twist=(0.0, 0.08 * (k < 4), 0.0, 0.0, 0.0, 0.0),
                )
                for k in range(1, 5)
            ),
            execution=ExecutionMode.SPLINE,
            proportional_outputs=(LAW,),
        )
        motion = cell.owner.start(plan(goal, state, ARM, OPTIONS))
        await flowing(cell)
        await cell.until(lambda: motion.outcome, 5.0)
        assert motion.outcome.succeeded, motion.outcome.text
        assert cell.robot.controller.io.analog_out[1] == 0.0

    run_cell(scenario)
