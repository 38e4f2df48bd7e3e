# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Calls of path moves, whose paths are computed when they begin; checks of the arguments."""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import NamedTuple, TypeAlias

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.sim.motion.motion_values import MotionError, Move
from ur_cartesian_driver.sim.motion.paths.move_paths import MovePath
from ur_cartesian_driver.sim.motion.paths.path_motion import ProfileParameters
from ur_cartesian_driver.sim.motion.paths.second_motion_version import SecondMotionVersion


class PathStart(NamedTuple):
    """The start of a path: joint positions [rad], and T_base_tcp."""

    q: Vector6
    pose: Pose


#: Moves whose blends follow ``blend_begin`` and ``blend_speed_ratio`` of the laws; not movep.
BLENDS_BY_LAWS = ('movej', 'movel', 'movec')

ParameterFunction: TypeAlias = Callable[[MovePath, PathStart], ProfileParameters]


class MotionCall(NamedTuple):
    """A call of a path move; ``move_path`` computes the path when the move begins."""

    name: str
    move_path: Callable[[PathStart], MovePath]
    parameters: ProfileParameters | ParameterFunction
    radius: float
    move: Move
    #: Reduces the blend radii; None = motion version 1, which does not reduce them.
    version: SecondMotionVersion | None = None

    def parameters_of(self, move_path: MovePath, start: PathStart) -> ProfileParameters:
        """Return the profile parameters of this call for its path."""
        given = self.parameters
        return given if isinstance(given, ProfileParameters) else given(move_path, start)


def constant_speed_parameters(a: float, v: float, r: float) -> ProfileParameters:
    """
    Return the parameters of movep, which can brake from its speed within the blend radius.

    The deceleration is the larger of a and v^2 / 2r; without a radius, it is a.
    """
    braking = max(a, v * v / (2.0 * r)) if r > 0.0 else None
    return ProfileParameters(acceleration=a, speed=v, braking=braking)


def check_profile_parameters(name: str, parameters: ProfileParameters) -> None:
    """
    Refuse a negative or infinite time; without a time, check acceleration and speed.

    :raises MotionError: a parameter is impossible.
    """
    if not 0.0 <= parameters.time < inf:
        raise MotionError(f'{name}: the time is {parameters.time:g} s, it must be 0 or more.')
    if parameters.time > 0.0:
        return
    for word, value in (('acceleration', parameters.acceleration), ('speed', parameters.speed)):
        if not 0.0 < value < inf:
            raise MotionError(f'{name}: the {word} is {value:g}, it must be above 0.')


def check_fractions(name: str, a: float, v: float) -> None:
    """Refuse fractions of an optimove (``a``: acceleration, ``v``: velocity) outside (0, 1]."""
    for word, value in (('acceleration', a), ('velocity', v)):
        if not 0.0 < value <= 1.0:
            raise MotionError(f'{name}: {word} is {value:g}, it must be a fraction in (0, 1].')
