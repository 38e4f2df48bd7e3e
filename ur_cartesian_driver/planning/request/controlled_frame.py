# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Goals that control a frame other than the robot's active TCP.

If the tool turns while one of its points moves on a straight line, other points move on curves. So
the robot's TCP is set to the controlled frame during the goal (temporary TCP), and the goal is
planned for this TCP. If the TCP must not be changed, the goal is converted to the active TCP; this
conversion is exact if the tool does not turn.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import degrees, isnan

import numpy as np

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.pose_rows import compose_rows, cross_rows, normalized_rows
from ur_cartesian_driver.motion.goal.goal import ArcMode, Goal, SegmentType
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable, rows_where
from ur_cartesian_driver.motion.state.rigid_body import shift_reference_point
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import (
    IS_JOINT_MOVE,
    is_spline,
    is_timed,
    point_field,
    resolve_execution_mode,
    segment_field,
)

#: Turns of the tool up to this angle [rad] on a straight or circular segment are neglected: a
#: frame at a distance r from the TCP leaves its line by r angle^2 / 8 (5 um for r = 0.4 m).
MAX_FIXED_ANGLE = 0.01

#: A controlled frame within this distance [m] and angle [rad] of the TCP counts as the TCP. Two
#: TCPs that differ by more are sent as different numbers, so the reported TCP shows which is set.
_SAME_TCP = 5e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class RetargetedGoal:
    """
    A goal and the state of its robot, both for the TCP with which the goal is executed.

    If the frame of the goal is on a held part, the state is given in this frame, like the goal.
    """

    goal: GoalTable
    state: RobotState
    #: The temporary TCP; None = the active TCP stays.
    T_flange_tcp: Pose | None = None
    #: The controlled frame in this TCP; IDENTITY unless the goal was converted to the active TCP.
    T_tcp_controlled: Pose = IDENTITY
    remarks: tuple[str, ...] = ()


def retarget_to_tcp(
    goal: GoalTable, state: RobotState, options: PlanningOptions
) -> RetargetedGoal:
    """
    Return a checked goal for the TCP with which it will be executed.

    :raises InvalidGoal: the TCP must not change (allow_tcp_change is false), but the tool turns.
    """
    if goal.moving_frame is not None:
        return RetargetedGoal(goal=goal, state=goal.moving_frame.seen(state))
    T_flange_controlled = goal.T_flange_controlled
    if T_flange_controlled is None or is_same_tcp(T_flange_controlled, state.T_flange_tcp):
        return RetargetedGoal(goal=goal, state=state)
    T_tcp_controlled = state.T_flange_tcp.inverse() @ T_flange_controlled
    if options.allow_tcp_change:
        x, y, z, rx, ry, rz = T_flange_controlled.rotation_vector()
        return RetargetedGoal(
            goal=goal,
            state=shift_reference_point(state, T_tcp_controlled),
            T_flange_tcp=T_flange_controlled,
            remarks=(
                f'temporary TCP: {_name(goal)}, p[{x:.6f}, {y:.6f}, {z:.6f}, {rx:.6f}, {ry:.6f}, '
                f'{rz:.6f}], set for this goal and restored at its end',
            ),
        )
    _check_no_rotation(goal, state.actual_tcp_pose @ T_tcp_controlled)
    return RetargetedGoal(
        goal=_retarget_goal(goal, T_tcp_controlled.inverse()),
        state=state,
        T_tcp_controlled=T_tcp_controlled,
        remarks=(
            f'the goal is converted from {_name(goal)} to the active TCP, because '
            'allow_tcp_change is false',
        ),
    )


def tool_tips(goal: Goal | GoalTable, T_flange_active: Pose) -> tuple[Pose, ...]:
    """
    Return the tool tips to check for collisions: the active TCP and the controlled frame.

    A mounted tool can collide even if a goal controls the bare flange.
    """
    T_flange_controlled = goal.T_flange_controlled
    if T_flange_controlled is None or is_same_tcp(T_flange_controlled, T_flange_active):
        return (T_flange_active,)
    return T_flange_active, T_flange_controlled


def is_same_tcp(a: Pose, b: Pose) -> bool:
    """Return whether two frames count as the same TCP."""
    return a.distance_to(b) <= _SAME_TCP and a.angle_to(b) <= _SAME_TCP


def _name(goal: GoalTable) -> str:
    return goal.controlled_frame or 'the controlled frame'


def _check_no_rotation(goal: GoalTable, T_base_start: Pose) -> None:
    """
    Refuse straight and circular segments that turn the tool.

    :param T_base_start: pose of the controlled frame at the start.
    """
    points, segments = goal.waypoints, goal.motions
    start = goal.T_base_frame.inverse() @ T_base_start
    follows_path = ~IS_JOINT_MOVE[segments.types]
    takes_joint_moves = not resolve_execution_mode(goal).traits.is_spline
    if is_timed(goal) and points.times[0] == 0.0:
        follows_path[0] = False
    for i in rows_where(follows_path):
        angle = (points.pose(i - 1) if i > 0 else start).angle_to(points.pose(i))
        segment = segments[i]
        joint = 'use JOINT for that segment, ' if takes_joint_moves else ''
        remedy = f'keep the orientation, {joint}or set allow_tcp_change to true'
        if angle > MAX_FIXED_ANGLE:
            raise InvalidGoal(
                point_field(i, 'pose.orientation'),
                f'turns {_name(goal)} by {degrees(angle):.2f} degrees, but a frame other than the '
                'active TCP follows a line or an arc only without turning',
                remedy,
            )
        if is_spline(goal):
            _check_no_angular_rates(goal, i, remedy)
        if segment.type == SegmentType.CIRCULAR and segment.arc_mode == ArcMode.FIXED:
            raise InvalidGoal(
                segment_field(i, 'arc_mode'),
                f'is FIXED, which turns {_name(goal)} with the arc, but a frame other than the '
                'active TCP follows an arc only without turning',
                'use UNCONSTRAINED, or set allow_tcp_change to true',
            )


def _check_no_angular_rates(goal: GoalTable, index: int, remedy: str) -> None:
    """Refuse a point of a spline with an angular velocity or acceleration; NaN counts as none."""
    point = goal.waypoints[index]
    for field, values in (('twist', point.twist), ('acceleration', point.acceleration)):
        if any(value != 0.0 and not isnan(value) for value in values[3:]):
            raise InvalidGoal(
                f'{point_field(index, field)}.angular',
                f'turns {_name(goal)}, but a frame other than the active TCP follows a spline '
                'only without turning',
                remedy,
            )


def _retarget_goal(goal: GoalTable, T_controlled_tcp: Pose) -> GoalTable:
    """
    Return the same motion as a goal of the TCP.

    Vias are shifted by the same vector as the ends of their segments, because the tool does not
    turn on arcs.
    """
    points, segments = goal.waypoints, goal.segments
    poses = points.poses.copy()
    poses[:, 3:] = normalized_rows(poses[:, 3:])
    moved = compose_rows(poses, T_controlled_tcp)
    offsets = moved[:, :3] - poses[:, :3]
    twists, accelerations = (
        np.concatenate([rates[:, :3], np.nan_to_num(rates[:, 3:])], axis=1)
        for rates in (points.twists, points.accelerations)
    )
    w = twists[:, 3:]
    swing = cross_rows(w, offsets)
    twists[:, :3] += swing
    accelerations[:, :3] += cross_rows(accelerations[:, 3:], offsets) + cross_rows(w, swing)
    goal = replace(
        goal,
        waypoints=replace(points, poses=moved, twists=twists, accelerations=accelerations),
    )
    if not len(segments):
        return goal
    vias = compose_rows(segments.vias, T_controlled_tcp)
    vias[:, :3] = segments.vias[:, :3] + offsets
    vias = np.where(segments.has_via[:, None], vias, segments.vias)
    return replace(goal, segments=replace(segments, vias=vias))
