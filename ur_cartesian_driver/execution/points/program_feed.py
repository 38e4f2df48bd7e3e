# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The feed override of a spline that the robot program runs."""

from __future__ import annotations

from math import nan

from ur_cartesian_driver.execution.goal.feed_state import FeedState
from ur_cartesian_driver.execution.goal.feeder import Prepared
from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand, SetFeedTarget
from ur_cartesian_driver.execution.offsets.feed_input import FeedInput
from ur_cartesian_driver.execution.offsets.feed_requests import FeedRequests
from ur_cartesian_driver.motion.goal.goal import FeedOverride
from ur_cartesian_driver.motion.state.rtde_state import RobotState

#: Smaller changes are sent only if they reach an end of the range; otherwise the noise of an
#: analog input would cost a message per packet, and CANCEL would wait behind them.
MIN_CHANGE = 0.005


class ProgramFeed(FeedRequests, Prepared):
    """
    Sends the robot program its target feed; the program approaches it cycle by cycle.

    So neither the network nor this computer can make the feed jump, and the feed that the program
    reports is the real one.
    """

    def __init__(self, bounds: FeedOverride, feed_input: FeedInput | None = None) -> None:
        """Begin with nothing sent; parameters as in :class:`FeedRequests`."""
        super().__init__(bounds, feed_input)
        self._sent = nan
        #: The delay that the program reported before the goal began; None = not known yet.
        self._first_delay: float | None = None

    def prepare(self) -> list[GoalCommand]:
        """Return the command with the feed at the start."""
        return self._send()

    def age(self, now: float) -> list[GoalCommand]:
        """Return the due warning, and the command with a new feed."""
        return super().age(now) + self._send()

    def _send(self) -> list[GoalCommand]:
        change = abs(self.target - self._sent)  # NaN at first
        is_at_end = self.target in (self.bounds.minimum, self.bounds.maximum)
        if change == 0.0 or (change < MIN_CHANGE and not is_at_end):
            return []
        self._sent = self.target
        return [SetFeedTarget(fraction=self._sent, rate=self.bounds.rate)]

    def observe_feed(self, packet: RobotState, now: float) -> FeedState:
        """Read the input, if it gives the signal, and return the feed that the program reports."""
        self.read_input(packet, now)
        if self._first_delay is None:
            self._first_delay = packet.feed_delay
        # Until the program has read START, it reports the feed of an earlier goal, which may be
        # below the minimum of this one.
        value = max(self.bounds.minimum, packet.feed_override)
        return self.noted(value, packet.feed_delay - self._first_delay)
