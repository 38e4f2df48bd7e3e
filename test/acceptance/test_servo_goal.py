# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""SERVO, from the goal to the simulated arm, in virtual time: as SPLINE, within its lag."""

from dataclasses import replace

from example_goals import example_goal, stretch_times
import numpy as np
import pytest
import robot_cell
from robot_cell import CYCLE, run_cell
from virtual_network import HOST

from ur_cartesian_driver.driver.ipc.channel import MotionProgress, ServoProgress
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.motion.state.servo_report import ServoActivity
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.geometry.tool_spline import ToolSpline
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.spline.spline_planner import SplineState
from ur_cartesian_driver.planning.spline.spline_points import tool_points
from ur_cartesian_driver.protocol.program import registers
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec
from ur_cartesian_driver.robot.rtde.rtde_connection import RtdeConnection

pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.both_arms]

ARM = Arm(robot_model('ur5e'))


class Run:
    """A goal that is executed, as its owner and the robot's clock see it."""

    def __init__(self, cell, goal):
        self.cell, self.packets, self.reports, self.progress = cell, [], [], []
        snapshot = cell.memory.read()
        self.made = plan(
            replace(goal(snapshot), execution=ExecutionMode.SERVO),
            snapshot,
            ARM,
            PlanningOptions(),
        )
        take = cell.owner._handle

        def tell(notice):
            if isinstance(notice, ServoProgress):
                self.reports.append(notice.report)
            elif isinstance(notice, MotionProgress):
                self.progress.append(notice.progress)
            take(notice)

        cell.owner._handle = tell
        self.motion = cell.owner.start(self.made)

    async def end(self):
        return await self.cell.record(self.motion, self.packets)

    def begin(self):
        """Return when the first set-point of the motion was sent [s]."""
        return next(
            report.timestamp
            for report in self.reports
            if report.activity is ServoActivity.SERVOING
        )


def straight(seconds=1.0, distance=0.1):
    def goal(snapshot):
        x, y, z = snapshot.actual_tcp_pose.position
        there = replace(snapshot.actual_tcp_pose, position=(x, y + distance, z))
        return Goal(waypoints=(Waypoint(pose=there, time=seconds),))

    return goal


def test_another_client_may_have_the_upper_registers():
    async def scenario(cell):
        other = RtdeConnection(
            RtdeClientCodec(['timestamp'], registers.SERVO_INPUTS), lambda *_: None
        )
        await other.open(HOST, robot_cell.RTDE)
        run = Run(cell, straight())
        begin = cell.memory.read()
        outcome = await run.end()
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        moved = run.packets[-1].actual_tcp_pose.position[1] - begin.actual_tcp_pose.position[1]
        assert moved == pytest.approx(0.1, abs=1e-3)
        assert run.reports[-1].setpoints_done > 100
        other.close()
        # A fieldbus may have the lower ones: then the sentence names both.
        fieldbus = RtdeConnection(
            RtdeClientCodec(['timestamp'], ['input_int_register_0']), lambda *_: None
        )
        await fieldbus.open(HOST, robot_cell.RTDE)
        await cell.until(cell.is_ready)
        outcome = await Run(cell, straight(distance=-0.05)).end()
        assert outcome.code is ErrorCode.ROBOT_NOT_READY
        assert 'input_int_register_0 are in use by the fieldbus, or another client' in outcome.text
        assert 'lower_registers: false' in outcome.text
        fieldbus.close()

    run_cell(scenario, lower_registers=True)


@pytest.mark.parametrize(
    ('name', 'factor'),
    [
        pytest.param('circle', 0.45, marks=pytest.mark.exhaustive),
        pytest.param('figure_eight', 1.0, marks=pytest.mark.exhaustive),
    ],
)
def test_every_point_is_passed_within_the_lag_that_is_reported(name, factor, monkeypatch):
    monkeypatch.setattr(robot_cell, 'CYCLE', 0.002)  # of an e-Series

    async def scenario(cell):
        run = Run(cell, lambda state: stretch_times(example_goal(name, state), factor))
        await run.end()
        return run

    # With these, servoj itself hardly deforms the path.
    run = run_cell(scenario, feedback_rate=500.0, servoj_gain=2000.0, servoj_lookahead_time=0.03)
    assert run.motion.outcome.code is ErrorCode.SUCCESSFUL, run.motion.outcome
    goal, start = run.made.goal, SplineState(q=run.made.start)
    kinematics = TcpKinematics(ARM, run.made.T_flange_active)
    curve = ToolSpline.through(tool_points(goal, start.tool(kinematics)))
    times = np.array([state.timestamp for state in run.packets]) - run.begin()
    places = np.array([state.target_tcp_pose.position for state in run.packets])
    twists = np.array([state.target_tcp_twist for state in run.packets])
    lag = max(progress.lag for progress in run.progress)
    assert 0.05 < lag < 0.1
    late = []
    for point in (point for point in goal.waypoints if any(point.twist)):
        asked = curve.at(np.array([point.time]))
        fine = np.arange(point.time - 0.06, point.time + 0.2, 1e-4)
        polyline = np.stack([np.interp(fine, times, x) for x in places.T], axis=1)
        at = fine[np.argmin(np.linalg.norm(polyline - asked.poses[0, :3], axis=1))]
        late.append(at - point.time)
        twist = np.array([np.interp(at, times, v) for v in twists.T])
        off = np.linalg.norm(twist[:3] - asked.twists[0][:3])
        assert off < 0.01 * np.linalg.norm(asked.twists[0][:3]) + 1e-3, point
    assert min(late) > 0.0
    assert max(late) <= lag + 1e-3
    assert max(late) - min(late) <= 2.0 * robot_cell.CYCLE
    end = goal.waypoints[-1].time
    around = [
        np.linalg.norm(
            places - curve.at(np.clip(times - lag + shift, 0.0, end)).poses[:, :3], axis=1
        )
        for shift in np.linspace(-0.01, 0.02, 61)
    ]
    assert np.min(around, axis=0).max() < 2e-4


def test_feedback_and_reports_tell_the_lag_and_the_inputs_are_given_back():
    async def scenario(cell):
        run = Run(cell, straight(0.5, distance=0.05))
        outcome = await run.end()
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        lags = [progress.lag for progress in run.progress]
        assert 0.05 < max(lags) < 0.12
        activities = [report.activity for report in run.reports]
        assert activities[-1] is ServoActivity.IDLE
        assert ServoActivity.SERVOING in activities
        last = run.reports[-1]
        assert last.setpoints_done == pytest.approx(last.setpoints_sent, abs=1)
        assert (last.underruns, last.overruns, last.skipped) == (0, 0, 0)
        # Another client can have the inputs now.
        other = RtdeConnection(
            RtdeClientCodec(['timestamp'], registers.SERVO_INPUTS), lambda *_: None
        )
        await other.open(HOST, robot_cell.RTDE)
        # And while it has them no goal moves anything.
        refused = Run(cell, straight(distance=-0.05))
        q = cell.q
        outcome = await refused.end()
        assert outcome.code is ErrorCode.ROBOT_NOT_READY
        assert 'in use by another client' in outcome.text
        # The rest of the goal before dies out, with the guide's gain in 33 ms to a third.
        assert cell.q == pytest.approx(q, abs=1e-6)
        # But for a moment it waits for somebody who is about to hang up.
        await cell.until(cell.is_ready)
        again = Run(cell, straight(0.4, distance=-0.02))
        await cell.sleep(0.1)
        other.close()
        assert (await again.end()).code is ErrorCode.SUCCESSFUL

    run_cell(scenario)


@pytest.mark.exhaustive
def test_slider_and_pause_hold_the_arm_and_no_more():
    async def scenario(cell):
        run = Run(cell, straight(0.8))
        await cell.sleep(0.6)
        cell.robot.set_speed_slider(0.0)
        await cell.sleep(2.5)  # longer than an arm may be at rest without a reason
        cell.robot.set_speed_slider(1.0)
        outcome = await run.end()
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome
        assert run.reports[-1].underruns == 0

        run = Run(cell, straight(0.8, distance=-0.1))
        await cell.sleep(0.5)
        cell.robot.controller.programs.pause()
        await cell.sleep(0.5)
        cell.robot.play_program()
        outcome = await run.end()
        assert outcome.code is ErrorCode.SUCCESSFUL, outcome

    run_cell(scenario)


def test_a_cancel_stops_the_arm_on_the_way():
    async def scenario(cell):
        run = Run(cell, straight(0.8))
        await cell.sleep(0.5)
        cell.owner.cancel()
        took = await cell.until(lambda: run.motion.outcome)
        assert run.motion.outcome.code is ErrorCode.CANCELLED
        assert took < 0.5
        await cell.until(cell.at_rest, 2.0 * CYCLE)  # the last step of the brakes
        await cell.until(cell.is_ready)

    run_cell(scenario)


def test_inputs_that_are_lost_on_the_way_brake_the_arm_and_the_program_stays():
    async def scenario(cell):
        run = Run(cell, straight(0.8))
        await cell.sleep(0.5)
        end = cell.loop.open_ends(robot_cell.RTDE)[-1]
        end.abort()
        outcome = await run.end()
        assert outcome.code is ErrorCode.CONNECTION_LOST
        assert 'RTDE inputs' in outcome.text
        await cell.until(cell.at_rest, 0.5)
        await cell.until(cell.is_ready)
        again = Run(cell, straight(0.3, distance=0.02))
        assert (await again.end()).code is ErrorCode.SUCCESSFUL

    run_cell(scenario)
