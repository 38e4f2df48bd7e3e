# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Collision bodies of the arm: a few cylinders per link, for many configurations at once.

A preflight checks tens of thousands of configurations for collisions with itself and planes.
Cylinders inside capsules (all points within a radius of a segment) allow this in numpy for every
model. They contain the true shape: if they do not collide, the arm does not. If they do, the arm
may still be free; :mod:`~.collision_meshes` decides exactly for the models that have meshes.

The DH table has one lateral length, d4, which is the sum of three: the upper arm lies beside the
axis of joint 1 by the *shoulder offset* s, the forearm by the *elbow offset* e, and wrist 1 ends
at d4. All joint housings are cylinders about their own joint's axis, and all tubes run from axis
to axis. So each end of a body is a point on an axis, and calibrated arms use the same table.

Sources. Radii and lengths of the housings: measured on the meshes of UR3, UR5 and UR10 in the
package example-robot-data and of UR3e and UR5e in airo-models (:data:`_MEASURED`); a test checks
that these cylinders contain them, except the cable connector at the base. The larger e-Series
arms are assumed to have the housings of a UR10. The largest ones are a UR10's scaled by the
footprints of the data sheets (190 mm; UR15 and its relatives 204 mm, UR20 and UR30 245 mm).
s and e: the offsets in the configuration files of the ROS 2 description package of Universal
Robots, but for the UR15 and its relatives, for which it has the planes in which the links meet;
there s and e are these plus the half widths of the housings. The UR10's are the middles of its
tubes in the meshes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from enum import IntEnum
from functools import cache
from math import hypot, inf
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ur_cartesian_driver.kinematics.chain import Arm, ChainFramesOf
from ur_cartesian_driver.motion.pose import IDENTITY, Pose

Floats: TypeAlias = NDArray[np.float64]
Flags: TypeAlias = NDArray[np.bool_]


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


@dataclass(frozen=True, slots=True, kw_only=True)
class HousingSizes:
    """
    The housings of one size of arm [m].

    ``_in`` and ``_out`` are the extents of a housing along its joint's axis, towards the previous
    link (where the two meet) and away from it. They count from the axis of the tube or, at the
    wrists, from the axis of the next joint.
    """

    base_radius: float
    shoulder_radius: float
    shoulder_below: float
    shoulder_above: float
    #: Both ends of the upper arm, counted from its tube.
    upper_shoulder_in: float
    upper_shoulder_out: float
    upper_elbow_radius: float
    upper_elbow_in: float
    upper_elbow_out: float
    upper_tube: float
    #: Both ends of the forearm, counted from its tube.
    elbow_radius: float
    elbow_in: float
    elbow_out: float
    fore_tube: float
    fore_wrist_in: float
    fore_wrist_out: float
    #: Wrists 1 and 2 are alike but for a neck: one housing about the previous joint, one about
    #: the next.
    wrist_radius: float
    wrist_1_in: float
    wrist_in: float
    wrist_out: float
    wrist_back: float
    wrist_front: float
    tool_flange_radius: float

    def scaled(self, factor: float) -> HousingSizes:
        """Return the housings of a larger or smaller arm."""
        return HousingSizes(**{name: factor * value for name, value in asdict(self).items()})


#: The housings of UR3, UR5, UR10, UR3e and UR5e [m].
_MEASURED: Mapping[str, tuple[float, float, float, float, float]] = {
    'base_radius': (0.0645, 0.0745, 0.0952, 0.0642, 0.0757),
    'shoulder_radius': (0.0468, 0.0608, 0.0772, 0.0472, 0.0607),
    'shoulder_below': (0.0665, 0.0655, 0.0895, 0.0572, 0.064),
    'shoulder_above': (0.0575, 0.069, 0.0885, 0.0582, 0.0717),
    'upper_shoulder_in': (0.066, 0.0655, 0.0904, 0.0572, 0.0638),
    'upper_shoulder_out': (0.058, 0.069, 0.0879, 0.0582, 0.072),
    'upper_elbow_radius': (0.0395, 0.0605, 0.0628, 0.0396, 0.0609),
    'upper_elbow_in': (0.051, 0.0655, 0.0601, 0.0542, 0.0779),
    'upper_elbow_out': (0.058, 0.069, 0.0692, 0.0564, 0.072),
    'upper_tube': (0.047, 0.059, 0.0763, 0.0454, 0.0586),
    'elbow_radius': (0.0395, 0.059, 0.0628, 0.0412, 0.0626),
    'elbow_in': (0.051, 0.055, 0.068, 0.0391, 0.0534),
    'elbow_out': (0.047, 0.0575, 0.07, 0.0316, 0.0486),
    'fore_tube': (0.0378, 0.0448, 0.06, 0.0345, 0.0508),
    'fore_wrist_in': (0.0425, 0.0453, 0.0537, 0.0537, 0.0728),
    'fore_wrist_out': (0.047, 0.0575, 0.07, 0.0468, 0.0567),
    'wrist_radius': (0.0343, 0.0397, 0.0474, 0.0325, 0.0401),
    'wrist_1_in': (0.047, 0.046, 0.0545, 0.0538, 0.0737),
    'wrist_in': (0.047, 0.046, 0.0545, 0.0355, 0.0462),
    'wrist_out': (0.031, 0.04, 0.0468, 0.0325, 0.0392),
    'wrist_back': (0.0484, 0.0575, 0.0578, 0.0471, 0.0569),
    'wrist_front': (0.0425, 0.048, 0.0625, 0.0505, 0.0537),
    'tool_flange_radius': (0.0385, 0.0444, 0.0475, 0.0379, 0.0438),
}
_UR3, _UR5, _UR10, _UR3E, _UR5E = (
    HousingSizes(**{name: sizes[k] for name, sizes in _MEASURED.items()}) for k in range(5)
)
_UR15 = _UR10.scaled(204 / 190)
_UR20 = _UR10.scaled(245 / 190)

#: Housings, shoulder offset and elbow offset [m] of each model.
_SIZES: Mapping[str, tuple[HousingSizes, float, float]] = MappingProxyType(
    {
        'ur3': (_UR3, 0.1198, 0.0273),
        'ur5': (_UR5, 0.13585, 0.01615),
        'ur10': (_UR10, 0.1758, 0.0486),
        'ur3e': (_UR3E, 0.12, 0.027),
        'ur5e': (_UR5E, 0.138, 0.007),
        'ur7e': (_UR5E, 0.138, 0.007),
        'ur10e': (_UR10, 0.1762, 0.0393),
        'ur12e': (_UR10, 0.1762, 0.0393),
        'ur16e': (_UR10, 0.176, 0.04),
        'ur15': (_UR15, 0.202, 0.061),
        'ur18': (_UR15, 0.202, 0.061),
        'ur8long': (_UR15, 0.202, 0.061),
        'ur20': (_UR20, 0.26, 0.043),
        'ur30': (_UR20, 0.26, 0.043),
    }
)

# The base of the UR5 extends a little below its frame [m].
_BASE_BOTTOM = -0.0035
# Overlap of two links where they meet [m].
_OVERLAP = 0.002
# A capsule on the whole axis of a cylinder sticks out by its radius at both ends. With 1.1 times
# the radius its segment can be shorter, and it sticks out by only 0.64 of the cylinder's radius.
_RADIUS_FACTOR = 1.1
_END_FACTOR = (_RADIUS_FACTOR**2 - 1.0) ** 0.5
# Rows per block, so that the intermediate arrays stay in the CPU cache.
_BLOCK = 256
# Of so many rows that lie close together the middle one says how near the others may be.
# Calibration makes no arm longer than its model by more than the slack [m].
_STRIDE = 16
_REACH_SLACK = 0.02
# Segments count as parallel below this squared sine of their angle: error 1e-6 of a length.
_PARALLEL = 1e-12
_TINY = 1e-300

#: Pairs of links that are checked. Neighbours share a joint that turns freely and are left out, as
#: are pairs that cannot collide, which the tests show with the meshes: base and upper arm (only
#: joint 2 matters), forearm and wrist 2 (wrist 3 collides first), wrist 1 and wrist 3 (d5 apart).
#: Wrist 2 and tool are left out because the tool only turns about the axis of wrist 3.
PAIRS: tuple[tuple[Link, Link], ...] = tuple(
    (a, b)
    for a in Link
    for b in Link
    if b - a >= 2
    and (a, b)
    not in (
        (Link.BASE, Link.UPPER_ARM),
        (Link.FOREARM, Link.WRIST_2),
        (Link.WRIST_1, Link.WRIST_3),
        (Link.WRIST_2, Link.TOOL),
    )
)


@dataclass(frozen=True, slots=True)
class _LinkCylinder:
    """A cylinder between two points, each given by an axis (0..5) and a distance along it [m]."""

    link: Link
    start: tuple[int, float]
    end: tuple[int, float]
    radius: float


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
        bodies = _link_cylinders(arm)
        self._ends_on_axes = _ends_on_axes(arm, bodies)
        links, radii = [body.link for body in bodies], [body.radius for body in bodies]
        capsules_of = [_capsule_of(arm, body) for body in bodies]
        self._has_tool = tool_radius > 0.0 and hypot(*self._tcp) > 0.0
        if self._has_tool:
            links.append(Link.TOOL)
            radii.append(tool_radius)
            capsules_of.append((0.0, tool_radius))
        #: The link and the radius [m] of each cylinder.
        self.links, self.radii = tuple(links), np.array(radii)
        self._cut, self.capsule_radii = np.array(capsules_of).T
        self.pairs = tuple(pair for pair in PAIRS if Link.TOOL not in pair or self._has_tool)
        self._first, self._second, self._pair = _comparisons(self.links, self.pairs)
        self._reach = self._reaches(bodies)

    def distances(self, q: Floats, enough: float = inf) -> Floats:
        """
        Return a lower bound of the distance of each pair of links in :attr:`pairs`.

        :param q: (n, 6) [rad]; faster with ``enough`` if rows that follow each other are close.
        :param enough: where a distance is neither less than this [m] nor the smallest of all, a
            smaller number may stand for it, which is no less than both.
        :returns: (n, pairs) distance of their capsules [m]; negative where these overlap.
        """
        every = np.ones(len(self.pairs), dtype=np.bool_)
        if enough == inf or len(q) <= _STRIDE:
            return self._pair_distances(q, every)
        block = np.arange(len(q)) // _STRIDE
        begins = np.arange(0, len(q), _STRIDE)
        middles = q[np.minimum(begins + _STRIDE // 2, len(q) - 1)]
        least = self._pair_distances(middles, every)
        enough = max(enough, float(least.min()))
        least -= np.maximum.reduceat(np.abs(q - middles[block]), begins) @ self._reach
        near: Flags = np.less(least, enough)
        result = least[block]
        rows = np.flatnonzero(np.any(near, axis=1)[block])
        for begin in range(0, len(rows), _BLOCK):
            some = rows[begin : begin + _BLOCK]
            pairs: Flags = np.any(near[block[some[0]] : block[some[-1]] + 1], axis=0)
            result[some[:, None], np.flatnonzero(pairs)] = self._pair_distances(q[some], pairs)
        return result

    def _pair_distances(self, q: Floats, pairs: Flags) -> Floats:
        """Return the distances (n, m) of some pairs."""
        wanted = pairs[self._pair]
        first, second = self._first[wanted], self._second[wanted]
        begins = np.flatnonzero(np.diff(self._pair[wanted], prepend=-1))
        sums = (self.capsule_radii[first] + self.capsule_radii[second])[:, None]
        result = np.empty((len(q), len(begins)))
        for begin in range(0, len(q), _BLOCK):
            rows = slice(begin, begin + _BLOCK)
            start, vector = self._capsules(self._ends(self.arm.frames_rows(q[rows])))
            distances = segment_distance(
                start[:, first], vector[:, first], start[:, second], vector[:, second]
            )
            result[rows] = np.minimum.reduceat(distances - sums, begins).T
        return result

    def _reaches(self, bodies: Sequence[_LinkCylinder]) -> Floats:
        """
        Return how far a turn of each joint moves one link of each pair towards the other.

        :returns: (6, pairs) [m/rad]: the largest distance of the second link from the joint, for
            the joints between the two.
        """
        g = self.arm.model.geometry
        # Of the origins of the joints' frames, and of the flange, along the arm.
        along = np.append(0.0, np.cumsum(np.hypot(g.a, g.d)))
        ends = [(body.link, axis, s) for body in bodies for axis, s in (body.start, body.end)]
        ends += [(Link.TOOL, 6, hypot(*self._tcp)), (Link.TOOL, 6, 0.0)]
        reach = np.zeros((6, len(self.pairs)))
        for k, (first, second) in enumerate(self.pairs):
            for joint in range(first, min(second, 6)):
                reach[joint, k] = _REACH_SLACK + max(
                    along[axis] - along[joint] + abs(s) for link, axis, s in ends if link == second
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
            start, end = self._ends(self.arm.frames_rows(q[rows]))
            vector = end - start
            square = np.maximum(np.einsum('ckn,ckn->kn', vector, vector), _TINY)
            for m, normal in enumerate(normals):
                low, rise = (np.tensordot(normal, v, axes=1) for v in (start, vector))
                # A disc across the unit vector u reaches r sqrt(1 - (n u)^2) down.
                disc = np.sqrt(np.maximum(0.0, 1.0 - rise**2 / square))
                result[rows, m] = (low + np.minimum(rise, 0.0) - self.radii[:, None] * disc).T
        return result

    def cylinder_ends(self, q: Floats) -> Floats:
        """Return both ends of every cylinder in base [m], (n, k, 2, 3), at joints (n, 6) [rad]."""
        ends: Floats = self._ends(self.arm.frames_rows(q)).transpose(3, 2, 0, 1)
        return ends

    def _ends(self, frames: ChainFramesOf[Floats]) -> Floats:
        """Return both ends of every cylinder, (2 ends, 3 coordinates, k cylinders, n rows)."""
        origins, axes = np.array(frames.origins), np.array(frames.axes)  # (6, 3, n)
        index, along = self._ends_on_axes
        ends = origins[index] + along[:, :, None, None] * axes[index]  # (2, k, 3, n)
        if self._has_tool:
            tool = np.array([frames.position, frames.point(self._tcp)])
            ends = np.concatenate([ends, tool[:, None]], axis=1)
        ordered: Floats = ends.transpose(0, 2, 1, 3)
        return ordered

    def _capsules(self, ends: Floats) -> tuple[Floats, Floats]:
        """Return start and vector of each capsule's segment, each (3, k, n)."""
        start, end = ends
        vector = end - start
        cut = self._cut[:, None]
        return start + cut * vector, (1.0 - 2.0 * cut) * vector


def segment_distance(
    start_1: Floats, vector_1: Floats, start_2: Floats, vector_2: Floats
) -> Floats:
    """
    Return the distances of pairs of segments, which may be parallel or points.

    The minimum of a convex quadratic form over the unit square (Ericson, Real-Time Collision
    Detection, 5.1.9).

    :param start_1: (3, ...) [m]; the segment ends at ``start_1 + vector_1``.
    """
    r = start_1 - start_2
    a, e = _dot(vector_1, vector_1), _dot(vector_2, vector_2)
    b, c, f = _dot(vector_1, vector_2), _dot(vector_1, r), _dot(vector_2, r)
    denominator = a * e - b * b
    crossing = denominator > _PARALLEL * a * e
    s = np.where(crossing, (b * f - c * e) / np.where(crossing, denominator, 1.0), 0.0)
    t = np.clip((b * np.clip(s, 0.0, 1.0) + f) / np.maximum(e, _TINY), 0.0, 1.0)
    s = np.clip((b * t - c) / np.maximum(a, _TINY), 0.0, 1.0)
    gap = r + s * vector_1 - t * vector_2
    distance: Floats = np.sqrt(_dot(gap, gap))
    return distance


def _dot(u: Floats, v: Floats) -> Floats:
    product: Floats = u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
    return product


def _link_cylinders(arm: Arm) -> list[_LinkCylinder]:
    """Return the cylinders of the arm's model."""
    g = arm.model.geometry
    d1, d4, d5, d6 = g.d[0], *g.d[3:]
    z, s, e = _SIZES[arm.model.name]
    # The upper arm begins where the forearm ends.
    elbow = min(s - z.upper_elbow_in, e + z.elbow_in)
    return [
        _housing(Link.BASE, 0, _BASE_BOTTOM, d1 - z.shoulder_below + _OVERLAP, z.base_radius),
        _housing(
            Link.SHOULDER, 0, d1 - z.shoulder_below, d1 + z.shoulder_above, z.shoulder_radius
        ),
        _housing(Link.SHOULDER, 1, 0.0, s - z.upper_shoulder_in + _OVERLAP, z.shoulder_radius),
        _housing(
            Link.UPPER_ARM,
            1,
            s - z.upper_shoulder_in,
            s + z.upper_shoulder_out,
            z.shoulder_radius,
        ),
        _LinkCylinder(Link.UPPER_ARM, (1, s), (2, s), z.upper_tube),
        _housing(Link.UPPER_ARM, 2, elbow, s + z.upper_elbow_out, z.upper_elbow_radius),
        _housing(Link.FOREARM, 2, e - z.elbow_out, e + z.elbow_in, z.elbow_radius),
        _LinkCylinder(Link.FOREARM, (2, e), (3, e), z.fore_tube),
        _housing(Link.FOREARM, 3, e - z.fore_wrist_out, d4 - z.fore_wrist_in, z.wrist_radius),
        _housing(Link.WRIST_1, 3, d4 - z.wrist_1_in, d4 + z.wrist_out, z.wrist_radius),
        _housing(Link.WRIST_1, 4, -z.wrist_back, z.wrist_front, z.wrist_radius),
        _housing(Link.WRIST_2, 4, d5 - z.wrist_in, d5 + z.wrist_out, z.wrist_radius),
        _housing(Link.WRIST_2, 5, -z.wrist_back, z.wrist_front, z.wrist_radius),
        _housing(Link.WRIST_3, 5, z.wrist_front - _OVERLAP, d6, z.tool_flange_radius),
    ]


def _housing(link: Link, axis: int, begin: float, end: float, radius: float) -> _LinkCylinder:
    """Return a cylinder about one axis, between two distances along it [m]."""
    return _LinkCylinder(link, (axis, begin), (axis, end), radius)


def _ends_on_axes(arm: Arm, bodies: list[_LinkCylinder]) -> tuple[NDArray[np.intp], Floats]:
    """
    Return the axis and the distance along it of both ends of each body, (2, k) each.

    The origin of a calibrated DH frame can lie anywhere on its axis, hundreds of metres away
    where axes are nearly parallel. With all joints at 0 the true axis is close to the nominal
    one, so distances count from the projection of the nominal origin onto the true axis.
    """
    ends = [[body.start for body in bodies], [body.end for body in bodies]]
    index = np.array([[axis for axis, _ in row] for row in ends], dtype=np.intp)
    along = np.array([[position for _, position in row] for row in ends])
    true, nominal = arm.frames((0.0,) * 6), Arm(arm.model).frames((0.0,) * 6)
    shift = np.einsum('ic,ic->i', np.subtract(nominal.origins, true.origins), np.array(true.axes))
    return index, along + shift[index]


def _capsule_of(arm: Arm, body: _LinkCylinder) -> tuple[float, float]:
    """Return the fraction of the axis cut off at each end, and the radius of the capsule."""
    (axis, begin), (other, end) = body.start, body.end
    if axis != other:
        # The ends of a tube lie inside housings: the caps of its capsule add nothing.
        return 0.0, body.radius
    length = end - begin
    if length <= 2.0 * _END_FACTOR * body.radius:
        return 0.5, hypot(body.radius, 0.5 * length)
    return _END_FACTOR * body.radius / length, _RADIUS_FACTOR * body.radius


@cache
def _comparisons(
    links: tuple[Link, ...], pairs: tuple[tuple[Link, Link], ...]
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
    """Return first and second body of each comparison, and the number of its pair of links."""
    first: list[int] = []
    second: list[int] = []
    numbers: list[int] = []
    for number, (a, b) in enumerate(pairs):
        for i, of in enumerate(links):
            same = [j for j, other in enumerate(links) if of == a and other == b]
            first += [i] * len(same)
            second += same
            numbers += [number] * len(same)
    return (
        np.array(first, dtype=np.intp),
        np.array(second, dtype=np.intp),
        np.array(numbers, dtype=np.intp),
    )
