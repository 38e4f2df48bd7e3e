# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A bead along the floor of a channel; channel (an STL mesh) and nozzle are bodies of the cell."""

from pathlib import Path as FilePath

from ur_cartesian_driver.path import DOWN, Path, Pose, StaticFrame

CELL = str(FilePath(__file__).parents[1] / 'config' / 'cells' / 'channel.yaml')
FRAMES = [StaticFrame('bead_nozzle', 'tool0', Pose((0.0, 0.0, 0.16)))]


def channel(start: Pose) -> Path:
    return (
        Path(tool='bead_nozzle')
        .at(speed=0.1, joint_speed=0.5)
        .joint((-0.5, -0.23, 0.15), DOWN)
        .line((-0.5, -0.23, 0.04))
        .at(speed=0.03).by(dy=0.2)
        .at(speed=0.1).by(dz=0.11)
    )  # fmt: skip


if __name__ == '__main__':
    from on_robot import run

    run(channel, FRAMES, cell_file=CELL)
