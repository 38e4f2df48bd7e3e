# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Stretches of a plan on which the tool is slower than the goal asks, and the remedies.

A goal asks for a speed by ``velocity`` of its segments or twists of its points; if it gives none,
the driver's default speed is asked for. A goal with times asks for the mean speed of each segment:
its length over its time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

#: A tool that is slower by less than this fraction is not slow.
SLOWER_BY = 0.02
_MAX_LISTED = 5


class SlowCause(Enum):
    """The cause of a tool slower than asked; the value of each is the advice to the user."""

    #: Beginning and end of the motion, and of its parts between joint motions.
    RAMP = 'begin the path before the seam and end it behind, so that the tool has its speed there'
    STOP = 'let the tool pass: blend_radius (with PROCESS at steady speed), or a SPLINE'
    REVERSAL = 'turn round beside the seam: leave it and come back, on an arc for example'
    BLEND = 'enlarge blend_radius, raise the acceleration, or use PROCESS'
    CORNER = 'allow a larger corner_deviation, or raise the acceleration or max_linear_jerk'
    IN_BLEND = 'enlarge blend_radius, or use a SPLINE, whose speed is known'
    SHORT = 'raise the acceleration, lengthen the segments, or put a SPLINE through the points'
    JOINT_LIMIT = (
        'take another posture, a free_axis, a path away from singularities, or less speed'
    )
    TOOL_LIMIT = 'raise max_tool_speed, or ask for less speed'
    ACCELERATION_LIMIT = (
        'raise that limit of the acceleration, widen the curve, or ask for less speed'
    )
    TURN = 'turn the tool less, or over more of the path, or leave its axis free (free_axis)'
    TIMES = 'space points and times evenly, with twists of .nan (chosen by the driver)'


class SpeedLimit(NamedTuple):
    """A limit that slows the tool."""

    cause: SlowCause
    #: Name and value of the limit, and the place where it holds.
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class SlowStretch:
    """A stretch of the path on which the tool is slower than asked."""

    #: Index of the point at the end of the segment in which the stretch begins.
    first: int
    #: Fraction of that segment before the stretch: of its length; for a SPLINE, of its time.
    first_fraction: float
    #: Index of the point at the end of the segment in which the stretch ends.
    last: int
    #: Fraction of that segment before the end of the stretch.
    last_fraction: float
    #: Speed of the tool that is asked for [m/s].
    asked: float
    #: Speed of the tool that is planned at the slowest place [m/s].
    lowest: float
    cause: SlowCause
    #: The explanation, as a clause.
    reason: str
    #: Index of the point that the advice names.
    point: int

    @property
    def counts(self) -> bool:
        """Whether ``min_speed_fraction`` applies; not to ramps and blends of unknown speed."""
        return self.cause not in (SlowCause.RAMP, SlowCause.IN_BLEND)

    @property
    def place(self) -> str:
        """The place of the stretch on the path, as part of a sentence."""
        begin, end = (f'{100.0 * u:.1f} %' for u in (self.first_fraction, self.last_fraction))
        if self.first == self.last:
            return f'point {self.first}, {begin} to {end} of its segment'
        return f'point {self.first} at {begin} to point {self.last} at {end}'

    @property
    def line(self) -> str:
        """The line of the stretch in the report."""
        return (
            f'{self.place}: slower than asked, down to {self.lowest:.3g} of {self.asked:.3g} m/s, '
            f'because {self.reason}'
        )


def speed_advice(stretches: Sequence[SlowStretch]) -> list[str]:
    """Return the advice against slow stretches, a line for each cause."""
    lines = []
    for cause in SlowCause:
        points = list(dict.fromkeys(each.point for each in stretches if each.cause is cause))
        if points:
            lines.append(f'speed at {name_points(points)}: {cause.value}')
    return lines


def name_points(points: Sequence[int]) -> str:
    """Return a text that lists the first few points and counts the others."""
    more = f' and {len(points) - _MAX_LISTED} more' if len(points) > _MAX_LISTED else ''
    listed = ', '.join(str(i) for i in points[:_MAX_LISTED])
    return f'{"point" if len(points) == 1 else "points"} {listed}{more}'
