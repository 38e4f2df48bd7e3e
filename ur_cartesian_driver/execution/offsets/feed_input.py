# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""An analog input of the robot as the signal of feed overrides (``feed_override_input``)."""

from __future__ import annotations

from math import isfinite, nan
from typing import NamedTuple

from ur_cartesian_driver.motion.state.rtde_state import RobotState

#: A level is valid up to this fraction of its range beyond either end: the noise of a sensor at
#: an end is no fault, but a broken wire is (0 mA of 4 to 20 mA).
MARGIN = 0.03


class FeedInput(NamedTuple):
    """A standard analog input whose level gives the feed."""

    pin: int
    #: The levels that mean 0 and 1 of the planned speed [A] or [V]; either may be the larger one.
    zero: float
    full: float

    def fraction(self, packet: RobotState) -> float:
        """Return the feed that the level means, 0 to 1; NaN = the level is invalid."""
        levels = packet.standard_analog_input0, packet.standard_analog_input1
        fraction = (levels[self.pin] - self.zero) / (self.full - self.zero)
        return min(max(fraction, 0.0), 1.0) if -MARGIN <= fraction <= 1.0 + MARGIN else nan


def parse_feed_input(text: str) -> FeedInput | None:
    """
    Return the input that the parameter ``feed_override_input`` names; None = none.

    :raises ValueError: the text names no input, or two equal levels.
    """
    if not text:
        return None
    try:
        kind, pin, zero, full = text.split()
        found = FeedInput(int(pin), float(zero), float(full))
    except ValueError:
        kind, found = '', FeedInput(0, nan, nan)
    is_level = isfinite(found.zero) and isfinite(found.full) and found.zero != found.full
    if kind != 'standard_analog' or found.pin not in (0, 1) or not is_level:
        raise ValueError(
            f"feed_override_input is '{text}'; write 'standard_analog', the pin 0 or 1, and two "
            "different levels [A] or [V] that mean 0 and 1, as in 'standard_analog 0 2.0 8.0'."
        )
    return found
