# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Once around an upright pipe, free about z: wrist 3 would leave its range otherwise."""

from math import cos, pi, sin

from ur_cartesian_driver.path import against, deg, mm, Path, Pose

CENTRE, RADIUS, LEAN = (-0.5, -0.1, 0.3), 0.05, deg(30)


def place(angle: float) -> Pose:
    """Return the pose of the tool against the pipe from outside and above, x along the seam."""
    x, y, z = CENTRE
    outwards = (cos(angle) * cos(LEAN), sin(angle) * cos(LEAN), sin(LEAN))
    q = against(outwards, x=(-sin(angle), cos(angle), 0.0))
    return Pose((x + RADIUS * cos(angle), y + RADIUS * sin(angle), z), q)


def round_pipe(start: Pose) -> Path:
    path = Path(start).at(speed=0.03, blend=mm(2)).free('z').joint(place(pi / 2), blend=0.0)
    for k in range(1, 25):
        path = path.line(place(pi / 2 + k * pi / 12))
    return path


if __name__ == '__main__':
    from on_robot import run

    run(round_pipe)
