# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Wire dialects: the messages of robot programs of different ages, one row for each dialect.

A program saved on a pendant keeps the messages of the library version it came with, and
nothing on the sockets reveals this version. So the dialect is a setting. A message has the same
number of words and the same size in all dialects; :mod:`~.point_fields` has the layout of today's
words. All differences are defined here:

=======  =============  ==========  ===================  =====================  =======
dialect  library        time scale  motion types         words 6 - 17 of moves  streams
=======  =============  ==========  ===================  =====================  =======
2.0      2.0 - 2.9      1000        0 - 3, 51            v x 6, a x 6           no
2.10     2.10, 2.11     1,000,000   0 - 5, 51            v x 6, a x 6           no
2.12     2.12, 2.13     1,000,000   0 - 13, 51           q_near, v, a, flag     no
2.14     since 2.14     1,000,000   0 - 13, 51, from 200 q_near, v, a, flag     yes
=======  =============  ==========  ===================  =====================  =======

Types from 200 on switch outputs, or act while the arm stands still. Only our own robot program
knows them; the library's programs skip them silently.

"Moves" are the types 0 to 13 except MOVEC* (arcs); the words of arcs and SPLINE never changed.
However, programs before 2.12 swap velocity and acceleration of an arc when they read them, while
the library of their time wrote them in today's order; the driver sends the order in which these
programs read. Blend radii have the time scale, too. With a scale of 1000, times are whole
milliseconds and radii whole millimetres. (The library of that time truncated times; we round them,
which no program can notice.)

Types 4 and 5 came with 2.2, so dialect 2.0 omits them: a program silently skips a type that it
does not know. On the reverse socket only the stream actions differ. The first library version of
each script command is not recorded, and a program skips unknown commands, too. So only the newest
dialect sets a temporary TCP for a goal.

The library discusses a 22nd word, the number of a move (``move_id``, its change 552). It will be
one more row: a dialect then also has the number of its words, which :mod:`~.trajectory_points` and
the robot program (``POINT_FIELDS``) take from it. It is not built before the library has it.

Three modules use more of a program's :class:`Dialect` than ``is_own`` and ``older_program``:
:mod:`~.trajectory_points` for the points,
:mod:`~ur_cartesian_driver.robot.program.program_sockets` for the actions, and
:mod:`~ur_cartesian_driver.planning.request.program_features` for the demands of goals.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Int32s
from ur_cartesian_driver.protocol.framing import FIXED_POINT, INT32_MAX
from ur_cartesian_driver.protocol.program.point_fields import (
    ARC_TYPES,
    check_fields,
    field_names,
    MotionType,
    MOVE_TYPES,
    PointField,
    PointFields,
)
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction

_Lengths = TypeVar('_Lengths', float, Floats)

_FIRST_TYPES = frozenset((*map(MotionType, range(4)), MotionType.SPLINE))
_OPTIMOVES = frozenset((MotionType.OPTIMOVEJ, MotionType.OPTIMOVEL))
_LIBRARY_TYPES = ARC_TYPES | MOVE_TYPES | {MotionType.SPLINE}
#: The words of a move, and of an arc, for programs before 2.12, as indices in today's order.
_OLD_MOVE = (*range(6), *(PointField.VELOCITY,) * 6, *(PointField.ACCELERATION,) * 6, 18, 19, 20)
_OLD_ARC = (*range(12), PointField.ACCELERATION, PointField.VELOCITY, *range(14, 21))


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """One row of the table."""

    name: str
    #: Factor by which times [s] and blend radii [m] are multiplied.
    time_scale: int = FIXED_POINT
    #: Motion types that a program of this dialect runs; it silently skips all others.
    motion_types: frozenset[MotionType]
    #: Whether words 6 - 14 of a move are q_near, velocity, acceleration and the flag of q_near.
    supports_q_near: bool = False
    #: Whether a trajectory may have an open end (STREAM_START, STREAM_END).
    supports_append: bool = False
    #: Whether the program is this driver's own: it has outputs and stops, the buffered servo,
    #: freedrive, offsets and a temporary TCP, and reports the number of points begun.
    is_own: bool = False

    @property
    def older_program(self) -> str:
        """Name of the dialect if the program is not the driver's own; '' = it is."""
        return '' if self.is_own else self.name

    @property
    def max_duration(self) -> float:
        """The longest duration that fits into a word [s]."""
        return INT32_MAX / self.time_scale

    @property
    def min_duration(self) -> float:
        """The shortest duration [s] that is not rounded to 0, which has another meaning."""
        return 0.5 / self.time_scale

    @property
    def is_coarse(self) -> bool:
        """Whether the rounding of times and radii matters."""
        return self.time_scale < FIXED_POINT

    def round_down_radius(self, radius: _Lengths) -> _Lengths:
        """Return the largest radius [m] on the wire that does not exceed the given one [m]."""
        if not self.is_coarse:
            return radius
        # Without 1e-6, 29 mm would become 28 mm: 0.029 * 1000 is a little less than 29.
        rounded: _Lengths = np.floor(radius * self.time_scale + 1e-6) / self.time_scale
        return rounded

    # -- the messages --------------------------------------------------------------------------

    def check_action(self, action: TrajectoryAction) -> None:
        """
        Refuse an action that the program would ignore.

        :raises LocalProtocolError: the program would ignore it; the text names the action.
        """
        is_stream = action in (TrajectoryAction.STREAM_START, TrajectoryAction.STREAM_END)
        if is_stream and not self.supports_append:
            raise self._unsupported(f'{action.name} (a trajectory with an open end)')

    def check_fields(self, fields: PointFields) -> None:
        """
        Refuse a point that the program would skip, misunderstand or ignore.

        :param fields: the 21 numbers of the point in SI units.
        :raises LocalProtocolError: a value is refused; the text names field, value and bound.
        """
        duration, kind = fields[18], fields[20]
        if kind not in self.motion_types:
            raise self._unsupported(f'{MotionType(int(kind)).name} (motion type {kind:g})')
        if not self.supports_q_near and fields[14] and kind in MOVE_TYPES:
            raise self._unsupported('q_near')
        name = field_names(fields)[PointField.DURATION]
        if 0.0 < duration < self.min_duration:
            raise LocalProtocolError(
                f'{name} is {duration!r} s, but wire dialect {self.name} has a resolution of '
                f'{1.0 / self.time_scale:g} s; a duration rounded to 0 would mean that the '
                'velocity applies.'
            )
        if duration > self.max_duration:
            raise LocalProtocolError(
                f'{name} is {duration!r} s, but one point can take at most {self.max_duration} '
                f's in wire dialect {self.name}.'
            )
        check_fields(fields)

    def accepts(self, fields: Floats) -> Flags:
        """Return a mask (n,) of the rows (n, 21) whose type and duration are certainly valid."""
        kinds, durations = fields[:, PointField.TYPE].astype(int), fields[:, PointField.DURATION]
        accepted = np.isin(kinds, list(self.motion_types))
        accepted &= (durations == 0.0) | (durations >= self.min_duration)
        accepted &= durations <= self.max_duration
        if not self.supports_q_near:
            accepted &= ~np.isin(kinds, list(MOVE_TYPES))
        return accepted

    def arrange(self, words: Int32s) -> Int32s:
        """Return points (n, 21) with their words in the order in which the program reads them."""
        if self.supports_q_near:
            return words
        kinds, words = words[:, PointField.TYPE], words.copy()
        for types, order in ((MOVE_TYPES, _OLD_MOVE), (ARC_TYPES, _OLD_ARC)):
            rows = np.isin(kinds, list(types))
            words[rows] = words[rows][:, order]
        return words

    def _unsupported(self, what: str) -> LocalProtocolError:
        return LocalProtocolError(f'{what} does not exist in wire dialect {self.name}.')


#: All dialects by name, oldest first.
DIALECTS: Mapping[str, Dialect] = {
    dialect.name: dialect
    for dialect in (
        Dialect(name='2.0', time_scale=1000, motion_types=_FIRST_TYPES),
        Dialect(name='2.10', motion_types=_FIRST_TYPES | _OPTIMOVES),
        Dialect(name='2.12', motion_types=_LIBRARY_TYPES, supports_q_near=True),
        Dialect(
            name='2.14',
            motion_types=frozenset(MotionType),
            supports_q_near=True,
            supports_append=True,
            is_own=True,
        ),
    )
}
#: The dialect of this package's robot program.
NEWEST_DIALECT = DIALECTS['2.14']
