# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The rest of a bead of glue that was stopped on the way to its second point."""

from ur_cartesian_driver.path import digital, mm, Path, PathPlace, Pose

GLUE = digital(2)


def resumed_seam(start: Pose) -> Path:
    x, y, z = start.position
    bead = (
        Path(start)
        .at(speed=0.05)
        .process((x, y + mm(10), z), blend=mm(2)).set(GLUE, True)
        .process((x, y + mm(80), z)).set(GLUE, False)
        .joint(start.position)
    )  # fmt: skip
    stopped = PathPlace(point=1, fraction=0.4)  # as outcome.stopped of driver.execute(bead)
    return bead.resumed(stopped, overlap=mm(5), approach=mm(20))


if __name__ == '__main__':
    from on_robot import run

    run(resumed_seam)
