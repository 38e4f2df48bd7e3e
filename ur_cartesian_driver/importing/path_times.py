# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Times of the points of a file.

The times that readers collect count from the first point, whatever the clock of the file. The
first time of a goal is the duration of the motion to the first point; it is 0 only if the arm is
already there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ur_cartesian_driver.importing.import_options import ImportOptions
from ur_cartesian_driver.importing.imported_path import (
    ImportedPath,
    ImportNotes,
    TYPES_WITH_SPEED,
)
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.goal.goal_columns import rows_where

#: Shortest standstill [s] that becomes a dwell. A shorter one can be a slow tool that has not
#: moved by 5 um yet, so its time stays part of the motion.
_MIN_REST = 0.5
#: A step in time is a gap if it is longer than the first number [s], and longer than the second
#: number times the median step.
_MIN_GAP, _GAP = 1.0, 20.0


def with_times(
    path: ImportedPath, rests: Floats, options: ImportOptions, remarks: ImportNotes
) -> ImportedPath:
    """
    Return the path with times from the start of the goal; without times if they cannot be kept.

    :param rests: (n,) times [s] for which the tool stands still at the points.
    """
    if np.isnan(path.times).all():
        return path
    without = replace(path, times=np.full(len(path), np.nan))
    steps = np.diff(path.times)
    wrong = rows_where(~(steps > 0.0))[:1]
    why = ''
    has_speeds = np.isin(path.types, TYPES_WITH_SPEED).any()
    if options.speed is not None and not has_speeds:
        remarks.add(0, 'the option speed', 'left out, because joint motions have none')
    if options.speed is not None and has_speeds:
        why = 'left out, because the option speed replaces them'
    elif options.simplify:
        why = 'simplify merges points, whose times would no longer fit'
    elif path.is_rounded:
        why = 'a path with rounded corners has speeds in their place'
    elif wrong:
        line = int(path.lines[wrong[0] + 1])
        why = f'they do not rise at {f"line {line}" if line else f"point {wrong[0] + 1}"}'
    if why:
        remarks.add(0, 'the times of the points', why)
        return without
    if len(path) == 1 and not (options.approach_time or path.times[0]):
        return without
    first = path.times[0] if options.approach_time is None else options.approach_time
    times = path.times - path.times[0] + first
    begin, rests = rests[0], np.where(rests > _MIN_REST, rests, 0.0)
    steps -= rests[:-1]
    if first == 0.0:
        # The arm is already at the first point, so the motion begins at once.
        if rests[0]:
            remarks.add(0, f'a rest of {begin:.3g} s at the first point', 'it is left out')
        times[1:] -= begin
        rests[0] = 0.0
        remarks.add(
            0, 'the first point is at time 0', 'the arm has to be there; else give approach_time'
        )
    for row in rows_where(steps > np.maximum(_MIN_GAP, _GAP * np.median([*steps, 0.0]))):
        why = 'the motion to this point takes that long'
        remarks.add(int(path.lines[row + 1]), f'a gap of {steps[row]:.3g} s', why)
    return replace(path, times=times, dwells=np.where(rests > 0.0, rests, path.dwells))
