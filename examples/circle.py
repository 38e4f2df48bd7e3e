# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A circle of two arcs with a blend between them."""

from ur_cartesian_driver.path import mm, Path, Pose


def circle(start: Pose, radius: float = 0.06) -> Path:
    x, y, z = start.position
    r = radius
    return (
        Path(start)
        .at(speed=0.1, acceleration=0.5)
        .arc((x, y + 2 * r, z), via=(x + r, y + r, z), blend=mm(5))
        .arc((x, y, z), via=(x - r, y + r, z))
    )


if __name__ == '__main__':
    from on_robot import run

    run(circle)
