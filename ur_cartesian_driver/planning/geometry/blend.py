# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Blends: the transition from one curve into the next that rounds the waypoint between them.

UR publishes the radius within which a blend stays, and its shape only for ``movep`` (a circular
fillet). The other blends are modelled as a crossfade of the two motions: the first slows down
evenly while the second speeds up evenly, which between straight lines is a parabola. Between two
joint moves this happens in joint space, else in Cartesian space.

Goals of ten thousand blended points are usual, so blends are made and sampled many at a time.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.motion.pose import N, Pose, pose_from_row
from ur_cartesian_driver.motion.pose_rows import (
    angle_rows,
    conjugate_rows,
    Floats,
    interpolate_rows,
    multiply_rows,
    normalized_rows,
)
from ur_cartesian_driver.planning.geometry.curves import (
    ARC_CHORD_ERROR,
    Curve,
    CURVE_CHORD_ERROR,
    JointLineCurve,
    LineCurve,
    MAX_TURN_PER_SAMPLE,
    SegmentCurve,
    tcp_rows,
    trim_end,
)

# Chords that measure the length of a blend without a formula.
_CHORDS = 16
# Segments that continue straight on, or straight back, have no circle between them [rad].
_STRAIGHT = 1e-6


@dataclass(frozen=True, slots=True)
class BlendInput:
    """Two curves that meet, and the blend to make there."""

    first: SegmentCurve
    second: SegmentCurve
    #: Distance from the waypoint at which both curves are left [m].
    radius: float
    #: A circular arc (``movep``); both curves must be lines.
    fillet: bool


@dataclass(frozen=True, slots=True)
class Blend:
    """
    The blend between two curves, over ``s`` in [0, 1].

    ``leave`` is where it leaves the first curve, ``join`` where it joins the second (their ``u``).
    """

    first: SegmentCurve
    second: SegmentCurve
    radius: float
    fillet: bool
    leave: float
    join: float
    #: Length [m], and turn of the tool [rad].
    length: float
    angle: float
    #: Number of chords that follow it closely enough.
    samples: int
    #: How far the robot's own blend may lie beside this one [m], [rad]. It may come as close to
    #: the waypoint as it likes, or cut across straight: this one is half-way between. The turn
    #: of the tool may run ahead of its position, or behind it.
    blend_tolerance: tuple[float, float]
    can_start_at_rest: ClassVar[bool] = False

    @property
    def joint_travel(self) -> float:
        """Travel of the leading joint on the parts of joint lines [rad]."""
        return max(
            (1.0 - self.leave) * self.first.joint_travel, self.join * self.second.joint_travel
        )

    @property
    def end(self) -> Pose:
        """The pose at which it joins the second curve."""
        return self.pose(1.0)

    def pose(self, s: float) -> Pose:
        """Return the pose at ``s``."""
        return pose_from_row(self.rows(np.array([s]))[0])

    def locate(self, s: float) -> tuple[int, float]:
        """Return the curve whose segment ``s`` counts to, 0 or 1, and the ``u`` there."""
        after = s > 0.5
        return int(after), crossfade(self.leave, self.join, s)[after]

    @property
    def in_joint_space(self) -> bool:
        """Whether it crossfades joint positions instead of tool poses."""
        return isinstance(self.first, JointLineCurve) and isinstance(self.second, JointLineCurve)

    def joint_rows(self, s: Floats) -> Floats:
        """Return the joint positions (n, 6) [rad] at ``s`` (n,) of a blend in joint space."""
        assert isinstance(self.first, JointLineCurve)
        assert isinstance(self.second, JointLineCurve)
        a, b = crossfade(np.array(self.leave), np.array(self.join), s)
        rows: Floats = (
            self.first.joint_rows(a) + self.second.joint_rows(b) - np.array(self.second.q_start)
        )
        return rows

    def rows(self, s: Floats) -> Floats:
        """Return the poses (n, 7) at ``s`` (n,) in [0, 1]."""
        if isinstance(self.first, JointLineCurve) and self.in_joint_space:
            return tcp_rows(self.first.arm, self.first.T_flange_tcp, self.joint_rows(s))
        return _crossfade_rows([self], np.zeros(len(s), dtype=np.intp), s)


def crossfade(leave: N, join: N, s: N) -> tuple[N, N]:
    """Return the ``u`` of the first curve and that of the second at ``s`` of blends."""
    return leave + (1.0 - leave) * s * (2.0 - s), join * s * s


def blends(inputs: Sequence[BlendInput]) -> list[Blend]:
    """Return the blends of many pairs of curves."""
    if not inputs:
        return []
    ends = [(trim_end(m.first, m.radius), m.second.trim(m.radius)) for m in inputs]
    start = _poses_at((m.first for m in inputs), [leave for leave, _ in ends])
    end = _poses_at((m.second for m in inputs), [join for _, join in ends])
    middle = _starts([m.second for m in inputs])
    shapes = _BlendShapes(
        start,
        middle,
        end,
        np.array([m.radius for m in inputs]),
        np.array([m.fillet for m in inputs]),
    )
    blends_made = [
        Blend(m.first, m.second, m.radius, m.fillet, leave, join, length, angle, n, (near, turn))
        for m, (leave, join), length, angle, n, (near, turn) in zip(
            inputs,
            ends,
            shapes.lengths().tolist(),
            shapes.turns.tolist(),
            shapes.samples().tolist(),
            shapes.blend_tolerances().tolist(),
            strict=True,
        )
    ]
    return [
        blend
        if isinstance(blend.first, LineCurve) and isinstance(blend.second, LineCurve)
        else _with_measured_length(blend)
        for blend in blends_made
    ]


def _with_measured_length(blend: Blend) -> Blend:
    """Return a blend that is no parabola with its length measured along chords."""
    positions = blend.rows(np.linspace(0.0, 1.0, _CHORDS + 1))[:, :3]
    length = float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())
    return replace(blend, length=length)


def _poses_at(paths: Iterable[SegmentCurve], u: Sequence[float]) -> Floats:
    """Return one pose (n, 7) of each curve."""
    every = list(paths)
    rows = np.empty((len(every), 7))
    lines = [k for k, path in enumerate(every) if isinstance(path, LineCurve)]
    if lines:
        ends = _ends([path for path in every if isinstance(path, LineCurve)])
        rows[lines] = interpolate_rows(ends[:, 0], ends[:, 1], np.array([u[k] for k in lines]))
    for k, path in enumerate(every):
        if not isinstance(path, LineCurve):
            rows[k] = path.pose(u[k]).row()
    return rows


def _starts(paths: Sequence[SegmentCurve]) -> Floats:
    """Return the poses (n, 7) at which curves begin."""
    return np.array(
        [path.ends[0] if isinstance(path, LineCurve) else path.start.row() for path in paths]
    )


def _ends(lines: Sequence[LineCurve]) -> Floats:
    """Return both ends (n, 2, 7) of lines."""
    return np.array([line.ends for line in lines])


class _BlendShapes:
    """
    Lengths, turns and tolerances of many blends.

    :param start: poses (n, 7) where they begin; ``middle`` of their waypoints, ``end`` where they
        end.
    """

    def __init__(
        self, start: Floats, middle: Floats, end: Floats, radius: Floats, fillet: Floats
    ) -> None:
        """Measure turns and openings."""
        self.start, self.middle, self.end = start[:, :3], middle[:, :3], end[:, :3]
        self.radius, self.fillet = radius, fillet
        self.before = angle_rows(start[:, 3:], middle[:, 3:])
        self.after = angle_rows(middle[:, 3:], end[:, 3:])
        self.turns: Floats = self.before + self.after
        self.opening = opening_rows(self.start, self.middle, self.end)

    def lengths(self) -> Floats:
        """Return the lengths [m], of parabolas and circles between straight lines."""
        arc = fillet_radius(self.radius, self.opening) * (np.pi - self.opening)
        there_and_back = np.linalg.norm(self.start - self.middle, axis=1) + np.linalg.norm(
            self.end - self.middle, axis=1
        )
        has_circle = (self.opening > _STRAIGHT) & (self.opening < np.pi - _STRAIGHT)
        lengths: Floats = np.where(
            self.fillet,
            np.where(has_circle, arc, there_and_back),
            _parabola_lengths(self.start, self.middle, self.end),
        )
        return lengths

    def samples(self) -> Floats:
        """Return the numbers of chords that follow them closely enough."""
        # At its ends the blend turns at twice its mean rate.
        turns = np.ceil(2.0 * self.turns / MAX_TURN_PER_SAMPLE)
        radius = np.maximum(fillet_radius(self.radius, self.opening), 1e-3)
        on_circle = (np.pi - self.opening) / np.sqrt(8.0 * ARC_CHORD_ERROR / radius)
        # A parabola with control points a, p, b leaves its chords by |a - 2 p + b| / (4 n^2).
        bend = np.linalg.norm(self.start - 2.0 * self.middle + self.end, axis=1)
        on_parabola = np.sqrt(bend / (4.0 * CURVE_CHORD_ERROR))
        curve = np.ceil(np.where(self.fillet, on_circle, on_parabola))
        return np.maximum(2.0, np.maximum(turns, curve)).astype(np.intp)

    def blend_tolerances(self) -> Floats:
        """Return their blend tolerances (n, 2) [m], [rad]."""
        height = np.linalg.norm(self.middle - 0.5 * (self.start + self.end), axis=1)
        return 0.5 * np.stack((height, np.maximum(self.before, self.after)), axis=1)


def blend_rows(all_blends: Sequence[Blend], which: NDArray[np.intp], s: Floats) -> Floats:
    """
    Return poses (n, 7) in many blends.

    :param which: (n,) the number of the blend of each row, not decreasing.
    :param s: (n,) in [0, 1].
    """
    in_joint_space = np.array([blend.in_joint_space for blend in all_blends], dtype=np.bool_)
    if not in_joint_space.any():
        return _crossfade_rows(all_blends, which, s)
    rows = np.empty((len(s), 7))
    crossfaded = np.flatnonzero(~in_joint_space[which])
    rows[crossfaded] = _crossfade_rows(all_blends, which[crossfaded], s[crossfaded])
    for k in np.flatnonzero(in_joint_space).tolist():
        first, last = np.searchsorted(which, (k, k + 1))
        rows[first:last] = all_blends[k].rows(s[first:last])
    return rows


def _crossfade_rows(all_blends: Sequence[Blend], which: NDArray[np.intp], s: Floats) -> Floats:
    """Return poses in blends that crossfade poses."""
    leave = np.array([c.leave for c in all_blends])[which]
    join = np.array([c.join for c in all_blends])[which]
    a, b = crossfade(leave, join, s)
    first = path_rows([c.first for c in all_blends], which, a)
    second = path_rows([c.second for c in all_blends], which, b)
    middle = _starts([c.second for c in all_blends])[which]
    rows = first + second - middle
    rows[:, 3:] = normalized_rows(
        multiply_rows(multiply_rows(first[:, 3:], conjugate_rows(middle[:, 3:])), second[:, 3:])
    )
    filleted = np.array([c.fillet for c in all_blends])[which]
    if filleted.any():
        of_them = which[filleted]
        start = _poses_at((c.first for c in all_blends), [c.leave for c in all_blends])[of_them]
        end = _poses_at((c.second for c in all_blends), [c.join for c in all_blends])[of_them]
        radius = np.array([c.radius for c in all_blends])[of_them]
        rows[filleted, :3] = _on_fillets(
            start[:, :3], middle[filleted, :3], end[:, :3], radius, s[filleted]
        )
    return rows


def curve_rows(curves: Sequence[Curve], which: NDArray[np.intp], u: Floats) -> Floats:
    """Return poses (n, 7) of many curves and blends; ``which`` as in :func:`path_rows`."""
    is_blend = np.array([isinstance(curve, Blend) for curve in curves], dtype=np.bool_)
    number = np.where(is_blend, np.cumsum(is_blend), np.cumsum(~is_blend)) - 1
    on_blend = is_blend[which]
    blends_only = [curve for curve in curves if isinstance(curve, Blend)]
    paths = [curve for curve in curves if not isinstance(curve, Blend)]
    rows = np.empty((len(u), 7))
    if paths:
        rows[~on_blend] = path_rows(paths, number[which[~on_blend]], u[~on_blend])
    if blends_only:
        rows[on_blend] = blend_rows(blends_only, number[which[on_blend]], u[on_blend])
    return rows


def path_rows(paths: Sequence[Curve], which: NDArray[np.intp], u: Floats) -> Floats:
    """
    Return poses (n, 7) of many curves.

    :param which: (n,) the number of the curve of each row, not decreasing.
    :param u: (n,) in [0, 1].
    """
    rows = np.empty((len(u), 7))
    is_line = np.array([isinstance(path, LineCurve) for path in paths], dtype=np.bool_)
    on_line = is_line[which]
    if on_line.any():
        number = np.cumsum(is_line) - 1
        ends = _ends([path for path in paths if isinstance(path, LineCurve)])
        of = ends[number[which[on_line]]]
        rows[on_line] = interpolate_rows(of[:, 0], of[:, 1], u[on_line])
    for k in np.unique(which[~on_line]):
        first, last = np.searchsorted(which, (k, k + 1))
        rows[first:last] = paths[k].rows(u[first:last])
    return rows


def opening_rows(start: Floats, waypoint: Floats, end: Floats) -> Floats:
    """Return the angles between the two segments at the waypoints [rad], pi = straight on."""
    a, b = _units(start - waypoint), _units(end - waypoint)
    # More accurate than the arc cosine where the segments are in line.
    opening: Floats = 2.0 * np.arctan2(
        np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1)
    )
    return opening


def fillet_radius(radius: Floats, opening: Floats) -> Floats:
    """Return the radii of the circles that touch both segments at the blend radius [m]."""
    result: Floats = radius * np.tan(np.minimum(0.5 * opening, 0.5 * np.pi - 1e-9))
    return result


def _on_fillets(start: Floats, waypoint: Floats, end: Floats, radius: Floats, s: Floats) -> Floats:
    """Return positions (n, 3) on circles that touch both segments, evenly along them."""
    opening = opening_rows(start, waypoint, end)
    rho = fillet_radius(radius, opening)
    inwards = _units(_units(start - waypoint) + _units(end - waypoint))
    across = _units(end - start)
    phi = (s - 0.5) * (np.pi - opening)
    # The center lies rho / sin(opening / 2) from the waypoint.
    depth = rho / np.maximum(np.sin(0.5 * opening), 1e-12) - rho * np.cos(phi)
    circle = waypoint + depth[:, None] * inwards + (rho * np.sin(phi))[:, None] * across
    # Straight on, or straight back, there is no circle.
    fraction = np.abs(1.0 - 2.0 * s)[:, None]
    straight = waypoint + fraction * (np.where(s[:, None] < 0.5, start, end) - waypoint)
    has_circle = (opening > _STRAIGHT) & (opening < np.pi - _STRAIGHT)
    return np.where(has_circle[:, None], circle, straight)


def _parabola_lengths(start: Floats, waypoint: Floats, end: Floats) -> Floats:
    """
    Return the lengths of parabolas with these control points [m].

    The speed is 2 |u + s w| with u = p - a, w = a - 2 p + b; its square A s^2 + B s + C has a
    root whose integral is elementary, but has special cases. Gauss-Legendre has none: its eight
    points are exact to a millionth, and to a thousandth for blends that go back nearly straight.
    """
    u, w = waypoint - start, start - 2.0 * waypoint + end
    nodes, weights = np.polynomial.legendre.leggauss(8)
    s = 0.5 * (nodes + 1.0)
    speeds = 2.0 * np.linalg.norm(u[:, None, :] + s[None, :, None] * w[:, None, :], axis=2)
    lengths: Floats = speeds @ (0.5 * weights)
    return lengths


def _units(vectors: Floats) -> Floats:
    lengths: Floats = np.linalg.norm(vectors, axis=1)
    return vectors / np.maximum(lengths, 1e-300)[:, None]
