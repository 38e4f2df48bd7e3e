# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A line behind a partition, far from where the arm stands: the driver finds the way there."""

from pathlib import Path as FilePath

from ur_cartesian_driver.path import DOWN, Path, Pose, StaticFrame

CELL = str(FilePath(__file__).parents[1] / 'config' / 'cells' / 'partition.yaml')
FRAMES = [StaticFrame('grip', 'tool0', Pose((0.0, 0.0, 0.1)))]


def far_start(start: Pose) -> Path:
    path = Path((0.25, -0.55, 0.15), DOWN, tool='grip').at(speed=0.05, joint_speed=0.6)
    return path.by(dx=0.1).allow_travel()


if __name__ == '__main__':
    from on_robot import run

    run(far_start, FRAMES, cell_file=CELL)
