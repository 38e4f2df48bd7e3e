# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A planner that looks a second ahead, ten times a second: each plan replaces the one before."""

from math import cos, sin
from time import sleep

from ur_cartesian_driver.driver import MotionHandle
from ur_cartesian_driver.path import ExecutionMode, mm, Path, Pose


def replanned(start: Pose, since: float = 0.0) -> Path:
    path, (x, y, z), first = Path(start), start.position, round(10 * since) + 1
    for k in range(first, first + 10):  # a circle, at 0.1 * (k + 1) seconds
        place = x + mm(50) * sin(0.1 * k), y + mm(50) * (1 - cos(0.1 * k)), z + mm(5) * sin(since)
        path = path.spline(place, duration=0.1 * (k + 1) if k == first else 0.1)
    return path.executed_as(ExecutionMode.SERVO).keep_open(replace_horizon=0.15)


def look_ahead(motion: MotionHandle, start: Pose) -> None:
    while (since := motion.progress.time + 0.3 if motion.progress else 0.3) < 10.0:
        motion.append(replanned(start, since).goal().waypoints, replace_from_time=since)
        sleep(0.1)
    motion.append((), last=True)


if __name__ == '__main__':
    from on_robot import run

    run(replanned, meanwhile=look_ahead)
