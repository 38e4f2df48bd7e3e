# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The robot's feedback on streamed set-points, and the driver's report about them."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from math import nan

from ur_cartesian_driver.motion.geometry.vectors import Vector6

UNKNOWN6: Vector6 = (nan,) * 6


class ServoActivity(IntEnum):
    """The phase of the stream of set-points, numbered as in ``ServoState``."""

    IDLE = 0
    FILLING = 1
    SERVOING = 2
    HOLDING = 3
    DRAINING = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoFeedback:
    """
    The registers of the buffered servo in one RTDE packet.

    Only our own robot program writes the counts, which are the fields with a default; a program
    that follows the manufacturer's guide leaves them at 0.
    """

    #: Time by the controller's clock [s].
    timestamp: float
    #: How fast the motion of the program runs, 0 to 1 (:mod:`~.effective_speed`).
    effective_speed: float
    #: Whether the robot program runs, and is not paused.
    playing: bool
    mode: int
    last_sequence: int
    #: Motion time in the buffer [s].
    lag: float
    setpoints_done: int = 0
    repeats: int = 0
    skipped: int = 0
    buffer_size: int = 0
    overflows: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ServoReport:
    """The progress of the streamed set-points, as ``ServoState`` reports it."""

    #: Time by the controller's clock [s].
    timestamp: float
    activity: ServoActivity
    setpoints_sent: int
    setpoints_done: int
    buffer_size: int
    buffer_capacity: int
    #: Nominal duration of the set-points in the robot's buffer [s].
    buffered: float
    #: Nominal time by which the arm is behind the newest set-point [s].
    lag: float
    #: The effective speed, 0 to 1.
    speed_scaling: float
    #: Target minus actual joint positions [rad].
    joint_error: Vector6 = UNKNOWN6
    underruns: int = 0
    overruns: int = 0
    repeats: int = 0
    #: Sequence numbers that the robot never saw, because newer ones overwrote them.
    skipped: int = 0
