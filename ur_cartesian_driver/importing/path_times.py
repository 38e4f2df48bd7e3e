# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Times of the points of a file.

They come from any clock: seconds since the robot was switched on, Unix times. In a goal the first
one is the time for the way to the first point, which is 0 only where the arm stands already.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ur_cartesian_driver.importing.import_options import ImportOptions
from ur_cartesian_driver.importing.imported_path import ImportedPath, ImportNotes
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.goal.goal_table import rows_where

#: A tool that stands for so long rests [s]; shorter, it may be slow: it has 5 um to go.
_MIN_REST = 0.5
#: A step in time that is as long as this [s], and so many times the median, is a gap.
_MIN_GAP, _GAP = 1.0, 20.0


def with_times(
    path: ImportedPath, rests: Floats, options: ImportOptions, remarks: ImportNotes
) -> ImportedPath:
    """
    Keep times that rise, unless there are speeds.

    :param rests: (n,) how long the tool stands at its points by these times [s].
    """
    if np.isnan(path.times).all():
        return path
    without = replace(path, times=np.full(len(path), np.nan))
    steps = np.diff(path.times)
    wrong = rows_where(~(steps > 0.0))[:1]
    why = ''
    if options.speed is not None:
        why = 'a speed is given'
    elif options.simplify:
        why = 'simplify merges points, whose times would no longer fit'
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
        # Nothing leads to a point where the arm stands already: the motion begins at once.
        if rests[0]:
            remarks.add(0, f'a rest of {begin:.3g} s at the first point', 'it is left out')
        times[1:] -= begin
        rests[0] = 0.0
        remarks.add(
            0, 'the first point is at time 0', 'the arm has to be there; else give approach_time'
        )
    for row in rows_where(steps > np.maximum(_MIN_GAP, _GAP * np.median([*steps, 0.0]))):
        why = 'the motion there takes as long'
        remarks.add(int(path.lines[row + 1]), f'a gap of {steps[row]:.3g} s', why)
    return replace(path, times=times, dwells=np.where(rests > 0.0, rests, path.dwells))
