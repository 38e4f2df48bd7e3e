# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A square with rounded corners that starts at the tool."""

from ur_cartesian_driver.path import mm, Path, Pose


def square(start: Pose) -> Path:
    path = Path(start).at(speed=0.1, acceleration=0.5, blend=mm(10))
    return path.by(dy=0.2).by(dx=0.2).by(dy=-0.2).by(dx=-0.2)


if __name__ == '__main__':
    from on_robot import run

    run(square)
