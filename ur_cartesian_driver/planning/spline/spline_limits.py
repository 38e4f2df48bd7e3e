# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Check the limits of tool and joints along a spline path.

A spline can only be slowed as a whole: times multiplied by f follow the same path with 1/f of the
speeds and 1/f^2 of the accelerations.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from math import ceil
from typing import NamedTuple, TypeAlias

import numpy as np

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, RobotModel
from ur_cartesian_driver.motion.errors import InvalidGoal, TooFast
from ur_cartesian_driver.motion.geometry.arrays import Floats, Indices
from ur_cartesian_driver.motion.geometry.pose_rows import length_rows
from ur_cartesian_driver.motion.goal.goal_columns import zeros
from ur_cartesian_driver.motion.plan.slow_stretch import SlowCause, SpeedLimit
from ur_cartesian_driver.planning.geometry.samples import MIN_SAMPLES
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.preflight.tcp_kinematics import TcpKinematics
from ur_cartesian_driver.planning.request.goal_fields import point_field
from ur_cartesian_driver.planning.spline.spline_path import SplinePath

_ROUNDING = 1e-6
#: A joint may come near a limit if the bound of its rate exceeds this part of the limit. The part
#: is well below 1, because the inverse of the Jacobian is computed at some places only.
_NEAR = 0.5
#: Along a spline path, these places are every _FEW-th sample.
_FEW = 3
# Fractions of a short piece at which its rates are computed, in addition to its samples.
_QUARTERS = (0.25, 0.5, 0.75)
# If a quantity may exceed its limit between samples by more than _HIGHER times the greatest excess
# at samples, the rates of its piece are computed at _DENSE steps.
_DENSE, _HIGHER = 64, 1.001
# Pieces or rows that are computed at a time, so that they stay in the cache.
_BLOCK = 1024


#: A quantity along a spline: name of the tool or joint to which it belongs, values (m,), limit,
#: power of time (1 for speeds, 2 for accelerations), unit, name of the limit, and the cause of a
#: slow tool where the limit holds.
_Quantity: TypeAlias = tuple[str, Floats, float, int, str, str, SlowCause]


@dataclass(frozen=True, slots=True, kw_only=True)
class LimitExcess:
    """The quantity that exceeds its limit most."""

    #: The tool or the joint to which the quantity belongs, as a phrase.
    what: str
    limit: float
    unit: str
    #: The name of the limit.
    name: str
    #: The factor by which all times must be multiplied to keep the limit.
    factor: float
    #: The point at the end of the segment with the greatest value of the quantity.
    point: int
    #: The time of this value, as a fraction of the segment's time.
    fraction: float
    #: The greatest value of the quantity.
    needed: float
    #: The cause of a slow tool if the times are stretched to keep the limit.
    cause: SlowCause

    @property
    def limit_text(self) -> str:
        """The name and value of the limit."""
        return f'{self.name} = {self.limit:.3f} {self.unit}'

    def refusal(self, *, may_slow: bool = True, rates: str = 'twists') -> TooFast:
        """
        Return the refusal of the goal.

        :param may_slow: whether the refusal advises to let the driver stretch the times.
        :param rates: the word for velocities in the goal's points.
        """
        return TooFast(
            point_field(self.point, 'time_from_start'),
            f'gives too little time: at {100.0 * self.fraction:.0f} % of it {self.what} needs '
            f'{self.needed:.3f} {self.unit}, more than {self.limit_text}',
            f'multiply all times by {ceil(1e3 * self.factor) / 1e3:.3f} (and adapt {rates} and '
            f'accelerations){", or set on_too_fast to slow" if may_slow else ""}',
        )

    @property
    def speed_limit(self) -> SpeedLimit:
        """The limit as a cause of a slow tool, and the segment on which it is exceeded most."""
        text = f'{self.limit_text} ({self.what}, on the segment to point {self.point})'
        return SpeedLimit(self.cause, text)

    def check_slowed(self, times: Floats, first: int, options: PlanningOptions) -> None:
        """
        Refuse times (n,) that became too long when they were stretched by ``factor``.

        :param first: the number of the point to which the first piece leads.
        :raises InvalidGoal: a piece takes too long.
        """
        durations = np.diff(times)
        longest = int(np.argmax(durations))
        if durations[longest] > options.max_segment_time:
            raise InvalidGoal(
                point_field(first + longest, 'time_from_start'),
                f'would take {durations[longest]:.0f} s because of {self.name}, more than '
                f'max_segment_time = {options.max_segment_time:.0f} s',
                'move the path away from there',
            )


def stretch_remark(factor: float, limit: SpeedLimit, duration: float) -> str:
    """Return the remark on times that are stretched by ``factor``, with the total duration."""
    return (
        f'all times are stretched by {factor:.4g}, because of {limit.text}: {duration:.3f} s '
        'in total'
    )


class Rates(NamedTuple):
    """The rates of tool and joints at m places of a spline, each (m, 6)."""

    #: Twists and accelerations of the tool in the frame of the path.
    twists: Floats
    accelerations: Floats
    #: Joint velocities [rad/s] and accelerations [rad/s^2].
    qd: Floats
    qdd: Floats
    #: (m,) speeds of the TCP in base [m/s], if the frame of the path moves.
    carrier: Floats | None = None


def worst_excess(
    kinematics: TcpKinematics, path: SplinePath, options: PlanningOptions
) -> LimitExcess | None:
    """Return the quantity along a path that exceeds its limit most; None if none does."""
    sampled, durations = path.piece + path.u, np.diff(path.spline.times)
    model = kinematics.arm.model
    joint_speeds = np.abs(np.diff(path.q, axis=0)) / np.diff(path.times)[:, None]
    is_near = bool((joint_speeds > _NEAR * np.array(model.max_joint_speed)).any())
    if not is_near:
        speeds, accelerations = (
            (float(length_rows(rows[:, :3]).max()), float(length_rows(rows[:, 3:]).max()))
            for rows in path.spline.rates(path.piece, path.u * durations[path.piece])
        )
        is_near = may_near_limits(kinematics, path.q[::_FEW], speeds, accelerations, options)

    def rates(piece: Indices, u: Floats) -> Rates:
        tool = path.spline.rates(piece, u * durations[piece])
        if not is_near:
            return Rates(*tool, zeros(len(u)), zeros(len(u)))
        q = np.stack([np.interp(piece + u, sampled, joint) for joint in path.q.T], axis=1)
        qd, qdd = kinematics.joint_rates(q, *tool)
        return Rates(*tool, qd, qdd, kinematics.carrier_speeds(q, qd))

    return worst_excess_between(rates, path.piece, path.u, path.first, model, options)


def may_near_limits(
    kinematics: TcpKinematics,
    q: Floats,
    rates: tuple[float, float],
    accelerations: tuple[float, float],
    options: PlanningOptions,
) -> bool:
    """
    Return whether a joint may come near a limit in one of the configurations (n, 6) [rad].

    The inverse of the Jacobian turns bounds on the rates of the tool into bounds on the joint
    rates. If the frame of the path moves, the result is always True, because the speed of the TCP
    in base is limited, too, and follows from the joint rates.

    :param rates: greatest speed and turn rate of the tool [m/s], [rad/s].
    :param accelerations: likewise [m/s^2], [rad/s^2].
    """
    if kinematics.frame_moves:
        return True
    model = kinematics.arm.model
    for k in range(0, len(q), _BLOCK):
        qd, qdd = kinematics.largest_joint_rates(q[k : k + _BLOCK], rates, accelerations)
        speeds = qd / model.max_joint_speed
        if max(speeds.max(), qdd.max() / options.max_joint_acceleration) > _NEAR:
            return True
    return False


def worst_excess_between(
    rates: Callable[[Indices, Floats], Rates],
    piece: Indices,
    u: Floats,
    first: int,
    model: RobotModel,
    options: PlanningOptions,
) -> LimitExcess | None:
    """
    Return the quantity that exceeds its limit most, also between samples; None if none does.

    :param rates: returns the rates at fractions (m,) of the times of pieces (m,).
    :param piece: (n,) pieces of samples that follow the path closely; ``u``: (n,) the fractions.
    :param first: the number of the point at the end of the first piece.
    """
    count = np.bincount(piece)
    short = np.flatnonzero(count < MIN_SAMPLES)
    # Accelerations jump between cubic pieces, so the start of each piece is added; on quintic
    # pieces they peak near the quarters, which are added to short pieces.
    later, inner = np.arange(1, len(count)), np.array(_QUARTERS)
    piece = np.concatenate([piece, later, np.repeat(short, len(inner))])
    u = np.concatenate([u, np.zeros(len(later)), np.tile(inner, len(short))])
    order = np.lexsort((u, piece))
    piece, u = piece[order], u[order]
    sampled = rates(piece, u)
    found = _worst_excess_at(sampled, first + piece, u, model, options)
    possible = np.zeros(len(piece))
    for _, values, limit, power, *_ in _quantities(sampled, model, options):
        factors = (_possible_peaks(values, piece) / limit) ** (1.0 / power)
        possible = np.maximum(possible, factors)
    high = np.unique(piece[possible > _HIGHER * (found.factor if found else 1.0)])
    dense = np.linspace(0.0, 1.0, _DENSE + 1)
    for begin in range(0, len(high), _BLOCK):
        piece = np.repeat(high[begin : begin + _BLOCK], len(dense))
        u = np.tile(dense, len(piece) // len(dense))
        between = _worst_excess_at(rates(piece, u), first + piece, u, model, options)
        if between and (not found or between.factor > found.factor):
            found = between
    return found


def _possible_peaks(values: Floats, piece: Indices) -> Floats:
    """
    Return upper bounds (n,) of a quantity around each sample of pieces (n,).

    A parabola through three samples exceeds them by at most an eighth of their second difference;
    a quarter is used as a safe bound.
    """
    bend = np.zeros(len(values))
    bend[1:-1] = np.abs(values[2:] - 2.0 * values[1:-1] + values[:-2])
    bend[1:-1][piece[2:] != piece[:-2]] = 0.0
    around = np.maximum(bend, np.maximum(np.append(bend[1:], 0.0), np.append(0.0, bend[:-1])))
    peaks: Floats = values + 0.25 * around
    return peaks


def _worst_excess_at(
    rates: Rates, points: Indices, u: Floats, model: RobotModel, options: PlanningOptions
) -> LimitExcess | None:
    """
    Return the quantity that exceeds its limit most at m places; None if none does.

    :param points: (m,) the number of the point at the end of each place's piece.
    :param u: (m,) the fraction of the piece's time.
    """
    worst: LimitExcess | None = None
    for what, values, limit, power, unit, name, cause in _quantities(rates, model, options):
        row = int(np.argmax(values))
        peak = float(values[row])
        factor = (peak / limit) ** (1.0 / power)
        if factor > max(1.0 + _ROUNDING, worst.factor if worst else 0.0):
            worst = LimitExcess(
                what=what,
                limit=limit,
                unit=unit,
                name=name,
                factor=factor,
                point=int(points[row]),
                fraction=float(u[row]),
                needed=peak,
                cause=cause,
            )
    return worst


def _quantities(rates: Rates, model: RobotModel, options: PlanningOptions) -> Iterator[_Quantity]:
    if options.max_tool_speed > 0.0:
        speed = length_rows(rates.twists[:, :3])
        limit, name = options.max_tool_speed, 'max_tool_speed'
        yield 'the tool', speed, limit, 1, 'm/s', name, SlowCause.TOOL_LIMIT
        if rates.carrier is not None:
            yield 'the held part', rates.carrier, limit, 1, 'm/s', name, SlowCause.TOOL_LIMIT
    cause = SlowCause.ACCELERATION_LIMIT
    for part, name, unit in (
        (slice(0, 3), 'max_linear_acceleration', 'm/s^2'),
        (slice(3, 6), 'max_angular_acceleration', 'rad/s^2'),
    ):
        values = length_rows(rates.accelerations[:, part])
        yield 'the tool', values, getattr(options, name), 2, unit, name, cause
    bound, name = options.max_joint_acceleration, 'max_joint_acceleration'
    cause = SlowCause.JOINT_LIMIT
    for k, (joint, limit) in enumerate(zip(JOINT_NAMES, model.max_joint_speed, strict=True)):
        source = f'the joint speed limit{model.speed_source(k)}'
        yield joint, np.abs(rates.qd[:, k]), limit, 1, 'rad/s', source, cause
        yield joint, np.abs(rates.qdd[:, k]), bound, 2, 'rad/s^2', name, cause
