# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Through points at their times, without a stop; the driver chooses the velocities."""

from ur_cartesian_driver.motion.geometry.pose import multiply
from ur_cartesian_driver.path import axis_angle, deg, mm, Path, Pose, Z


def spline(start: Pose) -> Path:
    path = Path(start)
    x, y, z = start.position
    for i, (dx, dy, dz) in enumerate(
        (mm(40, 40, 0), mm(60, 90, 30), mm(10, 130, 40), mm(0, 60, 0))
    ):
        turned = multiply(axis_angle(Z, deg(5 * i)), start.quaternion)
        path = path.spline((x + dx, y + dy, z + dz), turned, duration=0.8)
    return path


if __name__ == '__main__':
    from on_robot import run

    run(spline)
