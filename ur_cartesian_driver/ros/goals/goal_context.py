# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The objects that all goals of a node share."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from rclpy.clock import Clock

from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.motion.errors import CollisionPredicted
from ur_cartesian_driver.motion.goal.known_frames import ArmSnapshot, Frames
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.ros.goals.arm_arbiter import ArmArbiter
from ur_cartesian_driver.ros.parameters.node_parameters import Settings


@dataclass(frozen=True, slots=True, kw_only=True)
class GoalContext:
    """Driver, arbiter, frames, clock and settings, which all goals of a node share."""

    driver: Driver
    arbiter: ArmArbiter
    frames: Frames
    clock: Clock
    settings: Settings
    #: Shows a plan; called in the threads of goals.
    show: Callable[[Plan], None]
    #: Shows the collision of a refused goal; called in the threads of goals.
    show_refusal: Callable[[CollisionPredicted], None]

    def now(self) -> int:
        """Return the time of the node's clock [ns]."""
        return int(self.clock.now().nanoseconds)

    def snapshot(self) -> ArmSnapshot | None:
        """Return the pose and TCP of the arm after a stop that begins now; None if unknown."""
        state = self.driver.rest_state
        return None if state is None else ArmSnapshot.of(state)
