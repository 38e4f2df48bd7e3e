# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Feeds a session of live targets: a servo goal without a plan.

It begins, is cancelled and ends as any other goal does, so everything that can happen to a goal is
already handled.
"""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand, LogWarning
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.execution.live.live_targets import LiveTargets
from ur_cartesian_driver.execution.servo.servo_feeder import ServoFeeder
from ur_cartesian_driver.execution.servo.servo_stream import ServoSettings, ServoStream
from ur_cartesian_driver.motion.events import Event
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.state.robot_state import RobotState

#: The arm goes where the targets lead it: there is no plan that it could leave.
ANY_DEVIATION = (0.0, 0.0)
#: Shortest time between two warnings that say why the arm does not follow its target [s].
WARNING_PERIOD = 2.0


class LiveFeeder(ServoFeeder):
    """Streams the set-points that lead to the newest target."""

    def __init__(
        self, monitor: GoalMonitor, targets: LiveTargets, settings: ServoSettings
    ) -> None:
        """Prepare; the arm is at rest where the targets' generator begins."""
        super().__init__(monitor, ServoStream(targets, settings))
        self.targets = targets
        self._blocked_reason, self._next_warning = '', 0.0

    def enter(self, state: GoalState, packet: RobotState) -> list[GoalCommand]:
        """Begin where the arm is."""
        if state is GoalState.MOVING:
            self.targets.generator.reset(packet.target_q)
        return super().enter(state, packet)

    def set_target(self, T_base_tcp: Pose, age: float, now: float) -> bool:
        """Take a target; see :meth:`LiveTargets.add`."""
        self.targets.add(T_base_tcp, age, now)
        return True

    def take(self, event: Event, now: float) -> list[GoalCommand]:
        """Let targets age; warn where the arm stops because of its target."""
        self.targets.update(now)
        commands = super().take(event, now)
        before, self._blocked_reason = self._blocked_reason, self.targets.blocked
        if self._blocked_reason and not before and now >= self._next_warning:
            self._next_warning = now + WARNING_PERIOD
            commands.append(
                LogWarning(text=f'the arm does not go to the live target: {self._blocked_reason}')
            )
        return commands

    def success_text(self) -> str:
        """Return the sentence of a session that has ended by itself."""
        return (
            f'The session is over: no live targets came for {self.targets.settings.timeout:g} s.'
        )

    def location(self, *, started: bool) -> str:
        """Return where the session ended, as a clause."""
        return 'following live targets' if started else 'before anything moved'

    def report_lines(self) -> tuple[str, ...]:
        """Return what became of the targets."""
        return self.targets.report
