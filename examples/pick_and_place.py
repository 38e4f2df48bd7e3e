# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Pick and place: joint motions between the places, lines at them, a gripper at the tool."""

from ur_cartesian_driver.path import DOWN, mm, Path, Pose, tool_digital

GRIPPER = tool_digital(0)
PICK, PLACE, OVER = (-0.45, -0.25, 0.30), (-0.55, 0.10, 0.30), mm(80)


def pick_and_place(start: Pose) -> Path:
    x, y, z = PICK
    u, v, w = PLACE
    return (
        Path(start)
        .at(speed=0.15, joint_speed=0.8, joint_acceleration=2.0)
        .joint((x, y, z + OVER), DOWN)
        .line(PICK).set(GRIPPER, True)
        .by(dz=OVER, blend=mm(30))
        .joint((u, v, w + OVER))
        .line(PLACE).set(GRIPPER, False)
        .by(dz=OVER)
        .safe(GRIPPER, True)  # what was picked is held, whatever happens
    )  # fmt: skip


if __name__ == '__main__':
    from on_robot import run

    run(pick_and_place)
