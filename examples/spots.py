# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Spots of glue in a row: down, rest half a second with the valve open, up, on to the next."""

from ur_cartesian_driver.path import digital, mm, Path, Pose

VALVE = digital(2)


def spots(start: Pose, count: int = 3, pitch: float = 0.04, height: float = 0.03) -> Path:
    path = Path(start).at(speed=0.1, blend=mm(5)).safe(VALVE, False)
    for _ in range(count):
        path = (
            path
            .by(dz=-height).dwell(0.5).set(VALVE, True).set(VALVE, False, after=0.4)
            .by(dz=height).by(dy=pitch)
        )  # fmt: skip
    return path


if __name__ == '__main__':
    from on_robot import run

    run(spots)
