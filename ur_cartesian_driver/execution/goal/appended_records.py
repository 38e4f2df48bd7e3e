# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Accept, replace or refuse records appended to an open goal (keep_open)."""

from __future__ import annotations

from functools import partial
from math import inf

from ur_cartesian_driver.execution.goal.feeder import how_often, Phrasing, Reporting
from ur_cartesian_driver.execution.goal.goal_commands import AnswerAppend
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState, is_at_rest
from ur_cartesian_driver.execution.goal.motion_job import AppendJob
from ur_cartesian_driver.execution.goal.outcome_codes import GoalSignal, Meaning, NO_MEANING
from ur_cartesian_driver.motion.plan.joint_spline import SAME_TIME

#: The answer to points that come after a request with ``last: true``.
CLOSED_BY_CLIENT = 'The goal was closed by an earlier request with last: true.'

#: The states in which a goal accepts more points.
_ACCEPTS_POINTS = frozenset(
    {GoalState.ARMING, GoalState.MOVING, GoalState.RUNNING_OUT, GoalState.AWAITING_POINTS}
)


class AppendedRecords(Phrasing, Reporting):
    """Counts the records that will certainly run, and the stops because no more points came."""

    def __init__(self, monitor: GoalMonitor) -> None:
        """Begin with the records of the goal's first points."""
        self._monitor = monitor
        #: Whether more points may come.
        self.is_open = True
        #: Number of records that will run in any case: all except the ending.
        self.committed = monitor.job.points - monitor.job.ending_records
        #: Number of stops for lack of points; the point of the last such stop.
        self._stop_count = self._last_stop_point = 0
        self._is_resting = False

    def append(
        self, append_job: AppendJob, state: GoalState, *, sent: int = 0, sent_until: float
    ) -> AnswerAppend:
        """
        Accept all points of a request, or none, and return the answer.

        :param sent: number of records of the goal that can no longer be replaced.
        :param sent_until: the time until which the motion can no longer be replaced [s].
        """
        answer = partial(AnswerAppend, number=append_job.number)
        job, before, cut_time = append_job.job, append_job.records_before, append_job.cut_time
        if not self.is_open:
            return answer(refusal=CLOSED_BY_CLIENT)
        if state not in _ACCEPTS_POINTS:
            return answer(refusal='The goal is ending.')
        if cut_time is not None and (before < sent or cut_time < sent_until - SAME_TIME):
            refusal = 'What is to be replaced has been sent.'
            return answer(refusal=refusal, earliest_cut=sent_until)
        if cut_time is None and job is not None and before != self.committed:
            refusal = 'The motion was closed before these points came.'
            return answer(refusal=refusal, replan_from_rest=True)
        if job is not None:
            self._monitor.append(job, before)
        self.is_open = job is not None and job.keep_open
        self.committed = self._monitor.records.total
        if job is not None and job.keep_open:
            self.committed -= job.ending_records
        return answer()

    def supply(self, state: GoalState, *, runs_out: bool, has_more: bool) -> Meaning:
        """
        Return the due signal about the supply of points (such as STARVING), or none.

        :param runs_out: whether only the ending is left to send.
        :param has_more: whether the goal has a motion after the ending.
        """
        if state is GoalState.MOVING and runs_out:
            return GoalSignal.STARVING, ''
        if state is not GoalState.AWAITING_POINTS:
            return NO_MEANING
        if not has_more:
            return NO_MEANING if self.is_open else (GoalSignal.NO_MORE_POINTS, '')
        packet = self._monitor.latest
        # Packets may be late: the next motion begins only once a packet reports the arm at rest.
        if packet is None or not is_at_rest(packet):
            return NO_MEANING
        moved = self._monitor.rest_offset(packet)
        return (GoalSignal.APPENDED, '') if moved is None else (GoalSignal.DEVIATION, moved)

    def run_out(self) -> int:
        """Commit the ending because no points came in time; return the new ``committed``."""
        self._stop_count += 1
        self._last_stop_point = self._monitor.records.points - 1
        self.committed = self._monitor.records.total
        return self.committed

    def rest(self, time: float = inf) -> None:
        """Note that the arm rests after the ending, whose planned end is ``time`` [s]."""
        self._is_resting = True
        self._monitor.finish(time)

    def go_on(self) -> None:
        """Note that the arm moves again."""
        self._is_resting = False

    def location(self, *, started: bool) -> str:
        """Return the place where the arm waits for points, as a clause; '' while it moves."""
        if not self._is_resting:
            return ''
        return f'at rest behind point {self._last_stop_point}, waiting for more'

    @property
    def report(self) -> tuple[str, ...]:
        """The line about the stops for lack of points; empty if there were none."""
        if not self._stop_count:
            return ()
        times = how_often(self._stop_count)
        return (
            f'the motion was brought to rest {times}, the last time behind point '
            f'{self._last_stop_point}, because no more points came in time; points '
            'appended afterwards are delayed by these stops',
        )
