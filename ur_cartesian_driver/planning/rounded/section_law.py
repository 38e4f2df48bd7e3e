# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The time law of a section of a rounded path, within the limits of tool and joints.

The law is the fastest law, averaged over a window of time to bound its jerk (:mod:`~.time_law`).
Limits are evaluated at places that are a fraction of a corner's width apart. A first law gives the
time of each place, and so the places within the averaging window around it. For the next law, each
speed limit is lowered to the least limit in the window. Averaging mixes accelerations of
neighbouring places, so accelerations may still exceed their limits. They are measured, and limits
are tightened around places where one is exceeded, until all limits are kept or the greatest number
of rounds is reached.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf, sqrt

import numpy as np

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.pose_rows import (
    conjugate_rows,
    length_rows,
    multiply_rows,
    normalized_rows,
)
from ur_cartesian_driver.motion.geometry.vectors import Joints
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.rounded.joint_derivatives import joint_derivatives, Peaks
from ur_cartesian_driver.planning.rounded.programmed_path import ProgrammedSection
from ur_cartesian_driver.planning.rounded.rounded_path import PathRows, RoundedPath
from ur_cartesian_driver.planning.rounded.time_law import (
    FastestLaw,
    LawLimits,
    lowered_over,
    PathTimes,
    TimeLaw,
)

#: Distance between places at a corner, as a fraction of the corner's width.
_DENSITY = 1.0 / 4.0
#: Distance between places where nothing is rounded [m].
_SPACING = 0.002
#: Shortest averaging window [s]: long enough for the acceleration to be continuous on the wire.
_MIN_WINDOW = 0.02
#: The acceleration along the path is at most sqrt(_RAMP_PART * speed limit * jerk limit).
_RAMP_PART = 0.35
#: Fraction of the acceleration limits at which the law aims, because averaging adds a little.
_AIM = 0.975
#: Greatest number of rounds in which limits are tightened.
_ROUNDS = 8
#: In a round, a limit that is exceeded by the factor e is divided by _EXTRA e^_MORE; by _EXTRA
#: e^_LESS if e is above _FAR, because a jerk grows with a higher power of the speed.
_FAR, _LESS, _MORE, _EXTRA = 2.0, 0.6, 1.5, 1.01
#: Factor by which speeds may exceed their limits between places.
_SPEED_MARGIN = 1.005
#: Number of samples while the averaging window passes a place at which limits change.
_AROUND = 13
#: Time between two :attr:`SectionLaw.anchors` [s].
_ANCHOR_TIME = 2.0
#: Factor by which limits of acceleration are divided where the law has to be slower.
_SLOWER = 1.5
#: The jerk at a time is measured from this long before to this long after it [s].
_JERK_STEP = 0.002
#: Number of times that are measured at once, so that the intermediate arrays stay in the cache.
_BLOCK = 8192
#: Names of two limits for paths on a held part: max_tool_speed for the TCP in base; and, after the
#: name of a joint, max_joint_acceleration of this joint at a constant speed along the path.
HELD_PART, BENDS = 'held part', ' bends'
_TINY = 1e-12
_NEARLY = 1e-10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ToolLimits:
    """The limits of the tool (k,), for k segments or places, in SI units; one limit of jerk."""

    speeds: Floats
    turn_rates: Floats
    accelerations: Floats
    turn_accelerations: Floats
    jerk: float

    def at(self, *rows: Indices) -> ToolLimits:
        """
        Return the limits at m places, each the least of several limits.

        :param rows: arrays (m,) with the indices of these limits.
        """
        return replace(
            self,
            **{
                name: np.minimum.reduce([getattr(self, name)[each] for each in rows])
                for name in ('speeds', 'turn_rates', 'accelerations', 'turn_accelerations')
            },
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CurveSamples:
    """Derivatives of the tool with respect to s, in the frame of the path, at m places."""

    s: Floats
    #: (m, 3) first derivative of the position.
    x1: Floats
    #: (m, 3) second derivative of the position.
    x2: Floats
    #: (m, 3) third derivative of the position.
    x3: Floats
    #: (m, 3) turn of the tool per unit of s.
    w1: Floats
    #: (m, 3) derivative of ``w1``.
    w2: Floats

    @property
    def turns(self) -> bool:
        """Whether the tool turns anywhere."""
        return bool(self.w1.any() or self.w2.any())


def tool_rows(rows: PathRows) -> tuple[Floats, Floats, Floats]:
    """Return poses (m, 7), turns per unit of s (m, 3) and derivatives of the turns (m, 3)."""
    quaternions = rows.x[:, 3:]
    if not rows.d1[:, 3:].any() and not rows.d2[:, 3:].any():
        none = np.zeros((len(quaternions), 3))
        return rows.x, none, none
    inverse = (
        conjugate_rows(quaternions) / np.einsum('ij,ij->i', quaternions, quaternions)[:, None]
    )
    first = multiply_rows(rows.d1[:, 3:], inverse)
    second = multiply_rows(rows.d2[:, 3:], inverse)
    poses = np.concatenate([rows.x[:, :3], normalized_rows(quaternions)], axis=1)
    w2 = 2.0 * (second[:, :3] - 2.0 * first[:, 3:] * first[:, :3])
    return poses, 2.0 * first[:, :3], w2


class SectionLaw:
    """
    The rounded path of a section over time.

    :param tool: the limits of the tool, a row for each segment of the section.
    :param q_start: the configuration at the beginning of the section [rad].
    """

    def __init__(
        self,
        section: ProgrammedSection,
        path: RoundedPath,
        tool: ToolLimits,
        kinematics: TcpKinematics,
        q_start: Joints,
        options: PlanningOptions,
    ) -> None:
        """Find the time law."""
        self.section, self.path = section, path
        s = places(path, section.ends)
        rows = path.rows(s)
        poses, w1, w2 = tool_rows(rows)
        x1, x2, x3 = (each[:, :3].copy() for each in rows[1:])
        self.samples = CurveSamples(s=s, x1=x1, x2=x2, x3=x3, w1=w1, w2=w2)
        row = self._rows(s)
        #: (m - 1,) the rows of the tool's limits between places.
        self._rows_between = row[1:]
        # At the end of a segment, the lower limits of this and the next segment apply, because the
        # step after this place is in the next segment.
        after = np.minimum(row + np.isin(s, section.ends), len(section.ends) - 1)
        self._limits_at = tool.at(row, after)
        self._tool, self._options, self._model = tool, options, kinematics.arm.model
        # More acceleration along the path needs a longer window for its jerk. A ramp to the speed
        # v takes v / a + 2 a / j, which is least at a^2 = v j / 2. Ramps at corners are shorter
        # and favour a smaller a, hence the smaller part.
        self._ramp = min(
            float(tool.accelerations.max()),
            sqrt(_RAMP_PART * float(tool.speeds.max()) * tool.jerk),
        )
        self.window = max(_MIN_WINDOW, 2.0 * self._ramp / tool.jerk)
        #: For each limit by its name: the greatest ds/dt (m,) that it allows at the places.
        self.caps = self._tool_caps()
        derivatives = np.concatenate([x1, w1], axis=1), np.concatenate([x2, w2], axis=1)
        self._joints = joint_derivatives(
            kinematics, q_start, s, poses, derivatives, self._tool_peaks(), options
        )
        #: The configuration at the end of the section [rad].
        self.q_end = self._joints.end or q_start
        self.caps |= self._joint_caps()
        self._speed = np.minimum.reduce(list(self.caps.values()))
        self._fastest = FastestLaw(s, self._limits())
        #: (m,) divisor of the limits of acceleration at each place, above 1 where they had to be
        #: tightened.
        self._tightened = np.ones(len(s))
        #: The squares (m,) of ds/dt of the last law, and its :meth:`excess` (m,).
        self._measured = np.full(len(s), np.nan), np.zeros(len(s))
        self.law = self._fitted()
        #: Places, about :data:`_ANCHOR_TIME` apart, that are knots (see :mod:`~.tool_knots`).
        last = self.duration - 0.5 * _ANCHOR_TIME
        self.anchors = self.law.at(np.arange(_ANCHOR_TIME, last, _ANCHOR_TIME)).s

    @property
    def duration(self) -> float:
        """The time from rest to rest [s]."""
        return self.law.duration

    @property
    def asked(self) -> Floats:
        """The requested speed of the tool at each place (m,) [m/s]."""
        return self._limits_at.speeds

    @property
    def jerk(self) -> float:
        """The limit of the tool's jerk [m/s^3]."""
        return self._tool.jerk

    def acceleration_limits(self, s: Floats) -> tuple[Floats, Floats]:
        """Return the limits of the tool's acceleration at places (m,) [m/s^2], [rad/s^2]."""
        row = self._rows(s)
        return self._tool.accelerations[row], self._tool.turn_accelerations[row]

    def _rows(self, s: Floats) -> Indices:
        """Return the rows (m,) of the tool's limits for places (m,)."""
        rows: Indices = np.searchsorted(self.section.ends, s, side='left')
        return np.minimum(rows, len(self.section.ends) - 1)

    def slow_around(self, times: Floats) -> None:
        """
        Replace the law by one that is slower in some periods.

        :param times: (k, 2) both ends of each period, since the beginning of the section [s].
        """
        before = self.law.times
        inside = np.zeros(len(self.samples.s), dtype=np.bool_)
        for begin, end in times.tolist():
            inside |= (before >= begin - 2.0 * self.window) & (before <= end + self.window)
        if inside.any():
            self._tightened[inside] *= _SLOWER
            self.law = self._fitted()

    def _tool_caps(self) -> dict[str, Floats]:
        samples, tool, options = self.samples, self._limits_at, self._options
        speed = np.maximum(length_rows(samples.x1), _TINY)
        turn = np.maximum(length_rows(samples.w1), _TINY)
        return {
            'speed': np.minimum(tool.speeds / speed, tool.turn_rates / turn),
            'max_tool_speed': (options.max_tool_speed or inf) / speed,
            'jerk': np.cbrt(tool.jerk / np.maximum(length_rows(samples.x3), _TINY)),
            'corner': _corner_speed(samples.x1, samples.x2, tool.accelerations),
            'turn': _corner_speed(samples.w1, samples.w2, tool.turn_accelerations),
        }

    def _tool_peaks(self) -> Peaks:
        samples, fastest = self.samples, np.minimum.reduce(list(self.caps.values()))
        travel, turn = length_rows(samples.x1), length_rows(samples.w1)
        along = turn * self._ramp / np.maximum(travel, _TINY)
        across = length_rows(samples.w2) * fastest**2
        turns = np.minimum(along + across, self._limits_at.turn_accelerations)
        return (
            (float((travel * fastest).max()), float((turn * fastest).max())),
            (float(self._tool.accelerations.max()), float(turns.max())),
        )

    def _joint_caps(self) -> dict[str, Floats]:
        joints, options = self._joints, self._options
        caps = {
            JOINT_NAMES[k]: self._model.max_joint_speed[k] / np.maximum(np.abs(column), _TINY)
            for k, column in enumerate(joints.q1.T)
        }
        if joints.carrier is not None:
            # While the tool moves slowly around an edge of the part, the part may move fast.
            bound = options.max_tool_speed or inf
            caps[HELD_PART] = bound / np.maximum(joints.carrier, _TINY)
            for name, column in zip(JOINT_NAMES, joints.q2.T, strict=True):
                bend = np.maximum(np.abs(column), _TINY)
                caps[name + BENDS] = np.sqrt(options.max_joint_acceleration / bend)
        return caps

    def _limits(self) -> LawLimits:
        samples, tool, joints = self.samples, self._limits_at, self._joints
        travel = length_rows(samples.x1)
        return LawLimits(
            speed=self._speed,
            # The acceleration along the path is one more column after the joints.
            first=np.column_stack([joints.q1, travel]),
            second=np.column_stack([joints.q2, np.zeros(len(travel))]),
            bound=np.column_stack(
                [
                    np.full(joints.q1.shape, self._options.max_joint_acceleration),
                    np.full(len(travel), self._ramp),
                ]
            ),
            vectors=(
                (samples.x1, samples.x2, tool.accelerations),
                *[(samples.w1, samples.w2, tool.turn_accelerations)] * samples.turns,
            ),
        )

    def _fitted(self) -> TimeLaw:
        s, window = self.samples.s, self.window

        def squares(speed: Floats) -> Floats:
            return self._fastest.squares(speed, _AIM / self._tightened)

        first = TimeLaw(s, squares(self._speed), window)
        y, excess = self._measured
        for _ in range(_ROUNDS):
            slowed = self._speed / np.sqrt(self._tightened)
            before, y = y, squares(lowered_over(slowed, first.times, 0.5 * window))
            found = TimeLaw(s, y, window)
            # The law is measured again only near places where it has changed. Elsewhere it is the
            # same, only shifted in time.
            changed = np.where(y == before, 0.0, 1.0)
            again = _largest_around(changed, found.times, 2.0 * window) > 0.0
            excess[again] = self.excess(found, again)[again]
            self._measured = y, excess
            if excess.max() <= 1.0:
                break
            wide = _largest_around(excess, found.times, window)
            more = np.where(wide > _FAR, wide**_LESS, wide**_MORE)
            self._tightened *= np.where(wide > 1.0, more * _EXTRA, 1.0)
        return found

    def _measured_times(self, law: TimeLaw, at: Flags) -> Floats:
        """Return times near which the law passes flagged places, denser where limits change."""
        tool = self._tool
        changes = np.flatnonzero(
            (np.diff(tool.accelerations) != 0.0) | (np.diff(tool.turn_accelerations) != 0.0)
        )
        times = law.sampled_times(at)
        if not len(changes):
            return times
        passed = np.interp(self.section.ends[changes], self.samples.s, law.times)
        around = passed[:, None] + self.window * np.linspace(0.0, 1.5, _AROUND)
        return np.sort(np.concatenate([times, around.ravel()]))

    def excess(self, law: TimeLaw, at: Flags) -> Floats:
        """
        Return the greatest ratio, at each place (m,), of a measured quantity to its limit.

        :param at: (m,) flags of the places at which the law is measured; their neighbours are
            included.
        """
        s, excess = self.samples.s, np.zeros(len(self.samples.s))
        times = self._measured_times(law, at)
        for begin in range(0, len(times), _BLOCK):
            t = times[begin : begin + _BLOCK]
            places = law.at(t)
            row = np.clip(np.searchsorted(s, places.s, side='right') - 1, 0, len(s) - 2)
            jerk = law.accelerations(t + _JERK_STEP) - law.accelerations(t - _JERK_STEP)
            worst = self._excess_at(places, jerk / (2.0 * _JERK_STEP), row)
            np.maximum.at(excess, row, worst)
            np.maximum.at(excess, row + 1, worst)
        return excess

    def _excess_at(self, law: PathTimes, jerk: Floats, at: Indices) -> Floats:
        """
        Return the greatest ratio (b,) of a quantity to its limit at b times.

        :param law: the law at these times; ``jerk``: (b,) its third derivative there.
        :param at: (b,) the numbers of the places before these times.
        """
        samples, tool, joints = self.samples, self._tool, self._joints
        part = ((law.s - samples.s[at]) / (samples.s[at + 1] - samples.s[at]))[:, None]
        row = self._rows_between[at]

        def rows(values: Floats) -> Floats:
            found: Floats = values[at]
            return found + part * (values[at + 1] - found)

        v, a, jerk = law.v[:, None], law.a[:, None], jerk[:, None]
        square = v * v
        x1, x2 = rows(samples.x1), rows(samples.x2)
        values = [
            length_rows(x1 * a + x2 * square) / tool.accelerations[row],
            length_rows(x1 * jerk + x2 * (3.0 * v * a) + rows(samples.x3) * (square * v))
            / tool.jerk,
            # Speed limits apply at the places; between them, speeds may be a little higher.
            length_rows(x1) * law.v / (_SPEED_MARGIN * tool.speeds[row]),
        ]
        if samples.turns:
            turn = length_rows(rows(samples.w1) * a + rows(samples.w2) * square)
            values.append(turn / tool.turn_accelerations[row])
        if joints.q1.shape[1]:
            q1 = rows(joints.q1)
            qdd = q1 * a + rows(joints.q2) * square
            values.append(np.abs(qdd).max(axis=1) / self._options.max_joint_acceleration)
            speeds = np.abs(q1 * v) / (_SPEED_MARGIN * np.array(self._model.max_joint_speed))
            values.append(speeds.max(axis=1))
        worst: Floats = np.maximum.reduce(values)
        return worst


def _largest_around(values: Floats, times: Floats, reach: float) -> Floats:
    """Return, for each time (m,), the greatest value (m,) within ``reach`` [s] of it."""
    return -lowered_over(-values, times, reach)


def places(path: RoundedPath, ends: Floats) -> Floats:
    """
    Return the places at which a path is sampled, denser where it is curved.

    :param ends: places that are always included.
    """
    s = path.polyline.s
    edges = np.concatenate([s[path.corners] - path.widths, s[path.corners] + path.widths])
    marks = np.unique(np.concatenate([s, edges]))
    marks = marks[(marks >= s[0]) & (marks <= s[-1])]
    density = np.concatenate(
        [[0.0], np.cumsum(np.diff(marks) / path.spacing(marks, _DENSITY, _SPACING))]
    )
    count = max(16, int(np.ceil(density[-1])))
    found = np.interp(np.linspace(0.0, density[-1], count + 1), density, marks)
    # The middles of corners are included, because curvature is greatest there.
    every = np.unique(np.concatenate([found, ends, path.sharp_corners()]))
    # Of places that nearly coincide, one is kept: steps between them would be rounding errors.
    apart = np.append(True, np.diff(every) > _NEARLY)
    apart |= np.isin(every, ends)
    kept: Floats = every[apart]
    return kept


def _corner_speed(first: Floats, second: Floats, bound: Floats) -> Floats:
    """Return the ds/dt (m,) at which the acceleration across the path reaches ``bound``."""
    square = np.maximum(np.einsum('ij,ij->i', first, first), _TINY)
    across = second - (np.einsum('ij,ij->i', first, second) / square)[:, None] * first
    speed: Floats = np.sqrt(bound / np.maximum(length_rows(across), _TINY))
    return speed
