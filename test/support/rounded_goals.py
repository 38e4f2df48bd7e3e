# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Random goals with rounded corners, and geometric measures of their plans."""

from dataclasses import dataclass

from curve_distance import arc_points, distances
import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    multiply,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, SegmentType, Waypoint
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.sim.calibration import random_calibration

MODELS = ('ur3e', 'ur5', 'ur5e', 'ur10e', 'ur20')
HOME = np.array([0.2, -1.5, 1.9, -1.9, -1.57, 0.3])
OPTIONS = PlanningOptions(self_collision='off', max_approach_distance=2.0)
#: Distance of samples [s].
STEP = 0.002


@dataclass
class RoundedCase:
    """A goal, with its arm."""

    arm: Arm
    state: RobotState
    goal: Goal

    @property
    def starts(self):
        """The start poses of the segments."""
        return [self.state.actual_tcp_pose, *(point.pose for point in self.goal.waypoints[:-1])]


def random_case(random):
    """Return lines, arcs and turns of any size, with corners of any angle; reversals too."""
    rng = np.random.default_rng(random.randrange(2**32))
    model = robot_model(rng.choice(MODELS))
    calibrated = rng.random() < 0.5
    arm = Arm(model, random_calibration(model, int(rng.integers(1000))) if calibrated else None)
    q = tuple((HOME + rng.normal(0.0, 0.15, 6)).tolist())
    pose = arm.forward(q)
    state = RobotState(
        timestamp=0.0, actual_q=q, target_q=q, T_flange_tcp=IDENTITY, actual_tcp_pose=pose
    )
    size, way = 10.0 ** rng.uniform(-4.0, -1.0), _unit(rng.normal(size=3))
    points, segments = [], []
    for _ in range(rng.integers(2, 12)):
        angle = rng.choice([rng.uniform(0.0, 0.3), rng.uniform(0.0, np.pi), np.pi])
        way = _turned(way, _unit(np.cross(way, rng.normal(size=3))), angle)
        pose, segment = _segment(rng, pose, way, min(0.15, size * 10.0 ** rng.uniform(-0.7, 0.7)))
        points.append(Waypoint(pose=pose))
        segments.append(segment)
    deviation = float(10.0 ** rng.uniform(-4.5, -2.5))
    goal = Goal(
        waypoints=tuple(points), segments=tuple(segments), corner_deviation=max(deviation, 2e-5)
    )
    return RoundedCase(arm, state, goal)


def _segment(rng, start, way, length):
    speed = dict(
        velocity=10.0 ** rng.uniform(-2.0, -0.3), acceleration=10.0 ** rng.uniform(-0.7, 0.5)
    )
    turned = quaternion_from_rotation_vector(tuple(rng.normal(0.0, 0.1, 3)))
    quaternion = multiply(turned, start.quaternion) if rng.random() < 0.3 else start.quaternion
    kind, here = rng.random(), np.array(start.position)
    if kind < 0.1:  # a turn on the spot
        quaternion = multiply(turned, start.quaternion)
        turn = Segment(type=SegmentType.LINEAR, velocity=10.0 ** rng.uniform(-1.0, 0.3))
        return Pose(start.position, quaternion), turn
    if kind < 0.75:
        end = Pose(tuple(here + length * way), quaternion)
        return end, Segment(type=SegmentType.LINEAR, **speed)
    length, sweep = max(length, 5e-4), rng.uniform(0.3, 2.5)
    rise = 0.5 * length / np.sin(0.5 * sweep) * (1.0 - np.cos(0.5 * sweep))
    side = _unit(np.cross(way, rng.normal(size=3)))
    via = Pose(tuple(here + 0.5 * length * way + rise * side), start.quaternion)
    end = Pose(tuple(here + length * way), quaternion)
    return end, Segment(type=SegmentType.CIRCULAR, via=via, **speed)


def _unit(v):
    return v / np.linalg.norm(v)


def _turned(v, axis, angle):
    return v * np.cos(angle) + np.cross(axis, v) * np.sin(angle)


def programmed(case):
    """Return points (n, 3) along the programmed lines and arcs."""
    found = [np.array([case.state.actual_tcp_pose.position])]
    for start, point, segment in zip(
        case.starts, case.goal.waypoints, case.goal.segments, strict=True
    ):
        if segment.type is SegmentType.CIRCULAR:
            places = (start.position, segment.via.position, point.pose.position)
            found.append(arc_points(*map(np.array, places)))
        else:
            found.append(np.array([point.pose.position]))
    path = np.vstack(found)
    return path[np.append(True, np.linalg.norm(np.diff(path, axis=0), axis=1) > 1e-9)]


@dataclass
class Measured:
    """The largest values of a motion, as fractions of their limits."""

    deviation: float
    speed: float
    acceleration: float
    jerk: float
    joint_speed: float
    joint_acceleration: float
    shortest_piece: float
    pieces_per_second: float


def measure(case, plan, options=OPTIONS):
    """Return the motion of a plan, by the forward kinematics of its joint polynomials."""
    duration = plan.duration
    t = np.arange(0.0, duration, STEP)
    q, qd, qdd = plan.joint_spline.rows(t)
    tool = case.arm.forward_rows(q)[:, :3]
    path = programmed(case)
    off = distances(tool, [path]) if len(path) > 1 else np.linalg.norm(tool - path[0], axis=1)
    velocity = np.gradient(tool, STEP, axis=0)
    acceleration = np.gradient(velocity, STEP, axis=0)[2:-2]
    segments = case.goal.segments
    speeds = [
        options.linear_velocity if a.distance_to(b.pose) < 1e-6 else segment.velocity
        for a, b, segment in zip(case.starts, case.goal.waypoints, segments, strict=True)
    ]
    limit = max(segment.acceleration or options.linear_acceleration for segment in segments)
    over = 10  # the jerk over 20 ms
    jerk = np.linalg.norm(acceleration[over:] - acceleration[:-over], axis=1) / (over * STEP)
    durations = plan.rows.durations
    return Measured(
        deviation=off.max() / case.goal.corner_deviation,
        speed=np.linalg.norm(velocity, axis=1).max() / min(max(speeds), options.max_tool_speed),
        acceleration=np.linalg.norm(acceleration, axis=1).max(initial=0.0) / limit,
        jerk=jerk.max(initial=0.0) / options.max_linear_jerk,
        joint_speed=(np.abs(qd) / case.arm.model.max_joint_speed).max(),
        joint_acceleration=np.abs(qdd).max() / options.max_joint_acceleration,
        shortest_piece=durations[:-1].min(initial=1.0),
        pieces_per_second=len(durations) / duration,
    )
