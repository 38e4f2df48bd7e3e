# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Passes over a plate, forth and back, each beside the one before, then all crosswise."""

from ur_cartesian_driver.path import axis_angle, deg, mm, Path, Pose, Z


def polishing(start: Pose) -> Path:
    strokes = (
        Path(start)
        .at(speed=0.2, acceleration=2.0, blend=mm(4))
        .by(dy=0.08)
        .repeated(3, dx=mm(10), alternating=True)
    )
    there = Pose(start.position, (0.0, 0.0, 0.0, 1.0))
    about_start = there @ Pose(quaternion=axis_angle(Z, deg(90))) @ there.inverse()
    crosswise = strokes.transformed(about_start)
    return strokes.line(crosswise.start or start, speed=0.2).then(crosswise)


if __name__ == '__main__':
    from on_robot import run

    run(polishing)
