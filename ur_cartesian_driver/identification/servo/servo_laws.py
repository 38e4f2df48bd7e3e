# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The laws of servoj, from all motions of recordings whose calls are known."""

from __future__ import annotations

from collections.abc import Sequence
from math import radians

import numpy as np

from ur_cartesian_driver.identification.estimators import (
    plural,
    Result,
    result_of,
    unless_wide,
)
from ur_cartesian_driver.identification.moves import FoundMove
from ur_cartesian_driver.identification.profile import Misfit
from ur_cartesian_driver.identification.recorded_calls import SetPoints
from ur_cartesian_driver.identification.segmentation import LONGEST_GAP
from ur_cartesian_driver.identification.servo.servo_filter import find_filter, ServoFilter
from ur_cartesian_driver.identification.stop_ramp import find_ramp, StopRamp
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.motion.twin.laws import LAWS

#: A joint that servoj turns less is not used [rad]; a target moves visibly so long after its
#: set-point [s].
_MIN_SERVO_TURN, _SERVO_HIDDEN = radians(1.0), 0.01
#: How near the end of the calls the ramp behind them begins, and for how long before and behind
#: their end it is looked for [s].
_NEAR_END, _STEADY_END = 0.05, 0.2


def servo_laws(moves: Sequence[FoundMove]) -> dict[str, Result]:
    """Find the filter of servoj, and what follows its last set-point."""
    return {**_filter_laws(moves), 'set_point_deceleration': _deceleration(moves)}


def _filter_laws(moves: Sequence[FoundMove]) -> dict[str, Result]:
    """Find the factors on gain and lookahead time of servoj, where its calls are known."""
    filters: list[ServoFilter] = []
    others: list[float] = []
    motions = 0
    reason = 'no motion of servoj whose calls are known'
    for move in moves:
        points = move.set_points
        if points is None:
            continue
        if problem := _unusable(move):
            reason = f'a motion of servoj {problem}'
            continue
        motions += 1
        for found in _filters(move, points):
            if isinstance(found, Misfit):
                others.append(found.rms)
            else:
                filters.append(found)
    beyond = [each for each in filters if _is_beyond(each)]
    if others or beyond:
        filters = []
    if beyond:
        factors = f'{beyond[0].gain_factor.value:.3g} and {beyond[0].lookahead_factor.value:.3g}'
        reason = (
            f'{plural(len(beyond), "joint")} followed servoj by another law: factors of '
            f'{factors} fit best'
        )
    elif others:
        reason = (
            f'{plural(len(others), "joint")} followed servoj by another law: '
            f'{1e6 * max(others):.3g} urad are left'
        )
    elif motions and not filters:
        reason = f'{plural(motions, "motion")} of servoj turned no joint by a degree'
    evidence = (
        f'{plural(len(filters), "joint")} in {plural(motions, "motion")} of servoj, by '
        + ' and '.join(sorted({each.law for each in filters}))
    )
    experiment = (
        'record a joint that calls of servoj turn by 10 degrees and back, at 6 degrees/s, with '
        'half a second of rest before, between and behind, and name the calls'
    )
    left_over = f'{1e6 * max((each.rms for each in filters), default=0.0):.2g} urad rms'
    results: dict[str, Result] = {}
    for name, parts in (
        ('servo_gain_factor', [each.gain_factor for each in filters]),
        ('servo_lookahead_factor', [each.lookahead_factor for each in filters]),
    ):
        result = result_of(name, parts, evidence, reason, experiment, left_over=left_over)
        results[name] = unless_wide(name, result, parts, lambda value: 0.1 * value, experiment)
    return results


def _is_beyond(found: ServoFilter) -> bool:
    """Return whether a factor is none that the law can have."""
    gain, lookahead = found.gain_factor.value, found.lookahead_factor.value
    return bool(
        LAWS['servo_gain_factor'].problem(gain)
        or LAWS['servo_lookahead_factor'].problem(lookahead)
    )


def _deceleration(moves: Sequence[FoundMove]) -> Result:
    """Find how the leading joint brakes where set-points stay away while the program goes on."""
    ramps, odd, unsteady = [], 0, 0
    for move in moves:
        points, states = move.set_points, move.samples.runtime_state
        if points is None or points.is_stopped or states is None or _unusable(move):
            continue
        time, rows = move.rows
        end = _call_times(move, points)[1]
        near = (time > end - _STEADY_END) & (time < end + _STEADY_END)
        q = move.samples.target_q[move.piece.begin : move.piece.end]
        if (states[move.piece.begin : move.piece.end][near] != RuntimeState.PLAYING).any():
            continue
        moved = q[-1] - q[0]
        lead = int(np.abs(moved).argmax())
        ramp = find_ramp(time[near], np.sign(moved[lead]) * q[near, lead], rows[near])
        odd += isinstance(ramp, Misfit)
        unsteady += ramp is None
        if isinstance(ramp, StopRamp) and abs(ramp.begin - end) < _NEAR_END:
            ramps.append(ramp.deceleration)
    reason = 'no program goes on after calls of servoj that leave the arm in motion'
    if odd:
        reason = f'{plural(odd, "stop")} behind servoj followed no even ramp'
    elif unsteady:
        reason = f'{plural(unsteady, "motion")} of servoj was not steady at its end'
    return result_of(
        'set_point_deceleration',
        ramps,
        f'{plural(len(ramps), "motion")} of servoj without a further set-point',
        reason,
        'let calls of servoj turn a joint evenly at 30 degrees/s for two seconds, then sleep(1); '
        'record runtime_state, and name the calls',
    )


def _unusable(move: FoundMove) -> str:
    """Return why a motion of servoj shows no law, as a clause; '' = it does."""
    states = move.samples.runtime_state
    rows = slice(move.piece.begin, move.piece.end)
    if move.piece.ending or (states is not None and _is_paused(states[rows])):
        return 'was interrupted'
    if move.piece.slowed:
        return 'ran while the speed slider was below 100 %'
    # Pieces across gaps are left out, so the motion may seem to begin late.
    if (np.diff(move.samples.time) > LONGEST_GAP).any():
        return f'lacks packets for more than {LONGEST_GAP:g} s'
    return ''


def _is_paused(states: Floats) -> bool:
    return bool(np.isin(states, (RuntimeState.PAUSING, RuntimeState.PAUSED)).any())


def _call_times(move: FoundMove, points: SetPoints) -> tuple[float, float]:
    """Return when the calls of servoj of a motion began and ended, within some cycles [s]."""
    place = move.samples.target_q[move.piece.begin].tolist()
    moving = float(move.samples.time[move.piece.moving[0]])
    begin = moving - _SERVO_HIDDEN - points.rest(place)
    return begin, begin + sum(points.times)


def _filters(move: FoundMove, points: SetPoints) -> list[ServoFilter | Misfit]:
    """Return the filter of each joint that a motion of servoj turns."""
    (time, rows), begin = move.rows, _call_times(move, points)[0]
    q = move.samples.target_q[move.piece.begin : move.piece.end]
    turning = np.flatnonzero(np.ptp(q, axis=0) > _MIN_SERVO_TURN).tolist()
    found = (find_filter(time, q[:, i], rows, points, i, begin) for i in turning)
    return [each for each in found if each is not None]
