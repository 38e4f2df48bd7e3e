# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Grind two sides of a part: the tool presses along its z axis, and gives way to the surface."""

from ur_cartesian_driver.path import mm, Path, Pose

# The simulator needs the part: ur-cartesian sim --contact 'plane 0 0 0.4559 0 0 1'


def grind(start: Pose, side: float = 0.07, force: float = 20.0) -> Path:
    return (
        Path(start)
        .at(speed=0.05)
        .by(dz=mm(-30)).press({'z': force}, speed_limits={'z': 0.02}, max_yield=mm(10))
        .by(dy=side, blend=mm(10))
        .by(dx=side).end_press()
        .by(dz=mm(30))
    )  # fmt: skip


if __name__ == '__main__':
    from on_robot import run

    run(grind)
