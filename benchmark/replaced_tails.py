# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Replacing the tail of a motion: the time from the call to the changed motion, and its smoothness.

The arm follows a circle, and from time to time a new tail leads it 2 mm up or down. The changes
are found in the cycles of the simulated controller, whose process has the same clock as this one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from math import ceil, cos, nan, pi, sin
import time
from typing import Any

from figures import Figure, percentile
import numpy as np
from numpy.typing import NDArray
from processes import Child, simulator

from ur_cartesian_driver.driver import Driver, DriverConfig, MotionHandle
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import AlreadySent
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import vector6, ZERO6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint

NAME = 'replaced tails'
#: Radius [m] and period [s] of the circle; height of a step, and height at which it has begun [m].
RADIUS, PERIOD, HEIGHT, BEGUN = 0.05, 4.0, 0.002, 0.00005
#: Time between points; least time from the cut to the first new point; time from the first new
#: point to the last [s].
STEP, GAP, AHEAD = 0.05, 0.08, 0.8
HORIZON = 0.15
#: Time from the latest reported progress to the cut: its first value, and the addition after a cut
#: that came too late [s].
FIRST_LEAD, MORE = 0.1, 0.01
#: Time between two steps [s].
REST = 0.5
ARM = Arm(robot_model('ur5e'))


def note_targets(robot: Any) -> Mapping[str, Callable[..., Any]]:
    """Return a call for the rows since the last call: both times, joint positions and speeds."""
    rows: list[tuple[float, ...]] = []
    step = robot.controller.step

    def noted() -> None:
        step()
        motion = robot.controller.motion
        rows.append((time.monotonic(), robot.controller.time, *motion.q, *motion.qd))

    def take() -> list[tuple[float, ...]]:
        taken = list(rows)
        rows.clear()
        return taken

    robot.controller.step = noted
    return {'targets': take}


class Client:
    """Leads the arm around the circle, and up or down."""

    def __init__(self, robot: Child, driver: Driver, mode: ExecutionMode) -> None:
        state = driver.state
        assert state is not None
        self._robot, self._driver, self._mode = robot, driver, mode
        self._home, self._height, self._side = state.target_tcp_pose, 0.0, 1.0
        self.lead = FIRST_LEAD
        #: From the call until the driver has taken the points, and until the tool moves [s].
        self.taken: list[float] = []
        self.moved: list[float] = []

    def chunk(self, since: float, *, ahead: float = AHEAD, last: bool = False) -> list[Waypoint]:
        """Return the points that follow the time ``since`` of the motion [s]."""
        first, count = ceil((since + GAP) / STEP - 1e-9), round(ahead / STEP)
        points = []
        for k in range(first, first + count):
            t = STEP * k
            angle = 2.0 * pi / PERIOD * (0.5 * t * t if t < 1.0 else t - 0.5)
            x, y, z = self._home.position
            radius = self._side * RADIUS
            x, y = x + radius * sin(angle), y + radius * (1.0 - cos(angle))
            pose = Pose((x, y, z + self._height), self._home.quaternion)
            points.append(Waypoint(time=t, pose=pose, twist=vector6([nan] * 6)))
        if last:
            points[-1] = Waypoint(time=points[-1].time + 0.5, pose=points[-1].pose, twist=ZERO6)
        return points

    def goal(self, ahead: float = AHEAD, **changes: Any) -> Goal:
        """Return a goal with the first points."""
        points = tuple(self.chunk(0.0, ahead=ahead, last=bool(not changes)))
        return Goal(waypoints=points, execution=self._mode, **changes)

    def replace_tails(self, count: int) -> NDArray[np.float64]:
        """Replace the tail ``count`` times; return all rows of note_targets()."""
        motion = self._start(self.goal(keep_open=True, replace_horizon=HORIZON))
        self._keep_on(motion, 1.5)
        rows = self._robot.call('targets')
        while len(self.moved) < count:
            self._height = HEIGHT - self._height
            begin = time.monotonic()
            try:
                self._replace(motion)
            except AlreadySent:
                self.lead += MORE
                self.taken.clear()
                self.moved.clear()
                self._height = HEIGHT - self._height
                continue
            self.taken.append(time.monotonic() - begin)
            self._keep_on(motion, REST)
            new = self._robot.call('targets')
            self.moved.append(first_change(new, begin) - begin)
            rows += new
        motion.append((), last=True)
        motion.result(20.0).raise_for_error()
        return np.array(rows)

    def send_new_goals(self, count: int) -> None:
        """Replace the running goal by another one ``count`` times."""
        motion = self._start(self.goal(3.0))
        while len(self.moved) < count:
            time.sleep(1.2)
            self._height = HEIGHT - self._height
            self._robot.call('targets')
            begin = time.monotonic()
            self._driver.preempt_motion()
            state = self._driver.state
            assert state is not None
            x, y, _ = state.target_tcp_pose.position
            self._home = Pose((x, y, self._home.position[2]), self._home.quaternion)
            self._side = -self._side  # and back
            motion = self._start(self.goal(3.0))
            self.taken.append(time.monotonic() - begin)
            time.sleep(1.5)
            self.moved.append(first_change(self._robot.call('targets'), begin) - begin)
        motion.cancel()
        motion.result(20.0)

    def _start(self, goal: Goal) -> MotionHandle:
        return self._driver.start(self._driver.plan(goal))

    def _replace(self, motion: MotionHandle) -> None:
        while motion.progress is None:
            time.sleep(0.01)
        since = motion.progress.time + self.lead
        motion.append(self.chunk(since), replace_from_time=since)

    def _keep_on(self, motion: MotionHandle, seconds: float) -> None:
        """Replace the tail by an equal one ten times a second."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            time.sleep(0.1)
            self.lead, lead = 0.3, self.lead
            self._replace(motion)
            self.lead = lead


def first_change(rows: list[tuple[float, ...]], begin: float) -> float:
    """Return the first time after ``begin`` at which the tool has left its old height [s]."""
    times = np.array([row[0] for row in rows])
    heights = ARM.forward_rows(np.array([row[2:8] for row in rows]))[:, 2]
    before = heights[times < begin][-1] if (times < begin).any() else heights[0]
    changed = np.flatnonzero((times >= begin) & (np.abs(heights - before) > BEGUN))
    if not len(changed):
        raise RuntimeError('the tool has not moved up or down')
    return float(times[changed[0]])


def largest_jump(rows: NDArray[np.float64]) -> float:
    """Return the largest change of a joint's acceleration between two cycles [rad/s^2]."""
    accelerations = np.diff(rows[:, 8:14], axis=0) / np.diff(rows[:, 1])[:, None]
    return float(np.abs(np.diff(accelerations, axis=0)).max())


def run(quick: bool) -> Iterator[Figure]:
    """Replace tails in both modes, and send new goals."""
    count = 3 if quick else 30
    with simulator(note_targets) as robot:
        ports = robot.call('ports')
        config = DriverConfig(
            robot_ip='127.0.0.1',
            ur_type='ur5e',
            headless_mode=True,
            rtde_port=ports.rtde,
            primary_port=ports.primary,
            dashboard_port=ports.dashboard,
            reverse_port=0,
            script_sender_port=0,
            trajectory_port=0,
            script_command_port=0,
        )
        with Driver(config) as driver:
            driver.wait_ready(20.0)
            for mode in ExecutionMode.SERVO, ExecutionMode.SPLINE:
                yield from _figures(robot, driver, mode, count)


def _figures(robot: Child, driver: Driver, mode: ExecutionMode, count: int) -> Iterator[Figure]:
    other, client = Client(robot, driver, mode), Client(robot, driver, mode)
    other.send_new_goals(max(3, count // 3))
    plain = Client(robot, driver, mode)
    robot.call('targets')
    plain._start(plain.goal(6.0)).result(30.0).raise_for_error()
    known = np.array(robot.call('targets'))
    client = Client(robot, driver, mode)
    rows = client.replace_tails(count)
    for text, percent in ('p50', 50.0), ('most', 100.0):
        yield Figure(
            benchmark=NAME,
            name=f'{mode.name}: call -> changed motion, {text}',
            unit='ms',
            value=1e3 * percentile(client.moved, percent),
            baseline=1e3 * percentile(other.moved, percent),
            than='a new goal',
            note=f'cut {1e3 * client.lead:.0f} ms after what is reported' if percent < 60 else '',
        )
    yield Figure(
        benchmark=NAME,
        name=f'{mode.name}: of it planned and taken, p50',
        unit='ms',
        value=1e3 * percentile(client.taken, 50.0),
    )
    yield Figure(
        benchmark=NAME,
        name=f'{mode.name}: largest jump of acceleration',
        unit='rad/s^2',
        value=largest_jump(rows),
        baseline=largest_jump(known),
        than='the circle, all known',
        note='of a joint, in a cycle of 2 ms',
    )
