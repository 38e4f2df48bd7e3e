# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The action of motion_primitives_controllers: each sequence becomes a goal of the driver's action.

This server rejects the same goals as the controller: a goal while another one runs, and targets
that do not suit their type. The reason is logged, because a rejection carries none.
"""

from __future__ import annotations

from concurrent.futures import Future
from functools import partial

from rcl_interfaces.srv import GetParameters

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.goal_files.goal_schema import message_of, with_defaults
from ur_cartesian_driver.goal_files.goal_writing import fields_of_goal
from ur_cartesian_driver.motion.errors import ErrorCode, InvalidGoal
from ur_cartesian_driver.ros.message_fields import Message
from ur_cartesian_driver.ros.ur_driver_names.driver_node import DriverSilent
from ur_cartesian_driver.ros.ur_driver_names.offered_name import Served
from ur_cartesian_driver.ros.ur_driver_names.primitive_sequence import (
    check_targets,
    goal_of_sequence,
)
from ur_cartesian_driver.ros.ur_driver_names.trajectory_actions import ForwardedGoal, GoalForwarder

#: The index of the feedback is a byte.
_MAX_INDEX = 255


class _SequenceForwarder(GoalForwarder):
    target_type = FollowCartesianTrajectory

    def rejection(self, goal: Message) -> str:
        """Return the reason why the controller rejects a sequence; empty = it does not."""
        try:
            check_targets(goal.trajectory.motions)
        except InvalidGoal as error:
            return str(error).rstrip('.')
        return ''

    def forward(self, run: ForwardedGoal) -> None:
        """Ask for the prefix of the joints, and then send the goal."""
        request = GetParameters.Request(names=['tf_prefix'])
        answer = self.driver.request(GetParameters, 'get_parameters', request)
        answer.add_done_callback(partial(self._send, run))

    def _send(self, run: ForwardedGoal, answer: Future[Message]) -> None:
        try:
            values = answer.result().values
            prefix = values[0].string_value if values else ''
            goal = goal_of_sequence(run.handle.request.trajectory.motions, prefix)
        except (DriverSilent, InvalidGoal) as error:
            self.refuse(run, str(error))
        else:
            fields = with_defaults(fields_of_goal(goal))
            self.send(run, message_of(fields, FollowCartesianTrajectory.Goal))

    def feedback(self, feedback: Message) -> Message:
        """Return the number of the primitive that is being executed."""
        index = min(feedback.point_index, _MAX_INDEX)
        return self.action.Feedback(current_primitive_index=index)

    def result(self, result: Message) -> Message:
        """Return a result; for a failure, its text begins with the name of the driver's code."""
        code = ErrorCode(result.error_code)
        if code is ErrorCode.SUCCESSFUL:
            return self.action.Result(error_string=result.error_string)
        return self.action.Result(
            error_code=self.action.Result.INVALID_GOAL,
            error_string=f'{code.name}: {result.error_string}',
        )

    def failure(self, text: str) -> Message:
        """Return an INVALID_GOAL."""
        return self.action.Result(
            error_code=self.action.Result.INVALID_GOAL, error_string=f'INVALID_GOAL: {text}'
        )


SEQUENCE_ACTION = Served(
    kind='action',
    name='motion_primitive_forward_controller/motion_sequence',
    type='control_msgs/action/ExecuteMotionPrimitiveSequence',
    source='follow_cartesian_trajectory',
    server=_SequenceForwarder,
)
