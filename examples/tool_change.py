# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Take turns with the pendant's program, which calls the driver by its node External Control."""

from ur_cartesian_driver.driver import Driver, DriverConfig
from ur_cartesian_driver.path import mm, Path, Pose


def tool_change(start: Pose) -> Path:
    return Path(start).at(speed=0.1).by(dz=mm(-40)).by(dy=mm(60)).by(dz=mm(40))


if __name__ == '__main__':
    from on_robot import robot_options

    given = robot_options().parse_args()
    with Driver(DriverConfig(robot_ip=given.robot_ip, ur_type=given.ur_type)) as driver:
        while True:
            driver.wait_ready(timeout=60.0)  # until the program reaches External Control
            state = driver.state
            assert state is not None
            print(driver.execute(tool_change(state.actual_tcp_pose)).raise_for_error().text)
            print(driver.hand_back_control().text)
