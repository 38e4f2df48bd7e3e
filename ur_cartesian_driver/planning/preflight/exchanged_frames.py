# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Find goals whose two frames are probably exchanged, the part for the tool.

Exchanged frames give another path, not a wrong one, so this cannot be told for sure. But people
begin a path near where the arm stands: if the path as given begins far from there, and begins near
with the frames exchanged, then that is said.
"""

from __future__ import annotations

from ur_cartesian_driver.motion.errors import GoalRefused
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.motion.state.rtde_state import RobotState

#: Length for which a turn by one radian counts [m/rad].
_TURN = 0.1
#: The path as given begins at least this far away [m], and more than so many times as far.
_FAR, _TIMES = 0.1, 3.0


def exchanged_frames(goal: GoalTable, state: RobotState) -> str:
    """Return a clause about frames that are probably exchanged; '' = nothing points to that."""
    T_base_flange = state.actual_tcp_pose @ state.T_flange_tcp.inverse()
    held, first = goal.moving_frame, goal.waypoints.pose(0)
    if held is not None:
        given = held.tool(T_base_flange)
        T_base_part = held.frame(T_base_flange)
        exchanged = held.T_base_tool.inverse() @ T_base_part
    elif goal.T_flange_controlled is None or goal.T_base_frame == IDENTITY:
        return ''
    else:
        given = goal.T_base_frame.inverse() @ T_base_flange @ goal.T_flange_controlled
        other = MovingFrame(T_flange_frame=goal.T_flange_controlled, T_base_tool=goal.T_base_frame)
        exchanged = other.tool(T_base_flange)
    far, near = _far_from(given, first), _far_from(exchanged, first)
    if not (far > _FAR and far > _TIMES * near):
        return ''
    return (
        'with header.frame_id and controlled_frame exchanged, the path would begin '
        f'{1e3 * exchanged.distance_to(first):.0f} mm and {exchanged.angle_to(first):.2f} rad '
        f'from where the arm is, not {1e3 * given.distance_to(first):.0f} mm and '
        f'{given.angle_to(first):.2f} rad: frame_id is the part, controlled_frame the tool'
    )


def with_exchanged_frames(refusal: GoalRefused, goal: GoalTable, state: RobotState) -> GoalRefused:
    """Return a refusal, with the clause about exchanged frames if there is one."""
    if clause := exchanged_frames(goal, state):
        return refusal.reworded(f'{str(refusal).rstrip(".")} ({clause}).')
    return refusal


def _far_from(a: Pose, b: Pose) -> float:
    return a.distance_to(b) + _TURN * a.angle_to(b)
