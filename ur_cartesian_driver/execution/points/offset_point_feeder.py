# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The feeder of a goal whose points the robot runs while offsets displace the path.

In addition to sending points, the feeder answers each packet about the offset with the offset to
reach. The robot program moves towards this offset within the bounds of the goal, cycle by cycle,
so neither the network nor this computer can make the offset jump; the controller adds the present
offset to its motion, and reports it. The offset to reach, and its axes, are taken at the planned
time of the arm's position on the path.
"""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.feeder import Displaced, Prepared
from ur_cartesian_driver.execution.goal.goal_commands import (
    CloseOffsets,
    GoalCommand,
    OpenOffsets,
    WriteInputs,
)
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.execution.goal.timeouts import NO_INPUTS
from ur_cartesian_driver.execution.offsets.offset_requests import OffsetRequests
from ur_cartesian_driver.execution.points.point_feeder import PointFeeder
from ur_cartesian_driver.motion.events import Event, OffsetReceived
from ur_cartesian_driver.motion.geometry.vectors import ZERO3
from ur_cartesian_driver.motion.plan.offset_band import (
    AppliedOffset,
    NO_OFFSET,
    OffsetBand,
    OffsetFeedback,
)
from ur_cartesian_driver.motion.state.rtde_state import RobotState

#: Difference between our first sequence number and the last one that the robot has read. A lost
#: client may have written numbers between the two, which the robot has not read yet.
SEQUENCE_GAP = 1000
#: If the last number that the robot has read is not below this, ours begin at 1: long before the
#: register overflows.
MAX_SEQUENCE = 2**30


class OffsetPointFeeder(PointFeeder, Prepared, Displaced):
    """Sends points, and answers each packet about the offset with the offset to reach."""

    motion = 'path offsets'
    _takes_offsets = True

    def __init__(self, monitor: GoalMonitor, band: OffsetBand) -> None:
        """Keep the offset band; the RTDE inputs are not claimed yet."""
        super().__init__(monitor)
        self._band, self._requests = band, OffsetRequests(band)
        self.parts = (self._requests,)
        #: Our first sequence number (None = no packet came yet); our last sequence number.
        self._first: int | None = None
        self._sequence = 0
        self._moves = self._is_closed = False
        #: Whether the program may read offsets, now or in the motion to come.
        self._is_read = True
        self._applied = NO_OFFSET

    def prepare(self) -> list[GoalCommand]:
        """Return the command that claims the inputs."""
        return [OpenOffsets()]

    def explain_not_ready(self, packet: RobotState | None) -> str:
        """Return a clause if the robot has not granted the RTDE inputs yet, else ''."""
        return NO_INPUTS if self._first is None else ''

    def enter(self, state: GoalState, packet: RobotState) -> list[GoalCommand]:
        """Return START with the first points, CANCEL, or the command that releases the inputs."""
        # Offsets are written only for a motion: a sequence number that the program does not read
        # now would count for the next goal.
        self._moves = self._is_read = state is GoalState.MOVING
        commands = super().enter(state, packet)
        if state in (GoalState.RESTORING, GoalState.ENDED) and not self._is_closed:
            self._is_closed = True
            commands.append(CloseOffsets())
        return commands

    def feed(self, event: Event, now: float) -> list[GoalCommand]:
        """Answer a packet about the offset with a write, and a state packet with points."""
        if not isinstance(event, OffsetReceived):
            return super().feed(event, now)
        if self._is_closed:
            return []
        self._observe(event.feedback)
        return [WriteInputs(values=self._row())] if self._is_read else []

    def _observe(self, feedback: OffsetFeedback) -> None:
        last = feedback.last_sequence
        if self._first is None:
            self._sequence = last + SEQUENCE_GAP if 0 <= last < MAX_SEQUENCE else 0
            self._first = self._sequence + 1
        elif self._first <= last <= self._sequence:  # else the number is from an earlier goal
            self._applied = AppliedOffset(feedback.shift, feedback.offset)
            self._requests.note_applied(feedback.offset)

    def _row(self) -> tuple[float, ...]:
        """Return the inputs in the order of ``registers.OFFSET_INPUTS``."""
        band, time = self._band, self.monitor.time()
        self._sequence += 1
        return (
            self._sequence,
            *(self._requests.target(time) if self._moves else ZERO3),
            self.monitor.rate if self._moves else 0.0,
            *band.axes_at(time).ravel().tolist(),
            *band.limits,
            band.speed,
            band.acceleration,
        )

    def applied_offset(self, packet: RobotState) -> AppliedOffset:
        """Return the offset that the controller adds to its motion."""
        return self._applied
