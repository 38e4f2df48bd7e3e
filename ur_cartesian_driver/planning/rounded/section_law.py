# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The time law of a rounded path: speed, acceleration and jerk of the tool, and of each joint.

Limits are evaluated at places a fraction of a corner's width apart. The law is found twice: once
to know how far the window of its average reaches, then with speeds lowered over that window.
Averaging mixes accelerations of neighbouring places, so the result is measured, and limits are
tightened around the places where one is exceeded until none is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import inf

import numpy as np

from ur_cartesian_driver.kinematics.differential_kinematics import joint_rates
from ur_cartesian_driver.kinematics.inverse_rows import solve_path
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices
from ur_cartesian_driver.motion.geometry.pose_rows import (
    compose_rows,
    conjugate_rows,
    multiply_rows,
    normalized_rows,
)
from ur_cartesian_driver.motion.geometry.vectors import Joints
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.rounded.programmed_path import ProgrammedSection
from ur_cartesian_driver.planning.rounded.rounded_path import PathRows, RoundedPath
from ur_cartesian_driver.planning.rounded.time_law import (
    fastest_law,
    LawLimits,
    lowered_over,
    TimeLaw,
)

#: Places per width of a corner, and the distance of places where nothing is rounded [m].
_DENSITY = 1.0 / 4.0
_SPACING = 0.002
#: The window of the average [s]: long enough for the acceleration to be continuous on the wire.
_MIN_WINDOW = 0.02
#: The part of the limits of acceleration that the law aims at, for what averaging adds.
_AIM = 0.985
#: How often limits are tightened; the power of the excess by which they are, a smaller one where
#: the excess is far from 1, because jerk grows with a higher power of the speed; an extra factor;
#: and the excess that is close enough.
_ROUNDS = 8
_FAR, _LESS, _MORE, _EXTRA = 2.0, 0.6, 1.5, 1.01
CLOSE = 1.01
#: Samples while the window of the average passes a place at which limits change.
_AROUND = 13
#: Times before and after a sample between which its jerk is measured [s].
_JERK_STEP = 0.002
_TINY = 1e-12
_NEARLY = 1e-10


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ToolLimits:
    """What the segments (k,) of a section ask of the tool, and its largest jerk [m/s^3]."""

    speeds: Floats
    turn_rates: Floats
    accelerations: Floats
    turn_accelerations: Floats
    jerk: float

    def at(self, *rows: Indices) -> ToolLimits:
        """Return the least limits of some segments in each row (m,)."""
        return replace(
            self,
            **{
                name: np.minimum.reduce([getattr(self, name)[each] for each in rows])
                for name in ('speeds', 'turn_rates', 'accelerations', 'turn_accelerations')
            },
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CurveSamples:
    """A rounded path at m places: derivatives by s of the tool in base, and of the joints."""

    s: Floats
    poses: Floats
    #: (m, 3) each, of the position.
    x1: Floats
    x2: Floats
    x3: Floats
    #: (m, 3) angular velocity by s, and its derivative.
    w1: Floats
    w2: Floats
    #: (m, 6) each; empty where the arm cannot follow, which the plan's own check will say.
    q: Floats
    q1: Floats
    q2: Floats

    @property
    def turns(self) -> bool:
        """Whether the tool turns anywhere."""
        return bool(self.w1.any() or self.w2.any())


def sample_curve(
    path: RoundedPath, s: Floats, kinematics: TcpKinematics, q_start: Joints
) -> CurveSamples:
    """Return a path at places (m,)."""
    rows = path.rows(s)
    poses, w1, w2 = tool_rows(rows)
    x1, x2, x3 = rows.d1[:, :3], rows.d2[:, :3], rows.d3[:, :3]
    solved = solve_path(
        kinematics.arm, compose_rows(poses, kinematics.T_tcp_flange), q_start, skip_gaps=False
    )
    q = solved.q
    if solved.found.all():
        q1, q2 = joint_rates(
            kinematics.arm,
            kinematics.T_flange_tcp,
            q,
            np.concatenate([x1, w1], axis=1),
            np.concatenate([x2, w2], axis=1),
        )
    else:
        q = q1 = q2 = np.empty((len(s), 0))
    return CurveSamples(s=s, poses=poses, x1=x1, x2=x2, x3=x3, w1=w1, w2=w2, q=q, q1=q1, q2=q2)


def tool_rows(rows: PathRows) -> tuple[Floats, Floats, Floats]:
    """Return poses (m, 7), and the angular velocity by s and its derivative (m, 3) in base."""
    quaternions = rows.x[:, 3:]
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

    :param q_start: the configuration at its beginning [rad].
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
        self.samples = sample_curve(path, places(path, section.ends), kinematics, q_start)
        row = self._rows(self.samples.s)
        #: At each place; where segments meet, the lower ones, because a step begins there.
        after = np.minimum(row + np.isin(self.samples.s, section.ends), len(section.ends) - 1)
        self._limits_at = tool.at(row, after)
        self._tool, self._options, self._model = tool, options, kinematics.arm.model
        self.window = max(_MIN_WINDOW, 2.0 * float(tool.accelerations.max()) / tool.jerk)
        #: What bounds ds/dt at each place, by name (m,).
        self.caps = self._caps()
        m = len(self.samples.s)
        #: By how much limits are tightened at each place, for lack of agreement after averaging.
        self._tightened = np.ones(m)
        self.law = self._fitted()

    @property
    def duration(self) -> float:
        """From rest to rest [s]."""
        return self.law.duration

    @property
    def asked(self) -> Floats:
        """The speed of the tool that the segments ask for at each place (m,) [m/s]."""
        return self._limits_at.speeds

    def acceleration_bounds(self, t: Floats) -> tuple[Floats, Floats]:
        """Return the largest accelerations of the tool at times (m,) [m/s^2], [rad/s^2]."""
        row = self._rows(self.law.at(t).s)
        return self._tool.accelerations[row], self._tool.turn_accelerations[row]

    def _rows(self, s: Floats) -> Indices:
        """Return the rows of the tool's limits at places (m,)."""
        segments, _ = self.section.locate(s)
        rows: Indices = segments - self.section.segments[0]
        return rows

    def slow_around(self, times: Floats, factor: float) -> None:
        """
        Find another law that is slower at times.

        :param times: (k, 2) begin and end, since the beginning [s].
        :param factor: by which accelerations have to fall there.
        """
        before = self.law.times
        inside = np.zeros(len(self.samples.s), dtype=np.bool_)
        for begin, end in times.tolist():
            inside |= (before >= begin - 2.0 * self.window) & (before <= end + self.window)
        if inside.any():
            self._tightened[inside] *= factor
            self.law = self._fitted()

    def _caps(self) -> dict[str, Floats]:
        samples, tool, options = self.samples, self._limits_at, self._options
        speed = np.maximum(np.linalg.norm(samples.x1, axis=1), _TINY)
        turn = np.maximum(np.linalg.norm(samples.w1, axis=1), _TINY)
        caps = {
            'speed': np.minimum(tool.speeds / speed, tool.turn_rates / turn),
            'max_tool_speed': (options.max_tool_speed or inf) / speed,
            'jerk': np.cbrt(tool.jerk / np.maximum(np.linalg.norm(samples.x3, axis=1), _TINY)),
            'corner': _corner_speed(samples.x1, samples.x2, tool.accelerations),
            'turn': _corner_speed(samples.w1, samples.w2, tool.turn_accelerations),
        }
        for k in range(samples.q1.shape[1]):
            limit = self._model.max_joint_speed[k]
            caps[JOINT_NAMES[k]] = limit / np.maximum(np.abs(samples.q1[:, k]), _TINY)
        return caps

    def _limits(self) -> LawLimits:
        samples, tool = self.samples, self._limits_at
        bound = _AIM / self._tightened
        return LawLimits(
            speed=np.minimum.reduce(list(self.caps.values())),
            first=samples.q1,
            second=samples.q2,
            bound=self._options.max_joint_acceleration
            * bound[:, None]
            * np.ones(samples.q1.shape),
            vectors=(
                (samples.x1, samples.x2, tool.accelerations * bound),
                *[(samples.w1, samples.w2, tool.turn_accelerations * bound)] * samples.turns,
            ),
        )

    def _fitted(self) -> TimeLaw:
        s, limits = self.samples.s, self._limits()
        first = TimeLaw(s, fastest_law(s, limits), self.window)
        reach = 0.5 * self.window
        for _ in range(_ROUNDS):
            limits = self._limits()
            slowed = limits.speed / np.sqrt(self._tightened)
            limits = replace(limits, speed=lowered_over(slowed, first.times, reach))
            law = TimeLaw(s, fastest_law(s, limits), self.window)
            excess = self.excess(law)
            if excess.max() <= CLOSE:
                break
            wide = -lowered_over(-excess, law.times, self.window)
            more = np.where(wide > _FAR, wide**_LESS, wide**_MORE)
            self._tightened *= np.where(wide > CLOSE, more * _EXTRA, 1.0)
        return law

    def _measured_times(self, law: TimeLaw) -> Floats:
        """Return times near which each place is passed, closer together where limits change."""
        tool = self._tool
        changes = np.flatnonzero(
            (np.diff(tool.accelerations) != 0.0) | (np.diff(tool.turn_accelerations) != 0.0)
        )
        passed = np.interp(self.section.ends[changes], self.samples.s, law.times)
        around = passed[:, None] + self.window * np.linspace(0.0, 1.5, _AROUND)
        return np.sort(np.concatenate([law.sampled_times, around.ravel()]))

    def excess(self, law: TimeLaw) -> Floats:
        """Return the largest measured value at each place, as a part of its limit (m,)."""
        samples, tool, options = self.samples, self._tool, self._options
        t = self._measured_times(law)
        s, v, a = law.at(t)
        at = np.clip(np.searchsorted(samples.s, s, side='right') - 1, 0, len(samples.s) - 2)
        part = ((s - samples.s[at]) / (samples.s[at + 1] - samples.s[at]))[:, None]
        row = self._rows(s)

        def rows(values: Floats) -> Floats:
            found: Floats = values[at] + part * (values[at + 1] - values[at])
            return found

        v, a = v[:, None], a[:, None]
        x1, x2 = rows(samples.x1), rows(samples.x2)
        _, _, before = law.at(t - _JERK_STEP)
        _, _, after = law.at(t + _JERK_STEP)
        jerk = ((after - before) / (2.0 * _JERK_STEP))[:, None]
        values = [
            np.linalg.norm(x1 * a + x2 * v * v, axis=1) / tool.accelerations[row],
            np.linalg.norm(rows(samples.w1) * a + rows(samples.w2) * v * v, axis=1)
            / tool.turn_accelerations[row],
            np.linalg.norm(x1 * jerk + 3.0 * x2 * v * a + rows(samples.x3) * v**3, axis=1)
            / tool.jerk,
        ]
        if samples.q1.shape[1]:
            qdd = rows(samples.q1) * a + rows(samples.q2) * v * v
            values.append(np.abs(qdd).max(axis=1) / options.max_joint_acceleration)
        worst = np.maximum.reduce(values)
        excess = np.zeros(len(samples.s))
        np.maximum.at(excess, at, worst)
        np.maximum.at(excess, at + 1, worst)
        return excess


def places(path: RoundedPath, ends: Floats) -> Floats:
    """
    Return the places at which a path is sampled, denser where it is curved.

    :param ends: places that are among them.
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
    # The sharpest curvature is in the middle of a corner.
    every = np.unique(np.concatenate([found, ends, path.sharp_corners()]))
    # Places that nearly coincide make steps of rounding errors.
    apart = np.append(True, np.diff(every) > _NEARLY)
    apart |= np.isin(every, ends)
    kept: Floats = every[apart]
    return kept


def _corner_speed(first: Floats, second: Floats, bound: Floats) -> Floats:
    """Return ds/dt (m,) at which the acceleration across the path is all that is allowed."""
    square = np.maximum(np.einsum('ij,ij->i', first, first), _TINY)
    across = second - (np.einsum('ij,ij->i', first, second) / square)[:, None] * first
    speed: Floats = np.sqrt(bound / np.maximum(np.linalg.norm(across, axis=1), _TINY))
    return speed
