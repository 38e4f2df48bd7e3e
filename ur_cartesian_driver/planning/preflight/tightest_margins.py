# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Margins: distances of the arm from its singularities and joint limits.

The arm has three singularities, at each of which two of its solutions meet: the wrist is straight
(axes 4 and 6 parallel), the elbow is stretched or folded, or the wrist centre is above or below
the shoulder. The distances from them are the angle between axes 4 and 6, the angle by which the
elbow is bent or unfolded, and the distance of the wrist centre from the plane of axes 1 and 2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce

import numpy as np

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import format_distinct
from ur_cartesian_driver.kinematics.inverse_rows import branch_measures
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import GoalRefused, JointLimitExceeded, NearSingularity
from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Indices, Int32s
from ur_cartesian_driver.motion.goal.goal_columns import Rows
from ur_cartesian_driver.planning.geometry.samples import first_least
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.joint_path_solver import describe_location, JointPath

#: Length of path [m] after a start at rest on which the arm is allowed to be near a singularity.
START_LENGTH = 0.001
#: Turn [rad] after a start at rest during which the arm is allowed to be near a singularity.
START_ANGLE = 0.01
#: A distance from a singularity counts as growing if it shrinks by no more than this rounding
#: error.
_ROUNDING = 1e-9
#: Rows per block, so that intermediate arrays stay in the CPU cache.
_BLOCK = 8192


@dataclass(frozen=True, slots=True)
class SingularityMeasure:
    """A distance from a singularity."""

    name: str
    unit: str
    #: The singular configuration, in words.
    meaning: str
    #: Distances from different singularities are compared after division by their scales.
    scale: float

    @property
    def option(self) -> str:
        """The name of the parameter that bounds the distance."""
        return f'singularity_margin_{self.name}'


SINGULARITY_MEASURES = (
    SingularityMeasure('wrist', 'rad', 'axes 4 and 6 parallel', 1.0),
    SingularityMeasure('elbow', 'rad', 'arm stretched or folded', 1.0),
    SingularityMeasure('shoulder', 'm', 'wrist centre above or below the shoulder', 0.3),
)
_SCALES = np.array([measure.scale for measure in SINGULARITY_MEASURES])
#: Name and unit of each margin: the distances from singularities, then from joint limits.
_QUANTITIES = (
    *((f'the {measure.name} singularity', measure.unit) for measure in SINGULARITY_MEASURES),
    *((f'the limit of {name}', 'rad') for name in JOINT_NAMES),
)


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class TightestMargins(Rows[str]):
    """
    The smallest distance of each segment from singularities and joint limits.

    As a sequence, it has a phrase for each segment.
    """

    #: (n,) the segment of each margin.
    segments: Int32s
    #: (n,) the number of the nearest singularity, or 3 + the number of the joint nearest to a
    #: limit.
    kinds: Indices
    #: (n,) the distance from this singularity or limit [m] or [rad].
    values: Floats
    #: (n,) the fraction of the segment at which this distance is smallest.
    fractions: Floats
    #: (n,) the distance as a fraction of its scale.
    normalized: Floats

    def __len__(self) -> int:
        return len(self.segments)

    def __iter__(self) -> Iterator[str]:
        columns = (self.kinds, self.values, self.fractions)
        for kind, value, fraction in zip(*(column.tolist() for column in columns), strict=True):
            name, unit = _QUANTITIES[kind]
            yield f'{value:.3g} {unit} to {name} at {100.0 * fraction:.0f} %'

    @property
    def remark(self) -> str:
        """The remark on the tightest margin of all segments."""
        row = int(np.argmin(self.normalized))
        return f'tightest margin: {self[row]} of the segment to point {self.segments[row]}'


def singularity_distance_rows(arm: Arm, q: Floats) -> Floats:
    """
    Return the distances (n, 3), all >= 0, of configurations (n, 6) [rad] from singularities.

    The columns have the order and the units of :data:`SINGULARITY_MEASURES`.
    """
    of = branch_measures(arm, q)
    return np.stack(
        (
            np.arcsin(np.minimum(1.0, np.abs(of.wrist))),
            np.arcsin(np.minimum(1.0, np.abs(of.elbow))),
            np.abs(of.shoulder),
        ),
        axis=1,
    )


def joint_limit_distances(arm: Arm, q: Floats) -> Floats:
    """Return the distances of the joints from their limits (n, 6) [rad], negative outside."""
    low, high = np.array(arm.model.position_limits).T
    distances: Floats = np.minimum(q - low, high - q)
    return distances


def normalized_margins(arm: Arm, q: Floats) -> Floats:
    """Return the smallest margin (n,) of each configuration (n, 6), as a fraction of its scale."""
    measures = singularity_distance_rows(arm, q) / _SCALES
    nearest: Floats = np.minimum(measures.min(axis=1), joint_limit_distances(arm, q).min(axis=1))
    return nearest


def first_refusal(
    joint_path: JointPath, measures: Floats, options: PlanningOptions
) -> tuple[GoalRefused | None, int]:
    """
    Return the first refusal along a path, and its segment; None, -1 = the arm can follow.

    :param measures: (n, 3) the distances from singularities at the samples of the path.
    """
    refusal, index = joint_path.refusal, joint_path.refused_segment
    near = near_singularity_refusal(joint_path, measures, options)
    # Near a singularity joints swing round, and may reach a limit. Then the refusal names the
    # singularity, which is the cause.
    if near is not None and (
        refusal is None
        or near[1] < index
        or (near[1] == index and isinstance(refusal, JointLimitExceeded))
    ):
        return near
    return refusal, index


def near_singularity_refusal(
    joint_path: JointPath, measures: Floats, options: PlanningOptions
) -> tuple[NearSingularity, int] | None:
    """
    Return the refusal of the first segment that is too close to a singularity, and its number.

    Its text has the place that is closest in relation to the bound of its singularity.

    :param measures: (n, 3) the distances from singularities at the samples of the path.
    """
    segments = joint_path.segments
    bounds = np.array(
        [float(getattr(options, measure.option)) for measure in SINGULARITY_MEASURES]
    )
    near = measures < bounds
    if not near.any():
        return None
    for segment in np.unique(segments[near.any(axis=1)]):
        rows = np.flatnonzero(segments == segment)
        near[rows] &= ~_is_leaving(joint_path, rows, measures)
        if not near[rows].any():
            continue
        row, k = min(
            ((int(r), int(c)) for r, c in np.argwhere(near[rows])),
            key=lambda at: measures[rows[at[0]], at[1]] / bounds[at[1]],
        )
        measure, bound = SINGULARITY_MEASURES[k], float(bounds[k])
        value = _format_below(float(measures[rows[row], k]), bound)
        where = describe_location(int(segment), float(joint_path.fractions[rows[row]]))
        return NearSingularity(
            f'{where} comes within {value} {measure.unit} of the {measure.name} singularity '
            f'({measure.meaning}), less than {measure.option} = {bound:g} {measure.unit}; keep '
            'away from it, use a JOINT segment, or lower the parameter.'
        ), int(segment)
    return None


def _format_below(value: float, bound: float) -> str:
    """Return a value in three digits, or in as many as show that it is below its bound."""
    text = f'{round(value, 6):.3g}'  # smaller digits are rounding errors
    return text if float(text) < bound else format_distinct(value, bound)[0]


def _is_leaving(joint_path: JointPath, rows: Indices, measures: Floats) -> Flags:
    """
    Return whether each sample of a segment is allowed to be near each singularity (n, 3).

    A goal does not determine where the robot starts. So any distance from a singularity is allowed
    close to a start at rest, and afterwards as long as the distance only grows.
    """
    number, pieces = int(joint_path.piece[rows[0]]), joint_path.pieces
    excused = np.zeros((len(rows), len(SINGULARITY_MEASURES)), dtype=np.bool_)
    rests = pieces.path.rests_at_points and not pieces.is_blend[number]
    if rests and pieces.begin[number] == 0.0:
        on_it = rows[joint_path.piece[rows] == number]
        t, (length, turn) = joint_path.t[on_it], pieces.extent(number)
        excused[: len(on_it)] = is_leaving_rows(measures[on_it], t * length, t * turn, rests=True)
    return excused


def is_leaving_rows(measures: Floats, length: Floats, angle: Floats, *, rests: bool) -> Flags:
    """
    Return whether each sample of a motion is allowed to be near each singularity (n, 3).

    :param length: (n,) the path length since the start [m].
    :param angle: (n,) the turn since the start [rad].
    :param rests: whether the motion starts at rest. If not, nearness is allowed only as long as
        the distance grows from the start on.
    """
    at_start = (rests & (length <= START_LENGTH) & (angle <= START_ANGLE))[:, None]
    grows = np.diff(measures, axis=0, prepend=0.0) >= -_ROUNDING
    excused: Flags = np.logical_and.accumulate(grows | at_start, axis=0)
    return excused


def tightest_margins(
    arm: Arm, q: Floats, measures: Floats, segments: Int32s, fractions: Floats
) -> TightestMargins:
    """
    Return the tightest margin of each segment.

    :param measures: (n, 3) the distances from singularities; infinite where a singularity does not
        matter.
    :param segments: (n,) not decreasing.
    """

    def margins(rows: Indices | slice) -> Floats:
        """Return all margins as fractions of their scales, in the order of _QUANTITIES."""
        of_joints = joint_limit_distances(arm, q[rows])
        return np.concatenate([measures[rows] / _SCALES, of_joints], axis=1)

    least = np.empty(len(q))
    for begin in range(0, len(q), _BLOCK):
        rows = slice(begin, begin + _BLOCK)
        least[rows] = reduce(np.minimum, margins(rows).T)  # many times faster than min(axis=1)
    first = first_least(least, segments)
    kinds = np.argmin(margins(first), axis=1)
    return TightestMargins(
        segments=segments[first],
        kinds=kinds,
        values=least[first] * np.append(_SCALES, np.ones(6))[kinds],
        fractions=fractions[first],
        normalized=least[first],
    )
