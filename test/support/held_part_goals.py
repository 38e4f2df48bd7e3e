# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Random paths on random parts that an arm holds before a fixed tool, and measures of their plans.

Pinocchio measures the motion on a URDF of arm, part and tool, without any code of the package.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

from curve_distance import distances
import numpy as np
from rounded_goals import programmed, random_case, RoundedCase
from urdf_arm import urdf_of, UrdfArm

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import Pose, quaternion_from_roll_pitch_yaw
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.planning.stop_prediction import state_at_rest
from ur_cartesian_driver.sim.calibration import random_calibration

MODELS = ('ur3e', 'ur5', 'ur5e', 'ur10e', 'ur16e', 'ur20')
#: Distance of samples [s].
STEP = 0.002
#: Time over which the jerk is measured [s].
OVER = 0.02


@dataclass
class HeldCase(RoundedCase):
    """A goal on a held part; the pose of the arm's ``state`` is the tool's pose on the part."""

    frame: MovingFrame
    urdf: UrdfArm

    def relative(self, q):
        """Return the poses (n, 4, 4) of the fixed tool, seen from the part."""
        return self.urdf.relative('tool', 'part', q)


def origin_pose(origin):
    """Return the pose of the origin of a URDF."""
    return Pose(tuple(origin[:3]), quaternion_from_roll_pitch_yaw(*origin[3:]))


def held_case(random, path_of, arm=None):
    """
    Return a random part in a random hand before a random tool, with a path on the part.

    :param path_of: takes the generator and the start pose of a path, and returns its goal.
    :param arm: the arm; None = a random arm.
    """
    rng = np.random.default_rng(random.randrange(2**32))
    model = robot_model(rng.choice(MODELS))
    geometry = random_calibration(model, int(rng.integers(1000))) if rng.random() < 0.5 else None
    arm = arm or Arm(model, geometry)
    q = tuple((np.array([0.2, -1.5, 1.9, -1.9, -1.57, 0.3]) + rng.normal(0.0, 0.15, 6)).tolist())
    part = [*rng.uniform(-0.15, 0.15, 3), *rng.uniform(-1.5, 1.5, 3)]
    at = Pose(
        tuple(rng.uniform(-0.12, 0.12, 3).tolist()),
        quaternion_from_roll_pitch_yaw(*rng.uniform(-1.5, 1.5, 3).tolist()),
    )
    # The tool stands at the start of the path; its origin in the URDF comes from numbers alone.
    T_base_tool = arm.forward(q) @ origin_pose(part) @ at
    frame, urdf = frame_and_urdf(arm, origin_pose(part), T_base_tool)
    goal = replace(path_of(random, at), moving_frame=frame, controlled_frame='tool')
    seen = frame.seen(state_at_rest(arm, q))
    return HeldCase(arm, seen, goal, frame, urdf)


def frame_and_urdf(arm, T_flange_part, T_base_tool):
    """Return a part that the arm holds before a fixed tool, and pinocchio's view of the three."""
    part, tool = map(_origin, (T_flange_part, T_base_tool))
    frame = MovingFrame(T_flange_frame=origin_pose(part), T_base_tool=origin_pose(tool))
    return frame, UrdfArm(urdf_of(arm.geometry, {'part': ('tool0', part), 'tool': ('base', tool)}))


def _origin(pose):
    R = pose.matrix()
    return (
        *pose.position,
        float(np.arctan2(R[2, 1], R[2, 2])),
        float(np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0]))),
        float(np.arctan2(R[1, 0], R[0, 0])),
    )


def rounded_goal(random, start):
    """Return random lines, arcs and turns that begin at a pose."""
    case = random_case(random)
    T = start @ case.state.actual_tcp_pose.inverse()
    # Most parts are ground more slowly than arms can move.
    slower = random.choice([0.05, 0.2, 1.0])

    def moved(pose):
        return None if pose is None else T @ pose

    return replace(
        case.goal,
        waypoints=tuple(replace(each, pose=moved(each.pose)) for each in case.goal.waypoints),
        segments=tuple(
            replace(each, via=moved(each.via), velocity=slower * each.velocity)
            for each in case.goal.segments
        ),
    )


def spline_goal(random, start):
    """Return a goal with times and random rates, which begins at a pose and rests at its end."""
    rng = np.random.default_rng(random.randrange(2**32))
    pose, time, points, speed = start, 0.0, [], 10.0 ** rng.uniform(-2.0, -0.8)
    count = int(rng.integers(2, 7))
    for k in range(count):
        step = rng.normal(0.0, 0.04, 3)
        turn = rng.normal(0.0, 0.15, 3)
        time += max(float(np.linalg.norm(step)) / speed, 0.3)
        pose = Pose(
            tuple((np.array(pose.position) + step).tolist()),
            (Pose((0.0,) * 3, quaternion_from_roll_pitch_yaw(*turn.tolist())) @ pose).quaternion,
        )
        twist = (0.0,) * 6
        if k + 1 < count:
            twist = (*(0.5 * speed * rng.normal(size=3)).tolist(), *rng.normal(0.0, 0.05, 3))
        points.append(Waypoint(time=time, pose=pose, twist=vector6(map(float, twist))))
    return Goal(waypoints=tuple(points), execution=ExecutionMode.SPLINE)


def spline_poses(case, times):
    """Return positions (n, 3) at times on the cubics through the points, by the tests' formula."""
    found = np.empty((len(times), 3))
    points = [
        Waypoint(time=0.0, pose=case.state.actual_tcp_pose),
        *case.goal.waypoints,
    ]
    for a, b in pairwise(points):
        rows = (times >= a.time) & (times <= b.time)
        h = b.time - a.time
        u = ((times[rows] - a.time) / h)[:, None]
        found[rows] = (
            (1.0 + 2.0 * u) * (1.0 - u) ** 2 * np.array(a.pose.position)
            + u * (1.0 - u) ** 2 * h * np.array(a.twist[:3])
            + u * u * (3.0 - 2.0 * u) * np.array(b.pose.position)
            + u * u * (u - 1.0) * h * np.array(b.twist[:3])
        )
    return found


def turned_by(a, b):
    """Return the angle between rotations (3, 3) [rad]."""
    R = a.T @ b
    sine = np.linalg.norm([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return float(np.arctan2(sine, np.trace(R) - 1.0))


@dataclass
class Held:
    """The motion of a plan on the part, in samples, with fractions of its limits."""

    #: (n, 4, 4) the tool on the part; (n,) its speed there [m/s].
    tool: np.ndarray
    speed: np.ndarray
    #: (n,) as fractions of their limits: joint speeds and accelerations, the speed of the flange
    #: in base, and acceleration, angular acceleration and jerk of the tool on the part.
    joint_speed: np.ndarray
    joint_acceleration: np.ndarray
    carrier: np.ndarray
    acceleration: np.ndarray
    turn_acceleration: np.ndarray
    jerk: np.ndarray

    @property
    def near_limits(self):
        """The largest of these fractions (n,)."""
        return np.maximum.reduce(
            [
                self.joint_speed,
                self.joint_acceleration,
                self.carrier,
                self.acceleration,
                self.turn_acceleration,
                self.jerk,
            ]
        )


def measure(case, made, options):
    """Return the motion of a plan, by pinocchio."""
    t = np.arange(0.0, made.duration, STEP)
    return measured(case, made.joint_spline.rows(t), options)


def measure_trace(case, q, cycle, options):
    """Return the motion of the target joints (n, 6) of all cycles; rates are differences."""
    qd = np.gradient(q, cycle, axis=0)
    return measured(case, (q, qd, np.gradient(qd, cycle, axis=0)), options, cycle)


def measured(case, joints, options, step=STEP):
    """
    Return the motion on the part for a motion of the joints.

    :param joints: positions, speeds and accelerations (n, 6) each, a step [s] apart.
    """
    q, qd, qdd = joints
    tool = case.relative(q)
    flange = case.urdf.relative('tool0', 'base', q)[:, :3, 3]
    velocity = np.gradient(tool[:, :3, 3], step, axis=0)
    acceleration = np.gradient(velocity, step, axis=0)
    limit = max(
        (each.acceleration or options.linear_acceleration for each in case.goal.segments),
        default=options.max_linear_acceleration,
    )
    jerk, over = np.zeros(len(q)), round(OVER / step)
    if len(q) > over:
        change = acceleration[over:] - acceleration[:-over]
        jerk[over // 2 : len(q) - over + over // 2] = np.linalg.norm(change, axis=1) / (
            over * step
        )
    base_speed = np.linalg.norm(np.gradient(flange, step, axis=0), axis=1)
    return Held(
        tool=tool,
        speed=np.linalg.norm(velocity, axis=1),
        joint_speed=(np.abs(qd) / case.arm.model.max_joint_speed).max(axis=1),
        joint_acceleration=np.abs(qdd).max(axis=1) / options.max_joint_acceleration,
        carrier=base_speed / options.max_tool_speed,
        acceleration=np.linalg.norm(acceleration, axis=1) / limit,
        turn_acceleration=_turn_accelerations(tool[:, :3, :3], step)
        / options.max_angular_acceleration,
        jerk=jerk / options.max_linear_jerk,
    )


def _turn_accelerations(R, step):
    """Return the angular accelerations (n,) [rad/s^2] of rotations (n, 3, 3) a step [s] apart."""
    W = np.gradient(R, step, axis=0) @ R.transpose(0, 2, 1)
    w = np.stack([W[:, 2, 1], W[:, 0, 2], W[:, 1, 0]], axis=1)
    return np.linalg.norm(np.gradient(w, step, axis=0), axis=1)


def off_path(case, seen):
    """Return the distances (n,) of the tool from the programmed path on the part [m]."""
    path = programmed(case)
    points = seen.tool[:, :3, 3]
    if len(path) < 2:
        return np.linalg.norm(points - path[0], axis=1)
    return distances(points, [path])
