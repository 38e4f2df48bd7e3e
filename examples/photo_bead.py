# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A bead that begins and ends between points, ahead of a slow valve, and a picture every 5 mm."""

from ur_cartesian_driver.path import digital, mm, Path, Pose

VALVE, CAMERA = digital(2), digital(4)
OPEN, CLOSE = 0.060, 0.035  # [s] how late your valve is: "ur-cartesian valve" measures it


def photo_bead(start: Pose) -> Path:
    x, y, z = start.position
    return (
        Path(start)
        .at(speed=0.05)
        .line((x, y + mm(20), z))
        .pulses(CAMERA, mm(5), width=0.02)
        .set(VALVE, True, distance=mm(10), lead=OPEN)
        .line((x, y + mm(90), z))
        .line((x + mm(70), y + mm(90), z))
        .end_pulses(CAMERA)
        .set(VALVE, False, distance=mm(-10), lead=CLOSE)
        .line((x + mm(70), y + mm(60), z))
        .safe(VALVE, False)
    )


if __name__ == '__main__':
    from on_robot import run

    run(photo_bead)
