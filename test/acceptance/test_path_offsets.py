# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Paths that give way to offsets while the arm moves, judged by what RTDE reports."""

from dataclasses import replace
from math import hypot, pi, sin
import os
from runpy import run_path

from checkout import CHECKOUT, needs_checkout
import numpy as np
import pytest
from recorded_goal import RecordedGoal
from robot_cell import run_cell

from ur_cartesian_driver.driver.ipc.channel import SetPathOffset
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    PathOffset,
    Segment,
    SegmentType,
    StaleOffset,
    Tolerance,
    Waypoint,
)

pytestmark = [pytest.mark.acceptance]

#: Of the planned seam [s], [m], and how far the real one is bent to the side [m].
TIME, LENGTH, BEND = 4.0, 0.16, 0.005
#: Time between two offsets [s].
PERIOD = 0.02
#: How many seams get random offsets; 100 take two minutes.
SEAMS = int(os.environ.get('OFFSET_SEAMS', '1'))
EXAMPLE = CHECKOUT / 'examples' / 'tracked_seam.py'


class TrackedSeam(RecordedGoal):
    """A line along y, whose tool points down: across is -x, normal is z."""

    def send(self, across, normal=0.0, age=0.0):
        number = len(self.cell.owner.motions)
        self.cell.owner.send(SetPathOffset(motion=number, offset=(0.0, across, normal), age=age))

    async def end(self, sensor=lambda place: None):
        """Run to the end; a sensor sees where the tool is, every PERIOD."""
        due = 0.0

        def looked():
            nonlocal due
            state = self.cell.collect(self.states)
            if state.timestamp >= due:
                due = state.timestamp + PERIOD
                sensor(np.array(state.actual_tcp_pose.position) - self.start)
            return self.motion.outcome

        await self.cell.until(looked, 60.0)
        return self.motion.outcome


#: Who offsets the path: the driver its set-points, or the controller its motions.
MODES = (ExecutionMode.SERVO, ExecutionMode.PRIMITIVES)
both_modes = pytest.mark.parametrize('mode', MODES, ids=lambda mode: mode.name)


def start(cell, mode=ExecutionMode.SERVO, *, tolerance=0.0015, **changes):
    """Start the planned seam."""
    return TrackedSeam.along_y(
        cell,
        LENGTH,
        TIME,
        execution=mode,
        path_tolerance=Tolerance(position=(tolerance,) * 3),
        path_offset=PathOffset(limits=(0.0, 0.006, 0.006), **changes),
    )


def bent(y):
    """Return how far the real seam is beside the line, across it [m]."""
    return BEND * sin(pi * min(max(y / (0.8 * LENGTH), 0.0), 1.0)) ** 2


@both_modes
def test_a_seam_bent_by_5_mm_is_followed_within_the_stated_lag(mode):
    async def scenario(cell):
        seam = start(cell, mode)
        # The sensor is where the tool is: it sees the seam there, not the offset that is asked.
        outcome = await seam.end(lambda place: seam.send(bent(place[1])))
        return seam, outcome

    seam, outcome = run_cell(scenario)
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome
    _, y, _ = np.array([state.actual_tcp_pose.position for state in seam.states]).T
    x = np.array([state.actual_tcp_pose.position[0] for state in seam.states])
    y, across = y - seam.start[1], -(x - seam.start[0])
    wanted = np.array([bent(each) for each in y])
    assert across.max() > 0.95 * BEND
    # 0.08 s of set-points in flight or 0.02 s of the controller's filter, 0.02 s between offsets,
    # 0.04 s of braking distance.
    speed = np.abs(np.diff(wanted) / np.diff(seam.times)).max()
    lag = np.abs(across - wanted).max() / speed
    assert lag < (0.15 if mode is ExecutionMode.SERVO else 0.1)
    assert np.abs(seam.target[-1] - (0.0, LENGTH, 0.0)).max() < 2e-5
    # The feedback says how far the path has given way, and the error is small beside it.
    given = np.array([progress.path_offset for progress in seam.motion.progress])
    assert given[:, 1].max() > 0.95 * BEND
    assert not given[:, [0, 2]].any()
    for progress in seam.motion.progress:
        assert progress.desired_pose.distance_to(progress.actual_pose) < 0.001


@pytest.mark.parametrize('seed', range(1, 1 + SEAMS))
@both_modes
def test_jumps_and_nonsense_move_the_tool_within_the_bounds(mode, seed):
    limits, speed, acceleration = (0.0, 0.006, 0.006), 0.02, 0.2

    async def scenario(cell):
        seam = start(cell, mode, tolerance=0.003)
        rng = np.random.default_rng(seed)

        def sensor(place):
            offset = rng.choice((-1.0, 1.0, 0.004, np.nan, np.inf, 0.0), 2)
            across, normal = offset.tolist()
            seam.send(across, normal, float(rng.choice((0.0, 0.0, 9.0, np.nan))))

        return seam, await seam.end(sensor)

    # In the lower registers offsets go either way, too.
    lower = mode is ExecutionMode.PRIMITIVES
    seam, outcome = run_cell(scenario, lower_registers=lower)
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome
    beside = seam.target[:, [0, 2]]
    assert 0.5 * limits[1] < np.abs(beside).max() < limits[1] + 1e-4
    speeds = np.diff(beside, axis=0) / np.diff(seam.times)[:, None]
    assert np.abs(speeds).max() < 1.1 * speed
    accelerations = np.diff(speeds, axis=0) / np.diff(seam.times)[1:, None]
    assert np.abs(accelerations).max() < 2.0 * acceleration  # servoj smooths, and quantises
    assert np.abs(seam.target[-1] - (0.0, LENGTH, 0.0)).max() < 2e-5
    assert any('were ignored' in line for line in outcome.report)


@both_modes
def test_a_sensor_that_fails_leaves_the_tool_where_the_goal_says(mode):
    async def scenario(cell):
        seam = start(cell, mode, on_stale=StaleOffset.HOLD, timeout=0.3)
        return seam, await seam.end(lambda place: place[1] < 0.3 * LENGTH and seam.send(0.004))

    seam, outcome = run_cell(scenario)
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome
    late = seam.target[(seam.target[:, 1] > 0.7 * LENGTH) & (seam.target[:, 1] < 0.8 * LENGTH)]
    assert late[:, 0] == pytest.approx(-0.004, abs=5e-5)
    assert any('stale once' in line for line in outcome.report)


def test_the_slider_slows_an_offset_of_the_controller_and_a_pause_holds_it():
    slider = 0.3

    async def scenario(cell):
        seam = start(cell, ExecutionMode.PRIMITIVES, on_stale=StaleOffset.HOLD)
        marks = []

        def sensor(place):
            aside = abs(place[0])
            if not marks:
                cell.robot.set_speed_slider(slider)
                marks.append(0)
            elif len(marks) == 1 and place[1] > 0.02:
                seam.send(0.005)
                if aside > 0.002:
                    cell.robot.pause_program()
                    marks.append(len(seam.states))
            elif len(marks) == 2 and len(seam.states) > marks[1] + 100:
                cell.robot.set_speed_slider(1.0)
                cell.robot.play_program()
                marks.append(len(seam.states))

        outcome = await seam.end(sensor)
        return seam, outcome, marks

    seam, outcome, (_, paused, played) = run_cell(scenario)
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome
    beside, times = -seam.target[:, 0], seam.times
    speeds = np.diff(beside) / np.diff(times)
    slow = np.abs(speeds[:paused]).max()
    assert 0.9 * slider * 0.02 < slow < 1.05 * slider * 0.02
    held = beside[paused + 50 : played - 1]  # the controller's filter has settled
    assert np.ptp(held) < 1e-6
    assert 0.002 < held[0] < 0.003
    assert beside.max() == pytest.approx(0.005, abs=5e-5)
    assert np.abs(seam.target[-1] - (0.0, LENGTH, 0.0)).max() < 2e-5


@both_modes
def test_an_arm_that_is_pushed_off_the_path_that_gave_way_is_noticed(mode):
    async def scenario(cell):
        seam = start(cell, mode)

        def sensor(place):
            seam.send(0.005)
            if place[1] > 0.3 * LENGTH:
                cell.robot.inject('offset pose x 0.005 for 1 s')  # back onto the line of the goal

        return await seam.end(sensor)

    outcome = run_cell(scenario)
    assert outcome.code is ErrorCode.PATH_TOLERANCE_VIOLATED
    assert 'position x is off by' in outcome.text


def test_the_controller_offsets_lines_arcs_and_rests_as_one_path():
    """A line, a rest on it, and an arc that it meets in a tangent, with 3 mm to the side."""
    radius, aside = 0.06, 0.003

    def goal(state):
        x, y, z = state.actual_tcp_pose.position

        def at(dx, dy):
            return replace(state.actual_tcp_pose, position=(x + dx, y + dy, z))

        half = radius * sin(pi / 4.0)
        return Goal(
            waypoints=tuple(
                Waypoint(pose=at(dx, dy))
                for dx, dy in ((0.0, 0.03), (0.0, 0.06), (radius, 0.06 + radius))
            ),
            segments=(
                Segment(velocity=0.05, dwell=0.3),
                Segment(velocity=0.05, blend_radius=0.001),
                Segment(
                    type=SegmentType.CIRCULAR,
                    via=at(radius - half, 0.06 + half),
                    velocity=0.05,
                ),
            ),
            execution=ExecutionMode.PRIMITIVES,
            path_tolerance=Tolerance(position=(0.001,) * 3),
            path_offset=PathOffset(limits=(0.0, 0.004, 0.004)),
        )

    async def scenario(cell):
        seam = TrackedSeam(cell, goal(cell.memory.read()))
        return seam, await seam.end(lambda place: seam.send(aside))

    seam, outcome = run_cell(scenario)
    assert outcome.code is ErrorCode.SUCCESSFUL, outcome
    x, y, z = seam.target.T
    assert -x[(y > 0.025) & (y < 0.055)] == pytest.approx(aside, abs=2e-5)  # at rest, too
    on_arc = (y > 0.065) & (x < 0.3 * radius)
    away = np.hypot(x[on_arc] - radius, y[on_arc] - 0.06)
    assert away == pytest.approx(radius + aside, abs=5e-5)
    assert np.abs(z).max() < 2e-5
    assert seam.target[-1] == pytest.approx((radius, 0.06 + radius, 0.0), abs=2e-5)
    speeds = np.linalg.norm(np.diff(seam.target, axis=0), axis=1) / np.diff(seam.times)
    assert speeds.max() < hypot(0.05 * (radius + aside) / radius, 0.02) + 0.001


@needs_checkout
def test_the_example_is_tracked_3_mm_to_the_side():
    async def scenario(cell):
        path = run_path(str(EXAMPLE))['tracked_seam'](cell.memory.read().actual_tcp_pose)
        seam = TrackedSeam(cell, path.goal())
        return seam, await seam.end(lambda place: seam.send(0.003))

    seam, outcome = run_cell(scenario)
    assert outcome.succeeded, outcome
    x, y, z = seam.target.T
    beside = -x[(y > 0.02) & (y < 0.18)]
    assert beside == pytest.approx(0.003, abs=2e-4)
    assert np.abs(z).max() < 5e-5
    assert seam.target[-1] == pytest.approx((0.0, 0.2, 0.0), abs=5e-5)
