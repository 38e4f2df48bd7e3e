# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The curves of the robot's motions: lines, arcs and joint lines.

A curve maps ``u`` in [0, 1] to poses of the TCP in the robot's base, with ``u`` proportional to
the leading quantity of the motion (length of a line or an arc, travel of the joints). Each curve
leads from waypoint to waypoint. :mod:`~.blended_path` holds the curves of a goal in columns, and
adds the blends between them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import asin, atan2, ceil, degrees, hypot, pi, sqrt
from typing import ClassVar, TypeAlias

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices
from ur_cartesian_driver.motion.geometry.pose import (
    distance,
    multiply,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.geometry.pose_rows import (
    compose_rows,
    cross_rows,
    distance_rows,
    interpolate_rows,
    multiply_rows,
    normalized_rows,
)
from ur_cartesian_driver.motion.geometry.vectors import (
    cross,
    dot,
    Joints,
    scale,
    subtract,
    Vector3,
    vector6,
)
from ur_cartesian_driver.motion.goal.goal import ArcMode

#: If a line turns the tool by half a turn, to within this angle [rad], rounding on the wire and
#: the arm's actual pose decide the direction of the turn.
HALF_TURN = 1e-3

#: Poses that differ by less than the resolution of the wire [m], [rad] are the same.
SAME_POSITION = 1e-6
SAME_ANGLE = 1e-6
#: Minimum height of the via above the chord [m] at which three points make a circle.
MIN_ARC_HEIGHT = 1e-5
#: How far rounding to micrometres on the wire moves three points relative to each other [m].
_ROUNDING = 1.5e-6
#: Largest turn that rounding on the wire may add at the end of an arc whose tangent the tool
#: follows [rad].
MAX_ARC_TURN_ERROR = 0.005
#: Arcs through points that are farther apart than this [m] are refused: no arm reaches that far.
MAX_ARC_SIZE = 1000.0
#: Chord error of sampled arcs and of sampled joint lines [m].
ARC_CHORD_ERROR = 5e-6
CURVE_CHORD_ERROR = 20e-6
#: Largest turn between two samples [rad].
MAX_TURN_PER_SAMPLE = pi / 18.0
#: To find where a joint line leaves a ball, ever shorter intervals of the line are divided into
#: these numbers of parts.
_TRIM_DIVISIONS = (32,) * 6


@dataclass(frozen=True, slots=True)
class ArcCurve:
    """
    The tool on a circular arc.

    The position turns about ``axis`` through ``center`` by ``sweep`` in (0, 2 pi). The orientation
    changes from the start's to the end's by the shortest rotation (UNCONSTRAINED) or turns along
    with the tangent (FIXED), like the modes of URScript's ``movec``.
    """

    start: Pose
    end: Pose
    center: Vector3
    axis: Vector3
    radius: float
    sweep: float
    mode: ArcMode
    #: The ``u`` of the via, in (0, 1).
    u_via: float
    joint_travel: ClassVar[float] = 0.0

    @classmethod
    def through(cls, start: Pose, via: Vector3, end: Pose, mode: ArcMode) -> ArcCurve:
        """
        Return the arc from start through a position [m] to the end's position.

        In mode FIXED the orientation of ``end`` is replaced by the one in which the arc arrives.

        :raises ValueError: the three positions make no circle, or, in mode FIXED, a circle that
            rounding on the wire changes too much; the text is a clause that gives the reason.
        """
        center, axis, radius = _circle(start.position, via, end.position)
        if mode is ArcMode.FIXED:
            _check_turn_error(start.position, via, end.position)
        e1 = scale(subtract(start.position, center), 1.0 / radius)
        e2 = cross(axis, e1)
        sweep = _angle_on(e1, e2, subtract(end.position, center))
        if mode is ArcMode.FIXED:
            turn = quaternion_from_rotation_vector(scale(axis, sweep))
            end = Pose(end.position, multiply(turn, start.quaternion))
        u_via = _angle_on(e1, e2, subtract(via, center)) / sweep
        return cls(start, end, center, axis, radius, sweep, mode, u_via)

    @property
    def length(self) -> float:
        """Length of the arc [m]."""
        return self.radius * self.sweep

    @property
    def angle(self) -> float:
        """Turn of the tool along the arc [rad]; may exceed pi if the tool follows the tangent."""
        return self.sweep if self.mode is ArcMode.FIXED else self.start.angle_to(self.end)

    @property
    def samples(self) -> int:
        """Number of chords that follow the arc closely enough."""
        step = sqrt(8.0 * ARC_CHORD_ERROR / self.radius)
        return max(1, ceil(self.sweep / step), ceil(self.angle / MAX_TURN_PER_SAMPLE))

    def rows(self, u: Floats) -> Floats:
        """Return the poses (n, 7) at many ``u`` (n,)."""
        return arc_rows([self], np.zeros(len(u), dtype=np.intp), u)

    def trim(self, radius: float, *, at_end: bool) -> float:
        """Return the ``u`` at a distance ``radius`` [m] from the start of the arc, or its end."""
        u = min(1.0, 2.0 * asin(min(1.0, 0.5 * radius / self.radius)) / self.sweep)
        return 1.0 - u if at_end else u


def arc_rows(arcs: Sequence[ArcCurve], number: Indices, u: Floats) -> Floats:
    """
    Return poses (n, 7) on many arcs.

    :param number: (n,) the arc of each pose.
    :param u: (n,) its place on the arc.
    """
    starts = np.array([arc.start.row() for arc in arcs])
    centers, axes = (np.array([getattr(arc, name) for arc in arcs]) for name in ('center', 'axis'))
    spokes = starts[:, :3] - centers  # at a right angle to the axes
    ends = np.array([arc.end.row() for arc in arcs])
    rows = interpolate_rows(starts[number], ends[number], u)
    angle = (u * np.array([arc.sweep for arc in arcs])[number])[:, None]
    across = cross_rows(axes, spokes)
    rows[:, :3] = centers[number] + np.cos(angle) * spokes[number] + np.sin(angle) * across[number]
    fixed = np.array([arc.mode is ArcMode.FIXED for arc in arcs])[number]
    if fixed.any():
        half, arc = 0.5 * angle[fixed], number[fixed]
        turn = np.concatenate([np.sin(half) * axes[arc], np.cos(half)], axis=1)
        rows[fixed, 3:] = normalized_rows(multiply_rows(turn, starts[arc, 3:]))
    return rows


@dataclass(frozen=True, slots=True)
class JointLineCurve:
    """A straight line in joint space; forward kinematics gives the poses of the tool."""

    arm: Arm
    T_flange_tcp: Pose
    q_start: Joints
    q_end: Joints
    start: Pose
    end: Pose
    length: float
    #: Number of chords that follow the curve of the tool closely enough.
    samples: int
    #: Ratio of the tool's peak speed to its mean speed.
    unevenness: float

    @classmethod
    def between(
        cls, arm: Arm, T_flange_tcp: Pose, q_start: Joints, q_end: Joints
    ) -> JointLineCurve:
        """Return the joint line from one configuration to another."""
        # If the joints together turn by delta, a point within `reach` of all axes of rotation
        # deviates from its chord by at most reach delta^2 / 8.
        max_reach = arm.model.max_reach + hypot(*T_flange_tcp.position)
        step = sqrt(8.0 * CURVE_CHORD_ERROR / max_reach)
        samples = max(1, ceil(sum(abs(b - a) for a, b in zip(q_start, q_end, strict=True)) / step))
        q = np.linspace(q_start, q_end, samples + 1)
        chords = np.linalg.norm(np.diff(tcp_rows(arm, T_flange_tcp, q)[:, :3], axis=0), axis=1)
        length = float(chords.sum())
        unevenness = samples * float(chords.max()) / length if length > 0.0 else 1.0
        return cls(
            arm,
            T_flange_tcp,
            q_start,
            q_end,
            arm.forward(q_start) @ T_flange_tcp,
            arm.forward(q_end) @ T_flange_tcp,
            length,
            samples,
            unevenness,
        )

    @property
    def angle(self) -> float:
        """Shortest turn of the tool from the start to the end [rad]."""
        return self.start.angle_to(self.end)

    @property
    def travel(self) -> Joints:
        """The turn of each joint [rad], all >= 0."""
        return vector6(abs(y - x) for x, y in zip(self.q_start, self.q_end, strict=True))

    @property
    def joint_travel(self) -> float:
        """Travel of the leading joint [rad]."""
        return max(self.travel)

    def joints(self, u: float) -> Joints:
        """Return the joint positions at ``u``."""
        return vector6(x + u * (y - x) for x, y in zip(self.q_start, self.q_end, strict=True))

    def pose(self, u: float) -> Pose:
        """Return the pose at ``u``."""
        return self.arm.forward(self.joints(u)) @ self.T_flange_tcp

    def joint_rows(self, u: Floats) -> Floats:
        """Return the joint positions (n, 6) [rad] at many ``u`` (n,)."""
        q_start, q_end = np.array(self.q_start), np.array(self.q_end)
        rows: Floats = q_start + np.outer(u, q_end - q_start)
        return rows

    def rows(self, u: Floats) -> Floats:
        """Return the poses (n, 7) at many ``u`` (n,)."""
        return tcp_rows(self.arm, self.T_flange_tcp, self.joint_rows(u))

    def trim(self, radius: float, *, at_end: bool) -> float:
        """Return the ``u`` nearest to the start, or end, that is at least ``radius`` [m] away."""
        center = np.array([(self.end if at_end else self.start).row()])
        low, high = 0.0, 1.0
        for n in (max(16, self.samples), *_TRIM_DIVISIONS):
            v = np.linspace(low, high, n + 1)
            between = self.rows(1.0 - v[1:-1] if at_end else v[1:-1])
            k = int(np.argmin(np.append(distance_rows(center, between) < radius, False)))
            low, high = v[k : k + 2].tolist()
        return 1.0 - high if at_end else high


SegmentCurve: TypeAlias = ArcCurve | JointLineCurve


def tcp_rows(arm: Arm, T_flange_tcp: Pose, q: Floats) -> Floats:
    """Return ``T_base_tcp`` (n, 7) of joint positions (n, 6) [rad]."""
    return compose_rows(arm.forward_rows(q), T_flange_tcp)


def is_same_pose(a: Pose, b: Pose) -> bool:
    """Return whether two poses are the same within the resolution of the wire."""
    return a.distance_to(b) <= SAME_POSITION and a.angle_to(b) <= SAME_ANGLE


def _circle(a: Vector3, b: Vector3, c: Vector3) -> tuple[Vector3, Vector3, float]:
    """Return center, axis (unit) and radius of the circle through a, b and c in this order."""
    ab, ac = subtract(b, a), subtract(c, a)
    chord = hypot(*ac)
    for name, distance_apart in (
        ('the start and the end', chord),
        ('the start and the via', hypot(*ab)),
        ('the via and the end', distance(b, c)),
    ):
        if distance_apart < MIN_ARC_HEIGHT:
            raise ValueError(f'{name} of the arc coincide ({1e3 * distance_apart:.3f} mm apart)')
    if max(chord, hypot(*ab)) > MAX_ARC_SIZE:
        raise ValueError(f'the points of the arc are more than {MAX_ARC_SIZE:g} m apart')
    normal = cross(ab, ac)
    area = hypot(*normal)
    if area / max(chord, hypot(*ab), distance(b, c)) < MIN_ARC_HEIGHT:
        raise ValueError('the start, the via and the end of the arc lie on one straight line')
    # Circumcenter seen from a: ((|ab|^2 ac - |ac|^2 ab) x (ab x ac)) / (2 |ab x ac|^2).
    ab2, ac2 = hypot(*ab) ** 2, chord**2
    mixed = subtract(scale(ac, ab2), scale(ab, ac2))
    offset = scale(cross(mixed, normal), 0.5 / area**2)
    center = (a[0] + offset[0], a[1] + offset[1], a[2] + offset[2])
    return center, scale(normal, 1.0 / area), hypot(*offset)


def _check_turn_error(a: Vector3, b: Vector3, c: Vector3) -> None:
    """
    Refuse an arc at whose end the rounding of its points turns the tool too far.

    Rounding tilts the circle by rounding / height of the triangle. At the end of the arc this tilt
    turns the tool by 2 sin(sweep / 2) times as much. The law of sines expresses this error by the
    distances between start, via and end.
    """
    from_start, to_end = distance(a, b), distance(b, c)
    error = 2.0 * _ROUNDING * max(from_start, to_end, distance(a, c)) / (from_start * to_end)
    if error > MAX_ARC_TURN_ERROR:
        raise ValueError(
            f'its via is {1e3 * from_start:.3f} mm and {1e3 * to_end:.3f} mm from its ends, so '
            f'that micrometres on the wire may turn the tool by {degrees(error):.1f} degrees at '
            f'its end, more than {degrees(MAX_ARC_TURN_ERROR):.1f}'
        )


def _angle_on(e1: Vector3, e2: Vector3, v: Vector3) -> float:
    """Return the angle of a vector from e1 towards e2, in (0, 2 pi]."""
    angle = atan2(dot(e2, v), dot(e1, v))
    return angle if angle > 0.0 else angle + 2.0 * pi
