# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Plan, execute and stop Cartesian motions of one robot, from plain Python.

::

    with Driver(DriverConfig(robot_ip='192.168.56.101', ur_type='ur5e')) as driver:
        driver.wait_ready(timeout=10.0)
        outcome = driver.execute(Goal(waypoints=(Waypoint(pose=..., time=3.0),)))
        print(outcome.code.name, outcome.text)
"""

from typing import TYPE_CHECKING

from ur_cartesian_driver.lazy_names import lazy_names

if TYPE_CHECKING:
    from ur_cartesian_driver.driver.api import Driver
    from ur_cartesian_driver.driver.ipc.driver_config import DriverConfig
    from ur_cartesian_driver.driver.motion_handle import MotionHandle
    from ur_cartesian_driver.robot.connection_status import ConnectionStatus
    from ur_cartesian_driver.robot.lifecycle import ConnectionState

__all__ = ['ConnectionState', 'ConnectionStatus', 'Driver', 'DriverConfig', 'MotionHandle']

# Names are imported lazily: the robot process also imports modules from this package, but needs
# no planner.
__getattr__ = lazy_names(
    __name__,
    {
        'ur_cartesian_driver.driver.api': 'Driver',
        'ur_cartesian_driver.driver.ipc.driver_config': 'DriverConfig',
        'ur_cartesian_driver.driver.motion_handle': 'MotionHandle',
        'ur_cartesian_driver.robot.connection_status': 'ConnectionStatus',
        'ur_cartesian_driver.robot.lifecycle': 'ConnectionState',
    },
)
