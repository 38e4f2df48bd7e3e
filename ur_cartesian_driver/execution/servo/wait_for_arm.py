# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Stalls a motion while the arm is off its path (``on_path_tolerance: STALL``)."""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.feeder import Ageing, how_often, Reporting, Stallable
from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand, LogWarning
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.outcome_codes import Fault, GoalSignal
from ur_cartesian_driver.execution.servo.servo_stream import ServoStream
from ur_cartesian_driver.motion.state.rtde_state import RobotState, RuntimeState


class WaitForArm(Stallable, Ageing, Reporting):
    """
    Stalls the motion while the arm is off its path, for a limited time.

    Only time in which the robot's program plays is measured: in a pause the arm cannot come back.
    """

    def __init__(self, monitor: GoalMonitor, stream: ServoStream) -> None:
        """Begin on the path."""
        self._monitor, self._stream = monitor, stream
        self._timeout = monitor.job.stall_timeout
        self._since = self._timestamp = 0.0
        self._count, self._longest = 0, 0.0
        #: The delay by stalls that is already part of the monitor's ``allowed_delay`` [s].
        self._stalled_time = 0.0
        self._unsaid: list[GoalCommand] = []

    def wait_out(self, fault: Fault | None, packet: RobotState) -> Fault | None:
        """Stall the motion and hide the fault during a violation, up to the stall timeout."""
        stream = self._stream
        was_stalled = stream.is_stalled
        stream.is_stalled = fault is not None and fault[0] is GoalSignal.VIOLATION
        if not was_stalled:
            self._since = packet.timestamp
        elif packet.runtime_state is not RuntimeState.PLAYING:
            self._since += packet.timestamp - self._timestamp
        self._timestamp = packet.timestamp
        # The time of the goal stands still while the motion is stalled.
        self._monitor.allowed_delay += stream.stalled_time - self._stalled_time
        self._stalled_time = stream.stalled_time
        if fault is None or not stream.is_stalled:
            return fault
        if not was_stalled:
            self._count += 1
            text = f'the motion waits for the arm: {fault[1]}'
            self._unsaid.append(LogWarning(text=text))
        waited = packet.timestamp - self._since
        self._longest = max(self._longest, waited)
        if waited > self._timeout:
            return GoalSignal.VIOLATION, f'{fault[1]} for {self._timeout:g} s'
        return None

    def age(self, now: float) -> list[GoalCommand]:
        """Return the warning that the motion waits, once for each wait."""
        warnings, self._unsaid = self._unsaid, []
        return warnings

    @property
    def report(self) -> tuple[str, ...]:
        """The line about waits: their number, the longest, and the time that they cost."""
        if not self._count:
            return ()
        return (
            f'the motion waited {how_often(self._count)} for an arm that was off its path, for '
            f'{self._longest:.2f} s at most; the goal took {self._stalled_time:.2f} s more',
        )
