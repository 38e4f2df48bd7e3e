# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A bead that begins and ends between points, with leads for a valve; a picture every 5 mm."""

from ur_cartesian_driver.path import digital, mm, Path, Pose

VALVE, CAMERA = digital(2), digital(4)
OPEN, CLOSE = 0.060, 0.035  # [s] how late your valve is: "ur-cartesian valve" measures it


def photo_bead(start: Pose) -> Path:
    return (
        Path(start)
        .at(speed=0.05)
        .by(dy=mm(20))
        .pulses(CAMERA, mm(5), width=0.02)
        .set(VALVE, True, distance=mm(10), lead=OPEN)
        .by(dy=mm(70))
        .by(dx=mm(70))
        .end_pulses(CAMERA)
        .set(VALVE, False, distance=mm(-10), lead=CLOSE)
        .by(dy=mm(-30))
        .safe(VALVE, False)
    )


if __name__ == '__main__':
    from on_robot import run

    run(photo_bead)
