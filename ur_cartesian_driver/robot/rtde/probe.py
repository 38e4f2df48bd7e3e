# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Reads the state of a robot once by RTDE; writes and starts nothing."""

from __future__ import annotations

import asyncio

from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.robot.rtde.state_stream import StateStream


async def read_state(host: str, port: int) -> RobotState:
    """
    Return the state of a robot.

    :raises OSError: nothing answers, the other side is not a robot, or the connection ends.
    """
    states: list[RobotState] = []
    first = asyncio.Event()

    def take(state: RobotState) -> None:
        states.append(state)
        first.set()

    stream = StateStream(10.0, 0.0, take)
    waiting = asyncio.create_task(first.wait())
    try:
        await stream.open(host, port)
        ended = asyncio.create_task(stream.ended())
        await asyncio.wait({waiting, ended}, return_when=asyncio.FIRST_COMPLETED)
        ended.cancel()
        if not states:
            raise OSError(f'{host} port {port}: {ended.result()}')
        return states[0]
    finally:
        waiting.cancel()
        stream.close()
