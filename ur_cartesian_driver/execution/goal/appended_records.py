# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The records of a goal to which points are appended (keep_open): taken, replaced, refused."""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.goal_commands import AnswerAppend
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.execution.goal.motion_job import AppendJob
from ur_cartesian_driver.motion.plan.joint_spline import SAME_TIME

#: The answer to points that come after a request with ``last: true``.
CLOSED_BY_CLIENT = 'The goal was closed by an earlier request with last: true.'

#: In these a goal takes more points.
_ACCEPTS_POINTS = frozenset(
    {GoalState.ARMING, GoalState.MOVING, GoalState.RUNNING_OUT, GoalState.AWAITING_POINTS}
)


class AppendedRecords:
    """Which records of the goal are to be carried out, and how often there were none."""

    def __init__(self, monitor: GoalMonitor) -> None:
        """Begin with the first points of a goal."""
        self._monitor = monitor
        #: Whether more points may come.
        self.is_open = True
        #: How many records are carried out whatever comes: all but the ending.
        self.committed = monitor.job.points - monitor.job.ending_records
        #: How often the motion was brought to rest, and behind which point the last time.
        self._stop_count = self.last_stop_point = 0

    def append(
        self, append_job: AppendJob, state: GoalState, *, sent: int = 0, sent_until: float
    ) -> AnswerAppend:
        """
        Take all points of a request, or none.

        :param sent: how many records cannot be replaced any more.
        :param sent_until: until when the motion cannot [s].
        """
        number, job, before = append_job.number, append_job.job, append_job.records_before
        if not self.is_open:
            return AnswerAppend(number=number, refusal=CLOSED_BY_CLIENT)
        if state not in _ACCEPTS_POINTS:
            return AnswerAppend(number=number, refusal='The goal is ending.')
        if append_job.cut_time is not None:
            if before < sent or append_job.cut_time < sent_until - SAME_TIME:
                return AnswerAppend(
                    number=number,
                    refusal='What is to be replaced has been sent.',
                    earliest_cut=sent_until,
                )
        elif job is not None and before != self.committed:
            return AnswerAppend(
                number=number,
                replan_from_rest=True,
                refusal='The motion was closed before these points came.',
            )
        if job is not None:
            self._monitor.append(job, before)
        self.is_open = job is not None and job.keep_open
        self.committed = self._monitor.records.total
        if job is not None and job.keep_open:
            self.committed -= job.ending_records
        return AnswerAppend(number=number)

    def run_out(self) -> int:
        """Commit the ending, because nothing came in time; return how many records there are."""
        self._stop_count += 1
        self.last_stop_point = self._monitor.records.points - 1
        self.committed = self._monitor.records.total
        return self.committed

    @property
    def report_lines(self) -> tuple[str, ...]:
        """How often the arm had to wait for points."""
        if not self._stop_count:
            return ()
        times = 'once' if self._stop_count == 1 else f'{self._stop_count} times'
        return (
            f'the motion was brought to rest {times}, the last time behind point '
            f'{self.last_stop_point}, because no more points came in time; what was appended '
            'later is later by as much as that took',
        )
