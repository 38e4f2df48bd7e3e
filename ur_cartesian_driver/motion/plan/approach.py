# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The speed of a motion that is computed cycle by cycle and arrives at its target at rest."""

from __future__ import annotations

from math import sqrt

#: Fraction of the acceleration that planned braking uses; the remainder is for corrections.
BRAKING_FRACTION = 0.8
#: A target within this distance is reached [m, rad].
ARRIVAL_TOLERANCE = 1e-9


def approach_speed(distance: float, limit: float, acceleration: float, dt: float) -> float:
    """
    Return the speed of the next cycle for a motion that ends at rest.

    With the deceleration b, one cycle of length dt at the speed v, followed by cycles that are
    each slower by b dt, covers the distance d if v = sqrt((b dt / 2)^2 + 2 b d) - b dt / 2. After
    each such cycle the formula gives exactly b dt less. The speed of the last cycle is d / dt.

    :param distance: distance to the target, not negative [m, rad].
    :param limit: the largest speed.
    """
    if distance < ARRIVAL_TOLERANCE:
        return 0.0
    half = 0.5 * BRAKING_FRACTION * acceleration * dt
    return min(
        limit,
        sqrt(half * half + 2.0 * BRAKING_FRACTION * acceleration * distance) - half,
        distance / dt,
    )
