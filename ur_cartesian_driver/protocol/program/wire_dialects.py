# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What robot programs of different ages understand: one row for each wire dialect.

A program that was saved on a pendant keeps the messages of the library version it came with, and
nothing on the sockets tells which one that is. So the dialect is a setting. A message has the same
number of words and the same size in all dialects. Everything that differs is defined here;
:mod:`trajectory_points` and :mod:`reverse` ask the :class:`Dialect`:

=======  =============  ==========  ===================  =====================  =======
dialect  library        time scale  motion types         words 6 - 17 of moves  streams
=======  =============  ==========  ===================  =====================  =======
2.0      2.0 - 2.9      1000        0 - 3, 51            v x 6, a x 6           no
2.10     2.10, 2.11     1,000,000   0 - 5, 51            v x 6, a x 6           no
2.12     2.12, 2.13     1,000,000   0 - 13, 51           q_near, v, a, flag     no
2.14     since 2.14     1,000,000   0 - 13, 51, from 200 q_near, v, a, flag     yes
=======  =============  ==========  ===================  =====================  =======

Types from 200 on switch outputs and do what is done while the arm stands. Only our own robot
program knows them; the library's programs skip them silently.

"Moves" are all types except MOVEC* and SPLINE, whose words never changed. But programs before
2.12 take the velocity of an arc for its acceleration and the reverse, though the library of their
time wrote them in the order of today; so the driver sends them as these programs read them. Blend
radii have the time scale, too. With a scale of 1000, times are whole milliseconds and radii whole
millimetres. (The library of that time truncated times; we round them, which no program can
notice.)

Types 4 and 5 came with 2.2, so 2.0 omits them: a program silently skips a type that it does not
know. On the reverse socket only the stream actions differ. It is not recorded which library
version introduced which script command, and a program skips unknown commands, too. So only the
newest dialect sets a temporary TCP for a goal.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import floor
from types import MappingProxyType
from typing import TypeVar

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.motion.geometry.vectors import ZERO6
from ur_cartesian_driver.protocol.framing import FIXED_POINT, INT32_MAX

_V = TypeVar('_V', float, str)

_LINES_AND_ARCS = frozenset(range(4))
_OPTIMOVES = frozenset((4, 5))
_OTHER_TARGETS = frozenset(range(6, 14))
_SPLINE = frozenset((51,))
_OUTPUTS = frozenset((200,))
_STOPS = frozenset(range(201, 208))

#: Names of words 6 to 17 of a move in errors, with and without q_near.
_NAMES_WITH_Q_NEAR = (
    *(f'words 6-11[{i}]' for i in range(6)),
    'velocity',
    'acceleration',
    'mode',
    *(f'words 15-17[{i}]' for i in range(3)),
)
_NAMES_WITHOUT_Q_NEAR = (*['velocity'] * 6, *['acceleration'] * 6)


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """One row of the table."""

    name: str
    #: Factor of times [s] and blend radii [m].
    time_scale: int
    #: Motion types that a program of this dialect runs; it silently skips all others.
    motion_types: frozenset[int]
    #: Words 6 - 14 of a move are q_near, velocity, acceleration and flag.
    supports_q_near: bool = False
    #: A trajectory may have an open end (STREAM_START, STREAM_END).
    supports_append: bool = False
    #: The program is this driver's own: it has outputs and stops, the buffered servo, freedrive,
    #: offsets and a temporary TCP, and reports the number of points begun.
    is_own: bool = False
    #: Longest duration that fits [s].
    max_duration: float = field(init=False)
    #: Shortest duration that is not rounded to 0, which has another meaning [s].
    min_duration: float = field(init=False)
    #: Words that hold the velocity and the acceleration of a move.
    speed_words: tuple[int, int] = field(init=False)
    #: The same of an arc, as the program reads them.
    arc_speed_words: tuple[int, int] = field(init=False)
    #: Names of words 6 to 17 of a move, for errors.
    move_word_names: tuple[str, ...] = field(init=False)

    def __post_init__(self) -> None:
        """Derive what is looked up for every point."""
        with_q_near = self.supports_q_near
        for name, value in (
            ('max_duration', INT32_MAX / self.time_scale),
            ('min_duration', 0.5 / self.time_scale),
            ('speed_words', (12, 13) if with_q_near else (6, 12)),
            ('arc_speed_words', (12, 13) if with_q_near else (13, 12)),
            ('move_word_names', _NAMES_WITH_Q_NEAR if with_q_near else _NAMES_WITHOUT_Q_NEAR),
        ):
            object.__setattr__(self, name, value)

    @property
    def is_coarse(self) -> bool:
        """Whether rounding of times and radii matters."""
        return self.time_scale < FIXED_POINT

    def round_down_radius(self, radius: float) -> float:
        """Return the largest radius that the wire can express and that is not larger [m]."""
        if not self.is_coarse:
            return radius
        # 0.029 * 1000 is a little less than 29.
        return floor(radius * self.time_scale + 1e-6) / self.time_scale

    def encode_move(
        self, q_near: Sequence[float] | None, velocity: float, acceleration: float
    ) -> tuple[float, ...]:
        """
        Return words 6 to 17 of a move, unscaled.

        :raises LocalProtocolError: the dialect has no q_near.
        """
        if self.supports_q_near:
            flag = q_near is not None
            return (*(q_near or ZERO6), velocity, acceleration, flag, 0, 0, 0)
        if q_near is not None:
            raise self.unsupported('q_near')
        v, a = velocity, acceleration
        return (v, v, v, v, v, v, a, a, a, a, a, a)

    def arc_speeds(self, velocity: _V, acceleration: _V) -> tuple[_V, _V]:
        """Return words 12 and 13 of an arc, unscaled, or their names."""
        first = self.arc_speed_words[0] == 12
        return (velocity, acceleration) if first else (acceleration, velocity)

    def has_q_near(self, fields: Sequence[float]) -> bool:
        """Tell whether the 21 numbers of a move contain q_near, in words 6 to 11."""
        return self.supports_q_near and bool(fields[14])

    def unsupported(self, what: str) -> LocalProtocolError:
        """Return the error for something that this dialect does not have."""
        return LocalProtocolError(f'{what} does not exist in wire dialect {self.name}.')


#: By name, oldest first.
DIALECTS: Mapping[str, Dialect] = MappingProxyType(
    {
        dialect.name: dialect
        for dialect in (
            Dialect(name='2.0', time_scale=1000, motion_types=_LINES_AND_ARCS | _SPLINE),
            Dialect(
                name='2.10',
                time_scale=FIXED_POINT,
                motion_types=_LINES_AND_ARCS | _OPTIMOVES | _SPLINE,
            ),
            Dialect(
                name='2.12',
                time_scale=FIXED_POINT,
                motion_types=_LINES_AND_ARCS | _OPTIMOVES | _OTHER_TARGETS | _SPLINE,
                supports_q_near=True,
            ),
            Dialect(
                name='2.14',
                time_scale=FIXED_POINT,
                motion_types=_LINES_AND_ARCS
                | _OPTIMOVES
                | _OTHER_TARGETS
                | _SPLINE
                | _OUTPUTS
                | _STOPS,
                supports_q_near=True,
                supports_append=True,
                is_own=True,
            ),
        )
    }
)
#: The dialect of this package's robot program.
NEWEST_DIALECT = DIALECTS['2.14']
