# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The stream of the robot's state, through a separate RTDE connection."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from math import inf

from ur_cartesian_driver.motion.state.effective_speed import EffectiveSpeed
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.motion.state.state_age import STALE_TIMEOUT, StateAge
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec
from ur_cartesian_driver.protocol.rtde.rtde_recipe import RtdeValues
from ur_cartesian_driver.robot.rtde.rtde_connection import RtdeConnection
from ur_cartesian_driver.robot.rtde.state_decoding import (
    in_recipe_order,
    OPTIONAL_FIELDS,
    robot_state_from_rtde,
    STATE_FIELDS,
)
from ur_cartesian_driver.robot.transport import ignore


class StateStream(RtdeConnection):
    """A stream, used once and from one event loop: open it, wait for its end, close it."""

    def __init__(
        self,
        frequency: float,
        max_age: float,
        on_state: Callable[[RobotState], None],
        *,
        lower_registers: bool = False,
        on_text: Callable[[str], None] = ignore,
    ) -> None:
        """
        Prepare a stream.

        :param frequency: rate of the packets [Hz]; 0 = one in every step of the controller.
        :param max_age: the connection ends when its states stay older than this [s]; 0 = never.
        :param on_state: called for each packet, possibly before :meth:`open` returns.
        :param lower_registers: whether the robot program reports in the registers from 0 on.
        :param on_text: as in :class:`RtdeConnection`.
        """
        super().__init__(
            RtdeClientCodec(
                outputs=STATE_FIELDS,
                optional_outputs=OPTIONAL_FIELDS,
                frequency=frequency,
                lower_registers=lower_registers,
            ),
            self._on_row,
            on_text=on_text,
        )
        self._on_state = on_state
        self._effective_speed = EffectiveSpeed()
        self._max_age = max_age or inf
        self._age: StateAge | None = None
        self._last_fresh = 0.0

    def _on_row(self, names: Sequence[str], values: RtdeValues) -> None:
        state = robot_state_from_rtde(in_recipe_order(names, values))
        state.effective_speed = self._effective_speed.update(
            state.timestamp, state.speed_scaling, state.target_speed_fraction, state.runtime_state
        )
        now = asyncio.get_running_loop().time()
        if self._age is None:
            self._age, self._last_fresh = StateAge(0.5 * self.round_trip), now
        state.state_age = self._age.update(now, state.timestamp)
        self._on_state(state)
        if state.state_age <= self._max_age:
            self._last_fresh = now
        elif now - self._last_fresh > STALE_TIMEOUT:
            self.abort(
                f'its states were older than max_state_age = {self._max_age:g} s for '
                f'{STALE_TIMEOUT:g} s'
            )
