# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The feeder of a keep_open goal that runs through the buffered servo.

The driver makes the set-points. Set-points already made are final; the rest of the curve,
including its ending, can still be replaced, with immediate effect. A goal whose set-points reach
the ending comes to rest (RUNNING_OUT,
:mod:`~ur_cartesian_driver.execution.goal.goal_transitions`); later points continue from that rest.
"""

from __future__ import annotations

from math import inf

from ur_cartesian_driver.execution.goal.appended_records import AppendedRecords
from ur_cartesian_driver.execution.goal.feeder import Appendable
from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState, is_at_rest
from ur_cartesian_driver.execution.goal.motion_job import AppendJob
from ur_cartesian_driver.execution.goal.outcome_codes import GoalSignal, Meaning, NO_MEANING
from ur_cartesian_driver.execution.servo.servo_feeder import ServoFeeder
from ur_cartesian_driver.execution.servo.servo_stream import (
    ServoPhase,
    ServoSettings,
    ServoStream,
)
from ur_cartesian_driver.execution.servo.setpoint_source import SplineSetpoints
from ur_cartesian_driver.motion.events import Event, ServoReceived
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline, SAME_TIME
from ur_cartesian_driver.motion.state.rtde_state import RobotState


class AppendServoFeeder(ServoFeeder, Appendable):
    """Streams a curve to which points can be appended, and whose tail can be replaced."""

    def __init__(self, monitor: GoalMonitor, settings: ServoSettings, timeout: float) -> None:
        """
        Begin with the spline of the first points.

        :param timeout: longest wait at rest for more points [s]; 0 = no limit.
        """
        assert monitor.job.spline is not None
        self._source = SplineSetpoints(monitor.job.spline)
        super().__init__(monitor, ServoStream(self._source, settings))
        self.append_timeout = timeout
        self._appended = AppendedRecords(monitor)
        self.parts = (self._appended, *self.parts)
        #: The motion after the stop; None = no points have come for it.
        self._next_spline: JointSpline | None = None
        #: The planned time at which the arm comes to rest [s]; inf = the ending can be replaced.
        self._stop_time = inf

    def append(self, append_job: AppendJob, state: GoalState) -> list[GoalCommand]:
        """Accept all points or none; return the answer."""
        self._notice_ending()
        answer = self._appended.append(append_job, state, sent_until=self._source.time)
        job = append_job.job
        if job is None or answer.refusal:
            return [answer]
        assert job.spline is not None
        if self._stop_time == inf:
            self._replace_tail(job.spline)
        elif self._next_spline is None:
            self._next_spline = job.spline
        else:
            self._next_spline = self._next_spline.followed_by(job.spline, self._stop_time)
        return [answer]

    def supply(self, state: GoalState) -> Meaning:
        """Return the due signal about the supply of points (such as STARVING), or none."""
        self._notice_ending()
        return self._appended.supply(
            state, runs_out=self._stop_time < inf, has_more=self._next_spline is not None
        )

    def _notice_ending(self) -> None:
        """Commit the ending once a set-point of the ending has been made."""
        records = self.monitor.records
        if (
            self._stop_time == inf
            and self._appended.is_open
            and self._source.time >= records.end_time(self._appended.committed) - SAME_TIME
        ):
            self._stop_time = records.end_time(self._appended.run_out())

    def _replace_tail(self, spline: JointSpline) -> None:
        self._source.replace_tail(spline)
        self._spline = self._source.spline

    def enter(self, state: GoalState, packet: RobotState) -> list[GoalCommand]:
        """Record the stop after the ending, or go on with the points appended meanwhile."""
        if state is GoalState.AWAITING_POINTS:
            self._appended.rest(self._stop_time)
        elif state is GoalState.MOVING and self._next_spline is not None:
            self._appended.go_on()
            self._replace_tail(self._next_spline)
            self._next_spline, self._stop_time = None, inf
        return super().enter(state, packet)

    def interpret(self, event: Event, state: GoalState) -> Meaning | None:
        """Return the meaning of the servo's phase after a packet."""
        if isinstance(event, ServoReceived) and self.stream.phase is ServoPhase.ARRIVED:
            packet = self.monitor.latest
            if state is GoalState.RUNNING_OUT and packet is not None and is_at_rest(packet):
                return GoalSignal.SUCCESS, ''
            if self._stop_time < inf:  # not at the end: `supply` signals STARVING at next packet
                return NO_MEANING
        return super().interpret(event, state)
