# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The robots: geometry and limits of every model, in one table.

All arms have the same shape; the models differ in six lengths::

    i   theta   d    a    alpha
    1   0       d1   0    pi/2     shoulder pan
    2   0       0    a2   0        shoulder lift
    3   0       0    a3   0        elbow
    4   0       d4   0    pi/2     wrist 1
    5   0       d5   0    -pi/2    wrist 2
    6   0       d6   0    0        wrist 3, ends in the flange

in the distal Denavit-Hartenberg convention, link i = Rz(theta + q) Tz(d) Tx(a) Rx(alpha), from
the manufacturer's base frame (``base`` in ROS; ``base_link`` is turned by pi about z) to the tool
flange (``tool0``). A real arm differs from its model by a few millimetres; it reports its own
table, in which all 24 numbers may differ.

Sources: Universal Robots publishes the lengths in its article on DH parameters and in the
configuration files of its ROS 2 description package; speeds and torques are from the latter. UR7e
and UR12e have the mechanics of UR5e and UR10e.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import inf, isfinite, pi, radians
from types import MappingProxyType
from typing import TypeAlias

from ur_cartesian_driver.motion.geometry.vectors import Vector6, vector6

PositionLimits: TypeAlias = tuple[tuple[float, float], ...]

#: The joints in the order of the kinematic chain, named as the UR ROS 2 driver names them.
JOINT_NAMES = (
    'shoulder_pan_joint',
    'shoulder_lift_joint',
    'elbow_joint',
    'wrist_1_joint',
    'wrist_2_joint',
    'wrist_3_joint',
)

_ZERO: Vector6 = (0.0,) * 6
_ALPHA: Vector6 = (pi / 2, 0.0, 0.0, pi / 2, -pi / 2, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class DhTable:
    """
    A Denavit-Hartenberg table: a, d [m], alpha, theta [rad], one number for each joint.

    :raises ValueError: a column does not have six finite numbers.
    """

    a: Vector6
    d: Vector6
    alpha: Vector6 = _ALPHA
    theta: Vector6 = _ZERO

    def __post_init__(self) -> None:
        """Check that the table is complete."""
        for name, column in self.columns().items():
            if len(column) != 6 or not all(isfinite(value) for value in column):
                raise ValueError(
                    f'The column {name} of a DH table must hold six finite numbers, one for each '
                    f'joint, not {column!r}.'
                )

    def columns(self) -> dict[str, Vector6]:
        """Return the four columns by name."""
        return {'a': self.a, 'd': self.d, 'alpha': self.alpha, 'theta': self.theta}

    def difference(self, other: DhTable) -> float:
        """Return the largest difference between corresponding numbers of two tables [m or rad]."""
        return max(
            abs(mine - theirs)
            for name, column in self.columns().items()
            for mine, theirs in zip(column, other.columns()[name], strict=True)
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class JointLimits:
    """The limits of the joints as a controller reports them."""

    #: Lowest and highest position of each joint [rad].
    position: PositionLimits
    #: Largest speed of each joint [rad/s].
    speed: Vector6


#: The clause that error messages add to a limit that is tighter than the model's.
REPORTED = ', which the controller reports in its configuration'
#: A limit is tighter than another one only if they differ by more than this [rad], [rad/s].
_ROUNDING = 1e-4


@dataclass(frozen=True, slots=True)
class RobotModel:
    """One model of the product line."""

    name: str
    #: Generation of the controller: ``CB3``, ``e`` or ``UR``.
    series: str
    #: The table of an arm without calibration.
    geometry: DhTable
    #: Lowest and highest position of each joint [rad], infinite if the joint turns endlessly.
    position_limits: PositionLimits
    #: Largest speed of each joint [rad/s]. For ur15, ur18 and ur8long no speed is published: they
    #: have the speeds of the ur20, the lowest of the series.
    max_joint_speed: Vector6
    #: Largest torque of each joint [Nm]; None = not published.
    max_joint_torque: Vector6 | None
    #: Largest payload [kg].
    payload: float
    #: Reach in the data sheet, from the shoulder to the centre of the wrist [m].
    max_reach: float
    #: Number of the robot type in the configuration data that the primary interface sends.
    wire_type: int
    #: The joints for which the controller reports a tighter range than the model's.
    reported_ranges: frozenset[int] = frozenset()
    #: The joints for which the controller reports a lower speed than the model's.
    reported_speeds: frozenset[int] = frozenset()

    def limited_to(self, limits: JointLimits) -> RobotModel:
        """
        Return the model with those limits of a controller that are tighter than the model's.

        Limits that no joint can have (an empty range, no speed, NaN) are ignored.
        """
        ranges, speeds = list(self.position_limits), list(self.max_joint_speed)
        for k, (low, high) in enumerate(limits.position):
            own_low, own_high = self.position_limits[k]
            tighter = max(low, own_low), min(high, own_high)
            if tighter[0] < tighter[1] and (
                low > own_low + _ROUNDING or high < own_high - _ROUNDING
            ):
                ranges[k] = tighter
        for k, speed in enumerate(limits.speed):
            if 0.0 < speed < self.max_joint_speed[k] - _ROUNDING:
                speeds[k] = speed
        return replace(
            self,
            position_limits=tuple(ranges),
            max_joint_speed=vector6(speeds),
            reported_ranges=frozenset(k for k in range(6) if ranges[k] != self.position_limits[k]),
            reported_speeds=frozenset(k for k in range(6) if speeds[k] != self.max_joint_speed[k]),
        )

    def range_text(self, joint: int) -> str:
        """Return the range of a joint, with its source if that is the controller."""
        low, high = self.position_limits[joint]
        return f'{low:.4f} to {high:.4f} rad{REPORTED if joint in self.reported_ranges else ""}'

    def speed_source(self, joint: int) -> str:
        """Return the source of a joint's speed limit, as a clause; empty = the model."""
        return REPORTED if joint in self.reported_speeds else ''

    @property
    def control_cycle(self) -> float:
        """The cycle time of the controller [s]."""
        return 0.008 if self.series == 'CB3' else 0.002


def dh_table(d1: float, a2: float, a3: float, d4: float, d5: float, d6: float) -> DhTable:
    """Return the table of an arm without calibration from its six lengths [m]."""
    return DhTable(a=(0.0, a2, a3, 0.0, 0.0, 0.0), d=(d1, 0.0, 0.0, d4, d5, d6))


def _degrees(j1: float, j2: float, j3: float, wrist: float) -> Vector6:
    return (radians(j1), radians(j2), radians(j3), radians(wrist), radians(wrist), radians(wrist))


def _torques(j1: float, j2: float, j3: float, wrist: float) -> Vector6:
    return (j1, j2, j3, wrist, wrist, wrist)


_TURN = (-2 * pi, 2 * pi)
#: Joint positions larger than this [rad] in users' input must be mistakes, such as degrees.
MAX_JOINT_VALUE = 8.0 * pi
_LIMITS: PositionLimits = (_TURN,) * 6
_ENDLESS_WRIST: PositionLimits = (_TURN,) * 5 + ((-inf, inf),)

# Joint speeds: shoulder pan, shoulder lift, elbow, each wrist joint [degrees/s].
_SPEED_3 = _degrees(180, 180, 180, 360)
_SPEED_5 = _degrees(180, 180, 180, 180)
_SPEED_10 = _degrees(120, 120, 180, 180)
_SPEED_20 = _degrees(120, 120, 150, 210)

# Joint torques in the same order [Nm].
_TORQUE_3 = _torques(56, 56, 28, 12)
_TORQUE_3E = _torques(54, 54, 28, 9)
_TORQUE_5 = _torques(150, 150, 150, 28)
_TORQUE_10 = _torques(330, 330, 150, 56)
_TORQUE_10E = _torques(330, 330, 150, 54)
_TORQUE_20 = _torques(738, 738, 433, 107)

# Models that share all their lengths.
_UR5E = dh_table(0.1625, -0.425, -0.3922, 0.1333, 0.0997, 0.0996)
_UR10E = dh_table(0.1807, -0.6127, -0.57155, 0.17415, 0.11985, 0.11655)

# fmt: off
#       name       series  d1        a2        a3        d4        d5       d6
_TABLE = (
    # CB3
    ('ur3',     'CB3', dh_table(0.1519,   -0.24365, -0.21325, 0.11235,  0.08535, 0.0819),
     _ENDLESS_WRIST, _SPEED_3,  _TORQUE_3,   3.0,  0.500, 3),
    ('ur5',     'CB3', dh_table(0.089159, -0.425,   -0.39225, 0.10915,  0.09465, 0.0823),
     _LIMITS,        _SPEED_5,  _TORQUE_5,   5.0,  0.850, 1),
    ('ur10',    'CB3', dh_table(0.1273,   -0.612,   -0.5723,  0.163941, 0.1157,  0.0922),
     _LIMITS,        _SPEED_10, _TORQUE_10,  10.0, 1.300, 2),
    # e-Series
    ('ur3e',    'e',   dh_table(0.15185,  -0.24355, -0.2132,  0.13105,  0.08535, 0.0921),
     _ENDLESS_WRIST, _SPEED_3,  _TORQUE_3E,  3.0,  0.500, 3),
    ('ur5e',    'e',   _UR5E,
     _LIMITS,        _SPEED_5,  _TORQUE_5,   5.0,  0.850, 1),
    ('ur7e',    'e',   _UR5E,
     _LIMITS,        _SPEED_5,  _TORQUE_5,   7.5,  0.850, 1),
    ('ur10e',   'e',   _UR10E,
     _LIMITS,        _SPEED_10, _TORQUE_10E, 12.5, 1.300, 2),
    ('ur12e',   'e',   _UR10E,
     _LIMITS,        _SPEED_10, _TORQUE_10E, 12.5, 1.300, 2),
    ('ur16e',   'e',   dh_table(0.1807,   -0.4784,  -0.36,    0.17415,  0.11985, 0.11655),
     _LIMITS,        _SPEED_10, _TORQUE_10E, 16.0, 0.900, 4),
    # UR Series
    ('ur15',    'UR',  dh_table(0.2186,   -0.6475,  -0.5164,  0.1824,   0.1361,  0.1434),
     _LIMITS,        _SPEED_20, None,        15.0, 1.300, 9),
    ('ur18',    'UR',  dh_table(0.2186,   -0.475,   -0.3389,  0.1824,   0.1361,  0.1434),
     _LIMITS,        _SPEED_20, None,        18.0, 0.950, 5),
    ('ur8long', 'UR',  dh_table(0.2186,   -0.8989,  -0.7149,  0.1824,   0.1361,  0.1434),
     _LIMITS,        _SPEED_20, None,        8.0,  1.750, 6),
    ('ur20',    'UR',  dh_table(0.2363,   -0.862,   -0.7287,  0.201,    0.1593,  0.1543),
     _LIMITS,        _SPEED_20, _TORQUE_20,  20.0, 1.750, 7),
    ('ur30',    'UR',  dh_table(0.2363,   -0.637,   -0.5037,  0.201,    0.1593,  0.1543),
     _LIMITS,        _SPEED_20, _TORQUE_20,  30.0, 1.300, 8),
)
# fmt: on

#: Every model by its name, as the UR ROS 2 driver spells it in ``ur_type``.
MODELS: Mapping[str, RobotModel] = MappingProxyType({row[0]: RobotModel(*row) for row in _TABLE})


def robot_model(name: str) -> RobotModel:
    """
    Return the model with a name such as ``ur5e``.

    :raises ValueError: there is no such model; the text lists all models.
    """
    try:
        return MODELS[name]
    except KeyError:
        raise ValueError(
            f'There is no robot model {name!r}; use one of {", ".join(MODELS)}.'
        ) from None
