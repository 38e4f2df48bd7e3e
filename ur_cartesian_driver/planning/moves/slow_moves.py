# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Find the lines, arcs and PROCESS motions that are planned slower than requested.

Only motions that carry the tool along a path are examined. Joint moves and OPTIMIZED moves have no
requested tool speed, and turns on the spot have no path. In a blend, the speed is that of the
planned path, which follows an assumed law (:mod:`~.move_chain`).
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.goal.goal import SegmentType
from ur_cartesian_driver.motion.goal.goal_table import rows_where
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.motion.plan.slow_stretch import SlowCause, SLOWER_BY, SlowStretch
from ur_cartesian_driver.planning.moves.segment_geometries import SegmentGeometries
from ur_cartesian_driver.planning.moves.segment_timing import SegmentTimings
from ur_cartesian_driver.planning.request.blend_limits import (
    blend_law,
    blends_are_measured,
)
from ur_cartesian_driver.planning.request.goal_fields import OPTIMIZED_TYPES, type_table

_IS_FREE = type_table((SegmentType.JOINT, *OPTIMIZED_TYPES))
#: The path reverses if the dot product of its unit directions before and after is at most this.
_REVERSAL = -0.98
#: Fraction of ``slower_by`` that is tolerated in blends sampled by chords: the speed of a chord is
#: a mean, above the lowest speed.
_CHORD_PART = 0.5
_TINY = 1e-12
#: Rows of the reference path whose times differ by less than this [s] count as equal.
_SAME_TIME = 1e-6


def unknown_speeds(geometries: SegmentGeometries) -> tuple[list[int], list[int]]:
    """Return the points with blends, and the ends of motions without a requested tool speed."""
    begin, free = geometries.begin, _IS_FREE[geometries.kinds]
    return (
        [begin + row for row in rows_where(geometries.path.has_blend_after)],
        [begin + row for row in rows_where(free)],
    )


def slow_move_stretches(
    geometries: SegmentGeometries,
    timings: SegmentTimings,
    reference: ReferencePath,
    slower_by: float = SLOWER_BY,
) -> tuple[SlowStretch, ...]:
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
        self._free: Flags = _IS_FREE[geometries.kinds]
        #: (n,) whether each segment carries the tool along a path.
        self._carries = ~self._free & requests.limits.translates
        #: (n,) the requested speed [m/s]; NaN if the segment does not carry the tool.
        self._asked = np.where(self._carries, requests.asked, np.nan)
        #: Distance that the tool moves per unit of the length that the robot uses.
        self._ratio = curves.length / np.maximum(timings.chain.moves.length, _TINY)
        self._wanted = (1.0 - slower_by) * self._asked / np.maximum(self._ratio, _TINY)
        self._too_slow = self._carries & (times.cruise < self._wanted)

    def stretches(self) -> tuple[SlowStretch, ...]:
        """Return the stretches in the order of the path."""
        found = [*self._at_points(), *self._cruises(), *self._blends()]
        return tuple(sorted(found, key=lambda each: (each.first, each.first_fraction)))

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
        """Return the profile distances (n,) at which moves become fast enough, and slow again."""
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

    def _at_points(self) -> Iterator[SlowStretch]:
        """Return the stretches around points at which the tool brakes or speeds up."""
        begin, path, times = (
            self._geometries.begin,
            self._geometries.path,
            self._timings.chain.times,
        )
        speeds_up, brakes = self._ramps()
        begins, ends = self._fractions(brakes), self._fractions(speeds_up)
        # Whether each segment is the first after a joint move, and whether it is the last before
        # one.
        opens, closes = self._runs()
        heads, tails = speeds_up > 0.0, brakes < times.length - times.tail
        entering, leaving = times.enter * self._ratio, times.leave * self._ratio
        blended = path.has_blend_after
        if heads[0]:
            where = (0, path.u_join[0], 0, ends[0])
            reason = 'the arm starts from rest'
            yield self._stretch(where, entering[0], SlowCause.RAMP, reason, begin)
        for row in rows_where(tails & blended):
            yield self._stretch(
                (row, begins[row], row, path.u_leave[row]),
                leaving[row],
                SlowCause.RAMP if closes[row] else SlowCause.BLEND,
                f'it brakes because of the blend at point {begin + row}',
                begin + row,
            )
        for row in rows_where(heads & path.has_blend_before):
            yield self._stretch(
                (row, path.u_join[row], row, ends[row]),
                entering[row],
                SlowCause.RAMP if opens[row] else SlowCause.BLEND,
                f'it is still slow because of the blend at point {begin + row - 1}',
                begin + row - 1,
            )
        for row in rows_where((tails | np.append(heads[1:], False)) & ~blended):
            tail, head = bool(tails[row]), row + 1 < len(heads) and bool(heads[row + 1])
            cause, reason = SlowCause.STOP, f'the arm comes to rest at point {begin + row}'
            if tail and head and self._reverses(row):
                cause, reason = SlowCause.REVERSAL, f'the path reverses at point {begin + row}'
            if (not tail or closes[row]) and (not head or opens[row + 1]):
                cause = SlowCause.RAMP
            start = (row, begins[row]) if tail else (row + 1, 0.0)
            end = (row + 1, ends[row + 1]) if head else (row, 1.0)
            yield self._stretch((*start, *end), 0.0, cause, reason, begin + row)

    def _runs(self) -> tuple[Flags, Flags]:
        """Return whether each segment (n,) is the first, and the last, between joint moves."""
        run, carries = np.cumsum(self._free), self._carries
        opens, closes = np.zeros((2, len(run)), dtype=np.bool_)
        rows = np.flatnonzero(carries)
        opens[rows[np.diff(run[rows], prepend=-1) > 0]] = True
        closes[rows[np.diff(run[rows], append=len(run) + 1) > 0]] = True
        return opens, closes

    def _reverses(self, row: int) -> bool:
        """Return whether the path reverses at the end of a segment."""
        curves = self._geometries.path.curves
        at = np.array([row, row, row + 1, row + 1]), np.array([0.999, 1.0, 0.0, 0.001])
        before, here, _, after = curves.rows(*at)[:, :3]
        a, b = here - before, after - here
        return bool(a @ b <= _REVERSAL * np.linalg.norm(a) * np.linalg.norm(b))

    # -- whole segments --------------------------------------------------------------------------

    def _cruises(self) -> Iterator[SlowStretch]:
        """Return the stretches of segments whose cruising speed is too low."""
        geometries, timings, times = self._geometries, self._timings, self._timings.chain.times
        speeds_up, brakes = self._ramps()
        begins, ends = self._fractions(speeds_up), self._fractions(brakes)
        for row in rows_where(self._too_slow & (ends > begins)):
            point = geometries.begin + row
            lowest, limit = times.cruise[row], timings.requests.limited.get(row)
            if self._is_short[row] or self._turns[row]:
                lowest = min(times.enter[row], times.leave[row], lowest)
            if self._is_short[row]:
                cause = SlowCause.SHORT
                speed = times.cruise[row] * self._ratio[row]
                reason = f'the segment is too short for more than {speed:.3g} m/s'
            elif limit is not None:
                cause, reason = limit.cause, f'of {limit.text}'
            elif self._turns[row]:
                cause, reason = SlowCause.TURN, 'the tool turns that far on the segment'
            else:
                cause, reason = SlowCause.TIMES, 'the times of its neighbours leave it more time'
            where = (row, begins[row], row, ends[row])
            yield self._stretch(where, lowest * self._ratio[row], cause, reason, point)

    # -- in blends -------------------------------------------------------------------------------

    def _blends(self) -> list[SlowStretch]:
        """Return the blends in which the planned path is slower than requested."""
        path, times, reference = self._geometries.path, self._timings.chain.times, self._reference
        ratio, options = self._ratio, self._timings.options
        law = f'as {blend_law(options)}'
        if not blends_are_measured(options):
            law += ': how fast the robot passes blends is not published'
        rows = np.flatnonzero(path.has_blend_after)
        carries = np.append(self._carries, False)
        rows = rows[carries[rows] | carries[rows + 1]]
        if not len(rows):
            return []
        end = times.begins[rows + 1]
        begin = end - times.blend_time[rows + 1]
        steps = np.linalg.norm(np.diff(reference.poses[:, :3], axis=0), axis=1)
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
        return [
            self._stretch(
                (row, path.u_leave[row], row + 1, path.u_join[row + 1]),
                low,
                SlowCause.IN_BLEND,
                f'of the blend at point {self._geometries.begin + row} ({law})',
                self._geometries.begin + row,
                asked=wish,
            )
            for row, low, wish in zip(
                rows[slow].tolist(), lowest[slow].tolist(), asked[slow].tolist(), strict=True
            )
        ]

    def _stretch(
        self,
        place: tuple[int, float, int, float],
        lowest: float,
        cause: SlowCause,
        reason: str,
        point: int,
        asked: float | None = None,
    ) -> SlowStretch:
        """Return the stretch at a place: first row and fraction, last row and fraction."""
        first, begin, last, end = place
        base = self._geometries.begin
        return SlowStretch(
            first=base + first,
            first_fraction=float(begin),
            last=base + last,
            last_fraction=float(end),
            asked=asked or float(np.fmax(self._asked[first], self._asked[last])),
            lowest=float(lowest),
            cause=cause,
            reason=reason,
            point=point,
        )
