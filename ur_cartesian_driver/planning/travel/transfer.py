# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Find a transfer: a path from one configuration of an arm to one of several others.

The tool is retracted along its axis z, the joints move through free space, and the tool
approaches along its axis z. Each of the three parts begins and ends at rest or in a blend; the
planner checks the blends.
"""

from __future__ import annotations

from collections.abc import Sequence
import contextlib
from dataclasses import dataclass

import numpy as np

from ur_cartesian_driver.motion.errors import CollisionPredicted, GoalRefused, Unreachable
from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.vectors import Joints, vector6
from ur_cartesian_driver.planning.preflight.clearance import Violation
from ur_cartesian_driver.planning.travel.arm_space import ArmSpace
from ur_cartesian_driver.planning.travel.joint_path_search import search_joint_path

#: The largest retract and approach [m]; larger numbers must be millimetres by mistake.
MAX_RETRACT = 1.0
#: The fractions of retract or approach that are tried in turn if they may be shortened.
_SHORTER = (1.0, 0.4, 0.0)
#: The largest ``max_samples`` that is accepted.
MAX_SAMPLES = 1_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class TransferSettings:
    """
    The lines at both ends of a transfer, and the parameters of its search.

    :raises ValueError: a number is out of its range; the text is a clause.
    """

    #: The length of the retract along the tool's axis z before the joints move freely [m].
    retract: float = 0.05
    #: The length of the approach along the tool's axis z [m].
    approach: float = 0.05
    #: The number of samples after which a search gives up.
    max_samples: int = 2000
    #: Another seed finds another path; the same seed finds the same path again.
    seed: int = 0
    #: Whether retract and approach may be shortened, down to none, if they are not possible.
    shorten: bool = False

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name in ('retract', 'approach'):
            value = getattr(self, name)
            if not 0.0 <= value <= MAX_RETRACT:  # or NaN
                raise ValueError(f'{name} is {value:g} m, but must be from 0 to {MAX_RETRACT:g} m')
        if not 0 <= self.max_samples <= MAX_SAMPLES:
            raise ValueError(
                f'max_samples is {self.max_samples}, but must be from 0 to {MAX_SAMPLES}'
            )
        if self.seed < 0:
            raise ValueError(f'seed is {self.seed}, but must not be negative')


@dataclass(frozen=True, slots=True)
class Transfer:
    """A path through the air, from the end of the retract to the beginning of the approach."""

    #: (k, 6) [rad]; between two rows the joints move straight.
    waypoints: Floats
    #: The requested configuration to which the approach leads [rad].
    goal: Joints
    #: The number of samples that the search took.
    samples: int
    #: Whether the tool is retracted first.
    retracts: bool


def find_transfer(
    space: ArmSpace,
    q_start: Joints,
    goals: Sequence[Joints],
    settings: TransferSettings,
    where: str,
) -> Transfer:
    """
    Return a transfer to one of several configurations.

    :param goals: at least one; the search does not depend on their order. If none has a free
        approach, the refusal of the first one is raised.
    :param where: the beginning of a refusal, such as ``The travel to point 0``.
    :raises CollisionPredicted: the arm touches something at the start, on the retract, or in each
        goal or on its approach; or no path was found.
    :raises Unreachable: the arm cannot follow the line of the retract or of the approach.
    """
    if (touching := space.touching(q_start)) is not None:
        raise _collision(where, 'cannot begin', touching, q_start)
    left = _line_end(space, q_start, settings, f'{where}: the retract', 'retract')
    arrivals: dict[bytes, Joints] = {}
    refusal: GoalRefused | None = None
    for goal in goals:
        try:
            if (touching := space.touching(goal)) is not None:
                raise _collision(where, 'cannot end', touching, goal)
            what = f'{where}: the approach'
            begin = _line_end(space, goal, settings, what, 'approach')
            arrivals[begin.tobytes()] = goal
        except GoalRefused as error:
            refusal = refusal or error
    if refusal is not None and not arrivals:
        raise refusal
    rows = np.array([np.frombuffer(row) for row in arrivals])
    found = search_joint_path(
        space, left, rows, max_samples=settings.max_samples, seed=settings.seed
    )
    if found is None:
        raise CollisionPredicted(
            f'{where} was not found within {settings.max_samples} samples; allow more samples, '
            'ask for another posture, or look at the bodies between, and at their clearance.'
        )
    end = found.waypoints[-1].tobytes()
    retracts = bool(np.any(left != np.array(q_start)))
    return Transfer(found.waypoints, arrivals[end], found.samples, retracts)


def _line_end(
    space: ArmSpace, q: Joints, settings: TransferSettings, what: str, setting: str
) -> Floats:
    """Return the configuration (6,) in which the retract ends, or the approach begins."""
    length: float = getattr(settings, setting)
    for fraction in _SHORTER if settings.shorten else ():
        with contextlib.suppress(GoalRefused):
            return _along_tool(space, q, -fraction * length, what, setting)
    return _along_tool(space, q, -length, what, setting)


def _along_tool(space: ArmSpace, q: Joints, distance: float, what: str, setting: str) -> Floats:
    """Return the configuration (6,) at the end of a line along the tool, if the line is free."""
    if not distance:
        return np.array(q)
    rows = space.along_tool(q, distance)
    advice = f'use a shorter {setting}'
    if rows is None:
        raise Unreachable(
            f'{what} of {abs(distance):g} m along the axis z of the tool is out of reach, or '
            f'passes a singularity; {advice}.'
        )
    violation = space.violation(rows, q)
    if violation is not None:
        at = vector6(rows[violation.row].tolist())
        raise _collision(f'{what} of {abs(distance):g} m', 'is not free', violation, at, advice)
    end: Floats = rows[-1]
    return end


def _collision(
    where: str, what: str, violation: Violation, q: Joints, advice: str = ''
) -> CollisionPredicted:
    error = CollisionPredicted(f'{where} {what}: {violation.text}; {advice or violation.remedy}.')
    error.q, error.bodies = q, violation.bodies
    return error
