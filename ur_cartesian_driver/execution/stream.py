# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The machine of a goal that is continued while it runs (keep_open).

Its trajectory is a stream of the wire dialect 2.14: the robot program reads points until it is
told how many they are. Three things have to hold, whoever supplies the points:

* The program never waits for a point while the arm moves: it would fail, or stop the arm the hard
  way. So what comes at the end for now (the *ending*: the last motion, without a blend; behind a
  spline a piece to rest) is planned together with every point, and kept back. Where nothing else
  has come ``margin`` before the program would ask, the ending is sent, and the stream is closed
  with the number of its records.
* What was sent is final, so little is sent: as many seconds as ``horizon`` says. A program that
  is told to cancel has to read all of it.
* Memory does not grow: what was sent, and the path that was passed, are forgotten.

The states CLOSING and WAITING are of these goals only (:mod:`~.states`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf

from ur_cartesian_driver.execution.commands import (
    AnswerExtension,
    Command,
    Report,
    SendControl,
    SendPoints,
)
from ur_cartesian_driver.execution.observer import MAX_PLAN_DEVIATION
from ur_cartesian_driver.execution.order import Extension, Order
from ur_cartesian_driver.execution.states import Signal, State
from ur_cartesian_driver.execution.tcp_loan import REST_SPEED
from ur_cartesian_driver.execution.trajectory import TrajectoryMachine
from ur_cartesian_driver.motion.events import Event
from ur_cartesian_driver.motion.state import RobotState
from ur_cartesian_driver.protocol.reverse import TrajectoryAction

#: How long a motion that is only its ending so far waits for more before it begins [s]: the robot
#: program waits half a second for its first point.
PATIENCE = 0.25

#: In these a goal takes more points.
_TAKES = frozenset({State.ARMING, State.MOVING, State.CLOSING, State.WAITING})


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamSettings:
    """How far ahead the robot gets its points, and how long it waits for them."""

    #: Planned time of the motion that the robot program has and has not run [s].
    horizon: float = 1.0
    #: So long before the robot program would ask for a point that is not there, the motion is
    #: closed [s].
    margin: float = 0.2
    #: How long the goal waits at rest for more points [s]; 0 = without end.
    timeout: float = 30.0


class StreamMachine(TrajectoryMachine):
    """One goal with an open end; see the module's description."""

    def __init__(
        self,
        order: Order,
        *,
        settings: StreamSettings | None = None,
        feedback_period: float = 0.04,
        max_plan_deviation: tuple[float, float] = MAX_PLAN_DEVIATION,
        continues: bool = False,
    ) -> None:
        """Take the order of what is known so far; nothing happens before :meth:`start`."""
        super().__init__(
            order,
            feedback_period=feedback_period,
            max_plan_deviation=max_plan_deviation,
            continues=continues,
        )
        self._settings = settings if settings is not None else StreamSettings()
        #: Whether more points may come.
        self._is_open = True
        #: How many records will be sent whatever comes: all but the ending.
        self._firm = order.points - order.ending
        #: How many were sent before this stream, and whether its number was told.
        self._stream_from = 0
        #: When it was begun, by the robot's clock [s].
        self._stream_since = 0.0
        self._is_counted = False
        #: How often the motion was closed, and where the last time.
        self._closed = self._closed_at = 0
        #: Whether the arm has come to rest there and has not gone on.
        self._rests = False

    def step(self, event: Event | Extension, now: float) -> list[Command]:
        """Return what to do after an event, or after points that came."""
        if not isinstance(event, Extension):
            return super().step(event, now)
        refusal = self._refusal(event)
        if refusal is not None:
            return [refusal]
        self._take(event)
        return [AnswerExtension(number=event.number), *self._go_on(now)]

    # ---- points that come ---------------------------------------------------------------------

    def _refusal(self, extension: Extension) -> AnswerExtension | None:
        """Return why points are not taken, or None."""
        number = extension.number
        if not self._is_open:
            return AnswerExtension(
                number=number, refusal=('The last points of the goal were said to be the last.')
            )
        if self.state not in _TAKES:
            return AnswerExtension(number=number, refusal='The goal is ending.')
        if extension.order is not None and extension.behind != self._firm:
            return AnswerExtension(
                number=number,
                from_rest=True,
                refusal=('The motion was closed before these points came.'),
            )
        return None

    def _take(self, extension: Extension) -> None:
        order = extension.order
        self._is_open = order is not None and order.open_end
        if order is not None:
            self._observer.extend(order, extension.behind)
            self.order = order
        self._firm = self._records.total
        if self._is_open and order is not None:
            self._firm -= order.ending

    def _go_on(self, now: float) -> list[Command]:
        """Return what points, or the word that none will come, lead to in the present state."""
        if self.state is State.MOVING:
            return self._release(0)
        signal = self._continuation()  # else they are sent when it is their turn
        return [] if signal is None else self._apply(signal, '', now)

    def _continuation(self) -> Signal | None:
        """
        Return how a goal that waits goes on, or None.

        Packets may be late: where the arm goes on from is judged by one that shows it at rest.
        """
        if self.state is not State.WAITING:
            return None
        if self._records.total == self._window.sent:
            return None if self._is_open else Signal.LAST
        state = self._observer.latest
        is_seen = state is not None and max(map(abs, state.actual_qd)) < REST_SPEED
        return Signal.EXTENDED if is_seen else None

    # ---- points that go -----------------------------------------------------------------------

    def _begin(self, state: RobotState) -> list[Command]:
        self._deadline = inf
        self._started, self._is_counted, self._rests = True, False, False
        self._stream_from, self._stream_since = self._window.sent, state.timestamp
        self._observer.resume(state, self._window.sent)
        return [SendControl(action=TrajectoryAction.STREAM_START), *self._release(0)]

    def _release(self, begun: int) -> list[Command]:
        if self.state is not State.MOVING:
            return []
        first, self._window.begun = self._window.sent, max(self._window.begun, begun)
        ahead = self._records.until(self._observer.time() + self._settings.horizon)
        end = max(first, min(ahead, self._firm, self._window.begun + self._window.size))
        return self._send(first, end)

    def _send(self, first: int, end: int) -> list[Command]:
        """Send records, and their number where they are the last ones."""
        self._window.sent = end
        commands: list[Command] = [SendPoints(first=first, end=end)] if end > first else []
        closes = self.state is State.CLOSING or not self._is_open
        if closes and end == self._records.total and not self._is_counted:
            self._is_counted = True
            commands.append(
                SendControl(action=TrajectoryAction.STREAM_END, count=end - self._stream_from)
            )
        return commands

    def _sent(self) -> int:
        return self._window.sent - self._stream_from

    # ---- signals and states -------------------------------------------------------------------

    def _judge(self, state: RobotState, now: float) -> tuple[Signal | None, str]:
        signal, text = super()._judge(state, now)
        if signal is None and self.state is State.MOVING and self._starves():
            return Signal.STARVING, ''
        return (signal, text) if signal is not None else (self._continuation(), '')

    def _starves(self) -> bool:
        """Tell whether the program is soon going to ask for a point that nobody has given."""
        sent = self._window.sent
        if not self._is_open or sent != self._firm:
            return False
        if sent == self._stream_from:
            return self._robot_time() - self._stream_since >= PATIENCE
        return self._records.asked(sent) - self._observer.time() <= self._settings.margin

    def _robot_time(self) -> float:
        state = self._observer.latest
        return 0.0 if state is None else state.timestamp

    def _late(self, now: float) -> tuple[Signal | None, str]:
        if self.state is State.WAITING and now >= self._deadline:
            return Signal.LATE, (
                'no more points, and no word that there are none, came within '
                f'keep_open_timeout = {self._settings.timeout:g} s'
            )
        return super()._late(now)

    def _entered(self, state: State) -> Callable[[Signal, float], list[Command]]:
        if state is State.CLOSING:
            return self._enter_closing
        return self._enter_waiting if state is State.WAITING else super()._entered(state)

    def _enter_closing(self, signal: Signal, now: float) -> list[Command]:
        self._firm = self._records.total
        self._closed += 1
        self._closed_at = self._records.points - 1
        return self._send(self._window.sent, self._firm)

    def _enter_waiting(self, signal: Signal, now: float) -> list[Command]:
        self._rests = True
        self._observer.finish(self._records.end(self._window.sent))
        self._deadline = now + self._settings.timeout if self._settings.timeout > 0.0 else inf
        return self._go_on(now)

    def _enter_moving(self, signal: Signal, now: float) -> list[Command]:
        state = self._observer.latest
        if signal is Signal.EXTENDED and state is not None:
            moved = self._observer.off_place(state)
            if moved is not None:
                self.state = State.WAITING
                return self._apply(Signal.DEVIATION, moved, now)
        return super()._enter_moving(signal, now)

    # ---- what is told -------------------------------------------------------------------------

    def _progress_report(self) -> Report:
        waits = self.state is State.WAITING
        return Report(
            progress=self._observer.progress(
                self._window.sent, at_end=waits or self.state is State.SETTLING, waits=waits
            )
        )

    def _where(self) -> str:
        if self._rests:
            return f'at rest behind point {self._closed_at}, waiting for more'
        return super()._where()

    def _report(self) -> tuple[str, ...]:
        if not self._closed:
            return super()._report()
        times = 'once' if self._closed == 1 else f'{self._closed} times'
        return (
            *super()._report(),
            (
                f'the motion was brought to rest {times}, the last time behind point '
                f'{self._closed_at}, because no more points came in time; what was appended later '
                'is later by as much as that took'
            ),
        )
