# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The feeder of a goal whose points are all known: START with their number, then the points."""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.feeder import Feeder
from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand, SendControl
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.execution.points.send_window import SendWindow
from ur_cartesian_driver.motion.events import Event
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction


class PointFeeder(Feeder):
    """Sends records as fast as the send window permits."""

    #: Whether offsets that the robot program gets through registers displace the path.
    _takes_offsets = False

    def __init__(self, monitor: GoalMonitor) -> None:
        """Begin with no record sent."""
        super().__init__(monitor)
        self._window = SendWindow()
        #: Whether the program runs a trajectory of this goal, as far as is known.
        self._is_running = False

    def enter(self, state: GoalState, packet: RobotState) -> list[GoalCommand]:
        """
        Return START with the first points, or CANCEL.

        A goal that ends while its trajectory runs (a connection other than the program's is lost)
        cancels it, too: sent but unread points would run in the next goal.
        """
        was_running = self._is_running
        self._is_running = state in (GoalState.MOVING, GoalState.RUNNING_OUT)
        if state is GoalState.MOVING:
            return self._start(packet)
        if state is GoalState.CANCELLING or (state is GoalState.ENDED and was_running):
            return [SendControl(action=TrajectoryAction.CANCEL, count=self._sent_points())]
        return []

    def _start(self, packet: RobotState) -> list[GoalCommand]:
        self.monitor.start(packet.points_begun)
        start = SendControl(
            action=TrajectoryAction.START,
            count=self.monitor.job.points,
            takes_offsets=self._takes_offsets,
        )
        return [start, *self._release()]

    def _sent_points(self) -> int:
        """Return the number of sent points of the trajectory."""
        return self._window.sent

    def feed(self, event: Event, now: float) -> list[GoalCommand]:
        """Return the command that sends the records that the send window permits."""
        return self._release()

    def _release(self) -> list[GoalCommand]:
        return self._window.release(self.monitor.records_begun(), self.monitor.job.points)

    @property
    def buffered(self) -> float:
        """Planned time of the sent records ahead of the arm [s]."""
        return self.monitor.buffered(self._window.sent)
