# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
From motion calls to one target per control cycle.

A call (``movel`` ...) says what to do and returns a :class:`Move` at once; ``step`` does one cycle
of it. The caller polls ``Move.returned`` and may make its next call in the same frame, then the
motion goes on without an idle cycle.

Time is dilated, never the path: by the speed scaling that comes in, where a joint would be faster
than it can or closer to its limit than it can brake for, and where the tool would be too fast.
Tool motions are solved by inverse kinematics each cycle, from the solution before; where there is
none the arm creeps up to the place and stops there with a fault.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, log
from typing import TypeAlias

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.motion.pose import (
    IDENTITY,
    Pose,
    Vector6,
)
from ur_cartesian_driver.sim.motion.ik_branch import IkBranchTracker
from ur_cartesian_driver.sim.motion.joint_kinematics import (
    difference_rate,
    is_singular,
    JointKinematics,
    MAX_JOINT_ACCELERATION,
    max_joint_difference,
    MAX_TOOL_SPEED,
    NO_CHANGE,
    twist_between,
)
from ur_cartesian_driver.sim.motion.motion_calls import (
    BLEND_SKIPPED_ARGUMENTS,
    BLEND_TOO_SMALL_ARGUMENTS,
    check_fractions,
    check_profile_parameters,
    constant_speed_parameters,
    MotionCall,
    PathStart,
)
from ur_cartesian_driver.sim.motion.move_paths import (
    CircularMovePath,
    FilletBlendPath,
    JointMovePath,
    LinearMovePath,
    MovePath,
    Setpoint,
)
from ur_cartesian_driver.sim.motion.moves import MotionError, MotionFault, MotionWarning, Move
from ur_cartesian_driver.sim.motion.path_motion import (
    append_move_path,
    PathMotion,
    ProfileParameters,
    start_from_rest,
)
from ur_cartesian_driver.sim.motion.servo_motions import (
    JointSpeedMotion,
    JointStopMotion,
    ServoMotion,
    ToolSpeedMotion,
    ToolStopMotion,
)

_Motion: TypeAlias = (
    PathMotion
    | JointSpeedMotion
    | JointStopMotion
    | ServoMotion
    | ToolSpeedMotion
    | ToolStopMotion
)
_SetpointMotion = JointSpeedMotion | ServoMotion | ToolSpeedMotion
_Stop = JointStopMotion | ToolStopMotion

#: How hard the arm brakes when servoj set-points stay away, or before a path [rad/s^2].
UNATTENDED_DECELERATION = 15.0
#: Still this long [s]: steady.
STEADY_AFTER = 0.5

# Cycles are shortened this often before a place counts as out of reach.
_ATTEMPTS = 12
_WITHIN = 1.0 + 1e-6
# Beside a singularity half a step hardly turns the joints less than the whole one, so that it is
# shortened by a power, at most this one, of what it is too long, and at most so many times that.
_MAX_POWER, _MAX_OVERCUT = 4.0, 2.0
# A tool motion at less than this part of its speed for so long [s] has met a wall, unless a joint
# turns at more than this part of what it can: then it passes a singularity.
_STALLED = 0.01
_STALLED_AFTER = 1.0
_TURNING = 0.2
# A joint line does not begin where the tool's path before it ends if it is so much too fast.
_JUMP_RATIO = 50.0
# Blends that touch do not overlap [m].
_TOUCHING = 1e-9
_STILL: Vector6 = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class MotionGenerator:
    """
    The target of the arm, one control cycle after the other.

    ``q``, ``qd``, ``qdd`` [rad, rad/s, rad/s^2], ``T_base_tcp`` and ``tcp_twist`` (base axes,
    [m/s, rad/s]) are the targets of the last cycle. Speeds are those over the cycle: differences
    of positions, so that they always fit these.

    ``warnings`` collects what the controller has to report; it takes them out. After a ``fault``
    the arm stands until ``clear_fault``. ``max_tool_speed`` [m/s] is kept by all motion but stops.

    :param cycle: [s].
    :param q: where the arm stands [rad].
    """

    def __init__(self, arm: Arm, cycle: float, q: Vector6) -> None:
        """Stand still at ``q`` with the flange as TCP."""
        self.arm = arm
        self.cycle = cycle
        self.fault: MotionFault | None = None
        self.warnings: list[MotionWarning] = []
        self.max_tool_speed = MAX_TOOL_SPEED
        self._T_flange_tcp = self._used_tcp = self._T_tcp_flange = IDENTITY
        self._joint_kinematics = JointKinematics(arm, cycle)
        #: The scaling that came in, and the one of the last cycle, joint limits included.
        self._scale = self._rate = 1.0
        self._motion: _Motion | None = None
        self._move: Move | None = None
        #: Whether the last place was a pose, solved by inverse kinematics.
        self._on_tool_path = False
        self._stalled_for = 0.0
        #: What waits until the arm stands.
        self._next_call: MotionCall | None = None
        #: Whether the last leg is a movep's.
        self._circular = False
        #: The movep that has been found to be too fast.
        self._too_fast: Move | None = None
        #: What was before a waypoint that may be skipped.
        self._overlapping: tuple[PathMotion | None, bool, str] | None = None
        self.teleport(q)

    @property
    def T_flange_tcp(self) -> Pose:
        """The tool centre point. A change takes effect on the next call, not on a running one."""
        return self._T_flange_tcp

    @T_flange_tcp.setter
    def T_flange_tcp(self, pose: Pose) -> None:
        self._T_flange_tcp = pose
        self.T_base_tcp = self._forward(self.q)

    @property
    def moving(self) -> bool:
        """Whether the target moved in the last cycle or is about to."""
        return self._motion is not None or self.qd != _STILL

    @property
    def scaling(self) -> float:
        """What part of the speed the last cycle had: the scale asked for, less at a limit."""
        return min(self._rate, self._scale)

    @property
    def steady(self) -> bool:
        """Whether the target has stood still for half a second."""
        return self._still_for >= STEADY_AFTER - 0.5 * self.cycle

    # -- calls -------------------------------------------------------------------------------

    def movej(
        self, q: Vector6, a: float = 1.4, v: float = 1.05, t: float = 0.0, r: float = 0.0
    ) -> Move:
        """Go straight in joint space; a, v of the leading axis [rad/s^2, rad/s], r [m]."""
        return self._start_path_move(
            'movej',
            self._joint_move_path(q),
            ProfileParameters(acceleration=a, speed=v, time=t),
            r,
        )

    def movel(
        self, T_base_tcp: Pose, a: float = 1.2, v: float = 0.25, t: float = 0.0, r: float = 0.0
    ) -> Move:
        """Go straight with the tool; a, v [m/s^2, m/s; for rotations rad], t [s], r [m]."""
        return self._start_path_move(
            'movel',
            lambda start: LinearMovePath(start.pose, T_base_tcp),
            ProfileParameters(acceleration=a, speed=v, time=t),
            r,
        )

    def movep(self, T_base_tcp: Pose, a: float = 1.2, v: float = 0.25, r: float = 0.0) -> Move:
        """
        Go straight at constant tool speed, through circular fillets.

        The speed holds until the fillet: if no other motion follows, the arm brakes within it,
        harder than ``a`` where it has to.
        """
        radius = self._drivable_radius('movep', r, v)
        return self._start_path_move(
            'movep',
            lambda start: LinearMovePath(start.pose, T_base_tcp),
            constant_speed_parameters(a, v, radius),
            radius,
        )

    def movec(
        self, via: Pose, to: Pose, a: float = 1.2, v: float = 0.25, r: float = 0.0, mode: int = 0
    ) -> Move:
        """
        Go on a circle; mode 1 keeps the orientation fixed to the tangent.

        :raises MotionError: the three points do not lie on a circle.
        """
        return self._start_path_move(
            'movec',
            lambda start: CircularMovePath(start.pose, via.position, to, mode == 1),
            ProfileParameters(acceleration=a, speed=v),
            self._drivable_radius('movec', r, v),
        )

    def optimovej(self, q: Vector6, a: float = 0.3, v: float = 0.3, r: float = 0.0) -> Move:
        """Like movej with limited jerk; a, v fractions in (0, 1] of what the joints can do."""
        check_fractions('optimovej', a, v)
        return self._start_path_move(
            'optimovej', self._joint_move_path(q), self._optimove_parameters(a, v), r
        )

    def optimovel(self, T_base_tcp: Pose, a: float = 0.3, v: float = 0.3, r: float = 0.0) -> Move:
        """Like movel with limited jerk; a, v fractions in (0, 1] of what the joints can do."""
        check_fractions('optimovel', a, v)
        return self._start_path_move(
            'optimovel',
            lambda start: LinearMovePath(start.pose, T_base_tcp),
            self._optimove_parameters(a, v),
            r,
        )

    def servoj(
        self, q: Vector6, t: float, lookahead_time: float = 0.1, gain: float = 300.0
    ) -> Move:
        """Be drawn to ``q`` for ``t`` scaled seconds."""
        servo = ServoMotion(
            self.q, self._nominal_joint_speed(), q, t, lookahead_time, gain, MAX_JOINT_ACCELERATION
        )
        return self._replace_motion(servo)

    def speedj(self, qd: Vector6, a: float, t: float | None = None) -> Move:
        """Change to joint speeds [rad/s] and hold them; return after ``t`` or when reached."""
        return self._replace_motion(
            JointSpeedMotion(self.q, self._nominal_joint_speed(), qd, a, t)
        )

    def speedl(
        self, twist: Vector6, a: float, t: float | None = None, a_rot: float | None = None
    ) -> Move:
        """Change to a tool speed (base axes [m/s, rad/s]) and hold it."""
        motion = self._motion
        now = (
            motion.twist
            if isinstance(motion, ToolSpeedMotion)
            else self._unscaled(self._real_twist())
        )
        return self._replace_motion(
            ToolSpeedMotion(self.T_base_tcp, now, twist, a, a if a_rot is None else a_rot, t)
        )

    def stopj(self, a: float) -> Move:
        """
        Brake in joint space at ``a`` [rad/s^2]; in real time, the path is not kept.

        It takes a cycle at least: programs stop again and again until the arm is steady.
        """
        return self._replace_motion(JointStopMotion(self.q, self._real_joint_speed(), a))

    def stopl(self, a: float, a_rot: float | None = None) -> Move:
        """Brake along the tool's tangent; in real time, and a cycle at least."""
        if not self.moving:
            return self.stopj(a)
        return self._replace_motion(
            ToolStopMotion(self.T_base_tcp, self._real_twist(), a, a if a_rot is None else a_rot)
        )

    def stop_at_once(self) -> None:
        """Stay where the target is (the power is cut); a running call returns as aborted."""
        self._abort()
        self._motion = None
        self._hold_target()

    def clear_fault(self) -> None:
        """Allow motion again; the call that failed goes on from where the arm stands."""
        self.fault, self._stalled_for = None, 0.0

    def teleport(self, q: Vector6) -> None:
        """Stand at ``q`` [rad] without having moved there."""
        self.q, self.qd, self.qdd = q, _STILL, _STILL
        self.T_base_tcp = self._forward(q)
        self.tcp_twist = _STILL
        self._motion = self._move = self._next_call = self._overlapping = None
        self._still_for = inf

    # -- one cycle ---------------------------------------------------------------------------

    def step(self, scale: float) -> None:
        """Do one cycle at ``scale`` (0 to 1) of the speed: path unchanged, 0 is a pause."""
        self._overlapping = None
        self._scale = scale
        if self.fault is not None:
            self._hold_target()
            return
        if isinstance(self._motion, _SetpointMotion) and self._motion.is_over:
            self._motion = self._brake_unattended(self._motion)
        motion = self._motion
        if motion is None:
            self._hold_target()
            return
        reached = self._attempt(motion, self.cycle if motion.real_time else scale * self.cycle)
        if reached is None:
            self._hold_target()
            return
        self._set_target(*reached)
        self._update_move(motion)

    def _attempt(self, motion: _Motion, h: float) -> tuple[Vector6, Pose] | None:
        """Advance by ``h`` seconds or as far as the arm can follow; None: not at all."""
        setpoint: Setpoint = self.q
        requested, before = h, (h, 0.0)
        arm = self._ik_branch()
        for _ in range(_ATTEMPTS):
            setpoint, state = motion.preview(h)
            q = arm.after(setpoint, h, lambda time: motion.preview(time)[0])
            if q is None:
                h *= 0.5
                continue
            pose = setpoint if isinstance(setpoint, Pose) and self._tcp_kept else self._forward(q)
            joints = self._joint_kinematics.overspeed_factor(q, self.q)
            ratio = max(joints, self._tool_overspeed_factor(pose))
            if ratio <= _WITHIN or (ratio < inf and isinstance(motion, JointStopMotion)):
                if joints < _TURNING and self._stalls(setpoint, h, requested):
                    break
                motion.accept(state)
                self._rate = h / self.cycle
                self._on_tool_path = isinstance(setpoint, Pose)
                return q, pose
            if ratio == inf:
                break
            # A jump to another branch does not shrink with the step: creep up to its place.
            jump = (
                is_singular(self.q, q, self.T_base_tcp, setpoint)
                if isinstance(setpoint, Pose)
                else self._on_tool_path and joints > _JUMP_RATIO
            )
            before, h = (h, ratio), h / (2.0 if jump else _step_divisor((h, ratio), before))
        if isinstance(motion, ToolStopMotion):
            # No straight line left: brake in joint space.
            stop = self._motion = JointStopMotion(
                self.q, self._real_joint_speed(), motion.acceleration
            )
            return self._attempt(stop, self.cycle)
        if isinstance(motion, JointStopMotion):
            self._motion = None
            self._finish_at_rest()
        self.fault = self._joint_kinematics.motion_fault(self.q, arm.joints(setpoint))
        return None

    def _stalls(self, setpoint: Setpoint, h: float, requested: float) -> bool:
        """Return whether a tool motion has hardly come on for a while: it never will."""
        slow = isinstance(setpoint, Pose) and h < _STALLED * requested
        self._stalled_for = self._stalled_for + self.cycle if slow else 0.0
        return self._stalled_for > _STALLED_AFTER

    def _tool_overspeed_factor(self, pose: Pose) -> float:
        """Return by which factor the way to the pose is too long for one cycle."""
        return self.T_base_tcp.distance_to(pose) / (self.max_tool_speed * self.cycle)

    def _set_target(self, q: Vector6, pose: Pose) -> None:
        """Make it the target."""
        rate = 1.0 / self.cycle
        self.tcp_twist = twist_between(self.T_base_tcp, pose, rate)
        qd = difference_rate(q, self.q, rate)
        self.qdd = difference_rate(qd, self.qd, rate)
        self.q, self.qd, self.T_base_tcp = q, qd, pose
        self._still_for = (
            0.0 if max_joint_difference(qd, _STILL) > NO_CHANGE else self._still_for + self.cycle
        )

    def _hold_target(self) -> None:
        self.qdd = difference_rate(_STILL, self.qd, 1.0 / self.cycle)
        self.qd = self.tcp_twist = _STILL
        self._rate = self._scale
        self._still_for += self.cycle

    def _update_move(self, motion: _Motion) -> None:
        """Let the call return when it may, and what waited for rest begin."""
        move = self._move
        if isinstance(motion, PathMotion):
            self._check_movep_speed(motion)
            if motion.may_return(self.cycle):
                motion.last_move.call.returned = True
            if motion.finished:
                self._motion = None
                self._finish_at_rest()
        elif isinstance(self._motion, _Stop):
            if self._motion.is_over:
                self._motion = None
                self._finish_at_rest()
        elif move is not None and motion.is_over:
            move.returned = True

    def _check_movep_speed(self, path_motion: PathMotion) -> None:
        """Say once of a movep that it is too fast: slowed down, or too hard on a joint."""
        call = path_motion.last_move.call
        if not self._circular or call is self._too_fast:
            return
        slowed = self._rate < self._scale / _WITHIN
        hard = isinstance(path_motion.sections[path_motion.index].path, FilletBlendPath) and (
            max_joint_difference(self.qdd, _STILL) > MAX_JOINT_ACCELERATION
        )
        if slowed or hard:
            self._too_fast = call
            self._warn(
                196,
                0,
                'MoveP speed too high: '
                + (
                    'the arm cannot keep it here.'
                    if slowed
                    else 'a joint would need too much acceleration in a blend; enlarge its radius.'
                ),
            )

    def _finish_at_rest(self) -> None:
        """End what has come to rest, and begin what waited for that."""
        if self._next_call is None:
            if self._move is not None:
                self._move.returned = True
            return
        call, self._next_call = self._next_call, None
        try:
            self._begin_call(call)
        except MotionError as error:
            self.fault = MotionFault(code=171, argument=0, text=str(error))

    def _brake_unattended(
        self, motion: JointSpeedMotion | ServoMotion | ToolSpeedMotion
    ) -> _Motion:
        """Brake, because nobody has called again in time."""
        if isinstance(motion, ToolSpeedMotion):
            return ToolStopMotion(
                self.T_base_tcp, self._real_twist(), motion.acceleration, motion.acceleration_rot
            )
        a = UNATTENDED_DECELERATION if isinstance(motion, ServoMotion) else motion.acceleration
        return JointStopMotion(self.q, self._real_joint_speed(), a)

    # -- beginning a motion ------------------------------------------------------------------

    def _joint_move_path(self, q: Vector6) -> Callable[[PathStart], MovePath]:
        return lambda start: JointMovePath(start.q, q, self._forward)

    def _start_path_move(
        self,
        name: str,
        move_path: Callable[[PathStart], MovePath],
        parameters: ProfileParameters | Callable[[MovePath, PathStart], ProfileParameters],
        radius: float,
    ) -> Move:
        chosen = (
            (lambda _move_path, _start: parameters)
            if isinstance(parameters, ProfileParameters)
            else parameters
        )
        if isinstance(parameters, ProfileParameters):
            check_profile_parameters(name, parameters)
        if not 0.0 <= radius < inf:
            raise MotionError(f'{name}: the blend radius is {radius:g} m, it must be 0 or more.')
        call = MotionCall(name, move_path, chosen, radius, Move())
        self._begin_call(call)
        return call.move

    def _begin_call(self, call: MotionCall) -> None:
        self._skip_overlapping()
        motion = self._motion
        if isinstance(motion, PathMotion) and motion.last_move.call.returned:
            if self._tcp_kept:
                self._begin_in_blend(motion, call)
            else:
                # A corner is one of two legs of the same point: first to the waypoint.
                self._move, self._next_call = call.move, call
        elif motion is None:
            self._begin_from_rest(call)
        else:
            # A path begins at rest or in a blend, nowhere else: brake first.
            stop = JointStopMotion(self.q, self._real_joint_speed(), UNATTENDED_DECELERATION)
            self._replace_motion(stop)
            self._move = call.move
            self._next_call = call
            if stop.is_over:
                self._motion = None
                self._finish_at_rest()

    def _begin_from_rest(self, call: MotionCall) -> None:
        """Begin from rest."""
        self._activate_tcp()
        start = PathStart(self.q, self.T_base_tcp)
        move_path = call.move_path(start)
        path_motion = start_from_rest(
            move_path, call.parameters(move_path, start), call.radius, call.move
        )
        margin = _length(start.pose, move_path) - call.radius
        self._follow_path(None, path_motion, call, margin)

    def _begin_in_blend(self, path_motion: PathMotion, call: MotionCall) -> None:
        """Go on from a leg whose blend is about to begin or has begun."""
        before = path_motion.last_move
        pose = before.move_path.pose(before.move_path.length)
        q = self._ik_branch().joints_at_end_of(before.move_path)
        if q is None and call.name.endswith('j'):
            # No joint line begins where the arm cannot come: let it fail on its way there.
            self._move, self._next_call = call.move, call
            return
        q = q or self.q
        start = PathStart(q, pose)
        move_path = call.move_path(start)
        parameters = call.parameters(move_path, start)
        circular = call.name == 'movep' and self._circular
        blended, whole = append_move_path(
            path_motion, move_path, parameters, call.radius, call.move, circular
        )
        travel = _length(pose, move_path)
        if not whole and call.radius <= 0.0 and travel <= before.radius:
            self._warn(
                197,
                0,
                (
                    f'Blend overlap: the waypoint of this {call.name} lies within the blend '
                    'before it, so the arm stops at the waypoint before.'
                ),
            )
        margin = travel - call.radius - (before.radius if call.radius > 0.0 else 0.0)
        self._follow_path(path_motion, blended, call, margin)

    def _follow_path(
        self, before: PathMotion | None, path_motion: PathMotion, call: MotionCall, margin: float
    ) -> None:
        """
        Follow a track.

        A waypoint whose blend reaches into the one before (``margin`` [m] is missing) is skipped
        if the program goes on at once; if nothing follows, the arm goes there.
        """
        overlapping = call.radius > 0.0 and margin < -_TOUCHING
        self._overlapping = (before, self._circular, call.name) if overlapping else None
        self._circular = call.name == 'movep'
        self._motion, self._move = path_motion, call.move
        call.move.returned = overlapping or path_motion.may_return(self.cycle)
        if before is None and path_motion.sections[0].profile.duration <= 0.0:
            self._motion, call.move.returned = None, True

    def _skip_overlapping(self) -> None:
        """Forget a waypoint that overlaps, now that another motion follows at once."""
        if self._overlapping is None:
            return
        self._motion, self._circular, name = self._overlapping
        self._overlapping = None
        self._warn(
            171,
            BLEND_SKIPPED_ARGUMENTS[name],
            f'Overlapping blends in a {name}, a waypoint was skipped.',
        )

    def _drivable_radius(self, name: str, radius: float, speed: float) -> float:
        """Return the radius, 0 where the tool passes it within one cycle: that is no blend."""
        if not 0.0 < radius < speed * self.cycle:
            return radius
        self._warn(
            171,
            BLEND_TOO_SMALL_ARGUMENTS[name],
            (
                f'Blend radius too small in a {name}: {radius:g} m is less than the way of one '
                'cycle, so the arm stops at the waypoint.'
            ),
        )
        return 0.0

    def _warn(self, code: int, argument: int, text: str) -> None:
        self.warnings.append(MotionWarning(code=code, argument=argument, text=text))

    def _replace_motion(self, motion: _Motion) -> Move:
        """Run a motion without a path from now on."""
        self._abort()
        self._activate_tcp()
        self._motion, self._move = motion, Move()
        if isinstance(motion, _SetpointMotion) and motion.duration is not None:
            self._move.returned = motion.is_over
        return self._move

    def _abort(self) -> None:
        if self._move is not None and not self._move.returned:
            self._move.returned = self._move.aborted = True
        self._next_call = self._overlapping = None

    # -- kinematics --------------------------------------------------------------------------

    def _forward(self, q: Vector6) -> Pose:
        return self.arm.forward(q) @ self._T_flange_tcp

    def _ik_branch(self) -> IkBranchTracker:
        return IkBranchTracker(self._joint_kinematics, self.q, self.T_base_tcp, self._T_tcp_flange)

    def _activate_tcp(self) -> None:
        self._T_tcp_flange = self._T_flange_tcp.inverse()
        self._used_tcp = self._T_flange_tcp

    @property
    def _tcp_kept(self) -> bool:
        return self._used_tcp is self._T_flange_tcp

    def _optimove_parameters(
        self, a: float, v: float
    ) -> Callable[[MovePath, PathStart], ProfileParameters]:
        def parameters(move_path: MovePath, start: PathStart) -> ProfileParameters:
            return self._joint_kinematics.fastest_parameters(
                move_path, start.q, self._T_tcp_flange, a, v
            )

        return parameters

    def _real_joint_speed(self) -> Vector6:
        """Return the joint speed at the end of the last cycle (``qd`` is the mean of it)."""
        motion = self._motion
        if motion is None or isinstance(motion, JointStopMotion):
            return _STILL if motion is None else motion.qd
        if isinstance(motion, JointSpeedMotion | ServoMotion):
            return difference_rate(motion.qd, _STILL, self._rate)
        return self.qd

    def _real_twist(self) -> Vector6:
        motion = self._motion
        if motion is None or isinstance(motion, ToolStopMotion):
            return _STILL if motion is None else motion.twist
        if isinstance(motion, ToolSpeedMotion):
            return difference_rate(motion.twist, _STILL, self._rate)
        return self.tcp_twist

    def _nominal_joint_speed(self) -> Vector6:
        """Return the joint speed as it would be without speed scaling."""
        if isinstance(self._motion, JointSpeedMotion | ServoMotion):
            return self._motion.qd
        return self._unscaled(self._real_joint_speed())

    def _unscaled(self, speed: Vector6) -> Vector6:
        if self._motion is None or self._scale <= 0.0:
            return _STILL
        return difference_rate(speed, _STILL, 1.0 / self._scale)


def _step_divisor(step: tuple[float, float], before: tuple[float, float]) -> float:
    """
    Return by what to divide a step so that it is not too long: a secant in logarithms.

    :param step: the step and by which factor it is too long; ``before``: the last one.
    """
    (h, ratio), (h_before, ratio_before) = step, before
    if ratio_before <= ratio:
        return ratio
    power = log(h_before / h) / log(ratio_before / ratio)
    return min(float(ratio ** min(max(power, 1.0), _MAX_POWER)), _MAX_OVERCUT * ratio)


def _length(start: Pose, move_path: MovePath) -> float:
    """Return how far the waypoint is from the start [m]."""
    return start.distance_to(move_path.pose(move_path.length))
