# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The robot's state in every step, through an RTDE connection of its own."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ur_cartesian_driver.motion.effective_speed import EffectiveSpeed
from ur_cartesian_driver.motion.robot_state import RobotState
from ur_cartesian_driver.protocol.rtde.rtde_client import RtdeClientCodec
from ur_cartesian_driver.protocol.rtde.rtde_recipe import RtdeValues
from ur_cartesian_driver.robot.rtde.rtde_connection import RtdeConnection
from ur_cartesian_driver.robot.rtde.state_recipe import (
    in_recipe_order,
    OPTIONAL_FIELDS,
    robot_state_from_rtde,
    STATE_FIELDS,
)


class StateStream(RtdeConnection):
    """Used once, from one event loop: open it, wait for its end, close it."""

    def __init__(self, frequency: float, on_state: Callable[[RobotState], None]) -> None:
        """
        Prepare a stream.

        :param frequency: packets per second; 0 = as many as the robot can.
        :param on_state: a packet came in; also before :meth:`open` returns.
        """
        super().__init__(
            RtdeClientCodec(
                outputs=STATE_FIELDS, optional_outputs=OPTIONAL_FIELDS, frequency=frequency
            ),
            self._on_row,
        )
        self._on_state = on_state
        self._effective_speed = EffectiveSpeed()

    def _on_row(self, names: Sequence[str], values: RtdeValues) -> None:
        state = robot_state_from_rtde(in_recipe_order(names, values))
        state.effective_speed = self._effective_speed.update(
            state.timestamp, state.speed_scaling, state.target_speed_fraction, state.runtime_state
        )
        self._on_state(state)
