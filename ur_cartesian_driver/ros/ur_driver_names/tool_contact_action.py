# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The action of the tool contact controller: each goal becomes a goal of the driver's own action.

Like the controller, the server rejects a goal while another one watches. Goals and results have no
fields, so the reason why a goal is aborted is logged.
"""

from __future__ import annotations

from ur_cartesian_driver.action import DetectToolContact
from ur_cartesian_driver.ros.message_fields import Message
from ur_cartesian_driver.ros.ur_driver_names.offered_name import Served
from ur_cartesian_driver.ros.ur_driver_names.trajectory_actions import ForwardedGoal, GoalForwarder


class _ContactForwarder(GoalForwarder):
    target_type = DetectToolContact

    def forward(self, run: ForwardedGoal) -> None:
        """Send a goal, which has no fields."""
        self.send(run, DetectToolContact.Goal())

    def feedback(self, feedback: Message) -> Message:
        """Return feedback, which has no fields."""
        return self.action.Feedback()

    def result(self, result: Message) -> Message:
        """Return a result, which has no fields, and log a failure."""
        return self.action.Result() if result.success else self.failure(result.message)

    def failure(self, text: str) -> Message:
        """Return a result, and log the reason, for which it has no field."""
        self.driver.warn(f'tool_contact_controller/detect_tool_contact: {text}')
        return self.action.Result()


TOOL_CONTACT_ACTION = Served(
    kind='action',
    name='tool_contact_controller/detect_tool_contact',
    type='ur_msgs/action/ToolContact',
    source='detect_tool_contact',
    server=_ContactForwarder,
)
