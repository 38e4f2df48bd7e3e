# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
MoveIt's planning scene as bodies of the cell (``planning_scene_topic``).

The topic has only changes of the scene. So the whole scene is requested from a service whenever
the service appears: at the start of either node, and again after a restart of MoveIt.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
import contextlib
import traceback
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy

from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.motion.goal.known_frames import Frames
from ur_cartesian_driver.ros.message_fields import class_of
from ur_cartesian_driver.ros.messages.planning_scene import SceneArm, SceneBodies, updated_scene
from ur_cartesian_driver.ros.node_endpoints import steady_timer

#: The types of the topic and of the service.
TYPE, SERVICE_TYPE = 'moveit_msgs/msg/PlanningScene', 'moveit_msgs/srv/GetPlanningScene'
#: The name of the service, in the namespace of the topic.
SERVICE = 'get_planning_scene'
#: Period in which the node looks for the service [s].
_PERIOD = 1.0
#: Each message changes the scene of the previous messages, so none may be lost.
_QOS = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)


class PlanningSceneSubscriber:
    """Takes over planning scenes, one after the other in a thread of its own."""

    def __init__(self, node: Node, driver: Driver, frames: Frames, topic: str) -> None:
        """Subscribe, if moveit_msgs is installed."""
        self._logger: Any = node.get_logger()
        self._driver, self._frames = driver, frames
        self._names: frozenset[str] = frozenset()
        self._thread = ThreadPoolExecutor(1, thread_name_prefix='planning scene')
        self._had_service = False
        kind, self._service_kind = class_of(TYPE), class_of(SERVICE_TYPE)
        if kind is None or self._service_kind is None:
            self._logger.error(
                f'planning_scene_topic is {topic}, but moveit_msgs is not installed: nothing of '
                'the planning scene is checked.'
            )
            return
        group = MutuallyExclusiveCallbackGroup()
        self._subscription = node.create_subscription(
            kind, topic, self._received, _QOS, callback_group=group
        )
        namespace = topic.rpartition('/')[0]
        self._client: Any = node.create_client(
            self._service_kind,
            f'{namespace}/{SERVICE}' if '/' in topic else SERVICE,
            callback_group=group,
        )
        self._timer = steady_timer(node, _PERIOD, self._look_for_service, group)

    def close(self) -> None:
        """Take over no further scenes."""
        self._thread.shutdown(cancel_futures=True)

    def _look_for_service(self) -> None:
        """Ask for the whole scene each time the service appears."""
        has_service = self._client.service_is_ready()
        if has_service and not self._had_service:
            request: Any = self._service_kind.Request()
            wanted = request.components
            wanted.components = wanted.WORLD_OBJECT_GEOMETRY | wanted.ROBOT_STATE_ATTACHED_OBJECTS
            self._client.call_async(request).add_done_callback(
                lambda done: self._received(done.result().scene)
            )
        self._had_service = has_service

    def _received(self, message: Any) -> None:
        with contextlib.suppress(RuntimeError):  # close() was called
            self._thread.submit(self.take, message)

    def take(self, message: Any) -> None:
        """Take over a message, or log the reason why this is impossible."""
        driver = self._driver
        place = SceneArm(
            arm=driver.arm,
            state=driver.state,
            frames=self._frames,
            prefix=driver.options.tf_prefix,
        )
        before = SceneBodies(cell=driver.cell, names=self._names & driver.cell.names)
        try:
            after = updated_scene(before, message, place)
            pairs, pairs_before = after.cell.may_touch, before.cell.may_touch
            # change_cell() cannot take away a pair of bodies that may touch. So the bodies of such
            # a pair are removed, which removes all their pairs, and added anew.
            anew = {name for pair in pairs_before - pairs for name in pair} & after.names
            changed = [
                body
                for body in after.cell.bodies
                if body.name in anew or body not in before.cell.bodies
            ]
            if changed or pairs != pairs_before or before.cell.names != after.cell.names:
                driver.change_cell(
                    changed,
                    remove=(before.cell.names - after.cell.names) | anew,
                    may_touch=[pair for pair in pairs if pair & anew or pair not in pairs_before],
                )
        except (DriverError, ValueError) as error:
            clause = str(error).rstrip('.')
            self._logger.error(f'The planning scene is not taken over: {clause}.')
        except Exception:  # the next message may be right
            self._logger.error(traceback.format_exc())
        else:
            self._names = after.names
