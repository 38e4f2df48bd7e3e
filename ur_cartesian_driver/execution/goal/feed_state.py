# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The feed of a motion: a client's signal may slow it (``feed_override``)."""

from __future__ import annotations

from typing import NamedTuple


class FeedState(NamedTuple):
    """What a feed override makes of a motion."""

    #: The fraction of the planned speed, 0 to 1.
    value: float = 1.0
    #: By how much the motion is later because of it, in scaled time [s].
    delay: float = 0.0
    #: Whether a valid signal determines the fraction.
    is_valid: bool = True


#: The feed of a motion without override.
FULL_FEED = FeedState()
