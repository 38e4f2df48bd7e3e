# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Set-points at 500 Hz: SERVO compared with the servoJ loop of ``ur-rtde``, on one simulated robot.

Both stream the same joint path, with the same gain and lookahead, one after the other in one run;
the set-points that ``servoj`` gets in each cycle are compared. Each has a known time on the path,
which gives the jitter, the skipped set-points and the lag of the arm behind the newest one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
import importlib.util
from pathlib import Path
import subprocess
import sys
import tempfile
import time
from typing import Any

from figures import Figure, percentile
import numpy as np
from numpy.typing import NDArray
from processes import Child, simulator

from ur_cartesian_driver.driver import Driver, DriverConfig
from ur_cartesian_driver.motion.events import Progress
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.motion.plan.primitive import Spline
from ur_cartesian_driver.sim import SimulatedRobot

NAME = 'set-points at 500 Hz'
#: ``ur-rtde`` uses only the ports of a real robot, so the simulator has an address of its own.
ROBOT, HERE = '127.0.19.1', '127.0.0.1'
PORTS = {
    'primary_port': 30001,
    'secondary_port': 30002,
    'realtime_port': 30003,
    'rtde_port': 30004,
    'dashboard_port': 29999,
    'interpreter_port': 30020,
}
STEP = 0.002
GAIN, LOOKAHEAD = 2000.0, 0.03
OTHER = 'ur-rtde'
#: Fractions of the path between which it is evaluated.
FIRST, LAST = 0.2, 0.8
PERCENTILES = (('p50', 50.0), ('p99', 99.0), ('most', 100.0))


@dataclass(frozen=True, slots=True, kw_only=True)
class SetpointStream:
    """Set-points of servoj: cycle number and time on the path [s] of each; lag of the arm [s]."""

    cycles: NDArray[np.float64]
    path_times: NDArray[np.float64]
    lag: float

    @property
    def jitter(self) -> list[float]:
        """Deviation of each set-point from an even stream [ms]."""
        off = self.path_times - STEP * self.cycles
        return list(1e3 * np.abs(off - np.median(off)))

    def share(self, low: float, high: float) -> float:
        """Return the share of steps between set-points [%] that are in (low, high] cycles."""
        steps = np.diff(self.path_times) / (STEP * np.diff(self.cycles))
        return float(100.0 * np.mean((steps > low) & (steps <= high)))


def run(quick: bool) -> Iterator[Figure]:
    """Stream the same path with both clients."""
    seconds = 3.0 if quick else 10.0
    with simulator(count_servoj, host=ROBOT, **PORTS) as robot:
        ours, spline = _servo(robot, seconds)
        other = _ur_rtde(robot, spline) if importlib.util.find_spec('rtde_control') else None
    for text, percent in PERCENTILES:
        yield Figure(
            benchmark=NAME,
            name=f'set-point off an even stream, {text}',
            unit='ms',
            value=round(percentile(ours.jitter, percent), 3),
            than=OTHER,
            baseline=round(percentile(other.jitter, percent), 3) if other else None,
        )
    for text, low, high in (
        ('cycles without a new set-point', -1.0, 0.5),
        ('cycles in which one was left out', 1.5, 1e9),
    ):
        yield Figure(
            benchmark=NAME,
            name=text,
            unit='%',
            value=ours.share(low, high),
            than=OTHER,
            baseline=other.share(low, high) if other else None,
        )
    yield Figure(
        benchmark=NAME,
        name='arm behind what was sent last',
        unit='ms',
        value=1e3 * ours.lag,
        baseline=1e3 * other.lag if other else None,
        than=OTHER,
        note=f'of it {1e3 * LOOKAHEAD:g} ms the lookahead of servoj; ours keeps 40 ms in '
        'the buffer',
    )


def count_servoj(robot: SimulatedRobot) -> Mapping[str, Callable[..., Any]]:
    """Return a call for the cycles and set-points of servoj since the last call."""
    motion, received = robot.controller.motion, list[tuple[int, tuple[float, ...]]]()
    carry_out = motion.servoj

    def servoj(q: Any, *settings: Any) -> Any:
        received.append((robot.controller.cycles, tuple(q)))
        return carry_out(q, *settings)

    def take() -> list[tuple[int, tuple[float, ...]]]:
        taken = list(received)
        received.clear()
        return taken

    patched: Any = motion
    patched.servoj = servoj  # measured
    return {'servoj_calls': take}


def _servo(robot: Child, seconds: float) -> tuple[SetpointStream, JointSpline]:
    config = DriverConfig(
        robot_ip=ROBOT,
        ur_type='ur5e',
        headless_mode=True,
        allowed_peers=(ROBOT, HERE),
        reverse_port=0,
        script_sender_port=0,
        trajectory_port=0,
        script_command_port=0,
        servoj_gain=GAIN,
        servoj_lookahead_time=LOOKAHEAD,
    )
    lags: list[float] = []

    def note(progress: Progress) -> None:
        lags.append(progress.lag)

    with Driver(config) as driver:
        driver.wait_ready(20.0)
        state = driver.state
        assert state is not None
        plan = driver.plan(_goal(state.actual_tcp_pose, seconds))
        robot.call('servoj_calls')
        outcome = driver.start(plan, on_progress=note).result(seconds + 20.0)
        if not outcome.succeeded:
            raise RuntimeError(outcome.text)
        time.sleep(0.1)
    return _measured_stream(robot, spline_of(plan), float(np.median(lags[3:-3]))), spline_of(plan)


def _goal(here: Pose, seconds: float) -> Goal:
    x, y, z = here.position
    there = Pose((x, y, z + 0.02 * seconds), here.quaternion)
    return Goal(waypoints=(Waypoint(pose=there, time=seconds),), execution=ExecutionMode.SERVO)


def spline_of(plan: Plan) -> JointSpline:
    """Return the joint spline that a plan streams."""
    return JointSpline.of(
        plan.start,
        [segment.primitive for segment in plan.segments if isinstance(segment.primitive, Spline)],
    )


def _ur_rtde(robot: Child, spline: JointSpline) -> SetpointStream:
    """Stream the path with ``ur-rtde``, in a process of its own."""
    rows = spline.rows(np.arange(0.0, spline.duration + STEP, STEP))[0]
    robot.call('servoj_calls')
    with tempfile.TemporaryDirectory() as folder:
        path, sent = Path(folder) / 'rows.npy', Path(folder) / 'sent.npy'
        np.save(path, rows)
        subprocess.run(
            [sys.executable, __file__, str(path), str(sent)],
            check=True,
            timeout=120.0,
            stdout=subprocess.DEVNULL,
        )
        newest, actual = np.load(sent)
    inner = slice(round(FIRST * len(newest)), round(LAST * len(newest)))
    behind = _path_time(spline, newest[inner]) - _path_time(spline, actual[inner])
    return _measured_stream(robot, spline, float(np.median(behind)))


def _measured_stream(robot: Child, spline: JointSpline, lag: float) -> SetpointStream:
    received = robot.call('servoj_calls')
    path_times = _path_time(spline, np.array([q for _, q in received]))
    # Another program moves the arm back to the start meanwhile.
    inner = (path_times > FIRST * spline.duration) & (path_times < LAST * spline.duration)
    return SetpointStream(
        cycles=np.array([float(cycle) for cycle, _ in received])[inner],
        path_times=path_times[inner],
        lag=lag,
    )


def _path_time(spline: JointSpline, q: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the times of joints (n, 6) on the path, by the joint that moves most."""
    times = np.arange(0.0, spline.duration, 0.5 * STEP)
    rows = spline.rows(times)[0]
    joint = int(np.argmax(np.abs(rows[-1] - rows[0])))
    sign = 1.0 if rows[-1, joint] > rows[0, joint] else -1.0
    times_at: NDArray[np.float64] = np.interp(sign * q[:, joint], sign * rows[:, joint], times)
    return times_at


def _stream_with_ur_rtde(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Stream with ur-rtde; return joints sent and measured, (2, n, 6)."""
    from rtde_control import RTDEControlInterface
    from rtde_receive import RTDEReceiveInterface

    control = RTDEControlInterface(ROBOT, 500.0)
    receive = RTDEReceiveInterface(ROBOT, 500.0)
    control.moveJ(rows[0].tolist(), 1.0, 1.0)
    actual = []
    for row in rows.tolist():
        period = control.initPeriod()
        control.servoJ(row, 0.0, 0.0, STEP, LOOKAHEAD, GAIN)
        actual.append(receive.getActualQ())
        control.waitPeriod(period)
    control.servoStop()
    control.stopScript()
    return np.array([rows, actual])


if __name__ == '__main__':
    np.save(sys.argv[2], _stream_with_ur_rtde(np.load(sys.argv[1])))
