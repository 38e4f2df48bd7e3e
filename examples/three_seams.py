# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Three seams at the feet of ribs, in the shortest order; the driver finds the ways between."""

from pathlib import Path as FilePath

from ur_cartesian_driver.path import AirTravel, deg, join, Path, Pose, StaticFrame, tilted, X

CELL = str(FilePath(__file__).parents[1] / 'config' / 'cells' / 'three_ribs.yaml')
FRAMES = [StaticFrame('wire_tip', 'tool0', Pose((0.0, 0.0, 0.285)))]
AIR = {'retract': 0.05, 'approach': 0.05, 'blend': 0.03}


def three_seams(start: Pose, air: AirTravel) -> Path:
    q = tilted(deg(35), about=X)
    path = Path((-0.6, -0.22, 0.04), q, tool='wire_tip').at(speed=0.05, joint_speed=0.6)
    seam = path.by(dx=0.2)
    return join([seam, seam.offset(dy=0.4), seam.offset(dy=0.2)], air, order='best')


if __name__ == '__main__':
    from on_robot import run

    run(three_seams, FRAMES, cell_file=CELL, air=AIR)
