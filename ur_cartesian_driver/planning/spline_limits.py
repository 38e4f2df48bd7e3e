# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Whether tool and joints keep their limits along a spline, whose speed is known at each place.

What is too fast can be slowed only as a whole: in f times the time the same way is gone with 1/f
of the speeds and 1/f^2 of the accelerations.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np

from ur_cartesian_driver.kinematics.rates import joint_rates
from ur_cartesian_driver.kinematics.robots import JOINT_NAMES
from ur_cartesian_driver.motion.errors import TooFast
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.pose_rows import Floats
from ur_cartesian_driver.planning.postures import Reach
from ur_cartesian_driver.planning.spline_way import SplineWay
from ur_cartesian_driver.planning.validate import point_field

_ROUNDING = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class Excess:
    """What exceeds its limit by most."""

    #: How many times the time would be enough.
    factor: float
    #: The point on the way to which it does, and the share of the time to it.
    point: int
    fraction: float
    #: What it is, the most that is needed, what is allowed, and the unit of both.
    what: str
    needed: float
    allowed: float
    unit: str
    #: Which limit.
    name: str

    def refusal(self, *, may_slow: bool = True) -> TooFast:
        """
        Return the refusal of the goal.

        :param may_slow: whether the driver could give it more time.
        """
        return TooFast(
            point_field(self.point, 'time_from_start'),
            f'gives too little time: after {100.0 * self.fraction:.0f} % of it {self.what} needs '
            f'{self.needed:.3f} {self.unit}, and allowed are {self.allowed:.3f} {self.unit} '
            f'({self.name})',
            f'give all points {ceil(1e3 * self.factor) / 1e3:.3f} times the time (and twists and '
            f'accelerations to match){", or set on_too_fast to slow" if may_slow else ""}',
        )


@dataclass(frozen=True, slots=True)
class _Quantity:
    what: str
    #: (m,) its values, the limit, and 1 for speeds, 2 for accelerations.
    values: Floats
    limit: float
    power: int
    unit: str
    name: str


def excess(reach: Reach, way: SplineWay, options: PlanningOptions) -> Excess | None:
    """Return what exceeds its limit by most on a way, None if nothing does."""
    found: Excess | None = None
    for quantity in _quantities(reach, way, options):
        row = int(np.argmax(quantity.values))
        most = float(quantity.values[row])
        factor = (most / quantity.limit) ** (1.0 / quantity.power)
        if factor > max(1.0 + _ROUNDING, found.factor if found else 0.0):
            found = Excess(
                factor=factor,
                point=int(way.points[row]),
                fraction=float(way.u[row]),
                what=quantity.what,
                needed=most,
                allowed=quantity.limit,
                unit=quantity.unit,
                name=quantity.name,
            )
    return found


def _quantities(reach: Reach, way: SplineWay, options: PlanningOptions) -> Iterator[_Quantity]:
    begin, end = way.spline.times[way.piece], way.spline.times[way.piece + 1]
    tool = way.spline.rows(way.piece, way.u * (end - begin))
    qd, qdd = joint_rates(reach.arm, reach.T_flange_tcp, way.q, tool.twists, tool.accelerations)
    if options.max_tool_speed > 0.0:
        yield _Quantity(
            'the tool',
            _norms(tool.twists[:, :3]),
            options.max_tool_speed,
            1,
            'm/s',
            'max_tool_speed',
        )
    yield _Quantity(
        'the tool',
        _norms(tool.accelerations[:, :3]),
        options.max_linear_acceleration,
        2,
        'm/s^2',
        'max_linear_acceleration',
    )
    yield _Quantity(
        'the tool',
        _norms(tool.accelerations[:, 3:]),
        options.max_angular_acceleration,
        2,
        'rad/s^2',
        'max_angular_acceleration',
    )
    for k, (name, limit) in enumerate(
        zip(JOINT_NAMES, reach.arm.model.max_joint_speed, strict=True)
    ):
        yield _Quantity(name, np.abs(qd[:, k]), limit, 1, 'rad/s', 'the limit of the joint')
        yield _Quantity(
            name,
            np.abs(qdd[:, k]),
            options.max_joint_acceleration,
            2,
            'rad/s^2',
            'max_joint_acceleration',
        )


def _norms(vectors: Floats) -> Floats:
    lengths: Floats = np.linalg.norm(vectors, axis=1)
    return lengths
