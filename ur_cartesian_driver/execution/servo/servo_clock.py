# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The clock of streamed set-points, which runs as fast as the robot carries them out.

The clock uses both feedback values of the manufacturer's guide to buffered ``servoj``: the
effective speed shows at once how fast the robot's time runs; L, the motion time in flight,
accumulates the remaining error::

    rate = effective_speed + (target - L) / T        0 <= rate <= MAX_RATE, slew-limited

T is :data:`CORRECTION_TIME`. L is the motion time in the robot's buffer, which the robot reports,
plus the time of set-points that the robot had not read when it made the report. So the delay of
the wire does not make L look too small, and the loop (an integrator with a proportional gain) does
not oscillate.

With s for the true speed, the derivative of L is ``rate - s``. The clock never lets L exceed
``max_lag``, so everything in flight fits into the buffer, even if the robot reads all of it at
once and carries out nothing. The buffer cannot overflow.
"""

from __future__ import annotations

from dataclasses import dataclass

#: Highest rate of the clock, to fill the buffer again.
MAX_RATE = 1.5
#: Time constant of the correction of the lag [s].
CORRECTION_TIME = 0.05
#: Bound on the change of the rate [1/s].
MAX_RATE_CHANGE = 50.0
#: Largest number of control steps that a set-point covers: above 1, so that the clock catches up.
MAX_STEPS = 2
#: Largest number of control steps that the clock makes up for after late packets.
MAX_PENDING_STEPS = 10
_ROUNDING = 1e-6


@dataclass(slots=True, kw_only=True)
class ServoClock:
    """
    Counts the control steps of motion time that the next set-point covers.

    :param step: the robot's control step [s].
    :param target: motion time to keep in flight [s].
    :param max_lag: longest motion time in flight [s].
    """

    step: float
    target: float
    max_lag: float
    rate: float = 0.0
    _pending: float = 0.0

    def advance(self, passed: float, speed: float, in_flight: float) -> None:
        """
        Advance the clock.

        :param passed: time that has passed by the controller's clock [s].
        :param speed: effective speed of the controller, 0 when its program does not run.
        :param in_flight: L in the module's description [s].
        """
        target_rate = speed + (self.target - in_flight) / CORRECTION_TIME
        target_rate = min(max(target_rate, 0.0), MAX_RATE)
        change = MAX_RATE_CHANGE * passed
        self.rate = min(max(target_rate, self.rate - change), self.rate + change)
        self._pending = min(self._pending + self.rate * passed, MAX_PENDING_STEPS * self.step)

    def take_steps(self, in_flight: float) -> int:
        """
        Return the number of control steps that a set-point sent now covers; 0 = none is due.

        :param in_flight: as in :meth:`advance`.
        """
        due_steps = int(self._pending / self.step + _ROUNDING)
        free_steps = int((self.max_lag - in_flight) / self.step + _ROUNDING)
        steps = max(0, min(due_steps, free_steps, MAX_STEPS))
        self._pending -= steps * self.step
        return steps
