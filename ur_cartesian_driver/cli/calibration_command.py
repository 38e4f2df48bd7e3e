# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``ur-cartesian calibration``: write the kinematics of a robot as ``ur_description`` takes it."""

from __future__ import annotations

import argparse
import asyncio
from pathlib import Path
import sys

from ur_cartesian_driver.kinematics.calibration_file import calibration_hash, calibration_text
from ur_cartesian_driver.kinematics.robot_models import DhTable
from ur_cartesian_driver.robot.check.finding import RobotAddress
from ur_cartesian_driver.robot.check.primary_observations import GEOMETRY_TIMEOUT, PrimaryProbe


def write_calibration(arguments: argparse.Namespace) -> int:
    """Write the reported kinematics to a file or to standard output."""
    address = RobotAddress(host=arguments.robot_ip, primary_port=arguments.primary_port)
    geometry = asyncio.run(reported_geometry(address))
    text = calibration_text(geometry)
    if not arguments.output:
        print(text, end='')
        return 0
    try:
        Path(arguments.output).write_text(text, encoding='utf-8')
    except OSError as error:
        raise OSError(f'{arguments.output} cannot be written: {error.strerror}') from None
    print(f'{calibration_hash(geometry)}: {arguments.output}', file=sys.stderr)
    return 0


async def reported_geometry(address: RobotAddress) -> DhTable:
    """
    Return the DH table that a robot reports on its primary interface.

    :raises OSError: the robot does not answer, or reports no kinematics.
    """
    probe = PrimaryProbe()
    try:
        await probe.open(address)
        geometry = await probe.find_geometry()
    finally:
        await probe.close()
    if geometry is None:
        raise OSError(
            f'the robot at {address.host} port {address.primary_port} has reported no kinematics '
            f'in {GEOMETRY_TIMEOUT:g} s'
        )
    return geometry
