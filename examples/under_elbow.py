# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A seam under the elbow with a bent torch, free about z: the arm would hit itself otherwise."""

from ur_cartesian_driver.path import against, axis_angle, deg, mm, Path, Pose, StaticFrame, X, Y, Z

FRAMES = [StaticFrame('torch', 'tool0', Pose((0.0, 0.06, 0.12), axis_angle(X, deg(-45))))]


def under_elbow(start: Pose) -> Path:
    q = against(normal=Z, x=Y)
    path = Path(tool='torch').at(speed=0.05, joint_speed=0.5, blend=mm(2)).free('z')
    path = path.joint((-0.25, -0.25, 0.12), q, blend=0.0)
    for k in range(1, 11):
        path = path.line((-0.25, -0.25 + 0.05 * k, 0.12))
    return path


if __name__ == '__main__':
    from on_robot import run

    run(under_elbow, FRAMES)
