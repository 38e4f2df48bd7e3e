# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Sessions of live targets, from the side of their owner.

A session is a motion like that of a goal: there is one at a time, it is cancelled in the same way,
and has one outcome. Only where it goes is told while it runs.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, sqrt

import numpy as np

from ur_cartesian_driver.driver.channel import LiveOrder
from ur_cartesian_driver.driver.motion import Motion
from ur_cartesian_driver.execution import Order
from ur_cartesian_driver.execution.live_targets import LiveSettings
from ur_cartesian_driver.execution.target_follower import FollowLimits, KeepOut
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.goal import ExecutionMode, Goal, Waypoint
from ur_cartesian_driver.motion.plan import Plan, ReferencePath
from ur_cartesian_driver.motion.pose import Pose, pose_rows
from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.workspace import parse_planes

#: How far the square of a quaternion's length may be from 1.
UNIT_TOLERANCE = 1e-3


class LiveSession:
    """A session that runs."""

    def __init__(self, motion: Motion, send: Callable[[int, Pose, float], None]) -> None:
        """Be made by :meth:`~.api.Driver.follow_targets`."""
        #: To wait for its end, or to cancel it.
        self.motion = motion
        self._send = send

    def aim(self, T_base_tcp: Pose, *, age: float = 0.0) -> None:
        """
        Go to another target from now on; in a session that has ended it means nothing.

        :param T_base_tcp: where the active TCP is to be, in the robot's base.
        :param age: how long ago that was true [s].
        :raises InvalidGoal: the target is malformed, or too far away; the one before stays.
        """
        self._send(self.motion.number, T_base_tcp, age)


def check_pose(pose: Pose) -> None:
    """
    Refuse what is no pose.

    :raises InvalidGoal: a number is not finite, or the quaternion is not of length 1.
    """
    for name, values in (('position', pose.position), ('orientation', pose.quaternion)):
        if not all(map(isfinite, values)):
            raise InvalidGoal(f'The {name} of the target', f'is {values}, which is not finite')
    square = sum(v * v for v in pose.quaternion)
    if abs(square - 1.0) > UNIT_TOLERANCE:
        raise InvalidGoal(
            'The orientation of the target', f'has length {sqrt(square):.6g}; a unit quaternion '
            'is needed', 'divide it by its length')


def check_target(T_base_tcp: Pose, state: RobotState, options: PlanningOptions) -> None:
    """
    Refuse a target that cannot be meant.

    :raises InvalidGoal: it is malformed, or farther than ``max_approach_distance`` from the tool.
    """
    check_pose(T_base_tcp)
    far, most = T_base_tcp.distance_to(state.actual_tcp_pose), options.max_approach_distance
    if 0.0 < most < far:
        raise InvalidGoal(
            'The target', f'is {far:.4g} m away from the tool, max_approach_distance is '
            f'{most:g} m', 'approach it by a goal, or raise the parameter')


def live_order(arm: Arm, options: PlanningOptions) -> LiveOrder:
    """Return how targets are followed by the parameters."""
    fastest = options.servo_target_linear_velocity
    if options.max_tool_speed > 0.0:
        fastest = min(fastest, options.max_tool_speed)
    a, b, c, d, e, f = (
        min(speed, options.servo_target_joint_velocity) for speed in arm.model.max_joint_speed)
    limits = FollowLimits(
        linear_velocity=fastest,
        linear_acceleration=options.servo_target_linear_acceleration,
        angular_velocity=options.servo_target_angular_velocity,
        angular_acceleration=options.servo_target_angular_acceleration,
        joint_velocity=(a, b, c, d, e, f),
        singularity_margins=(
            options.singularity_margin_wrist, options.singularity_margin_elbow,
            options.singularity_margin_shoulder),
        planes=tuple(
            KeepOut(name=plane.name, point=plane.point, normal=plane.normal, margin=plane.margin)
            for plane in parse_planes(options.workspace_planes)),
        tool_radius=options.tool_radius)
    return LiveOrder(
        settings=LiveSettings(limits=limits, max_age=options.servo_target_max_age,
                              timeout=options.servo_target_timeout),
        geometry=arm.geometry)


def standing_plan(state: RobotState) -> Plan:
    """Return the plan of a motion that goes nowhere by itself."""
    here = state.target_tcp_pose
    return Plan(
        goal=Goal(waypoints=(Waypoint(pose=here),), execution=ExecutionMode.SERVO),
        segments=(),
        reference=ReferencePath(poses=pose_rows((here, here)), point=np.zeros(2, dtype=np.int32),
                                time=np.zeros(2)),
        start=state.target_q, T_flange_active=state.T_flange_tcp,
        execution=ExecutionMode.SERVO)


def standing_order(plan: Plan) -> Order:
    """Return the order of such a plan: there is nothing on the wire."""
    return Order(points=1, reference=plan.reference, duration=0.0,
                 T_flange_active=plan.T_flange_active, execution=plan.execution)
