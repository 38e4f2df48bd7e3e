# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Find goals in which the frames of part and tool are probably exchanged.

Exchanged frames give another valid path, so nothing proves a mistake. But paths usually begin near
the tool. So an exchange is suspected if the path as given begins far from the tool, and would
begin near it with the frames exchanged.
"""

from __future__ import annotations

from ur_cartesian_driver.motion.errors import GoalRefused
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.goal.goal_columns import GoalTable
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.motion.state.rtde_state import RobotState

#: Length that is equivalent to a turn by one radian [m/rad].
_TURN = 0.1
#: An exchange is suspected if the path as given begins farther than _FAR [m] from the tool, and
#: more than _TIMES times as far as with the frames exchanged.
_FAR, _TIMES = 0.1, 3.0


def exchanged_frames(goal: GoalTable, state: RobotState) -> str:
    """Return a clause about frames that are probably exchanged; '' = no exchange suspected."""
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
