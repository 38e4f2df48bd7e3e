# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The report of a plan with rounded corners: pieces, corners, and where the tool is slow."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.geometry.arrays import Bytes, Floats, Singles
from ur_cartesian_driver.motion.geometry.pose_rows import length_rows
from ur_cartesian_driver.motion.plan.plan import PlannedRows
from ur_cartesian_driver.motion.plan.slow_stretch import SlowCause, SlowStretch
from ur_cartesian_driver.planning.rounded.programmed_path import SegmentEnds
from ur_cartesian_driver.planning.rounded.rounded_planner import RoundedMotion
from ur_cartesian_driver.planning.rounded.section_law import BENDS, HELD_PART, SectionLaw
from ur_cartesian_driver.planning.spline.joint_polynomials import piece_rows

#: The requested speed counts as kept if the tool is slower by at most this fraction.
_KEPT = 0.01
#: The path reverses if the dot product of its unit directions before and after is below this.
_REVERSAL = -0.5
#: Decimal places of speeds [m/s] that single precision has.
_DIGITS = 8


class RoundedReport:
    """
    The report of a plan with rounded corners.

    A plan is kept until its motion ends. So the report keeps only a few numbers for each place on
    the path, and texts are made when they are read.
    """

    def __init__(self, motion: RoundedMotion) -> None:
        """Measure the motion."""
        self._sections = [_SectionSpeeds.of(law) for law in motion.laws]
        self._point_times = motion.point_times
        self._piece_ends = motion.polynomials.times[1:]
        #: (n,) the distance [m] at which the tool passes each point; -1 = it stops there.
        self.corner_deviations = np.full(len(motion.point_times), -1.0)
        for law in motion.laws:
            section = law.section
            self.corner_deviations[section.segments[:-1]] = law.path.deviations(section.ends[:-1])[
                :, 0
            ]
        #: The remarks on the whole motion.
        self.remarks = self._remarks(motion)

    def lines(self) -> list[str]:
        """Return the text of each piece: a line for each point that is passed on it, or ''."""
        passed = np.searchsorted(self._piece_ends + 1e-6, self._point_times, side='left')
        lines = [''] * len(self._piece_ends)
        begin = 0.0
        for k, (row, time, deviation) in enumerate(
            zip(
                passed.tolist(),
                self._point_times.tolist(),
                self.corner_deviations.tolist(),
                strict=True,
            )
        ):
            row = min(row, len(lines) - 1)
            how = (
                'stops there' if deviation < 0.0 else f'passes {1e3 * deviation:.3f} mm beside it'
            )
            line = f'point {k}: rounded, in {time - begin:.3f} s, {how}'
            lines[row] = f'{lines[row]}\n{line}' if lines[row] else line
            begin = time
        return lines

    def _remarks(self, motion: RoundedMotion) -> list[str]:
        polynomials = motion.polynomials
        kept, total = np.sum([each.kept_length for each in self._sections], axis=0).tolist()
        widest = float(self.corner_deviations.max(initial=-1.0))
        pieces = len(polynomials.piece)
        duration = float(polynomials.times[-1])
        return [
            f'rounded corners: {100.0 * kept / total if total else 100.0:.0f} % of the length at '
            f'the speed that was asked, within {100.0 * _KEPT:.0f} %'
            + (f'; points are passed within {1e3 * widest:.3f} mm' if widest >= 0.0 else ''),
            f'joints: {pieces} quintic pieces in {duration:.3f} s ({pieces / duration:.0f} a '
            f'second), which keep the tool within {1e3 * polynomials.distance:.3f} mm and '
            f'{polynomials.angle:.5f} rad of the rounded path',
            'assumptions about the robot: it follows speedj within a step, runs its program in '
            'every cycle, and reads a socket again after a pause; ur-cartesian check-robot '
            '--with-motion checks them (corner_*, steps_*, corner_pause)',
            motion.path.tightest_margins.remark,
        ]

    def slow_stretches(self, slower_by: float) -> tuple[SlowStretch, ...]:
        """
        Return the stretches on which the tool is slower than requested.

        :param slower_by: a speed is too low if it is more than this fraction below the requested
            one.
        """
        last = len(self._sections) - 1
        return tuple(
            stretch
            for k, section in enumerate(self._sections)
            for stretch in section.slow_stretches(slower_by, begins=k == 0, ends=k == last)
        )


def planned_rows(motion: RoundedMotion, report: RoundedReport) -> PlannedRows:
    """Return the pieces as rows, each with the first point that is passed at its end or later."""
    polynomials = motion.polynomials
    waypoints = np.minimum(
        np.searchsorted(motion.point_times, polynomials.times[1:] - 1e-6),
        len(motion.point_times) - 1,
    )
    return piece_rows(motion.reference, polynomials, waypoints, lambda _: report.lines())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _SectionSpeeds:
    """The speed along a section at m places, and the limits there, in single precision."""

    ends: SegmentEnds
    s: Floats
    #: (m,) planned and requested speed of the tool [m/s].
    speed: Singles
    asked: Singles
    #: (m, 3) derivative of the position with respect to s.
    directions: Singles
    #: (m,) the greatest ds/dt that all limits allow, and the index in ``names`` of the lowest
    #: limit.
    cap: Singles
    limit: Bytes
    names: tuple[str, ...]
    #: The length of the path with the requested speed, and the whole length [m].
    kept_length: tuple[float, float]

    @classmethod
    def of(cls, law: SectionLaw) -> _SectionSpeeds:
        """Return the speeds of a law."""
        _, (place, rate, _) = law.law.table
        s, caps = law.samples.s, np.stack(list(law.caps.values()))
        limit, travel = np.argmin(caps, axis=0), length_rows(law.samples.x1)
        speed, step = np.interp(s, place, rate) * travel, np.gradient(s) * travel
        kept = float(step[speed >= (1.0 - _KEPT) * law.asked].sum())
        return cls(
            ends=SegmentEnds(segments=law.section.segments, ends=law.section.ends),
            s=s,
            speed=speed.astype(np.float32),
            asked=law.asked.astype(np.float32),
            directions=law.samples.x1.astype(np.float32),
            cap=caps[limit, np.arange(len(s))].astype(np.float32),
            limit=limit.astype(np.uint8),
            names=tuple(law.caps),
            kept_length=(kept, float(step.sum())),
        )

    def slow_stretches(self, slower_by: float, *, begins: bool, ends: bool) -> list[SlowStretch]:
        """
        Return the slow stretches of the section.

        :param begins: whether the motion begins with this section.
        :param ends: whether the motion ends with this section.
        """
        speed, asked = self.speed, self.asked
        moves = np.abs(self.directions).max(axis=1) > 1e-3
        slow = (speed < (1.0 - slower_by) * asked) & moves
        edges = np.flatnonzero(np.diff(slow, prepend=False, append=False))
        segments, fractions = self.ends.locate(self.s)
        found = []
        for begin, stop in edges.reshape(-1, 2).tolist():
            slowest = begin + int(np.argmin(speed[begin:stop] / asked[begin:stop]))
            # The corner that slows the tool is at the nearer end of the segment.
            point = max(int(segments[slowest]) - bool(fractions[slowest] < 0.5), 0)
            cause, reason = self._cause(begin, stop, point, begins=begins, ends=ends)
            found.append(
                SlowStretch(
                    first=int(segments[begin]),
                    first_fraction=float(fractions[begin]),
                    last=int(segments[stop - 1]),
                    last_fraction=float(fractions[stop - 1]),
                    asked=round(float(asked[slowest]), _DIGITS),
                    lowest=round(float(max(speed[slowest], 0.0)), _DIGITS),
                    cause=cause,
                    reason=reason,
                    point=point,
                )
            )
        return found

    def _cause(
        self, begin: int, stop: int, point: int, *, begins: bool, ends: bool
    ) -> tuple[SlowCause, str]:
        last = len(self.s)
        rows = [max(begin - 1, 0), min(stop, last - 1)]
        directions = self.directions[rows].astype(np.float64)
        if directions[0] @ directions[1] < _REVERSAL * np.prod(length_rows(directions)):
            return SlowCause.REVERSAL, f'the path reverses near point {point}'
        if begin == 0 and begins:
            return SlowCause.RAMP, 'the arm starts from rest'
        if stop == last and ends:
            return SlowCause.RAMP, 'the arm comes to rest'
        if begin == 0 or stop == last:
            return SlowCause.STOP, f'the arm stops at point {point}'
        name = self.names[self.limit[begin + int(np.argmin(self.cap[begin:stop]))]]
        if name in JOINT_NAMES:
            return SlowCause.JOINT_LIMIT, f'of the speed limit of {name}'
        if name.endswith(BENDS):
            joint = name.removesuffix(BENDS)
            return SlowCause.JOINT_LIMIT, f'of max_joint_acceleration of {joint}'
        if name == 'max_tool_speed':
            return SlowCause.TOOL_LIMIT, 'of max_tool_speed'
        if name == HELD_PART:
            return SlowCause.TOOL_LIMIT, 'of max_tool_speed, which the held part reaches in base'
        what = {
            'corner': 'the acceleration across the path',
            'turn': 'the angular acceleration across the path',
            'jerk': 'max_linear_jerk',
        }.get(name, 'the acceleration')
        return SlowCause.CORNER, f'of {what} at the corner near point {point}'
