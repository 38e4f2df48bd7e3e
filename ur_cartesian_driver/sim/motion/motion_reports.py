# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Warnings and faults of the motion generator, with the controller's error codes."""

from __future__ import annotations

from ur_cartesian_driver.sim.motion.motion_values import MotionFault, MotionWarning, Move

#: Move -> argument of error code C171 for a skipped waypoint.
_BLEND_SKIPPED_ARGUMENTS = {
    'movej': 4,
    'optimovej': 4,
    'movel': 11,
    'optimovel': 11,
    'movec': 0,
    'movep': 9,
}
#: Move -> argument of error code C171 for a blend that is too small.
_BLEND_TOO_SMALL_ARGUMENTS = {'movec': 1, 'movep': 10}


class MotionReports:
    """Warnings that the controller has not sent yet, and the fault that stopped the arm."""

    def __init__(self) -> None:
        """Begin with nothing to report."""
        self.fault: MotionFault | None = None
        self.warnings: list[MotionWarning] = []
        #: The last movep that was reported as too fast.
        self._too_fast: Move | None = None

    def blend_skipped(self, name: str) -> None:
        """Report a waypoint that is skipped because its blend overlaps the previous blend."""
        self._warn(
            171,
            _BLEND_SKIPPED_ARGUMENTS[name],
            f'Overlapping blends in a {name}, a waypoint was skipped.',
        )

    def blend_too_small(self, name: str, radius: float) -> None:
        """Report a blend radius that the tool passes within one cycle."""
        self._warn(
            171,
            _BLEND_TOO_SMALL_ARGUMENTS[name],
            f'Blend radius too small in a {name}: {radius:g} m is less than the path of one '
            'cycle, so the arm stops at the waypoint.',
        )

    def waypoint_within_blend(self, name: str) -> None:
        """Report a waypoint that lies within the blend of the previous waypoint."""
        self._warn(
            197,
            0,
            f'Blend overlap: the waypoint of this {name} lies within the blend before it, so '
            'the arm stops at the waypoint before.',
        )

    def movep_too_fast(self, call: Move, reason: str) -> None:
        """Report that the arm cannot keep the speed of a movep; once for each movep."""
        if call is not self._too_fast:
            self._too_fast = call
            self._warn(196, 0, f'MoveP speed too high: {reason}')

    def _warn(self, code: int, argument: int, text: str) -> None:
        self.warnings.append(MotionWarning(code=code, argument=argument, text=text))
