# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The client's side of ``~/append_points``, for one goal."""

from __future__ import annotations

from typing import Any

from rclpy.task import Future

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.motion.errors import InvalidGoal
from ur_cartesian_driver.path import Path
from ur_cartesian_driver.planning.request.point_events.registry import EVENT_KINDS
from ur_cartesian_driver.ros.message_fields import AT_END
from ur_cartesian_driver.ros.messages.packed_points import packed_if_long
from ur_cartesian_driver.srv import AppendPoints


class GoalAppender:
    """Appends points to a goal, or replaces its tail; sends one request after the other."""

    def __init__(self, client: Any, goal_id: Any, points: int) -> None:
        """
        Take the client of the service, the id of a goal and the number of its points.

        :param goal_id: zeros = the goal that moves the arm.
        :param points: AT_END = not known.
        """
        self._client = client
        self._goal_id = goal_id
        self._points = points
        self._newest_answer: Future | None = None

    def append(
        self,
        path: Path | FollowCartesianTrajectory.Goal | None,
        *,
        last: bool = False,
        replace_from_point: int | None = None,
        replace_from_time: float | None = None,
    ) -> Future:
        """
        Send a request once all earlier ones are answered; return a future of the response.

        :param path: the points, segments and outputs; None = no points. For the other parameters
            see :meth:`~ur_cartesian_driver.ros.client.GoalClient.append`.
        :raises ValueError: both ``replace_from_point`` and ``replace_from_time`` are given.
        :raises InvalidGoal: the path has events that cannot be appended, or outputs at points
            whose numbers in the goal are not known.
        """
        if replace_from_point is not None and replace_from_time is not None:
            raise ValueError('Give replace_from_point or replace_from_time, not both.')
        request = AppendPoints.Request(goal_id=self._goal_id, last=last)
        counts_from_path = isinstance(path, Path)
        if path is not None:
            goal = packed_if_long(path.to_message() if isinstance(path, Path) else path)
            _refuse_other_events(goal, request)
            request.points, request.segments = goal.trajectory.points, goal.segments
            request.io_commands, request.packed = goal.io_commands, goal.packed
        if replace_from_point is not None:
            request.replace, request.first_index = request.REPLACE_FROM_POINT, replace_from_point
        elif replace_from_time is not None:
            request.replace = request.REPLACE_FROM_TIME
            request.replace_from_time = replace_from_time
        is_first_known = request.replace == request.REPLACE_FROM_POINT or (
            request.replace == request.APPEND and self._points != AT_END
        )
        if counts_from_path and request.io_commands and not is_first_known:
            raise InvalidGoal(
                'io_commands',
                'are at points of a path, whose numbers in the goal are not known here',
                'give replace_from_point, or append a message: its outputs count from the first '
                'point of the goal',
            )
        answer = Future()
        before, self._newest_answer = self._newest_answer, answer
        if before is None:
            self._ask(request, answer, counts_from_path)
        else:
            before.add_done_callback(lambda _: self._ask(request, answer, counts_from_path))
        return answer

    def _ask(self, request: AppendPoints.Request, answer: Future, counts_from_path: bool) -> None:
        if request.replace == request.APPEND:
            # The index is known once the earlier requests are answered.
            request.first_index = self._points
        for command in request.io_commands if counts_from_path else ():
            command.point_index += request.first_index

        def take(done: Future) -> None:
            response = done.result()
            # A refusal also has the count, because another client may have appended points. 0 =
            # there is no such goal.
            self._points = response.points_received or self._points
            answer.set_result(response)

        self._client.call_async(request).add_done_callback(take)


def _refuse_other_events(
    goal: FollowCartesianTrajectory.Goal, request: AppendPoints.Request
) -> None:
    """Refuse events at points for which a request has no field: they would be lost."""
    for kind in EVENT_KINDS.values():
        if not hasattr(request, kind.field) and len(getattr(goal, kind.field)):
            raise InvalidGoal(
                kind.field,
                'is not empty, but needs the whole path',
                'send it with the goal, or append the points without it',
            )
