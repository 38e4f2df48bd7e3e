# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Collision bodies of the arm: a few cylinders per link, for many configurations at once.

The preflight of a goal checks tens of thousands of configurations for collisions of the arm with
itself and with planes. Cylinders allow this in numpy for every model. They contain the true shape:
if the cylinders do not collide, the arm does not. If they do, the arm may still be free;
:mod:`~.collision_meshes` decides exactly for the models that have meshes.

All joint housings are cylinders about their own joint's axis, and all tubes run from axis to axis.
So each end of a body is a point on an axis, and calibrated arms use the same table. The connector
of the robot cable lies along y of ``base``, towards +y.

The distance of two cylinders is at least their separation along any direction. To choose a
direction, both axes are shortened at both ends by :data:`_CUT` radii, to skeletons. The direction
between the nearest points of the skeletons gives a bound in closed form: the distance of these
points, less the length by which each cylinder reaches beyond its skeleton in this direction. Where
cylinders may be close, a second direction raises the bound. It joins two points that approach the
nearest ones, found by projecting alternately onto both cylinders.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import product
from math import hypot, inf
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from ur_cartesian_driver.kinematics.body_sizes import BODY_SIZES, BodySizes
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose

_Skeletons: TypeAlias = tuple[Floats, Floats, Floats]


class Link(IntEnum):
    """The rigid bodies of the arm; joint i moves link i."""

    BASE = 0
    SHOULDER = 1
    UPPER_ARM = 2
    FOREARM = 3
    WRIST_1 = 4
    WRIST_2 = 5
    WRIST_3 = 6
    TOOL = 7

    def __str__(self) -> str:
        """Return the name for messages."""
        return self.name.lower().replace('_', ' ')


#: The kinds of bodies: a housing about a joint's axis, a tube from a joint's axis to the next one,
#: or the connector, along y of ``base``.
_Kind: TypeAlias = Literal['housing', 'tube', 'connector']

#: The bodies of every arm: link, kind, and number of the axis, from 0; the connector has axis 6.
_BODIES: tuple[tuple[Link, _Kind, int], ...] = (
    (Link.BASE, 'housing', 0),
    (Link.BASE, 'connector', 6),
    (Link.BASE, 'housing', 0),
    (Link.SHOULDER, 'housing', 0),
    (Link.SHOULDER, 'housing', 1),
    (Link.UPPER_ARM, 'housing', 1),
    (Link.UPPER_ARM, 'tube', 1),
    (Link.UPPER_ARM, 'housing', 2),
    (Link.FOREARM, 'housing', 2),
    (Link.FOREARM, 'tube', 2),
    (Link.FOREARM, 'housing', 3),
    (Link.WRIST_1, 'housing', 3),
    (Link.WRIST_1, 'housing', 4),
    (Link.WRIST_2, 'housing', 4),
    (Link.WRIST_2, 'housing', 5),
    (Link.WRIST_3, 'housing', 5),
)

# Fraction of the radius by which the axis of a cylinder is shortened: with this fraction, the
# bound is tightest on average.
_CUT = 0.46
# Rows per block, so that the intermediate arrays stay in the CPU cache.
_BLOCK = 2048
# The same for pairs of bodies: the product of rows and pairs.
_PAIR_ROWS = 12288
# Of this many consecutive rows, the middle one bounds the distances of the others.
_STRIDE = 16
# A calibrated arm is at most this much longer than its model [m].
_REACH_SLACK = 0.02
# Segments are taken for parallel if the squared sine of the angle between them is below this: the
# error is 1e-6 of a length.
_PARALLEL = 1e-12
_TINY = 1e-300
# How often a point is projected onto both bodies of a pair: a third round would gain 0.2 mm.
_PROJECTIONS = 2
# The second direction is tried for the bodies of two links whose first bounds are within this [m]
# of the least: any of them may be the nearest.
_LOOSENESS = 0.01
# Points nearer than this [m] give no direction.
_TOUCHING = 1e-9

#: Pairs of links that are checked. Neighbours share a joint that turns freely and are left out. So
#: are pairs that, as tests with the meshes show, cannot collide: forearm and wrist 2 (wrist
#: 3 collides first), wrist 1 and wrist 3 (d5 apart), wrist 2 and tool (the tool turns about the
#: axis of wrist 3, and would have to pass through it). The upper arm turns past the round part of
#: the base, so it is checked only against the connector of the base.
PAIRS: tuple[tuple[Link, Link], ...] = tuple(
    (a, b)
    for a in Link
    for b in Link
    if b - a >= 2
    and (a, b)
    not in (
        (Link.FOREARM, Link.WRIST_2),
        (Link.WRIST_1, Link.WRIST_3),
        (Link.WRIST_2, Link.TOOL),
    )
)
#: The pair in which only the connector of the base is checked.
CONNECTOR_PAIR = (Link.BASE, Link.UPPER_ARM)
#: The index of the connector among the bodies.
CONNECTOR = 1


@dataclass(frozen=True, slots=True)
class _LinkBody:
    """
    A cylinder between two points, each given by an axis and a distance along it [m].

    Axes 0..5 are the joint axes, 6 is the middle line of the connector, 7 the line from flange to
    TCP.

    :param across: half the length [m] of a cylinder about the axis of its start that is swept from
        start to end; 0 = the cylinder is about the line from start to end.
    """

    link: Link
    start: tuple[int, float]
    end: tuple[int, float]
    radius: float
    across: float = 0.0


class CollisionBodies:
    """
    The cylinders of one arm and its tool. Immutable.

    :param arm: nominal or calibrated.
    :param T_flange_tcp: the TCP, where the tool ends.
    :param tool_radius: radius of a cylinder from the flange to the TCP [m]; 0 = no tool.
    """

    def __init__(self, arm: Arm, T_flange_tcp: Pose = IDENTITY, tool_radius: float = 0.0) -> None:
        """Compute the positions of all ends on their axes."""
        self.arm, self._tcp = arm, T_flange_tcp.position
        size = BODY_SIZES[arm.model.name]
        bodies = _link_bodies(size)
        self._tool_length = hypot(*self._tcp) if tool_radius > 0.0 else 0.0
        if self._tool_length:
            ends = (7, 0.0), (7, self._tool_length)
            bodies.append(_LinkBody(Link.TOOL, *ends, tool_radius))
        x, z = size.connector
        self._connector = 1e-3 * x, 1e-3 * z
        self._ends_on_axes = _ends_on_axes(arm, bodies)
        #: The link and the radius [m] of each cylinder.
        self.links = tuple(body.link for body in bodies)
        self.radii = np.array([body.radius for body in bodies])
        start, end = self.cylinder_ends(np.zeros((1, 6)))[0].transpose(1, 0, 2)
        # Columns, with a row for each cylinder. Half the length of the swept cylinders [m]:
        across = np.array([[body.across] for body in bodies])
        self._moves = across > 0.0
        self._radii = self.radii[:, None]
        self._lengths = np.linalg.norm(end - start, axis=1, keepdims=True)
        # The lengths that are cut from both ends of the other cylinders [m]:
        insets = np.minimum(_CUT * self._radii, 0.5 * self._lengths)
        self._insets = np.where(self._moves, across, insets)
        self._cuts = np.where(self._moves, 0.0, insets)
        self._tubes = np.flatnonzero(np.not_equal(*self._ends_on_axes[0])).tolist()
        self.pairs = tuple(pair for pair in PAIRS if Link.TOOL not in pair or self._tool_length)
        of = {link: slice(*np.searchsorted(self.links, (link, link + 1))) for link in Link}
        of_connector = slice(CONNECTOR, CONNECTOR + 1)
        bodies_of = [
            (of_connector if (a, b) == CONNECTOR_PAIR else of[a], of[b]) for a, b in self.pairs
        ]
        numbers = np.arange(len(bodies))
        #: The pairs of bodies, (3, m): the number of their pair of links, and both bodies.
        self._compared = np.array(
            [
                (k, i, j)
                for k, (first, second) in enumerate(bodies_of)
                for i, j in product(numbers[first], numbers[second])
            ]
        ).T
        self._reach = self._reaches(bodies)

    def distances(self, q: Floats, enough: float = inf) -> Floats:
        """
        Return a lower bound of the distance of each pair of links in :attr:`pairs`.

        :param q: (n, 6) [rad].
        :param enough: larger distances [m], except the smallest of all, may be replaced by coarser
            lower bounds, which are below neither ``enough`` nor the smallest distance. This is
            faster if consecutive rows are close to each other.
        :returns: (n, pairs) separation of their cylinders [m]; negative where these may overlap.
        """
        every = np.ones(len(self.pairs), dtype=np.bool_)
        if enough == inf or len(q) <= _STRIDE:
            return self._pair_distances(q, every)
        block = np.arange(len(q)) // _STRIDE
        begins = np.arange(0, len(q), _STRIDE)
        middles = q[np.minimum(begins + _STRIDE // 2, len(q) - 1)]
        least = self._pair_distances(middles, every, first_bound=True)
        nearest = middles[int(np.argmin(least.min(axis=1))), None]
        enough = max(enough, float(self._pair_distances(nearest, every).min()))
        least -= np.maximum.reduceat(np.abs(q - middles[block]), begins) @ self._reach
        near: Flags = np.less(least, enough)
        result = least[block]
        rows = np.flatnonzero(np.any(near, axis=1)[block])
        for begin in range(0, len(rows), _BLOCK):
            some = rows[begin : begin + _BLOCK]
            pairs: Flags = np.any(near[block[some[0]] : block[some[-1]] + 1], axis=0)
            result[some[:, None], np.flatnonzero(pairs)] = self._pair_distances(q[some], pairs)
        return result

    def _pair_distances(self, q: Floats, pairs: Flags, *, first_bound: bool = False) -> Floats:
        """
        Return the distances (n, m) [m] of the m pairs that are marked in ``pairs``.

        :param first_bound: whether to leave out the second direction: coarser, but cheaper.
        """
        links, one, other = self._compared[:, pairs[self._compared[0]]]
        begins = np.flatnonzero(np.diff(links, prepend=-1))
        of_pair = np.repeat(np.arange(len(begins)), np.diff(begins, append=len(links)))
        result = np.empty((len(q), len(begins)))
        block = max(1, _PAIR_ROWS // len(links))
        for begin in range(0, len(q), _BLOCK):
            start, vector, axis = self._skeletons(self._lines(q[begin : begin + _BLOCK]))
            rows = result[begin : begin + _BLOCK]
            for row in range(0, len(rows), block):
                some = slice(row, row + block)
                skeletons = start[..., some], vector[..., some], axis[..., some]
                distances = self._body_distances(skeletons, one, other)
                least = np.minimum.reduceat(distances, begins)
                if not first_bound:
                    k, column = close = np.nonzero(distances < least[of_pair] + _LOOSENESS)
                    first = self._cylinders(skeletons, one[k], column)
                    second = self._cylinders(skeletons, other[k], column)
                    distances[close] = np.maximum(distances[close], _separation(first, second))
                    least = np.minimum.reduceat(distances, begins)
                rows[some] = least.T
        return result

    def _body_distances(self, skeletons: _Skeletons, one: Indices, other: Indices) -> Floats:
        """Return the distances (m, n) of pairs of bodies, by the gaps between their skeletons."""
        start, vector, axis = skeletons
        gap = segment_gap(start[:, one], vector[:, one], start[:, other], vector[:, other])
        distance = np.sqrt(_dot(gap, gap))
        scale = 1.0 / np.maximum(distance, _TINY)
        for k in (one, other):
            distance -= _beyond(_dot(gap, axis[:, k]) * scale, self._insets[k], self._radii[k])
        return distance

    def _cylinders(self, skeletons: _Skeletons, bodies: Indices, columns: Indices) -> _Cylinders:
        start, vector, axis = (each[:, bodies, columns] for each in skeletons)
        inset, radius, moves = (
            each[bodies, 0] for each in (self._insets, self._radii, self._moves)
        )
        return _Cylinders(start, vector, axis, inset, radius, moves)

    def _reaches(self, bodies: Sequence[_LinkBody]) -> Floats:
        """
        Return how far a turn of each joint can move one link of each pair towards the other.

        :returns: (6, pairs) [m/rad]: the largest distance of the second link from the joint, for
            the joints between the two.
        """
        g = self.arm.model.geometry
        # Distances along the arm to the origins of the joint frames, and to the flange.
        along = np.append(0.0, np.cumsum(np.hypot(g.a, g.d)))
        ends = [
            (body.link, axis, abs(s) + hypot(body.radius, body.across))
            for body in bodies
            for axis, s in (body.start, body.end)
        ]
        reach = np.zeros((6, len(self.pairs)))
        for k, (first, second) in enumerate(self.pairs):
            for joint in range(first, min(second, 6)):
                reach[joint, k] = _REACH_SLACK + max(
                    along[min(axis, 6)] - along[joint] + s
                    for link, axis, s in ends
                    if link == second
                )
        return reach

    def heights(self, q: Floats, normals: Floats) -> Floats:
        """
        Return the height of each cylinder's lowest point along each normal.

        :param q: (n, 6) [rad].
        :param normals: (m, 3) unit vectors in base.
        :returns: (n, m, k): minimum of normal . point over cylinder k [m].
        """
        result = np.empty((len(q), len(normals), len(self.links)))
        for begin in range(0, len(q), _BLOCK):
            rows = slice(begin, begin + _BLOCK)
            skeletons = self._skeletons(self._lines(q[rows]))
            for m, normal in enumerate(normals):
                low, rise, cosine = (np.tensordot(normal, v, axes=1) for v in skeletons)
                low += np.minimum(rise, 0.0)
                result[rows, m] = (low - _beyond(cosine, self._insets, self._radii)).T
        return result

    def cylinder_ends(self, q: Floats) -> Floats:
        """Return both ends (n, k, 2, 3) of every cylinder in base [m], at joints (n, 6) [rad]."""
        origins, axes = self._lines(q)
        ends: Floats = np.array(
            [
                origins[:, index] + along[:, None] * axes[:, index]
                for index, along in zip(*self._ends_on_axes, strict=True)
            ]
        )
        return ends.transpose(3, 2, 0, 1)

    def drawn_cylinders(self) -> Iterator[tuple[Link, Floats, Floats, float]]:
        """
        Yield link, start [m], end [m] and radius [m] of cylinders to draw, with all joints at 0.

        A swept cylinder is drawn at both ends, and as a tube between them.
        """
        for k, (link, radius, axes) in enumerate(self.hulls()):
            for start, end in axes:
                yield link, start, end, radius
            if len(axes) > 1:
                start, end = axes.mean(axis=1)
                yield link, start, end, min(radius, float(self._insets[k, 0]))

    def hulls(self) -> Iterator[tuple[Link, float, Floats]]:
        """
        Yield link, radius [m] and axes (k, 2, 3) [m] of cylinders, with all joints at 0.

        A body is the convex hull of one cylinder, or of the two at the ends of a swept cylinder.
        """
        ends = self.cylinder_ends(np.zeros((1, 6)))[0]
        halves = self._insets * self._skeletons(self._lines(np.zeros((1, 6))))[2][:, :, 0].T
        for k, axis in enumerate(ends):
            if self._moves[k]:
                axes = np.stack([axis - halves[k], axis + halves[k]], axis=1)
            else:
                axes = axis[None]
            yield self.links[k], float(self.radii[k]), axes

    def _lines(self, q: Floats) -> Floats:
        """Return a point on each axis and the axis's direction, as one array (2, 3, axes, n)."""
        frames = self.arm.frames_rows(q)
        (zero, _, one), (x, z) = frames.axes[0], self._connector
        origins = [*frames.origins, (zero + x, zero, zero + z)]
        axes = [*frames.axes, (zero, one, zero)]
        if self._tool_length:
            tcp = frames.point(self._tcp)
            origins.append(frames.position)
            axes.append(tuple(np.subtract(tcp, frames.position) / self._tool_length))
        return np.array([list(zip(*each, strict=True)) for each in (origins, axes)])

    def _skeletons(self, lines: Floats) -> _Skeletons:
        """Return start, vector and the cylinder's axis of all skeletons, each (3, k, n)."""
        (first, last), (begin, end) = self._ends_on_axes
        origins, axes = lines
        axis = axes[:, first]
        start = origins[:, first] + begin[:, None] * axis
        spans = self._lengths - 2.0 * self._cuts
        vector = spans * axis
        for k in self._tubes:
            tube = origins[:, last[k]] + end[k] * axes[:, last[k]] - start[:, k]
            if not self._moves[k]:
                axis[:, k] = tube / self._lengths[k]
            vector[:, k] = spans[k] / self._lengths[k] * tube
        return start + self._cuts * axis, vector, axis


class _Cylinders(NamedTuple):
    """Bodies by their skeletons: start, vector, axis (3, n), and the extent beyond them, (n,)."""

    start: Floats
    vector: Floats
    axis: Floats
    inset: Floats
    radius: Floats
    moves: Flags

    def nearest(self, points: Floats) -> Floats:
        """Return their points (3, n) that are nearest to some points [m]."""
        offset = points - self.start
        along = _dot(offset, self.vector) / np.maximum(_dot(self.vector, self.vector), _TINY)
        middle = np.where(self.moves, np.clip(along, 0.0, 1.0), 0.0) * self.vector
        offset -= middle
        height = _dot(offset, self.axis)
        across = offset - height * self.axis
        across *= np.minimum(self.radius / np.maximum(np.sqrt(_dot(across, across)), _TINY), 1.0)
        top = np.where(self.moves, 0.0, _dot(self.vector, self.axis)) + self.inset
        nearest: Floats = (
            self.start + middle + np.clip(height, -self.inset, top) * self.axis + across
        )
        return nearest

    def lowest(self, direction: Floats) -> Floats:
        """Return their smallest coordinates along unit vectors (3, n) [m]."""
        low = _dot(direction, self.start) + np.minimum(_dot(direction, self.vector), 0.0)
        lowest: Floats = low - _beyond(_dot(direction, self.axis), self.inset, self.radius)
        return lowest


def _separation(first: _Cylinders, second: _Cylinders) -> Floats:
    """Return a lower bound (n,) of their distances [m]; -inf where overlap gives no direction."""
    on_first = first.start + 0.5 * first.vector
    for _ in range(_PROJECTIONS):
        on_second = second.nearest(on_first)
        on_first = first.nearest(on_second)
    gap = on_first - on_second
    distance = np.sqrt(_dot(gap, gap))
    direction = gap / np.maximum(distance, _TINY)
    separation = first.lowest(direction) + second.lowest(-direction)
    return np.where(distance > _TOUCHING, separation, -inf)


def _beyond(cosine: Floats, insets: Floats, radii: Floats) -> Floats:
    """
    Return how far cylinders reach beyond their skeletons in a direction [m].

    :param cosine: (k, n) of the angle between the direction and each cylinder's axis.
    """
    sine = np.sqrt(np.maximum(1.0 - cosine * cosine, 0.0))
    reach: Floats = insets * np.abs(cosine) + radii * sine
    return reach


def segment_gap(start_1: Floats, vector_1: Floats, start_2: Floats, vector_2: Floats) -> Floats:
    """
    Return the vectors between the nearest points of pairs of segments, from second to first.

    The nearest points minimize a convex quadratic form over the unit square (Ericson, Real-Time
    Collision Detection, 5.1.9). Segments can be parallel, or have the length 0.

    :param start_1: (3, ...) [m]; the first segment ends at ``start_1 + vector_1``.
    """
    r = start_1 - start_2
    a, e = _dot(vector_1, vector_1), _dot(vector_2, vector_2)
    b, c, f = _dot(vector_1, vector_2), _dot(vector_1, r), _dot(vector_2, r)
    # For parallel segments the first s can be any number.
    s = (b * f - c * e) / np.maximum(a * e - b * b, _PARALLEL * a * e + _TINY)
    np.clip(s, 0.0, 1.0, out=s)
    t = np.clip((b * s + f) / np.maximum(e, _TINY), 0.0, 1.0)
    s = np.clip((b * t - c) / np.maximum(a, _TINY), 0.0, 1.0)
    gap: Floats = r + s * vector_1 - t * vector_2
    return gap


def _dot(u: Floats, v: Floats) -> Floats:
    product: Floats = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
    return product


def _link_bodies(size: BodySizes) -> list[_LinkBody]:
    """Return the bodies of an arm of this size, in metres."""
    bodies = []
    for (link, kind, axis), row in zip(_BODIES, size.rows, strict=True):
        if row is None:
            continue
        begin, end, radius = (1e-3 * value for value in row)
        if kind != 'tube':
            bodies.append(_LinkBody(link, (axis, begin), (axis, end), radius))
            continue
        middle, half = 0.5 * (begin + end), 0.5 * (end - begin)
        bodies.append(_LinkBody(link, (axis, middle), (axis + 1, middle), radius, half))
    return bodies


def _ends_on_axes(arm: Arm, bodies: list[_LinkBody]) -> tuple[Indices, Floats]:
    """
    Return for both ends of each body the axis, and the distance along it [m], (2, k) each.

    The origin of a calibrated DH frame can lie anywhere on its axis, hundreds of metres away
    where axes are nearly parallel. With all joints at 0 the true axis is close to the nominal
    one, so distances are from the projection of the nominal origin onto the true axis.
    """
    ends = [[body.start for body in bodies], [body.end for body in bodies]]
    index = np.array([[axis for axis, _ in row] for row in ends], dtype=np.intp)
    along = np.array([[position for _, position in row] for row in ends])
    true, nominal = arm.frames((0.0,) * 6), Arm(arm.model).frames((0.0,) * 6)
    shift = np.einsum('ic,ic->i', np.subtract(nominal.origins, true.origins), np.array(true.axes))
    return index, along + np.append(shift, (0.0, 0.0))[index]
