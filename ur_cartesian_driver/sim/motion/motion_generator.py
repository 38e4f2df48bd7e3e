# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Turn motion calls into one target of the arm per control cycle.

A call (``movel`` ...) returns a :class:`Move` at once; ``step`` does one cycle of the motion. To
find out when the URScript function can return, the caller polls ``Move.returned``. If the next
call comes in the cycle in which ``returned`` becomes true, the motion continues without an idle
cycle.

Speed scaling and the limits of the arm stretch the time and never change the path. Tool motions
are solved by inverse kinematics in each cycle, starting from the previous solution. If a path
leads to a point without a solution, the arm creeps up to this point and stops with a fault.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector6
from ur_cartesian_driver.motion.twin.laws import ASSUMED_LAWS, MotionLaws
from ur_cartesian_driver.sim.motion.arm_target import ArmTarget
from ur_cartesian_driver.sim.motion.controller_offset import ControllerPathOffset
from ur_cartesian_driver.sim.motion.cycle_stepper import CycleStepper, Motion
from ur_cartesian_driver.sim.motion.kinematics.joint_kinematics import (
    MAX_JOINT_ACCELERATION,
    MAX_TOOL_SPEED,
    NO_CHANGE,
)
from ur_cartesian_driver.sim.motion.motion_reports import MotionReports
from ur_cartesian_driver.sim.motion.motion_values import (
    MotionError,
    MotionFault,
    MotionWarning,
    Move,
)
from ur_cartesian_driver.sim.motion.paths.motion_calls import (
    BLENDS_BY_LAWS,
    check_fractions,
    check_profile_parameters,
    constant_speed_parameters,
    MotionCall,
    ParameterFunction,
    PathStart,
)
from ur_cartesian_driver.sim.motion.paths.move_paths import (
    CircularMovePath,
    JointMovePath,
    LinearMovePath,
    MovePath,
)
from ur_cartesian_driver.sim.motion.paths.path_motion import PathMotion, ProfileParameters
from ur_cartesian_driver.sim.motion.paths.path_queue import PathQueue
from ur_cartesian_driver.sim.motion.paths.second_motion_version import SecondMotionVersion
from ur_cartesian_driver.sim.motion.running_motion import RunningMotion
from ur_cartesian_driver.sim.motion.servo_motions import (
    JointSpeedMotion,
    JointStopMotion,
    ServoLikeMotion,
    ServoMotion,
    SetpointMotion,
    StopMotion,
    ToolSpeedMotion,
    ToolStopMotion,
)


class MotionGenerator:
    """
    Computes the target of the arm, one control cycle after the other; see :class:`ArmTarget`.

    ``warnings`` collects reports until the controller takes them. After a ``fault`` the arm stands
    still until ``clear_fault``. Only joint stops can exceed ``max_tool_speed`` [m/s]. A path move
    (``movej`` to ``optimovel``) with an impossible parameter raises :class:`MotionError`.

    :param cycle: duration of a cycle [s].
    :param q: joint positions at the start [rad].
    :param laws: the numbers that describe the controller's motions, assumed or measured.
    """

    def __init__(
        self, arm: Arm, cycle: float, q: Vector6, laws: MotionLaws = ASSUMED_LAWS
    ) -> None:
        """Begin at rest at ``q`` with the flange as TCP."""
        self.arm = arm
        self.cycle = cycle
        self.laws = laws
        self.max_tool_speed = MAX_TOOL_SPEED
        #: The controller's version of movej and movel, 1 or 2, and the numbers of version 2.
        self.motion_version = 1
        self.second_version = SecondMotionVersion()
        #: The target of the motion, without the path offset.
        self._target = ArmTarget(arm, cycle, q)
        #: The offset that a program adds to the target.
        self.path_offset = ControllerPathOffset(self._target)
        self._active = RunningMotion(self._target, laws.set_point_deceleration)
        self._reports = MotionReports()
        self._paths = PathQueue(self._target, self._active, self._reports, laws)
        self._stepper = CycleStepper(self._target)
        #: The rate at which the time of a path runs before speed scaling; it is less than 1 only
        #: while the first path of a program starts.
        self._start_rate = 1.0

    # -- state -------------------------------------------------------------------------------

    @property
    def _displaced(self) -> ArmTarget:
        """The target, displaced by the path offset if there is one."""
        return self.path_offset.target or self._target

    @property
    def q(self) -> Vector6:
        """Joint positions [rad]."""
        return self._displaced.q

    @property
    def qd(self) -> Vector6:
        """Joint speeds [rad/s]."""
        return self._displaced.qd

    @property
    def qdd(self) -> Vector6:
        """Joint accelerations [rad/s^2]."""
        return self._displaced.qdd

    @property
    def T_base_tcp(self) -> Pose:
        """Pose of the TCP."""
        return self._displaced.T_base_tcp

    @property
    def tcp_twist(self) -> Vector6:
        """Twist of the TCP in base axes [m/s, rad/s]."""
        return self._displaced.tcp_twist

    @property
    def T_flange_tcp(self) -> Pose:
        """Pose of the TCP in the flange; a change applies from the next call on."""
        return self._target.T_flange_tcp

    @T_flange_tcp.setter
    def T_flange_tcp(self, pose: Pose) -> None:
        self._target.T_flange_tcp = pose
        if self.path_offset.target is not None:
            self.path_offset.target.T_flange_tcp = pose

    @property
    def moving(self) -> bool:
        """Whether the target moved in the last cycle or is about to move."""
        return self._active.moving

    @property
    def has_motion(self) -> bool:
        """Whether a motion is running; false already in the cycle in which it ends."""
        return self._active.motion is not None

    @property
    def on_path(self) -> bool:
        """Whether a path move is running."""
        return isinstance(self._active.motion, PathMotion)

    @property
    def scaling(self) -> float:
        """The speed scaling that the last cycle achieved; limits of the arm can reduce it."""
        return min(self._active.rate, self._active.scale)

    @property
    def steady(self) -> bool:
        """Whether the target has stood still for half a second."""
        return self._displaced.steady

    @property
    def fault(self) -> MotionFault | None:
        """The fault that stopped the arm, until ``clear_fault``."""
        return self._reports.fault

    @property
    def warnings(self) -> list[MotionWarning]:
        """Reports that the controller has not sent yet."""
        return self._reports.warnings

    # -- path moves --------------------------------------------------------------------------

    def movej(
        self,
        q: Vector6,
        a: float = ASSUMED_LAWS.timed_joint_acceleration,
        v: float = ASSUMED_LAWS.timed_joint_speed,
        t: float = 0.0,
        r: float = 0.0,
    ) -> Move:
        """
        Move straight in joint space.

        :param a: acceleration of the leading axis, the joint with the longest way [rad/s^2].
        :param v: speed of the leading axis [rad/s].
        :param t: duration [s]; 0 = it follows from ``a`` and ``v``.
        :param r: blend radius [m].
        """
        parameters = ProfileParameters(acceleration=a, speed=v, time=t)
        return self._start_path('movej', self._joint_path('movej', q), parameters, r)

    def movel(
        self, T_base_tcp: Pose, a: float = 1.2, v: float = 0.25, t: float = 0.0, r: float = 0.0
    ) -> Move:
        """
        Move the tool straight; ``t`` and ``r`` as in :meth:`movej`.

        :param a: acceleration [m/s^2]; for a turn, ``a * turn_ratio`` [rad/s^2].
        :param v: speed [m/s]; for a turn, ``v * turn_ratio`` [rad/s].
        """
        parameters = ProfileParameters(acceleration=a, speed=v, time=t)
        ratio = self.laws.turn_ratio
        return self._start_path(
            'movel', lambda start: LinearMovePath(start.pose, T_base_tcp, ratio), parameters, r
        )

    def movep(self, T_base_tcp: Pose, a: float = 1.2, v: float = 0.25, r: float = 0.0) -> Move:
        """
        Move straight at constant tool speed, through circular fillets.

        The speed is constant up to the fillet. If no other motion follows, the arm therefore
        brakes within the length of the fillet, harder than ``a`` if necessary.
        """
        radius = self._drivable_radius('movep', r, v)
        parameters = constant_speed_parameters(a, v, radius)
        return self._start_path('movep', _linear_path(T_base_tcp), parameters, radius)

    def movec(
        self, via: Pose, to: Pose, a: float = 1.2, v: float = 0.25, r: float = 0.0, mode: int = 0
    ) -> Move:
        """
        Move on a circular arc; mode 1 keeps the orientation fixed relative to the tangent.

        :raises MotionError: the three points do not lie on a circle. If the arm has to stop before
            the arc begins, they are checked only then, and cause a fault instead.
        """
        return self._start_path(
            'movec',
            lambda start: CircularMovePath(start.pose, via.position, to, mode == 1),
            ProfileParameters(acceleration=a, speed=v),
            self._drivable_radius('movec', r, v),
        )

    def optimovej(self, q: Vector6, a: float = 0.3, v: float = 0.3, r: float = 0.0) -> Move:
        """Move like movej with limited jerk; a and v are fractions (0, 1] of the joint limits."""
        check_fractions('optimovej', a, v)
        move_path = self._joint_path('optimovej', q)
        return self._start_path('optimovej', move_path, self._fastest(a, v), r)

    def optimovel(self, T_base_tcp: Pose, a: float = 0.3, v: float = 0.3, r: float = 0.0) -> Move:
        """Move like movel with limited jerk; a and v are fractions (0, 1] of the joint limits."""
        check_fractions('optimovel', a, v)
        return self._start_path('optimovel', _linear_path(T_base_tcp), self._fastest(a, v), r)

    def _start_path(
        self,
        name: str,
        move_path: Callable[[PathStart], MovePath],
        parameters: ProfileParameters | ParameterFunction,
        radius: float,
    ) -> Move:
        if isinstance(parameters, ProfileParameters):
            check_profile_parameters(name, parameters)
        if not 0.0 <= radius < inf:
            raise MotionError(f'{name}: the blend radius is {radius:g} m, it must be 0 or more.')
        if name in BLENDS_BY_LAWS:
            radius *= self.laws.blend_begin
        call = MotionCall(name, move_path, parameters, radius, Move())
        if self.motion_version == 2 and isinstance(parameters, ProfileParameters):
            call = self._by_second_version(call, parameters)
        self._paths.begin(call)
        return call.move

    def _by_second_version(self, call: MotionCall, asked: ProfileParameters) -> MotionCall:
        """Return a movej or movel as motion version 2 carries it out; other calls unchanged."""
        if call.name not in ('movej', 'movel'):
            return call
        version, target = self.second_version, self._target

        def parameters(move_path: MovePath, start: PathStart) -> ProfileParameters:
            most = target.kinematics.fastest_parameters(
                move_path, start.q, target.T_tcp_flange, 1.0, 1.0
            )
            return version.parameters(asked, move_path.length, most)

        radius = version.blend_fraction * call.radius
        return call._replace(parameters=parameters, radius=radius, version=version)

    def _joint_path(self, name: str, q: Vector6) -> Callable[[PathStart], MovePath]:
        for i, (angle, (low, high)) in enumerate(
            zip(q, self.arm.model.position_limits, strict=True), 1
        ):
            if not low - NO_CHANGE <= angle <= high + NO_CHANGE:
                raise MotionError(
                    f'{name}: joint {i} would go to {angle:g} rad, its range is {low:g} to '
                    f'{high:g} rad.'
                )
        return lambda start: JointMovePath(start.q, q, self._target.forward)

    def _fastest(self, a: float, v: float) -> ParameterFunction:
        target = self._target
        return lambda move_path, start: target.kinematics.fastest_parameters(
            move_path, start.q, target.T_tcp_flange, a, v
        )

    def _drivable_radius(self, name: str, radius: float, speed: float) -> float:
        """Return the blend radius, or 0 (no blend) if the tool passes the radius in one cycle."""
        if not 0.0 < radius < speed * self.cycle:
            return radius
        self._reports.blend_too_small(name, radius)
        return 0.0

    # -- servo-like motions and stops --------------------------------------------------------

    def servoj(
        self, q: Vector6, t: float, lookahead_time: float = 0.1, gain: float = 300.0
    ) -> Move:
        """Move a set-point, which the arm follows, to ``q`` within ``t`` [s] of scaled time."""
        qd, before = self._active.nominal_joint_speed(), self._active.motion
        begin = before.setpoint(before.elapsed) if isinstance(before, ServoMotion) else self.q
        lookahead_time *= self.laws.servo_lookahead_factor
        gain *= self.laws.servo_gain_factor
        return self._replace(
            ServoMotion(self.q, qd, begin, q, t, lookahead_time, gain, MAX_JOINT_ACCELERATION)
        )

    def speedj(self, qd: Vector6, a: float, t: float | None = None) -> Move:
        """Change to joint speeds [rad/s] and hold them; see :class:`JointSpeedMotion`."""
        return self._replace(
            JointSpeedMotion(self.q, self._active.nominal_joint_speed(), qd, a, t)
        )

    def speedl(
        self, twist: Vector6, a: float, t: float | None = None, a_rot: float | None = None
    ) -> Move:
        """Change to a twist of the TCP (base axes [m/s, rad/s]) and hold this twist."""
        now, a_rot = self._active.nominal_twist(), a if a_rot is None else a_rot
        return self._replace(ToolSpeedMotion(self.T_base_tcp, now, twist, a, a_rot, t))

    def stopj(self, a: float) -> Move:
        """
        Brake in joint space at ``a`` [rad/s^2], regardless of speed scaling and path.

        A stop takes at least one cycle: programs repeat it until the arm is steady, and such a
        loop has to take time.
        """
        return self._replace(self._active.joint_stop(a))

    def stopl(self, a: float, a_rot: float | None = None) -> Move:
        """Brake along the tool's tangent, regardless of speed scaling; takes at least a cycle."""
        if not self.moving:
            return self.stopj(a)
        return self._replace(self._active.tool_stop(a, a if a_rot is None else a_rot))

    def end_path_offset(self, a: float) -> Move:
        """Brake in joint space at ``a`` [rad/s^2], and end the path offset without a jump."""
        self.path_offset.end()
        return self._replace(JointStopMotion(self._target.q, self._target.qd, a))

    def _replace(self, motion: ServoLikeMotion) -> Move:
        if self.path_offset.target is not None and isinstance(motion, SetpointMotion):
            self.path_offset.end_displacement()
        self._paths.clear()
        return self._active.replace(motion)

    def begin_program(self) -> None:
        """
        Make the next path start slowly.

        Within the ``start_time`` of the laws, the rate of the path's time grows from 0 to 1, by
        the same step in each cycle, so the path takes longer by half of (``start_time`` - cycle).
        Recorded joint moves of a UR3, and of the manufacturer's simulator, follow this law within
        1e-12 rad.
        """
        self._start_rate = 0.0 if self.laws.start_time > 0.0 else 1.0

    def stop_at_once(self) -> None:
        """Stop at the present target, as if the power was cut; a running call returns."""
        self._paths.clear()
        self._active.abort()
        self._active.motion = None
        self._active.hold()

    def clear_fault(self) -> None:
        """Allow motion again; the failed call continues from the arm's present position."""
        self._reports.fault = None
        self._stepper.forget_stall()

    def teleport(self, q: Vector6) -> None:
        """Stand still at ``q`` [rad] without having moved there."""
        self._target.teleport(q)
        self.path_offset.forget()
        self._active.motion = self._active.move = None
        self._paths.clear()

    # -- one cycle ---------------------------------------------------------------------------

    def step(self, scale: float) -> None:
        """Do one cycle at ``scale`` times the programmed speed (0..1, 0 = pause)."""
        active = self._active
        self._paths.end_of_frame()
        active.scale = scale
        if active.setpoints_are_late and self.fault is None:
            active.brake_unattended()
        if active.motion is None or self.fault is not None:
            active.hold()
        else:
            self._advance(active.motion)
        if self.path_offset.is_active:
            self._displace()

    def _displace(self) -> None:
        """Add the path offset to the target of this cycle."""
        motion, offset = self._active.motion, self.path_offset
        if self.fault is not None:
            offset.hold()
            return
        self._reports.fault = offset.step(
            moving=self.moving, is_led=isinstance(motion, SetpointMotion)
        )

    def _advance(self, motion: Motion) -> None:
        active, cycle = self._active, self.cycle
        start = self._next_start_rate() if isinstance(motion, PathMotion) else 1.0
        duration = cycle if motion.real_time else active.scale * start * cycle
        step = self._stepper.advance(motion, duration, self.max_tool_speed)
        if isinstance(step, MotionFault) and isinstance(motion, ToolStopMotion):
            # The arm cannot continue on the straight line: brake in joint space.
            motion = active.motion = active.joint_stop(motion.acceleration)
            step = self._stepper.advance(motion, cycle, self.max_tool_speed)
        if isinstance(step, MotionFault):
            if isinstance(motion, JointStopMotion):
                self._paths.finish_at_rest()
            self._reports.fault = step
            active.hold()
            return
        active.rate = step.duration / cycle / start
        self._target.move_to(step.q, step.pose, step.rates)
        if isinstance(motion, PathMotion):
            self._paths.after_step(motion)
        elif motion.is_over:
            if isinstance(motion, StopMotion):
                self._paths.finish_at_rest()
            elif active.move is not None:
                active.move.returned = True

    def _next_start_rate(self) -> float:
        """Return the rate of a path's time, which grows at a start, except in a pause."""
        if self._active.scale <= 0.0 or self._start_rate == 1.0:
            return 1.0
        self._start_rate = min(1.0, self._start_rate + self.cycle / self.laws.start_time)
        return self._start_rate


def _linear_path(T_base_tcp: Pose) -> Callable[[PathStart], MovePath]:
    return lambda start: LinearMovePath(start.pose, T_base_tcp)
