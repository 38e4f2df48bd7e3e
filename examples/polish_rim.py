# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Polish the rim of a box in the hand: the arm leads it along a belt that stands in the cell."""

from ur_cartesian_driver.path import against, axis_angle, deg, mm, Path, Pose, StaticFrame, Y, Z

FRAMES = (
    StaticFrame('box', 'tool0', Pose((0.0, 0.0, 0.08))),  # the middle of the rim
    StaticFrame('belt', 'base', Pose((-0.56, -0.15, 0.41), against((-1, 0, 0), x=Y))),
)


def polish_rim(start: Pose, a: float = 0.04, b: float = 0.03, r: float = 0.01) -> Path:
    path = Path(frame='box', tool='belt').rounded(mm(0.2)).at(speed=0.1)
    for side in range(4):
        turn = Pose((0.0, 0.0, 0.0), axis_angle(Z, deg(90 * side)))
        touch = (turn @ Pose((0.0, 0.0, 0.0), against((0, -1, 0), x=(1, 0, 0)))).quaternion
        along, out = (a, b) if side % 2 == 0 else (b, a)
        begin, end = (turn.apply((x, -out, 0.0)) for x in (r - along, along - r))
        k = 0.29289 * r  # the middle of the arc around a corner, which has the radius r
        corner = turn.apply((k - along, k - out, 0.0))
        path = path.arc(begin, touch, via=corner) if side else path.line(begin, touch)
        path = path.at(speed=0.02).line(end)
    return path.at(speed=0.1).line(turn.apply((along - r, -out - mm(20), 0.0)))


if __name__ == '__main__':
    from on_robot import run

    run(polish_rim, FRAMES)
