# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The primitives of a plan in columns: a row for each motion.

Nearly all motions of a long goal go to a pose, or are pieces of a spline. The others (to joint
targets) are kept as objects, by row, in addition to the columns. The rows are still a sequence of
primitives; those in columns are created on access.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Int64s
from ur_cartesian_driver.motion.geometry.pose import pose_from_row
from ur_cartesian_driver.motion.geometry.vectors import vector6, ZERO6
from ur_cartesian_driver.motion.goal.goal import ArcMode
from ur_cartesian_driver.motion.goal.goal_columns import Rows
from ur_cartesian_driver.motion.plan.primitive import (
    MoveC,
    MoveJ,
    MoveL,
    MoveP,
    OptimoveJ,
    OptimoveL,
    Primitive,
    Spline,
    Stop,
)

#: The classes that are stored in columns; a kind is an index into this tuple.
MOVES = (MoveJ, MoveL, MoveP, OptimoveJ, OptimoveL, MoveC)
#: The kind of arcs.
ARC = MOVES.index(MoveC)


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class MoveRows(Rows[Primitive]):
    """Motions to poses of the TCP in base; units as in the primitives."""

    #: (n,) indices into :data:`MOVES`
    kinds: Int64s
    #: (n, 7) x y z [m], unit quaternion x y z w
    targets: Floats
    #: (n, 6) [rad]
    q_near: Floats
    #: (n,) whether the row has a ``q_near``
    has_q_near: Flags
    #: (n, 7) the poses on the arcs, and (n,) their modes; other rows are meaningless
    vias: Floats
    arc_modes: Int64s
    #: (n,) each; only MoveJ and MoveL have durations
    velocities: Floats
    accelerations: Floats
    durations: Floats
    #: (n,) also for the rows of ``others``
    blend_radii: Floats
    #: Primitives that the columns cannot express, by row; of the columns, only ``blend_radii`` is
    #: used for these rows.
    others: Mapping[int, Primitive]

    def __len__(self) -> int:
        return len(self.kinds)

    def __iter__(self) -> Iterator[Primitive]:
        numbers = self._numbers(
            *('kinds', 'targets', 'velocities', 'accelerations', 'durations', 'blend_radii'),
            *('q_near', 'has_q_near', 'vias', 'arc_modes'),
        )
        for i, row in enumerate(numbers):
            if i in self.others:
                yield self.others[i]
                continue
            kind, target, velocity, acceleration, duration, radius, *rest = row
            q_near, has_q_near, via, mode = rest
            move = MOVES[kind]
            own: dict[str, Any] = {'q_near': vector6(q_near) if has_q_near else None}
            if move is MoveC:
                own = {'via': pose_from_row(via), 'mode': ArcMode(mode)}
            elif move in (MoveJ, MoveL):
                own['duration'] = duration
            yield move(
                target=pose_from_row(target),
                velocity=velocity,
                acceleration=acceleration,
                blend_radius=radius,
                **own,
            )


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class SplineRows(Rows[Spline]):
    """Pieces of a joint spline; units as in a :class:`Spline`."""

    #: (n, 6) each
    targets: Floats
    velocities: Floats
    accelerations: Floats
    #: (n,)
    durations: Floats
    #: (n,) whether the piece is quintic; if not, its accelerations are not used
    quintic: Flags

    @classmethod
    def of(cls, pieces: Iterable[Spline]) -> SplineRows:
        """Return pieces as rows; rows are returned unchanged."""
        if isinstance(pieces, cls):
            return pieces
        every = tuple(pieces)
        states = [
            (piece.target, piece.velocities, piece.accelerations or ZERO6) for piece in every
        ]
        targets, velocities, accelerations = np.array(states).reshape(-1, 3, 6).swapaxes(0, 1)
        return cls(
            targets=targets,
            velocities=velocities,
            accelerations=accelerations,
            durations=np.array([piece.duration for piece in every], dtype=np.float64),
            quintic=np.array([piece.accelerations is not None for piece in every], dtype=np.bool_),
        )

    def __len__(self) -> int:
        return len(self.durations)

    def __iter__(self) -> Iterator[Spline]:
        for target, velocity, acceleration, duration, quintic in self._numbers(
            'targets', 'velocities', 'accelerations', 'durations', 'quintic'
        ):
            yield Spline(
                target=vector6(target),
                velocities=vector6(velocity),
                accelerations=vector6(acceleration) if quintic else None,
                duration=duration,
            )


def classes(primitives: Sequence[Primitive]) -> list[type[Primitive]]:
    """Return the class of each primitive, without creating objects from rows."""
    if isinstance(primitives, SplineRows):
        return [Spline] * len(primitives)
    if not isinstance(primitives, MoveRows):
        return [type(primitive) for primitive in primitives]
    found: list[type[Primitive]] = [MOVES[kind] for kind in primitives.kinds.tolist()]
    for row, primitive in primitives.others.items():
        found[row] = type(primitive)
    return found


def blend_radii(primitives: Sequence[Primitive]) -> Floats:
    """Return the blend radius of each primitive (n,) [m]; 0 = it has none."""
    if isinstance(primitives, MoveRows):
        return primitives.blend_radii
    if isinstance(primitives, SplineRows):
        return np.zeros(len(primitives))
    return np.array([getattr(primitive, 'blend_radius', 0.0) for primitive in primitives])


def has_optimized(primitives: Sequence[Primitive]) -> bool:
    """Return whether there is a primitive whose time the robot chooses."""
    classes = (OptimoveJ, OptimoveL)
    if isinstance(primitives, SplineRows):
        return False
    if not isinstance(primitives, MoveRows):
        return any(isinstance(primitive, classes) for primitive in primitives)
    in_rows = np.isin(primitives.kinds, [MOVES.index(move) for move in classes])
    return bool(in_rows.any()) or has_optimized(tuple(primitives.others.values()))


def stops(primitives: Sequence[Primitive]) -> dict[int, Stop]:
    """Return the stops (actions while the arm is at rest), by row."""
    if isinstance(primitives, SplineRows | MoveRows):
        return {}
    return {row: each for row, each in enumerate(primitives) if isinstance(each, Stop)}
