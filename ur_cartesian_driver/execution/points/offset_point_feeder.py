# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Feeds a goal whose points the robot runs, and whose path may give way to offsets meanwhile.

Beside the points, each packet of the robot is answered with where the tool shall be off its path.
The robot program moves the offset there within the bounds of the goal, cycle by cycle, so neither
the network nor this computer can make it jump; the controller adds it to its motion, and reports
what it adds. The time of the motion is that of the arm on its path.
"""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.goal_commands import (
    CloseOffsets,
    GoalCommand,
    OpenOffsets,
    SendControl,
    WriteInputs,
)
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.execution.goal.outcome_codes import GoalSignal, Meaning, NO_MEANING
from ur_cartesian_driver.execution.goal.timeouts import ARMING_TIMEOUT
from ur_cartesian_driver.execution.offsets.offset_requests import OffsetRequests
from ur_cartesian_driver.execution.points.point_feeder import PointFeeder
from ur_cartesian_driver.motion.events import Event, INPUTS_LINK, LinkLost, OffsetReceived
from ur_cartesian_driver.motion.geometry.vectors import Vector3, ZERO3
from ur_cartesian_driver.motion.plan.offset_band import (
    AppliedOffset,
    NO_OFFSET,
    OffsetBand,
    OffsetFeedback,
)
from ur_cartesian_driver.motion.state.robot_state import RobotState
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction

#: The first sequence number is so far beyond the last one that the robot has read: more than a
#: client that was lost may have written and the robot not read.
SEQUENCE_GAP = 1000
#: Beyond this number they begin at 0 again, long before the register overflows.
MAX_SEQUENCE = 2**30


class OffsetPointFeeder(PointFeeder):
    """Sends points, and the offset in answer to each packet about it."""

    def __init__(self, monitor: GoalMonitor, band: OffsetBand) -> None:
        """Prepare; the inputs are not taken yet."""
        super().__init__(monitor)
        self._band, self._requests = band, OffsetRequests(band)
        #: Our sequence numbers: the first, and the last; None = nothing was written.
        self._first: int | None = None
        self._sequence = 0
        self._moves = self._is_closed = False
        self._applied = NO_OFFSET

    # ---- what to send -------------------------------------------------------------------------

    def prepare(self) -> list[GoalCommand]:
        """Return what takes the inputs."""
        return [OpenOffsets()]

    def explain_not_ready(self, packet: RobotState | None) -> str:
        """Return that the inputs are not there yet."""
        if self._first is not None:
            return ''
        return (
            f'the robot did not give its RTDE inputs within {ARMING_TIMEOUT:g} s; '
            'nothing was moved'
        )

    def enter(self, state: GoalState, packet: RobotState) -> list[GoalCommand]:
        """Return START with the first points, CANCEL, or what releases the inputs."""
        self._moves = state is GoalState.MOVING
        commands = [
            SendControl(action=command.action, count=command.count, takes_offsets=True)
            if isinstance(command, SendControl) and command.action is TrajectoryAction.START
            else command
            for command in super().enter(state, packet)
        ]
        if state in (GoalState.RESTORING, GoalState.ENDED) and not self._is_closed:
            self._is_closed = True
            commands.append(CloseOffsets())
        return commands

    def set_path_offset(self, offset: Vector3, age: float, now: float) -> bool:
        """Take a path offset."""
        self._requests.set_offset(offset, age, now)
        return True

    # ---- what the robot confirms --------------------------------------------------------------

    def take(self, event: Event, now: float) -> list[GoalCommand]:
        """Answer a packet about the offset with a write."""
        commands = self._requests.warnings(now)
        if isinstance(event, OffsetReceived) and not self._is_closed:
            self._observe(event.feedback)
            commands.append(WriteInputs(values=self._row()))
        return commands

    def _observe(self, feedback: OffsetFeedback) -> None:
        last = feedback.last_sequence
        if self._first is None:
            self._sequence = last + SEQUENCE_GAP if 0 <= last < MAX_SEQUENCE else 0
            self._first = self._sequence + 1
        elif self._first <= last <= self._sequence:  # else it is what an earlier goal has left
            self._applied = AppliedOffset(feedback.shift, feedback.offset)
            self._requests.note_applied(feedback.offset)

    def _row(self) -> tuple[float, ...]:
        """Return the inputs in the order of ``registers.OFFSET_INPUTS``."""
        band, time = self._band, self.monitor.time()
        target = self._requests.target(time) if self._moves else ZERO3
        self._sequence += 1
        return (
            self._sequence,
            *target,
            self.monitor.rate if self._moves else 0.0,
            *band.axes_at(time).ravel().tolist(),
            *band.limits,
            band.speed,
            band.acceleration,
        )

    def interpret(self, event: Event, state: GoalState) -> Meaning | None:
        """Return what a packet about the offset, or the loss of the inputs, means to the goal."""
        match event:
            case OffsetReceived():
                return NO_MEANING
            case LinkLost(link=link, reason=reason) if (
                link == INPUTS_LINK and state is GoalState.ARMING
            ):
                return GoalSignal.NOT_READY, (
                    f'the robot does not take path offsets: {reason}'.rstrip('.')
                )
        return None

    def applied_offset(self, packet: RobotState) -> AppliedOffset:
        """Return what the controller adds to its motion."""
        return self._applied

    # ---- what to report -----------------------------------------------------------------------

    def report_lines(self) -> tuple[str, ...]:
        """Return what became of the offsets."""
        return self._requests.report
