# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A bead of glue that slows when the pressure of the glue falls."""

from time import sleep

from ur_cartesian_driver.driver import MotionHandle
from ur_cartesian_driver.path import mm, Path, Pose


def fed_bead(start: Pose) -> Path:
    x, y, z = start.position
    path = Path(start).rounded(mm(2)).feed_override(0.3, rate=1.0, timeout=0.3)
    path = path.line((x, y + 0.07, z), speed=0.05)
    return path.line((x + 0.07, y + 0.07, z), speed=0.05)


def follow(motion: MotionHandle, start: Pose) -> None:
    while not motion.done():
        pressure = 4.0  # [bar] what your sensor says; 5 bar are enough for the planned speed
        motion.set_feed_override(min(1.0, pressure / 5.0))
        sleep(0.05)


if __name__ == '__main__':
    from on_robot import run

    run(fed_bead, meanwhile=follow)
