# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Values that the motion generator gives to its callers: calls, faults, warnings, errors."""

from __future__ import annotations

from dataclasses import dataclass


class MotionError(Exception):
    """Raised for a motion call that is refused before the arm moves; programmers read the text."""


@dataclass(slots=True)
class Move:
    """
    One running motion call.

    ``returned`` becomes true when the script call can return: the waypoint is reached, the next
    cycle enters its blend, the stop has ended, the time is over, or another motion has taken over.
    The arm can still be moving then.
    """

    returned: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionFault:
    """The reason why the arm stopped by itself: error ``C<code>A<argument>`` and its text."""

    code: int
    argument: int
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionWarning:
    """A robot error code of warning level; the motion continues."""

    code: int
    argument: int
    text: str
