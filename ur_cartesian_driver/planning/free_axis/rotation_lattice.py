# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Search for the rotation about a free axis along a path by dynamic programming over a lattice.

A *layer* is a place at which the rotation can be chosen, and its *nodes* are rotations. An *edge*
connects nodes of two layers; along an edge, the rotation changes linearly, as on a line of the
robot, and the arm is solved at the *samples* between the layers. Each branch of the arm has a
closed-form solution, so all rotations of all samples are solved at once into a table, in which
edges look up their joints. Each node keeps the joints of the best way to it, so that full turns
are tracked and joint limits hold along that way.

The search is first coarse, over all rotations, then finer and finer around the best way.

Rotations are angles [rad] about the axis from the reference orientation, which goes along the path
without turning about the axis. Rotations are not wrapped: two rotations that differ by a full turn
are different nodes, because their joints differ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf, pi, tau

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.closed_form_rows import (
    branch_rows,
    BRANCHES,
    BranchSolution,
    TargetPoses,
)
from ur_cartesian_driver.kinematics.ideal_arm import ideal_arm_of
from ur_cartesian_driver.kinematics.inverse_rows import branch_measures
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Int64s
from ur_cartesian_driver.motion.geometry.pose_rows import multiply_rows
from ur_cartesian_driver.motion.geometry.vectors import Joints
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.preflight.tightest_margins import (
    singularity_distance_rows,
    SINGULARITY_MEASURES,
)

#: Number of rotations in a full turn in the coarse search.
TURN_COUNT = 72
#: Step of the coarse search [rad].
COARSE_STEP = tau / TURN_COUNT
#: Steps of the finer searches [rad].
_FINE_STEPS = tuple(COARSE_STEP / 3**k for k in (1, 2, 3))
#: Number of rotations that a finer search tries on each side of the previous best.
_FINE_REACH = 3
#: Numbers of full turns that are added to rotations to make further nodes.
_COPIES = (-1, 0, 1)
#: Greatest change of the rotation from layer to layer [rad]: less than half a turn, because the
#: direction of a half turn is ambiguous.
_MAX_CHANGE = 0.95 * pi
#: A joint that turns farther than this [rad] between two samples counts as jumping.
_MAX_JOINT_STEP = 1.0
#: Greatest deviation [rad] of the axis from the shortest way between two points; the axis deviates
#: if the tool turns and tilts at once.
MAX_AXIS_DEVIATION = pi / 180.0

# The cost of an edge is the sum of the turns of all joints [rad] and of the terms that follow.
#: Weight of the squared change of the rotation, which spreads the change evenly.
_EVENNESS = 2.0
#: Distances from joint limits [rad] and from singularities (as fractions of their scales) that are
#: below this add a cost.
_WIDE_MARGIN = 0.6
#: Weight of the cost of these distances, per unit of path (``RotationSamples.sizes``).
_NEARNESS = 1.0
#: Penalty per unit of path where the arm is so near a singularity that the planner would refuse.
_REFUSED = 50.0
#: Penalty per radian by which a joint turns farther than its speed limit allows in the time.
_TOO_FAST = 50.0
#: Penalty for a distance from the posture of a point [1/rad].
_OFF_POSTURE = 20.0
#: Joint moves are tried from at most this many nodes, the cheapest ones.
_JOINT_SOURCES = 24
#: Number of layers whose edges a finer search computes at once, small enough for the CPU cache.
_BLOCK = 32
_SCALES = np.array([measure.scale for measure in SINGULARITY_MEASURES])


@dataclass(frozen=True, slots=True, kw_only=True)
class Layer:
    """A place at which the rotation can be chosen, and the samples of the path to it."""

    #: The samples have the rows ``begin`` to ``end - 1``; the last of them is the place itself.
    begin: int
    end: int
    #: Allowed rotations [rad]: any, or from ``low`` to ``high`` plus any number of full turns.
    low: float = -inf
    high: float = inf
    #: Whether a joint move, which may change branch and full turns, leads to the place.
    is_joint: bool = False
    #: Whether a joint move must end in the nearest solution, because the rotation is fixed and no
    #: posture is given.
    is_nearest: bool = False
    #: Largest change of the rotation from the previous layer [rad].
    max_change: float = _MAX_CHANGE
    #: Requested joint positions [rad]; NaN = no request for that joint.
    posture: Joints | None = None

    def turns(self, rotation: float) -> float:
        """Return the full turns [rad] by which the range is shifted to lie around a rotation."""
        return tau * round((rotation - 0.5 * (self.low + self.high)) / tau)

    @property
    def is_any(self) -> bool:
        """Whether all rotations are allowed."""
        return self.low == -inf


@dataclass(frozen=True, slots=True, kw_only=True)
class RotationSamples:
    """The samples of a path; columns (n,)."""

    #: (n, 7) the reference pose of the controlled frame in the frame of the path.
    poses: Floats
    #: Fractions, in (0, 1], of the way from the previous layer to the next one.
    fractions: Floats
    #: Size of the path from the previous sample: lengths in units of 5 cm plus tilts [rad].
    sizes: Floats
    #: Time from the previous sample [s]; inf = unknown.
    times: Floats

    def __len__(self) -> int:
        return len(self.fractions)


@dataclass(slots=True)
class RotationPath:
    """The chosen rotation at each layer, and the branch and joints of the arm there."""

    #: (layers,) rotations [rad].
    rotations: Floats
    #: (layers,) numbers of the branches.
    branches: Int64s
    #: (layers, 6) joint positions [rad].
    joints: Floats


class NoRotation(Exception):
    """There is no way through the lattice."""


@dataclass(slots=True)
class _Tables:
    """
    The arm at each sample: joints (n, 6, branches, rotations), costs (n, branches, rotations).

    The array axis of the joints comes early, as in all arrays of the search: numpy sums over an
    outer array axis many times faster than over the innermost one.
    """

    #: (n,) first rotation at each sample [rad].
    first: Floats
    #: Step from rotation to rotation [rad].
    step: float
    #: Whether the rotations fill a full turn.
    is_round: bool
    #: Joint positions [rad].
    q: Floats
    #: Costs of these joint positions; inf = no solution.
    cost: Floats

    def look_up(self, sample: int | Int64s, rotations: Floats) -> Int64s:
        """
        Return the indices of the table's rotations that are nearest to ``rotations``.

        :param sample: the sample of all rotations, or the sample of each.
        """
        index: Int64s = np.rint((rotations - self.first[sample]) / self.step).astype(np.int64)
        count = self.q.shape[3]
        return np.mod(index, count) if self.is_round else np.clip(index, 0, count - 1)


@dataclass(slots=True)
class RotationLattice:
    """
    The lattice of one path.

    :param kinematics: the kinematics of the controlled frame, which has the free axis.
    :param axis: unit vector of the free axis in the controlled frame.
    """

    kinematics: TcpKinematics
    axis: tuple[float, float, float]
    samples: RotationSamples
    layers: Sequence[Layer]
    q_start: Joints
    options: PlanningOptions
    #: By sample: additional costs of the coarse rotations (8 branches, 72 rotations).
    _charges: dict[int, Floats] = field(default_factory=dict)
    _coarse: _Tables | None = None
    _speeds: Floats = field(init=False)
    _ranges: tuple[Floats, Floats] = field(init=False)
    #: The first sample of each layer, with the number of samples appended; whether each layer is
    #: reached by a joint move.
    _begins: Int64s = field(init=False)
    _is_joint: Flags = field(init=False)
    #: (n,) the layer of each sample.
    _layer: Int64s = field(init=False)

    def __post_init__(self) -> None:
        """Read the limits of the joints, and the layers."""
        self._begins = np.array([*(layer.begin for layer in self.layers), len(self.samples)])
        self._is_joint = np.array([layer.is_joint for layer in self.layers])
        self._layer = np.repeat(np.arange(len(self.layers)), np.diff(self._begins))
        low, high = np.array(self.arm.model.position_limits).T
        self._ranges = _column(low), _column(high)
        self._speeds = _column(self.arm.model.max_joint_speed)

    def search(self) -> RotationPath:
        """
        Return the best way through the lattice.

        :raises NoRotation: no way leads through all layers.
        """
        if self._coarse is None:
            branches = range(8) if any(layer.is_joint for layer in self.layers) else (self._start,)
            self._coarse = self._tables(
                np.zeros(len(self.samples)), COARSE_STEP, TURN_COUNT, tuple(branches)
            )
        found = self._best_path(self._coarse)
        for step in _FINE_STEPS:
            found = self._refined(found, step)
        return found

    def along(self, rotations: Floats) -> Floats:
        """Return the rotation at each sample (n,), interpolated between the layers."""
        before = np.concatenate([[0.0], rotations])[self._layer]
        part = np.where(self._is_joint[self._layer], 1.0, self.samples.fractions)
        along: Floats = before + part * (rotations[self._layer] - before)
        return along

    def joints_along(self, path: RotationPath) -> Floats:
        """Return the joint positions (n, 6) [rad] at the samples, possibly off by full turns."""
        rotations = self.along(path.rotations)
        tables = self._tables(rotations, COARSE_STEP, 1, self.sample_branches(path))
        return tables.q[:, :, 0, 0]

    def charge(self, sample: int, branch: int, costs: Floats) -> None:
        """Add ``costs`` (72,) to the coarse rotations of a branch at a sample."""
        known = self._charges.setdefault(sample, np.zeros((8, TURN_COUNT)))
        known[branch] += costs
        if self._coarse is not None:
            self._coarse.cost[sample, branch if self._coarse.cost.shape[1] > 1 else 0] += costs

    def coarse_joints(self, sample: int, branch: int) -> Floats:
        """Return the joint positions (72, 6) [rad] of a branch's coarse rotations at a sample."""
        poses = self._flange_poses(
            np.full(TURN_COUNT, sample), COARSE_STEP * np.arange(TURN_COUNT, dtype=np.float64)
        )
        solution = branch_rows(ideal_arm_of(self.arm), TargetPoses.of(poses), BRANCHES[branch])
        return solution.q.T

    def sample_branches(self, path: RotationPath) -> Int64s:
        """Return the branch of a rotation path at each sample (n,)."""
        return path.branches[self._layer]

    @property
    def arm(self) -> Arm:
        """The arm; the lattice is solved for its ideal arm."""
        return self.kinematics.arm

    @property
    def _start(self) -> int:
        return int(branch_measures(self.arm, np.array([self.q_start])).branch[0])

    # -- tables ----------------------------------------------------------------------------------

    def _flange_poses(self, samples: Int64s, rotations: Floats) -> Floats:
        """Return the flange poses (n, 7) at samples that are rotated about the free axis."""
        half = 0.5 * rotations[:, None]
        turn = np.concatenate([np.sin(half) * np.array(self.axis), np.cos(half)], axis=1)
        rows = self.samples.poses[samples].copy()
        rows[:, 3:] = multiply_rows(rows[:, 3:], turn)
        return self.kinematics.flange_rows(rows)

    def _tables(
        self, first: Floats, step: float, count: int, branches: tuple[int, ...] | Int64s
    ) -> _Tables:
        """
        Return the table of the arm at all samples.

        :param branches: a tuple of branches for all samples, or one branch for each sample (n,).
        """
        n = len(self.samples)
        sample = np.repeat(np.arange(n), count)
        rotations = np.repeat(first, count) + step * np.tile(np.arange(count), n)
        targets = TargetPoses.of(self._flange_poses(sample, rotations))
        ideal = ideal_arm_of(self.arm)
        if isinstance(branches, tuple):
            columns = [self._solve(branch_rows(ideal, targets, BRANCHES[b])) for b in branches]
            q = np.stack([q for q, _ in columns], axis=1)
            cost = np.stack([cost for _, cost in columns], axis=1)
            numbers = np.broadcast_to(np.array(branches), (n, len(branches)))
        else:
            q, cost = np.empty((n * count, 1, 6)), np.empty((n * count, 1))
            of_row = np.repeat(branches, count)
            for b in np.unique(branches):
                rows = np.flatnonzero(of_row == b)
                q[rows, 0], cost[rows, 0] = self._solve(
                    branch_rows(ideal, targets.rows(rows), BRANCHES[b])
                )
            numbers = branches[:, None]
        width = q.shape[1]
        q = np.ascontiguousarray(q.reshape(n, count, width, 6).transpose(0, 3, 2, 1))
        cost = cost.reshape(n, count, width).swapaxes(1, 2) * self.samples.sizes[:, None, None]
        for row, charges in self._charges.items():
            which = np.rint((first[row] + step * np.arange(count)) / COARSE_STEP).astype(np.int64)
            cost[row] += charges[numbers[row]][:, which % TURN_COUNT]
        is_round = count * step > tau - 1e-9
        return _Tables(first=first, step=step, is_round=is_round, q=q, cost=cost)

    def _solve(self, solution: BranchSolution) -> tuple[Floats, Floats]:
        """Return joints (n, 6), and costs (n,) of nearness to singularities per unit of path."""
        q = solution.q.T
        distances = singularity_distance_rows(self.arm, q)
        bounds = np.array([getattr(self.options, m.option) for m in SINGULARITY_MEASURES])
        cost = _nearness((distances / _SCALES).min(axis=1))
        cost += np.where((distances < bounds).any(axis=1), _REFUSED, 0.0)
        cost[~solution.exists] = inf
        return q, cost

    # -- nodes -----------------------------------------------------------------------------------

    def _coarse_nodes(self, layer: Layer) -> Floats:
        """Return the ascending rotations of a layer in the coarse search."""
        if layer.is_any:
            one = COARSE_STEP * (np.arange(TURN_COUNT) - TURN_COUNT // 2)
        else:
            count = int(np.ceil((layer.high - layer.low) / COARSE_STEP)) + 1
            one = np.linspace(layer.low, layer.high, count)
            one = one - tau * np.rint(one.mean() / tau)
        return np.concatenate([one + tau * k for k in _COPIES])

    # -- finer searches --------------------------------------------------------------------------

    def _refined(self, path: RotationPath, step: float) -> RotationPath:
        """Return the best way in the neighbourhood of ``path``, with a finer step."""
        first = self.along(path.rotations) - _FINE_REACH * step
        tables = self._tables(first, step, 2 * _FINE_REACH + 1, self.sample_branches(path))
        offsets = step * np.arange(-_FINE_REACH, _FINE_REACH + 1)
        nodes = np.concatenate([[0.0], path.rotations])[:, None] + offsets
        nodes[0] = 0.0  # the start
        for number, layer in enumerate(self.layers, 1):
            if not layer.is_any:
                turns = layer.turns(float(path.rotations[number - 1]))
                nodes[number] = np.clip(nodes[number], layer.low + turns, layer.high + turns)
        ends = self._begins[1:] - 1
        joints = _taken(tables.q[ends], tables.look_up(ends[:, None], nodes[1:]))
        # Choose the full turns that bring the joints nearest to the joints on ``path``.
        joints += tau * np.rint((path.joints.T[:, :, None] - joints) / tau)
        start = np.broadcast_to(np.array(self.q_start)[:, None, None], (6, 1, len(offsets)))
        joints = np.concatenate([start, joints], axis=1)
        sources, cost = np.zeros(nodes.shape, dtype=np.int64), np.zeros(len(offsets))
        for number in range(len(self.layers)):
            if number % _BLOCK == 0:
                edges = self._fine_edges(tables, nodes, joints, number)
            total = edges[number % _BLOCK] + cost
            sources[number + 1], cost = total.argmin(axis=1), total.min(axis=1)
            if np.isinf(cost).all():
                raise NoRotation
        best = np.empty(len(nodes), dtype=np.int64)
        best[-1] = np.argmin(cost)
        for number in range(len(self.layers), 0, -1):
            best[number - 1] = sources[number, best[number]]
        row, best = np.arange(1, len(nodes)), best[1:]
        return RotationPath(nodes[row, best], path.branches, joints[:, row, best].T)

    def _fine_edges(self, tables: _Tables, nodes: Floats, joints: Floats, first: int) -> Floats:
        """
        Return the costs (layers, targets, sources) of the edges to a block of layers.

        :param nodes: (1 + layers, k) rotations at the start and on all layers.
        :param joints: (6, 1 + layers, k) joint positions there.
        :param first: the first layer of the block.
        """
        block = slice(first, first + _BLOCK)
        is_joint, begins = self._is_joint[block], self._begins[first : first + _BLOCK + 1]
        rows, layer = np.arange(begins[0], begins[-1]), self._layer[begins[0] : begins[-1]] - first
        begins, ends = begins[:-1] - begins[0], begins[1:] - 1 - begins[0]
        sources, q_sources = nodes[:-1][block, None], joints[:, :-1][:, block, None]
        targets, q_targets = nodes[1:][block, :, None], joints[:, 1:][:, block, :, None]
        change = targets - sources
        samples, sizes = self.samples, self.samples.sizes[rows, None, None]
        rotations = sources[layer] + samples.fractions[rows, None, None] * change[layer]
        rotations[ends] = targets
        entry = tables.look_up(rows[:, None, None], rotations)
        q = _taken(tables.q[rows], entry)
        turn = np.diff(q, axis=1, prepend=q[:, :1])
        turn[:, begins] = q[:, begins] - q_sources
        turn -= tau * np.rint(turn / tau)
        turn[:, ends[is_joint]] = (q_targets - q_sources)[:, is_joint]
        here = np.cumsum(turn, axis=1)
        here += (q_sources - (here - turn)[:, begins])[:, layer]
        # An edge must end at the joints of its target node, not a full turn away from them.
        jumps: Flags = np.any(np.abs(here[:, ends] - q_targets) > _MAX_JOINT_STEP, axis=0)
        turn = np.abs(turn)
        is_joint = is_joint[:, None, None]
        cost = turn.sum(axis=0) + _taken(tables.cost[rows, None], entry)[0]
        cost += self._limits(here, np.where(is_joint[layer], 1.0, sizes))
        cost[(turn.max(axis=0) > _MAX_JOINT_STEP) & ~is_joint[layer]] = inf
        turn -= self._speeds * samples.times[rows, None, None] + tables.step
        cost += _TOO_FAST * np.maximum(turn, 0.0).sum(axis=0)
        evenness = _EVENNESS / np.maximum(np.add.reduceat(sizes, begins), 1e-6)
        edges: Floats = np.add.reduceat(cost, begins)
        edges += np.where(is_joint, 0.0, evenness * change**2)
        for number, each in enumerate(self.layers[block]):
            reach = inf if each.is_joint else min(each.max_change, _MAX_CHANGE) + 1e-9
            edges[number][(np.abs(change[number]) > reach) | jumps[number]] = inf
            edges[number, None] += self._off_posture(each, q_targets[:, number, None])
        return edges

    # -- coarse search ---------------------------------------------------------------------------

    def _best_path(self, tables: _Tables) -> RotationPath:
        """Return the best way through the coarse nodes of all layers."""
        branches = np.arange(8) if tables.q.shape[2] == 8 else np.array([self._start])
        cost = np.where(branches == self._start, 0.0, inf)[:, None]
        q = np.broadcast_to(np.array(self.q_start)[:, None, None], (6, len(cost), 1))
        rotations = np.zeros(1)
        back: list[tuple[Int64s, Floats, Floats]] = []
        for layer in self.layers:
            targets = self._coarse_nodes(layer)
            if layer.is_joint:
                step_to = self._joint_edges(tables, layer, targets, cost, q)
            else:
                step_to = self._edges(tables, layer, targets, rotations, cost, q)
            cost, q, source, rotations = step_to
            if not np.isfinite(cost).any():
                raise NoRotation
            back.append((source, rotations, q))
        n = len(back)
        path = RotationPath(np.empty(n), np.empty(n, dtype=np.int64), np.empty((n, 6)))
        b, k = divmod(int(np.argmin(cost)), cost.shape[1])
        for number in range(n - 1, -1, -1):
            source, rotations, q = back[number]
            path.rotations[number], path.joints[number] = rotations[k], q[:, b, k]
            path.branches[number] = branches[b]
            width = len(back[number - 1][1]) if number else 1
            b, k = divmod(int(source[b, k]), width)
        return path

    def _edges(
        self,
        tables: _Tables,
        layer: Layer,
        targets: Floats,
        rotations: Floats,
        cost: Floats,
        q: Floats,
    ) -> tuple[Floats, Floats, Int64s, Floats]:
        """
        Return costs (b, k), joints (6, b, k), sources (b, k) and rotations (k,) of a layer.

        Each node is one of b branches at one of k rotations; its values belong to the best way to
        it. A source is an index of the flattened nodes of the layer before.

        :param targets: the rotations of the nodes of ``layer``.
        :param rotations: the rotations (j,) of the layer before.
        :param cost: the costs (b, j) of its nodes; ``q``: their joints (6, b, j).
        """
        reach = min(layer.max_change, _MAX_CHANGE) + 1e-9
        alive = np.flatnonzero(np.isfinite(cost).any(axis=0))
        first, last = int(alive[0]), int(alive[-1]) + 1
        sources = rotations[first:last]
        targets = targets[(targets >= sources[0] - reach) & (targets <= sources[-1] + reach)]
        low = np.searchsorted(sources, targets - reach)
        counts = np.searchsorted(sources, targets + reach, side='right') - low
        offsets = np.arange(counts.max(initial=1))
        index = np.minimum(low[:, None] + offsets, len(sources) - 1)
        change = targets[:, None] - sources[index]
        size = float(self.samples.sizes[layer.begin : layer.end].sum())
        total = np.where(np.abs(change) <= reach, _EVENNESS / max(size, 1e-6) * change**2, inf)
        index = index + first
        total = np.take(cost, index, axis=1) + total
        here = np.take(q, index, axis=2)  # contiguous in memory, unlike the result of indexing
        for sample in range(layer.begin, layer.end):
            if sample == layer.end - 1:
                entry = tables.look_up(sample, targets)[:, None]
            else:
                part = self.samples.fractions[sample]
                entry = tables.look_up(sample, sources[index - first] + part * change)
            turn = np.take(tables.q[sample], entry, axis=2) - here
            turn -= tau * np.rint(turn / tau)
            here = here + turn
            turn = np.abs(turn)
            total = total + turn.sum(axis=0) + tables.cost[sample][:, entry]
            total += self._limits(here, float(self.samples.sizes[sample]))
            total[turn.max(axis=0) > _MAX_JOINT_STEP] = inf
            if (time := self.samples.times[sample]) < inf:
                excess = turn - (self._speeds * time + COARSE_STEP)
                total += _TOO_FAST * np.maximum(excess, 0.0).sum(axis=0)
        total = total + self._off_posture(layer, here)
        best = np.argmin(total, axis=2)
        b, k = np.arange(len(cost))[:, None], np.arange(len(targets))
        source = index[k, best] + len(rotations) * b
        return total[b, k, best], here[:, b, k, best], source, targets

    def _joint_edges(
        self, tables: _Tables, layer: Layer, targets: Floats, cost: Floats, q: Floats
    ) -> tuple[Floats, Floats, Int64s, Floats]:
        """Return the same as :meth:`_edges` for a joint move, which connects any two nodes."""
        sample = layer.end - 1
        flat = cost.ravel()
        sources = np.argsort(flat)[:_JOINT_SOURCES]
        sources = sources[np.isfinite(flat[sources])]
        there = tables.q[sample][:, :, tables.look_up(sample, targets), None]
        start = q.reshape(6, -1)[:, None, None, sources]
        turn = there - start
        turn -= tau * np.rint(turn / tau)
        # The copies of a rotation are reached by full turns of the last joint.
        copies = np.repeat(tau * np.array(_COPIES), len(targets) // len(_COPIES))
        turn[5] += copies[:, None]
        end = start + turn
        total = flat[sources] + np.abs(turn).sum(axis=0)
        total = total + tables.cost[sample][:, tables.look_up(sample, targets)][:, :, None]
        total += self._limits(end, 1.0)
        if layer.is_nearest:
            distance = np.where(np.isfinite(total), np.linalg.norm(turn, axis=0), inf)
            nearest = distance.min(axis=(0, 1))
            total = np.where(distance <= nearest + 1e-9, total, inf)
        total += self._off_posture(layer, end)
        best = np.argmin(total, axis=2)
        b, k = np.arange(total.shape[0])[:, None], np.arange(len(targets))
        return total[b, k, best], end[:, b, k, best], sources[best], targets

    def _limits(self, q: Floats, size: float | Floats) -> Floats:
        """Return the costs of nearness to joint limits on a path of ``size``; inf if exceeded."""
        low, high = self._ranges
        margin = np.minimum(q - low, high - q).min(axis=0)
        return np.where(margin < 0.0, inf, _nearness(margin) * size)

    @staticmethod
    def _off_posture(layer: Layer, q: Floats) -> Floats | float:
        if layer.posture is None:
            return 0.0
        off: Floats = np.nan_to_num(np.abs(q - _column(layer.posture))).sum(axis=0)
        return _OFF_POSTURE * off


def _column(joints: Sequence[float]) -> Floats:
    """Return a value for each joint as an array (6, 1, 1, 1)."""
    return np.array(joints)[:, None, None, None]


def _taken(table: Floats, entry: Int64s) -> Floats:
    """Return the values of a one-branch table (n, k, 1, rotations) at ``entry`` as (k, n, ...)."""
    rows = table[:, :, 0].swapaxes(0, 1)
    taken: Floats = np.take_along_axis(rows, entry.reshape(1, len(entry), -1), axis=2)
    return taken.reshape(len(rows), *entry.shape)


def _nearness(margin: Floats) -> Floats:
    cost: Floats = _NEARNESS * np.maximum(0.0, 1.0 - margin / _WIDE_MARGIN) ** 2
    return cost
