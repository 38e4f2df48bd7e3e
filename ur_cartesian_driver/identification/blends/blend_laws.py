# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The laws of blends, from all blends of all recordings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import degrees

from ur_cartesian_driver.identification.blends.blend_corners import corners_of
from ur_cartesian_driver.identification.blends.blend_fit import (
    find_blend,
    FoundBlend,
    OtherLaw,
)
from ur_cartesian_driver.identification.estimators import plural, Result, result_of, Unknown
from ur_cartesian_driver.identification.least_squares import Measured
from ur_cartesian_driver.identification.moves import FoundMove
from ur_cartesian_driver.motion.twin.twin import Estimate

_EXPERIMENT = (
    'record three movel, the first two with r, with corners of 60 to 150 degrees and lines longer '
    'than four r, and name the calls'
)
_NOT_FITTED = 'their law is not known, so plans keep the assumed one with its tolerance'


def blend_laws(moves: Sequence[FoundMove]) -> dict[str, Result]:
    """
    Find where blends begin and end, their curve, and their speed half-way through.

    Where a blend follows no parabola, the shape is ``unknown``, and nothing else is found.
    """
    found: list[FoundBlend] = []
    reasons: list[str] = []
    for move in moves:
        if len(move.chain) < 2:
            continue
        for corner in corners_of(move):
            blend = corner if isinstance(corner, str) else find_blend(corner)
            if isinstance(blend, str):
                reasons.append(blend)
            else:
                found.append(blend)
    odd = [blend for blend in found if not blend.is_parabola]
    if odd:
        return _unknown_shape(found, odd)
    evidence = _evidence(found)
    left = f'{_left(found)} rms'
    begins, ratios = [each.begin for each in found], [each.speed_ratio for each in found]
    shape: Result = Unknown(reason=_reason(reasons), experiment=_EXPERIMENT)
    if found:
        shape = Estimate(value='parabola', evidence=evidence, left_over=left)
    results: dict[str, Result] = {'blend_shape': shape}
    for name, parts in (('blend_begin', begins), ('blend_speed_ratio', ratios)):
        others = [part for part in parts if isinstance(part, OtherLaw)]
        measured = [] if others else [part for part in parts if isinstance(part, Measured)]
        why = _reason(others or [*(part for part in parts if isinstance(part, str)), *reasons])
        experiment = _NOT_FITTED if others else _EXPERIMENT
        results[name] = result_of(name, measured, evidence, why, experiment, left_over=left)
    return results


def _unknown_shape(found: Sequence[FoundBlend], odd: Sequence[FoundBlend]) -> dict[str, Result]:
    """Return what is said of blends some of which follow no parabola."""
    reason = f'{len(odd)} of {plural(len(found), "blend")} followed no parabola'
    nothing = Unknown(reason=f'{reason}: {_left(odd)} are left', experiment=_NOT_FITTED)
    return {
        'blend_begin': nothing,
        'blend_shape': Estimate(value='unknown', evidence=reason, left_over=f'{_left(odd)} rms'),
        'blend_speed_ratio': nothing,
    }


def _reason(reasons: Sequence[str]) -> str:
    if not reasons:
        return 'no moves joined by a blend, with calls that are known'
    if len(reasons) == 1:
        return f'1 blend could not be used: {reasons[0]}'
    return f'{len(reasons)} blends could not be used, the first one: {reasons[0]}'


def _evidence(found: Sequence[FoundBlend]) -> str:
    if not found:
        return ''
    angles = [degrees(blend.angle) for blend in found]
    lines = sum(blend.of_lines for blend in found)
    kinds = ((lines, 'line'), (len(found) - lines, 'joint move'))
    joined = ' and '.join(f'{count} of {kind}s' for count, kind in kinds if count)
    return (
        f'{plural(len(found), "blend")}: {joined}, at corners of {min(angles):.0f} to '
        f'{max(angles):.0f} degrees'
    )


def _left(blends: Iterable[FoundBlend]) -> str:
    return f'{1e6 * max((blend.off for blend in blends), default=0.0):.3g} um or urad'
