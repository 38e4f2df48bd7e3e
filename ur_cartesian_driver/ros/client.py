# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
An action client: read a goal from YAML, send it, wait for its result.

``ur-cartesian send`` and the demo use it. The YAML is the same as for ``ros2 action send_goal``,
whose reader (rosidl_runtime_py) is missing if ROS 2 is installed as Python wheels.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
import contextlib
import os
import signal
import threading
from time import monotonic
from types import FrameType
from typing import Any

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from geometry_msgs.msg import Vector3, Vector3Stamped
import rclpy
from rclpy.action.client import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import Float64, Header
from unique_identifier_msgs.msg import UUID

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.goal_files.goal_file import read_goal_file
from ur_cartesian_driver.goal_files.goal_reading import goal_from_fields, io_commands
from ur_cartesian_driver.goal_files.goal_schema import message_of, with_defaults
from ur_cartesian_driver.goal_files.goal_writing import duration_fields, fields_of_goal
from ur_cartesian_driver.motion.events import Outcome, PathPlace
from ur_cartesian_driver.motion.goal.leads import Lead, with_lead_times
from ur_cartesian_driver.msg import DriverStatus
from ur_cartesian_driver.path import Path, resume, ResumedGoal
from ur_cartesian_driver.ros.goal_appender import GoalAppender
from ur_cartesian_driver.ros.message_fields import AT_END
from ur_cartesian_driver.ros.messages.action_messages import outcome_of
from ur_cartesian_driver.ros.messages.packed_points import packed_if_long
from ur_cartesian_driver.ros.node_endpoints import Endpoints, feedback_publishers, LATCHED_QOS
from ur_cartesian_driver.srv import AppendPoints, Recover

#: Names of the final states of a goal.
STATUS_NAMES = {
    GoalStatus.STATUS_SUCCEEDED: 'SUCCEEDED',
    GoalStatus.STATUS_CANCELED: 'CANCELED',
    GoalStatus.STATUS_ABORTED: 'ABORTED',
}
#: Time without the action server after which the driver is considered gone [s].
SERVER_TIMEOUT = 3.0
#: The states of a driver that accepts goals.
_READY_STATES = (DriverStatus.READY, DriverStatus.EXECUTING)
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


# ---- reading ----------------------------------------------------------------------------------


def load_goal(source: str | os.PathLike[str]) -> FollowCartesianTrajectory.Goal:
    """
    Return the goal that a YAML text describes, as in ``ros2 action send_goal``.

    :param source: a path object for a file, or the text itself.
    :raises GoalFileError: the text is not YAML, or a key or value does not fit the action.
    :raises OSError: the file cannot be read.
    """
    return message_of(read_goal_file(source), FollowCartesianTrajectory.Goal)


def add_tf_prefix(
    goal: FollowCartesianTrajectory.Goal, tf_prefix: str
) -> FollowCartesianTrajectory.Goal:
    """Add a ``tf_prefix`` to the frames and joints of a goal; return the goal."""
    trajectory = goal.trajectory
    trajectory.header.frame_id = _prefixed(tf_prefix, trajectory.header.frame_id)
    trajectory.controlled_frame = _prefixed(tf_prefix, trajectory.controlled_frame)
    postures = [point.posture for point in trajectory.points]
    postures += [segment.via_posture for segment in goal.segments]
    for posture in (*postures, goal.packed):
        posture.posture_joint_names = [
            _prefixed(tf_prefix, name) for name in posture.posture_joint_names
        ]
    return goal


def apply_leads(
    goal: FollowCartesianTrajectory.Goal, leads: Sequence[Lead], file: str
) -> FollowCartesianTrajectory.Goal:
    """
    Switch each output that names a lead earlier by this lead, as a driver does; return the goal.

    A lead is the time by which an output has to switch early, because its valve acts late.

    :param file: the file of the leads, for error messages.
    :raises InvalidGoal: as for :func:`~ur_cartesian_driver.motion.goal.leads.with_lead_times`.
    """
    commands = with_lead_times(io_commands(goal), leads, file)
    for message, command in zip(goal.io_commands, commands, strict=True):
        message.lead = command.lead
        message.offset = Duration(**duration_fields(command.offset))
    return goal


def _prefixed(tf_prefix: str, name: str) -> str:
    return tf_prefix + name if name else ''


def resumed_goal(
    goal: FollowCartesianTrajectory.Goal, place: PathPlace, *, overlap: float, approach: float
) -> tuple[FollowCartesianTrajectory.Goal, ResumedGoal]:
    """
    Return the rest of a goal that was stopped at a place, as a message and as a ResumedGoal.

    For ``overlap`` and ``approach`` [m] see :func:`~ur_cartesian_driver.path.resume`.

    :raises InvalidGoal: the goal cannot be resumed.
    """
    left = resume(goal_from_fields(goal), place, overlap=overlap, approach=approach)
    fields = with_defaults(fields_of_goal(left.goal))
    return message_of(fields, FollowCartesianTrajectory.Goal), left


# ---- sending ----------------------------------------------------------------------------------


class GoalClient:
    """
    A client with a node and a ROS context of its own, or on a given node; a context manager.

    ::

        with GoalClient() as client:
            client.execute(path).raise_for_error()
    """

    def __init__(
        self,
        driver: str = 'ur_cartesian_driver',
        node_name: str = 'ur_cartesian_client',
        *,
        node: Node | None = None,
    ) -> None:
        """
        Create the client, and its node unless one is given.

        :param driver: name of the driver's node, with its namespace if it has one.
        :param node: an existing node to use. If an executor spins the node, call the client
            outside the executor's thread; if not, the client spins the node while it waits.
        """
        #: The signal that cancelled the last goal; 0 = none.
        self.signal_number = 0
        self._driver = f'/{driver.strip("/")}'
        self.action = f'{self._driver}/follow_cartesian_trajectory'
        self._closed = False
        self._own_context: Context | None = None
        if node is None:
            # This context installs no signal handlers, so Ctrl-C does not shut ROS down, and the
            # goal can still be cancelled.
            self._own_context = Context()
            rclpy.init(args=[], context=self._own_context)
            node = rclpy.create_node(node_name, context=self._own_context)
        self._node = node
        self._offsets: Any = None
        self._feeds: Any = None
        self._append_service: Any = None
        #: The appender of the running goal; None = no goal runs, or it has no keep_open.
        self._appender: GoalAppender | None = None
        self._client = ActionClient(node, FollowCartesianTrajectory, self.action)
        #: The client's own executor; None = another executor spins the node.
        self._executor: SingleThreadedExecutor | None = None
        if node.executor is None:
            self._executor = SingleThreadedExecutor(context=node.context)
            self._executor.add_node(node)

    def __enter__(self) -> GoalClient:
        """Return the client."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close the client."""
        self.close()

    def close(self) -> None:
        """Destroy the client's ROS objects; a second call does nothing."""
        if self._closed:
            return
        self._closed = True
        if self._executor is not None:
            self._node.executor = None  # type: ignore[assignment]  # removes the node
            self._executor.shutdown()
            self._client.destroy()
        else:
            # An executor that is about to wait would fail on a client that is destroyed meanwhile.
            # So the client is only removed here, and destroyed when nothing refers to it any more.
            self._node.remove_waitable(self._client)
        if self._append_service is not None:
            self._node.destroy_client(self._append_service)
        for publisher in (self._offsets, self._feeds):
            if publisher is not None:
                self._node.destroy_publisher(publisher)
        if self._own_context is not None:
            self._node.destroy_node()
            rclpy.shutdown(context=self._own_context)

    def send(
        self,
        goal: FollowCartesianTrajectory.Goal,
        on_feedback: Callable[[FollowCartesianTrajectory.Feedback], None] | None = None,
        timeout: float = 10.0,
        *,
        cancel: bool = True,
    ) -> tuple[int, FollowCartesianTrajectory.Result]:
        """
        Send a goal and return its status (:data:`STATUS_NAMES`) and result.

        A goal of many points is sent with its points packed into arrays.

        On the first SIGINT, SIGTERM or SIGHUP, the client cancels the goal, waits for its result
        and sets :attr:`signal_number`; on the second one, it raises KeyboardInterrupt.

        :param on_feedback: called with each feedback message. If the call raises an exception, the
            goal is cancelled; when the goal has ended, the exception is raised here, with a note
            that gives the result.
        :param timeout: how long to look for the driver [s].
        :param cancel: whether a signal or a failed ``on_feedback`` cancels the goal; if not, the
            goal goes on.
        :raises TimeoutError: no driver answers.
        :raises ConnectionError: the goal was not accepted, or the driver is gone or was started
            again; in the last two cases it is not known how the goal ended.
        """
        driver = self._find_driver(timeout)
        if goal.keep_open and self._append_service is None:
            self._append_service = self._find_service(AppendPoints, 'append_points', timeout)
        self.signal_number = 0
        points = len(goal.trajectory.points) or len(goal.packed.times)
        goal = packed_if_long(goal)
        failures: list[BaseException] = []

        def take(message: Any) -> None:
            if on_feedback is None or failures:
                return
            try:
                on_feedback(message.feedback)
            except BaseException as failure:  # raised again below
                failures.append(failure)

        unknown = 'how the goal ended is not known'
        with self._signals() if cancel else contextlib.nullcontext():
            handle = self._spin_until(self._client.send_goal_async(goal, take), driver, unknown)
            if not handle.accepted:
                raise ConnectionError(
                    f'{self.action} did not accept the goal; this driver accepts all goals, so '
                    'another node serves the action, or the driver is shutting down.'
                )
            if goal.keep_open:
                self._appender = GoalAppender(self._append_service, handle.goal_id, points)
            cancelled = False

            def check_end() -> None:
                nonlocal cancelled
                if failures and not cancel:
                    raise failures[0]
                if (self.signal_number or failures) and not cancelled:
                    cancelled = True
                    handle.cancel_goal_async()

            try:
                response = self._spin_until(handle.get_result_async(), driver, unknown, check_end)
            finally:
                self._appender = None
        if failures:
            failures[0].add_note(
                f'the goal ended {STATUS_NAMES[response.status]}: {response.result.error_string}'
            )
            raise failures[0]
        return response.status, response.result

    def execute(
        self,
        path: Path,
        on_feedback: Callable[[FollowCartesianTrajectory.Feedback], None] | None = None,
        timeout: float = 10.0,
    ) -> Outcome:
        """
        Send a path and return its outcome, like ``Driver.execute``; parameters as in :meth:`send`.

        The driver node resolves the frames that the path names. It does not compare the pose of
        the arm with the start of the path, because messages do not contain the start.
        """
        _, result = self.send(path.to_message(), on_feedback, timeout)
        return outcome_of(result)

    def set_path_offset(
        self, *, along: float = 0.0, across: float = 0.0, normal: float = 0.0
    ) -> None:
        """
        Displace the tool from its path from now on, if the running goal permits offsets.

        This can be called from anywhere while the goal runs, also in the callback of :meth:`send`.

        :param along: offset in the direction of the motion [m]; ``across``: in the direction of
            the cross product of this direction and the tool's z axis; ``normal``: in the direction
            of the cross product of the other two. Each offset is limited to the
            ``path_offset.limits`` of the goal.
        """
        if self._offsets is None:
            self._offsets = self._node.create_publisher(
                Vector3Stamped, f'{self._driver}/path_offset', 1
            )
        header = Header(stamp=self._node.get_clock().now().to_msg())
        vector = Vector3(x=along, y=across, z=normal)
        self._offsets.publish(Vector3Stamped(header=header, vector=vector))

    def set_feed_override(self, fraction: float) -> None:
        """
        Slow the running goal from now on, if it permits a feed override.

        This can be called from anywhere while the goal runs, also in the callback of :meth:`send`.
        The fraction becomes stale after the ``feed_override.timeout`` of the goal; call this again
        before that.

        :param fraction: fraction of the planned speed, 0 to 1.
        """
        if self._feeds is None:
            self._feeds = self._node.create_publisher(Float64, f'{self._driver}/feed_override', 1)
        self._feeds.publish(Float64(data=fraction))

    def append(
        self,
        path: Path | FollowCartesianTrajectory.Goal | None = None,
        *,
        last: bool = False,
        replace_from_point: int | None = None,
        replace_from_time: float | None = None,
    ) -> Future:
        """
        Append the points of a path to the running goal (``keep_open``), or replace its tail.

        This can be called from anywhere while the goal runs, also in the callback of :meth:`send`.
        The call does not wait; requests are sent one after the other.

        :param path: a path or goal message, of which only points, segments and outputs are used.
            Its times count from the start of the running goal. The outputs of a path number its
            own points from 0, the outputs of a message the points of the running goal. None = no
            points, allowed only with ``last``.
        :param last: whether these are the last points of the goal.
        :param replace_from_point: the first point that the new ones replace, together with all
            later points.
        :param replace_from_time: alternatively, the time from the start of the goal from which
            new points replace old ones [s].
        :returns: a future of the response of ``~/append_points``. If the request is refused,
            ``accepted`` is false, ``message`` says why, and the goal goes on as it was.
        :raises RuntimeError: no goal of this client runs.
        :raises ValueError: both ``replace_from_point`` and ``replace_from_time`` are given.
        """
        appender = self._appender  # another thread may see the goal end
        if appender is None:
            raise RuntimeError(
                'No goal runs to which points could be appended: send one with keep_open, and '
                'append while send or execute waits for its end.'
            )
        return appender.append(
            path,
            last=last,
            replace_from_point=replace_from_point,
            replace_from_time=replace_from_time,
        )

    def append_to_running(
        self,
        path: Path | FollowCartesianTrajectory.Goal | None = None,
        *,
        timeout: float = 10.0,
        **where: Any,
    ) -> AppendPoints.Response:
        """
        Append to the goal that moves the arm, whichever client sent it; return the response.

        If no goal runs, the response is a refusal.

        :param path: see :meth:`append`.
        :param where: ``last``, ``replace_from_point`` or ``replace_from_time``, see
            :meth:`append`.
        :param timeout: how long to look for the driver [s].
        :raises TimeoutError: no driver answers.
        :raises ConnectionError: the driver is gone, or was started again.
        """
        driver = self._find_driver(timeout)
        service = self._find_service(AppendPoints, 'append_points', timeout)
        try:
            appender = GoalAppender(service, UUID(), AT_END)
            answer = appender.append(path, **where)
            return self._spin_until(
                answer, driver, 'whether the points were appended is not known'
            )
        finally:
            self._node.destroy_client(service)

    def recover(self, *, unlock_protective_stop: bool = False, timeout: float = 10.0) -> Any:
        """
        Bring a stopped robot back to READY, as far as software is allowed to; return the response.

        :param unlock_protective_stop: whether a person has found and removed the cause of a
            protective stop; if not, unlocking the stop is left to a person.
        :param timeout: how long to look for the driver [s].
        :raises TimeoutError: no driver answers.
        :raises ConnectionError: the driver is gone, or was started again.
        """
        driver = self._find_driver(timeout)
        service = self._find_service(Recover, 'recover', timeout)
        try:
            request = Recover.Request(unlock_protective_stop=unlock_protective_stop)
            return self._spin_until(
                service.call_async(request), driver, 'what the robot has done is not known'
            )
        finally:
            self._node.destroy_client(service)

    def wait_ready(self, timeout: float) -> None:
        """
        Wait until the status of the driver is READY or EXECUTING.

        :raises TimeoutError: the driver does not become either within ``timeout`` [s]; the error
            message names the next step.
        """
        latest: list[DriverStatus] = []
        subscription = self._node.create_subscription(
            DriverStatus, f'{self._driver}/status', latest.append, LATCHED_QOS
        )
        try:
            deadline = monotonic() + timeout
            while not latest or latest[-1].state not in _READY_STATES:
                if monotonic() > deadline:
                    needed = latest[-1].message if latest else self._how_to_find()
                    raise TimeoutError(
                        f'The driver {self._driver} is not ready after {timeout:g} s: {needed}'
                    )
                self._spin_or_wait()
        finally:
            self._node.destroy_subscription(subscription)

    def _find_driver(self, timeout: float) -> Endpoints:
        """
        Wait for the driver, and return its endpoints; a restarted driver has other endpoints.

        A killed driver stays visible for some seconds beside its successor, so this waits until
        only one driver is left.

        :raises TimeoutError: no driver answers.
        :raises ConnectionError: several drivers serve the action, and any of them could move.
        """
        deadline = monotonic() + timeout
        if not self._client.wait_for_server(timeout_sec=timeout):
            raise TimeoutError(
                f'No driver serves {self.action} (searched for {timeout:g} s): '
                f'{self._how_to_find()}'
            )
        while len(found := feedback_publishers(self._node, self.action)) > 1:
            if monotonic() > deadline:
                raise ConnectionError(
                    f'{len(found)} drivers serve {self.action}, and any of them could move its '
                    'arm; end the others, or give each a namespace (-r __ns:=/left) and name it'
                )
            self._spin_or_wait()
        return found

    def _find_service(self, kind: Any, name: str, timeout: float) -> Any:
        """
        Return a client of a service of the driver.

        :raises TimeoutError: the driver does not serve it.
        """
        service = self._node.create_client(kind, f'{self._driver}/{name}')
        if not service.wait_for_service(timeout_sec=timeout):
            self._node.destroy_client(service)
            raise TimeoutError(
                f'{self._driver} does not serve {self._driver}/{name} (searched for {timeout:g} '
                's): it is another release of the driver, or another node.'
            )
        return service

    @staticmethod
    def _how_to_find() -> str:
        domain = os.environ.get('ROS_DOMAIN_ID', '0')
        return f'start it, with the same ROS_DOMAIN_ID as here, which is {domain}.'

    def _spin_until(
        self,
        future: Any,
        driver: Endpoints,
        unknown: str,
        between: Callable[[], None] = lambda: None,
    ) -> Any:
        """
        Spin until a future is done, and return its result.

        :param driver: the endpoints of the driver, from :meth:`_find_driver`.
        :param unknown: a clause for the error, such as "how the goal ended is not known".
        :param between: called after each spin, at least every 0.1 s.
        :raises ConnectionError: the driver is gone, or was started again.
        """
        last_seen = monotonic()
        done = threading.Event()
        future.add_done_callback(lambda _: done.set())
        while not future.done():
            self._spin_or_wait(done)
            between()
            if future.done():
                break
            if self._client.server_is_ready():
                last_seen = monotonic()
                present = feedback_publishers(self._node, self.action)
                if present and not present & driver:
                    raise ConnectionError(
                        f'The driver of {self.action} was started again; {unknown}.'
                    )
            elif monotonic() - last_seen > SERVER_TIMEOUT:
                raise ConnectionError(f'The driver of {self.action} is gone; {unknown}.')
        return future.result()

    def _spin_or_wait(self, done: threading.Event | None = None) -> None:
        """Spin for at most 0.1 s, or wait that long while another executor spins the node."""
        if self._executor is not None:
            self._executor.spin_once(timeout_sec=0.1)
        else:
            (done or threading.Event()).wait(0.1)

    @contextlib.contextmanager
    def _signals(self) -> Iterator[None]:
        """
        During the block, store the first signal; the second one raises KeyboardInterrupt.

        Only the main thread can do this; in another thread, signals are handled as before.
        """
        if threading.current_thread() is not threading.main_thread():
            yield
            return

        def received(number: int, _frame: FrameType | None) -> None:
            if self.signal_number:
                raise KeyboardInterrupt(number)
            self.signal_number = number

        before = {
            number: signal.signal(number, received)
            for number in _SIGNALS
            # Under nohup, SIGHUP stays ignored.
            if number == signal.SIGINT or signal.getsignal(number) != signal.SIG_IGN
        }
        try:
            yield
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
