# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Deburr the edge of a ring in the hand at a brush that stands in the cell."""

from math import cos, sin

from ur_cartesian_driver.path import against, deg, mm, Path, Pose, StaticFrame, Y

FRAMES = (
    StaticFrame('ring', 'tool0', Pose((0.0, 0.0, 0.06))),
    StaticFrame('brush', 'base', Pose((-0.56, -0.13, 0.42), against((-1, 0, 0), x=Y))),
)


def deburr_ring(start: Pose, radius: float = 0.04) -> Path:
    def at(angle: float, r: float = radius) -> Pose:  # from outside, x of the brush along the edge
        x, y = cos(deg(angle)), sin(deg(angle))
        return Pose((r * x, r * y, 0.0), against((x, y, 0.0), x=(-y, x, 0.0)))

    path = Path(frame='ring', tool='brush').rounded(mm(0.1)).at(speed=0.1)
    path = path.line(at(-240, radius + mm(10))).line(at(-240)).at(speed=0.02)
    for angle in range(-180, 61, 60):  # a turn of 300 degrees, which the wrist has
        path = path.arc(at(angle), via=at(angle - 30).position)
    return path.at(speed=0.1).line(at(60, radius + mm(10)))


if __name__ == '__main__':
    from on_robot import run

    run(deburr_ring, FRAMES)
