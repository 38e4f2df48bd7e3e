# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Random paths with a free axis that are known to have a solution.

They are made backwards: a smooth motion of the joints of a nominal arm, which keeps 10 degrees (at
the shoulder 5 cm) from limits and singularities and does not collide, gives the poses of the tool.
Then each pose is turned about the axis by a random angle, so that only the axis is left of that
solution.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from math import pi

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_rotation_vector
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.goal import FreeAxis, Goal, Segment, Waypoint
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.planning.preflight.clearance import Clearance
from ur_cartesian_driver.planning.preflight.tightest_margins import (
    joint_limit_distances,
    singularity_distance_rows,
)
from ur_cartesian_driver.planning.stop_prediction import state_at_rest

OPTIONS = PlanningOptions(max_tool_speed=0.0, max_approach_distance=0.0)
MODELS = ('ur3e', 'ur5e', 'ur10e', 'ur20', 'ur5')
MARGIN, SHOULDER_MARGIN = pi / 18.0, 0.05
#: Number of configurations from point to point.
_STEPS = 20


@dataclass(frozen=True, kw_only=True)
class FreePath:
    """A path with a free axis, the arm at its start, and the rotations of its solution."""

    arm: Arm
    state: RobotState
    #: The goal, whose poses are turned about the axis.
    goal: Goal
    #: The poses of the solution, and the angle by which each was turned [rad].
    solution: tuple[Pose, ...]
    turns: tuple[float, ...]


def free_path(number: int) -> FreePath:
    """Return the path of a number."""
    rng = np.random.default_rng(number)
    arm = Arm(robot_model(MODELS[number % len(MODELS)]))
    tool = Pose(
        tuple(rng.uniform((-0.05, -0.05, 0.0), (0.05, 0.05, 0.2)).tolist()),
        quaternion_from_rotation_vector((0.4 * rng.normal(size=3)).tolist()),
    )
    while True:
        points = int(rng.integers(6, 25))
        q = _joint_motion(rng, points)
        poses = [arm.forward(vector6(row)) @ tool for row in q[::_STEPS].tolist()]
        if _is_sound(arm, tool, q) and _has_sound_steps(poses):
            break
    axis = FreeAxis(1 + number % 3)
    turns = rng.uniform(-pi, pi, points).tolist()
    scrambled = [turned(pose, axis, turn) for pose, turn in zip(poses[1:], turns, strict=True)]
    return FreePath(
        arm=arm,
        state=state_at_rest(arm, vector6(q[0].tolist()), tool),
        goal=Goal(
            waypoints=tuple(Waypoint(pose=pose) for pose in scrambled),
            segments=(Segment(free_axis=axis, velocity=0.05),) * points,
        ),
        solution=tuple(poses[1:]),
        turns=tuple(turns),
    )


def turned(pose: Pose, axis: FreeAxis, angle: float) -> Pose:
    """Return a pose turned about one of its axes [rad]."""
    vector = [0.0, 0.0, 0.0]
    vector[axis - 1] = angle
    return pose @ Pose((0.0, 0.0, 0.0), quaternion_from_rotation_vector(vector))


def with_ranges(path: FreePath, width: float) -> Goal:
    """Return the goal of a path with ranges of a width [rad] somewhere around its solution."""
    rng = np.random.default_rng(len(path.turns))
    segments = []
    for segment, turn in zip(path.goal.segments, path.turns, strict=True):
        low = -turn - width * rng.uniform(0.2, 0.8)
        segments.append(replace(segment, free_min=low, free_max=low + width))
    return replace(path.goal, segments=tuple(segments))


def _joint_motion(rng: np.random.Generator, points: int) -> np.ndarray:
    start = rng.uniform(-2.0 * pi + MARGIN, 2.0 * pi - MARGIN, 6)
    start[2] = rng.uniform(-2.6, 2.6)
    size = np.array((1.0, 0.6, 0.6, 1.0, 1.0, 1.5)) * rng.uniform(0.1, 0.9)
    straight, bow, wave = rng.normal(size=(3, 6)) * size
    t = np.linspace(0.0, 1.0, points * _STEPS + 1)[:, None]
    bent = 0.5 * bow * np.sin(pi * t) + 0.25 * wave * np.sin(2.0 * pi * t)
    q: np.ndarray = start + straight * t + bent
    return q


def _is_sound(arm: Arm, tool: Pose, q: np.ndarray) -> bool:
    distances = singularity_distance_rows(arm, q)
    return (
        distances[:, :2].min() > MARGIN
        and distances[:, 2].min() > SHOULDER_MARGIN
        and joint_limit_distances(arm, q).min() > MARGIN
        and not Clearance(arm, tool, OPTIONS).too_close(q).any()
    )


def _has_sound_steps(poses: list[Pose]) -> bool:
    """Return whether lines between points stay near the motion of the joints."""
    pairs = list(pairwise(poses))
    distances = [a.distance_to(b) for a, b in pairs]
    return (
        min(distances) > 0.003
        and max(distances) < 0.06
        and max(a.angle_to(b) for a, b in pairs) < 0.35
    )
