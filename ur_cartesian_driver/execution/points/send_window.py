# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The bound on records on their way to the robot."""

from __future__ import annotations

from dataclasses import dataclass

from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand, SendPoints


@dataclass(slots=True)
class SendWindow:
    """
    Releases records so that at most ``size`` are sent and not yet begun.

    When a goal is cancelled, the robot program reads and discards everything that was sent (10
    points in each step of the controller), so the window bounds the time of a cancel: 500 points
    cost 0.1 s at 500 Hz. Still, 500 points are far more than the robot can run in its 0.5 s read
    timeout, so the window does not make it wait for a point.
    """

    size: int = 500
    sent: int = 0
    #: Number of records that the robot has begun, as far as known.
    begun: int = 0

    def release(self, begun: int, limit: int) -> list[GoalCommand]:
        """
        Return the command that sends the records that fit into the window, or none.

        :param begun: number of records that the robot has begun.
        :param limit: largest number of records to send in total, even if more fit into the window.
        """
        self.begun = max(self.begun, begun)
        return self.send(min(limit, self.begun + self.size))

    def send(self, end: int) -> list[GoalCommand]:
        """Return the command that sends all records before ``end``, or none."""
        first, self.sent = self.sent, max(self.sent, end)
        return [SendPoints(first=first, end=end)] if end > first else []
