# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of planning: bounds, defaults and what to do where a goal exceeds a bound."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from typing import get_args, Literal, TypeAlias

from ur_cartesian_driver.motion.geometry.workspace import parse_planes
from ur_cartesian_driver.motion.goal.declared_types import declare_types
from ur_cartesian_driver.motion.goal.output_names import parse_safe_outputs
from ur_cartesian_driver.program.prelude import NO_PRELUDE, Prelude
from ur_cartesian_driver.protocol.program.wire_dialects import Dialect, NEWEST_DIALECT

#: The wire carries joint positions no finer than this [m].
MIN_SPLINE_TOLERANCE = 1e-6

Choice: TypeAlias = Literal['refuse', 'slow']
PostureChoice: TypeAlias = Literal['refuse', 'movej']
CollisionChoice: TypeAlias = Literal['off', 'warn', 'refuse', 'auto']
_CHOICES = {
    'on_too_fast': Choice,
    'on_posture_change': PostureChoice,
    'self_collision': CollisionChoice,
}
#: Options that must not be 0.
_POSITIVE = (
    *(
        f'{quantity}_{rate}'
        for quantity in ('linear', 'angular', 'joint', 'optimized')
        for rate in ('velocity', 'acceleration')
    ),
    'keep_open_deceleration',
    'live_target_linear_velocity',
    'live_target_linear_acceleration',
    'live_target_angular_velocity',
    'live_target_angular_acceleration',
    'live_target_joint_velocity',
    'live_target_max_age',
    'live_target_timeout',
)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanningOptions:
    """
    The parameters of planning, with the defaults of ``config/driver.yaml``.

    :raises ValueError: an option is not in its range.
    """

    #: Maximum number of points.
    max_points: int = 100_000
    #: Maximum age of ``header.stamp`` on receipt [s].
    stamp_tolerance: float = 1.0
    #: How far the robot may be from a first point at time 0 [m], [rad].
    start_tolerance_position: float = 0.001
    start_tolerance_angle: float = 0.01
    #: Maximum distance of the tool to the first point [m]; 0 = no bound.
    max_approach_distance: float = 0.5
    #: Maximum speed of the TCP [m/s]; 0 = no bound.
    max_tool_speed: float = 0.25
    #: What to do with a goal whose times need more speed than the limits allow.
    on_too_fast: Choice = 'refuse'
    #: What to do with a line or an arc that cannot arrive in the requested posture, or that the
    #: arm cannot follow although it can reach the end.
    on_posture_change: PostureChoice = 'refuse'
    #: What to do where the arm comes too close to itself; auto: refuse for the models that have
    #: meshes, warn for the others.
    self_collision: CollisionChoice = 'auto'
    #: Minimum distance of the arm to itself [m].
    min_clearance: float = 0.005
    #: Radius of a tool between the flange and the TCP, for these checks [m]; 0 = none.
    tool_radius: float = 0.0
    #: Planes that the arm must not cross, each 'name x y z nx ny nz [margin]' in base [m].
    workspace_planes: tuple[str, ...] = ()
    #: Values that outputs take when a motion does not go on as planned, each 'kind pin value
    #: [current | voltage] [restore]'.
    safe_outputs: tuple[str, ...] = ()
    #: How close a line or an arc may come to a singularity: angle of wrist 2 [rad], angle of the
    #: elbow [rad], distance of the wrist centre from the plane of axes 1 and 2 [m]; 0 = off.
    singularity_margin_wrist: float = 0.05
    singularity_margin_elbow: float = 0.05
    singularity_margin_shoulder: float = 0.02
    #: Whether a goal may set a temporary TCP.
    allow_tcp_change: bool = True
    #: Whether the kinematics is the robot's calibrated one; if not, arcs are sent as poses.
    calibration_known: bool = True
    #: Whether the robot's software has OPTIMIZED moves (PolyScope 5.21, PolyScope X 10.8).
    optimove_known: bool = True
    #: Whether it has path offsets of its own (PolyScope 5 from 5.6 on).
    path_offset_known: bool = True
    #: Whether the robot reports TCP accelerations; if not, tolerances on them are refused.
    acceleration_known: bool = True
    #: The wire dialect of the robot program.
    dialect: Dialect = NEWEST_DIALECT
    #: The functions of others that it contains.
    prelude: Prelude = NO_PRELUDE
    #: Prefix of the joint names in postures.
    tf_prefix: str = ''

    #: Path tolerances on axes for which the goal gives none; 0 = no limit: [m], [rad], [m/s],
    #: [rad/s], [m/s^2], [rad/s^2].
    path_tolerance_position: float = 0.0
    path_tolerance_orientation: float = 0.0
    path_tolerance_linear_velocity: float = 0.0
    path_tolerance_angular_velocity: float = 0.0
    path_tolerance_linear_acceleration: float = 0.0
    path_tolerance_angular_acceleration: float = 0.0
    #: The same of the goal tolerances.
    goal_tolerance_position: float = 0.0
    goal_tolerance_orientation: float = 0.0
    goal_tolerance_linear_velocity: float = 0.0
    goal_tolerance_angular_velocity: float = 0.0
    goal_tolerance_linear_acceleration: float = 0.0
    goal_tolerance_angular_acceleration: float = 0.0

    #: How fast the robot turns the tool on a line for each m/s of its speed [rad/s]: 4 was
    #: recorded once, 1 is the manual's word. Limits hold for both where a time is sent.
    turn_ratio: float = 4.0

    #: Defaults of speed and acceleration: tool [m/s], [m/s^2],
    linear_velocity: float = 0.1
    linear_acceleration: float = 0.5
    #: rotation of the tool [rad/s], [rad/s^2],
    angular_velocity: float = 0.5
    angular_acceleration: float = 1.0
    #: leading joint of joint moves [rad/s], [rad/s^2],
    joint_velocity: float = 0.5
    joint_acceleration: float = 1.0
    #: fractions of the robot's limits in OPTIMIZED moves, (0, 1].
    optimized_velocity: float = 0.3
    optimized_acceleration: float = 0.3

    #: Live targets: limits of the tool [m/s], [m/s^2], [rad/s], [rad/s^2] and of every joint
    #: [rad/s],
    live_target_linear_velocity: float = 0.25
    live_target_linear_acceleration: float = 1.0
    live_target_angular_velocity: float = 1.0
    live_target_angular_acceleration: float = 4.0
    live_target_joint_velocity: float = 1.5
    #: maximum age of a target, and time after the last one at which the session ends [s].
    live_target_max_age: float = 0.2
    live_target_timeout: float = 2.0

    #: Maximum accelerations that follow from times [m/s^2], [rad/s^2], [rad/s^2].
    max_linear_acceleration: float = 10.0
    max_angular_acceleration: float = 40.0
    max_joint_acceleration: float = 40.0
    #: SPLINE and SERVO: how far the tool may deviate from the curve through the points [m]; a turn
    #: counts as its arc at 0.1 m.
    spline_tolerance: float = 0.00005
    #: Deceleration of the fastest joint where no more points are appended [rad/s^2].
    keep_open_deceleration: float = 4.0
    #: Maximum time of a segment [s]; the wire carries (2^31 - 1) us.
    max_segment_time: float = 2147.483647

    def __post_init__(self) -> None:
        """Check types and ranges."""
        declare_types(self)
        for name in self.__slots__:
            value = getattr(self, name)
            if isinstance(value, float) and (not isfinite(value) or value < 0.0):
                raise ValueError(f'{name} is {value}; it must be finite and not negative')
        for name in _POSITIVE:
            if getattr(self, name) == 0.0:
                raise ValueError(f'{name} is 0; it must be positive')
        for name in ('optimized_velocity', 'optimized_acceleration'):
            if getattr(self, name) > 1.0:
                raise ValueError(f'{name} is {getattr(self, name)}; it must not exceed 1')
        for name, choices in _CHOICES.items():
            value = getattr(self, name)
            if value not in get_args(choices):
                *others, last = (repr(choice) for choice in get_args(choices))
                raise ValueError(f'{name} is {value!r}; it must be {", ".join(others)} or {last}')
        if self.spline_tolerance < MIN_SPLINE_TOLERANCE:
            raise ValueError(
                f'spline_tolerance is {self.spline_tolerance}; it must be at least '
                f'{MIN_SPLINE_TOLERANCE:g} m'
            )
        if self.max_segment_time > NEWEST_DIALECT.max_duration:
            raise ValueError(
                f'max_segment_time is {self.max_segment_time}; at most '
                f'{NEWEST_DIALECT.max_duration} s can be sent'
            )
        parse_planes(self.workspace_planes)
        parse_safe_outputs(self.safe_outputs)
        if self.max_points < 1:
            raise ValueError(f'max_points is {self.max_points}; it must be at least 1')
