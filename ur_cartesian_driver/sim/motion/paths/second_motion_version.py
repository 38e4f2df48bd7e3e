# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Motion version 2 of movej and movel: clamped speeds, reduced blends, other ramps."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from math import sqrt

from ur_cartesian_driver.sim.motion.paths.path_motion import ProfileParameters


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondMotionVersion:
    """
    The known differences of motion version 2 (PolyScope 5.22) from version 1.

    The script manual says that speeds and accelerations are clamped to the limits of the hardware
    while moves are planned, that blend radii are reduced so that blends neither overlap nor skip a
    waypoint, that ramps differ, and that blends run on slightly other paths. It gives no figures,
    so the values of the fields are assumed.

    :raises ValueError: a field is outside its range; the text names the field.
    """

    #: Time for which the acceleration rises at the beginning of a ramp, and falls at its end [s].
    #: Each ramp takes longer by this time. 0 to 0.5; 0 = ramps as in version 1.
    ramp_rise: float = 0.02
    #: Factor on the blend radius of a call; 0.1 to 1, and 1 = blends as in version 1.
    blend_fraction: float = 0.9
    #: Fraction of the distance between two waypoints that the blends at both may take together;
    #: 0.1 to 0.99, because the last move needs some distance in which to brake.
    blend_share: float = 0.99

    def __post_init__(self) -> None:
        """Refuse values out of range."""
        ranges = {'ramp_rise': (0.0, 0.5), 'blend_fraction': (0.1, 1.0)}
        for field in fields(self):
            low, high = ranges.get(field.name, (0.1, 0.99))
            if not low <= getattr(self, field.name) <= high:
                raise ValueError(
                    f'{field.name} is {getattr(self, field.name)}; use {low:g} to {high:g}.'
                )

    def parameters(
        self, asked: ProfileParameters, length: float, most: ProfileParameters
    ) -> ProfileParameters:
        """
        Return the parameters of a move, clamped to the limits of the arm.

        A move with a time takes longer if the limits require it; each of its ramps keeps its
        fraction x of the time T. The move reaches v = d / (T (1 - x)) at a = v / (x T).

        :param length: length d of the path, in its unit.
        :param most: the highest acceleration and speed on the path.
        """
        if asked.time > 0.0:
            part = asked.ramp_part(length)
            least = max(
                length / ((1.0 - part) * most.speed),
                sqrt(length / (part * (1.0 - part) * most.acceleration)),
            )
            return replace(asked, time=max(asked.time, least))
        acceleration = min(asked.acceleration, most.acceleration)
        return ProfileParameters(
            acceleration=acceleration,
            speed=min(asked.speed, most.speed),
            jerk=acceleration / self.ramp_rise if self.ramp_rise > 0.0 else None,
        )

    def reduced_radii(self, before: float, after: float, distance: float) -> tuple[float, float]:
        """
        Return the blend radii at both ends of a move [m], scaled down if their sum is too large.

        :param before: radius at the waypoint where the move begins [m].
        :param after: radius at the waypoint where the move ends [m].
        :param distance: distance between the two waypoints [m].
        """
        most, both = self.blend_share * distance, before + after
        if both <= most:
            return before, after
        return before * most / both, after * most / both
