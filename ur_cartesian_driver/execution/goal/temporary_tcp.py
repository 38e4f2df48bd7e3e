# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The TCP set for a goal that moves another frame, until the original TCP is restored.

Only the reported TCP counts, never the one on its way to the robot: a paused program
reads nothing, an ended program may have restored the TCP by itself, and somebody else may have set
another TCP, which must not be overwritten.
"""

from __future__ import annotations

from math import inf

from ur_cartesian_driver.execution.goal.goal_transitions import is_at_rest
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.state.rtde_state import RobotState

#: The largest distance [m] and angle [rad] of a reported TCP from the sent one: values
#: on the wire have a resolution of 1e-6.
TCP_RESOLUTION = 2e-6
#: Longest time until the robot reports a TCP that a command has set [s]; after that the command
#: is considered lost.
SET_TIMEOUT = 0.5
#: Shortest and longest pause before the next try to restore the TCP [s].
MIN_RETRY_PERIOD, MAX_RETRY_PERIOD = 0.2, 10.0


def same_tcp(a: Pose, b: Pose) -> bool:
    """Return whether two TCPs are the same within the resolution of the wire."""
    return a.distance_to(b) <= TCP_RESOLUTION and a.angle_to(b) <= TCP_RESOLUTION


class TemporaryTcp:
    """Tracks a TCP set for a goal, until the original one is restored."""

    def __init__(self, T_flange_original: Pose, T_flange_temporary: Pose) -> None:
        """
        Begin; the command that sets the TCP is on its way.

        :param T_flange_original: the TCP to restore.
        """
        self.T_flange_original = T_flange_original
        self.T_flange_temporary = T_flange_temporary
        #: Whether the robot no longer has the temporary TCP, or never had it.
        self.is_restored = False
        #: Whether the robot has reported the temporary TCP.
        self._was_reported = False
        self._first_observed = inf
        self._retry_period, self._next_retry = MIN_RETRY_PERIOD, -inf

    def observe(self, state: RobotState, now: float) -> None:
        """
        Process a packet of the robot.

        :param now: time of a steady clock [s].
        """
        self._first_observed = min(self._first_observed, now)
        if self.is_active(state):
            self._was_reported, self.is_restored = True, False
        elif self._was_reported or now - self._first_observed >= SET_TIMEOUT:
            self.is_restored = True

    def is_active(self, state: RobotState) -> bool:
        """Return whether the robot has the temporary TCP."""
        return same_tcp(state.T_flange_tcp, self.T_flange_temporary)

    def is_restore_due(self, state: RobotState, now: float) -> bool:
        """
        Return whether to restore the TCP now: at rest only, with ever longer pauses between tries.

        :returns: True once for each try.
        """
        if (
            self.is_restored
            or not self.is_active(state)
            or now < self._next_retry
            or not is_at_rest(state)
        ):
            return False
        self._next_retry = now + self._retry_period
        self._retry_period = min(2.0 * self._retry_period, MAX_RETRY_PERIOD)
        return True

    def retry_now(self) -> None:
        """Allow the next try at once, because the robot has changed and may now accept the TCP."""
        self._retry_period, self._next_retry = MIN_RETRY_PERIOD, -inf

    def report(self, packet: RobotState | None) -> str:
        """Return the line about the TCP in the report of the goal."""
        if not self.is_restored:
            return (
                'the TCP of the robot was set for the goal, and is not back yet: no goal is taken '
                'until it is'
            )
        if packet is not None and same_tcp(packet.T_flange_tcp, self.T_flange_original):
            return 'the TCP of the robot was set for the goal, and is what it was before'
        return (
            'the TCP of the robot is neither the one of the goal nor the one before it: somebody '
            'else has set it, and it is left alone'
        )
