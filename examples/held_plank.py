# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Pick and place over a post: the held plank is checked for collisions like the tool."""

from pathlib import Path as FilePath

from ur_cartesian_driver.path import DOWN, mm, Path, Pose, StaticFrame, tool_digital

CELL = str(FilePath(__file__).parents[1] / 'config' / 'cells' / 'plank.yaml')
FRAMES = [StaticFrame('fingers', 'tool0', Pose((0.0, 0.0, 0.12)))]
GRIPPER = tool_digital(1)


def held_plank(start: Pose) -> Path:
    return (
        Path(tool='fingers')
        .at(speed=0.2, joint_speed=0.8)
        .joint((-0.5, -0.3, 0.1), DOWN)
        .line((-0.5, -0.3, 0.04)).set(GRIPPER, True)
        .attach('plank', mass=1.1, center_of_gravity=(0.0, 0.0, 0.13))
        .by(dz=0.22, blend=mm(30)).by(dy=0.4, blend=mm(30)).by(dz=-0.22)
        .set(GRIPPER, False).release('plank', mass=0.0)
        .by(dz=0.2)
    )  # fmt: skip


if __name__ == '__main__':
    from on_robot import run

    run(held_plank, FRAMES, cell_file=CELL)
