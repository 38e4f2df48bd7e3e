# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The topics that tell the state of the robot, published from a thread of their own.

A timer of the executor would cost twice as much and wait behind every other callback. The thread
also notices changes, so there is one place that publishes and nothing to lock.

==========================  ======================  ===========================================
topic                       type                    content
==========================  ======================  ===========================================
``joint_states``            sensor_msgs/JointState  measured positions [rad], velocities [rad/s]
``~/tcp_pose``              geometry_msgs/          measured pose of the active TCP in ``base``
                            PoseStamped
``~/speed_scaling``         std_msgs/Float64        part of the nominal speed at which the
                                                    controller runs, 0 (stands) to 1
``~/robot_mode``            std_msgs/Int8, latched  number of the controller, 7 = RUNNING; -2 =
                                                    not reported (``DriverStatus`` names them)
``~/safety_mode``           std_msgs/Int8, latched  number of the controller, 1 = NORMAL; 0 = not
                                                    reported
``~/robot_program_running`` std_msgs/Bool, latched  our program runs on the robot
``~/status``                DriverStatus, latched   all of it, and what is needed; on each change
                                                    and once a second
==========================  ======================  ===========================================
"""

from __future__ import annotations

from collections.abc import Callable
from math import nan
import threading
from time import monotonic
from typing import Any

from builtin_interfaces.msg import Time
from geometry_msgs.msg import PoseStamped
from rclpy.action.server import RCLError
from rclpy.exceptions import InvalidHandle
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Bool, Float64, Int8

from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.driver import DriverStatus as Connection
from ur_cartesian_driver.kinematics.robots import JOINT_NAMES
from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.msg import DriverStatus
from ur_cartesian_driver.ros.parameters import Settings
from ur_cartesian_driver.ros.reports import joint_state_message, tcp_pose_message

#: The newest value is enough, but a reliable subscriber shall be served too.
STATE = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)
#: Who comes late gets the last value at once.
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                     durability=DurabilityPolicy.TRANSIENT_LOCAL)
#: How often an unchanged status is confirmed [s].
CONFIRMATION = 1.0


class StatePublisher:
    """Publishes the state of a driver from its start to :meth:`close`."""

    def __init__(self, node: Node, driver: Driver, settings: Settings) -> None:
        """Make the publishers; :meth:`start` begins to use them."""
        self._clock = node.get_clock()
        self._driver = driver
        self._period = 1.0 / settings.node.state_publish_rate
        self._joint_names = tuple(settings.planning.tf_prefix + name for name in JOINT_NAMES)
        self._base = settings.frames.base

        self._joint_states = node.create_publisher(JointState, 'joint_states', STATE)
        self._tcp_pose = node.create_publisher(PoseStamped, '~/tcp_pose', STATE)
        self._speed_scaling = node.create_publisher(Float64, '~/speed_scaling', STATE)
        self._status = node.create_publisher(DriverStatus, '~/status', LATCHED)
        self._confirmed = -CONFIRMATION
        self._last_status: object = None
        self._last_state: RobotState | None = None
        self._on_change: tuple[_OnChange, ...] = (
            _OnChange(node, Int8, '~/robot_mode', lambda status: status.robot_mode),
            _OnChange(node, Int8, '~/safety_mode', lambda status: status.safety_mode),
            _OnChange(node, Bool, '~/robot_program_running',
                      lambda status: status.program_running),
        )
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._run, name='state publisher', daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """End the thread; the publishers go with the node."""
        self._closed.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        """Publish at absolute deadlines; those that were missed are left out."""
        due = monotonic()
        while not self._closed.wait(max(0.0, due - monotonic())):
            try:
                self._publish(monotonic())
            except (InvalidHandle, RCLError):
                return  # ROS was shut down under the node
            due += self._period * max(1.0, (monotonic() - due) // self._period)

    def _publish(self, now: float) -> None:
        state, connection = self._driver.state, self._driver.status
        stamp = self._clock.now().to_msg()
        if state is not None and state != self._last_state:
            self._joint_states.publish(joint_state_message(state, self._joint_names, stamp))
            self._tcp_pose.publish(tcp_pose_message(state, self._base, stamp))
            self._speed_scaling.publish(Float64(data=state.speed_scaling))
        self._last_state = state

        mode = None if state is None else (state.robot_mode, state.safety_mode)
        if (connection, mode) != self._last_status or now - self._confirmed >= CONFIRMATION:
            self._last_status, self._confirmed = (connection, mode), now
            status = status_message(connection, state, stamp)
            self._status.publish(status)
            for topic in self._on_change:
                topic.publish(status)


class _OnChange:
    """A latched topic with one value of the status."""

    def __init__(self, node: Node, kind: Any, name: str,
                 value: Callable[[DriverStatus], Any]) -> None:
        self._publisher = node.create_publisher(kind, name, LATCHED)
        self._kind, self._value, self._last = kind, value, None

    def publish(self, status: DriverStatus) -> None:
        value = self._value(status)
        if value != self._last:
            self._last = value
            self._publisher.publish(self._kind(data=value))


def status_message(connection: Connection, state: RobotState | None, stamp: Time) -> DriverStatus:
    """Return how far the connection is, with the modes of the robot."""
    message = DriverStatus(
        state=int(connection.state),
        message=connection.message,
        last_error=connection.last_error,
        robot_mode=DriverStatus.ROBOT_MODE_UNKNOWN,
        safety_mode=DriverStatus.SAFETY_MODE_UNKNOWN,
        program_running=connection.program_running,
        speed_scaling=nan,
        robot_model=connection.robot_model,
        polyscope_version=connection.polyscope_version,
        calibration_known=connection.calibration_known,
    )
    message.header.stamp = stamp
    if state is not None:
        message.robot_mode = int(state.robot_mode)
        message.safety_mode = int(state.safety_mode)
        message.speed_scaling = state.speed_scaling
    return message
