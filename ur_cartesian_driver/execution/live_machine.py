# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The machine of a session of live targets, and the one that lets a person guide the arm.

Both are goals of the buffered servo that go nowhere by themselves (:mod:`~.servo`): they begin,
are cancelled and end as any other, so nothing that can happen to a goal has to be thought of
again.
"""

from __future__ import annotations

from typing import Any

from ur_cartesian_driver.execution.commands import Command, Remark
from ur_cartesian_driver.execution.live_targets import LiveSettings, LiveTargets
from ur_cartesian_driver.execution.order import Order
from ur_cartesian_driver.execution.servo import ServoMachine
from ur_cartesian_driver.execution.servo_stream import Phase, ServoSettings, ServoStream
from ur_cartesian_driver.execution.states import Signal
from ur_cartesian_driver.execution.target_follower import TargetFollower
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import Event
from ur_cartesian_driver.motion.goal import ZERO6
from ur_cartesian_driver.motion.pose import Pose
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.motion.servo import ServoFeedback
from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.protocol.registers import ServoMode

#: The arm goes where it is led: no plan is there that it could leave.
ANY_WAY = (0.0, 0.0)
#: How often it is said why the arm stands, at most [s].
REMARK_PERIOD = 2.0
#: How long the robot program may take to let the arm be guided [s].
TEACH_BOUND = 1.0


class LiveMachine(ServoMachine):
    """
    A session of live targets.

    :param arm: the kinematics of the robot.
    :param start: where it stands [rad].
    """

    def __init__(
        self,
        order: Order,
        live: LiveSettings,
        arm: Arm,
        start: Joints,
        *,
        settings: ServoSettings,
        **more: Any,
    ) -> None:
        """Take an order to stand; nothing happens before :meth:`start`."""
        self._follower = TargetFollower(arm, order.T_flange_active, start, live.limits)
        self._timeout = live.timeout
        self.live = LiveTargets(self._follower, live)
        self._blocked, self._next_remark = '', 0.0
        super().__init__(
            order, settings=settings, source=self.live, **more | {'max_plan_deviation': ANY_WAY}
        )

    def aim(self, T_base_tcp: Pose, age: float, now: float) -> None:
        """Take a target; see :meth:`LiveTargets.take`."""
        self.live.take(T_base_tcp, age, now)

    def step(self, event: Event, now: float) -> list[Command]:
        """Return what to do after an event; also why the arm stops, where it does."""
        self.live.look(now)
        commands = super().step(event, now)
        before, self._blocked = self._blocked, self.live.blocked
        if self._blocked and not before and now >= self._next_remark:
            self._next_remark = now + REMARK_PERIOD
            commands.append(Remark(text=f'the live target is not gone to: {self._blocked}'))
        return commands

    def _begin(self, state: RobotState) -> list[Command]:
        self._follower.stand_at(state.target_q)
        return super()._begin(state)

    def _report(self) -> tuple[str, ...]:
        return (*super()._report(), *self.live.report)

    def _sentence(self, code: ErrorCode) -> str:
        if code is ErrorCode.SUCCESSFUL:
            return f'No live targets came for {self._timeout:g} s: the session is over.'
        return super()._sentence(code)

    def _where(self) -> str:
        return 'following live targets' if self._started else 'before anything moved'


class _NoSetpoints:
    """What an arm that is guided by hand gets; in the mode TEACH nobody reads it."""

    done = False

    def next(self, dt: float) -> Joints:
        """Return something."""
        return ZERO6


class TeachMachine(ServoMachine):
    """The robot program lets the arm be guided by hand, until it is told to end that."""

    def __init__(self, order: Order, *, settings: ServoSettings, **more: Any) -> None:
        """Take an order to stand; nothing happens before :meth:`start`."""
        super().__init__(
            order,
            settings=settings,
            source=_NoSetpoints(),
            **more | {'max_plan_deviation': ANY_WAY},
        )
        self.stream: TeachStream = TeachStream(settings)

    def _progress_of_stream(self) -> tuple[Signal | None, str]:
        if self.stream.trouble:
            # A program ends the guiding by itself where it is about to end.
            signal = Signal.PROGRAM_STOPPED if self.stream.is_guided else Signal.FAILURE
            return signal, self.stream.trouble
        return super()._progress_of_stream()

    def _shows_goal(self) -> bool:
        """Report once the arm is let go, and not before: that is how its owner knows."""
        return self.stream.is_guided and super()._shows_goal()

    def _where(self) -> str:
        return 'while the arm was guided' if self._started else 'before the arm was let go'


class TeachStream(ServoStream):
    """The registers of an arm that is guided: the mode TEACH in the place of set-points."""

    def __init__(self, settings: ServoSettings) -> None:
        """Wait for the first packet."""
        super().__init__(_NoSetpoints(), settings)
        self._begun = False
        self._asked_at = 0.0
        #: Whether the robot program has let the arm go.
        self.is_guided = False
        #: Why it does not (any more), as a clause.
        self.trouble = ''

    def begin(self) -> None:
        """Let the arm be guided from now on."""
        self._begun = True

    def take(self, feedback: ServoFeedback, now: float) -> tuple[float, ...] | None:
        """Take a packet; return what is to be written, None = nothing."""
        if self._begun and self._asked_at == 0.0:
            self._asked_at = now
        teaches = feedback.mode == ServoMode.TEACH
        if self._begun and self.phase is Phase.READY and not teaches:
            if self.is_guided:
                self.trouble = 'the robot program has ended the guiding by itself'
            elif now > self._asked_at + TEACH_BOUND:
                self.trouble = (
                    'the robot program does not let the arm be guided: it is paused, '
                    'or was started without allow_teach'
                )
        self.is_guided = self.is_guided or teaches
        return super().take(feedback, now)

    def _row(self) -> tuple[float, ...]:
        mode, *rest = super()._row()
        guided = self._begun and self.phase is Phase.READY
        return (ServoMode.TEACH if guided else mode, *rest)
