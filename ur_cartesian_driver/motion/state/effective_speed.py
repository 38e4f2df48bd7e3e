# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The speed scaling of the robot program's motion, from the controller's reports.

The controller reports two factors. ``target_speed_fraction`` is the speed slider.
``speed_scaling`` is the slowdown in addition to the slider: 1 in an undisturbed motion, wherever
the slider is, and 0 at rest. As in the manufacturer's ROS 2 driver and ``ur_rtde``, the effective
speed is the product of both, is 0 while the program is RESUMING, and rises slowly after a pause:
the controller reports a scaling of 1 before the arm has sped up from rest.
"""

from __future__ import annotations

from ur_cartesian_driver.motion.state.rtde_state import RuntimeState

#: How fast the effective speed rises after a pause, as in the manufacturer's ROS 2 driver [1/s].
RISE_AFTER_PAUSE = 5.0
#: States in which the program moves the arm, or still brakes it.
_MOVING = frozenset({RuntimeState.PLAYING, RuntimeState.PAUSING, RuntimeState.STOPPING})
#: States after which the arm speeds up again.
_HELD = frozenset({RuntimeState.PAUSED, RuntimeState.RESUMING})


class EffectiveSpeed:
    """The effective speed, packet by packet: 1 = as programmed, 0 = held or at rest."""

    def __init__(self) -> None:
        """Begin with an arm that has not been paused."""
        self._time = 0.0
        self._speed = 0.0
        self._rises = False

    def update(
        self,
        timestamp: float,
        speed_scaling: float,
        target_speed_fraction: float,
        runtime_state: int,
    ) -> float:
        """
        Return the effective speed in a packet, 0 to 1.

        :param timestamp: time by the controller's clock [s].
        :param speed_scaling: the slowdown in addition to the slider, 0 to 1.
        :param target_speed_fraction: the speed slider, 0 to 1.
        :param runtime_state: a :class:`RuntimeState`, or its number.
        """
        speed = speed_scaling * target_speed_fraction if runtime_state in _MOVING else 0.0
        if self._rises:
            risen = self._speed + RISE_AFTER_PAUSE * max(0.0, timestamp - self._time)
            self._rises = risen < speed
            speed = min(speed, risen)
        self._rises = self._rises or runtime_state in _HELD
        self._time, self._speed = timestamp, speed
        return speed
