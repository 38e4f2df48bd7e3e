# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A bead of glue that slows when the pressure of the glue falls."""

from time import sleep

from ur_cartesian_driver.driver import MotionHandle
from ur_cartesian_driver.path import mm, Path, Pose

#: At this pressure the bead goes at the planned speed [bar].
FULL_PRESSURE = 5.0


def fed_bead(start: Pose) -> Path:
    x, y, z = start.position
    return (
        Path(start)
        .rounded(mm(2))
        .feed_override(0.3, rate=1.0, timeout=0.3)
        .line((x, y + 0.07, z), speed=0.05)
        .line((x + 0.07, y + 0.07, z), speed=0.05)
    )


def follow(motion: MotionHandle, start: Pose) -> None:
    while not motion.done():
        pressure = 4.0  # what your sensor says
        motion.set_feed_override(min(1.0, pressure / FULL_PRESSURE))
        sleep(0.05)


if __name__ == '__main__':
    from on_robot import run

    run(fed_bead, meanwhile=follow)
