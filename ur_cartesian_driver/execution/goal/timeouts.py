# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Bounds on the time that a goal waits in its states (:mod:`~.goal_transitions`)."""

from __future__ import annotations

#: Longest time from CANCEL to its answer, and again from the answer to standstill [s]: the arm
#: brakes within a second from full speed, and the program discards the points in flight within
#: 0.5 s.
STOP_TIMEOUT = 3.0
#: Longest time for the robot to report a new TCP, to confirm the outputs of a goal, or to get
#: ready for set-points [s]: longer than the time after which a silent RTDE connection is given up,
#: so that the outcome names the connection if this is the reason.
ARMING_TIMEOUT = 1.2
#: Longest time for the robot program to confirm the safe outputs of a goal [s]; after that the
#: driver writes them itself.
SAFE_OUTPUTS_TIMEOUT = 0.2
#: Time after an early CANCELED in which the program may still begin its first point [s].
EARLY_CANCELED_TIMEOUT = 1.0
#: Wait for a deeper reason after the end of the robot program [s]: connections that die together
#: are reported some cycles apart.
CAUSE_TIMEOUT = 0.1

#: The clause for a motion for which the robot did not grant its RTDE inputs.
NO_INPUTS = f'the robot did not give its RTDE inputs within {ARMING_TIMEOUT:g} s'
