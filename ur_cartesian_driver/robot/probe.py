# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""One look at a robot: dial RTDE, take one packet, hang up. Nothing is written or started."""

from __future__ import annotations

import asyncio

from ur_cartesian_driver.motion.errors import ProtocolError
from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.protocol.rtde import DataReceived, Ready, RtdeClient
from ur_cartesian_driver.robot.state_recipe import OPTIONAL, REQUIRED, robot_state
from ur_cartesian_driver.robot.transport import dial

#: How long the robot may take to answer [s].
TIMEOUT = 5.0


async def read_state(host: str, port: int) -> RobotState:
    """
    Return the state of a robot.

    :raises OSError: nobody answers, or not as a robot.
    """
    client = RtdeClient(outputs=(*REQUIRED, *OPTIONAL), optional_outputs=OPTIONAL, frequency=10.0)
    found: asyncio.Future[RobotState] = asyncio.get_running_loop().create_future()
    names: list[str] = []

    def on_data(data: bytes) -> None:
        try:
            for event in client.feed(data):
                if isinstance(event, Ready):
                    names[:] = event.outputs.names
                elif isinstance(event, DataReceived) and not found.done():
                    found.set_result(robot_state(dict(zip(names, event.values, strict=True))))
        except ProtocolError as error:
            on_closed(str(error))
        connection.send(client.data_to_send())

    def on_closed(reason: str) -> None:
        if not found.done():
            found.set_exception(OSError(f'{host} port {port}: {reason}'))

    connection = await dial(host, port, on_data, on_closed)
    try:
        connection.send(client.start())
        async with asyncio.timeout(TIMEOUT):
            return await found
    except TimeoutError:
        raise OSError(f'{host} port {port} does not answer as an RTDE server') from None
    finally:
        connection.close()
