# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
What leads a segment, and how fast that may be.

The robot has one speed for the translation and the turn of the tool, in m/s and rad/s, which
neither may exceed; so the quantity that *leads* a segment is the larger of both numbers (for joint
moves the joint that turns farthest). Tool, joints and accelerations bound it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from ur_cartesian_driver.kinematics.robots import JOINT_NAMES, RobotModel
from ur_cartesian_driver.motion.goal import ArcMode, SegmentType
from ur_cartesian_driver.planning.leg import Leg, Pace
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.path import Arc, JointLine, SAME_POSITION
from ur_cartesian_driver.planning.validate import is_optimized

#: Where the robot stands at the first point already, the way there counts as this.
_NO_WAY = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """The largest speed of the leading quantity, what sets it, and the largest acceleration."""

    speed: float
    name: str
    acceleration: float


def measure(leg: Leg) -> tuple[float, str]:
    """
    Return the length of the leading quantity and its unit (m or rad; s for OPTIMIZED moves).

    OPTIMIZED moves are measured by the time that they would take with some joint at its limit
    everywhere.
    """
    path = leg.path
    if is_optimized(leg.kind):
        length, unit = leg.pace.whole, 's'
    elif isinstance(path, JointLine):
        length, unit = max(path.travel), 'rad'
    elif path.length >= path.angle or (isinstance(path, Arc) and path.mode == ArcMode.FIXED):
        length, unit = path.length, 'm'
    else:
        length, unit = path.angle, 'rad'
    return max(length, _NO_WAY), unit


def limits_of(leg: Leg, length: float, options: PlanningOptions, model: RobotModel) -> Limits:
    """Return what bounds the leading quantity of a leg."""
    tool = inf
    if options.max_tool_speed > 0.0 and moves(leg):
        tool = options.max_tool_speed / _tool_per_unit(leg, length)
    speed, name = tool, f'max_tool_speed = {options.max_tool_speed:g} m/s'
    if leg.kind == SegmentType.JOINT and isinstance(leg.path, JointLine):
        for k, way in enumerate(leg.path.travel):
            if way > 0.0 and model.max_joint_speed[k] * length / way < speed:
                speed = model.max_joint_speed[k] * length / way
                name = f'the limit of {JOINT_NAMES[k]}, {model.max_joint_speed[k]:.3f} rad/s'
        speed, name = _in_blends(leg, length, speed, name)
        return Limits(speed=speed, name=name, acceleration=options.max_joint_acceleration)
    if not is_optimized(leg.kind):
        least = leg.pace.time
        if least > 0.0 and length / least < speed:
            speed, name = length / least, _joint_limit(leg.pace)
    bound = options.max_linear_acceleration * length / leg.path.length if moves(leg) else inf
    if leg.path.angle > 0.0:
        bound = min(bound, options.max_angular_acceleration * length / leg.path.angle)
    return Limits(speed=speed, name=name, acceleration=bound)


def _in_blends(leg: Leg, length: float, speed: float, name: str) -> tuple[float, str]:
    """Return the bound of a joint move, whose joints may turn faster where it is blended."""
    least = leg.pace.time
    if is_blended(leg) and least > 0.0 and length / least < speed * (1.0 - 1e-9):
        return length / least, _joint_limit(leg.pace)
    return speed, name


def _joint_limit(pace: Pace) -> str:
    return (
        f'the speed limits of the joints, {JOINT_NAMES[pace.joint]} at '
        f'{100.0 * pace.fraction:.0f} % of the way'
    )


def _tool_per_unit(leg: Leg, length: float) -> float:
    """Return the most metres that the tool goes per unit of the leading quantity."""
    path = leg.path
    if is_optimized(leg.kind):  # the tool is fastest where the joints have the least to do
        length = max(leg.pace.quickest, _NO_WAY)
    uneven = path.unevenness if isinstance(path, JointLine) else 1.0
    return path.length * uneven / length


def is_blended(leg: Leg) -> bool:
    """Tell whether a leg has a corner at one of its ends."""
    return leg.before is not None or leg.after is not None


def moves(leg: Leg) -> bool:
    """Tell whether the tool's position changes; if not the leg only turns it."""
    return leg.path.length > SAME_POSITION


def speed_unit(unit: str) -> str:
    """Return the unit of speeds of a quantity in a unit."""
    return 'of the limits' if unit == 's' else f'{unit}/s'
