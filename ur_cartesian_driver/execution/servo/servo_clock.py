# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The clock of streamed set-points: it runs as fast as the robot carries them out.

Both feedbacks of the manufacturer's guide are in it. ``speed_scaling`` says at once how fast the
robot's time runs; the motion time that is under way to the arm, L, says what that left over::

    rate = speed_scaling + (target - L) / T        0 <= rate <= MAX_RATE, slew-limited

L is the motion time in the robot's buffer, which the robot reports, and that of the set-points
that it had not read when it made the report: so the delay of the wire is not taken for a lag that
is missing, and the loop has nothing to oscillate with (an integrator with a proportional gain).

With s for the true speed, L changes by ``rate - s``. The clock never lets L grow beyond
``max_lag``, whatever the rate: what is under way fits into the buffer even if the robot reads all
of it at once and carries out nothing. That is why the buffer cannot overflow.
"""

from __future__ import annotations

from dataclasses import dataclass

#: The fastest that the clock runs to fill the buffer again.
MAX_RATE = 1.5
#: How fast a lag that is not the wanted one is corrected [s].
CORRECTION_TIME = 0.05
#: How fast the rate changes [1/s].
MAX_RATE_CHANGE = 50.0
#: A set-point stands for so many steps at most: more than one where the clock has to catch up.
MAX_STEPS = 2
#: What the clock has to catch up with at most, after packets that came late [steps].
MAX_PENDING_STEPS = 10
_ROUNDING = 1e-6


@dataclass(slots=True, kw_only=True)
class ServoClock:
    """
    Says how many control steps of motion time the next set-point stands for.

    :param step: the robot's control step [s].
    :param target: motion time that is to be under way [s].
    :param max_lag: motion time that may be under way [s].
    """

    step: float
    target: float
    max_lag: float
    rate: float = 0.0
    _pending: float = 0.0

    def advance(self, passed: float, scaling: float, in_flight: float) -> None:
        """
        Let time pass.

        :param passed: by the controller's clock [s].
        :param scaling: what the controller runs at, 0 when its program does not.
        :param in_flight: L of the module's description [s].
        """
        target_rate = scaling + (self.target - in_flight) / CORRECTION_TIME
        target_rate = min(max(target_rate, 0.0), MAX_RATE)
        change = MAX_RATE_CHANGE * passed
        self.rate = min(max(target_rate, self.rate - change), self.rate + change)
        self._pending = min(self._pending + self.rate * passed, MAX_PENDING_STEPS * self.step)

    def take_steps(self, in_flight: float) -> int:
        """
        Return how many steps a set-point stands for that is sent now; 0 = none is due.

        :param in_flight: as in :meth:`advance`.
        """
        due_steps = int(self._pending / self.step + _ROUNDING)
        free_steps = int((self.max_lag - in_flight) / self.step + _ROUNDING)
        steps = max(0, min(due_steps, free_steps, MAX_STEPS))
        self._pending -= steps * self.step
        return steps
