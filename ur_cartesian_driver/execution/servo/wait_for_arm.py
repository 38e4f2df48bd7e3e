# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The wait of a motion for an arm that is off its path (``on_path_tolerance: STALL``)."""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.outcome_codes import Fault, GoalSignal
from ur_cartesian_driver.motion.state.robot_state import RobotState, RuntimeState


class WaitForArm:
    """
    The waiting of a motion for an arm that is off its path.

    The time of the robot counts, while its program plays: in a pause the arm cannot come back.

    :param timeout: how long the arm may be off its path at a time [s]; 0 = nothing waits for it.
    """

    def __init__(self, timeout: float) -> None:
        """Begin on the path."""
        self.timeout = timeout
        #: What is wrong, as a clause; empty = nothing. Whether that has just begun.
        self.clause, self.begins = '', False
        #: By how much the motion was delayed, as far as it has been counted [s].
        self.held_time = 0.0
        self._since = self._timestamp = 0.0
        self._count, self._longest = 0, 0.0

    def update(self, fault: Fault | None, packet: RobotState) -> bool:
        """Take a packet, and return whether the arm is off its path."""
        clause = fault[1] if fault and fault[0] is GoalSignal.VIOLATION else ''
        is_off = bool(clause)
        self.begins = is_off and not self.clause
        if self.begins:
            self._count, self._since = self._count + 1, packet.timestamp
        elif packet.runtime_state is not RuntimeState.PLAYING:
            self._since += packet.timestamp - self._timestamp
        self._timestamp = packet.timestamp
        self.clause = clause
        if is_off:
            self._longest = max(self._longest, packet.timestamp - self._since)
        return is_off

    @property
    def is_over(self) -> bool:
        """Whether the arm is off its path for too long."""
        return bool(self.clause) and self._timestamp - self._since > self.timeout

    @property
    def report(self) -> tuple[str, ...]:
        """What became of it."""
        if not self._count:
            return ()
        times = 'once' if self._count == 1 else f'{self._count} times'
        return (
            f'the motion waited {times} for an arm that was off its path, for '
            f'{self._longest:.2f} s at most; the goal took {self.held_time:.2f} s more',
        )
