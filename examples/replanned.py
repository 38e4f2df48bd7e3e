# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A planner that looks a second ahead, ten times a second: each plan replaces the one before."""

from math import cos, pi, sin
from time import sleep

from ur_cartesian_driver.driver import MotionHandle
from ur_cartesian_driver.path import mm, Path, Pose


def replanned(start: Pose, since: float = 0.0) -> Path:
    path, (x, y, z), first = Path(start), start.position, round(10 * since) + 2
    for k in range(first, first + 10):
        angle = 0.5 * pi * (0.005 * k**2 if k < 10 else 0.1 * k - 0.5)  # a circle, slow at first
        place = x + mm(50) * sin(angle), y + mm(50) * (1 - cos(angle)), z + mm(5) * sin(since)
        path = path.spline(place, duration=0.1 * k if k == first else 0.1)
    return path


def look_ahead(motion: MotionHandle, start: Pose) -> None:
    for _ in range(100):
        sleep(0.1)
        since = motion.progress.time + 0.3 if motion.progress else 0.3
        motion.append(replanned(start, since).goal().waypoints, replace_from_time=since)
    motion.append((), last=True)
