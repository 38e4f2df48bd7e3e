# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A seam at the foot of a web: the torch turns so that its cable stays off the part."""

from pathlib import Path as FilePath

from ur_cartesian_driver.path import deg, mm, Path, Pose, StaticFrame, tilted, X

CELL = str(FilePath(__file__).parents[1] / 'config' / 'cells' / 'torch.yaml')
FRAMES = [StaticFrame('wire', 'tool0', Pose((0.0, 0.0, 0.295)))]


def torch_cable(start: Pose) -> Path:
    q = tilted(deg(35), about=X)
    path = Path(tool='wire').at(speed=0.03, joint_speed=0.5).free('z')
    path = path.joint((-0.62, -0.06, 0.07), q)
    return path.line((-0.38, -0.06, 0.07)).by(dz=mm(-100), of_tool=True)


if __name__ == '__main__':
    from on_robot import run

    run(torch_cable, FRAMES, cell_file=CELL)
