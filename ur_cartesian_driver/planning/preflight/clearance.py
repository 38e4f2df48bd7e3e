# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Check the clearance of the arm from itself, the workspace planes and the cell along its path.

For every row (a sample of the joint positions), the distances of pairs are measured: link to link,
or link to plane, between cylinders that contain the links. Where links come close to each other,
their meshes are measured, if the model has them
(:mod:`~ur_cartesian_driver.kinematics.collision_meshes`). Whether a distance below `min_clearance`
is refused or only reported depends on `self_collision` and the model, never on whether meshes are
installed. An arm that starts too close can move away: a pair that is too close at the start is
accepted while its distance only grows. Once the pair is clear, it is treated like all others.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from math import inf
from typing import NamedTuple

import numpy as np

from ur_cartesian_driver.kinematics.cell_distances import CellDistances, missing_coal, Pair
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.collision_bodies import CollisionBodies, Link
from ur_cartesian_driver.kinematics.collision_meshes import CollisionMeshes, missing_meshes
from ur_cartesian_driver.kinematics.inverse import format_distinct
from ur_cartesian_driver.kinematics.link_shapes import mesh_model, MODELS_WITH_MESHES
from ur_cartesian_driver.motion.cell.cell import Cell, EMPTY_CELL
from ur_cartesian_driver.motion.errors import CollisionPredicted, NotAvailable
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Int32s
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints
from ur_cartesian_driver.motion.geometry.workspace import parse_planes, Plane
from ur_cartesian_driver.motion.goal.goal import PartChange
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.cell_clearance import CellClearance
from ur_cartesian_driver.planning.preflight.cell_stretches import cell_stretches
from ur_cartesian_driver.planning.request.goal_fields import point_field

# Rows per block. Blocks bound the memory; those after a refused violation are not checked.
_BLOCK = 4096
# A separating pair may come closer by this much [m], because of rounding.
_RECEDING_TOLERANCE = 1e-4
# Bodies that overlap by less than this [m] are reported as touching.
_DEPTH_SHOWN = 1e-4
# A tool that works on a plane may be beyond the plane's margin by this rounding error [m].
_ON_PLANE = 1e-6


class JointSamples(NamedTuple):
    """The joints along the path of a goal, in columns of n samples."""

    #: The segment of each sample, by the number of the point at its end.
    segment: Int32s
    #: The fraction of this segment before the sample, 0..1.
    fraction: Floats
    #: Joint positions (n, 6) [rad].
    q: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Violation:
    """A row at which a pair is too close, with the texts about it."""

    #: The row, as an index of the checked configurations.
    row: int
    #: A clause with the pair that is too close, its distance and the bound.
    text: str
    #: A clause that tells how to avoid the violation.
    remedy: str
    #: The names of the two bodies, if the violation is in the cell.
    bodies: tuple[str, ...] = ()
    #: The joints at the violation [rad], if it is in the cell.
    q: Joints | None = None


class ClosestInCell(NamedTuple):
    """The closest approach of two bodies in the cell along a path."""

    #: The row, as an index of the checked configurations.
    row: int
    #: The names of both bodies.
    bodies: tuple[str, str]
    #: Distance of both bodies [m].
    distance: float
    #: Lower bound of the distances of all pairs but neighbouring links on the whole path [m].
    at_least: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ClearanceResult:
    """The clearance of a path."""

    #: The violation for which the goal is refused.
    violation: Violation | None
    #: The violation of which the report only warns.
    warning: Violation | None
    #: The smallest distance of the arm from itself and from the planes [m], without the cell:
    #: negative if cylinders overlap or a plane is crossed, infinite if neither is checked, a lower
    #: bound if measured between cylinders.
    margin: float
    #: The pair with the distance ``margin``, and the shapes between which it was measured.
    description: str
    #: The closest pair in the cell; None = no pair was measured.
    in_cell: ClosestInCell | None = None


class Clearance:
    """
    The clearance of one arm with one tool.

    :param T_flange_tcp: the TCP of the goal, to which the cylinder of the tool reaches.
    :param options: self_collision, min_clearance, tool_radius, workspace_planes and cell are used.
    :param T_flange_active: the active TCP, for bodies in ``tool0_controller``; None = the TCP of
        the goal.
    :raises NotAvailable: the cell has a mesh, and pinocchio, which measures it, is not installed.
    """

    def __init__(
        self,
        arm: Arm,
        T_flange_tcp: Pose,
        options: PlanningOptions,
        T_flange_active: Pose | None = None,
    ) -> None:
        """Create the checkers."""
        bodies = _bodies(arm, T_flange_tcp, options.tool_radius)
        self._checkers: list[_SelfCollisionChecker | _PlaneChecker] = []
        if options.self_collision != 'off':
            self._checkers.append(_SelfCollisionChecker(bodies, T_flange_tcp, options))
        if planes := parse_planes(options.workspace_planes):
            self._checkers.append(_PlaneChecker(bodies, arm, T_flange_tcp, planes))
        self._cell = _cell_clearance(
            arm, T_flange_active or T_flange_tcp, options.cell, options.tool_radius, T_flange_tcp
        )

    def too_close(self, q: Floats) -> Flags:
        """
        Return for each configuration (n, 6) [rad] whether a pair is too close.

        Pairs that would only be warned of count, too. There is no exception for a start that is
        too close.
        """
        close = np.zeros(len(q), dtype=np.bool_)
        for checker in self._checkers:
            exact = np.zeros(len(checker.bounds), dtype=np.bool_)
            for begin in range(0, len(q), _BLOCK):
                rows = slice(begin, begin + _BLOCK)
                _, distances = checker.measure(q[rows], exact)
                close[rows] |= (distances < checker.bounds).any(axis=1)
        if self._cell is not None:
            rest = np.flatnonzero(~close)
            close[rest] = self._cell.too_close(q[rest])
        return close

    def violation_at(self, q: Joints) -> Violation | None:
        """Return a violation if :meth:`too_close` is true of a configuration [rad], else None."""
        row = np.array([q])
        for checker in self._checkers:
            _, distances = checker.measure(row, np.ones(len(checker.bounds), dtype=np.bool_))
            found = _first(checker, distances < checker.bounds, distances, row, 0)
            if found is not None:
                return found
        if self._cell is not None and (pairs := self._cell.bodies.pairs_below(row[0])):
            return _violation_in_cell(*pairs[0], 0, q)
        return None

    def closest(self, q: Floats) -> tuple[Floats, list[tuple[str, str]]]:
        """
        Return the smallest distance and the closest pair in the cell for each configuration.

        :param q: (n, 6) [rad].
        :returns: (n,) the smallest distances [m], infinite if the cell has no pairs, and the names
            of the closest pairs.
        """
        if self._cell is None or not self._cell.bodies.pairs:
            return np.full(len(q), inf), [('', '')] * len(q)
        distances, numbers = self._cell.bodies.closest(q)
        pairs = self._cell.bodies.pairs
        return distances, [(pairs[k].a, pairs[k].b) for k in numbers.tolist()]

    def check(self, q: Floats, q_start: Joints, *, closest: bool = True) -> ClearanceResult:
        """
        Return the first violation, the first warning and the smallest distance.

        :param q: (n, 6) [rad], all configurations of a goal, in order of time.
        :param q_start: the start configuration; pairs that are too close there may separate.
        :param closest: whether to search for the closest pair in the cell, which takes longer.
        """
        #: The first violation, by ``checker.refuses``: True = refused, False = only warned of.
        found: dict[bool, Violation] = {}
        margin, description = inf, ''
        start = np.array([q_start])
        initials = [_InitialViolations(checker, start) for checker in self._checkers]
        for begin in range(0, len(q), _BLOCK):
            for checker, initial in zip(self._checkers, initials, strict=True):
                lower, distances = checker.measure(q[begin : begin + _BLOCK], initial.pending)
                row, column = np.unravel_index(np.argmin(distances), distances.shape)
                if distances[row, column] < margin:
                    margin = float(distances[row, column])
                    description = checker.description(int(column), float(lower[row, column]))
                refused = initial.refused(lower, distances)
                other = _first(checker, refused, distances, q[begin:], begin)
                one = found.get(checker.refuses, other)
                if one is not None and other is not None:
                    found[checker.refuses] = min(one, other, key=lambda each: each.row)
            if True in found:
                break
        in_cell = None
        if self._cell is not None:
            of_cell, in_cell = self._check_cell(self._cell, q, q_start, closest)
            violations = [each for each in (found.get(True), of_cell) if each is not None]
            if violations:
                found[True] = min(violations, key=lambda each: each.row)
        return ClearanceResult(
            violation=found.get(True),
            warning=found.get(False),
            margin=margin,
            description=description,
            in_cell=in_cell,
        )

    @staticmethod
    def _check_cell(
        clearance: CellClearance, q: Floats, q_start: Joints, seeks_closest: bool
    ) -> tuple[Violation | None, ClosestInCell | None]:
        """Return the first violation in the cell, and the closest pair."""
        result = clearance.check(q, q_start, closest=seeks_closest)
        pairs, closest = clearance.bodies.pairs, None
        if result.closest is not None:
            place = result.closest
            names = pairs[place.pair].a, pairs[place.pair].b
            closest = ClosestInCell(place.row, names, place.distance, result.at_least)
        if result.violation is None:
            return None, closest
        place = result.violation
        there = place.joints(q, q_start)
        found = _violation_in_cell(pairs[place.pair], place.distance, place.row, there)
        return found, closest


def _violation_in_cell(pair: Pair, distance: float, row: int, q: Joints) -> Violation:
    """Return the violation of a pair whose distance [m] in a row is below its clearance."""
    if distance > 0.0:
        found, bound = format_distinct(distance, pair.clearance)
        near, than = (
            f'come within {found} m of each other',
            f', less than the clearance of {bound} m',
        )
    else:
        near = f'overlap by {-distance:.4f} m' if distance < -_DEPTH_SHOWN else 'touch'
        than = f', with a clearance of {pair.clearance:.4f} m'
    return Violation(
        row=row,
        text=f'{pair.a} and {pair.b} {near}{than} in the cell',
        remedy='take another path or posture, change the cell, or list the pair in may_touch',
        bodies=(pair.a, pair.b),
        q=q,
    )


@lru_cache(maxsize=8)
def _bodies(arm: Arm, T_flange_tcp: Pose, tool_radius: float) -> CollisionBodies:
    """Return the bodies of an arm, cached because goals for the same arm follow each other."""
    return CollisionBodies(arm, T_flange_tcp, tool_radius)


# This cache is larger because a goal may take and release a dozen parts: the cells that result are
# used again at each corner of the offset band (each combination of the largest path offsets).
@lru_cache(maxsize=32)
def _cell_clearance(
    arm: Arm, T_flange_active: Pose, cell: Cell, tool_radius: float, T_flange_tip: Pose
) -> CellClearance | None:
    """Return the clearance from a cell, cached like :func:`_bodies`; None = the cell is empty."""
    if not cell:
        return None
    if problem := missing_coal(cell):
        raise NotAvailable('cell_file', problem)
    return CellClearance(CellDistances(arm, T_flange_active, cell, tool_radius, T_flange_tip))


def clearance_remarks(clear: ClearanceResult, segment: Int32s, fraction: Floats) -> list[str]:
    """
    Return the report lines about the clearance.

    :param segment: (n,) the segment of each row.
    :param fraction: (n,) the fraction of its segment before each row, 0..1.
    :raises CollisionPredicted: there is a violation for which the goal is refused.
    """
    if clear.violation is not None:
        row = clear.violation.row
        error = CollisionPredicted(
            f'{point_field(int(segment[row]), "pose")}, at {100.0 * fraction[row]:.1f} % of its '
            f'segment: {clear.violation.text}; {clear.violation.remedy}.'
        )
        error.bodies, error.q = clear.violation.bodies, clear.violation.q
        raise error
    lines = []
    if clear.warning is not None:
        row = clear.warning.row
        lines.append(
            f'point {segment[row]}: at {100.0 * fraction[row]:.1f} % of its segment '
            f'{clear.warning.text}'
        )
    if clear.description:
        smallest_distance = f'at least {clear.margin:.3f} m' if clear.margin > 0.0 else 'none'
        lines.append(f'clearance: {smallest_distance} between {clear.description}')
    if clear.in_cell is not None:
        row, (a, b), distance, at_least = clear.in_cell
        lines.append(
            f'cell: {a} and {b} come closest, {distance:.4f} m, at {100.0 * fraction[row]:.0f} % '
            f'of the segment to point {segment[row]}; at least {at_least:.4f} m everywhere'
        )
    return lines


def clearance_lines(
    arm: Arm,
    tool_tips: Sequence[Pose],
    options: PlanningOptions,
    path: JointSamples,
    q_start: Joints,
    part_changes: Sequence[PartChange] = (),
) -> list[str]:
    """Return the report lines about the clearance; for errors see :func:`clearances`."""
    found = clearances(arm, tool_tips, options, path, q_start, part_changes)
    # Two tool tips often give the same line.
    return list(dict.fromkeys(line for _, lines in found for line in lines))


def clearances(
    arm: Arm,
    tool_tips: Sequence[Pose],
    options: PlanningOptions,
    path: JointSamples,
    q_start: Joints,
    part_changes: Sequence[PartChange] = (),
    displaced: Floats | None = None,
    *,
    closest: bool = True,
) -> Iterator[tuple[ClearanceResult, list[str]]]:
    """
    Yield the clearance of each stretch of a path with each tool tip, and its report lines.

    A stretch ends where the tool takes or puts down a body.

    :param tool_tips: the tips in the flange frame, the active TCP first.
    :param part_changes: the bodies that the tool takes or puts down along the path.
    :param displaced: (n, 6) joints displaced by an offset [rad], to check in place of ``path.q``.
    :param closest: whether to search for the closest pair in the cell, which takes longer.
    :raises CollisionPredicted: there is a violation for which the goal is refused.
    """
    checked = path.q if displaced is None else displaced
    active = tool_tips[0]
    stretches = cell_stretches(
        part_changes, path.segment, path.q, q_start, arm, active, options.cell
    )
    for rows, cell, start in stretches:
        used = options if cell is options.cell else replace(options, cell=cell)
        for tip in tool_tips:
            if tip is not active and cell and not options.tool_radius:
                used = replace(used, cell=EMPTY_CELL)  # no shape depends on this tip
            clear = Clearance(arm, tip, used, active).check(checked[rows], start, closest=closest)
            try:
                lines = clearance_remarks(clear, path.segment[rows], path.fraction[rows])
            except CollisionPredicted as error:
                error.cell = cell
                raise
            yield clear, lines


class _InitialViolations:
    """The pairs that were too close at the start and are not clear yet."""

    def __init__(self, checker: _SelfCollisionChecker | _PlaneChecker, start: Floats) -> None:
        lower, distances = checker.measure(start, np.ones(len(checker.bounds), dtype=np.bool_))
        self._bounds = checker.bounds
        #: Whether each pair has been too close since the start.
        self.pending: Flags = distances[0] < checker.bounds
        self._lower, self._reached = lower[0], distances[0]

    def refused(self, lower: Floats, distances: Floats) -> Flags:
        """
        Return for each row and pair (rows, pairs) whether it is too close and not separating.

        Call it with consecutive rows, because it follows the separating pairs.

        :param lower: the distances between cylinders; they tell whether the links separate where
            meshes touch, whose distance is 0.
        :param distances: the distances to compare with the bounds.
        """
        near = distances < self._bounds
        if not (near.any() or self.pending.any()):
            return near
        free = np.logical_or.accumulate(np.vstack([~self.pending, ~near]))
        self._lower, of_cylinders = _is_receding(lower, self._lower)
        self._reached, exact = _is_receding(distances, self._reached)
        leaving = ~free[:-1] & np.where(distances > 0.0, exact, of_cylinders)
        self.pending = ~free[-1]
        refused: Flags = near & ~leaving
        return refused


def _is_receding(values: Floats, reached: Floats) -> tuple[Floats, Flags]:
    """
    Return each column's largest value, and whether each value is at least as large as all before.

    A value that is smaller only by rounding counts as equal.

    :param reached: the largest values before the first row.
    """
    largest = np.maximum.accumulate(np.vstack([reached, values]))
    receding: Flags = values >= largest[:-1] - _RECEDING_TOLERANCE
    return largest[-1], receding


class _SelfCollisionChecker:
    """The check of the links of the arm, and of the tool, against each other."""

    def __init__(
        self, bodies: CollisionBodies, T_flange_tcp: Pose, options: PlanningOptions
    ) -> None:
        self._bodies, self._tcp, self._options = bodies, T_flange_tcp, options
        self._name = bodies.arm.model.name
        self._bound = options.min_clearance
        #: The distance that each pair has to keep [m].
        self.bounds = np.full(len(bodies.pairs), self._bound)
        #: Whether a distance below its bound is refused.
        self.refuses = refuses_self_collision(self._name, options)

    @cached_property
    def _meshes(self) -> CollisionMeshes | None:
        """The meshes; loaded when cylinders first come close, because most goals need none."""
        if missing_meshes(self._name):
            return None
        try:
            return CollisionMeshes(self._bodies.arm, self._tcp, self._options.tool_radius)
        except ImportError:  # pinocchio is broken, for example built for another numpy
            return None

    def description(self, column: int, lower: float) -> str:
        """Return the names of a pair and of the shapes whose distance was measured."""
        a, b = self._bodies.pairs[column]
        exact = lower < self._bound and self._meshes is not None
        return f'{a} and {b} ({self._mesh_name if exact else "cylinders"})'

    @property
    def _mesh_name(self) -> str:
        return f'meshes of the {mesh_model(self._name)}'

    def measure(self, q: Floats, pending: Flags) -> tuple[Floats, Floats]:
        """
        Return the cylinders' distances, and distances to compare with the bounds, (n, pairs).

        :param pending: (pairs,) whether the distances of a pair have to be exact. For other pairs,
            if this check refuses, a distance below the bound may be returned as 0, and a lower
            bound in place of a larger distance, which is faster.
        """
        lower = self._bodies.distances(q, inf if pending.any() else self._bound)
        close = np.flatnonzero((lower < self._bound).any(axis=0))
        if not len(close) or self._meshes is None:
            return lower, lower
        distances = lower.copy()
        for column in close:
            pair = self._bodies.pairs[column]
            rows = np.flatnonzero(lower[:, column] < self._bound)
            if pending[column] or not self.refuses:
                distances[rows, column] = self._meshes.distances(pair, q[rows])
            else:
                near, lower_bounds = self._meshes.nearer_than(self._bound, pair, q[rows])
                distances[rows, column] = np.where(near, 0.0, lower_bounds)
        return lower, distances

    def violation(self, row: int, column: int, distance: float, q: Floats) -> Violation:
        """Return the violation at a row, whose joints are ``q`` (1, 6)."""
        a, b = self._bodies.pairs[column]
        if self._meshes is not None:
            distance = float(self._meshes.distances((a, b), q)[0])
            shapes, advice = self._mesh_name, ''
        else:
            shapes = 'cylinders that contain the arm'
            advice = '; self_collision decides whether cylinders refuse'
        near = f'come within {distance:.4f} m of each other' if distance > 0.0 else 'touch'
        return Violation(
            row=row,
            text=f'{a} and {b} {near}, less than min_clearance = {self._bound:.4f} m '
            f'(measured between {shapes})',
            remedy=f'take another path or posture, or lower min_clearance{advice}',
        )


def refuses_self_collision(name: str, options: PlanningOptions) -> bool:
    """Return whether self-collisions of a model are refused, and not only warned of."""
    choice = options.self_collision
    return choice == 'refuse' or (choice == 'auto' and name in MODELS_WITH_MESHES)


def self_collision_remark(name: str, options: PlanningOptions) -> str:
    """Return a sentence about missing meshes of a model; '' = there is nothing to tell."""
    missing, refuses = missing_meshes(name), refuses_self_collision(name, options)
    if not missing or options.self_collision == 'off':
        return ''
    if name not in MODELS_WITH_MESHES and not refuses:
        return ''  # no meshes exist, and nothing is refused
    verdict = 'refuse' if refuses else 'warn of'
    return (
        f'{missing[0].upper()}{missing[1:]}: cylinders that contain the arm {verdict} '
        f'self-collisions (self_collision is {options.self_collision}).'
    )


class _PlaneChecker:
    """The check of the TCP, the tool and all links but the base against the workspace planes."""

    def __init__(
        self, bodies: CollisionBodies, arm: Arm, T_flange_tcp: Pose, planes: Sequence[Plane]
    ) -> None:
        self._bodies, self._arm, self._planes = bodies, arm, planes
        self._tcp = T_flange_tcp.position
        self._normals = np.array([plane.normal for plane in planes])
        self._offsets = np.array([np.dot(plane.normal, plane.point) for plane in planes])
        moving = [k for k, link in enumerate(bodies.links) if link != Link.BASE]
        links = [bodies.links[k] for k in moving]
        self._moving = slice(moving[0], None)
        # Bodies of the same link are adjacent.
        self._begins = [i for i, link in enumerate(links) if i == 0 or links[i - 1] != link]
        self._names = [str(links[i]) for i in self._begins] + ['TCP']
        self.bounds = np.repeat([plane.margin - _ON_PLANE for plane in planes], len(self._names))
        self.refuses = True

    def description(self, column: int, lower: float) -> str:
        """Return the names of a link and a plane."""
        number, which = divmod(column, len(self._names))
        return f'{self._names[which]} and the plane "{self._planes[number].name}"'

    def measure(self, q: Floats, pending: Flags) -> tuple[Floats, Floats]:
        """
        Return the heights of links and TCP above the planes [m], a column for each pair.

        They are returned twice, as both results of :meth:`_SelfCollisionChecker.measure`.
        """
        low = self._bodies.heights(q, self._normals)[:, :, self._moving]
        links = np.minimum.reduceat(low, self._begins, axis=2)
        tcp = np.array(self._arm.frames_rows(q).point(self._tcp))
        heights = np.concatenate([links, (self._normals @ tcp).T[:, :, None]], axis=2)
        distances = (heights - self._offsets[:, None]).reshape(len(q), -1)
        return distances, distances

    def violation(self, row: int, column: int, distance: float, q: Floats) -> Violation:
        """Return the violation at a row."""
        number, which = divmod(column, len(self._names))
        plane, name = self._planes[number], self._names[which]
        name = 'the TCP' if name == 'TCP' else name
        if distance < -_ON_PLANE:
            text = f'{name} is {-distance:.4f} m beyond the workspace plane "{plane.name}"'
        else:
            text = f'{name} comes within {distance:.4f} m of the workspace plane "{plane.name}"'
        if plane.margin > 0.0:
            text += f', whose margin is {plane.margin:.4f} m'
        return Violation(
            row=row,
            text=text,
            remedy='stay on the side to which its normal points, or change workspace_planes',
        )


def _first(
    checker: _SelfCollisionChecker | _PlaneChecker,
    refused: Flags,
    distances: Floats,
    q: Floats,
    begin: int,
) -> Violation | None:
    """Return the violation of the pair farthest below its bound in the first refused row."""
    rows = np.flatnonzero(refused.any(axis=1))
    if not len(rows):
        return None
    row = int(rows[0])
    column = int(np.argmin(np.where(refused[row], distances[row] - checker.bounds, inf)))
    return checker.violation(begin + row, column, float(distances[row, column]), q[row : row + 1])
