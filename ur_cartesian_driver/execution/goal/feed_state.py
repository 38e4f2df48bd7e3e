# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The feed of a motion: a client's signal may slow it (``feed_override``)."""

from __future__ import annotations

from typing import NamedTuple


class FeedState(NamedTuple):
    """The effect of a feed override on a motion."""

    #: The fraction of the planned speed, 0 to 1.
    value: float = 1.0
    #: The delay of the motion by the override, in scaled time [s].
    delay: float = 0.0
    #: Whether a valid signal determines the fraction.
    is_valid: bool = True


#: The feed of a motion without override.
FULL_FEED = FeedState()
