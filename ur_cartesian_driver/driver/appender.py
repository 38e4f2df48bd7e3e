# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Append points to an open goal while it runs (keep_open).

Points are planned here, in the thread that appends them, and offered to the robot loop. Meanwhile
the loop may have sent the goal's ending, the records that bring the arm to rest. Only the loop
knows, so the loop decides: it accepts all points or none. If the ending has been sent, the points
are planned again, from rest.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from concurrent.futures import Future
from dataclasses import dataclass, replace
import itertools
from math import isnan
import threading
from typing import TypeAlias

from ur_cartesian_driver.driver.ipc.channel import AppendToMotion
from ur_cartesian_driver.execution.goal.appended_records import CLOSED_BY_CLIENT
from ur_cartesian_driver.execution.goal.goal_commands import AnswerAppend
from ur_cartesian_driver.execution.goal.motion_job import AppendJob, job_from_plan, MotionJob
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.errors import AlreadySent, InvalidGoal, RobotNotReady
from ur_cartesian_driver.motion.events import Progress
from ur_cartesian_driver.motion.goal.declared_types import with_declared_types, WrongType
from ur_cartesian_driver.planning import PlanningOptions
from ur_cartesian_driver.planning.append.append_planner import AppendPlan, plan_append
from ur_cartesian_driver.planning.append.appendable_goal import AppendableGoal, AppendedPoints
from ur_cartesian_driver.planning.append.replaced_tail import (
    cut_time,
    first_replaceable,
    points_before,
    without_passed,
)
from ur_cartesian_driver.protocol.program.trajectory_points import encode_plan

#: Longest wait for an answer of the robot loop [s]. A loop that is silent for this long is
#: replaced, which stops the arm (:data:`~.loop.loop_host.SILENCE_TIMEOUT`).
ANSWER_TIMEOUT = 5.0
#: Largest number of points ahead of the arm, as a multiple of ``max_points``.
MAX_AHEAD = 2


@dataclass(frozen=True, slots=True, kw_only=True)
class AppendResult:
    """The result of an append."""

    #: Number of points of the goal, including the new ones.
    points: int
    #: Index of the first new point in the goal, from 0.
    first: int
    #: The result as a sentence.
    text: str


Offers: TypeAlias = Generator[AppendToMotion, AnswerAppend, AppendResult]


def encode_part(part: AppendPlan) -> tuple[bytes, MotionJob]:
    """Return the encoded records of an append plan, and the job of the plan."""
    plan = part.plan
    job = job_from_plan(
        plan,
        start_time=part.start_time,
        ending_records=part.ending_records,
        spline=part.spline,
    )
    # A plan streamed as set-points needs no records.
    points = b'' if plan.execution.traits.streams_setpoints else encode_plan(plan)
    return points, replace(job, due=part.end_time)


class Appender:
    """Appends points to one open goal; thread-safe."""

    def __init__(
        self,
        motion: int,
        opened: AppendPlan,
        *,
        planning_inputs: Callable[[], tuple[Arm, PlanningOptions]],
        send: Callable[[AppendToMotion], None],
        progress: Callable[[], Progress | None],
        on_appended: Callable[[AppendPlan, MotionJob], None] = lambda part, job: None,
        timeout: float = ANSWER_TIMEOUT,
    ) -> None:
        """
        Begin with the first points of a goal.

        :param opened: the plan of the first points.
        :param planning_inputs: returns the present arm and planning options.
        :param progress: returns the newest progress report of the motion.
        :param on_appended: called with each part that the loop has accepted.
        :param timeout: longest wait for an answer [s].
        """
        self._timeout = timeout
        self._motion = motion
        self._on_appended = on_appended
        self._arm_and_options, self._send, self._progress = planning_inputs, send, progress
        self._goal: AppendableGoal = opened.next_goal
        self._is_open = True
        # Appends run one after the other, because each begins where the previous one ends.
        self._append_lock = threading.Lock()
        # Guards the pending answers, and whether the goal has ended.
        self._lock = threading.Lock()
        self._pending_answers: dict[int, Future[AnswerAppend]] = {}
        #: Why nothing can be appended any more; empty = more points are possible.
        self._ended = ''
        self._numbers = itertools.count(1)

    @property
    def points(self) -> int:
        """The number of points of the goal."""
        return self._goal.points

    def append(self, new_points: AppendedPoints) -> AppendResult:
        """
        Plan points, and have all or none of them accepted; blocks until the answer has come.

        :raises GoalRefused: the points are not accepted, and the goal stays as it was; or the loop
            did not answer, and whether it has accepted them is unknown.
        """
        with self._append_lock:
            offers = self.offers(new_points)
            try:
                offer = next(offers)
                while True:
                    offer = offers.send(self._send_offer(offer))
            except StopIteration as end:
                appended: AppendResult = end.value
                return appended

    def offers(self, new_points: AppendedPoints) -> Offers:
        """
        Yield the offers to the robot loop, one by one; not thread-safe.

        The caller sends each offer to the loop, and sends the answer into the generator.

        :raises GoalRefused: as in :meth:`append`.
        """
        try:
            new_points = with_declared_types(new_points, AppendedPoints, 'append').in_rows()
        except WrongType as error:
            raise InvalidGoal(error.field, error.problem) from None
        if not self._is_open:
            raise RobotNotReady(CLOSED_BY_CLIENT)
        appended = yield from (
            self._append(new_points) if new_points.waypoints else self._close(new_points)
        )
        self._is_open = not new_points.last
        return appended

    def _close(self, new_points: AppendedPoints) -> Offers:
        if new_points.replaces:
            raise InvalidGoal('points', 'is empty, so nothing replaces the tail', 'give a point')
        if not new_points.last:
            raise InvalidGoal('points', 'is empty', 'give at least one point, or set last')
        answer = yield self._offer(None, b'', 0)
        if answer.refusal:
            raise RobotNotReady(answer.refusal)
        return AppendResult(
            points=self.points,
            first=self.points,
            text=f'No point follows: the goal has {self.points} in all.',
        )

    def _append(self, new_points: AppendedPoints) -> Offers:
        arm, options = self._arm_and_options()
        before = self._forget_passed(new_points)
        self._check_ahead(before, new_points, options)
        attempts = (True,) if self._is_at_rest() else (False, True)
        for from_rest in attempts:
            part = plan_append(before, new_points, arm, options, from_rest=from_rest)
            points, job = encode_part(part)
            answer = yield self._offer(job, points, part.records_before, part.cut_time)
            if not answer.refusal:
                self._goal = part.next_goal
                self._on_appended(part, job)
                return AppendResult(
                    points=part.next_goal.points,
                    first=part.next_goal.points - len(new_points.waypoints),
                    text=part.text
                    + (_from_rest(part.next_goal.last_client_time > 0.0) if from_rest else ''),
                )
            if answer.earliest_cut is not None:
                raise AlreadySent(*first_replaceable(before, answer.earliest_cut))
            if not answer.replan_from_rest:
                break
        raise RobotNotReady(answer.refusal)

    def _forget_passed(self, new_points: AppendedPoints) -> AppendableGoal:
        """
        Forget the points that the arm has passed, and return the goal.

        :raises GoalRefused: the points to replace were passed, or do not exist.
        """
        progress = self._progress()
        if progress is not None:
            self._goal = without_passed(self._goal, progress.time)
            if cut_time(self._goal, new_points) < progress.time:
                # Motion sent but not yet run cannot be replaced either.
                ahead = progress.buffered if isnan(progress.lag) else progress.lag
                raise AlreadySent(*first_replaceable(self._goal, progress.time + ahead))
        return self._goal

    def _is_at_rest(self) -> bool:
        """Return whether the arm rests after the goal's last point, by the newest report."""
        progress = self._progress()
        return (
            progress is not None
            and progress.awaiting_points
            and progress.points_received == self.points
        )

    def _check_ahead(
        self, before: AppendableGoal, new_points: AppendedPoints, options: PlanningOptions
    ) -> None:
        progress = self._progress()
        reached = progress.waypoint if progress is not None else 0
        kept = points_before(before, cut_time(before, new_points))
        ahead = kept - reached + len(new_points.waypoints)
        max_ahead = MAX_AHEAD * options.max_points
        if ahead > max_ahead:
            raise InvalidGoal(
                'points',
                f'would put {ahead} points ahead of the arm; the limit is {max_ahead} '
                f'({MAX_AHEAD} times max_points)',
                'append them once the arm has advanced (feedback: point_index)',
            )

    def _offer(
        self,
        job: MotionJob | None,
        points: bytes,
        records_before: int,
        cut_time: float | None = None,
    ) -> AppendToMotion:
        append_job = AppendJob(
            number=next(self._numbers),
            records_before=records_before,
            job=job,
            cut_time=cut_time,
        )
        return AppendToMotion(motion=self._motion, points=points, append_job=append_job)

    def _send_offer(self, offer: AppendToMotion) -> AnswerAppend:
        """Send an offer and wait for its answer."""
        number = offer.append_job.number
        with self._lock:
            if self._ended:
                return AnswerAppend(number=number, refusal=self._ended)
            future = self._pending_answers[number] = Future()
        try:
            self._send(offer)
            return future.result(self._timeout)
        except TimeoutError:
            # The loop may have accepted the points, so it is unknown where further ones begin.
            silent = 'The robot loop did not answer: nothing can be appended any more.'
            with self._lock:
                self._ended = self._ended or silent
            return AnswerAppend(number=number, refusal=silent)
        finally:
            with self._lock:
                self._pending_answers.pop(number, None)

    # ---- called by the driver -----------------------------------------------------------------

    def answer(self, answer: AnswerAppend) -> None:
        """Pass the answer of the robot loop to the append that waits for it."""
        with self._lock:
            future = self._pending_answers.get(answer.number)
        if future is not None:
            future.set_result(answer)

    def end(self) -> None:
        """Refuse pending and further appends, because the motion has ended."""
        with self._lock:
            self._ended = 'The goal has ended.'
            pending, self._pending_answers = self._pending_answers, {}
        for number, future in pending.items():
            if not future.done():
                future.set_result(AnswerAppend(number=number, refusal=self._ended))


def _from_rest(timed: bool) -> str:
    """
    Return the sentence about points that continue from rest.

    The sentence does not state the delay, because it is unknown how long the arm waits.
    """
    clause = ', later than their times' if timed else ''
    return f' The arm had come to rest before these points; it goes on from there{clause}.'
