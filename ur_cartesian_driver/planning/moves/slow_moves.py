# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Find the lines, arcs and PROCESS motions that are planned slower than requested.

Only motions that carry the tool along a path are examined. Joint moves and OPTIMIZED moves have no
requested tool speed, and turns on the spot have no path. In a blend, the speed of the planned path
counts, which follows an assumed or a measured law (:mod:`~.move_chain`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.pose_rows import length_rows
from ur_cartesian_driver.motion.goal.goal_columns import Rows, rows_where
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.motion.plan.slow_stretch import SlowCause, SLOWER_BY, SlowStretch
from ur_cartesian_driver.planning.moves.segment_geometries import SegmentGeometries
from ur_cartesian_driver.planning.moves.segment_timing import SegmentTimings
from ur_cartesian_driver.planning.request.blend_limits import (
    blend_law,
    blends_are_measured,
)
from ur_cartesian_driver.planning.request.goal_fields import TAKES_TOOL_SPEED

#: The path reverses if the dot product of its unit directions before and after is at most this.
_REVERSAL = -0.98
#: Fraction of ``slower_by`` that is tolerated in blends sampled by chords: the speed of a chord is
#: a mean, above the lowest speed.
_CHORD_PART = 0.5
#: A column of objects that many rows share.
Shared = NDArray[Any]
_TINY = 1e-12
#: Rows of the reference path whose times differ by less than this [s] count as equal.
_SAME_TIME = 1e-6


def unknown_speeds(geometries: SegmentGeometries) -> tuple[list[int], list[int]]:
    """Return the points with blends, and the ends of motions without a requested tool speed."""
    begin, free = geometries.begin, ~TAKES_TOOL_SPEED[geometries.kinds]
    return (
        [begin + row for row in rows_where(geometries.path.has_blend_after)],
        [begin + row for row in rows_where(free)],
    )


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class SlowStretches(Rows[SlowStretch]):
    """
    Slow stretches in columns (n,), because a long goal can have several per point.

    The columns have the names of the fields of a :class:`SlowStretch`. Reasons have ``{point}``
    and ``{speed}`` in place of numbers.
    """

    first: Indices
    first_fraction: Floats
    last: Indices
    last_fraction: Floats
    asked: Floats
    lowest: Floats
    cause: Shared
    reason: Shared
    point: Indices
    #: Speeds in the reasons [m/s].
    speed: Floats

    def __len__(self) -> int:
        return len(self.first)

    def __iter__(self) -> Iterator[SlowStretch]:
        names = tuple(self.__dataclass_fields__)
        for row in self._numbers(*names):
            of = dict(zip(names, row, strict=True))
            of['reason'] = of['reason'].format(point=of['point'], speed=of.pop('speed'))
            yield SlowStretch(**of)


def slow_move_stretches(
    geometries: SegmentGeometries,
    timings: SegmentTimings,
    reference: ReferencePath,
    slower_by: float = SLOWER_BY,
) -> SlowStretches:
    """
    Return the slow stretches of a plan of moves, in the order of the path.

    :param reference: the reference path of the motions, before stops are inserted.
    :param slower_by: a speed is too low if it is more than this fraction below the requested one.
    """
    with np.errstate(over='ignore', invalid='ignore'):  # a goal may ask for any speed
        return _SlowMoves(geometries, timings, reference, slower_by).stretches()


class _SlowMoves:
    """Finds the slow stretches."""

    def __init__(
        self,
        geometries: SegmentGeometries,
        timings: SegmentTimings,
        reference: ReferencePath,
        slower_by: float,
    ) -> None:
        """Compare the speeds of the profiles with the requested speeds."""
        self._geometries, self._timings, self._reference = geometries, timings, reference
        self._slower_by = slower_by
        requests, times = timings.requests, timings.chain.times
        curves = geometries.path.curves
        self._free: Flags = ~TAKES_TOOL_SPEED[geometries.kinds]
        #: (n,) whether each segment carries the tool along a path.
        self._carries = ~self._free & requests.limits.translates
        #: (n,) the requested speed [m/s]; NaN if the segment does not carry the tool.
        self._asked = np.where(self._carries, requests.asked, np.nan)
        #: Distance that the tool moves per unit of the length that the robot uses.
        self._ratio = curves.length / np.maximum(timings.chain.moves.length, _TINY)
        #: The lowest speed that is not too slow, in the unit of the length that the robot uses.
        self._wanted = (1.0 - slower_by) * self._asked / np.maximum(self._ratio, _TINY)
        self._too_slow = self._carries & (times.cruise < self._wanted)

    def stretches(self) -> SlowStretches:
        """Return the stretches in the order of the path."""
        groups = [*self._at_points(), self._cruises(), *self._blends()]

        def column(name: str) -> Shared:
            return np.concatenate([getattr(group, name) for group in groups])

        order = np.lexsort((column('first_fraction'), column('first')))
        names = SlowStretches.__dataclass_fields__
        return SlowStretches(**{name: column(name)[order] for name in names})

    # -- between the blends ----------------------------------------------------------------------

    @cached_property
    def _is_short(self) -> Flags:
        """(n,) whether each segment is too short for the tool to reach the requested speed."""
        moves = self._timings.chain.moves
        untimed = (moves.time <= 0.0) & ~self._turns
        return self._too_slow & untimed & (moves.speed >= self._wanted)

    @cached_property
    def _turns(self) -> Flags:
        """(n,) whether the turn of the tool, not a limit, makes each segment slow."""
        requests = self._timings.requests
        turns = self._too_slow & requests.limits.is_turn
        turns[list(requests.limited)] = False
        return turns

    def _ramps(self) -> tuple[Floats, Floats]:
        """
        Return the profile distances (n,) at which moves become fast enough, and slow again.

        Of a move whose cruising speed is too low, these are the ends of its cruise, or of its
        whole profile if the segment is too short or turns the tool.
        """
        times = self._timings.chain.times
        full = times.length - times.tail
        slow = (1.0 - self._slower_by) * times.cruise
        wanted = np.where(self._too_slow, slow, self._wanted)
        squared = wanted**2
        speeds_up = np.clip(
            (squared - times.enter**2) / (2.0 * np.maximum(times.acceleration, _TINY)), 0.0, full
        )
        brakes = np.clip(times.length - squared / (2.0 * times.braking), 0.0, full)
        nothing = ~self._carries
        speeds_up[nothing | (times.enter >= wanted)] = 0.0
        brakes = np.where(nothing | (times.leave >= wanted), full, brakes)
        whole = self._is_short | self._turns
        speeds_up[whole], brakes[whole] = 0.0, full[whole]
        return speeds_up, brakes

    def _fractions(self, distances: Floats) -> Floats:
        """Convert distances (n,) on the profiles to fractions of the segments."""
        path, times = self._geometries.path, self._timings.chain.times
        full = np.maximum(times.length - times.tail, _TINY)
        fractions: Floats = path.u_join + (path.u_leave - path.u_join) * distances / full
        return fractions

    def _at_points(self) -> Iterator[SlowStretches]:
        """Yield the stretches around points at which the tool brakes or speeds up."""
        path, times = self._geometries.path, self._timings.chain.times
        speeds_up, brakes = self._ramps()
        begins, ends = self._fractions(brakes), self._fractions(speeds_up)
        # Whether each segment is the first after a joint move, and whether it is the last before
        # one.
        opens, closes = self._runs()
        heads, tails = speeds_up > 0.0, brakes < times.length - times.tail
        entering, leaving = times.enter * self._ratio, times.leave * self._ratio
        blended = path.has_blend_after
        rows = np.flatnonzero(heads[:1])
        yield self._stretches(
            (rows, path.u_join[rows], rows, ends[rows]),
            entering[rows],
            SlowCause.RAMP,
            'the arm starts from rest',
        )
        rows = np.flatnonzero(tails & blended)
        yield self._stretches(
            (rows, begins[rows], rows, path.u_leave[rows]),
            leaving[rows],
            _choose(closes[rows], SlowCause.RAMP, SlowCause.BLEND),
            'it brakes because of the blend at point {point}',
        )
        rows = np.flatnonzero(heads & path.has_blend_before)
        yield self._stretches(
            (rows, path.u_join[rows], rows, ends[rows]),
            entering[rows],
            _choose(opens[rows], SlowCause.RAMP, SlowCause.BLEND),
            'it is still slow because of the blend at point {point}',
            rows - 1,
        )
        # Stops: the tool brakes before the point, or speeds up after it, or both.
        heads, opens, ends = (
            np.append(heads[1:], False), np.append(opens[1:], False), np.append(ends[1:], 0.0)
        )  # fmt: skip
        rows = np.flatnonzero((tails | heads) & ~blended)
        tail, head = tails[rows], heads[rows]
        reverses = tail & head
        reverses[reverses] = self._reverses(rows[reverses])
        is_ramp = (~tail | closes[rows]) & (~head | opens[rows])
        yield self._stretches(
            (
                np.where(tail, rows, rows + 1),
                np.where(tail, begins[rows], 0.0),
                np.where(head, rows + 1, rows),
                np.where(head, ends[rows], 1.0),
            ),
            np.zeros(len(rows)),
            np.where(
                is_ramp,
                _shared(SlowCause.RAMP),
                _choose(reverses, SlowCause.REVERSAL, SlowCause.STOP),
            ),
            _choose(
                reverses,
                'the path reverses at point {point}',
                'the arm comes to rest at point {point}',
            ),
            rows,
        )

    def _runs(self) -> tuple[Flags, Flags]:
        """Return whether each segment (n,) is the first, and the last, between joint moves."""
        run, carries = np.cumsum(self._free), self._carries
        opens, closes = np.zeros((2, len(run)), dtype=np.bool_)
        rows = np.flatnonzero(carries)
        opens[rows[np.diff(run[rows], prepend=-1) > 0]] = True
        closes[rows[np.diff(run[rows], append=len(run) + 1) > 0]] = True
        return opens, closes

    def _reverses(self, rows: Indices) -> Flags:
        """Return whether the path reverses at the ends of segments (n,)."""
        curves = self._geometries.path.curves
        before, here, after = (
            curves.rows(rows + beyond, np.full(len(rows), u))[:, :3]
            for beyond, u in ((0, 0.999), (0, 1.0), (1, 0.001))
        )
        a, b = here - before, after - here
        along = np.einsum('ij,ij->i', a, b)
        reverses: Flags = along <= _REVERSAL * (
            np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
        )
        return reverses

    # -- whole segments --------------------------------------------------------------------------

    def _cruises(self) -> SlowStretches:
        """Return the stretches of segments whose cruising speed is too low."""
        times, limited = self._timings.chain.times, self._timings.requests.limited
        speeds_up, brakes = self._ramps()
        begins, ends = self._fractions(speeds_up), self._fractions(brakes)
        rows = np.flatnonzero(self._too_slow & (ends > begins))
        is_short, turns = self._is_short[rows], self._turns[rows]
        lowest = times.cruise[rows]
        at_ends = np.minimum(times.enter[rows], times.leave[rows])
        lowest = np.where(is_short | turns, np.minimum(lowest, at_ends), lowest)
        causes = _choose(turns, SlowCause.TURN, SlowCause.TIMES)
        reasons = _choose(
            turns,
            'the tool turns that far on the segment',
            'the times of its neighbours leave it more time',
        )
        for i, row in enumerate(rows.tolist()):
            if (limit := limited.get(row)) is not None:
                causes[i], reasons[i] = limit.cause, f'of {_literal(limit.text)}'
        causes[is_short] = SlowCause.SHORT
        reasons[is_short] = 'the segment is too short for more than {speed:.3g} m/s'
        return self._stretches(
            (rows, begins[rows], rows, ends[rows]),
            lowest * self._ratio[rows],
            causes,
            reasons,
            speeds=times.cruise[rows] * self._ratio[rows],
        )

    # -- in blends -------------------------------------------------------------------------------

    def _blends(self) -> Iterator[SlowStretches]:
        """Yield the blends in which the planned path is slower than requested."""
        path, times, reference = self._geometries.path, self._timings.chain.times, self._reference
        ratio, options = self._ratio, self._timings.options
        law = f'as {blend_law(options)}'
        if not blends_are_measured(options):
            law += ': how fast the robot passes blends is not published'
        rows = np.flatnonzero(path.has_blend_after)
        carries = np.append(self._carries, False)
        rows = rows[carries[rows] | carries[rows + 1]]
        if not len(rows):
            return
        end = times.begins[rows + 1]
        begin = end - times.blend_time[rows + 1]
        steps = length_rows(np.diff(reference.poses[:, :3], axis=0))
        passing = np.diff(reference.time)
        speeds = np.where(passing > _SAME_TIME, steps / np.maximum(passing, _SAME_TIME), np.inf)
        middle = 0.5 * (reference.time[1:] + reference.time[:-1])
        first, last = np.searchsorted(middle, begin), np.searchsorted(middle, end)
        asked = np.fmin(self._asked[rows], self._asked[rows + 1])
        # The last blend may end at the last speed, and reduceat needs an element after it.
        lowest = np.minimum.reduceat(
            np.append(speeds, np.inf), np.stack((first, last), axis=1).ravel()
        )[::2]
        # The speed in a fillet changes linearly over time, so it is lowest at one end.
        ends = np.fmin(times.leave[rows] * ratio[rows], times.enter[rows + 1] * ratio[rows + 1])
        lowest = np.where(path.fillet[rows], ends, lowest)
        part = np.where(path.fillet[rows], 1.0, _CHORD_PART)
        slow = lowest < (1.0 - part * self._slower_by) * asked
        rows = rows[slow]
        yield self._stretches(
            (rows, path.u_leave[rows], rows + 1, path.u_join[rows + 1]),
            lowest[slow],
            SlowCause.IN_BLEND,
            f'of the blend at point {{point}} ({_literal(law)})',
            asked=asked[slow],
        )

    def _stretches(
        self,
        place: tuple[Indices, Floats, Indices, Floats],
        lowest: Floats,
        causes: Shared | SlowCause,
        reasons: Shared | str,
        points: Indices | None = None,
        asked: Floats | None = None,
        speeds: Floats | None = None,
    ) -> SlowStretches:
        """
        Return the stretches at places (n,): first row and fraction, last row and fraction.

        :param points: rows of the segments to the points that the reasons name; None = ``first``.
        """
        first, begin, last, end = place
        base, shape = self._geometries.begin, first.shape
        return SlowStretches(
            first=base + first,
            first_fraction=begin,
            last=base + last,
            last_fraction=end,
            asked=np.fmax(self._asked[first], self._asked[last]) if asked is None else asked,
            lowest=lowest,
            cause=np.broadcast_to(_shared(causes), shape),
            reason=np.broadcast_to(_shared(reasons), shape),
            point=base + (first if points is None else points),
            speed=np.zeros(shape) if speeds is None else speeds,
        )


def _shared(value: object) -> Shared:
    return np.array(value, dtype=object)


def _choose(condition: Flags, this: object, other: object) -> Shared:
    """Return a column that has one of two objects in each row."""
    return np.where(condition, _shared(this), _shared(other))


def _literal(text: str) -> str:
    """Return a text that :meth:`str.format` leaves as it is."""
    return text.replace('{', '{{').replace('}', '}}')
