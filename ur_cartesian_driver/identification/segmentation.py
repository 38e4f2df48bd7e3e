# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Divides a recording into pieces: single moves, from a speed of zero to a speed of zero.

Between moves in a row, often no packet shows rest: the speed only falls to what a ramp changes in
one cycle. In a blend it stays higher.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum
from itertools import pairwise

import numpy as np

from ur_cartesian_driver.identification.arm_samples import ArmSamples
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats
from ur_cartesian_driver.motion.state.rtde_state import (
    MOVABLE_SAFETY_MODES,
    RuntimeState,
    SafetyMode,
)

#: Targets slower than this count as at rest [rad/s].
REST_SPEED = 1e-3
#: Longest rest inside a chain of moves, and longest gap in the packets of a usable piece [s].
CHAIN_TIME, LONGEST_GAP = 0.1, 0.1
#: How much of the rest on both sides belongs to a piece [s].
MARGIN = 0.2
#: Pieces of fewer rows are no moves.
_FEWEST_ROWS = 12


class Ending(Enum):
    """The event that ended a piece before its target; the value names the law of its ramp."""

    PROGRAM_STOP = 'stop_time'
    PAUSE = 'pause_time'
    PROTECTIVE_STOP = 'protective_stop_time'
    #: Emergency and safeguard stops, violations, faults: no law describes their ramps.
    OTHER_SAFETY_STOP = ''


#: Endings after which the rest of the move may follow.
_RESUMABLE = (Ending.PAUSE, Ending.PROTECTIVE_STOP, Ending.OTHER_SAFETY_STOP)


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """
    Rows of a recording that belong to one move.

    :param begin: first row; rest before it, if any, is included.
    :param end: row after the last one; rest behind it, if any, is included.
    :param moving: first and last row in which the target moves.
    :param number: index among all pieces of the recording, including those that are left out.
    :param chained: whether another piece precedes it within :data:`CHAIN_TIME`.
    :param ending: None = it came to its end, or the recording does not tell.
    :param resumed: whether it is the remainder of a move that was paused or stopped.
    :param slowed: whether the speed slider was below 100 %.
    """

    begin: int
    end: int
    moving: tuple[int, int]
    number: int
    chained: bool
    ending: Ending | None
    resumed: bool
    slowed: bool

    def directly_follows(self, before: Piece) -> bool:
        """Return whether this piece comes right after ``before`` in one chain."""
        return self.chained and self.number == before.number + 1


def pieces(samples: ArmSamples) -> list[Piece]:
    """Return the pieces of a recording in the order of time, without those across long gaps."""
    speed = _speeds(samples)
    stretches = _stretches(samples, speed)
    # In a sharp blend one joint may pass zero, but not all of them.
    together = np.linalg.norm(np.diff(samples.target_q, axis=0), axis=1) / np.diff(samples.time)
    cuts = [
        (begin, end, i, len(parts))
        for begin, last in stretches
        for parts in [_split(samples.time, together, begin, last)]
        for i, (begin, end) in enumerate(parts)
    ]
    found: list[Piece] = []
    for k, (begin, end, place, count) in enumerate(cuts):
        before = cuts[k - 1][1] if k else -1
        after = cuts[k + 1][0] if k + 1 < len(cuts) else len(speed)
        if end - begin < _FEWEST_ROWS or _has_long_gap(samples.time[begin : end + 1]):
            continue
        cut = place > 0, place + 1 < count
        piece = _piece(samples, k, (begin, end), (before, after), cut)
        is_rest = k > 0 and _ending(samples, *cuts[k - 1][:2]) in _RESUMABLE
        found.append(replace(piece, resumed=is_rest and _is_resuming(samples, begin)))
    return found


def noise_of(values: Floats) -> float:
    """Return the standard deviation of white noise in a smooth curve (n,) or curves (n, k)."""
    if len(values) < 8:
        return 0.0
    rough = np.diff(values, 3, axis=0)
    return float(1.4826 * np.median(np.abs(rough)) / np.sqrt(20.0))


def follows(time: Floats, cycle: float) -> Flags:
    """Return a mask (n,) of rows that come one cycle after the row before."""
    return np.concatenate([[False], np.diff(time) < 1.5 * cycle])


def _speeds(samples: ArmSamples) -> Floats:
    """Return the speed (n - 1,) of the fastest joint between rows [rad/s]."""
    steps = np.abs(np.diff(samples.target_q, axis=0)).max(axis=1)
    speed: Floats = steps / np.diff(samples.time)
    return speed


def _stretches(samples: ArmSamples, speed: Floats) -> list[tuple[int, int]]:
    """Return first and last step of each stretch in motion; single slow steps do not end one."""
    scatter = noise_of(samples.target_q) / samples.cycle
    moving = speed > max(REST_SPEED, 8.0 * scatter)
    steps = np.flatnonzero(moving)
    if not len(steps):
        return []
    breaks = np.flatnonzero(np.diff(steps) > 2)
    firsts = np.concatenate([[0], breaks + 1])
    lasts = np.concatenate([breaks, [len(steps) - 1]])
    return [(int(steps[a]), int(steps[b])) for a, b in zip(firsts, lasts, strict=True)]


def _split(time: Floats, speed: Floats, begin: int, last: int) -> list[tuple[int, int]]:
    """Split a stretch where its speed passes zero between two packets."""
    part, bounds = speed[begin : last + 1], [begin]
    elapsed = np.diff(time)[begin : last + 1]
    # A ramp down and up again: the acceleration is that of the neighbours beyond.
    for i in range(3, len(part) - 3):
        if part[i] > part[i - 1] or part[i] > part[i + 1]:
            continue
        fall = (part[i - 3] - part[i - 1]) / elapsed[i - 2 : i].sum()
        rise = (part[i + 3] - part[i + 1]) / elapsed[i + 2 : i + 4].sum()
        if min(fall, rise) <= 0.0:
            continue
        if part[i] >= 1.05 * max(fall, rise) * elapsed[i] or begin + i - bounds[-1] <= 5:
            continue
        beside = (part[i - 1], fall), (part[i + 1], rise)
        if not any(_is_flat(v, ramp * elapsed[i], part[i]) for v, ramp in beside):
            bounds.append(begin + i)
    bounds.append(last + 1)
    return list(pairwise(bounds))


def _is_flat(speed: float, change: float, least: float) -> bool:
    """
    Return whether a speed beside the least one leads to no stop: it comes from a slow blend.

    :param change: of the speed, from packet to packet.
    """
    return speed > 4.0 * change and speed < 2.0 * least


def _piece(
    samples: ArmSamples,
    number: int,
    moving: tuple[int, int],
    beside: tuple[int, int],
    cut: tuple[bool, bool],
) -> Piece:
    """
    Make the piece of some moving steps; the caller sets ``resumed``.

    :param moving: row at which it begins to move, and the row at which it has ended.
    :param beside: row at which the piece before has ended, and at which the next one begins.
    :param cut: whether it touches the piece before, and the next one.
    """
    (begin, end), time = moving, samples.time
    margin = round(MARGIN / samples.cycle)
    # The row at a junction may belong to either side.
    low = begin + 2 if cut[0] else max(begin - margin, beside[0] + 2, 0)
    high = end - 1 if cut[1] else min(end + 1 + margin, beside[1] - 1, len(time))
    pause = time[begin] - time[max(beside[0], 0)] if beside[0] >= 0 else np.inf
    ending = _ending(samples, begin, end)
    slider = samples.slider
    return Piece(
        begin=low,
        end=max(high, low),
        moving=(begin, end),
        number=number,
        chained=bool(pause < CHAIN_TIME),
        ending=ending,
        resumed=False,
        slowed=slider is not None and bool((slider[begin:end] < 0.999).any()),
    )


def _is_resuming(samples: ArmSamples, begin: int) -> bool:
    """Return whether a paused program goes on where a piece begins."""
    states = samples.runtime_state
    if states is None:
        return False
    recent = states[max(begin - 3, 0) : begin + 3]
    return bool(np.isin(recent, (RuntimeState.PAUSED, RuntimeState.RESUMING)).any())


def _ending(samples: ArmSamples, begin: int, end: int) -> Ending | None:
    """Return the event that interrupted a motion; events in its last cycles do not count."""
    inside = slice(begin + 1, max(end - 2, begin + 1))
    safety, states = samples.safety_mode, samples.runtime_state
    if safety is not None:
        stops = safety[inside][~np.isin(safety[inside], MOVABLE_SAFETY_MODES)]
        if (stops != SafetyMode.PROTECTIVE_STOP).any():
            return Ending.OTHER_SAFETY_STOP
        if len(stops):
            return Ending.PROTECTIVE_STOP
    if states is None:
        return None
    if np.isin(states[inside], (RuntimeState.PAUSING, RuntimeState.PAUSED)).any():
        return Ending.PAUSE
    if (states[inside] == RuntimeState.STOPPING).any():
        return Ending.PROGRAM_STOP
    return None


def _has_long_gap(time: Floats) -> bool:
    return bool((np.diff(time) > LONGEST_GAP).any())
