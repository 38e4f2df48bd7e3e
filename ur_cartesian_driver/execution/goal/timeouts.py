# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""How long a goal waits in its states; the states are in :mod:`~.goal_transitions`."""

from __future__ import annotations

#: Longest time from CANCEL to the answer, and from there to standstill [s]: the arm brakes within
#: a second from full speed, and discarding the points in flight takes 0.5 s at most.
STOP_TIMEOUT = 3.0
#: How long the robot may take to report a TCP that was set, to confirm the outputs of a goal, or
#: to get ready for set-points [s]: longer than a silent RTDE connection counts as alive, which is
#: then the reason that the user hears.
ARMING_TIMEOUT = 1.2
#: How long the robot program may take to confirm that the outputs of a goal are safe [s]; after
#: that the driver writes them itself.
SAFE_OUTPUTS_TIMEOUT = 0.2
#: How long a program that answered CANCELED before its first point may take to begin anyway [s].
EARLY_CANCELED_TIMEOUT = 1.0
#: How long to wait for a deeper reason after the robot program has ended [s]: what dies together
#: is reported by different connections, some cycles apart.
CAUSE_TIMEOUT = 0.1
