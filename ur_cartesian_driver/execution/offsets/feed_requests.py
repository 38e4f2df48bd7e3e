# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The signal that overrides the feed of a goal: the newest value, its age, and a report.

The signal may come at any time, jump, stop or be nonsense. A valid value, 0 to 1, is cut to the
bounds of the goal. Without a valid value the lower bound applies, because a higher feed might harm
the process. The driver or the robot program, whichever times the motion, changes the feed at the
goal's rate.
"""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.feed_state import FeedState
from ur_cartesian_driver.execution.goal.feeder import (
    Ageing,
    counted,
    how_often,
    Overridable,
    Reporting,
)
from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand
from ur_cartesian_driver.execution.offsets.feed_input import FeedInput
from ur_cartesian_driver.execution.offsets.freshness import Freshness, RareWarnings
from ur_cartesian_driver.motion.goal.goal import FeedOverride
from ur_cartesian_driver.motion.state.rtde_state import RobotState


class FeedRequests(Overridable, Ageing, Reporting):
    """Accepts the values of the signal, and derives the feed that the motion should have."""

    def __init__(self, bounds: FeedOverride, feed_input: FeedInput | None = None) -> None:
        """
        Begin with no value, at the lower bound.

        :param bounds: the bounds of the goal, with all defaults filled in.
        :param feed_input: the input that gives the values; None = clients give them.
        """
        self.bounds, self._input = bounds, feed_input
        self._freshness, self._warnings = Freshness(bounds.timeout), RareWarnings()
        self._newest = bounds.minimum
        #: Whether no value has come yet: an invalid first value is warned of, but loses no signal.
        self._is_silent = True
        self._is_valid = False
        self._invalid = self._lost = 0
        self._lowest, self._delay = bounds.maximum, 0.0

    def set_feed(self, fraction: float, age: float, now: float) -> None:
        """Accept a value of the signal; an invalid one also voids the valid one before it."""
        if not 0.0 <= fraction <= 1.0:  # also refuses NaN
            self._invalid += 1
            self._lose()
        elif self._freshness.accept(age, now):
            self._newest = min(max(fraction, self.bounds.minimum), self.bounds.maximum)
            self._is_valid, self._is_silent = True, False
            self._warnings.forget()

    def read_input(self, packet: RobotState, now: float) -> None:
        """Accept the value of the input, if an input gives the values."""
        if self._input is not None:
            self.set_feed(self._input.fraction(packet), packet.state_age, now)

    def age(self, now: float) -> list[GoalCommand]:
        """Check the age of the newest value; warn, not too often, that the signal is lost."""
        if self._is_valid and self._freshness.is_stale(now):
            self._lose()
        return self._warnings.due(now)

    def _lose(self) -> None:
        self._lost += self._is_valid
        if self._is_valid or self._is_silent:
            self._warnings.ask(
                'the signal of feed_override is invalid or older than '
                f'{self.bounds.timeout:g} s: the motion slows down to {self.bounds.minimum:.0%}'
            )
        self._is_valid = self._is_silent = False

    @property
    def target(self) -> float:
        """The feed that the motion should have: within the bounds of the goal."""
        return self._newest if self._is_valid else self.bounds.minimum

    def noted(self, value: float, delay: float) -> FeedState:
        """
        Return the present feed, and note it for the report.

        :param value: the feed that the motion has, 0 to 1.
        :param delay: delay of the motion by its feed [s].
        """
        self._lowest, self._delay = min(self._lowest, value), delay
        return FeedState(value, delay, self._is_valid)

    @property
    def report(self) -> tuple[str, ...]:
        """The lines about followed and ignored values, and about the delay."""
        taken, dropped = self._freshness.accepted, self._freshness.dropped
        lines = [
            f'feed_override: {counted(taken, "value")} followed; the feed went down to '
            f'{self._lowest:.0%}, and the goal took {self._delay:.2f} s more'
        ]
        if self._invalid:
            lines.append(f'feed_override: {counted(self._invalid, "value")} not within 0 to 1')
        if dropped:
            lines.append(
                f'feed_override: {counted(dropped, "value")} ignored: older than a newer one or '
                f'than {self.bounds.timeout:g} s'
            )
        if self._lost:
            lines.append(
                f'feed_override: the signal was lost {how_often(self._lost)}: invalid, or older '
                f'than {self.bounds.timeout:g} s'
            )
        return tuple(lines)
