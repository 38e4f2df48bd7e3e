# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Where a client's requests to append points say that their points go."""

import pytest
from rclpy.task import Future
from unique_identifier_msgs.msg import UUID

from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.path import digital, Path
from ur_cartesian_driver.ros.goal_appender import GoalAppender
from ur_cartesian_driver.ros.message_fields import AT_END
from ur_cartesian_driver.srv import AppendPoints


class Service:
    """A client of the service that answers each request as told."""

    def __init__(self, *answers):
        self._answers = list(answers)
        self.indices = []
        self.outputs = []

    def call_async(self, request):
        self.indices.append(request.first_index)
        self.outputs.append([command.point_index for command in request.io_commands])
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


START = Path((0.4, 0.0, 0.3), (1.0, 0.0, 0.0, 0.0))
TWO = START.by(dx=0.01).by(dx=0.01).set(digital(1), True)


def test_outputs_of_a_path_go_where_its_points_go():
    service = Service((True, 7), (True, 9), (True, 9))
    appender = GoalAppender(service, UUID(), 5)
    appender.append(TWO)
    appender.append(TWO)
    appender.append(TWO, replace_from_point=3)
    assert service.outputs == [[6], [8], [4]]


@pytest.mark.parametrize('where', [{'replace_from_time': 1.0}, {}])
def test_outputs_of_a_path_whose_numbers_are_not_known_are_refused(where):
    appender = GoalAppender(Service(), UUID(), AT_END)
    with pytest.raises(InvalidGoal, match='whose numbers in the goal are not known'):
        appender.append(TWO, **where)


def test_what_needs_the_whole_path_is_refused():
    appender = GoalAppender(Service(), UUID(), 2)
    with pytest.raises(InvalidGoal, match='payload_changes is not empty, but needs the whole'):
        appender.append(TWO.payload(1.0))
