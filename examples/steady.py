# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A bead of glue around a corner, refused if it would run below 95 % of its speed."""

from ur_cartesian_driver.path import digital, mm, Path, Pose

GLUE = digital(2)


def steady(start: Pose) -> Path:
    x, y, z = start.position
    return (
        Path(start)
        .at(speed=0.05)
        .process((x, y + mm(10), z), blend=mm(2)).set(GLUE, True)  # it has its speed here
        .process((x, y + mm(70), z), blend=mm(10))
        .process((x + mm(60), y + mm(70), z), blend=mm(2)).set(GLUE, False)
        .process((x + mm(70), y + mm(70), z))
        .joint(start.position)
        .steady(0.95)
    )  # fmt: skip


if __name__ == '__main__':
    from on_robot import run

    run(steady)
