# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The outcome of one goal: keeps its code and cause, and phrases them for the client."""

from __future__ import annotations

from ur_cartesian_driver.execution.goal.feeder import Capabilities
from ur_cartesian_driver.execution.goal.goal_monitor import GoalMonitor
from ur_cartesian_driver.execution.goal.goal_transitions import GoalState
from ur_cartesian_driver.execution.goal.outcome_codes import GoalSignal
from ur_cartesian_driver.execution.goal.temporary_tcp import TemporaryTcp
from ur_cartesian_driver.motion import events
from ur_cartesian_driver.motion.errors import ErrorCode


class GoalOutcome:
    """The code and the text of an outcome, as far as they are decided."""

    def __init__(self, monitor: GoalMonitor, can: Capabilities) -> None:
        """Begin with nothing decided; the monitor and the feeder's phrasing complete the text."""
        self._monitor, self._can = monitor, can
        self._code: ErrorCode | None = None
        #: The cause, as a clause.
        self.cause = ''
        #: Whether a contact ended the goal.
        self.touched = False
        #: Whether the arm may have moved.
        self.has_moved = False

    @property
    def succeeds(self) -> bool:
        """Whether the goal has succeeded, as far as it is decided."""
        return self._code is ErrorCode.SUCCESSFUL

    def decide(self, code: ErrorCode, cause: str, signal: GoalSignal, before: GoalState) -> None:
        """
        Take the code and the cause of a transition in the table.

        :param before: the state before the transition.
        """
        cause = cause.rstrip('.')  # the texts of robots and libraries are whole sentences
        if before is GoalState.PROGRAM_LOST:  # the new text says why the program ended
            cause = f'{cause}; before that, {self.cause}'
        if signal is not GoalSignal.UNCONFIRMED:
            self.touched = signal is GoalSignal.CONTACT
        elif self.cause:  # self.cause says why the arm had to stop
            cause = f'{self.cause}; {cause}'
            if self._code is ErrorCode.CONNECTION_LOST:
                code = self._code
        self._code, self.cause = code, cause

    def late_arrival(self, tolerance: float) -> str:
        """
        Return the delay of the last point, as a clause; '' = in time.

        :param tolerance: allowed delay [s]; negative = any delay.
        """
        job, monitor = self._monitor.job, self._monitor
        if job.due is None or tolerance < 0.0:
            return ''
        due = job.due + monitor.allowed_delay
        late = monitor.scaled_time - due
        if late <= tolerance:
            return ''
        return (
            f'the last point was reached {late:.3f} s after its time {due:.3f} s, '
            f'goal_time_tolerance is {tolerance:.3f} s'
        )

    def for_client(self, tcp: TemporaryTcp | None) -> events.Outcome:
        """
        Return the outcome for the client.

        :param tcp: the TCP set for the goal, if any.
        """
        monitor = self._monitor
        has_place = not self.succeeds and len(monitor.job.waypoint)
        return events.Outcome(
            code=self._code if self._code is not None else ErrorCode.EXECUTION_FAILED,
            text=self._success_text() if self.succeeds else self._failure_text(),
            report=(
                *(() if tcp is None else (tcp.report(monitor.latest),)),
                *(line for each in self._can.reporting for line in each.report),
            ),
            stopped=monitor.place() if has_place else None,
            touched=self.touched,
        )

    def _success_text(self) -> str:
        if self.cause:
            return f'{self.cause}.'
        return self._can.phrasing.success_text() or self._monitor.success_text()

    def _failure_text(self) -> str:
        """Return the sentence for a failed goal: the cause, and the place."""
        location, laws = 'before anything moved', ''
        if self._code is ErrorCode.GOAL_TOLERANCE_VIOLATED:
            location, laws = 'at the last point', self._monitor.law_clause()
        elif own := self._can.phrasing.location(started=self.has_moved):
            location = own
        elif self.has_moved:
            location = self._monitor.location()
        text = self.cause if location in self.cause else f'{self.cause} ({location})'
        return f'{text[:1].upper()}{text[1:]}{laws}.'
