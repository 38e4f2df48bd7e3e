# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The feed override of streamed set-points."""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.feed_state import FeedState
from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand
from ur_cartesian_driver.execution.offsets.feed_input import FeedInput
from ur_cartesian_driver.execution.offsets.feed_requests import FeedRequests
from ur_cartesian_driver.execution.servo.servo_stream import ServoStream
from ur_cartesian_driver.motion.goal.goal import FeedOverride
from ur_cartesian_driver.motion.state.rtde_state import RobotState


class SetpointFeed(FeedRequests):
    """Changes the feed of a stream."""

    def __init__(
        self, bounds: FeedOverride, stream: ServoStream, feed_input: FeedInput | None = None
    ) -> None:
        """
        Begin at the lower bound.

        :param stream: the stream of set-points; the other parameters as in :class:`FeedRequests`.
        """
        super().__init__(bounds, feed_input)
        self._stream = stream
        stream.feed = stream.feed_target = self.target
        stream.feed_rate = bounds.rate

    def age(self, now: float) -> list[GoalCommand]:
        """Return the due warning; the stream approaches the newest feed from now on."""
        warnings = super().age(now)
        self._stream.feed_target = self.target
        return warnings

    def observe_feed(self, packet: RobotState, now: float) -> FeedState:
        """Read the input, if it gives the signal, and return the feed of the newest set-point."""
        self.read_input(packet, now)
        return self.noted(self._stream.feed, self._stream.feed_delay)
