# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Generate the motion from the present pose to the newest target, one set-point per control cycle.

A target from a sensor arrives at any time, jumps, and may be anywhere. The motion of the arm must
not jump: the tool goes straight towards the newest target with bounded speed and acceleration,
brakes in time to arrive at rest, and never goes where it could not stop. To ensure this, each
cycle checks the pose at which the tool would come to rest if it braked after its next step. If
that pose is out of reach, beyond a joint limit, too near to a singularity or outside the workspace
(:mod:`~.workspace_guard`), the arm brakes now, along a path that earlier cycles have checked.

Speed and acceleration are bounded as the lengths of vectors, linear and angular, so the direction
of the target does not matter (doc/architecture.md says why ruckig, which bounds each axis, is not
used). The length of a cycle is an argument; there is no clock here.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import cos, inf, isfinite, sin

from ur_cartesian_driver.execution.live.workspace_guard import LiveWorkspace, WorkspaceGuard
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.inverse import explain_unreachable
from ur_cartesian_driver.kinematics.inverse_incremental import singularity_distances, track_pose
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.geometry.pose import (
    conjugate,
    multiply,
    Pose,
    rotation_vector_from_quaternion,
)
from ur_cartesian_driver.motion.geometry.vectors import (
    add,
    Joints,
    norm,
    scale,
    subtract,
    Vector3,
    Vector6,
    ZERO3,
)
from ur_cartesian_driver.motion.plan.approach import approach_speed, ARRIVAL_TOLERANCE

#: A stopped arm goes on only if it can move at least this far [m], [rad]; otherwise it would
#: jitter at a bound.
_MIN_RESTART_MOTION = (0.002, 0.01)
#: A smaller approach to a bound counts as rounding [rad], [m].
_ROUNDING = 1e-9
#: Distance that joints keep from the ends of their ranges [rad].
LIMIT_MARGIN = 0.01
_SINGULARITIES = (
    ('wrist', 'rad', 'wrist_2_joint nearly straight'),
    ('elbow', 'rad', 'the arm nearly stretched'),
    ('shoulder', 'm', 'the wrist nearly above or below the shoulder'),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class LiveLimits:
    """
    Bounds on the motion of the tool and the joints, and on their positions.

    :raises ValueError: a bound on speed or acceleration is not positive, or one on the tool is
        not finite.
    """

    #: Bounds on the tool: linear velocity [m/s] and acceleration [m/s^2]; angular velocity [rad/s]
    #: and acceleration [rad/s^2].
    linear_velocity: float = 0.25
    linear_acceleration: float = 1.0
    angular_velocity: float = 1.0
    angular_acceleration: float = 4.0
    #: Bound on the speed of each joint [rad/s].
    joint_velocity: Vector6 = (inf,) * 6
    #: Margins to the singularities: wrist [rad], elbow [rad], shoulder [m]; 0 = no limit.
    singularity_margins: Vector3 = (0.05, 0.05, 0.02)
    #: Workspace planes, bodies of the cell and self-clearance.
    workspace: LiveWorkspace = field(default_factory=LiveWorkspace)

    def __post_init__(self) -> None:
        """Check the bounds."""
        for half in ('linear', 'angular'):
            for name in (f'{half}_velocity', f'{half}_acceleration'):
                value = getattr(self, name)
                if not (isfinite(value) and value > 0.0):
                    raise ValueError(f'{name} is {value}; it must be positive and finite')
        if not all(speed > 0.0 for speed in self.joint_velocity):
            raise ValueError(f'joint_velocity is {self.joint_velocity}; all must be positive')


class OnlineTrajectoryGenerator:
    """
    Follows targets, beginning at rest; its owner calls :meth:`step` once in each cycle.

    :param arm: the arm, nominal or calibrated.
    :param T_flange_tcp: the TCP that moves to the targets.
    :param q: joint positions at the start [rad].
    """

    def __init__(self, arm: Arm, T_flange_tcp: Pose, q: Joints, limits: LiveLimits) -> None:
        """Begin at rest with no target."""
        self.limits = limits
        #: The largest speed and acceleration of the tool: linear, then angular.
        self._bounds = (
            (limits.linear_velocity, limits.linear_acceleration),
            (limits.angular_velocity, limits.angular_acceleration),
        )
        #: The newest set-point: joint positions [rad]; TCP pose.
        self.q = q
        self.T_base_tcp = arm.forward(q) @ T_flange_tcp
        #: Velocity of the tool at the newest set-point, base axes: linear [m/s]; angular [rad/s].
        self.linear: Vector3 = ZERO3
        self.angular: Vector3 = ZERO3
        #: Why the arm does not go to its target, as a clause; '' = it does.
        self.blocked = ''
        self._arm = arm
        self._T_tcp_flange = T_flange_tcp.inverse()
        #: The pose to which the tool goes; None = it brakes or rests.
        self.target: Pose | None = None
        self._bounds_check = _BoundsCheck(arm, T_flange_tcp, limits)
        # Joint positions at which the tool would come to rest, found in the last cycle [rad].
        self._q_stop = q
        #: Length of the last cycle [s].
        self._dt = 0.0
        # Whether the target has changed since a bound stopped the arm.
        self._is_target_new = False

    def reset(self, q: Joints) -> None:
        """Begin again, at rest at other joint positions [rad], towards the same target."""
        self.q = self._q_stop = q
        self.T_base_tcp = self._arm.forward(q) @ self._T_tcp_flange.inverse()
        self.linear = self.angular = ZERO3

    @property
    def at_rest(self) -> bool:
        """Return whether the tool has no velocity at the newest set-point."""
        return self.linear == ZERO3 and self.angular == ZERO3

    @property
    def arrived(self) -> bool:
        """Return whether the tool rests at its target."""
        return (
            self.at_rest
            and self.target is not None
            and self.T_base_tcp.distance_to(self.target) < ARRIVAL_TOLERANCE
            and self.T_base_tcp.angle_to(self.target) < 2.0 * ARRIVAL_TOLERANCE
        )

    def set_target(self, T_base_tcp: Pose) -> None:
        """Go to another target from now on; its quaternion must have length 1."""
        self._is_target_new |= T_base_tcp != self.target
        self.target = T_base_tcp

    def clear_target(self) -> None:
        """Drop the target: brake, and rest."""
        self.target = None
        self.blocked, self._is_target_new = '', False

    def step(self, dt: float) -> Joints:
        """
        Return the next set-point [rad].

        :param dt: nominal time from the last set-point to this one [s].
        """
        # The last speed was chosen so that the arm can brake with the change of velocity that a
        # cycle of the last length allows. A shorter cycle would allow less, and may not suffice.
        change, self._dt = max(dt, self._dt), dt
        if self.blocked and self._is_target_new and self.at_rest:
            self._is_target_new = False
            if self._is_path_clear():
                self.blocked = ''
        target = None if self.blocked else self.target
        linear, angular = self._next_velocity(target, dt, change)
        if target is not None:
            self.blocked = self._violation_when_braking(linear, angular, dt)
            if self.blocked:
                self._is_target_new = False
                linear, angular = self._next_velocity(None, dt, change)
        if linear == ZERO3 and angular == ZERO3:
            self.linear = self.angular = ZERO3
        else:
            self._move(linear, angular, dt)
        return self.q

    def _next_velocity(
        self, target: Pose | None, dt: float, change: float
    ) -> tuple[Vector3, Vector3]:
        """
        Return the velocity of the next cycle, linear and angular.

        :param target: the pose to which the tool goes; None = it brakes.
        :param change: time in which the velocity may change [s].
        """
        shift = turn = ZERO3
        if target is not None:
            shift, turn = _pose_difference(self.T_base_tcp, target)
        linear, angular = self._bounds
        return (
            _approach_velocity(shift, self.linear, *linear, dt, change),
            _approach_velocity(turn, self.angular, *angular, dt, change),
        )

    def _move(self, linear: Vector3, angular: Vector3, dt: float) -> None:
        """Take a step, shortened if a joint would be too fast."""
        pose, q = self._next_pose(linear, angular, dt)
        if q is None:  # only by rounding, because earlier cycles have checked the braking path
            reason = explain_unreachable(self._arm, pose @ self._T_tcp_flange)
            self.blocked = self.blocked or reason or 'the joint positions jump'
            self.linear = self.angular = ZERO3
            return
        allowed = self.limits.joint_velocity
        fastest = max([abs(b - a) / (dt * v) for a, b, v in zip(self.q, q, allowed, strict=True)])
        if fastest > 1.0:
            linear, angular = scale(linear, 1.0 / fastest), scale(angular, 1.0 / fastest)
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
        Return the reason against moving at these velocities, or ''.

        Checks the pose where the tool would come to rest if it braked with the full acceleration.
        """
        if linear == ZERO3 and angular == ZERO3:
            return ''
        # From speed v the braking distance is v^2 / 2a: the same as moving at v for v / 2a.
        moving = dt + 0.5 * norm(linear) / self.limits.linear_acceleration
        turning = dt + 0.5 * norm(angular) / self.limits.angular_acceleration
        stop = _integrate(self.T_base_tcp, linear, angular, moving, turning)
        return self._violation_at_stop(stop)

    def _violation_at_stop(self, stop: Pose) -> str:
        """Return the reason against coming to rest at a pose, or ''."""
        flange = stop @ self._T_tcp_flange
        q = track_pose(self._arm, flange, self._q_stop) or track_pose(self._arm, flange, self.q)
        if q is None:
            self._q_stop = self.q
            return explain_unreachable(self._arm, flange) or 'the arm would be singular'
        self._q_stop = q
        return self._bounds_check.violation(q, self.q)

    def _is_path_clear(self) -> bool:
        """Return whether the path to the target is clear for :data:`_MIN_RESTART_MOTION`."""
        if self.target is None:
            return False
        ratio = max(
            self.T_base_tcp.distance_to(self.target) / _MIN_RESTART_MOTION[0],
            self.T_base_tcp.angle_to(self.target) / _MIN_RESTART_MOTION[1],
        )
        if ratio < ARRIVAL_TOLERANCE:
            return True
        self._q_stop = self.q
        return not self._violation_at_stop(
            self.T_base_tcp.interpolate(self.target, min(1.0, 1.0 / ratio))
        )


class _BoundsCheck:
    """Checks joint limits, singularity margins and the workspace."""

    def __init__(self, arm: Arm, T_flange_tcp: Pose, limits: LiveLimits) -> None:
        self._arm = arm
        self._ranges = arm.model.position_limits
        self._margins = limits.singularity_margins
        workspace = limits.workspace
        self._workspace_guard = WorkspaceGuard(arm, T_flange_tcp, workspace) if workspace else None

    def violation(self, q: Joints, q_now: Joints) -> str:
        """
        Return the reason against coming to rest at q [rad], or ''.

        An arm that is already too near to a bound may move away from it.
        """
        for name, angle, now, (low, high) in zip(JOINT_NAMES, q, q_now, self._ranges, strict=True):
            clearance = min(angle - low, high - angle)
            if clearance < LIMIT_MARGIN and clearance < min(now - low, high - now) - _ROUNDING:
                return (
                    f'{name} would be at {angle:.4f} rad, and its limits are '
                    f'{low:.4f} to {high:.4f} rad'
                )
        distances = singularity_distances(self._arm, q)
        if not all(a >= b for a, b in zip(distances, self._margins, strict=True)):
            distances_now = singularity_distances(self._arm, q_now)
            for distance, before, margin, (name, unit, meaning) in zip(
                distances, distances_now, self._margins, _SINGULARITIES, strict=True
            ):
                if distance < min(margin, before - _ROUNDING):
                    return (
                        f'the {name} singularity is {margin:g} {unit} away '
                        f'(singularity_margin_{name}: {meaning})'
                    )
        return '' if self._workspace_guard is None else self._workspace_guard.violation(q, q_now)


def _pose_difference(here: Pose, there: Pose) -> tuple[Vector3, Vector3]:
    """Return translation and rotation vector from one pose to another, both in base axes."""
    return (
        subtract(there.position, here.position),
        rotation_vector_from_quaternion(multiply(there.quaternion, conjugate(here.quaternion))),
    )


def _approach_velocity(
    difference: Vector3,
    velocity: Vector3,
    limit: float,
    acceleration: float,
    dt: float,
    change: float,
) -> Vector3:
    """
    Return the velocity of the next cycle for a motion that ends at rest.

    :param difference: vector from here to the target, or zeros to brake.
    :param velocity: velocity of the last cycle.
    :param change: time in which the velocity may change [s].
    """
    distance, desired = norm(difference), ZERO3
    if distance >= ARRIVAL_TOLERANCE:
        speed = approach_speed(distance, limit, acceleration, dt)
        desired = scale(difference, speed / distance)
    step, allowed = subtract(desired, velocity), acceleration * change
    size = norm(step)
    return desired if size <= allowed else add(velocity, scale(step, allowed / size))


def _integrate(
    pose: Pose, linear: Vector3, angular: Vector3, moving: float, turning: float
) -> Pose:
    """Return a pose after moving for ``moving`` [s] and turning for ``turning`` [s]."""
    position, speed = add(pose.position, scale(linear, moving)), norm(angular)
    if speed == 0.0:
        return Pose(position, pose.quaternion)
    half = 0.5 * speed * turning
    turn = (*scale(angular, sin(half) / speed), cos(half))
    return Pose(position, multiply(turn, pose.quaternion))
