# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
From where the tool is to the newest target, one set-point for each control cycle.

A target that sensors correct comes when it comes, jumps, and may be anywhere. What the arm does
with it must not: the tool goes straight towards the newest target with bounded speed and
acceleration, brakes in time to arrive at rest, and never goes where it could not stop. For that
each cycle looks at two places: the next one, and the one where the tool would rest if it braked
from there. Is the second one out of reach, beyond a limit of a joint, too near to a singularity
or behind a workspace plane, the arm brakes instead, on a way that earlier cycles have looked at.

Time comes in as the length of a cycle; nobody here knows a clock.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, hypot, inf, isfinite, sin, sqrt

from ur_cartesian_driver.execution.live.workspace_guard import LiveWorkspace, WorkspaceGuard
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import explain_unreachable
from ur_cartesian_driver.kinematics.inverse_incremental import singularity_distances, track_pose
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.pose import (
    conjugate,
    multiply,
    Pose,
    Quaternion,
    rotation_vector_from_quaternion,
)
from ur_cartesian_driver.motion.primitive import Joints
from ur_cartesian_driver.motion.vectors import Vector3, Vector6

ZERO: Vector3 = (0.0, 0.0, 0.0)
#: Of the acceleration so much is planned with when braking for a target: the rest corrects.
_BRAKING_FRACTION = 0.8
#: A target this near is reached [m, rad].
_ARRIVAL_TOLERANCE = 1e-9
#: An arm that was stopped goes on when it could go at least so far [m], [rad]; else it would
#: tremble at a bound.
_MIN_RESTART_MOTION = (0.002, 0.01)
#: What counts as not coming nearer to a bound [rad, m].
_ROUNDING = 1e-9
#: How far joints stay away from the ends of their ranges [rad].
LIMIT_MARGIN = 0.01
_SINGULARITIES = (
    ('wrist', 'rad', 'wrist_2_joint nearly straight'),
    ('elbow', 'rad', 'the arm nearly stretched'),
    ('shoulder', 'm', 'the wrist nearly above or below the shoulder'),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveLimits:
    """
    How fast the tool may follow, and how near it may come to where it cannot go.

    :raises ValueError: a bound of speed or acceleration is not positive.
    """

    #: Of the tool [m/s], [m/s^2], [rad/s], [rad/s^2].
    linear_velocity: float = 0.25
    linear_acceleration: float = 1.0
    angular_velocity: float = 1.0
    angular_acceleration: float = 4.0
    #: Of each joint [rad/s].
    joint_velocity: Vector6 = (inf,) * 6
    #: Distances from the singularities: wrist [rad], elbow [rad], shoulder [m]; 0 = any.
    singularity_margins: Vector3 = (0.05, 0.05, 0.02)
    #: What the arm keeps away from, and itself.
    workspace: LiveWorkspace = field(default_factory=LiveWorkspace)

    def __post_init__(self) -> None:
        """Check the bounds."""
        for name in (
            'linear_velocity',
            'linear_acceleration',
            'angular_velocity',
            'angular_acceleration',
        ):
            value = getattr(self, name)
            if not (isfinite(value) and value > 0.0):
                raise ValueError(f'{name} is {value}; it must be positive and finite')
        if not all(speed > 0.0 for speed in self.joint_velocity):
            raise ValueError(f'joint_velocity is {self.joint_velocity}; all must be positive')


class OnlineTrajectoryGenerator:
    """
    Follows targets from a state of rest on; one owner calls :meth:`step` once in each cycle.

    :param arm: nominal or calibrated.
    :param T_flange_tcp: the TCP that is to be at the targets.
    :param q: joint positions at the start [rad].
    """

    def __init__(self, arm: Arm, T_flange_tcp: Pose, q: Joints, limits: LiveLimits) -> None:
        """Begin at rest with no target."""
        self.limits = limits
        #: The newest set-point: joints [rad], and where it has the tool.
        self.q = q
        self.T_base_tcp = arm.forward(q) @ T_flange_tcp
        #: Speed of the tool at the newest set-point [m/s], [rad/s], base axes.
        self.linear: Vector3 = ZERO
        self.angular: Vector3 = ZERO
        #: Why the arm stops or stands although it has a target, as a clause; empty: it does not.
        self.blocked = ''
        #: Speed over allowed speed of the fastest joint where that slowed the tool down, else 1.
        self.joint_speed_ratio = 1.0
        self._arm = arm
        self._T_tcp_flange = T_flange_tcp.inverse()
        self._target: Pose | None = None
        self._bounds_check = _BoundsCheck(arm, T_flange_tcp, limits)
        # The joints of the place where the tool would rest, from the last cycle.
        self._q_stop = q
        #: Length of the last cycle [s].
        self._dt = 0.0
        # Whether the target is another one than that which the arm was stopped for.
        self._is_target_new = False

    def reset(self, q: Joints) -> None:
        """Begin again at rest at other joint positions [rad], towards the same target."""
        self.q = self._q_stop = q
        self.T_base_tcp = self._arm.forward(q) @ self._T_tcp_flange.inverse()
        self.linear = self.angular = ZERO

    @property
    def target(self) -> Pose | None:
        """Where the tool is to go; None: it is to stop, or stands."""
        return self._target

    @property
    def at_rest(self) -> bool:
        """Tell whether the newest set-point does not move."""
        return self.linear == ZERO and self.angular == ZERO

    @property
    def arrived(self) -> bool:
        """Tell whether the tool rests at its target."""
        return (
            self.at_rest
            and self._target is not None
            and self.T_base_tcp.distance_to(self._target) < _ARRIVAL_TOLERANCE
            and self.T_base_tcp.angle_to(self._target) < 2.0 * _ARRIVAL_TOLERANCE
        )

    def set_target(self, T_base_tcp: Pose) -> None:
        """Go to another target from now on; its quaternion is of length 1."""
        self._is_target_new |= T_base_tcp != self._target
        self._target = T_base_tcp

    def clear_target(self) -> None:
        """Have no target any more: brake, and rest."""
        self._target = None
        self.blocked, self._is_target_new = '', False

    def step(self, dt: float) -> Joints:
        """
        Return the next set-point [rad].

        :param dt: nominal time to it [s].
        """
        self.joint_speed_ratio = 1.0
        # The speed of the cycle before was chosen for its length, and cannot be undone in less.
        change, self._dt = max(dt, self._dt), dt
        if self.blocked and self._is_target_new and self.at_rest:
            self._is_target_new = False
            if self._is_path_clear():
                self.blocked = ''
        linear, angular = self._next_velocity(dt, change)
        if self._target is not None and not self.blocked:
            self.blocked = self._violation_when_braking(linear, angular, dt)
            if self.blocked:
                self._is_target_new = False
                linear, angular = self._braking_velocity(change)
        if linear == ZERO and angular == ZERO:
            self.linear = self.angular = ZERO
        else:
            self._move(linear, angular, dt)
        return self.q

    # ---- speeds -------------------------------------------------------------------------------

    def _next_velocity(self, dt: float, change: float) -> tuple[Vector3, Vector3]:
        """
        Return the speeds of the next cycle towards the target, or towards rest.

        :param change: for so long they may change [s].
        """
        if self._target is None or self.blocked:
            return self._braking_velocity(change)
        limits, (linear, angular) = self.limits, _pose_difference(self.T_base_tcp, self._target)
        return (
            _limit_change(
                self.linear,
                _approach_velocity(linear, limits.linear_velocity, limits.linear_acceleration, dt),
                limits.linear_acceleration * change,
            ),
            _limit_change(
                self.angular,
                _approach_velocity(
                    angular, limits.angular_velocity, limits.angular_acceleration, dt
                ),
                limits.angular_acceleration * change,
            ),
        )

    def _braking_velocity(self, change: float) -> tuple[Vector3, Vector3]:
        limits = self.limits
        return (
            _limit_change(self.linear, ZERO, limits.linear_acceleration * change),
            _limit_change(self.angular, ZERO, limits.angular_acceleration * change),
        )

    # ---- places -------------------------------------------------------------------------------

    def _move(self, linear: Vector3, angular: Vector3, dt: float) -> None:
        """Take a step, as much of it as the joints allow."""
        pose, q = self._next_pose(linear, angular, dt)
        if q is None:  # next to what was looked at: it does not happen but by rounding
            self.blocked = (
                self.blocked
                or explain_unreachable(self._arm, pose @ self._T_tcp_flange)
                or 'the joint positions jump'
            )
            self.linear = self.angular = ZERO
            return
        allowed = self.limits.joint_velocity
        fastest = max([abs(b - a) / (dt * v) for a, b, v in zip(self.q, q, allowed, strict=True)])
        if fastest > 1.0:
            self.joint_speed_ratio = fastest
            linear, angular = _scaled(linear, 1.0 / fastest), _scaled(angular, 1.0 / fastest)
            pose, q_slow = self._next_pose(linear, angular, dt)
            q = q_slow or q
        self.linear, self.angular = linear, angular
        self.T_base_tcp, self.q = pose, q

    def _next_pose(
        self, linear: Vector3, angular: Vector3, dt: float
    ) -> tuple[Pose, Joints | None]:
        pose = _integrate(self.T_base_tcp, linear, angular, dt, dt)
        return pose, track_pose(self._arm, pose @ self._T_tcp_flange, self.q)

    def _violation_when_braking(self, linear: Vector3, angular: Vector3, dt: float) -> str:
        """
        Return why the tool must not get these speeds; empty if it could still stop in time.

        The place where it would rest is looked at, with all the acceleration that there is.
        """
        limits = self.limits
        if linear == ZERO and angular == ZERO:
            return ''
        stop = _integrate(
            self.T_base_tcp,
            linear,
            angular,
            dt + 0.5 * hypot(*linear) / limits.linear_acceleration,
            dt + 0.5 * hypot(*angular) / limits.angular_acceleration,
        )
        return self._violation_at_stop(stop)

    def _violation_at_stop(self, stop: Pose) -> str:
        flange = stop @ self._T_tcp_flange
        q = track_pose(self._arm, flange, self._q_stop) or track_pose(self._arm, flange, self.q)
        if q is None:
            self._q_stop = self.q
            return explain_unreachable(self._arm, flange) or 'the arm would be singular'
        self._q_stop = q
        return self._bounds_check.violation(q, self.q)

    def _is_path_clear(self) -> bool:
        """Tell whether the way to the target is open again for a stretch that is worth it."""
        if self._target is None:
            return False
        ratio = max(
            self.T_base_tcp.distance_to(self._target) / _MIN_RESTART_MOTION[0],
            self.T_base_tcp.angle_to(self._target) / _MIN_RESTART_MOTION[1],
        )
        if ratio < _ARRIVAL_TOLERANCE:
            return True
        self._q_stop = self.q
        return not self._violation_at_stop(
            self.T_base_tcp.interpolate(self._target, min(1.0, 1.0 / ratio))
        )


class _BoundsCheck:
    """Where the joints, and all that they move, may be."""

    def __init__(self, arm: Arm, T_flange_tcp: Pose, limits: LiveLimits) -> None:
        self._arm = arm
        self._ranges = arm.model.position_limits
        self._margins = limits.singularity_margins
        workspace = limits.workspace
        self._workspace_guard = WorkspaceGuard(arm, T_flange_tcp, workspace) if workspace else None

    def violation(self, q: Joints, q_now: Joints) -> str:
        """
        Return why the arm must not come to rest at q [rad]; empty if it may.

        What is too near to a bound already may get away from it.
        """
        for joint, (angle, now, (low, high)) in enumerate(
            zip(q, q_now, self._ranges, strict=True)
        ):
            clearance = min(angle - low, high - angle) - LIMIT_MARGIN
            if (
                clearance < 0.0
                and clearance < min(now - low, high - now) - LIMIT_MARGIN - _ROUNDING
            ):
                return (
                    f'{JOINT_NAMES[joint]} would be at {angle:.4f} rad, and its limits are '
                    f'{low:.4f} to {high:.4f} rad'
                )
        distances = singularity_distances(self._arm, q)
        if not all(a >= b for a, b in zip(distances, self._margins, strict=True)):
            before = singularity_distances(self._arm, q_now)
            for distance, now, margin, (name, unit, meaning) in zip(
                distances, before, self._margins, _SINGULARITIES, strict=True
            ):
                if distance < min(margin, now - _ROUNDING):
                    return (
                        f'the {name} singularity is {margin:g} {unit} away '
                        f'(singularity_margin_{name}: {meaning})'
                    )
        return '' if self._workspace_guard is None else self._workspace_guard.violation(q, q_now)


# --- Vectors ---------------------------------------------------------------------------------


def _pose_difference(here: Pose, there: Pose) -> tuple[Vector3, Vector3]:
    """Return translation and rotation vector from one pose to another, both in base axes."""
    (ax, ay, az), (bx, by, bz) = here.position, there.position
    return (
        (bx - ax, by - ay, bz - az),
        rotation_vector_from_quaternion(multiply(there.quaternion, conjugate(here.quaternion))),
    )


def _approach_velocity(
    difference: Vector3, limit: float, acceleration: float, dt: float
) -> Vector3:
    """
    Return the speed that is wanted in the next cycle on a way that is to end at rest.

    The speed v of which the cycle of length dt and braking by b dt in each one after it cover the
    distance d is v = sqrt((b dt / 2)^2 + 2 b d) - b dt / 2: after each such cycle the formula
    gives exactly b dt less. The last step is d / dt.
    """
    distance = hypot(*difference)
    if distance < _ARRIVAL_TOLERANCE:
        return ZERO
    half = 0.5 * _BRAKING_FRACTION * acceleration * dt
    speed = min(
        limit,
        sqrt(half * half + 2.0 * _BRAKING_FRACTION * acceleration * distance) - half,
        distance / dt,
    )
    return _scaled(difference, speed / distance)


def _limit_change(speed: Vector3, desired: Vector3, limit: float) -> Vector3:
    """Return the wanted speed, or the one on the way to it that the acceleration allows."""
    x, y, z = desired[0] - speed[0], desired[1] - speed[1], desired[2] - speed[2]
    size = hypot(x, y, z)
    if size <= limit:
        return desired
    fraction = limit / size
    return (speed[0] + fraction * x, speed[1] + fraction * y, speed[2] + fraction * z)


def _scaled(v: Vector3, factor: float) -> Vector3:
    return (v[0] * factor, v[1] * factor, v[2] * factor)


def _integrate(
    pose: Pose, linear: Vector3, angular: Vector3, seconds: float, turning: float
) -> Pose:
    """Return a pose that moves and turns (base axes) for some time each."""
    (x, y, z), (vx, vy, vz) = pose.position, linear
    return Pose(
        (x + vx * seconds, y + vy * seconds, z + vz * seconds),
        multiply(_rotation_after(angular, turning), pose.quaternion)
        if angular != ZERO
        else pose.quaternion,
    )


def _rotation_after(angular: Vector3, seconds: float) -> Quaternion:
    speed = hypot(*angular)
    half = 0.5 * speed * seconds
    scale = sin(half) / speed
    return (angular[0] * scale, angular[1] * scale, angular[2] * scale, cos(half))
