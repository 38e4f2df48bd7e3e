# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A stand-in for control_msgs.action.FollowJointTrajectory, which is not on PyPI.

The classes have the fields of the message definitions; numbers in arrays are floats, as rosidl's.
"""

from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, ClassVar

from builtin_interfaces.msg import Duration
from std_msgs.msg import Header


@dataclass
class JointTrajectoryPoint:
    """As trajectory_msgs/JointTrajectoryPoint."""

    positions: Any = field(default_factory=lambda: array('d'))
    velocities: Any = field(default_factory=lambda: array('d'))
    accelerations: Any = field(default_factory=lambda: array('d'))
    effort: Any = field(default_factory=lambda: array('d'))
    time_from_start: Duration = field(default_factory=Duration)


@dataclass
class JointTrajectory:
    """As trajectory_msgs/JointTrajectory, and as far as needed MultiDOFJointTrajectory."""

    header: Header = field(default_factory=Header)
    joint_names: list[str] = field(default_factory=list)
    points: list[Any] = field(default_factory=list)


@dataclass
class JointTolerance:
    """As control_msgs/JointTolerance."""

    name: str = ''
    position: float = 0.0
    velocity: float = 0.0
    acceleration: float = 0.0


@dataclass
class Goal:
    """The goal of the action."""

    trajectory: JointTrajectory = field(default_factory=JointTrajectory)
    multi_dof_trajectory: JointTrajectory = field(default_factory=JointTrajectory)
    path_tolerance: list[JointTolerance] = field(default_factory=list)
    component_path_tolerance: list[Any] = field(default_factory=list)
    goal_tolerance: list[JointTolerance] = field(default_factory=list)
    component_goal_tolerance: list[Any] = field(default_factory=list)
    goal_time_tolerance: Duration = field(default_factory=Duration)


@dataclass
class Result:
    """The result of the action."""

    SUCCESSFUL: ClassVar[int] = 0
    INVALID_GOAL: ClassVar[int] = -1
    INVALID_JOINTS: ClassVar[int] = -2
    OLD_HEADER_TIMESTAMP: ClassVar[int] = -3
    PATH_TOLERANCE_VIOLATED: ClassVar[int] = -4
    GOAL_TOLERANCE_VIOLATED: ClassVar[int] = -5

    error_code: int = 0
    error_string: str = ''


@dataclass
class Feedback:
    """The feedback of the action."""

    header: Header = field(default_factory=Header)
    joint_names: list[str] = field(default_factory=list)
    desired: JointTrajectoryPoint = field(default_factory=JointTrajectoryPoint)
    actual: JointTrajectoryPoint = field(default_factory=JointTrajectoryPoint)
    error: JointTrajectoryPoint = field(default_factory=JointTrajectoryPoint)


class FollowJointTrajectory:
    """As control_msgs.action.FollowJointTrajectory."""

    Goal, Result, Feedback = Goal, Result, Feedback


class StandInHandle:
    """As the goal handle of rclpy's action server."""

    def __init__(self, request: Goal, number: int):
        self.request = request
        self.goal_id = SimpleNamespace(uuid=bytes([number] * 16))
        self.is_cancel_requested = False
        self.feedback: list[Feedback] = []
        self.status = ''
        self.result: Any = None

    def publish_feedback(self, message: Feedback) -> None:
        self.feedback.append(message)

    def succeed(self) -> None:
        self.status = 'succeeded'

    def canceled(self) -> None:
        self.status = 'canceled'

    def abort(self) -> None:
        self.status = 'aborted'


class StandInServer:
    """As the action server, which sends the result of a goal when the goal has ended."""

    def finish(self, handle: StandInHandle, callback: Callable[[StandInHandle], Any]) -> None:
        handle.result = callback(handle)

    def destroy(self) -> None:
        """Do nothing: there is no connection."""
