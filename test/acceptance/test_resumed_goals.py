# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A seam that is interrupted and resumed is, put together, the whole seam.

The seam has lines, PROCESS with a blend, an arc and an output; as a spline it has twists. It is
stopped at random places (cancelled, by a protective stop, by a lost arc) and resumed, in
virtual time. RTDE reports tool and output; the seam's geometry is the tests' own.
``INTERRUPTIONS`` is the number of places of each kind.
"""

from dataclasses import replace
import os

from goal_geometry import Kinematics
import numpy as np
from plain_clients import RtdeRecorder
from process_output import is_on, SAFE_OUTPUTS, switch
import pytest
from robot_cell import CYCLE, RTDE, run_cell
from virtual_network import HOST

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    Goal,
    Segment,
    SegmentType,
    Waypoint,
)
from ur_cartesian_driver.path import resume
from ur_cartesian_driver.planning import plan, PlanningOptions

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

PLACES = int(os.environ.get('INTERRUPTIONS', '2'))
ARM = Arm(robot_model('ur5e'))
OPTIONS = PlanningOptions(self_collision='off')
TOOL = Kinematics(ARM.geometry, ARM.model.position_limits, IDENTITY)
Q = (0.0, -1.5708, 1.5708, -1.5708, -1.5708, 0.0)
ON, OFF = 1, 4
SPEED, OVERLAP, APPROACH = 0.05, 0.005, 0.02
#: How close the path and its places are followed: RTDE says it once in a cycle [m].
CLOSE = SPEED * CYCLE + 2e-4
#: Between so many places the seam is looked at.
LOOKED_AT = 600


def seam():
    """Return the goal: down to the seam, on to its end around a corner and an arc, and away."""
    x, y, z = ARM.forward(Q).position
    turned = ARM.forward(Q).quaternion

    def at(dx, dy, dz=0.0):
        return Pose((x + dx, y + dy, z - 0.02 + dz), turned)

    corner = Segment(type=SegmentType.PROCESS, velocity=SPEED, blend_radius=0.008)
    line = Segment(type=SegmentType.LINEAR, velocity=SPEED)
    return Goal(
        waypoints=tuple(
            Waypoint(pose=pose)
            for pose in (
                at(0.0, 0.0),
                at(0.0, 0.02),
                at(0.0, 0.05),
                at(0.03, 0.05),
                at(0.05, 0.07),
                at(0.05, 0.09),
            )
        ),
        segments=(
            line,
            replace(corner, blend_radius=0.004),
            corner,
            Segment(type=SegmentType.PROCESS, velocity=SPEED),
            Segment(
                type=SegmentType.CIRCULAR,
                velocity=SPEED,
                via=at(0.03 + 0.02 * np.sin(np.pi / 4), 0.07 - 0.02 * np.cos(np.pi / 4)),
            ),
            line,
        ),
        io_commands=(switch(ON, 1.0), switch(OFF, 0.0)),
        safe_outputs=SAFE_OUTPUTS,
    )


def timed_seam():
    """Return the seam with times, without what a timed goal cannot have."""
    goal = seam()
    times = np.cumsum([1.5, 1.0, 1.2, 1.2, 1.4, 1.0])
    return replace(
        goal,
        waypoints=tuple(
            replace(point, time=float(time))
            for point, time in zip(goal.waypoints, times, strict=True)
        ),
        segments=tuple(replace(segment, velocity=0.0) for segment in goal.segments),
    )


def spline_seam():
    """Return the seam as a spline through its points."""
    goal, chosen = seam(), (np.nan,) * 6
    times = np.cumsum([1.0, 0.8, 1.0, 1.0, 1.0, 0.8]).tolist()
    last = len(times) - 1
    return replace(
        goal,
        waypoints=tuple(
            replace(point, time=time, twist=chosen if i < last else (0.0,) * 6)
            for i, (point, time) in enumerate(zip(goal.waypoints, times, strict=True))
        ),
        segments=(),
        execution=ExecutionMode.SPLINE,
    )


def rounded_seam():
    """Return the seam with rounded corners in place of the blends."""
    goal = seam()
    segments = tuple(replace(segment, blend_radius=0.0) for segment in goal.segments)
    return replace(goal, segments=segments, corner_deviation=0.001)


def streamed_seam():
    """Return the seam with rounded corners as set-points."""
    return replace(rounded_seam(), execution=ExecutionMode.SERVO)


SEAMS = {
    'by speed': seam,
    'by time': timed_seam,
    'spline': spline_seam,
    'rounded': rounded_seam,
    'set-points': streamed_seam,
}
STOPS = ('cancel', 'protective_stop')


class Bench:
    """The robot, and the readings of it."""

    def __init__(self, cell):
        self.cell, self.recorder = cell, RtdeRecorder()

    async def connect(self):
        connection, _ = await self.cell.loop.create_connection(lambda: self.recorder, HOST, RTDE)
        connection.write(self.recorder.codec.requests(1.0 / CYCLE))

    async def place_at_home(self):
        self.cell.robot.controller.motion.teleport(Q)
        await self.cell.sleep(0.1)

    async def run(self, goal, stop_at=None, how=''):
        """Carry a goal out, up to a part of its time; return outcome and readings."""
        cell = self.cell
        made = plan(goal, cell.memory.read(), ARM, OPTIONS)
        self.recorder.rows.clear()
        motion = cell.owner.start(made)
        if stop_at is not None:
            await cell.until(lambda: motion.progress and motion.progress[-1].time >= stop_at, 60.0)
            if how == 'protective_stop':
                cell.robot.inject('protective_stop')
            else:
                cell.owner.cancel()
        await cell.until(lambda: motion.outcome is not None, 60.0)
        await cell.until(cell.at_rest)
        rows = list(self.recorder.rows)
        if how == 'protective_stop':
            await cell.sleep(0.2)
            await cell.dashboard('unlock protective stop')
            cell.resend()
            await cell.until(cell.is_ready, 10.0)
            await cell.until(cell.control_messages)
            await cell.sleep(0.1)
        x = TOOL.tool(np.array([row.target_q for row in rows]))[:, :3, 3]
        on = np.array([is_on(row.digital_outputs) for row in rows])
        return motion.outcome, x, on


def nearest(places, x):
    """Return the distance of each place from the path that the tool has passed [m]."""
    if len(x) < 2:
        return np.full(len(places), np.inf)
    a, b = x[:-1], x[1:] - x[:-1]
    length = np.maximum((b**2).sum(axis=1), 1e-18)
    u = np.clip(((places[:, None] - a) * b).sum(axis=2) / length, 0.0, 1.0)
    return np.linalg.norm(places[:, None] - (a + u[:, :, None] * b), axis=2).min(axis=1)


async def interrupt(cell, make, number, wrong):
    bench, goal = Bench(cell), make()
    await bench.connect()
    await bench.place_at_home()
    made = plan(goal, cell.memory.read(), ARM, OPTIONS)
    whole, x, on = await bench.run(goal)
    assert whole.succeeded, whole
    assert whole.stopped is None
    # The seam: where the whole goal has its output on.
    seam_x = x[on]
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(seam_x, axis=0), axis=1))])
    at = np.linspace(CLOSE, way[-1] - CLOSE, LOOKED_AT)
    places = np.stack([np.interp(at, way, seam_x[:, k]) for k in range(3)], axis=1)
    rng = np.random.default_rng(7)
    for k in range(number):
        await bench.place_at_home()
        # Anywhere on the seam, and in the middle of its corners and arcs too.
        stop_at = made.duration * rng.uniform(0.15, 0.93)
        how = STOPS[k % len(STOPS)]
        outcome, x, on = await bench.run(goal, stop_at, how)
        name = f'{k} ({how} at {stop_at:.2f} s, {outcome.stopped})'
        if outcome.succeeded or outcome.stopped is None:
            wrong.append(f'{name}: {outcome}')
            continue
        left = resume(
            goal,
            outcome.stopped,
            overlap=OVERLAP,
            approach=APPROACH,
            start=Pose(ARM.forward(Q).position, ARM.forward(Q).quaternion),
        )
        second, x2, on2 = await bench.run(left.goal)
        if not second.succeeded:
            wrong.append(f'{name}: {second}')
            continue
        glued, glued2 = x[on], x2[on2]
        # One of them has nothing where it was stopped before the seam, or behind it.
        off, off2 = nearest(places, glued), nearest(places, glued2)
        gap = np.minimum(off, off2)
        if gap.max() > CLOSE:
            wrong.append(f'{name}: {1e3 * gap.max():.2f} mm from {at[gap.argmax()]:.4f} m on')
        both = (off < CLOSE) & (off2 < CLOSE)
        if off.max() > CLOSE and off2.max() > CLOSE:
            overlap = both.sum() * (at[1] - at[0])
            # More in a blend, and at the begin of the seam less.
            at_begin = off2[0] < CLOSE
            if overlap < OVERLAP - 2.0 * CLOSE and not at_begin:
                wrong.append(f'{name}: overlap {1e3 * overlap:.2f} mm')
            if overlap > OVERLAP + 0.012:
                wrong.append(f'{name}: overlap {1e3 * overlap:.2f} mm')
        # The output is on nowhere else: neither on the approach, nor behind the end.
        beside = nearest(glued2, seam_x)
        if beside.max(initial=0.0) > 2.0 * CLOSE:
            wrong.append(f'{name}: on {1e3 * beside.max():.2f} mm beside the seam')
        if on2[-1]:
            wrong.append(f'{name}: still on at the end')


@pytest.mark.parametrize('kind', SEAMS)
@pytest.mark.timeout(1200)
def test_an_interrupted_seam_is_whole(kind):
    wrong = []
    run_cell(lambda cell: interrupt(cell, SEAMS[kind], PLACES, wrong), imperfect='')
    assert not wrong, '\n'.join(wrong)
