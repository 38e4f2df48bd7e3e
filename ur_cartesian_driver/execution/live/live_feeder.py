# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The feeder of a session of live targets: a servo goal without a plan.

The session begins, is cancelled and ends like any other goal, so the goal machine already handles
all that can happen to a session.
"""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.feeder import Phrasing
from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.execution.live.live_targets import LiveTargets
from ur_cartesian_driver.execution.servo.servo_feeder import ServoFeeder
from ur_cartesian_driver.execution.servo.servo_stream import ServoSettings, ServoStream
from ur_cartesian_driver.motion.state.rtde_state import RobotState

#: The ``max_plan_deviation`` of a session: no limit, because there is no plan to deviate from.
ANY_DEVIATION = (0.0, 0.0)


class LiveFeeder(ServoFeeder, Phrasing):
    """Streams the set-points that lead to the newest target."""

    def __init__(
        self, monitor: GoalMonitor, targets: LiveTargets, settings: ServoSettings
    ) -> None:
        """Set up the stream; the arm is at rest."""
        super().__init__(monitor, ServoStream(targets, settings), targets)
        self.targets = targets

    def enter(self, state: GoalState, packet: RobotState) -> list[GoalCommand]:
        """Begin the motion at the arm's present position."""
        if state is GoalState.MOVING:
            self.targets.generator.reset(packet.target_q)
        return super().enter(state, packet)

    def success_text(self) -> str:
        """Return the sentence for a session that has ended by itself."""
        return (
            f'The session is over: no live targets came for {self.targets.settings.timeout:g} s.'
        )

    def location(self, *, started: bool) -> str:
        """Return the activity during which the session ended, as a clause."""
        return 'following live targets' if started else 'before anything moved'
