# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Round the upper half of a pipe, the tool against its surface and leaning 10 degrees."""

from math import cos, sin

from ur_cartesian_driver.path import against, deg, Path, Pose, tilted, Y

CENTRE, RADIUS = (-0.5, -0.05, 0.34), 0.08


def place(angle: float) -> Pose:
    x, y, z = CENTRE
    normal = (0.0, cos(angle), sin(angle))
    q = tilted(deg(10), about=(0.0, -normal[2], normal[1]), of=against(normal, x=Y))
    return Pose((x, y + RADIUS * normal[1], z + RADIUS * normal[2]), q)


def pipe(start: Pose) -> Path:
    path = Path(start).spline(place(deg(130)), duration=2.0)
    for angle in range(120, 49, -10):
        path = path.spline(place(deg(angle)), duration=0.25)
    return path.spline(start, duration=2.0)


if __name__ == '__main__':
    from on_robot import run

    run(pipe)
