# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Along the rim of a slot: at its ends the tool turns with the arc. Tolerances stop the arm."""

from ur_cartesian_driver.path import digital, mm, Path, Pose, Tolerance

SPINDLE = digital(1)


def slot(start: Pose, length: float = 0.1, width: float = 0.06) -> Path:
    x, y, z = start.position
    r, end = width / 2, y + length
    return (
        Path(start)
        .at(speed=0.08, acceleration=0.8)
        .process((x, end, z)).set(SPINDLE, True)
        .arc((x + width, end, z), via=(x + r, end + r, z), follow=True)
        .process((x + width, y, z))
        .arc((x, y, z), via=(x + r, y - r, z), follow=True).set(SPINDLE, False)
        .tolerances(path=Tolerance(position=(mm(3),) * 3))
        .safe(SPINDLE, False)
    )  # fmt: skip


if __name__ == '__main__':
    from on_robot import run

    run(slot)
