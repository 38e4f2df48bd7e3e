# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The targets of a live session, which may come late, come out of order, or stop coming.

The newest target is the one with the newest stamp, in whatever order the targets arrive. The arm
follows it until it is ``max_age`` old, then brakes and waits at rest for a newer target. When no
target has arrived for ``timeout``, the session is over. All times are of one steady clock.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf

from ur_cartesian_driver.execution.goal.feeder import (
    Ageing,
    counted,
    how_often,
    Reporting,
    Steerable,
)
from ur_cartesian_driver.execution.goal.goal_commands import GoalCommand
from ur_cartesian_driver.execution.live.online_trajectory import (
    LiveLimits,
    OnlineTrajectoryGenerator,
)
from ur_cartesian_driver.execution.offsets.freshness import Freshness, RareWarnings
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveSettings:
    """
    Bounds and times of a session, with the defaults of ``config/driver.yaml``.

    :raises ValueError: a time is not positive.
    """

    limits: LiveLimits = field(default_factory=LiveLimits)
    #: Largest age of a target that is followed [s].
    max_age: float = 0.2
    #: The session is over when no target has arrived for this long [s].
    timeout: float = 2.0

    def __post_init__(self) -> None:
        """Check the times."""
        for name in ('max_age', 'timeout'):
            if not getattr(self, name) > 0.0:
                raise ValueError(f'{name} is {getattr(self, name)}; it must be positive')


class LiveTargets(Steerable, Ageing, Reporting):
    """The source of the set-points of a session."""

    def __init__(self, generator: OnlineTrajectoryGenerator, settings: LiveSettings) -> None:
        """Begin with no target."""
        self.generator, self.settings = generator, settings
        #: Number of stops because the newest target was too old.
        self.pauses = 0
        self.freshness, self._warnings = Freshness(settings.max_age), RareWarnings()
        self._last_came = inf
        self._is_over = self._was_blocked = False
        # The first text of each reason for a stop; the key is the reason without its numbers.
        self._reasons: dict[str, str] = {}

    def set_target(self, T_base_tcp: Pose, age: float, now: float) -> None:
        """Accept a target, unless it is older than ``max_age`` or than a newer one."""
        self._last_came = now
        if not self.freshness.accept(age, now):
            return
        self._is_over = False
        self.generator.set_target(T_base_tcp)

    def age(self, now: float) -> list[GoalCommand]:
        """Drop a stale target, end the session after its timeout, warn if the arm is blocked."""
        generator = self.generator
        if not generator.blocked:
            self._warnings.forget()
        elif not self._was_blocked:
            self._warnings.ask(f'the arm does not go to the live target: {generator.blocked}')
        self._was_blocked = bool(generator.blocked)
        if generator.target is not None and self.freshness.is_stale(now):
            # Dropping the target does not stop an arm that already rests at it.
            self.pauses += not generator.arrived
            generator.clear_target()
        self._last_came = min(self._last_came, now)
        self._is_over = now - self._last_came > self.settings.timeout
        return self._warnings.due(now)

    def next(self, dt: float) -> Joints:
        """Return the set-point [rad] that follows ``dt`` [s] of nominal time after the last."""
        if dt <= 0.0:
            return self.generator.q
        q = self.generator.step(dt)
        if reason := self.generator.blocked:
            self._reasons.setdefault(_without_numbers(reason), reason)
        return q

    @property
    def done(self) -> bool:
        """Return whether the session is over: targets have ceased, and the arm is at rest."""
        return self._is_over and self.generator.at_rest

    @property
    def report(self) -> tuple[str, ...]:
        """The lines about followed and ignored targets, and about stops."""
        taken, dropped = self.freshness.accepted, self.freshness.dropped
        age = f'older than {self.settings.max_age:g} s'
        lines = [f'{counted(taken, "target")} followed']
        if dropped:
            lines.append(f'{counted(dropped, "target")} ignored: older than a newer one, or {age}')
        if self.pauses:
            times = how_often(self.pauses)
            lines.append(f'the arm was stopped {times} because the newest target was {age}')
        return (*lines, *(f'the arm was stopped: {reason}' for reason in self._reasons.values()))


def _without_numbers(reason: str) -> str:
    """Return the part of a reason that stays the same while the target jitters."""
    return ' '.join(word for word in reason.split() if not word[:1].isdigit())
