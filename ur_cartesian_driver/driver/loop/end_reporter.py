# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Report how and why a motion ended."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from math import inf

from ur_cartesian_driver.driver.ipc.channel import MotionEnded
from ur_cartesian_driver.driver.loop.output_securer import OutputSecurer
from ur_cartesian_driver.driver.loop.owner_pipe import OwnerPipe
from ur_cartesian_driver.driver.recordings.recorder import Recorder
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.robot.link import RobotLink

#: Outcomes whose text lacks the cause; the event log has it.
CODES_WITH_CAUSE = frozenset(
    {
        ErrorCode.PROTECTIVE_STOP,
        ErrorCode.EMERGENCY_STOP,
        ErrorCode.PROGRAM_STOPPED,
        ErrorCode.CONNECTION_LOST,
        ErrorCode.EXECUTION_FAILED,
    }
)
#: Outcomes whose cause the robot sends on another connection, at the same time or soon after.
CODES_WITH_LATE_CAUSE = frozenset({ErrorCode.PROTECTIVE_STOP, ErrorCode.EMERGENCY_STOP})
#: Longest wait for such a cause [s].
CAUSE_TIMEOUT = 0.05
#: An error of the robot up to this long before the start of a motion can explain its end [s],
#: because a program that fails closes its sockets only some cycles later.
CAUSE_LEAD = 0.1


class EndReporter:
    """Reports the end of a motion to the owner, the recording and the status of the link."""

    def __init__(
        self, link: RobotLink, pipe: OwnerPipe, recorder: Recorder, outputs: OutputSecurer
    ) -> None:
        """Begin with nothing to report."""
        self._link, self._pipe, self._recorder = link, pipe, recorder
        self._outputs = outputs
        #: The end that still waits for its cause, or for its outputs to be written; None = none.
        self._pending: MotionEnded | None = None
        #: Only errors of the robot since this time can explain the end [s].
        self._since = -inf

    def begin(self) -> None:
        """Note that a motion begins."""
        self._since = self._link.event_log.now - CAUSE_LEAD

    @property
    def is_pending(self) -> bool:
        """Return whether the end of a motion waits for its cause or the write of its outputs."""
        return self._pending is not None

    def report(self, ended: MotionEnded) -> None:
        """Report an end, as soon as its cause and the state of its outputs are known."""
        self._pending = ended
        self._outputs.when_done(self._report_with_cause)

    def _report_with_cause(self) -> None:
        ended = self._pending
        if ended is None:
            return
        if ended.outcome.code in CODES_WITH_LATE_CAUSE and not self._link.event_log.robot_error(
            self._since
        ):
            asyncio.get_running_loop().call_later(CAUSE_TIMEOUT, self.report_pending)
        else:
            self.report_pending()

    def report_pending(self) -> None:
        """Report the waiting end now, with the causes known so far."""
        ended, self._pending = self._pending, None
        if ended is not None:
            self._report_now(ended)

    def _report_now(self, ended: MotionEnded) -> None:
        outcome = ended.outcome
        if failure := self._outputs.failure:
            outcome = replace(outcome, text=f'{outcome.text} {failure}')
        if outcome.code in CODES_WITH_CAUSE:
            text = outcome.text
            if error := self._link.event_log.robot_error(self._since):
                text = f'{text} {error[:1].upper()}{error[1:].rstrip(".")}.'
            causes = tuple(f'why: {line}' for line in self._link.event_log.event_chain())
            outcome = replace(outcome, text=text, report=(*outcome.report, *causes))
            self._link.explain(text)
        self._recorder.end(outcome)
        self._pipe.send(replace(ended, outcome=outcome))
