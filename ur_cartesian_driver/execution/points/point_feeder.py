# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Feeds a goal whose points are all known: START with their number, then the points."""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.feeder import Feeder
from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand, SendControl, SendPoints
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.execution.points.send_window import SendWindow
from ur_cartesian_driver.motion.state.robot_state import RobotState
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction


class PointFeeder(Feeder):
    """Sends records as fast as the send window lets it."""

    def __init__(self, monitor: GoalMonitor) -> None:
        """Prepare the records of the goal."""
        super().__init__(monitor)
        self._total = monitor.job.points
        self._window = SendWindow()

    def enter(self, state: GoalState, packet: RobotState) -> list[GoalCommand]:
        """Return START with the first points, or CANCEL."""
        if state is GoalState.MOVING:
            self.monitor.start(packet.points_begun)
            return [
                SendControl(action=TrajectoryAction.START, count=self._total),
                *self.feed(),
            ]
        if state is GoalState.CANCELLING:
            return [SendControl(action=TrajectoryAction.CANCEL, count=self._window.sent)]
        return []

    def feed(self) -> list[GoalCommand]:
        """Return the records that the send window lets go."""
        first, end = self._window.release(self.monitor.records_begun(), self._total)
        return [SendPoints(first=first, end=end)] if end > first else []

    @property
    def buffered(self) -> float:
        """Planned time of what was sent and lies ahead of the arm [s]."""
        return self.monitor.buffered(self._window.sent)
