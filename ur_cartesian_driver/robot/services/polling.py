# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Wait until a robot reports a condition, and describe its modes."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.robot.link import RobotLink

#: Time between two checks of a condition [s].
POLL_PERIOD = 0.02


async def wait_for_state(
    link: RobotLink, predicate: Callable[[RobotState], bool], within: float
) -> bool:
    """Wait up to ``within`` [s] for the state to meet a condition; return whether it does."""
    loop = asyncio.get_running_loop()
    end = loop.time() + within
    while loop.time() < end:
        state = link.robot
        if state is not None and predicate(state):
            return True
        await asyncio.sleep(POLL_PERIOD)
    return False


def describe_modes(link: RobotLink) -> str:
    """Return the robot's modes, as the end of a sentence."""
    state = link.robot
    if state is None:
        return link.status.message
    return (
        f'robot mode {state.robot_mode.name}, safety mode {state.safety_mode.name}, '
        f'program {state.runtime_state.name}.'
    )
