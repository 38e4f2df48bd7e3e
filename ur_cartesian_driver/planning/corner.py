# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Blended corners: the way from one path into the next that leaves out the waypoint between them.

The robot's maker publishes the radius within which a corner is rounded, and the shape only for
``movep`` (a circular fillet). The others are taken as the two motions crossing over: the first
slows down evenly while the second speeds up evenly, which between straight lines is a parabola.
Between two joint moves this happens in joint space, else in Cartesian space.

Goals of ten thousand blended points are usual, so corners are made and sampled many at a time.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.planning.path import (
    ARC_CHORD_ERROR,
    CURVE_CHORD_ERROR,
    JointLine,
    Line,
    Path,
    tcp_rows,
    trim_end,
    TURN_PER_SAMPLE,
)
from ur_cartesian_driver.planning.pose_rows import (
    angle_rows,
    conjugate_rows,
    Floats,
    interpolate_rows,
    multiply_rows,
    normalized_rows,
)
from ur_cartesian_driver.planning.tool_spline import ToolCurve

# Chords that measure the length of a corner without a formula.
_CHORDS = 16
# Legs that go straight on, or straight back, have no circle between them [rad].
_STRAIGHT = 1e-6


@dataclass(frozen=True, slots=True)
class Meeting:
    """Where two paths meet, and how: what a corner is made of."""

    first: Path
    second: Path
    #: Distance from the waypoint at which both paths are left [m].
    radius: float
    #: A circular arc (``movep``); both paths must be lines.
    fillet: bool


@dataclass(frozen=True, slots=True)
class Corner:
    """
    The blend between two paths.

    ``leave`` is where it leaves the first path, ``join`` where it joins the second (their ``u``).
    """

    first: Path
    second: Path
    radius: float
    fillet: bool
    leave: float
    join: float
    #: Length of the rounded corner [m], and the turn of the tool in it [rad].
    length: float
    angle: float
    #: Into how many pieces to cut it so that chords follow it.
    samples: int
    #: How far the robot's own corner may lie beside this one, [m] and [rad]. It may come as near
    #: to the waypoint as it likes, or cut the corner straight: this one is half-way between. The
    #: turn of the tool may run ahead of its way, or behind it.
    room: tuple[float, float]

    @property
    def in_joints(self) -> bool:
        """Whether the joints cross over, and not the poses of the tool."""
        return isinstance(self.first, JointLine) and isinstance(self.second, JointLine)

    def joint_rows(self, s: Floats) -> Floats:
        """Return the joint positions (n, 6) [rad] at ``s`` (n,) of a corner in joint space."""
        assert isinstance(self.first, JointLine)
        assert isinstance(self.second, JointLine)
        a, b = crossing(self.leave, self.join, s)
        rows: Floats = (
            self.first.joint_rows(a) + self.second.joint_rows(b) - np.array(self.second.q_start)
        )
        return rows

    def rows(self, s: Floats) -> Floats:
        """Return the poses (n, 7) at ``s`` (n,) in [0, 1]."""
        if isinstance(self.first, JointLine) and self.in_joints:
            return tcp_rows(self.first.arm, self.first.T_flange_tcp, self.joint_rows(s))
        return _crossing_rows([self], np.zeros(len(s), dtype=np.intp), s)


def crossing(leave: float | Floats, join: float | Floats, s: Floats) -> tuple[Floats, Floats]:
    """Return the ``u`` of the first path and that of the second at ``s`` of corners."""
    return leave + (1.0 - leave) * s * (2.0 - s), join * s * s


def corners(meetings: Sequence[Meeting]) -> list[Corner]:
    """Return the corners of many pairs of paths."""
    if not meetings:
        return []
    ends = [(trim_end(m.first, m.radius), m.second.trim(m.radius)) for m in meetings]
    start = _places((m.first for m in meetings), [leave for leave, _ in ends])
    end = _places((m.second for m in meetings), [join for _, join in ends])
    middle = _starts([m.second for m in meetings])
    shapes = _Shapes(
        start,
        middle,
        end,
        np.array([m.radius for m in meetings]),
        np.array([m.fillet for m in meetings]),
    )
    lengths, samples, rooms = shapes.lengths(), shapes.samples(), shapes.rooms()
    found = [
        Corner(m.first, m.second, m.radius, m.fillet, leave, join, length, angle, n, (near, turn))
        for m, (leave, join), length, angle, n, (near, turn) in zip(
            meetings,
            ends,
            lengths.tolist(),
            shapes.turns.tolist(),
            samples.tolist(),
            rooms.tolist(),
            strict=True,
        )
    ]
    return [
        corner
        if isinstance(corner.first, Line) and isinstance(corner.second, Line)
        else _measured(corner)
        for corner in found
    ]


def _measured(corner: Corner) -> Corner:
    """Return a corner that is no parabola with its length measured along chords."""
    positions = corner.rows(np.linspace(0.0, 1.0, _CHORDS + 1))[:, :3]
    length = float(np.linalg.norm(np.diff(positions, axis=0), axis=1).sum())
    return Corner(
        corner.first,
        corner.second,
        corner.radius,
        corner.fillet,
        corner.leave,
        corner.join,
        length,
        corner.angle,
        corner.samples,
        corner.room,
    )


def _places(paths: Iterable[Path], u: Sequence[float]) -> Floats:
    """Return one pose (n, 7) of each path."""
    every = list(paths)
    rows = np.empty((len(every), 7))
    lines = [k for k, path in enumerate(every) if isinstance(path, Line)]
    if lines:
        ends = _ends([path for path in every if isinstance(path, Line)])
        rows[lines] = interpolate_rows(ends[:, 0], ends[:, 1], np.array([u[k] for k in lines]))
    for k, path in enumerate(every):
        if not isinstance(path, Line):
            rows[k] = path.pose(u[k]).row()
    return rows


def _starts(paths: Sequence[Path]) -> Floats:
    """Return the poses (n, 7) at which paths begin."""
    return np.array(
        [path.ends[0] if isinstance(path, Line) else path.start.row() for path in paths]
    )


def _ends(lines: Sequence[Line]) -> Floats:
    """Return both ends (n, 2, 7) of lines."""
    return np.array([line.ends for line in lines])


class _Shapes:
    """
    The measures of many corners.

    :param start: the poses (n, 7) where they begin; ``middle`` of their waypoints, ``end`` where
        they end.
    """

    def __init__(
        self, start: Floats, middle: Floats, end: Floats, radius: Floats, fillet: Floats
    ) -> None:
        """Keep the positions, and measure turns and openings."""
        self.start, self.middle, self.end = start[:, :3], middle[:, :3], end[:, :3]
        self.radius, self.fillet = radius, fillet
        self.before = angle_rows(start[:, 3:], middle[:, 3:])
        self.after = angle_rows(middle[:, 3:], end[:, 3:])
        self.turns: Floats = self.before + self.after
        self.opening = opening_rows(self.start, self.middle, self.end)

    def lengths(self) -> Floats:
        """Return the lengths [m], of parabolas and circles between straight lines."""
        arc = fillet_radius(self.radius, self.opening) * (np.pi - self.opening)
        to_and_fro = np.linalg.norm(self.start - self.middle, axis=1) + np.linalg.norm(
            self.end - self.middle, axis=1
        )
        has_circle = (self.opening > _STRAIGHT) & (self.opening < np.pi - _STRAIGHT)
        lengths: Floats = np.where(
            self.fillet,
            np.where(has_circle, arc, to_and_fro),
            _parabola_lengths(self.start, self.middle, self.end),
        )
        return lengths

    def samples(self) -> Floats:
        """Return into how many pieces to cut them."""
        # At its ends the blend turns at twice its mean rate.
        turns = np.ceil(2.0 * self.turns / TURN_PER_SAMPLE)
        radius = np.maximum(fillet_radius(self.radius, self.opening), 1e-3)
        on_circle = (np.pi - self.opening) / np.sqrt(8.0 * ARC_CHORD_ERROR / radius)
        # A parabola with control points a, p, b leaves its chords by |a - 2 p + b| / (4 n^2).
        bend = np.linalg.norm(self.start - 2.0 * self.middle + self.end, axis=1)
        on_parabola = np.sqrt(bend / (4.0 * CURVE_CHORD_ERROR))
        curve = np.ceil(np.where(self.fillet, on_circle, on_parabola))
        return np.maximum(2.0, np.maximum(turns, curve)).astype(np.intp)

    def rooms(self) -> Floats:
        """Return the room (n, 2) beside them [m], [rad]."""
        height = np.linalg.norm(self.middle - 0.5 * (self.start + self.end), axis=1)
        return 0.5 * np.stack((height, np.maximum(self.before, self.after)), axis=1)


def corner_rows(all_corners: Sequence[Corner], which: NDArray[np.intp], s: Floats) -> Floats:
    """
    Return poses (n, 7) in many corners.

    :param which: (n,) the number of the corner of each row, not decreasing.
    :param s: (n,) where in it, [0, 1].
    """
    in_joints = np.array([corner.in_joints for corner in all_corners], dtype=np.bool_)
    if not in_joints.any():
        return _crossing_rows(all_corners, which, s)
    rows = np.empty((len(s), 7))
    crossing_ones = np.flatnonzero(~in_joints[which])
    rows[crossing_ones] = _crossing_rows(all_corners, which[crossing_ones], s[crossing_ones])
    for k in np.flatnonzero(in_joints).tolist():
        first, last = np.searchsorted(which, (k, k + 1))
        rows[first:last] = all_corners[k].rows(s[first:last])
    return rows


def _crossing_rows(all_corners: Sequence[Corner], which: NDArray[np.intp], s: Floats) -> Floats:
    """Return poses in corners whose poses cross over."""
    leave = np.array([c.leave for c in all_corners])[which]
    join = np.array([c.join for c in all_corners])[which]
    a, b = crossing(leave, join, s)
    first = path_rows([c.first for c in all_corners], which, a)
    second = path_rows([c.second for c in all_corners], which, b)
    middle = _starts([c.second for c in all_corners])[which]
    rows = first + second - middle
    rows[:, 3:] = normalized_rows(
        multiply_rows(multiply_rows(first[:, 3:], conjugate_rows(middle[:, 3:])), second[:, 3:])
    )
    round_ones = np.array([c.fillet for c in all_corners])[which]
    if round_ones.any():
        of_them = which[round_ones]
        start = _places((c.first for c in all_corners), [c.leave for c in all_corners])[of_them]
        end = _places((c.second for c in all_corners), [c.join for c in all_corners])[of_them]
        radius = np.array([c.radius for c in all_corners])[of_them]
        rows[round_ones, :3] = _on_fillets(
            start[:, :3], middle[round_ones, :3], end[:, :3], radius, s[round_ones]
        )
    return rows


def path_rows(paths: Sequence[Path | ToolCurve], which: NDArray[np.intp], u: Floats) -> Floats:
    """
    Return poses (n, 7) of many paths.

    :param which: (n,) the number of the path of each row, not decreasing.
    :param u: (n,) where on it.
    """
    rows = np.empty((len(u), 7))
    is_line = np.array([isinstance(path, Line) for path in paths], dtype=np.bool_)
    on_line = is_line[which]
    if on_line.any():
        number = np.cumsum(is_line) - 1
        ends = _ends([path for path in paths if isinstance(path, Line)])
        of = ends[number[which[on_line]]]
        rows[on_line] = interpolate_rows(of[:, 0], of[:, 1], u[on_line])
    for k in np.unique(which[~on_line]):
        first, last = np.searchsorted(which, (k, k + 1))
        rows[first:last] = paths[k].rows(u[first:last])
    return rows


def opening_rows(start: Floats, corner: Floats, end: Floats) -> Floats:
    """Return the angles between the two legs at the waypoints [rad], pi = straight on."""
    a, b = _units(start - corner), _units(end - corner)
    # Better than the arc cosine where the legs are in line.
    opening: Floats = 2.0 * np.arctan2(
        np.linalg.norm(a - b, axis=1), np.linalg.norm(a + b, axis=1)
    )
    return opening


def fillet_radius(radius: Floats, opening: Floats) -> Floats:
    """Return the radii of the circles that touch both legs at the blends' distances [m]."""
    result: Floats = radius * np.tan(np.minimum(0.5 * opening, 0.5 * np.pi - 1e-9))
    return result


def _on_fillets(start: Floats, corner: Floats, end: Floats, radius: Floats, s: Floats) -> Floats:
    """Return positions (n, 3) on circles that touch both legs, evenly along them."""
    opening = opening_rows(start, corner, end)
    rho = fillet_radius(radius, opening)
    inwards = _units(_units(start - corner) + _units(end - corner))
    across = _units(end - start)
    phi = (s - 0.5) * (np.pi - opening)
    # The center lies rho / sin(opening / 2) from the waypoint.
    depth = rho / np.maximum(np.sin(0.5 * opening), 1e-12) - rho * np.cos(phi)
    circle = corner + depth[:, None] * inwards + (rho * np.sin(phi))[:, None] * across
    # Straight on, or straight back, there is no circle.
    share = np.abs(1.0 - 2.0 * s)[:, None]
    straight = corner + share * (np.where(s[:, None] < 0.5, start, end) - corner)
    has_circle = (opening > _STRAIGHT) & (opening < np.pi - _STRAIGHT)
    return np.where(has_circle[:, None], circle, straight)


def _parabola_lengths(start: Floats, corner: Floats, end: Floats) -> Floats:
    """
    Return the lengths of parabolas with these control points [m].

    The speed is 2 |u + s w| with u = p - a, w = a - 2 p + b; its square A s^2 + B s + C has a
    root whose integral is elementary. It is taken by Gauss-Legendre instead, whose eight points
    are exact to a millionth but for corners that go back nearly straight, where it is a
    thousandth, and which knows no special cases.
    """
    u, w = corner - start, start - 2.0 * corner + end
    nodes, weights = np.polynomial.legendre.leggauss(8)
    s = 0.5 * (nodes + 1.0)
    speeds = 2.0 * np.linalg.norm(u[:, None, :] + s[None, :, None] * w[:, None, :], axis=2)
    lengths: Floats = speeds @ (0.5 * weights)
    return lengths


def _units(vectors: Floats) -> Floats:
    lengths: Floats = np.linalg.norm(vectors, axis=1)
    return vectors / np.maximum(lengths, 1e-300)[:, None]
