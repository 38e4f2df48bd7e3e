# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A weld that begins when the arc burns: light, wait for the input, rest, go, fill the crater."""

from ur_cartesian_driver.path import digital, digital_input, mm, Path, Pose

# The simulator needs the arc: ur-cartesian sim --input 'standard 3'
TORCH, ARC_ESTABLISHED = digital(1), digital_input(3)


def arc_start(start: Pose, length: float = 0.08) -> Path:
    return (
        Path(start)
        .safe(TORCH, False)
        .by(dz=mm(-30), speed=0.1).set(TORCH, True).wait_for(ARC_ESTABLISHED, timeout=2.0)
        .dwell(0.3)
        .by(dy=length, speed=0.02).dwell(0.4).set(TORCH, False, after=0.4)
        .by(dz=mm(50), speed=0.2)
    )  # fmt: skip


if __name__ == '__main__':
    from on_robot import run

    run(arc_start)
