# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Layers of glue on top of each other: the same bead, 3 mm higher each time."""

from ur_cartesian_driver.path import analog, digital, mm, Path, Pose

VALVE, PRESSURE = digital(0), analog(0)


def layers(start: Pose, count: int = 2) -> Path:
    bead = (
        Path(start)
        .at(speed=0.12, acceleration=1.0, blend=mm(1))
        .by(dy=mm(10)).set(VALVE, True).set(PRESSURE, 0.6)
        .by(dy=0.08, motion='process')
        .by(dx=0.04, motion='process')
        .by(dy=-0.08, motion='process').set(VALVE, False)
        .by(dy=mm(-10))
        .by(dx=-0.04)
    )  # fmt: skip
    return bead.repeated(count, dz=mm(3)).safe(VALVE, False)


if __name__ == '__main__':
    from on_robot import run

    run(layers)
