# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The actions of the node: each class converts the messages of one action for the runs of goals.

:class:`JointAction` is served only if control_msgs is installed, and :class:`JointUntilAction`
only if ur_msgs is, too; neither is on PyPI.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeAlias

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.motion.events import Outcome, Progress
from ur_cartesian_driver.motion.goal.goal import Goal
from ur_cartesian_driver.motion.goal.joint_goal import JointGoal
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.ros.goals.goal_context import GoalContext
from ur_cartesian_driver.ros.message_fields import class_of, Message
from ur_cartesian_driver.ros.messages.action_messages import (
    feedback_message,
    FeedbackFrame,
    result_message,
)
from ur_cartesian_driver.ros.messages.goal_conversion import goal_from_message, resolve_frames
from ur_cartesian_driver.ros.messages.joint_messages import (
    joint_feedback,
    joint_goal_from_message,
    joint_result,
)

AnyGoal: TypeAlias = Goal | JointGoal
MakeFeedback: TypeAlias = Callable[[Progress], Message]


class CartesianAction:
    """Follow the path of a tool: ``~/follow_cartesian_trajectory``."""

    #: The class of the action, and its name relative to the node.
    action_type: Any = FollowCartesianTrajectory
    name = '~/follow_cartesian_trajectory'

    def is_validation(self, request: Message) -> bool:
        """Return whether a goal is only to be checked."""
        return bool(request.validate_only)

    def goal(self, request: Message, context: GoalContext, received: int) -> Goal:
        """
        Return the goal of a message.

        :param received: time of receipt on the node's clock [ns].
        :raises GoalRefused: the message is malformed, or the pose of a frame is not known.
        """
        return goal_from_message(
            request,
            context.frames,
            now=received,
            snapshot=context.snapshot(),
            time_tolerance=context.settings.node.goal_time_tolerance,
        )

    def resolved(self, goal: Any, request: Message, context: GoalContext) -> AnyGoal:
        """Return a goal with the present poses of its frames."""
        return resolve_frames(
            goal,
            request.trajectory,
            context.frames,
            now=context.now(),
            snapshot=context.snapshot(),
        )

    def feedback_of(self, request: Message, plan: Plan, context: GoalContext) -> MakeFeedback:
        """Return the function that makes the feedback messages of a plan."""
        trajectory = request.trajectory
        frame = FeedbackFrame(
            frame_id=trajectory.header.frame_id or context.frames.base,
            controlled_frame=trajectory.controlled_frame or context.frames.tcp,
            T_frame_base=plan.goal.T_base_frame.inverse(),
            joint_names=context.settings.joint_names,
        )
        return lambda progress: feedback_message(progress, frame, context.clock.now().to_msg())

    def result(self, outcome: Outcome) -> FollowCartesianTrajectory.Result:
        """Return the result message of an outcome."""
        return result_message(outcome)


class JointAction:
    """Follow a joint trajectory, as MoveIt sends it: ``~/follow_joint_trajectory``."""

    name = '~/follow_joint_trajectory'

    def __init__(self, action_type: Any) -> None:
        """Serve an action with the fields of control_msgs/FollowJointTrajectory."""
        self.action_type = action_type

    def is_validation(self, request: Message) -> bool:
        """Return False, because all goals are executed."""
        return False

    def goal(self, request: Message, context: GoalContext, received: int) -> JointGoal:
        """Return the goal of a message."""
        return joint_goal_from_message(
            request, now=received, time_tolerance=context.settings.node.goal_time_tolerance
        )

    def resolved(self, goal: AnyGoal, request: Message, context: GoalContext) -> AnyGoal:
        """Return the goal unchanged, because joints have no frames."""
        return goal

    def feedback_of(self, request: Message, plan: Plan, context: GoalContext) -> MakeFeedback:
        """Return the function that makes the feedback messages of a plan."""
        make, names = self.action_type.Feedback, context.settings.joint_names
        return lambda progress: joint_feedback(make, progress, names, context.clock.now().to_msg())

    def result(self, outcome: Outcome) -> Message:
        """Return the result message of an outcome."""
        return joint_result(self.action_type.Result, outcome)


class JointUntilAction(JointAction):
    """Follow a joint trajectory until the tool touches: ``~/follow_joint_trajectory_until``."""

    name = '~/follow_joint_trajectory_until'

    def goal(self, request: Message, context: GoalContext, received: int) -> JointGoal:
        """
        Return the goal of a message.

        :raises InvalidGoal: the goal waits for something other than contact.
        """
        if request.until_type != request.TOOL_CONTACT:
            raise InvalidGoal(
                'until_type',
                f'is {request.until_type}',
                f'use TOOL_CONTACT ({request.TOOL_CONTACT})',
            )
        return replace(super().goal(request, context, received), until_contact=True)

    def result(self, outcome: Outcome) -> Message:
        """Return the result message of an outcome."""
        message = super().result(outcome)
        message.until_condition_result = (
            message.TRIGGERED if outcome.touched else message.NOT_TRIGGERED
        )
        return message


GoalAction: TypeAlias = CartesianAction | JointAction


def installed_actions() -> list[GoalAction]:
    """Return the actions that the node can serve with the installed packages."""
    actions: list[GoalAction] = [CartesianAction()]
    for type_name, kind in (
        ('control_msgs/action/FollowJointTrajectory', JointAction),
        ('ur_msgs/action/FollowJointTrajectoryUntil', JointUntilAction),  # not in old releases
    ):
        action_type = class_of(type_name)
        if action_type is None:
            break  # ur_msgs needs control_msgs
        actions.append(kind(action_type))
    return actions
