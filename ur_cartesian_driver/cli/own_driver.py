# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The driver that a command runs by itself, without ROS."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ur_cartesian_driver.driver import Driver, DriverConfig


@contextmanager
def ready_driver(arguments: argparse.Namespace, **settings: Any) -> Iterator[Driver]:
    """
    Run a driver in headless mode during the block, which begins when the robot is ready.

    :param settings: further fields of the driver's configuration.
    :raises RobotNotReady: the robot is not ready in time; the text says what to do.
    """
    config = DriverConfig(
        robot_ip=arguments.robot_ip,
        ur_type=arguments.ur_type,
        headless_mode=True,
        rtde_port=arguments.rtde_port,
        primary_port=arguments.primary_port,
        dashboard_port=arguments.dashboard_port,
        **settings,
    )
    with Driver(config) as driver:
        driver.wait_ready(arguments.wait)
        yield driver
