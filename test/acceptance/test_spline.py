# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
SPLINE, from the goal to the simulated arm: every point in time, with its twist, on the curve.

The tests compare the targets that the controller reports, packet by packet, in virtual time.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from math import nan

from example_goals import example_goal, stretch_times
from forward_model import dh_forward, pose_matrix
import numpy as np
import pytest
import robot_cell
from robot_cell import run_cell

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.motion.goal.goal_columns import goal_table
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.geometry.tool_spline import ToolSpline
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.spline.spline_planner import SplineState
from ur_cartesian_driver.planning.spline.spline_points import tool_points

pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.both_arms]

ARM = Arm(robot_model('ur5e'))


@dataclass
class Run:
    """A goal that was executed, and the targets of all packets."""

    made: Plan
    outcome: object
    #: (n,) since the arm began to move [s]; (n, 3), (n, 6).
    times: np.ndarray
    places: np.ndarray
    twists: np.ndarray

    @property
    def stands(self):
        """When the arm is at rest again [s]."""
        return self.times[np.flatnonzero(np.abs(self.twists).max(axis=1) > 1e-9)[-1]]

    def curve(self):
        goal, begin = self.made.goal, SplineState(q=self.made.start)
        return ToolSpline.through(
            tool_points(
                goal_table(goal), begin.tool(TcpKinematics(ARM, self.made.T_flange_active))
            )
        )

    def passing(self, time):
        """Return when the tool is nearest to a position of the curve, and its twist then."""
        place = self.curve().at(np.array([time])).poses[0, :3]
        fine = np.arange(time - 0.06, time + 0.06, 1e-4)
        polyline = np.stack([np.interp(fine, self.times, x) for x in self.places.T], axis=1)
        at = fine[np.argmin(np.linalg.norm(polyline - place, axis=1))]
        return at, np.array([np.interp(at, self.times, v) for v in self.twists.T])


def run_goal(goal_from):
    """Run a goal that is made from the state of the arm."""

    async def scenario(cell):
        snapshot = cell.memory.read()
        made = plan(
            replace(goal_from(snapshot), execution=ExecutionMode.SPLINE),
            snapshot,
            ARM,
            PlanningOptions(),
        )
        packets = []
        outcome = await cell.record(cell.owner.start(made), packets)
        return run_of(made, outcome, packets)

    return run_cell(scenario)


def run_of(made, outcome, packets):
    begin = next(before.timestamp for before, after in pairwise(packets) if any(after.target_qd))
    return Run(
        made,
        outcome,
        np.array([state.timestamp - begin for state in packets]),
        np.array([state.target_tcp_pose.position for state in packets]),
        np.array([state.target_tcp_twist for state in packets]),
    )


@pytest.mark.parametrize(
    ('name', 'factor'),
    [
        ('circle', 0.45),
        *(
            pytest.param(name, 1.0, marks=pytest.mark.exhaustive)
            for name in ('circle', 'figure_eight', 'seam_timed')
        ),
    ],
)
def test_every_point_is_passed_in_time_with_its_twist_and_the_tool_keeps_to_the_curve(
    name, factor, monkeypatch
):
    monkeypatch.setattr(robot_cell, 'CYCLE', 0.002)  # of an e-Series
    run = run_goal(lambda state: stretch_times(example_goal(name, state), factor))
    assert run.outcome.code is ErrorCode.SUCCESSFUL, run.outcome.text
    curve = run.curve()
    points = run.made.goal.waypoints
    passed = [point for point in points if any(point.twist)]
    for point in passed:
        asked = curve.at(np.array([point.time])).twists[0]
        at, twist = run.passing(point.time)
        assert abs(at - point.time) <= 2.0 * robot_cell.CYCLE, point
        for part in (slice(0, 3), slice(3, 6)):
            bound = 0.01 * np.linalg.norm(asked[part]) + 1e-5
            assert np.linalg.norm(twist[part] - asked[part]) < bound, point
    assert abs(run.stands - points[-1].time) < 3.5 * robot_cell.CYCLE
    # From where the curve is around that time.
    around = [
        np.linalg.norm(run.places - curve.at(run.times + lag).poses[:, :3], axis=1)
        for lag in np.linspace(-0.006, 0.006, 25)
    ]
    assert np.min(around, axis=0)[run.times < run.stands].max() < 2e-4
    between = (run.times > passed[0].time) & (run.times < passed[-1].time)
    assert np.linalg.norm(run.twists[between, :3], axis=1).min() > 0.005  # no stop


def test_a_long_wait_at_a_point_is_no_stall():
    def goal(snapshot):
        x, y, z = snapshot.actual_tcp_pose.position
        there = replace(snapshot.actual_tcp_pose, position=(x, y + 0.02, z))
        return Goal(
            waypoints=tuple(
                Waypoint(time=time, pose=pose)
                for time, pose in ((0.5, there), (4.0, there), (4.5, snapshot.actual_tcp_pose))
            )
        )

    run = run_goal(goal)
    assert run.outcome.code is ErrorCode.SUCCESSFUL, run.outcome.text
    waits = (run.times > 0.55) & (run.times < 3.95)
    assert np.abs(run.twists[waits]).max() < 1e-4
    assert abs(run.stands - 4.5) < 3.5 * robot_cell.CYCLE


@pytest.mark.parametrize(
    ('mode', 'slower', 'gain', 'lookahead'),
    [
        (ExecutionMode.SPLINE, 1.0, 1000.0, 0.06),
        (ExecutionMode.SERVO, 3.0, 1000.0, 0.06),
        # Such a servo swings past its end and back: slower joints stand there for a moment.
        (ExecutionMode.SERVO, 30.0, 100.0, 0.03),
    ],
    ids=['SPLINE', 'SERVO', 'SERVO that swings'],
)
@pytest.mark.parametrize(
    'cycle',
    [
        pytest.param(0.008, id='CB3'),
        pytest.param(0.002, id='e-Series', marks=pytest.mark.exhaustive),
    ],
)
def test_an_end_at_the_limits_of_the_arm_is_where_the_goal_says(
    mode, slower, gain, lookahead, cycle, monkeypatch, simulated_arm
):
    """By the actual joints of the simulator, and a forward kinematics that is not ours."""
    monkeypatch.setattr(robot_cell, 'CYCLE', cycle)
    options = PlanningOptions(on_too_fast='slow', max_tool_speed=0.0)

    def goal(state, quintic, seconds):
        x, y, z = state.actual_tcp_pose.position
        chosen, rest = (nan,) * 6, (0.0,) * 6
        return Goal(
            execution=mode,
            waypoints=tuple(
                Waypoint(
                    time=part * seconds,
                    pose=replace(state.actual_tcp_pose, position=(x + dx, y + dy, z + dz)),
                    twist=twist,
                    acceleration=chosen if quintic and twist is chosen else rest,
                )
                for part, dx, dy, dz, twist in (
                    (0.7, 0.02, 0.05, -0.03, chosen),
                    (1.0, -0.01, 0.06, 0.02, rest),
                )
            ),
        )

    async def scenario(cell):
        for quintic in (False, True):
            state = cell.memory.read()
            shortest = plan(goal(state, quintic, 0.05), state, ARM, options).reference.time[-1]
            made = plan(goal(state, quintic, slower * shortest), state, ARM, options)
            motion = cell.owner.start(made)
            await cell.until(lambda motion=motion: motion.outcome is not None, 60.0)
            assert motion.outcome.code is ErrorCode.SUCCESSFUL, motion.outcome.text
            if simulated_arm:
                await cell.sleep(0.6)  # it rings, which no goal waits for
            here = dh_forward(ARM.geometry, cell.robot.controller.actual.q) @ pose_matrix(
                made.T_flange_active
            )
            off = np.linalg.norm(here[:3, 3] - made.reference.poses[-1, :3])
            # An arm that is not ideal holds its place within a tenth of a milliradian.
            assert off < (2e-4 if simulated_arm else 0.0) + (
                2e-5 if mode is ExecutionMode.SPLINE else 1e-4
            )

    run_cell(scenario, servoj_gain=gain, servoj_lookahead_time=lookahead)
