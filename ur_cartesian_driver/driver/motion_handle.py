# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A running motion: the handle that a user holds, and the object that the driver holds."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Future
from dataclasses import replace
import logging
from math import isfinite
import threading

from ur_cartesian_driver.driver.appender import Appender, AppendResult
from ur_cartesian_driver.driver.callbacks import LOG, run_callback
from ur_cartesian_driver.driver.ipc.channel import (
    CancelMotion,
    Request,
    SetFeedOverride,
    SetPathOffset,
    TemporaryTcpSet,
)
from ur_cartesian_driver.driver.running_path import RunningPath
from ur_cartesian_driver.motion.errors import InvalidGoal, RobotNotReady
from ur_cartesian_driver.motion.events import Outcome, Progress
from ur_cartesian_driver.motion.geometry.vectors import vector3
from ur_cartesian_driver.motion.goal.declared_types import with_declared_types, WrongType
from ur_cartesian_driver.motion.goal.goal import IOCommand, Segment, Waypoint
from ur_cartesian_driver.motion.plan.plan import Plan
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints

OnProgress = Callable[[Progress], None]


#: Field, problem and remedy of the error if a goal without ``feed_override`` is to be slowed.
NO_FEED_OVERRIDE = (
    'feed_override',
    'is not set in the running goal',
    'set its minimum in the goal',
)
#: Likewise if the parameter ``feed_override_input`` is set: then no client can slow a motion.
HAS_FEED_INPUT = (
    'feed_override_input',
    'names an input of the robot, whose signal slows all goals',
    "set the parameter to '' so that clients can give the signal",
)


class MotionHandle:
    """A running motion; it always ends with an outcome, whatever happens to the robot."""

    def __init__(
        self,
        number: int,
        outcome: Future[Outcome],
        send: Callable[[Request], None],
        make_report: Callable[[], object],
    ) -> None:
        """Wrap a running motion; users get handles from :meth:`~.api.Driver.start`."""
        self.number = number
        self._outcome, self._send, self._make_report = outcome, send, make_report
        #: Appends points; None = the goal was sent without keep_open. Set by the driver.
        self.appender: Appender | None = None
        #: Largest accepted age of a path offset [s]; None = the goal permits no offsets. Set by
        #: the driver.
        self.offset_timeout: float | None = None
        #: Field, problem and remedy of the error that :meth:`set_feed_override` raises; None =
        #: the motion can be slowed. Set by the driver.
        self.feed_problem: tuple[str, str, str] | None = NO_FEED_OVERRIDE
        #: The newest progress report; None before the first report.
        self.progress: Progress | None = None

    def cancel(self) -> None:
        """Stop the arm; the outcome follows when it is at rest. May be called twice."""
        self._send(CancelMotion(motion=self.number))

    def preempt(self, by: str = 'a newer motion') -> None:
        """
        Stop the arm, as :meth:`cancel` does, because another motion follows.

        :param by: the other motion, as a noun phrase for the text of the outcome.
        """
        self._send(CancelMotion(motion=self.number, preempted_by=by))

    def stop_before_collision(self, reason: str) -> None:
        """
        Stop the arm, as :meth:`cancel` does, because it would collide; the outcome is COLLISION.

        :param reason: a clause for the text of the outcome.
        """
        self._send(CancelMotion(motion=self.number, collision=reason.rstrip('.')))

    def append(
        self,
        waypoints: Sequence[Waypoint],
        segments: Sequence[Segment] = (),
        io_commands: Sequence[IOCommand] = (),
        *,
        last: bool = False,
        replace_from_point: int | None = None,
        replace_from_time: float | None = None,
    ) -> AppendResult:
        """
        Append points to a running goal with ``keep_open``, or replace its tail.

        The points are checked and planned in this call, which takes a while: do not call it from
        callbacks.

        :param waypoints: the points, with times from the start of the goal, in the goal's frame.
        :param segments: empty, or one for each point.
        :param io_commands: outputs to switch; their waypoint indices count from the goal's start.
        :param last: whether no more points follow, so that the arm comes to rest at the last one.
            If ``waypoints`` is empty, the arm comes to rest at the planned ending, which for a
            spline is after its last point.
        :param replace_from_point: the first point that the new points replace, together with all
            points after it (SPLINE and SERVO).
        :param replace_from_time: an alternative to ``replace_from_point``: the time [s], since the
            start of the goal, from which the new points replace the old ones. The motion leaves
            the old path at that time and goes to the first new point.
        :raises AlreadySent: the tail can no longer be replaced, because it was passed or sent; the
            error gives the first point and time that are still replaceable.
        :raises GoalRefused: a check or the robot loop refused the points, as the text explains; no
            point was accepted, and the goal goes on. The exception is a loop that did not answer:
            it may have accepted the points.
        """
        if self.appender is None:
            raise RobotNotReady('The goal was sent without keep_open: nothing can be appended.')
        return self.appender.append(
            AppendedPoints(
                waypoints=tuple(waypoints),
                segments=tuple(segments),
                io_commands=tuple(io_commands),
                last=last,
                replace_from_point=replace_from_point,
                replace_from_time=replace_from_time,
            )
        )

    def set_path_offset(
        self, *, along: float = 0.0, across: float = 0.0, normal: float = 0.0, age: float = 0.0
    ) -> None:
        """
        Displace the tool from its path from now on; ignored by a motion that has ended.

        :param along: offset along the tangent of the path [m]. The module
            :mod:`~ur_cartesian_driver.motion.plan.offset_band` defines the directions of
            ``across`` and ``normal``; ``path_offset.limits`` of the goal bounds all three.
        :param age: time since the offset was measured [s].
        :raises InvalidGoal: the goal permits no offset, a value is not a finite number, or the age
            is negative or more than ``path_offset.timeout``; the previous offset stays.
        """
        if self.offset_timeout is None:
            raise InvalidGoal(
                'path_offset', 'is not set in the running goal', 'set its limits in the goal'
            )
        values = {'along': along, 'across': across, 'normal': normal, 'age': age}
        for name, value in values.items():
            try:
                values[name] = with_declared_types(value, float, name)
            except WrongType as error:
                raise InvalidGoal(error.field, error.problem) from None
            if not isfinite(values[name]) or (name == 'age' and values[name] < 0.0):
                bound = ', and at least 0' if name == 'age' else ''
                raise InvalidGoal(name, f'is {values[name]}; it must be finite{bound}')
        *offset, age = values.values()
        if age > self.offset_timeout:
            raise InvalidGoal(
                'age', f'is {age:.3f} s, path_offset.timeout is {self.offset_timeout:g} s'
            )
        self._send(SetPathOffset(motion=self.number, offset=vector3(offset), age=age))

    def set_feed_override(self, fraction: float, *, age: float = 0.0) -> None:
        """
        Slow the motion from now on; ignored by a motion that has ended.

        The motion then runs at the planned speed times ``fraction`` times the robot's speed
        slider. The goal's ``feed_override`` sets the bounds of the fraction, and the rate at which
        it changes. Call the method again before ``feed_override.timeout`` has passed: a stale or
        invalid fraction brings the motion to ``feed_override.minimum``.

        :param fraction: fraction of the planned speed, 0 to 1; all other numbers, and NaN, are
            invalid.
        :param age: time since the fraction was measured [s].
        :raises InvalidGoal: the goal has no feed override, an input of the robot gives the signal
            (parameter ``feed_override_input``), or an argument has no numeric type.
        """
        if self.feed_problem is not None:
            raise InvalidGoal(*self.feed_problem)
        try:
            fraction = with_declared_types(fraction, float, 'fraction')
            age = with_declared_types(age, float, 'age')
        except WrongType as error:
            raise InvalidGoal(error.field, error.problem) from None
        self._send(SetFeedOverride(motion=self.number, fraction=fraction, age=age))

    def done(self) -> bool:
        """Return whether the outcome has arrived."""
        return self._outcome.done()

    def result(self, timeout: float | None = None) -> Outcome:
        """
        Wait for the outcome.

        :raises TimeoutError: no outcome came within ``timeout`` [s]; the motion goes on.
        """
        if timeout is None:
            self._make_report()  # while the arm moves, as this thread has to wait anyway
        return self._outcome.result(timeout)

    def add_done_callback(self, callback: Callable[[Outcome], None]) -> None:
        """
        Call ``callback`` with the outcome; at once if the outcome has arrived already.

        A later call comes from the thread that delivers the outcome, usually the driver's.
        """
        self._outcome.add_done_callback(lambda future: callback(future.result()))


class ActiveMotion:
    """The driver's side of a running motion: passes on the progress and the outcome."""

    def __init__(
        self,
        number: int,
        plan: Plan,
        on_progress: OnProgress | None,
        send: Callable[[Request], None],
        log: logging.Logger = LOG,
        *,
        path: RunningPath | None = None,
    ) -> None:
        """
        Begin with no progress and no outcome.

        :param send: sends requests to the robot loop.
        :param log: receives the exceptions of ``on_progress``.
        :param path: receives the progress reports, too; None = the motion has no planned path.
        """
        self._outcome: Future[Outcome] = Future()
        self._on_progress, self._log = on_progress, log
        #: Guards the attributes below.
        self._lock = threading.Lock()
        #: The plan; None once a thread has taken it to make its report.
        self._plan: Plan | None = plan
        #: The report of the plan; None before it is made.
        self._plan_report: tuple[str, ...] | None = None
        #: The outcome of the motion; None before the motion has ended.
        self._ended: Outcome | None = None
        self.path = path
        #: The handle that the owner holds.
        self.motion = MotionHandle(number, self._outcome, send, self.make_report)
        if plan.offset_band is not None:
            self.motion.offset_timeout = plan.offset_band.timeout
        #: The TCP that the robot has while this motion runs; None = the TCP is not changed.
        self.temporary_tcp = (
            None
            if plan.T_flange_tcp is None
            else TemporaryTcpSet(
                T_flange_original=plan.T_flange_active, T_flange_temporary=plan.T_flange_tcp
            )
        )

    def make_report(self) -> None:
        """
        Make the report of the plan, unless it is made or another thread is making it.

        The report takes longer than sending the plan, so it is made after the motion has started.
        If the motion has ended meanwhile, the thread that made the report delivers the outcome.
        """
        with self._lock:
            plan, self._plan = self._plan, None
        if plan is None:
            return
        report = plan.short_report()
        with self._lock:
            self._plan_report, ended = report, self._ended
        if ended is not None:
            self._give(ended, report)

    def report(self, progress: Progress) -> None:
        """Store a progress report of the robot loop; pass it to the path and ``on_progress``."""
        self.motion.progress = progress
        if self.path is not None:
            self.path.report(progress)
        if self._on_progress is not None:
            run_callback(self._on_progress, progress, self._log)

    def end(self, outcome: Outcome) -> None:
        """Deliver the outcome; any further outcome is ignored."""
        if self.motion.appender is not None:
            self.motion.appender.end()
        if self.path is not None:
            self.path.end(outcome)
        with self._lock:
            if self._ended is not None:
                return
            self._ended, report = outcome, self._plan_report
        if report is None:
            self.make_report()
        else:
            self._give(outcome, report)

    def _give(self, outcome: Outcome, report: tuple[str, ...]) -> None:
        self._outcome.set_result(replace(outcome, report=(*report, *outcome.report)))
