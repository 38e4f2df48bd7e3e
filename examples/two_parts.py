# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""One job on two parts: made once in the axes of a part, moved to each of them."""

from ur_cartesian_driver.path import axis_angle, deg, DOWN, mm, Path, Pose, Z

LEFT = Pose((-0.45, -0.20, 0.25), axis_angle(Z, deg(10)))
RIGHT = Pose((-0.50, 0.05, 0.25), axis_angle(Z, deg(-15)))


def two_parts(start: Pose) -> Path:
    job = (
        Path((0.0, 0.0, 0.05), DOWN)
        .at(speed=0.15, acceleration=0.8)
        .by(dz=-0.05)
        .by(dx=0.06, motion='process')
        .by(dy=0.04, motion='process')
        .by(dz=0.05, blend=mm(0))
    )
    path = Path(start).at(joint_speed=0.8)
    for part in (LEFT, RIGHT):
        there = job.transformed(part)
        path = path.at(joint_speed=0.8).joint(there.start or start).then(there)
    return path


if __name__ == '__main__':
    from on_robot import run

    run(two_parts)
