# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The paths of a goal and the inverse kinematics of an arm, in the tests' own implementation.

It uses matrices, and follows the descriptions of the goal's fields and the manufacturer's
description of its motions. It shares nothing with planner, driver or simulator; it is slow and
simple.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from forward_model import dh_frames, pose_matrix, turn_between
import numpy as np

from ur_cartesian_driver.motion.goal.goal import ArcMode, Goal, SegmentType

#: When one number compares poses, a turn counts as much as its arc at this radius [m].
ARM = 0.1


def rotation(axis, angle):
    """Return the rotations about a unit axis by angles (n,): (n, 3, 3)."""
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.atleast_1d(angle)[:, None, None]
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K)


def axis_angle(R):
    """Return the axis and the angle, at most pi, of a rotation."""
    angle = float(turn_between(R, np.eye(3)))
    if angle > 3.0:
        _, vectors = np.linalg.eigh(0.5 * (R + R.T))
        axis = vectors[:, -1]
        twice = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
        return (axis if twice @ axis >= 0.0 else -axis), angle
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    size = np.linalg.norm(axis)
    return (axis / size if size > 0.0 else np.array([0.0, 0.0, 1.0])), angle


def poses_apart(a, b):
    """Return distances [m] and turns [rad] between poses (..., 4, 4)."""
    return (
        np.linalg.norm(a[..., :3, 3] - b[..., :3, 3], axis=-1),
        turn_between(a[..., :3, :3], b[..., :3, :3]),
    )


@dataclass(frozen=True)
class Line:
    """Straight, with the shortest rotation."""

    start: np.ndarray
    end: np.ndarray

    @cached_property
    def length(self):
        return float(np.linalg.norm(self.end[:3, 3] - self.start[:3, 3]))

    @cached_property
    def _turn(self):
        return axis_angle(self.start[:3, :3].T @ self.end[:3, :3])

    @property
    def angle(self):
        return self._turn[1]

    def at(self, u):
        """Return the poses at fractions (n,)."""
        u = np.atleast_1d(u)
        poses = np.tile(np.eye(4), (len(u), 1, 1))
        poses[:, :3, :3] = self.start[:3, :3] @ rotation(self._turn[0], u * self.angle)
        a, b = self.start[:3, 3], self.end[:3, 3]
        poses[:, :3, 3] = a + u[:, None] * (b - a)
        return poses

    def fractions(self, poses):
        """Return the fractions of the line that are nearest to poses."""
        if self.length > ARM * self.angle:
            way = self.end[:3, 3] - self.start[:3, 3]
            u = (poses[:, :3, 3] - self.start[:3, 3]) @ way / self.length**2
        elif self.angle > 0.0:
            u = turn_between(self.start[:3, :3], poses[:, :3, :3]) / self.angle
        else:
            u = np.zeros(len(poses))
        return np.clip(u, 0.0, 1.0)


@dataclass(frozen=True)
class Arc:
    """The circle through three points; the orientation as on a line, or along with the circle."""

    start: np.ndarray
    via: np.ndarray
    target: np.ndarray
    fixed: bool

    @cached_property
    def _circle(self):
        a, b, c = (T[:3, 3] for T in (self.start, self.via, self.target))
        normal = np.cross(b - a, c - a)
        size = np.linalg.norm(normal)
        axis = normal / size
        # The centre is where both bisecting planes and the plane of the circle meet.
        center = np.linalg.solve(
            np.array([b - a, c - a, axis]),
            np.array([0.5 * (b @ b - a @ a), 0.5 * (c @ c - a @ a), axis @ a]),
        )
        return center, axis, self._angles(center, axis, c[None])[0]

    def _angles(self, center, axis, points):
        x = self.start[:3, 3] - center
        y = np.cross(axis, x)
        relative = points - center
        return np.arctan2(relative @ y, relative @ x) % (2.0 * np.pi)

    @property
    def radius(self):
        return float(np.linalg.norm(self.start[:3, 3] - self._circle[0]))

    @property
    def length(self):
        return self.radius * self._circle[2]

    @cached_property
    def _turn(self):
        return axis_angle(self.start[:3, :3].T @ self.target[:3, :3])

    @property
    def angle(self):
        return self._circle[2] if self.fixed else self._turn[1]

    @cached_property
    def end(self):
        return self.at(1.0)[0]

    def at(self, u):
        """Return the poses at fractions (n,)."""
        center, axis, sweep = self._circle
        u = np.atleast_1d(u)
        turns = rotation(axis, u * sweep)
        poses = np.tile(np.eye(4), (len(u), 1, 1))
        poses[:, :3, 3] = center + turns @ (self.start[:3, 3] - center)
        R = self.start[:3, :3]
        poses[:, :3, :3] = (
            turns @ R if self.fixed else R @ rotation(self._turn[0], u * self._turn[1])
        )
        return poses

    def fractions(self, poses):
        """Return the fractions of the arc that are nearest to poses."""
        center, axis, sweep = self._circle
        angles = self._angles(center, axis, poses[:, :3, 3])
        beyond = angles > sweep
        nearer_start = angles > 0.5 * (sweep + 2.0 * np.pi)
        return np.where(beyond, np.where(nearer_start, 0.0, 1.0), angles / sweep)


@dataclass(frozen=True)
class JointLine:
    """All joints in proportion, from one configuration to another."""

    arm: Kinematics
    q_start: np.ndarray
    q_end: np.ndarray

    @cached_property
    def _samples(self):
        return self.at(np.linspace(0.0, 1.0, 200))

    @property
    def start(self):
        return self._samples[0]

    @property
    def end(self):
        return self._samples[-1]

    @property
    def length(self):
        return float(np.linalg.norm(np.diff(self._samples[:, :3, 3], axis=0), axis=1).sum())

    @property
    def angle(self):
        R = self._samples[:, :3, :3]
        return float(turn_between(R[1:], R[:-1]).sum())

    def joints(self, u):
        return self.q_start + np.atleast_1d(u)[:, None] * (self.q_end - self.q_start)

    def at(self, u):
        return self.arm.tool(self.joints(u))


class Kinematics:
    """An arm with a tool, from its Denavit-Hartenberg table."""

    def __init__(self, geometry, limits, T_flange_tool):
        """
        Take the table, the ranges and the tool.

        :param limits: lowest and highest positions of the joints (6, 2) [rad].
        :param T_flange_tool: a pose.
        """
        self.geometry, self.T_flange_tool = geometry, pose_matrix(T_flange_tool)
        self.low, self.high = np.array(limits, dtype=float).T

    def tool(self, q):
        """Return the poses of the tool (n, 4, 4)."""
        return dh_frames(self.geometry, q)[:, -1] @ self.T_flange_tool

    def jacobian(self, q):
        """Return poses (n, 4, 4) and Jacobians (n, 6, 6) [m, rad per rad]."""
        frames = dh_frames(self.geometry, q)
        tool = frames[:, -1] @ self.T_flange_tool
        axes, origins = frames[:, :6, :3, 2], frames[:, :6, :3, 3]
        J = np.concatenate(
            [np.cross(axes, tool[:, None, :3, 3] - origins), axes], axis=2
        ).transpose(0, 2, 1)
        return tool, J

    def solve(self, target, q, iterations=60):
        """Run Newton's method from configurations (n, 6); return its ends, and which arrived."""
        q = np.array(np.atleast_2d(q), dtype=float)
        for _ in range(iterations):
            T, J = self.jacobian(q)
            error = np.zeros((len(q), 6))
            error[:, :3] = target[:3, 3] - T[:, :3, 3]
            for row, R in enumerate(T[:, :3, :3]):
                axis, angle = axis_angle(R.T @ target[:3, :3])
                error[row, 3:] = R @ axis * angle
            size = np.abs(error).max(axis=1)
            if (size < 1e-9).all():
                break
            step = np.linalg.solve(
                J.transpose(0, 2, 1) @ J + 1e-9 * np.eye(6) * np.minimum(1.0, size)[:, None, None],
                np.einsum('nji,nj->ni', J, error)[:, :, None],
            )[:, :, 0]
            largest = np.abs(step).max(axis=1, keepdims=True)
            q = q + step * np.minimum(1.0, 0.3 / np.maximum(largest, 1e-12))
        distance, angle = poses_apart(self.tool(q), target)
        return q, distance + angle < 1e-6

    def all_solutions(self, target, rng):
        """Return every configuration at a pose, within the ranges of the joints, (n, 6)."""
        found, arrived = self.solve(target, rng.uniform(-np.pi, np.pi, (80, 6)))
        solutions: list[np.ndarray] = []
        for q in (found[arrived] + np.pi) % (2.0 * np.pi) - np.pi:
            if not any(
                np.abs((q - other + np.pi) % (2.0 * np.pi) - np.pi).max() < 1e-4
                for other in solutions
            ):
                solutions.append(q)
        return solutions

    def within(self, q, slack=1e-6):
        """Return whether configurations are within the ranges."""
        return ((q >= self.low - slack) & (q <= self.high + slack)).all(axis=-1)

    def measures(self, q):
        """Return the distances from singularities (n, 3): wrist, elbow [rad], shoulder [m]."""
        frames = dh_frames(self.geometry, q)
        axes = frames[:, :6, :3, 2]
        # The wrist centre: the place of axis 6 that is nearest to axis 5.
        centre = frames[:, 5, :3, 3]
        normal = np.cross(axes[:, 0], axes[:, 1])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        wrist = np.linalg.norm(np.cross(axes[:, 3], axes[:, 5]), axis=1)
        # Only some milliradians of the elbow's calibrated angle are unknown.
        elbow = np.abs(np.sin(q[:, 2]))
        shoulder = np.abs(np.einsum('ni,ni->n', centre - frames[:, 1, :3, 3], normal))
        return np.stack([np.arcsin(np.minimum(1.0, wrist)), np.arcsin(elbow), shoulder], axis=1)


def targets(goal: Goal):
    """Return the poses of the points in base."""
    base = pose_matrix(goal.T_base_frame)
    return [base @ pose_matrix(point.pose) for point in goal.waypoints]


def straight_curve(goal: Goal, index: int, start):
    """Return the line or the arc to a point from a pose; None for joint moves."""
    end = targets(goal)[index]
    segment = goal.segments[index] if goal.segments else None
    if segment is None or segment.type in (
        SegmentType.AUTO,
        SegmentType.LINEAR,
        SegmentType.PROCESS,
        SegmentType.OPTIMIZED_LINEAR,
    ):
        return Line(start, end)
    if segment.type == SegmentType.CIRCULAR:
        via = pose_matrix(goal.T_base_frame) @ pose_matrix(segment.via)
        return Arc(start, via, end, segment.arc_mode == ArcMode.FIXED)
    return None
