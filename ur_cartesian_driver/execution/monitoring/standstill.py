# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Check that the controller's target does not stand for long although nothing holds it."""

from __future__ import annotations

import numpy as np

from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.motion.state.robot_state import RobotState, RuntimeState

#: How long the target may stand still in the middle of a goal while nothing holds it [s].
STANDSTILL_TIMEOUT = 2.0
#: How much longer than planned it may stand where the plan itself waits [s].
STANDSTILL_MARGIN = 1.0
#: Rows of a path that differ by less are the same pose, at which the plan waits [m], [rad].
SAME_POSE = 1e-9


class Standstill:
    """Measures how long the target stands."""

    def __init__(self, path: ReferencePath, output_delay: float) -> None:
        """Find how long the target stands by plan."""
        #: Whether the target stands for longer than planned.
        self.is_long = False
        #: How long the target has stood [s]; the same in scaled time, and the bound on that.
        self._time = self._scaled_time = self._timeout = 0.0
        self.extend(path, output_delay)

    def extend(self, path: ReferencePath, output_delay: float) -> None:
        """
        Take a path that is appended.

        :param output_delay: how long after the end of the motion the last output is switched [s].
        """
        still = (np.abs(np.diff(path.poses, axis=0)) < SAME_POSE).all(axis=1)
        # A wait may have several rows: those that follow each other count as one.
        waits = np.bincount(np.cumsum(~still), weights=np.where(still, np.diff(path.time), 0.0))
        longest = max(float(waits.max(initial=0.0)), output_delay)
        if longest > 0.0:
            self._timeout = max(self._timeout, longest + STANDSTILL_MARGIN)

    def restart(self) -> None:
        """Begin to measure again, because a trajectory starts."""
        self._time = self._scaled_time = 0.0
        self.is_long = False

    def update(self, before: RobotState | None, state: RobotState, passed: float) -> None:
        """
        Compare a packet with the one before.

        :param passed: time between them, by the controller's clock [s].
        """
        if (
            before is not None
            and state.target_q == before.target_q
            and state.target_tcp_pose == before.target_tcp_pose
            and state.target_speed_fraction > 0.0
            and state.runtime_state is RuntimeState.PLAYING
        ):
            self._time += passed
            # At rest the scaling is 0: only the slider says how fast a wait would pass.
            self._scaled_time += passed * state.target_speed_fraction
            self.is_long = self._time >= STANDSTILL_TIMEOUT and self._scaled_time >= self._timeout
        else:
            self.restart()

    def violation(self, longest_wait: float) -> str | None:
        """
        Return that the target stands for no reason, as a clause, or None.

        :param longest_wait: how long the robot program may wait where it is, in real time [s].
        """
        if self._time < longest_wait + STANDSTILL_MARGIN:
            return None
        return (
            f'the arm has stood still for {self._time:.3g} s, nothing holds it, and '
            'the robot program has not reported the end: a message to it or from it was lost, so '
            'it was ended'
        )
