# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The other side of the action: read a goal from YAML, send it, wait for its end.

``ur-cartesian send`` and the demo use it. The YAML is the one of ``ros2 action send_goal``, whose
own reader (rosidl_runtime_py) does not come with the wheels of ROS 2.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
import contextlib
from importlib import import_module
import os
from pathlib import Path
import signal
import threading
from time import monotonic
from types import TracebackType
from typing import Any, TypeAlias

from action_msgs.msg import GoalStatus
import rclpy
from rclpy.action.client import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from rosidl_parser.definition import (  # type: ignore[import-untyped]
    AbstractSequence,
    AbstractString,
    Array,
    BasicType,
    NamespacedType,
)
import yaml

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.msg import DriverStatus

Message: TypeAlias = Any

#: What a goal's status is called.
STATUS_NAMES = {
    GoalStatus.STATUS_SUCCEEDED: 'SUCCEEDED',
    GoalStatus.STATUS_CANCELED: 'CANCELED',
    GoalStatus.STATUS_ABORTED: 'ABORTED',
}
#: Without a server for that long, the driver counts as gone [s].
SERVER_TIMEOUT = 3.0
_INTEGERS = {
    f'{sign}int{bits}': (0 if sign else -(2 ** (bits - 1)), 2 ** (bits - (not sign)) - 1)
    for sign in ('', 'u')
    for bits in (8, 16, 32, 64)
}
_FLOATS = ('float', 'double', 'long double')


class GoalFileError(ValueError):
    """A text is no goal; the sentence names the key."""


# ---- reading ----------------------------------------------------------------------------------


def load_goal(source: str | os.PathLike[str]) -> FollowCartesianTrajectory.Goal:
    """
    Return the goal that a YAML text describes, as in ``ros2 action send_goal``.

    :param source: a path object for a file, or the text itself.
    :raises GoalFileError: the text is no YAML, or a key or value does not fit the action.
    :raises OSError: the file cannot be read.
    """
    text = source if isinstance(source, str) else Path(source).read_text(encoding='utf-8')
    name = '' if isinstance(source, str) else f'{os.fspath(source)}: '
    try:
        values = yaml.safe_load(text)
        goal = FollowCartesianTrajectory.Goal()
        _fill(goal, {} if values is None else values, '')
    except yaml.YAMLError as error:
        raise GoalFileError(f'{name}this is not YAML: {" ".join(str(error).split())}.') from None
    except GoalFileError as error:
        raise GoalFileError(f'{name}{error}') from None
    return goal


def add_tf_prefix(
    goal: FollowCartesianTrajectory.Goal, tf_prefix: str
) -> FollowCartesianTrajectory.Goal:
    """Change a goal to the frames and joints of an arm with a ``tf_prefix``; return it."""
    trajectory = goal.trajectory
    trajectory.header.frame_id = _prefixed(tf_prefix, trajectory.header.frame_id)
    trajectory.controlled_frame = _prefixed(tf_prefix, trajectory.controlled_frame)
    postures = [point.posture for point in trajectory.points]
    postures += [segment.via_posture for segment in goal.segments]
    for posture in postures:
        posture.posture_joint_names = [
            _prefixed(tf_prefix, name) for name in posture.posture_joint_names
        ]
    return goal


def _prefixed(tf_prefix: str, name: str) -> str:
    return tf_prefix + name if name else ''


def _fill(message: Message, values: object, key: str) -> None:
    """Set the fields of a message that are named; the others keep their defaults."""
    if not isinstance(values, dict):
        raise GoalFileError(f'{key or "the goal"} is {values!r}, but it is a mapping of fields.')
    types = dict(zip(message.get_fields_and_field_types(), message.SLOT_TYPES, strict=True))
    for name, value in values.items():
        path = f'{key}.{name}' if key else str(name)
        if name not in types:
            raise GoalFileError(
                f'{path}: there is no such field; {key or "a goal"} has {", ".join(types)}.'
            )
        setattr(message, name, _value(types[name], value, path))


def _value(kind: Any, value: object, key: str) -> Any:
    """Return a value of a field as its message wants it."""
    if isinstance(kind, NamespacedType):
        message = getattr(import_module('.'.join(kind.namespaces)), kind.name)()
        _fill(message, value, key)
        return message
    if isinstance(kind, (AbstractSequence, Array)):
        if not isinstance(value, list):
            raise GoalFileError(f'{key} is {value!r}, but it is a list.')
        return [_value(kind.value_type, item, f'{key}[{i}]') for i, item in enumerate(value)]
    if isinstance(kind, AbstractString):
        if not isinstance(value, str):
            raise GoalFileError(f'{key} is {value!r}, but it is a text; put it in quotes.')
        return value
    assert isinstance(kind, BasicType), kind
    return _number(kind.typename, value, key)


def _number(typename: str, value: object, key: str) -> bool | int | float:
    if typename == 'boolean':
        if not isinstance(value, bool):
            raise GoalFileError(f'{key} is {value!r}, but it is true or false.')
        return value
    if typename in _FLOATS:
        # YAML takes 1e-3 for a text: it wants 1.0e-3.
        with contextlib.suppress(ValueError):
            if isinstance(value, (int, float, str)) and not isinstance(value, bool):
                return float(value)
        raise GoalFileError(f'{key} is {value!r}, but it is a number.')
    low, high = _INTEGERS[typename]
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise GoalFileError(f'{key} is {value!r}, but it is a whole number from {low} to {high}.')
    return value


# ---- sending ----------------------------------------------------------------------------------


class GoalClient:
    """
    A context manager with a node of its own, beside whatever else uses ROS in this process.

    ::

        with GoalClient() as client:
            status, result = client.send(load_goal(Path('square.yaml')), print)
    """

    def __init__(
        self, driver: str = 'ur_cartesian_driver', node_name: str = 'ur_cartesian_client'
    ) -> None:
        """
        Prepare a client.

        :param driver: name of the driver's node, with its namespace if it has one.
        """
        self._driver = f'/{driver.strip("/")}'
        self.action = f'{self._driver}/follow_cartesian_trajectory'
        # A context of its own leaves signals alone: after Ctrl-C a goal can still be cancelled.
        self._context = Context()
        rclpy.init(args=[], context=self._context)
        self._node = rclpy.create_node(node_name, context=self._context)
        self._client = ActionClient(self._node, FollowCartesianTrajectory, self.action)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)

    def __enter__(self) -> GoalClient:
        """Do nothing; the client is ready."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """Close."""
        self.close()

    def close(self) -> None:
        """Leave the graph."""
        if self._context.ok():
            self._executor.shutdown()
            self._client.destroy()
            self._node.destroy_node()
            rclpy.shutdown(context=self._context)

    def send(
        self,
        goal: FollowCartesianTrajectory.Goal,
        on_feedback: Callable[[FollowCartesianTrajectory.Feedback], None] | None = None,
        timeout: float = 10.0,
    ) -> tuple[int, FollowCartesianTrajectory.Result]:
        """
        Send a goal and return its status (:data:`STATUS_NAMES`) and result.

        The first Ctrl-C cancels the goal and goes on waiting, the second one gives up.

        :param timeout: how long to look for the driver [s].
        :raises TimeoutError: no driver answers.
        :raises ConnectionError: the driver is gone, and nobody knows how the goal ended.
        """
        self._find_server(timeout)
        with _interrupts() as interrupted:
            request = self._client.send_goal_async(
                goal, None if on_feedback is None else lambda m: on_feedback(m.feedback)
            )
            handle = self._spin_until(request, lambda: None)
            if not handle.accepted:
                raise ConnectionError(
                    f'{self.action} did not accept the goal; this driver '
                    'accepts all, so it is another one, or it is ending.'
                )
            cancelled = False

            def cancel_once() -> None:
                nonlocal cancelled
                if interrupted.is_set() and not cancelled:
                    cancelled = True
                    handle.cancel_goal_async()

            response = self._spin_until(handle.get_result_async(), cancel_once)
        return response.status, response.result

    def wait_ready(self, timeout: float) -> None:
        """
        Wait until the driver says on its status topic that a goal can run.

        :raises TimeoutError: it takes longer than ``timeout`` [s]; the text says what is needed.
        """
        latest: list[DriverStatus] = []
        latched = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        subscription = self._node.create_subscription(
            DriverStatus, f'{self._driver}/status', latest.append, latched
        )
        try:
            deadline = monotonic() + timeout
            while not latest or latest[-1].state < DriverStatus.READY:
                if monotonic() > deadline:
                    needed = latest[-1].message if latest else 'Its status does not come.'
                    raise TimeoutError(
                        f'The driver {self._driver} is not ready after {timeout:g} s: {needed}'
                    )
                self._executor.spin_once(timeout_sec=0.1)
        finally:
            self._node.destroy_subscription(subscription)

    def _find_server(self, timeout: float) -> None:
        if not self._client.wait_for_server(timeout_sec=timeout):
            domain = os.environ.get('ROS_DOMAIN_ID', '0')
            raise TimeoutError(
                f'Nobody serves {self.action} (looked for {timeout:g} s): start the driver, with '
                f'the same ROS_DOMAIN_ID as here, which is {domain}.'
            )

    def _spin_until(self, future: Any, between: Callable[[], None]) -> Any:
        """Serve callbacks until a future is done."""
        last_seen = monotonic()
        while not future.done():
            self._executor.spin_once(timeout_sec=0.1)
            between()
            if self._client.server_is_ready():
                last_seen = monotonic()
            elif monotonic() - last_seen > SERVER_TIMEOUT:
                raise ConnectionError(
                    f'The driver that served {self.action} is gone; how the goal ended is not '
                    'known.'
                )
        return future.result()


@contextlib.contextmanager
def _interrupts() -> Iterator[threading.Event]:
    """Note the first Ctrl-C instead of raising KeyboardInterrupt; the second one raises it."""
    interrupted = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield interrupted
        return

    def received(number: int, frame: object) -> None:
        if interrupted.is_set():
            raise KeyboardInterrupt
        interrupted.set()

    before = signal.signal(signal.SIGINT, received)
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, before)
