# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The report of a plan with rounded corners: pieces, corners, and where the tool is slow."""

from __future__ import annotations

import numpy as np

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.geometry.arrays import Floats, Int32s
from ur_cartesian_driver.motion.goal.goal_table import GoalTable, zeros
from ur_cartesian_driver.motion.plan.move_rows import SplineRows
from ur_cartesian_driver.motion.plan.plan import LateLines, PlannedRows
from ur_cartesian_driver.motion.plan.slow_stretch import SlowCause, SlowStretch
from ur_cartesian_driver.planning.rounded.rounded_planner import RoundedMotion
from ur_cartesian_driver.planning.rounded.section_law import SectionLaw

#: The requested speed counts as kept if the tool is slower by at most this fraction.
_KEPT = 0.01
#: The path reverses if the dot product of its unit directions before and after is below this.
_REVERSAL = -0.5


class RoundedReport:
    """
    The rows and lines of a plan with rounded corners.

    :param goal: the goal, expressed for the TCP with which it runs.
    """

    def __init__(self, goal: GoalTable, motion: RoundedMotion) -> None:
        """Store goal and motion."""
        self._goal, self._motion = goal, motion

    def segments(self) -> PlannedRows:
        """Return the pieces, each with the first point that is passed at its end or later."""
        motion, polynomials = self._motion, self._motion.polynomials
        path, ends = motion.path, polynomials.times[1:]
        durations = np.round(np.diff(polynomials.times), 6)
        waypoints = np.minimum(
            np.searchsorted(motion.point_times, ends - 1e-6), len(motion.point_times) - 1
        ).astype(np.int32)
        n = len(durations)
        return PlannedRows(
            waypoints=waypoints,
            lengths=np.diff(np.interp(polynomials.times, path.times, path.length)),
            angles=np.diff(np.interp(polynomials.times, path.times, path.angle)),
            durations=durations,
            blend_entries=zeros(n, 5),
            joints=polynomials.joints.x[1:],
            primitives=SplineRows(
                targets=polynomials.joints.x[1:],
                velocities=polynomials.joints.v[1:],
                accelerations=polynomials.joints.a[1:],
                durations=durations,
                quintic=np.ones(n, dtype=np.bool_),
            ),
            report_lines=LateLines(n, lambda: self._lines(waypoints)),
        )

    def _lines(self, waypoints: Int32s) -> list[str]:
        """Return the text of each piece: a line for each point that is passed on it, or ''."""
        motion = self._motion
        deviations = self.corner_deviations()
        passed = np.searchsorted(
            motion.polynomials.times[1:] + 1e-6, motion.point_times, side='left'
        )
        lines = [''] * len(waypoints)
        begin = 0.0
        for k, (row, time, deviation) in enumerate(
            zip(passed.tolist(), motion.point_times.tolist(), deviations.tolist(), strict=True)
        ):
            row = min(row, len(lines) - 1)
            how = (
                'stops there' if deviation < 0.0 else f'passes {1e3 * deviation:.3f} mm beside it'
            )
            line = f'point {k}: rounded, in {time - begin:.3f} s, {how}'
            lines[row] = f'{lines[row]}\n{line}' if lines[row] else line
            begin = time
        return lines

    def corner_deviations(self) -> Floats:
        """Return the distance (n,) [m] by which the tool misses each point; -1 = it stops."""
        found = np.full(len(self._motion.point_times), -1.0)
        for law in self._motion.laws:
            section = law.section
            found[section.segments[:-1]] = law.path.deviations(section.ends)[:-1, 0]
        return found

    def remarks(self) -> list[str]:
        """Return the remarks on the whole motion."""
        motion, polynomials = self._motion, self._motion.polynomials
        kept = self._kept_length()
        passed = self.corner_deviations()
        widest = float(passed.max(initial=-1.0))
        pieces = len(polynomials.piece)
        total = float(polynomials.times[-1])
        return [
            f'rounded corners: {100.0 * kept:.0f} % of the length at the speed that was asked, '
            f'within {100.0 * _KEPT:.0f} %'
            + (f'; points are passed within {1e3 * widest:.3f} mm' if widest >= 0.0 else ''),
            f'joints: {pieces} quintic pieces in {total:.3f} s ({pieces / total:.0f} a second), '
            f'which keep the tool within {1e3 * polynomials.distance:.3f} mm and '
            f'{polynomials.angle:.5f} rad of the rounded path',
            'assumed of the robot: speedj is followed within a step, the program steps in every '
            'cycle, a socket goes on after a pause; ur-cartesian check-robot --with-motion checks '
            'them (corner_*, steps_*, corner_pause); all else here is planned',
            motion.path.tightest_margins.remark,
        ]

    def _kept_length(self) -> float:
        """Return the fraction of the path length on which the tool has the requested speed."""
        kept = total = 0.0
        for law in self._motion.laws:
            speed, asked, step = _speeds(law)
            total += float(step.sum())
            kept += float(step[speed >= (1.0 - _KEPT) * asked].sum())
        return kept / total if total > 0.0 else 1.0

    def slow_stretches(self, slower_by: float) -> tuple[SlowStretch, ...]:
        """
        Return the stretches on which the tool is slower than requested.

        :param slower_by: a speed is too low if it is more than this fraction below the requested
            one.
        """
        laws = self._motion.laws
        return tuple(
            stretch
            for law in laws
            for stretch in _slow_stretches(
                law, slower_by, begins=law is laws[0], ends=law is laws[-1]
            )
        )


def _speeds(law: SectionLaw) -> tuple[Floats, Floats, Floats]:
    """Return, at each sample (m,), actual and requested tool speed [m/s] and step length [m]."""
    samples = law.samples
    rate = law.law.at(law.law.times_of(samples.s)).v
    length = np.linalg.norm(samples.x1, axis=1)
    step = np.gradient(samples.s) * length
    return rate * length, law.asked, step


def _slow_stretches(
    law: SectionLaw, slower_by: float, *, begins: bool, ends: bool
) -> list[SlowStretch]:
    speed, asked, _ = _speeds(law)
    slow = (speed < (1.0 - slower_by) * asked) & (np.linalg.norm(law.samples.x1, axis=1) > 1e-3)
    edges = np.flatnonzero(np.diff(slow, prepend=False, append=False))
    segments, fractions = law.section.locate(law.samples.s)
    found = []
    for begin, stop in edges.reshape(-1, 2).tolist():
        slowest = begin + int(np.argmin(speed[begin:stop] / asked[begin:stop]))
        # The corner of a place is at the nearer end of its segment.
        point = max(int(segments[slowest]) - bool(fractions[slowest] < 0.5), 0)
        cause, reason = _cause(law, begin, stop, point, begins=begins, ends=ends)
        found.append(
            SlowStretch(
                first=int(segments[begin]),
                first_fraction=float(fractions[begin]),
                last=int(segments[stop - 1]),
                last_fraction=float(fractions[stop - 1]),
                asked=float(asked[slowest]),
                lowest=float(max(speed[slowest], 0.0)),
                cause=cause,
                reason=reason,
                point=point,
            )
        )
    return found


def _cause(
    law: SectionLaw, begin: int, stop: int, point: int, *, begins: bool, ends: bool
) -> tuple[SlowCause, str]:
    directions = law.samples.x1[[max(begin - 1, 0), min(stop, len(law.samples.s) - 1)]]
    if directions[0] @ directions[1] < _REVERSAL * np.prod(np.linalg.norm(directions, axis=1)):
        return SlowCause.REVERSAL, f'the path reverses near point {point}'
    if begin == 0 and begins:
        return SlowCause.RAMP, 'the arm starts from rest'
    if stop == len(law.samples.s) and ends:
        return SlowCause.RAMP, 'the arm comes to rest'
    if begin == 0 or stop == len(law.samples.s):
        return SlowCause.STOP, f'the arm stops at point {point}'
    own = slice(begin, stop)
    lows = {name: float((cap[own]).min()) for name, cap in law.caps.items()}
    name = min(lows, key=lambda each: lows[each])
    if name in JOINT_NAMES:
        return SlowCause.JOINT_LIMIT, f'of the speed limit of {name}'
    if name == 'max_tool_speed':
        return SlowCause.TOOL_LIMIT, 'of max_tool_speed'
    what = {
        'corner': 'the acceleration across the path',
        'turn': 'the angular acceleration across the path',
        'jerk': 'max_linear_jerk',
    }.get(name, 'the acceleration')
    return SlowCause.CORNER, f'of {what} at the corner near point {point}'
