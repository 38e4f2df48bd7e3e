# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A bead of glue round a corner: the pump follows the speed of the tool."""

from ur_cartesian_driver.path import analog, AnalogDomain, mm, Path, Pose

PUMP = analog(1, AnalogDomain.VOLTAGE)


def bead(start: Pose, side: float = 0.07) -> Path:
    return (
        Path(start)
        .at(speed=0.1, acceleration=0.5, blend=mm(5))
        .by(dz=mm(-30))
        .by(dy=mm(30)).follow_speed(PUMP, 3.0, offset=0.1, filter_time=0.01, lead=0.05)
        .by(dy=side)
        .by(dx=side).end_follow_speed(PUMP, lead=0.05)
        .by(dz=mm(30))
    )  # fmt: skip


if __name__ == '__main__':
    from on_robot import run

    run(bead)
