# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Glue along a drawn contour of a plate, which the arm moves over a nozzle fixed in the cell."""

from ur_cartesian_driver.path import against, digital, mm, Path, Pose, StaticFrame, X, Y, Z

FRAMES = (
    StaticFrame('plate', 'tool0', Pose((0.0, 0.0, 0.03))),
    StaticFrame('nozzle', 'base', Pose((-0.49, -0.13, 0.42), against((0, 0, -1), x=Y))),
)
GLUE = digital(2)
CONTOUR = [(-30, -20), (0, -26), (30, -20), (34, 0), (30, 20), (6, 20), (0, 12), (-6, 20)]


def glue_contour(start: Pose) -> Path:
    *points, last = [(mm(x), mm(y), 0.0) for x, y in [*CONTOUR, (-30, 20), (-30, -20)]]
    path = Path(frame='plate', tool='nozzle').rounded(mm(0.5)).at(speed=0.1)
    path = path.line((*points[0][:2], mm(10)), against(Z, x=X)).line(points[0]).set(GLUE, True)
    path = path.at(speed=0.03)
    for point in points[1:]:
        path = path.line(point)
    return path.line(last).set(GLUE, False).at(speed=0.1).line((*last[:2], mm(10)))


if __name__ == '__main__':
    from on_robot import run

    run(glue_contour, FRAMES)
