# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The machine of a session of live targets, and the one that lets a person guide the arm.

Both are goals of the buffered servo that go nowhere by themselves (:mod:`~.servo_machine`): they
begin, are cancelled and end as any other, so nothing that can happen to a goal has to be thought
of again.
"""

from __future__ import annotations

from typing import Any

from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand, LogWarning
from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.execution.goal.states import GoalSignal
from ur_cartesian_driver.execution.live.live_targets import LiveSettings, LiveTargets
from ur_cartesian_driver.execution.live.online_trajectory import OnlineTrajectoryGenerator
from ur_cartesian_driver.execution.servo.servo_machine import ServoMachine
from ur_cartesian_driver.execution.servo.servo_stream import ServoPhase, ServoSettings, ServoStream
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import Event
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.motion.servo import ServoFeedback
from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.motion.vectors import ZERO6
from ur_cartesian_driver.protocol.program.registers import ServoMode

#: The arm goes where it is led: no plan is there that it could leave.
ANY_DEVIATION = (0.0, 0.0)
#: How often it is said why the arm stands, at most [s].
WARNING_PERIOD = 2.0
#: How long the robot program may take to let the arm be guided [s].
FREEDRIVE_TIMEOUT = 1.0


class LiveMachine(ServoMachine):
    """
    A session of live targets.

    :param arm: the kinematics of the robot.
    :param start: where it stands [rad].
    """

    def __init__(
        self,
        job: MotionJob,
        live: LiveSettings,
        arm: Arm,
        start: Joints,
        *,
        settings: ServoSettings,
        **more: Any,
    ) -> None:
        """Take an order to stand; nothing happens before :meth:`start`."""
        self._generator = OnlineTrajectoryGenerator(arm, job.T_flange_active, start, live.limits)
        self._timeout = live.timeout
        self.live = LiveTargets(self._generator, live)
        self._blocked_reason, self._next_remark = '', 0.0
        super().__init__(
            job,
            settings=settings,
            source=self.live,
            **more | {'max_plan_deviation': ANY_DEVIATION},
        )

    def set_target(self, T_base_tcp: Pose, age: float, now: float) -> None:
        """Take a target; see :meth:`LiveTargets.add`."""
        self.live.add(T_base_tcp, age, now)

    def step(self, event: Event, now: float) -> list[GoalCommand]:
        """Return what to do after an event; also why the arm stops, where it does."""
        self.live.update(now)
        commands = super().step(event, now)
        before, self._blocked_reason = self._blocked_reason, self.live.blocked
        if self._blocked_reason and not before and now >= self._next_remark:
            self._next_remark = now + WARNING_PERIOD
            commands.append(
                LogWarning(text=f'the live target is not gone to: {self._blocked_reason}')
            )
        return commands

    def _start_motion(self, state: RobotState) -> list[GoalCommand]:
        self._generator.reset(state.target_q)
        return super()._start_motion(state)

    def _outcome_report(self) -> tuple[str, ...]:
        return (*super()._outcome_report(), *self.live.report)

    def _outcome_text(self, code: ErrorCode) -> str:
        if code is ErrorCode.SUCCESSFUL:
            return f'No live targets came for {self._timeout:g} s: the session is over.'
        return super()._outcome_text(code)

    def _location_clause(self) -> str:
        return 'following live targets' if self._started else 'before anything moved'


class _IdleSetpoints:
    """What an arm that is guided by hand gets; in the mode TEACH nobody reads it."""

    done = False

    def next(self, dt: float) -> Joints:
        """Return something."""
        return ZERO6


class FreedriveMachine(ServoMachine):
    """The robot program lets the arm be guided by hand, until it is told to end that."""

    def __init__(self, job: MotionJob, *, settings: ServoSettings, **more: Any) -> None:
        """Take an order to stand; nothing happens before :meth:`start`."""
        super().__init__(
            job,
            settings=settings,
            source=_IdleSetpoints(),
            **more | {'max_plan_deviation': ANY_DEVIATION},
        )
        self.stream: FreedriveStream = FreedriveStream(settings)

    def _stream_signal(self) -> tuple[GoalSignal | None, str]:
        if self.stream.failure:
            # A program ends the guiding by itself where it is about to end.
            signal = GoalSignal.PROGRAM_STOPPED if self.stream.is_free else GoalSignal.FAILURE
            return signal, self.stream.failure
        return super()._stream_signal()

    def _has_goal_tcp(self) -> bool:
        """Report once the arm is let go, and not before: that is how its owner knows."""
        return self.stream.is_free and super()._has_goal_tcp()

    def _location_clause(self) -> str:
        return 'while the arm was guided' if self._started else 'before the arm was let go'


class FreedriveStream(ServoStream):
    """The registers of an arm that is guided: the mode TEACH in the place of set-points."""

    def __init__(self, settings: ServoSettings) -> None:
        """Wait for the first packet."""
        super().__init__(_IdleSetpoints(), settings)
        self._begun = False
        self._requested_at = 0.0
        #: Whether the robot program has let the arm go.
        self.is_free = False
        #: Why it does not (any more), as a clause.
        self.failure = ''

    def begin(self) -> None:
        """Let the arm be guided from now on."""
        self._begun = True

    def on_feedback(self, feedback: ServoFeedback, now: float) -> tuple[float, ...] | None:
        """Take a packet; return what is to be written, None = nothing."""
        if self._begun and self._requested_at == 0.0:
            self._requested_at = now
        is_teaching = feedback.mode == ServoMode.TEACH
        if self._begun and self.phase is ServoPhase.READY and not is_teaching:
            if self.is_free:
                self.failure = 'the robot program has ended the guiding by itself'
            elif now > self._requested_at + FREEDRIVE_TIMEOUT:
                self.failure = (
                    'the robot program does not let the arm be guided: it is paused, '
                    'or was started without allow_freedrive'
                )
        self.is_free = self.is_free or is_teaching
        return super().on_feedback(feedback, now)

    def _row(self) -> tuple[float, ...]:
        mode, *rest = super()._row()
        freedrive = self._begun and self.phase is ServoPhase.READY
        return (ServoMode.TEACH if freedrive else mode, *rest)
