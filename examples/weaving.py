# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A torch that swings to both sides of its seam, as a spline."""

from ur_cartesian_driver.path import mm, Path, Pose


def weaving(start: Pose) -> Path:
    x, y, z = start.position
    seam = (
        Path(start)
        .at(speed=0.03, acceleration=0.2)
        .by(dy=0.04)
        .arc((x + 0.03, y + 0.07, z), via=(x + 0.0088, y + 0.0612, z))
    )
    return seam.weave(amplitude=mm(3), wavelength=mm(10))


if __name__ == '__main__':
    from on_robot import run

    run(weaving)
