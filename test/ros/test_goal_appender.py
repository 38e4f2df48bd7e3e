# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Where a client's requests to append points say that their points go."""

from rclpy.task import Future
from unique_identifier_msgs.msg import UUID

from ur_cartesian_driver.ros.goal_appender import GoalAppender
from ur_cartesian_driver.srv import AppendPoints


class Service:
    """A client of the service that answers each request as told."""

    def __init__(self, *answers):
        self._answers = list(answers)
        self.indices = []

    def call_async(self, request):
        self.indices.append(request.first_index)
        accepted, points = self._answers.pop(0)
        future = Future()
        future.set_result(AppendPoints.Response(accepted=accepted, points_received=points))
        return future


def test_a_refusal_tells_where_the_next_points_go():
    service = Service((False, 5), (True, 6), (False, 0), (True, 7))
    appender = GoalAppender(service, UUID(), 2)
    for _ in range(4):
        appender.append(None)
    assert service.indices == [2, 5, 6, 6]
