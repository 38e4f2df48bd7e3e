# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A seam around a corner: the torch is on along it; part and nozzle are frames."""

from ur_cartesian_driver.path import deg, digital, mm, Path, Pose, StaticFrame, tilted

FRAMES = (
    StaticFrame('part', 'base', Pose((0.02, -0.01, 0.0))),
    StaticFrame('nozzle', 'tool0', Pose((0.0, 0.0, 0.1))),
)
TORCH = digital(2)


def seam(start: Pose | None = None) -> Path:
    return (
        Path(start, frame='part', tool='nozzle')
        .at(speed=0.15, acceleration=0.5)  # stays until changed, like a feed rate
        .joint((-0.55, -0.28, 0.40), tilted(deg(20)), posture={'elbow_joint': 1.6})
        .line((-0.55, -0.20, 0.25), blend=mm(5))
        .set(TORCH, True)  # at the end of the line before it, where the seam begins
        .at(speed=0.05).process((-0.55, 0, 0.25))
        .arc((-0.47, 0.08, 0.25), via=(-0.527, 0.057, 0.25))
        .process((-0.35, 0.08, 0.25)).set(TORCH, False)
    )  # fmt: skip


if __name__ == '__main__':
    from on_robot import run

    run(seam, FRAMES)
