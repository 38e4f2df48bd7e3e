# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Check that the controller's target does not stand still for long while nothing holds it."""

from __future__ import annotations

from functools import reduce

import numpy as np

from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.motion.state.rtde_state import RobotState, RuntimeState

#: Longest standstill of the target in the middle of a goal while nothing holds it [s].
STANDSTILL_TIMEOUT = 2.0
#: Margin on the standstill of the target when the plan itself waits [s].
STANDSTILL_MARGIN = 1.0
#: Two path rows are the same pose, at which the plan waits, if no number differs by this [m], [1].
SAME_POSE = 1e-9


class Standstill:
    """Measures the standstill of the target."""

    def __init__(self, path: ReferencePath, output_delay: float) -> None:
        """Find the longest planned standstill of the target."""
        #: Whether the target has stood still for longer than the plan explains.
        self.is_long = False
        #: Present standstill of the target, in real time [s]; the same in scaled time [s]; the
        #: longest planned one with :data:`STANDSTILL_MARGIN`, in scaled time [s], 0 = none is
        #: planned.
        self._time = self._scaled_time = self._timeout = 0.0
        self.extend(path, output_delay)

    def extend(self, path: ReferencePath, output_delay: float) -> None:
        """
        Allow for the planned waits of a path, which may be an appended one.

        :param output_delay: delay of the last output after the end of the motion [s].
        """
        # Faster than all(axis=1) for the few columns of a pose.
        still = reduce(np.logical_and, (np.abs(np.diff(path.poses, axis=0)) < SAME_POSE).T)
        longest = output_delay
        if still.any():
            # A wait may have several rows: consecutive rows at one pose are summed.
            passed = np.where(still, np.diff(path.time), 0.0)
            waits = np.bincount(np.cumsum(~still), weights=passed)
            longest = max(float(waits.max()), longest)
        if longest > 0.0:
            self._timeout = max(self._timeout, longest + STANDSTILL_MARGIN)

    def restart(self) -> None:
        """Begin to measure again, because a trajectory starts."""
        self._time = self._scaled_time = 0.0
        self.is_long = False

    def update(
        self, before: RobotState | None, state: RobotState, passed: float, feed: float
    ) -> None:
        """
        Compare a packet with the previous one.

        :param passed: time between the packets, by the controller's clock [s].
        :param feed: the feed, as a fraction of the planned speed, 0 to 1.
        """
        if (
            before is not None
            and state.target_q == before.target_q
            and state.target_tcp_pose == before.target_tcp_pose
            and state.target_speed_fraction > 0.0
            and state.runtime_state is RuntimeState.PLAYING
        ):
            self._time += passed
            # At rest the speed scaling is 0: slider and feed give the rate of a planned wait.
            self._scaled_time += passed * state.target_speed_fraction * feed
            self.is_long = self._time >= STANDSTILL_TIMEOUT and self._scaled_time >= self._timeout
        else:
            self.restart()

    def violation(self, longest_wait: float) -> str | None:
        """
        Return a clause if the target stands still for no reason, else None.

        :param longest_wait: longest wait of the robot program at this point, in real time [s].
        """
        if self._time < longest_wait + STANDSTILL_MARGIN:
            return None
        return (
            f'the arm has stood still for {self._time:.3g} s, nothing holds it, and '
            'the robot program has not reported the end: a message to it or from it was lost, so '
            'it was ended'
        )
