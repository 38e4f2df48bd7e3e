# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Records RTDE packets with the times of their arrival."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from typing import Any

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.protocol.rtde.rtde_recipe import RtdeValues
from ur_cartesian_driver.robot.rtde.rtde_connection import RtdeConnection


def name_in(kind: type[IntEnum], number: int) -> str:
    """Return the name of a number that a robot reports; 'unknown (number)' if it has none."""
    try:
        return kind(number).name
    except ValueError:
        return f'unknown ({number})'


class RtdeRecorder:
    """Records from :meth:`open` to :meth:`close`; used once, from one event loop."""

    def __init__(self, names: Sequence[str], host: str, port: int) -> None:
        """
        Prepare; :meth:`open` connects.

        :param names: RTDE outputs to record; the robot may lack any of them except ``timestamp``.
        """
        self.names: tuple[str, ...] = ()
        self.rows: list[RtdeValues] = []
        #: Arrival time of each row, by the clock of the event loop [s].
        self.arrivals: list[float] = []
        self._requested = tuple(names)
        self._address = host, port
        self.connection = RtdeConnection(
            RtdeClientCodec(
                outputs=self._requested,
                optional_outputs=[name for name in names if name != 'timestamp'],
            ),
            self._take,
        )

    async def open(self) -> ControllerVersion:
        """
        Begin recording, and return the software version of the controller.

        :raises OSError: nothing answers, or the other side is not a robot.
        """
        return await self.connection.open(*self._address)

    def close(self) -> None:
        """End recording."""
        self.connection.close()

    @property
    def missing(self) -> tuple[str, ...]:
        """The outputs that the robot lacks."""
        return tuple(name for name in self._requested if name not in self.names)

    @property
    def newest(self) -> Mapping[str, Any]:
        """The values of the newest row by their names; empty before the first."""
        return dict(zip(self.names, self.rows[-1], strict=True)) if self.rows else {}

    def column(self, name: str) -> Floats:
        """Return the values of an output: (n,), or (n, m) for vectors; NaN (n,) if missing."""
        if name not in self.names:
            return np.full(len(self.rows), np.nan)
        i = self.names.index(name)
        return np.array([row[i] for row in self.rows], dtype=float)

    async def wait_for(self, is_reached: Callable[[Mapping[str, Any]], bool], time: float) -> bool:
        """
        Wait until the newest row meets a condition; return whether it did within ``time`` [s].

        :raises OSError: the connection ended before that.
        """
        ended = asyncio.create_task(self.connection.ended())
        end = asyncio.get_running_loop().time() + time
        try:
            while not (self.rows and is_reached(self.newest)):
                if ended.done():
                    host, port = self._address
                    raise OSError(f'{host} port {port} (RTDE): {ended.result()}')
                if asyncio.get_running_loop().time() >= end:
                    return False
                await asyncio.sleep(0.002)
            return True
        finally:
            ended.cancel()

    def _take(self, names: Sequence[str], values: RtdeValues) -> None:
        self.names = tuple(names)
        self.rows.append(values)
        self.arrivals.append(asyncio.get_running_loop().time())
