# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Goal, feedback and result of control_msgs/FollowJointTrajectory.

Nothing here imports control_msgs, which is not on PyPI: callers pass the classes of the messages.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from builtin_interfaces.msg import Time

from ur_cartesian_driver.motion.errors import ErrorCode, InvalidGoal
from ur_cartesian_driver.motion.events import Outcome, Progress
from ur_cartesian_driver.motion.geometry.vectors import subtract6, Vector6
from ur_cartesian_driver.motion.goal.joint_goal import JointGoal, JointPoint, JointTolerance
from ur_cartesian_driver.ros.message_fields import age_of, duration_message, Message, seconds

#: Codes that become INVALID_GOAL: the goal was refused before anything moved, was preempted (for
#: both, ros2_control's joint trajectory controller reports the same), or was cancelled.
_AS_INVALID_GOAL = (
    ErrorCode.INVALID_POSTURE,
    ErrorCode.UNREACHABLE,
    ErrorCode.SINGULARITY,
    ErrorCode.JOINT_LIMIT,
    ErrorCode.COLLISION,
    ErrorCode.ROBOT_NOT_READY,
    ErrorCode.PREEMPTED,
    ErrorCode.CANCELLED,
)
#: Fields of newer control_msgs, which are for other robots than arms.
_OTHER_FIELDS = ('component_path_tolerance', 'component_goal_tolerance')


def joint_goal_from_message(message: Message, *, now: int, time_tolerance: float) -> JointGoal:
    """
    Return the goal of a ``FollowJointTrajectory.Goal``.

    :param now: time of the node's clock when the goal was received [ns].
    :param time_tolerance: the value for a ``goal_time_tolerance`` of zero [s].
    :raises InvalidGoal: the message has parts that are not for the joints of an arm.
    """
    _check_other_fields(message)
    trajectory = message.trajectory
    return JointGoal(
        joint_names=tuple(trajectory.joint_names),
        points=tuple(
            JointPoint(
                time=seconds(point.time_from_start),
                positions=tuple(point.positions),
                velocities=tuple(point.velocities),
                accelerations=tuple(point.accelerations),
                effort=tuple(point.effort),
            )
            for point in trajectory.points
        ),
        age=age_of(trajectory.header.stamp, now),
        path_tolerance=tuple(_tolerances(message.path_tolerance)),
        goal_tolerance=tuple(_tolerances(message.goal_tolerance)),
        goal_time_tolerance=seconds(message.goal_time_tolerance) or time_tolerance,
    )


def joint_feedback(
    make: type[Any], progress: Progress, joint_names: Sequence[str], stamp: Time
) -> Message:
    """
    Return the feedback message of a progress report.

    :param make: the class of the action's feedback.
    """
    message = make()
    message.header.stamp = stamp
    message.joint_names = list(joint_names)
    q, qd = progress.actual_q, progress.actual_qd
    _fill(message.desired, progress.time, progress.desired_q, progress.desired_qd)
    _fill(message.actual, progress.time, q, qd)
    _fill(
        message.error,
        progress.time,
        subtract6(progress.desired_q, q),
        subtract6(progress.desired_qd, qd),
    )
    return message


def joint_result(make: type[Any], outcome: Outcome) -> Message:
    """
    Return the result message of an outcome; its text begins with the name of our own code.

    :param make: the class of the action's result.
    """
    name = '' if outcome.succeeded else f'{outcome.code.name}: '
    message = make()
    code = joint_error_code(outcome.code)
    if outcome.code is ErrorCode.COLLISION and outcome.stopped is not None:
        code = ErrorCode.PATH_TOLERANCE_VIOLATED  # the cell changed after the arm had moved
    message.error_code = int(code)
    message.error_string = f'{name}{outcome.text}'
    return message


def joint_error_code(code: ErrorCode) -> ErrorCode:
    """
    Return the code of FollowJointTrajectory for one of ours.

    Codes that FollowJointTrajectory does not have become INVALID_GOAL or, if the motion was
    stopped for another reason, PATH_TOLERANCE_VIOLATED. No failure becomes 0, which is SUCCESSFUL.
    """
    if code >= ErrorCode.GOAL_TOLERANCE_VIOLATED:
        return code
    if code in _AS_INVALID_GOAL:
        return ErrorCode.INVALID_GOAL
    return ErrorCode.PATH_TOLERANCE_VIOLATED


def _tolerances(entries: Iterable[Message]) -> Iterable[JointTolerance]:
    return (
        JointTolerance(
            name=entry.name,
            position=entry.position,
            velocity=entry.velocity,
            acceleration=entry.acceleration,
        )
        for entry in entries
    )


def _check_other_fields(message: Message) -> None:
    more = getattr(message, 'multi_dof_trajectory', None)
    wrong = ['multi_dof_trajectory'] if more is not None and more.points else []
    wrong += [field for field in _OTHER_FIELDS if getattr(message, field, ())]
    if wrong:
        raise InvalidGoal(
            wrong[0], 'is given, but an arm has only the six joints', 'leave it empty'
        )


def _fill(point: Message, time: float, positions: Vector6, velocities: Vector6) -> None:
    point.time_from_start = duration_message(time)
    point.positions = list(positions)
    point.velocities = list(velocities)
