# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A motion by set-points (SERVO) that waits while somebody holds the arm over 5 mm off it."""

from ur_cartesian_driver.path import ExecutionMode, mm, Path, Pose, Tolerance


def stall(start: Pose) -> Path:
    return (
        Path(start)
        .by(dy=mm(100), duration=1.5)
        .by(dy=mm(-100), duration=1.5)
        .executed_as(ExecutionMode.SERVO)
        .tolerances(path=Tolerance(position=(mm(5),) * 3), stall=3.0)
    )


if __name__ == '__main__':
    from on_robot import run

    run(stall)
