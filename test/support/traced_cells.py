# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Goals through random cells, and the distances of the bodies along the joints of a trace.

Between the cycles of a trace the joints are interpolated so densely that no body can have been
0.1 mm nearer than found. Steps are left out if the distance before them proves them harmless.
"""

from __future__ import annotations

from itertools import pairwise
from math import inf

import numpy as np
from random_cells import box_of, CellJudge, random_cell
from triangle_distance import moved

from ur_cartesian_driver.kinematics.cell_distances import CellDistances
from ur_cartesian_driver.motion.cell.cell import EMPTY_CELL, LINK_NAMES
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import (
    FreeAxis,
    Goal,
    Segment,
    SegmentType,
    Waypoint,
)

#: Largest approach of two bodies between two steps [m].
STEP = 1e-4
#: Largest number of spheres that cover a surface of a body.
_SLICES = 10
KINDS = ('primitives', 'spline', 'rounded', 'free axis')


# -- goals ----------------------------------------------------------------------------------------


def random_goal(rng, kind, start):
    """Return a goal of a kind, of 2 to 6 points, from a pose."""
    count = int(rng.integers(2, 7))
    lengths = rng.uniform(0.03, 0.15, count)
    places, way = [np.array(start.position)], rng.normal(size=3)
    for length in lengths:
        way = 0.6 * way / np.linalg.norm(way) + rng.normal(size=3)
        places.append(places[-1] + length * way / np.linalg.norm(way))
    poses = []
    for place in places[1:]:
        turn = Pose(
            (0.0, 0.0, 0.0), quaternion_from_rotation_vector(tuple(rng.normal(0, 0.15, 3)))
        )
        poses.append(Pose(tuple(place.tolist()), (start @ turn).quaternion))
    speeds = rng.uniform(0.15, 0.24, count)
    if kind == 'spline':
        times = np.cumsum(1.6 * lengths / speeds + 0.2)
        return Goal(
            waypoints=tuple(
                Waypoint(pose=pose, time=time)
                for pose, time in zip(poses, times.tolist(), strict=True)
            ),
            execution=ExecutionMode.SPLINE,
        )
    kinds = {
        'primitives': [SegmentType.LINEAR, SegmentType.JOINT, SegmentType.CIRCULAR],
        'rounded': [SegmentType.LINEAR, SegmentType.CIRCULAR],
        'free axis': [SegmentType.LINEAR],
    }[kind]
    radii = [*(rng.uniform(0.1, 0.45) * np.minimum(lengths[:-1], lengths[1:])), 0.0]
    segments = []
    for k, (a, b) in enumerate(pairwise(places)):
        of, side = SegmentType(rng.choice(kinds)), np.cross(b - a, rng.normal(size=3))
        via = 0.5 * (a + b) + 0.3 * lengths[k] * side / np.linalg.norm(side)
        segments.append(
            Segment(
                type=of,
                velocity=float(speeds[k]),
                blend_radius=0.0 if kind == 'rounded' else float(radii[k]),
                via=Pose(tuple(via.tolist()), start.quaternion)
                if of == SegmentType.CIRCULAR
                else None,
                free_axis=FreeAxis.Z if kind == 'free axis' else FreeAxis.NONE,
                free_min=-1.0 if kind == 'free axis' else 0.0,
                free_max=1.0 if kind == 'free axis' else 0.0,
            )
        )
    return Goal(
        waypoints=tuple(Waypoint(pose=pose) for pose in poses),
        segments=tuple(segments),
        corner_deviation=0.002 if kind == 'rounded' else 0.0,
    )


def cell_beside(rng, arm, tcp, q, goal):
    """Return a cell with bodies beside a goal; none is too close to its start joints (6,)."""
    ways = np.array([point.pose.position for point in goal.waypoints])
    frames = CellJudge(arm, tcp, EMPTY_CELL).frames(q)
    away = rng.normal(size=(len(ways), 3)) * 0.12
    places = np.concatenate([ways + away, frames[3:7, :3, 3] + 0.25 * rng.normal(size=(4, 3))])
    cell = random_cell(rng, places, spread=0.1, largest=0.25)
    for pair, _ in CellDistances(arm, tcp, cell).pairs_below(np.array(q)):
        if named := sorted({pair.a, pair.b} & cell.names):
            cell = cell.without(named[0])
    return cell


# -- traces ---------------------------------------------------------------------------------------


def short_of(clearance, distance):
    """Return the shortfall of a distance [m]; above 0 for touching bodies, without their depth."""
    return max(clearance - distance, 0.0 if distance > 0.0 else 1e-9)


class TraceJudge:
    """
    The distances of the bodies of a cell along a trace.

    :param q: (n, 6) joints by cycle [rad].
    """

    def __init__(self, arm, tcp, cell, q):
        self.judge, self.cell = CellJudge(arm, tcp, cell), cell
        self.q = np.asarray(q)
        self.frames = np.array([self.judge.frames(row) for row in self.q])
        parts = self.judge.parts
        self._covers = {name: _cover(of) for name, of in parts.items()}
        self._ways = {}
        for name, of in parts.items():
            corners = [moved(box_of(part), part.T)[0] for part in of if not part.is_half_space]
            carrier = self.judge.carriers[name]
            if not corners or carrier == 0:
                self._ways[name] = np.zeros(len(self.q) - 1)
                continue
            T = self.frames[:, carrier]
            points = np.concatenate(corners) @ T[:, :3, :3].transpose(0, 2, 1) + T[:, None, :3, 3]
            self._ways[name] = np.linalg.norm(np.diff(points, axis=0), axis=2).max(axis=1)

    def pairs(self):
        """Return the measured pairs, and the distances that they have to keep [m]."""
        carriers, found = self.judge.carriers, []
        for k, body in enumerate(self.cell.bodies):
            for other in (*LINK_NAMES[:7], *(each.name for each in self.cell.bodies[:k])):
                # Wrist 3 and the flange are one link.
                if min(carriers[other], 6) == min(carriers[body.name], 6):
                    continue
                clearance = self.cell.clearance_of(body)
                if other in self.cell.names:
                    clearance = max(clearance, self.cell.clearance_of(self.cell.body(other)))
                found.append((other, body.name, clearance))
        return found

    def nearest(self):
        """Return the largest shortfall of a pair below its clearance [m], and the pair."""
        found = [(self.shortfall(*pair), pair) for pair in self.pairs()]
        return max(found, default=(0.0, None))

    def shortfall(self, a, b, clearance):
        """Return the largest shortfall of two bodies below a clearance [m]; 0 = none."""
        ways = self._ways[a] + self._ways[b]
        along = np.append(0.0, np.cumsum(ways))
        lower = self._lower(a, b)
        candidates = np.flatnonzero(lower[:-1] - ways < clearance)
        row, worst = 0, 0.0
        while True:
            next_one = np.searchsorted(candidates, row)
            if next_one == len(candidates):
                return worst
            row = int(candidates[next_one])
            low, high = self.judge.distances(a, b, self.frames[row])
            worst = max(worst, short_of(clearance, high))
            if low > clearance:
                proved = along[row] + low - clearance + 2.0 * STEP
                reached = int(np.searchsorted(along, proved)) - 1
                if reached > row:
                    row = reached
                    continue
            worst = max(worst, self._between(row, a, b, clearance, ways[row], low - clearance))
            if worst > STEP:
                return worst
            row += 1

    def _between(self, row, a, b, clearance, way, slack):
        """Return the shortfall between two cycles."""
        part, worst = 0.0, 0.0
        while True:
            # A step covers the slack and 2 STEP: if both of its ends keep the clearance, no place
            # between falls short by more than STEP.
            part += (max(slack, 0.0) + 2.0 * STEP) / max(way, 1e-12)
            if part >= 1.0:
                return worst
            q = self.q[row] + part * (self.q[row + 1] - self.q[row])
            low, high = self.judge.distances(a, b, self.judge.frames(q))
            worst, slack = max(worst, short_of(clearance, high)), low - clearance

    def _lower(self, a, b):
        """Return lower bounds (n,) of the distances of two bodies, by spheres around one."""
        if any(part.is_half_space for part in self.judge.parts[a]):
            a, b = b, a
        centres, radii = self._covers[a]
        T = self.frames[:, self.judge.carriers[a]]
        points = centres @ T[:, :3, :3].transpose(0, 2, 1) + T[:, None, :3, 3]
        lowest = np.full(len(T), inf)
        for part in self.judge.parts[b]:
            place = self.frames[:, self.judge.carriers[b]] @ part.T
            local = (points - place[:, None, :3, 3]) @ place[:, :3, :3]
            if part.is_half_space:
                apart = local[..., 2]
            else:
                low, high = part.outer.min(axis=(0, 1)), part.outer.max(axis=(0, 1))
                beyond = np.maximum(np.maximum(low - local, local - high), 0.0)
                apart = np.sqrt(np.einsum('nkc,nkc->nk', beyond, beyond)) - part.radius
            lowest = np.minimum(lowest, (apart - radii).min(axis=1))
        return lowest


def _cover(parts):
    """Return centres (k, 3) on the carrier and radii (k,) of spheres around some parts."""
    centres, radii = [np.empty((0, 3))], [np.empty(0)]
    for part in parts:
        if part.is_half_space:
            continue
        triangles = moved(part.outer, part.T)
        middles = triangles.mean(axis=1)
        along = middles[:, int(np.argmax(np.ptp(triangles.reshape(-1, 3), axis=0)))]
        for some in np.array_split(np.argsort(along), min(_SLICES, len(along))):
            points = triangles[some].reshape(-1, 3)
            centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
            centres.append(centre[None])
            radii.append(np.linalg.norm(points - centre, axis=1).max(keepdims=True) + part.radius)
    return np.concatenate(centres), np.concatenate(radii)
