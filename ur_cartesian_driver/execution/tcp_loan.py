# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The robot's TCP, lent to a goal that moves another frame, and whether it is back.

What the robot reports decides, never what was sent: a program that is paused reads nothing, one
that ended may have put the TCP back by itself, and somebody else may have set another one, which
is theirs then and not ours to overwrite.
"""

from __future__ import annotations

from math import inf

from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.state import RobotState

#: A TCP comes back from the robot as it went there within this [m], [rad]: the wire's resolution
#: on each axis.
TCP_RESOLUTION = 2e-6
#: How long the robot may take from a message that sets a TCP to reporting it [s]; after that a
#: message that nobody has carried out is taken for lost.
CARRIED_OUT = 0.5
#: Below this joint speed the arm stands, and its TCP may be changed [rad/s].
REST_SPEED = 1e-3
#: The first and the longest pause before the TCP is put back once more [s].
FIRST_PAUSE, LONGEST_PAUSE = 0.2, 10.0


def same_tcp(a: Pose, b: Pose) -> bool:
    """Tell whether two TCPs are the same within what the wire resolves."""
    return a.distance_to(b) <= TCP_RESOLUTION and a.angle_to(b) <= TCP_RESOLUTION


class TcpLoan:
    """One TCP that was set for a goal, until it is back."""

    def __init__(self, T_flange_before: Pose, T_flange_lent: Pose) -> None:
        """
        Take note of a loan; the message that sets the TCP is on its way.

        :param T_flange_before: what has to be put back.
        """
        self.T_flange_before = T_flange_before
        self.T_flange_lent = T_flange_lent
        #: Whether the robot does not have the TCP any more, or never had it.
        self.returned = False
        #: Whether the robot has reported it.
        self._seen = False
        self._since = inf
        self._pause, self._next_try = FIRST_PAUSE, -inf

    def observe(self, state: RobotState, now: float) -> None:
        """
        Take a packet of the robot.

        :param now: time of a steady clock [s].
        """
        self._since = min(self._since, now)
        if self.has_robot(state):
            self._seen, self.returned = True, False
        elif self._seen or now - self._since >= CARRIED_OUT:
            self.returned = True

    def has_robot(self, state: RobotState) -> bool:
        """Tell whether the robot's TCP is the one that was lent."""
        return same_tcp(state.T_flange_tcp, self.T_flange_lent)

    def is_due(self, state: RobotState, now: float) -> bool:
        """
        Tell whether it is time to put the TCP back, again: ever more seldom, and at rest only.

        :returns: True once for each try.
        """
        if (
            self.returned
            or not self.has_robot(state)
            or now < self._next_try
            or max(map(abs, state.actual_qd)) >= REST_SPEED
        ):
            return False
        self._next_try = now + self._pause
        self._pause = min(2.0 * self._pause, LONGEST_PAUSE)
        return True

    def hurry(self) -> None:
        """Try again at once: something has changed that may let the next try succeed."""
        self._pause, self._next_try = FIRST_PAUSE, -inf
