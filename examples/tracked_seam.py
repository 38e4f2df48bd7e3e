# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A seam whose path follows a sensor that measures how far the seam lies to the side."""

from time import sleep

from ur_cartesian_driver.driver import MotionHandle
from ur_cartesian_driver.path import ExecutionMode, mm, Path, Pose


def tracked_seam(start: Pose) -> Path:
    x, y, z = start.position
    return (
        Path(start)
        .executed_as(ExecutionMode.SERVO)
        .path_offset(across=mm(6), timeout=0.3)
        .line((x, y + 0.2, z), duration=5.0)
    )


def follow(motion: MotionHandle, start: Pose) -> None:
    while not motion.done():
        motion.set_path_offset(across=mm(3))  # what your sensor sees
        sleep(0.02)


if __name__ == '__main__':
    from on_robot import run

    run(tracked_seam, meanwhile=follow)
