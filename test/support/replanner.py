# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A planner that replans repeatedly, as a learned policy does; and its readings."""

import asyncio
from collections.abc import Callable
from math import ceil, cos, nan, pi, sin
from typing import Any

from append_goals import AppendMotion, clear_network_log, moved
import numpy as np
from plain_clients import RtdeRecorder
from robot_cell import RobotCell, RTDE
from virtual_network import HOST

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import vector6, ZERO6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint

#: Time between two points of a chunk, and time that a chunk looks ahead [s].
STEP, AHEAD = 0.05, 0.8
#: Time from the planner's latest state of the arm to the beginning of a new tail, and from there
#: to its first point, at least [s].
LEAD, GAP = 0.2, 0.15
#: Radius of the circle [m], and its period [s].
RADIUS, PERIOD = 0.06, 4.0
#: Amplitude with which the circle wanders [m], and its angular frequency [rad/s].
WANDER, WANDER_RATE = 0.01, 2.0


class Replanner:
    """
    Plans the next piece of a circle whose centre wanders.

    Each chunk assumes that the centre stays at its present place, so chunks contradict each other.
    """

    def __init__(self, home: Pose) -> None:
        self.home = home

    def chunk(self, time: float, *, last: bool = False) -> list[Waypoint]:
        """Return points after a time of the motion [s]; with ``last`` they end at rest."""
        shift = WANDER * sin(WANDER_RATE * time)
        first = ceil((time + GAP) / STEP - 1e-9)
        points = [self._point(k * STEP, shift) for k in range(first, first + round(AHEAD / STEP))]
        if last:
            points[-1] = Waypoint(time=points[-1].time + 0.5, pose=points[-1].pose, twist=ZERO6)
        return points

    def _point(self, time: float, shift: float) -> Waypoint:
        # The first round begins with a ramp of a second.
        angle = 2.0 * pi / PERIOD * (0.5 * time * time if time < 1.0 else time - 0.5)
        pose = moved(
            self.home, RADIUS * sin(angle), RADIUS * (1.0 - cos(angle)), shift * min(1.0, time)
        )
        return Waypoint(time=round(time, 6), pose=pose, twist=vector6([nan] * 6))

    def goal(self, execution: ExecutionMode, **changes: Any) -> Goal:
        """Return the goal with the first chunk."""
        fields: dict[str, Any] = {'keep_open': True, 'replace_horizon': 0.15}
        return Goal(waypoints=tuple(self.chunk(0.0)), execution=execution, **{**fields, **changes})


class Readings:
    """Joints as another RTDE client reads them: time, targets and their rates, in rows."""

    def __init__(self, cell: RobotCell, seconds: float) -> None:
        self._cell, self._recorder = cell, RtdeRecorder()
        self._cycle: float = cell.robot.config.cycle  # type: ignore[union-attr]  # it has started
        self._rows, self._count = np.empty((int(seconds / self._cycle), 13)), 0

    async def connect(self) -> None:
        """Begin to read."""
        connection, _ = await self._cell.loop.create_connection(lambda: self._recorder, HOST, RTDE)
        connection.write(self._recorder.codec.requests(1.0 / self._cycle))

    def take(self) -> None:
        """Take the received data, into memory that does not grow."""
        for row in self._recorder.rows:
            self._rows[self._count] = (row.time, *row.target_q, *row.target_qd)
            self._count += 1
        self._recorder.rows.clear()

    @property
    def rows(self) -> Floats:
        """Return all rows (n, 13): time [s], target_q [rad], target_qd [rad/s]."""
        self.take()
        return self._rows[: self._count]

    @property
    def moving(self) -> Floats:
        """Return the rows from the first to the last in which the arm moves."""
        rows = self.rows
        moves = np.flatnonzero((np.abs(rows[:, 7:]) > 1e-4).any(axis=1))
        return rows[moves[0] : moves[-1] + 1]

    @property
    def accelerations(self) -> Floats:
        """Return the accelerations of the moving arm, by differences (n, 6) [rad/s^2]."""
        rows = self.moving
        steps: Floats = np.diff(rows[:, 7:], axis=0) / np.diff(rows[:, :1], axis=0)
        return steps


async def replan(
    cell: RobotCell,
    motion: AppendMotion,
    readings: Readings,
    rate: float,
    seconds: float,
    measure: Callable[[], object] = bool,
) -> None:
    """Replace the tail at a rate [Hz], measure once a second, then end at rest."""
    planner, count = Replanner(motion.home), 0
    assert await motion.until(lambda: motion.motion.progress)
    begin = cell.loop.time()
    while count < seconds * rate:
        time = motion.progress.time + LEAD
        await motion.append(planner.chunk(time), replace_from_time=time)
        count += 1
        readings.take()
        clear_network_log(cell)
        del motion.motion.progress[:-1]
        if count % rate == 0:
            measure()
        await asyncio.sleep(max(0.0, begin + count / rate - cell.loop.time()))
        assert motion.outcome is None, motion.outcome
    time = motion.progress.time + LEAD
    await motion.append(planner.chunk(time, last=True), replace_from_time=time, last=True)
    await motion.ended()
