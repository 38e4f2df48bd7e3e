# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The topics with the state of the robot, published by a thread of their own.

A timer of the executor would take twice the computing time and wait for every other callback. The
thread also detects changes, so that only one thread publishes and nothing needs a lock.

Names, types, units and rates are in ``doc/ros_interface.md``.
"""

from __future__ import annotations

import threading
from time import monotonic
import traceback
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import PoseStamped, WrenchStamped
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, String

from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.link_shapes import LinkFrames
from ur_cartesian_driver.kinematics.robot_description import robot_description
from ur_cartesian_driver.motion.state.io_signals import Signals
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.msg import DriverStatus, IOStates, RobotMode, SafetyMode, ToolData
from ur_cartesian_driver.ros.message_fields import class_of
from ur_cartesian_driver.ros.messages.state_messages import (
    io_states_message,
    joint_state_message,
    link_transforms,
    robot_mode_message,
    safety_mode_message,
    slowed_by,
    status_message,
    tcp_pose_message,
    tcp_transform,
    tool_data_message,
    wrench_message,
)
from ur_cartesian_driver.ros.node_endpoints import LATCHED_QOS, STATE_QOS, TF_QOS
from ur_cartesian_driver.ros.parameters.node_parameters import Settings
from ur_cartesian_driver.ros.state.diagnostics import diagnostics_message

#: Number of stamps of ``joint_states`` that are kept: enough for all messages that a subscriber
#: may not have received yet.
KEPT_STAMPS = 1000
#: Period in which an unchanged status is published again [s].
STATUS_PERIOD = 1.0
#: Shortest time between two logs of the same defect [s].
WARNING_PERIOD = 10.0


class StatePublisher:
    """Publishes the state of a driver from :meth:`start` to :meth:`close`."""

    def __init__(self, node: Node, driver: Driver, settings: Settings) -> None:
        """Create the publishers."""
        self._clock, self._context = node.get_clock(), node.context
        self._logger = node.get_logger()
        self._driver = driver
        self._period = 1.0 / settings.node.state_publish_rate
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name='state publisher', daemon=True)
        self._description_topic = _DescriptionTopic(node, settings.planning.tf_prefix)
        self._state_topics = _StateTopics(node, settings)
        self._status_topics = _StatusTopics(node)
        self._io_topics = _IoTopics(node)
        self._diagnostics_topic = _DiagnosticsTopic(node, settings.node.diagnostics_rate)

    def has_published(self, stamp: Time) -> bool:
        """Return whether one of the last ``joint_states`` has this stamp."""
        return self._state_topics.has_published(stamp)

    def start(self) -> None:
        """Start publishing."""
        self._thread.start()

    def close(self) -> None:
        """Stop publishing; the node destroys the publishers."""
        self._closed.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        """Publish at absolute deadlines; missed ones are skipped."""
        due = monotonic()
        while not self._closed.wait(max(0.0, due - monotonic())):
            try:
                self._publish(monotonic())
            except InvalidHandle:
                return  # the node was destroyed
            except Exception as error:
                if not self._context.ok():
                    return  # ROS was shut down under the node
                # One bad value must not silence all topics for good.
                self._logger.error(
                    'The state of the robot is not published, because of a defect of the driver, '
                    f'{type(error).__name__}: {error}.\n{traceback.format_exc()}',
                    throttle_duration_sec=WARNING_PERIOD,
                )
            due += self._period * max(1.0, (monotonic() - due) // self._period)

    def _publish(self, now: float) -> None:
        driver, stamp = self._driver, self._clock.now().to_msg()
        state = driver.state
        self._description_topic.publish(driver.arm)
        self._state_topics.publish(state, driver.arm, stamp)
        self._status_topics.publish(driver, state, now, stamp)
        self._io_topics.publish(driver.signals, stamp)
        self._diagnostics_topic.publish(driver, now, stamp)


class _DescriptionTopic:
    """``~/robot_description``: latched, published again when the calibration is known."""

    def __init__(self, node: Node, tf_prefix: str) -> None:
        self._tf_prefix = tf_prefix
        self._topic = node.create_publisher(String, '~/robot_description', LATCHED_QOS)
        self._last: Arm | None = None

    def publish(self, arm: Arm) -> None:
        if arm is not self._last:
            self._last = arm
            self._topic.publish(String(data=robot_description(arm, self._tf_prefix)))


class _StateTopics:
    """Topics that are published with each new state of the robot."""

    def __init__(self, node: Node, settings: Settings) -> None:
        self._joint_names = settings.joint_names
        self._base, self._tcp = settings.frames.base, settings.frames.tcp
        self._joint_states = node.create_publisher(JointState, 'joint_states', STATE_QOS)
        self._tcp_pose = node.create_publisher(PoseStamped, '~/tcp_pose', STATE_QOS)
        self._wrench = node.create_publisher(WrenchStamped, '~/wrench', STATE_QOS)
        self._speed_scaling = node.create_publisher(Float64, '~/speed_scaling', STATE_QOS)
        # tf2_msgs is not on PyPI.
        self._tf_message_type: Any = class_of('tf2_msgs/msg/TFMessage')
        self._tf = self._tf_message_type and node.create_publisher(
            self._tf_message_type, '/tf', TF_QOS
        )
        self._last: RobotState | None = None
        self._publishes_links = settings.node.publish_link_frames
        self._tf_prefix = settings.planning.tf_prefix
        self._arm: Arm | None = None
        #: The stamps of the last messages, as keys, because another thread looks them up.
        self._stamps: dict[tuple[int, int], None] = {}

    def has_published(self, stamp: Time) -> bool:
        return (stamp.sec, stamp.nanosec) in self._stamps

    def publish(self, state: RobotState | None, arm: Arm, stamp: Time) -> None:
        last, self._last = self._last, state
        if state is None or (last is not None and state.timestamp == last.timestamp):
            return
        self._stamps[stamp.sec, stamp.nanosec] = None
        if len(self._stamps) > KEPT_STAMPS:
            del self._stamps[next(iter(self._stamps))]
        self._joint_states.publish(joint_state_message(state, self._joint_names, stamp))
        self._tcp_pose.publish(tcp_pose_message(state, self._base, stamp))
        self._wrench.publish(wrench_message(state, self._tcp, stamp))
        self._speed_scaling.publish(Float64(data=state.effective_speed))
        if self._tf is not None:
            transforms = [tcp_transform(state, self._base, self._tcp, stamp)]
            if self._publishes_links:
                if arm is not self._arm:
                    self._arm, self._link_frames = arm, LinkFrames(arm)
                transforms += link_transforms(state, self._link_frames, self._tf_prefix, stamp)
            self._tf.publish(self._tf_message_type(transforms=transforms))


class _StatusTopics:
    """Latched topics that are published on change."""

    def __init__(self, node: Node) -> None:
        self._status = node.create_publisher(DriverStatus, '~/status', LATCHED_QOS)
        self._robot_mode = node.create_publisher(RobotMode, '~/robot_mode', LATCHED_QOS)
        self._safety_mode = node.create_publisher(SafetyMode, '~/safety_mode', LATCHED_QOS)
        self._program = node.create_publisher(Bool, '~/robot_program_running', LATCHED_QOS)
        self._last: dict[Any, object] = {}
        self._last_status_time = -STATUS_PERIOD

    def publish(self, driver: Driver, state: RobotState | None, now: float, stamp: Time) -> None:
        connection = driver.status
        robot_mode = None if state is None else state.robot_mode
        safety_mode = None if state is None else state.safety_mode
        progress = driver.progress
        slowed = [(who, why) for who, _, why in slowed_by(state, progress)]
        overdue = now - self._last_status_time >= STATUS_PERIOD
        if self._is_new(self._status, (connection, robot_mode, safety_mode, slowed)) or overdue:
            self._last_status_time = now
            self._status.publish(status_message(connection, state, stamp, progress))
        if self._is_new(self._robot_mode, robot_mode):
            self._robot_mode.publish(robot_mode_message(state))
        if self._is_new(self._safety_mode, safety_mode):
            self._safety_mode.publish(safety_mode_message(state))
        if self._is_new(self._program, connection.program_running):
            self._program.publish(Bool(data=connection.program_running))

    def _is_new(self, topic: Any, value: object) -> bool:
        """Return whether the value of a topic has changed, or is its first value."""
        if topic in self._last and self._last[topic] == value:
            return False
        self._last[topic] = value
        return True


class _IoTopics:
    """Inputs, outputs and tool: latched, published on change."""

    def __init__(self, node: Node) -> None:
        self._io_states = node.create_publisher(IOStates, '~/io_states', LATCHED_QOS)
        self._tool_data = node.create_publisher(ToolData, '~/tool_data', LATCHED_QOS)
        self._last: Signals | None = None

    def publish(self, signals: Signals | None, stamp: Time) -> None:
        last, self._last = self._last, signals
        if signals is None or signals is last:
            return
        self._io_states.publish(io_states_message(signals, stamp))
        self._tool_data.publish(tool_data_message(signals, stamp))


class _DiagnosticsTopic:
    """``/diagnostics``, at its own rate."""

    def __init__(self, node: Node, rate: float) -> None:
        self._name = node.get_fully_qualified_name().strip('/')
        self._period = 1.0 / rate if rate > 0.0 else 0.0
        self._topic = (
            node.create_publisher(DiagnosticArray, '/diagnostics', STATE_QOS)
            if rate > 0.0
            else None
        )
        self._due = 0.0

    def publish(self, driver: Driver, now: float, stamp: Time) -> None:
        if self._topic is not None and now >= self._due:
            self._due = now + self._period
            self._topic.publish(diagnostics_message(driver, self._name, stamp))
