# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Choose the rotations of a goal with a free axis, an axis about which the driver may turn the tool.

The result is a goal with the chosen orientations and without a free axis, which is planned and
checked like any other goal. So the search here need not be exact: it uses samples of the path and
the ideal arm that fits the calibrated arm best, and ignores blends.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import degrees, inf, nan, pi, tau

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices
from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    multiply,
    normalize,
    Quaternion,
    rotate,
)
from ur_cartesian_driver.motion.geometry.pose_rows import (
    angle_rows,
    conjugate_rows,
    cross_rows,
    distance_rows,
    interpolate_rows,
    multiply_rows,
    normalized_rows,
    transform_rows,
)
from ur_cartesian_driver.motion.geometry.vectors import cross, dot, Vector3, vector6
from ur_cartesian_driver.motion.goal.goal import FreeAxis, Posture
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable, SegmentRows
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.free_axis.rotation_lattice import (
    Layer,
    MAX_AXIS_DEVIATION,
    RotationLattice,
    RotationPath,
    RotationSamples,
)
from ur_cartesian_driver.planning.geometry.curves import goal_arcs
from ur_cartesian_driver.planning.geometry.samples import counted
from ur_cartesian_driver.planning.options import MAX_CLEARANCE, PlanningOptions
from ur_cartesian_driver.planning.preflight.clearance import Clearance
from ur_cartesian_driver.planning.preflight.held_part_kinematics import kinematics_of
from ur_cartesian_driver.planning.request.controlled_frame import is_same_tcp, tool_tips
from ur_cartesian_driver.planning.request.goal_fields import (
    IS_JOINT_MOVE,
    IS_OPTIMIZED,
    is_spline,
    is_timed,
)
from ur_cartesian_driver.planning.request.joint_points import named_joints

#: Length between two samples of a segment [m].
_SAMPLE_LENGTH = 0.02
#: Tilt of the axis between two samples [rad], if the tilt needs more samples than the length.
_SAMPLE_TILT = pi / 18.0
#: Greatest number of samples of a segment (at density 1).
_MAX_SAMPLES = 32
#: If all rotations are allowed, they are chosen only at points (*knots*) that are this far apart,
#: by length [m] or tilt [rad]; the rotations at the points between knots are interpolated.
_KNOT_LENGTH = 0.01
_KNOT_TILT = pi / 36.0
#: The size of a stretch is its length in units of this [m], plus the tilt of the axis on it [rad].
_LENGTH_PER_RADIAN = 0.05
#: Greatest number of searches; each avoids the collisions found by the earlier ones.
_MAX_SEARCHES = 8
#: Costs of a small clearance: each key [m] adds its value to the cost of a rotation whose
#: clearance is below the required clearance plus the key.
_NEARNESS = {0.0: 1000.0, 0.003: 100.0, 0.01: 20.0}
#: Number of passes that smooth the chosen rotations along the path.
_SMOOTHING_PASSES = 40
#: Greatest change of a rotation by all smoothing passes together [rad].
_MAX_SMOOTHING = pi / 120.0

#: Greatest change of a rotation per sample of a segment [rad].
_MAX_CHANGE_PER_SAMPLE = pi / 6.0

_AXES: dict[int, Vector3] = {
    FreeAxis.X: (1.0, 0.0, 0.0),
    FreeAxis.Y: (0.0, 1.0, 0.0),
    FreeAxis.Z: (0.0, 0.0, 1.0),
}


def as_named(goal: GoalTable) -> GoalTable:
    """
    Return a goal without a free axis.

    Each pose keeps its orientation or, if that is not allowed, gets the nearest allowed one.
    """
    segments = goal.segments
    return _turned(goal, np.clip(0.0, segments.free_minima, segments.free_maxima))


def _turned(goal: GoalTable, turns: Floats) -> GoalTable:
    """Return a goal without free axes, with poses turned about them by ``turns`` (n,) [rad]."""
    points, segments = goal.waypoints, goal.segments
    free, plain = segments.free_axes != FreeAxis.NONE, SegmentRows.plain(len(segments))
    half = 0.5 * turns[free, None]
    axes = np.array([_AXES[axis] for axis in segments.free_axes[free].tolist()])
    poses = points.poses.copy()
    poses[free, 3:] = normalized_rows(
        multiply_rows(poses[free, 3:], np.concatenate([np.sin(half) * axes, np.cos(half)], axis=1))
    )
    points = replace(points, poses=poses)
    if is_spline(goal):  # let the planner choose the angular rates of turned points
        rates = {}
        for name in ('twists', 'accelerations'):
            rows = getattr(points, name).copy()
            rows[(turns != 0.0) & rows.any(axis=1), 3:] = nan
            rates[name] = rows
        points = replace(points, **rates)
    segments = replace(
        segments,
        free_axes=plain.free_axes,
        free_minima=plain.free_minima,
        free_maxima=plain.free_maxima,
    )
    return replace(goal, waypoints=points, segments=segments)


def choose_rotations(
    goal: GoalTable, state: RobotState, arm: Arm, options: PlanningOptions, density: int = 1
) -> tuple[GoalTable, tuple[str, ...]]:
    """
    Return a checked goal with its rotations about the free axis chosen, and remarks on the choice.

    :param state: state of the robot at the start.
    :param density: factor on the number of samples; a higher one misses fewer singularities
        between samples.
    :raises NoRotation: the arm cannot follow the whole path with any choice of rotations.
    """
    path = _FreePath(goal, state, arm, options, density)
    if not path.is_open.any():  # every range is a single rotation
        return as_named(goal), ()
    if not path.can_turn:
        return as_named(goal), (
            f'free axis {path.name}: rotations as given, because a frame other than the active '
            'TCP must not turn (allow_tcp_change is false)',
        )
    lattice = path.lattice()
    found = _search_without_collisions(lattice, path)
    turns = path.turns(lattice.layers, found)
    chosen = _turned(goal, turns)
    return path.with_postures(chosen, lattice.layers, found), (path.remark(chosen, turns),)


def _search_without_collisions(lattice: RotationLattice, path: _FreePath) -> RotationPath:
    """
    Return the best way through the lattice without collisions, or else the last way found.

    The lattice holds the possible rotations along the path. Collisions found on a way add to the
    cost of the rotations around it, so that the next search avoids them.
    """
    least = path.options.min_clearance

    def too_close(q: Floats, more: float) -> Flags:
        options = replace(path.options, min_clearance=min(least + more, MAX_CLEARANCE))
        tips = path.tool_tips
        checks = (Clearance(lattice.arm, T_flange_tip, options, tips[0]) for T_flange_tip in tips)
        close: Flags = np.any([check.too_close(q) for check in checks], axis=0)
        return close

    known: set[tuple[int, int]] = set()
    for _ in range(_MAX_SEARCHES):
        found = lattice.search()
        close = np.flatnonzero(too_close(lattice.joints_along(found), max(_NEARNESS)))
        branches = lattice.sample_branches(found)[close]
        new = {*zip(close.tolist(), branches.tolist(), strict=True)} - known
        if not new:
            break
        known |= new
        for sample, branch in new:
            around = lattice.coarse_joints(sample, branch)
            costs = sum(cost * too_close(around, more) for more, cost in _NEARNESS.items())
            lattice.charge(sample, branch, np.asarray(costs, dtype=np.float64))
    return found


class _FreePath:
    """The path of a goal with a free axis, in base, or in the frame of a held part."""

    def __init__(
        self,
        goal: GoalTable,
        state: RobotState,
        arm: Arm,
        options: PlanningOptions,
        density: int,
    ) -> None:
        self.goal, self.options, self.density = goal, options, density
        T_flange_controlled = goal.T_flange_controlled or state.T_flange_tcp
        T_tcp_controlled = state.T_flange_tcp.inverse() @ T_flange_controlled
        self.kinematics = kinematics_of(goal.moving_frame, arm, T_flange_controlled)
        segments = goal.segments
        free = segments.free_axes != FreeAxis.NONE
        first = int(np.argmax(free))
        #: Whether the tool may turn, because the controlled frame is the TCP or will be made the
        #: TCP. The robot leads the TCP along straight lines, so any other frame would leave its
        #: line if the tool turned.
        self.can_turn = options.allow_tcp_change or is_same_tcp(T_tcp_controlled, IDENTITY)
        self.tool_tips = tool_tips(goal, state.T_flange_tcp)
        self.q_start = state.actual_q
        self.name = FreeAxis(int(segments.free_axes[first])).name.lower()
        self.axis = _AXES[int(segments.free_axes[first])]
        self.free = free
        self.is_joint = IS_JOINT_MOVE[segments.types]
        self.low, self.high = segments.free_minima, segments.free_maxima
        #: (n,) whether every rotation is allowed, which a goal expresses by two limits of 0.
        self.is_any = free & (self.low == 0.0) & (self.high == 0.0)
        #: (n,) whether there is more than one rotation to choose from.
        self.is_open = free & (self.is_any | (self.high > self.low))
        poses = transform_rows(goal.T_base_frame, goal.waypoints.poses)
        seen = state if goal.moving_frame is None else goal.moving_frame.seen(state)
        self.start = seen.actual_tcp_pose @ T_tcp_controlled
        starts = np.concatenate([[self.start.row()], poses[:-1]])
        # goal_arcs() also changes `poses`: the ends of FIXED arcs get the arcs' orientations.
        self.arc_rows, self.arcs, _ = goal_arcs(goal.segments, goal.T_base_frame, starts, poses)
        self.poses = poses
        self.references, self.rotations = self._references()
        if is_timed(goal) and goal.waypoints.times[0] == 0.0 and free[0]:
            # The arm is already at this point: keep its orientation, or the nearest allowed one.
            turn = _wrapped(-self.rotations[:1], 0.5 * (self.low + self.high)[:1])
            if not self.is_any[0]:
                turn = np.clip(turn, self.low[0], self.high[0])
            self.low, self.high = self.low.copy(), self.high.copy()
            self.low[0] = self.high[0] = turn[0]
            self.is_any[0] = self.is_open[0] = False

    def _references(self) -> tuple[Floats, Floats]:
        """
        Return reference orientations (n, 4), and the rotations (n,) [rad] from them to the poses.

        Each reference is the previous one, turned the shortest way so that its free axis has the
        direction of the free axis of the pose.
        """
        references = np.empty((len(self.poses), 4))
        reference, axis = self.start.quaternion, rotate(self.start.quaternion, self.axis)
        for row, (x, y, z, w) in enumerate(self.poses[:, 3:].tolist()):
            axis_there = rotate((x, y, z, w), self.axis)
            reference = multiply(_shortest_turn(axis, axis_there), reference)
            references[row], axis = reference, axis_there
        references = normalized_rows(references)
        turn = multiply_rows(conjugate_rows(references), self.poses[:, 3:])
        rotations = 2.0 * np.arctan2(turn[:, :3] @ np.array(self.axis), turn[:, 3])
        return references, rotations - tau * np.rint(rotations / tau)

    # -- the lattice -----------------------------------------------------------------------------

    def lattice(self) -> RotationLattice:
        """Return the lattice of rotations along the path; it has a layer for each knot."""
        before = np.concatenate([[self.start.row()], self.poses[:-1]])
        lengths = distance_rows(before, self.poses)
        lengths[self.arc_rows] = self.arcs.radius * self.arcs.sweep
        references = np.concatenate([[self.start.quaternion], self.references])
        tilts = angle_rows(references[:-1], references[1:])
        self.sizes = lengths / _LENGTH_PER_RADIAN + tilts
        self.knots = self._knots(lengths, tilts)
        counts = np.ceil(np.maximum(lengths / _SAMPLE_LENGTH, tilts / _SAMPLE_TILT))
        counts = self.density * np.clip(counts, 1, _MAX_SAMPLES).astype(np.intp)
        counts[self.is_joint] = 1
        row, number = counted(counts)
        u = number / counts[row]
        ends = np.concatenate([self.poses[:, :3], self.references], axis=1)
        begins = np.concatenate([[self.start.row()], ends[:-1]])
        poses = interpolate_rows(begins[row], ends[row], u)
        on_arc = np.isin(row, self.arc_rows)
        number = np.searchsorted(self.arc_rows, row[on_arc])
        poses[on_arc, :3] = self.arcs.take(number).places(u[on_arc])
        layer = np.searchsorted(self.knots, row)
        sizes = self.sizes[row] / counts[row]
        behind = np.cumsum(sizes)
        layer_ends = np.searchsorted(layer, np.arange(len(self.knots)), side='right')
        at_ends = np.concatenate([[0.0], behind[layer_ends - 1]])
        whole = np.maximum(np.diff(at_ends), 1e-12)
        samples = RotationSamples(
            poses=poses,
            fractions=np.minimum(1.0, (behind - at_ends[layer]) / whole[layer]),
            sizes=np.maximum(sizes, 1e-6),
            times=self._times(lengths)[row] / counts[row],
        )
        return RotationLattice(
            kinematics=self.kinematics,
            axis=self.axis,
            samples=samples,
            layers=self._layers(layer_ends, whole, tilts),
            q_start=self.q_start,
            options=self.options,
        )

    def _knots(self, lengths: Floats, tilts: Floats) -> Indices:
        """Return the points whose rotations are searched; the others are interpolated."""
        extent = np.maximum(lengths / _KNOT_LENGTH, tilts / _KNOT_TILT)
        full = np.diff(np.floor(np.cumsum(np.minimum(extent, 1.0))), prepend=0.0) > 0.0
        after_any = np.append(self.is_any[1:] & ~self.is_joint[1:], False)
        return np.flatnonzero(full | ~self.is_any | ~after_any | self.is_joint)

    def _layers(self, ends: Indices, whole: Floats, tilts: Floats) -> list[Layer]:
        postures = self.goal.waypoints.postures
        # If a rotation has limits, the goal's own change of rotation must remain possible.
        commanded = np.abs(np.diff(self.rotations, prepend=0.0))
        bound = ~self.is_any | np.append(False, ~self.is_any[:-1])
        tilted = tilts * self.sizes  # the axis deviates by tilt x turn / 8
        layers: list[Layer] = []
        begin = first = 0
        for number, (end, row) in enumerate(zip(ends.tolist(), self.knots.tolist(), strict=True)):
            change = inf
            if first:  # 0 = the first layer: the axis may deviate on the way there
                share = float(tilted[first : row + 1].max()) / whole[number]
                change = 8.0 * MAX_AXIS_DEVIATION / max(share, 1e-9)
            change = min(change, (end - begin) * _MAX_CHANGE_PER_SAMPLE / self.density)
            if bound[row]:
                change = max(change, float(commanded[row]) + _MAX_CHANGE_PER_SAMPLE)
            posture = postures.get(row)
            named = named_joints(posture, self.options.tf_prefix) if posture else {}
            fixed = not self.is_open[row]
            low = high = float(self.rotations[row]) + (
                float(self.low[row]) if self.free[row] else 0.0
            )
            if not fixed:
                low, high = (
                    (-inf, inf)
                    if self.is_any[row]
                    else (low, float(self.rotations[row] + self.high[row]))
                )
            layers.append(
                Layer(
                    begin=begin,
                    end=end,
                    low=low,
                    high=high,
                    is_joint=bool(self.is_joint[row]),
                    is_nearest=fixed and not named,
                    max_change=change,
                    posture=vector6(named.get(k, nan) for k in range(6)) if named else None,
                )
            )
            begin, first = end, row + 1
        return layers

    def _times(self, lengths: Floats) -> Floats:
        """Return the duration of each segment (n,) [s]; inf = unknown."""
        goal, segments = self.goal, self.goal.segments
        if is_timed(goal):
            return np.where(self.is_joint, inf, np.diff(goal.waypoints.times, prepend=0.0))
        speeds = np.where(
            segments.velocities > 0.0, segments.velocities, self.options.linear_velocity
        )
        known = ~self.is_joint & ~IS_OPTIMIZED[segments.types] & (lengths > 0.0)
        return np.where(known, lengths / speeds, inf)

    # -- the choice ------------------------------------------------------------------------------

    def turns(self, layers: Sequence[Layer], found: RotationPath) -> Floats:
        """Return the smoothed turn (n,) [rad] of each pose, within the range of its segment."""
        chosen = self._smoothed(layers, found.rotations)
        at = np.cumsum(self.sizes)
        at_knots = at[self.knots]
        rotations = np.interp(at, np.append(0.0, at_knots), np.append(0.0, chosen))
        rotations[self.knots] = chosen
        turns = rotations - self.rotations
        middle = 0.5 * (self.low + self.high)
        turns = _wrapped(turns, middle)
        turns = np.where(self.is_any, turns, np.clip(turns, self.low, self.high))
        return np.where(self.free, turns, 0.0)

    def _smoothed(self, layers: Sequence[Layer], rotations: Floats) -> Floats:
        """Return the rotations (layers,), smoothed because the search takes discrete steps."""
        low, high = rotations - _MAX_SMOOTHING, rotations + _MAX_SMOOTHING
        for number, layer in enumerate(layers):
            if not layer.is_any:
                turns = layer.turns(rotations[number])
                low[number] = max(low[number], layer.low + turns)
                high[number] = min(high[number], layer.high + turns)
        place = np.cumsum(self.sizes)[self.knots]
        before, after = np.diff(place)[:-1], np.diff(place)[1:]
        joint = np.array([layer.is_joint for layer in layers])
        inner = ~(joint[1:-1] | joint[2:])
        part = before / np.maximum(before + after, 1e-12)
        smooth = rotations.copy()
        for _ in range(_SMOOTHING_PASSES):
            middle = smooth[:-2] + part * (smooth[2:] - smooth[:-2])
            smooth[1:-1] = np.where(inner, 0.5 * (smooth[1:-1] + middle), smooth[1:-1])
            smooth = np.clip(smooth, low, high)
        return smooth

    def with_postures(
        self, goal: GoalTable, layers: Sequence[Layer], found: RotationPath
    ) -> GoalTable:
        """Return the goal with a posture for each joint move to a point with a free rotation."""
        names = tuple(self.options.tf_prefix + name for name in JOINT_NAMES)
        postures = dict(goal.waypoints.postures)
        for number, row in enumerate(self.knots.tolist()):
            if layers[number].is_joint and self.is_open[row] and row not in postures:
                values = vector6(found.joints[number].tolist())
                postures[row] = Posture(names=names, values=values)
        return replace(goal, waypoints=replace(goal.waypoints, postures=postures))

    def remark(self, goal: GoalTable, turns: Floats) -> str:
        """Return the remark on the chosen turns."""
        rows = np.flatnonzero(self.is_open)
        points = f'points {rows[0]} to {rows[-1]}' if len(rows) > 1 else f'point {rows[0]}'
        low, high = degrees(turns[rows].min()), degrees(turns[rows].max())
        text = (
            f'free axis {self.name}: {points} turned by {low:.1f} to {high:.1f} degrees about it'
        )
        deviation = degrees(self._axis_deviation(goal))
        if deviation < 0.05:
            return text
        return f'{text}; between points the axis leaves its way by up to {deviation:.1f} degrees'

    def _axis_deviation(self, goal: GoalTable) -> float:
        """
        Return the greatest deviation [rad] of the axis from the shortest way between points.

        It is measured halfway between each two points.
        """
        poses = transform_rows(goal.T_base_frame, goal.waypoints.poses)
        counts = self.free[1:] & ~self.is_joint[1:]
        if not counts.any():
            return 0.0
        half = np.full(len(poses) - 1, 0.5)
        turned = interpolate_rows(poses[:-1], poses[1:], half)
        ends = np.concatenate([poses[:, :3], self.references], axis=1)
        straight = interpolate_rows(ends[:-1], ends[1:], half)
        a, b = (_rotated(rows[counts, 3:], self.axis) for rows in (turned, straight))
        across = np.linalg.norm(cross_rows(a, b), axis=1)
        return float(np.arctan2(across, np.einsum('ij,ij->i', a, b)).max())


def _wrapped(angles: Floats, middle: Floats) -> Floats:
    """Return angles wrapped to within half a turn of ``middle``."""
    return angles - tau * np.rint((angles - middle) / tau)


def _rotated(quaternions: Floats, axis: Vector3) -> Floats:
    """Return an axis rotated by each of the quaternions (n, 4)."""
    u, w = quaternions[:, :3], quaternions[:, 3:]
    v = np.broadcast_to(np.array(axis), u.shape)
    t = 2.0 * cross_rows(u, v)
    rotated: Floats = v + w * t + cross_rows(u, t)
    return rotated


def _shortest_turn(a: Vector3, b: Vector3) -> Quaternion:
    """Return the rotation that turns one unit vector into another the shortest way."""
    w = 1.0 + dot(a, b)
    if w < 1e-9:  # opposite vectors: turn about any axis across them
        side = cross(a, (1.0, 0.0, 0.0) if abs(a[0]) < 0.7 else (0.0, 1.0, 0.0))
        return normalize((*side, 0.0))
    return normalize((*cross(a, b), w))
