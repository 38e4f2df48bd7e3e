# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The ROS node, which creates and connects its components, and the command that runs it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
import ctypes
from dataclasses import fields
import logging
import re
import signal
import sys
from time import monotonic
from types import FrameType
from typing import Any, ClassVar

import rclpy
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.executors import SingleThreadedExecutor
from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import remove_ros_args

from ur_cartesian_driver.driver import Driver
from ur_cartesian_driver.driver.callbacks import LOG
from ur_cartesian_driver.ros.goals.action_server import GoalServer
from ur_cartesian_driver.ros.goals.feed_override_subscriber import FeedOverrideSubscriber
from ur_cartesian_driver.ros.goals.path_offset_subscriber import PathOffsetSubscriber
from ur_cartesian_driver.ros.goals.planning_scene_subscriber import PlanningSceneSubscriber
from ur_cartesian_driver.ros.live.freedrive_service import FreedriveService
from ur_cartesian_driver.ros.live.live_target_subscriber import LiveTargetSubscriber
from ur_cartesian_driver.ros.live.servo_state_publisher import ServoStatePublisher
from ur_cartesian_driver.ros.node_endpoints import steady_timer
from ur_cartesian_driver.ros.parameters.node_parameters import (
    as_overrides,
    declare_parameters,
    explained_overrides,
)
from ur_cartesian_driver.ros.parameters.parameter_table import ParameterError, ParameterValue
from ur_cartesian_driver.ros.services.append_service import AppendService
from ur_cartesian_driver.ros.services.cell_service import CellService
from ur_cartesian_driver.ros.services.command_services import CommandServices
from ur_cartesian_driver.ros.services.contact_action import ContactAction
from ur_cartesian_driver.ros.state.joint_states_check import JointStatesCheck
from ur_cartesian_driver.ros.state.pulse_publisher import PulsePublisher
from ur_cartesian_driver.ros.state.state_publisher import StatePublisher
from ur_cartesian_driver.ros.ur_driver_names.names_process import NamesProcess
from ur_cartesian_driver.ros.ur_driver_names.names_settings import NamesSettings

#: Longest period of the heartbeat, which reports that the node's executor is alive [s].
HEARTBEAT_PERIOD = 0.5
#: Time after which other nodes have been discovered, and their names are checked [s].
DISCOVERY_TIME = 2.0
#: Longest time that :func:`main` waits for the arm to stop and the results to be sent [s].
SHUTDOWN_TIMEOUT = 5.0
#: Arrays of at least this size give their memory back to the system when they are freed [bytes].
LARGE_ARRAY = 2**20
#: The option with which :func:`main` also offers topics and services of the UR ROS 2 driver.
UR_DRIVER_NAMES = '--ur-driver-names'
_USAGE = (
    f'Usage: ur-cartesian-driver [{UR_DRIVER_NAMES}] [--ros-args [-p NAME:=VALUE] '
    '[--params-file FILE] [-r __ns:=/NAMESPACE]]; doc/parameters.md has the parameters.'
)
#: Parameters of mallopt, from malloc.h.
_M_MMAP_THRESHOLD, _M_ARENA_MAX = -3, -8


class CartesianDriverNode(Node):
    """
    The driver of one arm as a ROS node.

    From its construction until :meth:`destroy_node`, the node connects to the robot by itself. Add
    the node to any executor; if the executor hangs for ``node_timeout``, the arm is stopped.
    """

    def __init__(
        self,
        node_name: str = 'ur_cartesian_driver',
        *,
        namespace: str | None = None,
        parameter_overrides: Mapping[str, ParameterValue] | Iterable[Parameter] | None = None,
        **node_kwargs: Any,
    ) -> None:
        """
        Declare the parameters and start to connect.

        :param parameter_overrides: values by name, or rclpy parameters.
        :param node_kwargs: for ``rclpy.node.Node``.
        :raises ParameterError: a parameter is unknown or invalid; the text says why.
        """
        with explained_overrides():
            super().__init__(
                node_name,
                namespace=namespace,
                parameter_overrides=as_overrides(parameter_overrides),
                automatically_declare_parameters_from_overrides=True,
                **node_kwargs,
            )
        self._components: list[Any] = []  # destroy_node() closes them, the last one first
        try:
            self._start()
        except BaseException:
            self.destroy_node()
            raise

    def _start(self) -> None:
        settings = declare_parameters(self, [each.name for each in fields(NamesSettings)])
        self._joint_names = settings.joint_names
        logger = self.get_logger()  # type: ignore[no-untyped-call]  # rclpy's
        log_bridge = _LogBridge(logger)
        self._components.append(log_bridge)
        self.driver = Driver(
            settings.driver, settings.planning, auto_heartbeat=False, logger=log_bridge.source
        )
        self._components.append(self.driver)
        self.driver.open()
        self._publisher = StatePublisher(self, self.driver, settings)
        self._components.append(self._publisher)
        self.action_server = GoalServer(self, self.driver, settings)
        self._components.append(self.action_server)
        self.driver.add_cell_listener(lambda _: self.action_server.cell_markers.publish())
        self._components.append(AppendService(self, self.action_server))
        self.path_offsets = PathOffsetSubscriber(self, self.action_server)
        self.feed_overrides = FeedOverrideSubscriber(self, self.action_server)
        arbiter = self.action_server.arbiter
        self._pulse_publisher = PulsePublisher(self, self.driver, settings.frames.base)
        if settings.node.servo_state_rate > 0.0:
            self._servo_state_publisher = ServoStatePublisher(
                self, self.driver, settings.node.servo_state_rate
            )
        if settings.node.live_target_enabled:
            self.live_targets = LiveTargetSubscriber(
                self, self.driver, arbiter, self.action_server.frames
            )
            self._components.append(self.live_targets)
        self._components.append(FreedriveService(self, self.driver, arbiter))
        self.contact_action = ContactAction(self, self.driver)
        self._components.append(self.contact_action)
        self._components.append(CellService(self, self.driver))
        if topic := settings.node.planning_scene_topic:
            self.planning_scenes = PlanningSceneSubscriber(
                self, self.driver, self.action_server.frames, topic
            )
            self._components.append(self.planning_scenes)
        self._publisher.start()
        self._call_services = CommandServices(self, self.driver, self._is_idle)
        steady_timer(
            self,
            min(HEARTBEAT_PERIOD, settings.driver.node_timeout / 4.0),
            self.driver.heartbeat,
            MutuallyExclusiveCallbackGroup(),  # so that it runs during other callbacks
        )
        self._neighbour_timer = steady_timer(self, DISCOVERY_TIME, self._warn_of_neighbours)

    def _is_idle(self) -> bool:
        """Return whether no goal or session depends on the present TCP, payload and gravity."""
        return self.action_server.idle and not self.action_server.arbiter.holder

    def _warn_of_neighbours(self) -> None:
        """
        Log once if another node has the name of this one, or publishes states of its joints.

        Two nodes of one name could get each other's goals.
        """
        self._neighbour_timer.cancel()
        if self.count_publishers('joint_states') > 1:
            self._joint_states_check = JointStatesCheck(
                self, self._joint_names, self._publisher.has_published
            )
        own_name = self.get_name(), self.get_namespace()
        if self.get_node_names_and_namespaces().count(own_name) > 1:
            self.get_logger().error(  # type: ignore[no-untyped-call]  # rclpy's
                f'Another node has the name {self.get_fully_qualified_name()}: goals and calls '
                'may reach the wrong robot. Give each driver a namespace, a tf_prefix and ports '
                'of its own.'
            )

    def destroy_node(self) -> None:
        """Stop the arm, end all goals, threads and connections, and destroy the node."""
        if hasattr(self, 'action_server'):
            self.action_server.stop()  # first, as the end of other components may take seconds
        components, self._components = self._components, []
        for component in reversed(components):
            component.close()
        super().destroy_node()  # type: ignore[no-untyped-call]  # rclpy's


class _LogBridge(logging.Handler):
    """
    Passes the log records of one driver to the logger of its node.

    Records that belong to no driver, such as a report of a failed callback, go to the oldest node
    of the process.
    """

    _bridges: ClassVar[list[_LogBridge]] = []
    _SEVERITIES = ((logging.ERROR, 'error'), (logging.WARNING, 'warning'), (logging.INFO, 'info'))

    def __init__(self, logger: RcutilsLogger) -> None:
        super().__init__()
        self._ros_logger = logger
        #: The logger of the driver.
        self.source = LOG.getChild(logger.name)
        self.source.setLevel(logging.DEBUG)
        self._bridges.append(self)
        LOG.addHandler(self)

    def filter(self, record: logging.LogRecord) -> bool:
        if record.name == self.source.name:
            return True
        others = (bridge.source.name for bridge in self._bridges)
        return self._bridges[0] is self and record.name not in others

    def emit(self, record: logging.LogRecord) -> None:
        text = self.format(record)  # with the traceback, if there is one
        for level, severity in self._SEVERITIES:
            if record.levelno >= level:
                # rclpy insists on one call site for each severity.
                getattr(self, f'_{severity}')(text)
                return
        self._ros_logger.debug(text)

    def _error(self, text: str) -> None:
        self._ros_logger.error(text)

    def _warning(self, text: str) -> None:
        self._ros_logger.warning(text)

    def _info(self, text: str) -> None:
        self._ros_logger.info(text)

    def close(self) -> None:
        LOG.removeHandler(self)
        self._bridges.remove(self)
        super().close()


def main(arguments: Sequence[str] | None = None) -> None:
    """
    Run the node until SIGINT or SIGTERM.

    The first signal stops the arm, and the node waits until running goals have ended with a
    result; a second signal ends this wait. With ``--ur-driver-names`` another process offers the
    topics and services of the UR ROS 2 driver under their names.
    """
    given = list(sys.argv if arguments is None else arguments)
    own_arguments = [argument for argument in given if argument != UR_DRIVER_NAMES]
    _share_freed_memory()
    # rclpy's own handlers would shut ROS down at once, and no goal could end with a result.
    try:
        rclpy.init(
            args=own_arguments,
            signal_handler_options=SignalHandlerOptions.NO,
        )
        _check_arguments(remove_ros_args(own_arguments)[1:])
    except RuntimeError as error:
        # rcl appends the source line to its sentence; for unknown arguments it just lists them.
        reason = re.split(r', at /', str(error))[0]
        if reason.startswith('['):
            reason = f'{reason[1:-1]} is not understood. {_USAGE}'
        sys.exit(f'ur_cartesian_driver: {reason}')
    signals = _SignalCounter()
    try:
        node = CartesianDriverNode()
    except ParameterError as error:
        rclpy.shutdown()
        sys.exit(f'ur_cartesian_driver: {error}')
    names = None
    try:
        if UR_DRIVER_NAMES in given:
            names = NamesProcess(node.get_fully_qualified_name(), own_arguments)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        was_idle = True
        while not signals.count:
            executor.spin_once(timeout_sec=0.2)
            idle = node.action_server.idle
            if idle and not was_idle:
                _give_freed_memory_back()
            was_idle = idle
        _end_goals(node, executor, signals)
    finally:
        node.destroy_node()  # first: it stops live targets and freedrive, too
        if names is not None:
            names.close()
        rclpy.shutdown()


def _check_arguments(arguments: Sequence[str]) -> None:
    """
    Exit if help is requested, or if ROS does not take an argument.

    Ignoring a misspelt argument could connect the node to another arm.
    """
    if arguments:
        rclpy.shutdown()
    if {'-h', '--help'} & set(arguments):
        sys.stdout.write(f'{_USAGE}\n')
        sys.exit(0)
    if arguments:
        sys.exit(f'ur_cartesian_driver: {" ".join(arguments)} is not understood. {_USAGE}')


def _end_goals(
    node: CartesianDriverNode, executor: SingleThreadedExecutor, signals: _SignalCounter
) -> None:
    servers = node.action_server, node.contact_action
    for server in servers:
        server.stop()
    deadline = monotonic() + SHUTDOWN_TIMEOUT
    while (
        not all(server.idle for server in servers) and monotonic() < deadline and signals.count < 2
    ):
        executor.spin_once(timeout_sec=0.05)
    for _ in range(3):  # the executor still has to send the results
        executor.spin_once(timeout_sec=0.02)


def _share_freed_memory() -> None:
    """
    Make all threads share one memory arena, and free large arrays at once (glibc, mallopt(3)).

    Each goal is planned in a thread of its own. With an arena for each thread, the memory that a
    thread frees stays in its arena: five goals of 100,000 points then take 200 MB more.
    """
    mallopt = getattr(ctypes.CDLL(None), 'mallopt', None)  # other C libraries have none
    if mallopt is not None:
        mallopt(_M_ARENA_MAX, 1)
        mallopt(_M_MMAP_THRESHOLD, LARGE_ARRAY)


def _give_freed_memory_back() -> None:
    """
    Return unused heap pages to the system (glibc, malloc_trim(3)).

    Without this, leftovers of a goal keep the next one from reusing its memory. The call takes one
    to five milliseconds.
    """
    malloc_trim = getattr(ctypes.CDLL(None), 'malloc_trim', None)
    if malloc_trim is not None:
        malloc_trim(0)


class _SignalCounter:
    """Counts SIGINT and SIGTERM."""

    def __init__(self) -> None:
        self.count = 0
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._received)

    def _received(self, number: int, frame: FrameType | None) -> None:
        self.count += 1


if __name__ == '__main__':
    main()
