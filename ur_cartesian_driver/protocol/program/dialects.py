# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What robot programs of different ages understand: one row for each wire dialect.

A program that was saved on a pendant keeps the messages of the library version it came with, and
nothing on the sockets tells which one that is. So the dialect is a setting. The messages have
their 21 words and their sizes in all of them; what differs stands in :data:`DIALECTS`:

=======  =============  ==========  ================  =====================  =======
dialect  library        time scale  motion types      words 6 - 17 of moves  streams
=======  =============  ==========  ================  =====================  =======
2.0      2.0 - 2.9      1000        0 - 3, 51         v x 6, a x 6           no
2.10     2.10, 2.11     1,000,000   0 - 5, 51         v x 6, a x 6           no
2.12     2.12, 2.13     1,000,000   0 - 13, 51        q_near, v, a, flag     no
2.14     since 2.14     1,000,000   0 - 13, 51, 200   q_near, v, a, flag     yes
=======  =============  ==========  ================  =====================  =======

Type 200, which switches an output, is ours alone: a program of the library skips it in silence.

"Moves" are all types but MOVEC* and SPLINE, whose words never changed. Blend radii have the time
scale too. With a scale of 1000 times are whole milliseconds and radii whole millimetres (the
library of that time cut times off; here they are rounded, which no program can tell).

Types 4 and 5 came with 2.2, so 2.0 leaves them out: a program that does not know a type skips it
in silence. On the reverse socket only the stream actions differ. When each script command came is
not recorded, and a program skips those that it does not know as well; so a TCP is set for a goal
in the newest dialect only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import floor
from types import MappingProxyType

from ur_cartesian_driver.protocol.framing import FIXED_POINT, INT32_MAX

_ARCS_AND_LINES = frozenset(range(4))
_OPTIMOVES = frozenset((4, 5))
_OTHER_TARGETS = frozenset(range(6, 14))
_SPLINE = frozenset((51,))
_OUTPUTS = frozenset((200,))


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """One row of the table."""

    name: str
    #: What times [s] and blend radii [m] are multiplied by.
    time_scale: int
    #: Motion types that a program of this dialect runs; it skips others in silence.
    motion_types: frozenset[int]
    #: Whether words 6 - 14 of a move are q_near, velocity, acceleration and flag.
    q_near: bool
    #: Whether trajectories may have an open end (STREAM_START, STREAM_END).
    supports_append: bool
    #: Whether it is sure that the program sets a TCP when it is told to.
    supports_tcp_change: bool
    #: The longest duration that fits [s].
    max_duration: float = field(init=False)
    #: The shortest one that is not rounded to 0, which would mean another thing [s].
    min_duration: float = field(init=False)

    def __post_init__(self) -> None:
        """Derive what is looked up for every point."""
        object.__setattr__(self, 'max_duration', INT32_MAX / self.time_scale)
        object.__setattr__(self, 'min_duration', 0.5 / self.time_scale)

    @property
    def is_coarse(self) -> bool:
        """Tell whether times and radii are rounded to an extent that matters."""
        return self.time_scale < FIXED_POINT

    def round_down_radius(self, radius: float) -> float:
        """Return the largest radius that the wire carries and that is not larger [m]."""
        if not self.is_coarse:
            return radius
        # 0.029 * 1000 is a little less than 29.
        return floor(radius * self.time_scale + 1e-6) / self.time_scale


#: By name, the oldest first.
DIALECTS: Mapping[str, Dialect] = MappingProxyType(
    {
        dialect.name: dialect
        for dialect in (
            Dialect(
                name='2.0',
                time_scale=1000,
                motion_types=_ARCS_AND_LINES | _SPLINE,
                q_near=False,
                supports_append=False,
                supports_tcp_change=False,
            ),
            Dialect(
                name='2.10',
                time_scale=FIXED_POINT,
                motion_types=_ARCS_AND_LINES | _OPTIMOVES | _SPLINE,
                q_near=False,
                supports_append=False,
                supports_tcp_change=False,
            ),
            Dialect(
                name='2.12',
                time_scale=FIXED_POINT,
                motion_types=_ARCS_AND_LINES | _OPTIMOVES | _OTHER_TARGETS | _SPLINE,
                q_near=True,
                supports_append=False,
                supports_tcp_change=False,
            ),
            Dialect(
                name='2.14',
                time_scale=FIXED_POINT,
                motion_types=_ARCS_AND_LINES | _OPTIMOVES | _OTHER_TARGETS | _SPLINE | _OUTPUTS,
                q_near=True,
                supports_append=True,
                supports_tcp_change=True,
            ),
        )
    }
)
#: The one that the robot program of this package speaks.
NEWEST_DIALECT = DIALECTS['2.14']
