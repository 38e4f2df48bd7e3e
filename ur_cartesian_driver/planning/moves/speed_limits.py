# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The leading quantity of a segment and its speed limits.

The robot has one speed for the translation [m/s] and the turn [rad/s] of the tool, which neither
may exceed; so the larger of both numbers *leads* a segment (for joint moves the joint that turns
farthest). Tool, joints and accelerations bound it.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, RobotModel
from ur_cartesian_driver.motion.goal import ArcMode, SegmentType
from ur_cartesian_driver.planning.geometry.curves import ArcCurve, JointLineCurve, SAME_POSITION
from ur_cartesian_driver.planning.moves.segment_data import JointSpeedBound, SegmentGeometry
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.planning.request.goal_fields import is_optimized

#: Length of a segment to a first point where the robot already is.
_MIN_LENGTH = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedLimits:
    """Maximum speed of the leading quantity, what sets it, and the maximum acceleration."""

    speed: float
    name: str
    acceleration: float


def leading_quantity(geometry: SegmentGeometry) -> tuple[float, str]:
    """
    Return the length of the leading quantity and its unit (m or rad; s for OPTIMIZED moves).

    The length of an OPTIMIZED move is its time with some joint at its limit everywhere.
    """
    path = geometry.curve
    if is_optimized(geometry.kind):
        length, unit = geometry.speed_bound.time_at_limits, 's'
    elif isinstance(path, JointLineCurve):
        length, unit = max(path.travel), 'rad'
    elif path.length >= path.angle or (isinstance(path, ArcCurve) and path.mode == ArcMode.FIXED):
        length, unit = path.length, 'm'
    else:
        length, unit = path.angle, 'rad'
    return max(length, _MIN_LENGTH), unit


def speed_limits(
    geometry: SegmentGeometry, length: float, options: PlanningOptions, model: RobotModel
) -> SpeedLimits:
    """Return the limits of the leading quantity of a segment."""
    tool = inf
    if options.max_tool_speed > 0.0 and translates(geometry):
        tool = options.max_tool_speed / _tool_travel_per_unit(geometry, length)
    speed, name = tool, f'max_tool_speed = {options.max_tool_speed:g} m/s'
    if geometry.kind == SegmentType.JOINT and isinstance(geometry.curve, JointLineCurve):
        for k, travel_of_joint in enumerate(geometry.curve.travel):
            if (
                travel_of_joint > 0.0
                and model.max_joint_speed[k] * length / travel_of_joint < speed
            ):
                speed = model.max_joint_speed[k] * length / travel_of_joint
                name = (
                    f'the speed limit of {JOINT_NAMES[k]}, {model.max_joint_speed[k]:.3f} rad/s'
                    f'{model.speed_source(k)}'
                )
        return SpeedLimits(speed=speed, name=name, acceleration=options.max_joint_acceleration)
    if not is_optimized(geometry.kind):
        min_time = geometry.speed_bound.time
        if min_time > 0.0 and length / min_time < speed:
            speed, name = length / min_time, _joint_limit(geometry.speed_bound, model)
    bound = (
        options.max_linear_acceleration * length / geometry.curve.length
        if translates(geometry)
        else inf
    )
    if geometry.curve.angle > 0.0:
        bound = min(bound, options.max_angular_acceleration * length / geometry.curve.angle)
    # Where the robot turns the tool faster than it moves it, it gets ahead of the turn.
    faster = 1.0
    if geometry.kind in (SegmentType.CIRCULAR, SegmentType.PROCESS):
        turn = min(geometry.curve.angle, length)  # a FIXED arc turns the tool by its angle
        faster = min(1.0, max(geometry.curve.length, turn / options.turn_ratio) / length)
    return SpeedLimits(speed=speed * faster, name=name, acceleration=bound * faster)


def _joint_limit(speed_bound: JointSpeedBound, model: RobotModel) -> str:
    joint = speed_bound.joint
    return (
        f'the joint speed limits ({JOINT_NAMES[joint]} at {100.0 * speed_bound.fraction:.0f} % of '
        f'the segment{model.speed_source(joint)})'
    )


def _tool_travel_per_unit(geometry: SegmentGeometry, length: float) -> float:
    """Return the maximum distance of the tool [m] per unit of the leading quantity."""
    path = geometry.curve
    if is_optimized(geometry.kind):  # the tool is fastest where the joints turn least
        length = max(geometry.speed_bound.shortest_time, _MIN_LENGTH)
    uneven = path.unevenness if isinstance(path, JointLineCurve) else 1.0
    return path.length * uneven / length


def is_blended(geometry: SegmentGeometry) -> bool:
    """Tell whether a segment has a blend at one of its ends."""
    return geometry.blend_before is not None or geometry.blend_after is not None


def translates(geometry: SegmentGeometry) -> bool:
    """Tell whether the tool's position changes; if not, the segment only turns it."""
    return geometry.curve.length > SAME_POSITION


def speed_unit(unit: str) -> str:
    """Return the unit of speeds of a quantity in a unit."""
    return 'of the limits' if unit == 's' else f'{unit}/s'
