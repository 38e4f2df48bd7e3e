# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A figure eight with a velocity at each point; the driver chooses the accelerations."""

from math import cos, pi, sin

from ur_cartesian_driver.path import Path, Pose


def figure_eight(start: Pose, points: int = 24, time: float = 4.5) -> Path:
    path = Path(start)
    x, y, z = start.position
    for i in range(1, points + 1):
        u = i / points
        s = 2 * pi * (10 * u**3 - 15 * u**4 + 6 * u**5)  # from rest to rest
        rate = 2 * pi * 30 * (u - u**2) ** 2 / time
        path = path.spline(
            (x + 0.03 * sin(2 * s), y + 0.06 * sin(s), z),
            duration=time / points,
            twist=(0.06 * cos(2 * s) * rate, 0.06 * cos(s) * rate, 0.0),
        )
    return path


if __name__ == '__main__':
    from on_robot import run

    run(figure_eight)
