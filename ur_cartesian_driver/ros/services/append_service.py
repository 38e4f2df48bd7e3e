# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The service that appends points to a running goal with keep_open.

A separate thread plans the points, one request after the other, so neither the executor nor the
feedback waits for the planning. The response is sent when the points are appended or refused.
"""

from __future__ import annotations

from hashlib import sha256
import pickle
import traceback
from typing import Any

from rclpy.node import Node

from ur_cartesian_driver.motion.errors import (
    AlreadySent,
    DriverError,
    InvalidGoal,
    RobotNotReady,
)
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints
from ur_cartesian_driver.ros.goals.action_server import GoalServer
from ur_cartesian_driver.ros.goals.goal_run import GoalRun
from ur_cartesian_driver.ros.message_fields import AT_END
from ur_cartesian_driver.ros.messages.goal_conversion import appended_points_from_message
from ur_cartesian_driver.ros.services.deferred_service import DeferredService, RequestQueue
from ur_cartesian_driver.srv import AppendPoints

#: How long points wait for the motion of a goal to begin [s].
BEGIN_TIMEOUT = 10.0


class AppendService:
    """Serves ``~/append_points``."""

    def __init__(self, node: Node, server: GoalServer) -> None:
        """Start to serve."""
        self._logger, self._server = node.get_logger(), server
        self._queue = RequestQueue('append points', self._append, _refusal)
        self._service = DeferredService(node, AppendPoints, '~/append_points', self._queue.submit)

    def close(self) -> None:
        """Refuse new requests; the one that is being planned is completed."""
        self._queue.close()

    def _append(self, request: Any) -> Any:
        """Return the response to a request."""
        goal_id = bytes(request.goal_id.uuid)
        run = self._server.find_run(goal_id) if any(goal_id) else self._server.running_goal
        if run is None:
            return _refusal(
                'No goal with this goal_id is running: it has ended, or was never sent.'
                if any(goal_id)
                else 'No goal runs to which points could be appended: send one with keep_open.'
            )
        try:
            return self._append_to_run(run, request)
        except AlreadySent as error:
            return _refusal(
                str(error),
                run.points,
                first_index=error.first_point,
                first_time=error.first_time,
            )
        except DriverError as error:
            return _refusal(str(error), run.points)
        except Exception as error:
            self._logger.error(traceback.format_exc())
            return _refusal(
                f'The driver has a defect, {type(error).__name__}: {error}; its log says more.',
                run.points,
            )

    def _append_to_run(self, run: GoalRun, request: Any) -> Any:
        """
        Append the points of a request to a goal, and return the response.

        :raises GoalRefused: the request is refused, and nothing was appended.
        """
        # A goal that waits for its start time must not hold up appends to the running one.
        motion = run.motion(0.0 if run.is_waiting else BEGIN_TIMEOUT)
        if motion is None or motion.appender is None:
            raise RobotNotReady(
                'The goal does not move yet; append its points when it does.'
                if motion is None
                else 'The goal was sent without keep_open: nothing can be appended.'
            )
        new_points = appended_points_from_message(request)
        request_key = request.first_index, _digest(new_points)
        if run.last_append is not None and run.last_append[0] == request_key:
            return run.last_append[1]  # the same request again
        points = motion.appender.points
        if not new_points.replaces and request.first_index not in (points, AT_END):
            raise InvalidGoal(
                'first_index',
                f'is {request.first_index}, but the goal has {points} points',
                f'append point {points} first'
                if request.first_index > points
                else f'continue with point {points}',
            )
        appended = motion.appender.append(new_points)
        response = AppendPoints.Response(
            accepted=True,
            message=appended.text,
            points_received=appended.points,
            first_index=appended.first,
        )
        run.last_append = (request_key, response)
        return response


def _digest(new_points: AppendedPoints) -> bytes:
    """Return a key that is the same for the same points, even if they contain NaN."""
    return sha256(pickle.dumps(new_points)).digest()


def _refusal(text: str, points: int = 0, **first: float) -> Any:
    return AppendPoints.Response(accepted=False, message=text, points_received=points, **first)
