# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Pick and place with a gripper that brings its own URScript functions (script_prelude)."""

from pathlib import Path as FilePath

from ur_cartesian_driver.path import mm, Path, Pose

# The simulator needs the sensor of the gripper: ur-cartesian sim --input 'standard 2'
PRELUDE = str(FilePath(__file__).parents[1] / 'config' / 'examples' / 'gripper.script')


def pick(start: Pose) -> Path:
    return (
        Path(start)
        .at(speed=0.1)
        .by(dz=mm(-30)).call('close_gripper', 0.6, timeout=2.0).payload(1.2, (0.0, 0.0, 0.06))
        .by(dz=mm(30), blend=mm(10)).by(dy=0.1, blend=mm(10))
        .by(dz=mm(-30)).call('open_gripper').payload(0.0)
        .by(dz=mm(30))
    )  # fmt: skip


if __name__ == '__main__':
    from on_robot import run

    run(pick, allow_scripts=True, script_prelude=PRELUDE)
