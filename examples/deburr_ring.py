# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Deburr the edge of a held ring at a fixed brush, free about z for the range of wrist 3."""

from math import cos, sin

from ur_cartesian_driver.path import against, deg, mm, Path, Pose, StaticFrame, X

FRAMES = (
    StaticFrame('ring', 'tool0', Pose((0.0, 0.0, 0.06))),
    StaticFrame('brush', 'base', Pose((-0.49, -0.13, 0.4), against((0, 0, -1), x=X))),
)


def deburr_ring(start: Pose) -> Path:
    def at(angle: float) -> Pose:  # from outside and 60 degrees below, x along the edge
        x, y = cos(deg(angle)), sin(deg(angle))
        return Pose((mm(40) * x, mm(40) * y, mm(10)), against((x, y, 3**0.5), x=(-y, x, 0)))

    path = Path(frame='ring', tool='brush').rounded(mm(0.1)).free('z').at(speed=0.1)
    path = path.line(at(0) @ Pose((0.0, 0.0, -mm(10)))).line(at(0)).at(speed=0.02)
    for angle in range(20, 381, 20):  # once around, and a little more
        path = path.arc(at(angle), via=at(angle - 10).position)
    return path.at(speed=0.1).line(at(380) @ Pose((0.0, 0.0, -mm(10))))


if __name__ == '__main__':
    from on_robot import run

    run(deburr_ring, FRAMES)
