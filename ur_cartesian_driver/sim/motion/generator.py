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
from ur_cartesian_driver.sim.motion.branch import Branch
from ur_cartesian_driver.sim.motion.calls import (
    Call,
    check_fractions,
    check_law,
    constant_speed,
    SKIPPED,
    Start,
    TOO_SMALL,
)
from ur_cartesian_driver.sim.motion.moves import MotionError, MotionFault, MotionWarning, Move
from ur_cartesian_driver.sim.motion.paths import Arc, Fillet, JointLine, Leg, Line, Place
from ur_cartesian_driver.sim.motion.reach import (
    is_singular,
    lead,
    MAX_JOINT_ACCELERATION,
    MAX_TOOL_SPEED,
    NO_CHANGE,
    rate_of,
    Reach,
    twist_between,
)
from ur_cartesian_driver.sim.motion.servo import JointSpeed, JointStop, Servo, ToolSpeed, ToolStop
from ur_cartesian_driver.sim.motion.track import from_rest, joined, Law, Track

_Motion: TypeAlias = Track | JointSpeed | JointStop | Servo | ToolSpeed | ToolStop
_Speeding = JointSpeed | Servo | ToolSpeed
_Stop = JointStop | ToolStop

#: How hard the arm brakes when servoj set-points stay away, or before a path [rad/s^2].
RUN_OUT_BRAKING = 15.0
#: Still this long [s]: steady.
STEADY_AFTER = 0.5

# Cycles are shortened this often before a place counts as out of reach.
_ATTEMPTS = 12
_WITHIN = 1.0 + 1e-6
# Beside a singularity half a step hardly turns the joints less than the whole one, so that it is
# shortened by a power, at most this one, of what it is too long, and at most so many times that.
_HIGHEST_POWER, _DEEPEST = 4.0, 2.0
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
        self._reach = Reach(arm, cycle)
        #: The scaling that came in, and the one of the last cycle, joint limits included.
        self._scale = self._rate = 1.0
        self._motion: _Motion | None = None
        self._move: Move | None = None
        #: Whether the last place was a pose, solved by inverse kinematics.
        self._on_tool_path = False
        self._stalled_for = 0.0
        #: What waits until the arm stands.
        self._then: Call | None = None
        #: Whether the last leg is a movep's.
        self._circular = False
        #: The movep that has been found to be too fast.
        self._too_fast: Move | None = None
        #: What was before a waypoint that may be skipped.
        self._overlapping: tuple[Track | None, bool, str] | None = None
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
        return self._follow('movej', self._joint_leg(q), Law(acceleration=a, speed=v, time=t), r)

    def movel(
        self, T_base_tcp: Pose, a: float = 1.2, v: float = 0.25, t: float = 0.0, r: float = 0.0
    ) -> Move:
        """Go straight with the tool; a, v [m/s^2, m/s; for rotations rad], t [s], r [m]."""
        return self._follow(
            'movel',
            lambda start: Line(start.pose, T_base_tcp),
            Law(acceleration=a, speed=v, time=t),
            r,
        )

    def movep(self, T_base_tcp: Pose, a: float = 1.2, v: float = 0.25, r: float = 0.0) -> Move:
        """
        Go straight at constant tool speed, through circular fillets.

        The speed holds until the fillet: if no other motion follows, the arm brakes within it,
        harder than ``a`` where it has to.
        """
        radius = self._drivable('movep', r, v)
        return self._follow(
            'movep',
            lambda start: Line(start.pose, T_base_tcp),
            constant_speed(a, v, radius),
            radius,
        )

    def movec(
        self, via: Pose, to: Pose, a: float = 1.2, v: float = 0.25, r: float = 0.0, mode: int = 0
    ) -> Move:
        """
        Go on a circle; mode 1 keeps the orientation fixed to the tangent.

        :raises MotionError: the three points do not lie on a circle.
        """
        return self._follow(
            'movec',
            lambda start: Arc(start.pose, via.position, to, mode == 1),
            Law(acceleration=a, speed=v),
            self._drivable('movec', r, v),
        )

    def optimovej(self, q: Vector6, a: float = 0.3, v: float = 0.3, r: float = 0.0) -> Move:
        """Like movej with limited jerk; a, v fractions in (0, 1] of what the joints can do."""
        check_fractions('optimovej', a, v)
        return self._follow('optimovej', self._joint_leg(q), self._optimal(a, v), r)

    def optimovel(self, T_base_tcp: Pose, a: float = 0.3, v: float = 0.3, r: float = 0.0) -> Move:
        """Like movel with limited jerk; a, v fractions in (0, 1] of what the joints can do."""
        check_fractions('optimovel', a, v)
        return self._follow(
            'optimovel', lambda start: Line(start.pose, T_base_tcp), self._optimal(a, v), r
        )

    def servoj(
        self, q: Vector6, t: float, lookahead_time: float = 0.1, gain: float = 300.0
    ) -> Move:
        """Be drawn to ``q`` for ``t`` scaled seconds."""
        servo = Servo(
            self.q, self._nominal_joint_speed(), q, t, lookahead_time, gain, MAX_JOINT_ACCELERATION
        )
        return self._take_over(servo)

    def speedj(self, qd: Vector6, a: float, t: float | None = None) -> Move:
        """Change to joint speeds [rad/s] and hold them; return after ``t`` or when reached."""
        return self._take_over(JointSpeed(self.q, self._nominal_joint_speed(), qd, a, t))

    def speedl(
        self, twist: Vector6, a: float, t: float | None = None, a_rot: float | None = None
    ) -> Move:
        """Change to a tool speed (base axes [m/s, rad/s]) and hold it."""
        motion = self._motion
        now = motion.twist if isinstance(motion, ToolSpeed) else self._unscaled(self._real_twist())
        return self._take_over(
            ToolSpeed(self.T_base_tcp, now, twist, a, a if a_rot is None else a_rot, t)
        )

    def stopj(self, a: float) -> Move:
        """
        Brake in joint space at ``a`` [rad/s^2]; in real time, the path is not kept.

        It takes a cycle at least: programs stop again and again until the arm is steady.
        """
        return self._take_over(JointStop(self.q, self._real_joint_speed(), a))

    def stopl(self, a: float, a_rot: float | None = None) -> Move:
        """Brake along the tool's tangent; in real time, and a cycle at least."""
        if not self.moving:
            return self.stopj(a)
        return self._take_over(
            ToolStop(self.T_base_tcp, self._real_twist(), a, a if a_rot is None else a_rot)
        )

    def halt_hard(self) -> None:
        """Stay where the target is (the power is cut); a running call returns as aborted."""
        self._abort()
        self._motion = None
        self._stand()

    def clear_fault(self) -> None:
        """Allow motion again; the call that failed goes on from where the arm stands."""
        self.fault, self._stalled_for = None, 0.0

    def teleport(self, q: Vector6) -> None:
        """Stand at ``q`` [rad] without having moved there."""
        self.q, self.qd, self.qdd = q, _STILL, _STILL
        self.T_base_tcp = self._forward(q)
        self.tcp_twist = _STILL
        self._motion = self._move = self._then = self._overlapping = None
        self._still_for = inf

    # -- one cycle ---------------------------------------------------------------------------

    def step(self, scale: float) -> None:
        """Do one cycle at ``scale`` (0 to 1) of the speed: path unchanged, 0 is a pause."""
        self._overlapping = None
        self._scale = scale
        if self.fault is not None:
            self._stand()
            return
        if isinstance(self._motion, _Speeding) and self._motion.over:
            self._motion = self._run_out(self._motion)
        motion = self._motion
        if motion is None:
            self._stand()
            return
        reached = self._attempt(motion, self.cycle if motion.real_time else scale * self.cycle)
        if reached is None:
            self._stand()
            return
        self._go(*reached)
        self._report(motion)

    def _attempt(self, motion: _Motion, h: float) -> tuple[Vector6, Pose] | None:
        """Advance by ``h`` seconds or as far as the arm can follow; None: not at all."""
        place: Place = self.q
        requested, before = h, (h, 0.0)
        arm = self._branch()
        for _ in range(_ATTEMPTS):
            place, state = motion.preview(h)
            q = arm.after(place, h, lambda time: motion.preview(time)[0])
            if q is None:
                h *= 0.5
                continue
            pose = place if isinstance(place, Pose) and self._tcp_kept else self._forward(q)
            joints = self._reach.overspeed(q, self.q)
            ratio = max(joints, self._tool_overspeed(pose))
            if ratio <= _WITHIN or (ratio < inf and isinstance(motion, JointStop)):
                if joints < _TURNING and self._stalls(place, h, requested):
                    break
                motion.accept(state)
                self._rate = h / self.cycle
                self._on_tool_path = isinstance(place, Pose)
                return q, pose
            if ratio == inf:
                break
            # A jump to another branch does not shrink with the step: creep up to its place.
            jump = (
                is_singular(self.q, q, self.T_base_tcp, place)
                if isinstance(place, Pose)
                else self._on_tool_path and joints > _JUMP_RATIO
            )
            before, h = (h, ratio), h / (2.0 if jump else _cut((h, ratio), before))
        if isinstance(motion, ToolStop):
            # No straight line left: brake in joint space.
            stop = self._motion = JointStop(self.q, self._real_joint_speed(), motion.acceleration)
            return self._attempt(stop, self.cycle)
        if isinstance(motion, JointStop):
            self._motion = None
            self._come_to_rest()
        self.fault = self._reach.why_not(self.q, arm.joints(place))
        return None

    def _stalls(self, place: Place, h: float, requested: float) -> bool:
        """Return whether a tool motion has hardly come on for a while: it never will."""
        slow = isinstance(place, Pose) and h < _STALLED * requested
        self._stalled_for = self._stalled_for + self.cycle if slow else 0.0
        return self._stalled_for > _STALLED_AFTER

    def _tool_overspeed(self, pose: Pose) -> float:
        """Return by which factor the way to the pose is too long for one cycle."""
        return self.T_base_tcp.distance_to(pose) / (self.max_tool_speed * self.cycle)

    def _go(self, q: Vector6, pose: Pose) -> None:
        """Make it the target."""
        rate = 1.0 / self.cycle
        self.tcp_twist = twist_between(self.T_base_tcp, pose, rate)
        qd = rate_of(q, self.q, rate)
        self.qdd = rate_of(qd, self.qd, rate)
        self.q, self.qd, self.T_base_tcp = q, qd, pose
        self._still_for = 0.0 if lead(qd, _STILL) > NO_CHANGE else self._still_for + self.cycle

    def _stand(self) -> None:
        self.qdd = rate_of(_STILL, self.qd, 1.0 / self.cycle)
        self.qd = self.tcp_twist = _STILL
        self._rate = self._scale
        self._still_for += self.cycle

    def _report(self, motion: _Motion) -> None:
        """Let the call return when it may, and what waited for rest begin."""
        move = self._move
        if isinstance(motion, Track):
            self._look_at_speed(motion)
            if motion.may_return(self.cycle):
                motion.tip.call.returned = True
            if motion.finished:
                self._motion = None
                self._come_to_rest()
        elif isinstance(self._motion, _Stop):
            if self._motion.over:
                self._motion = None
                self._come_to_rest()
        elif move is not None and motion.over:
            move.returned = True

    def _look_at_speed(self, track: Track) -> None:
        """Say once of a movep that it is too fast: slowed down, or too hard on a joint."""
        call = track.tip.call
        if not self._circular or call is self._too_fast:
            return
        slowed = self._rate < self._scale / _WITHIN
        hard = isinstance(track.pieces[track.index].path, Fillet) and (
            lead(self.qdd, _STILL) > MAX_JOINT_ACCELERATION
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

    def _come_to_rest(self) -> None:
        """End what has come to rest, and begin what waited for that."""
        if self._then is None:
            if self._move is not None:
                self._move.returned = True
            return
        call, self._then = self._then, None
        try:
            self._begin(call)
        except MotionError as error:
            self.fault = MotionFault(code=171, argument=0, text=str(error))

    def _run_out(self, motion: JointSpeed | Servo | ToolSpeed) -> _Motion:
        """Brake, because nobody has called again in time."""
        if isinstance(motion, ToolSpeed):
            return ToolStop(
                self.T_base_tcp, self._real_twist(), motion.acceleration, motion.acceleration_rot
            )
        a = RUN_OUT_BRAKING if isinstance(motion, Servo) else motion.acceleration
        return JointStop(self.q, self._real_joint_speed(), a)

    # -- beginning a motion ------------------------------------------------------------------

    def _joint_leg(self, q: Vector6) -> Callable[[Start], Leg]:
        return lambda start: JointLine(start.q, q, self._forward)

    def _follow(
        self,
        name: str,
        leg: Callable[[Start], Leg],
        law: Law | Callable[[Leg, Start], Law],
        radius: float,
    ) -> Move:
        chosen = (lambda _leg, _start: law) if isinstance(law, Law) else law
        if isinstance(law, Law):
            check_law(name, law)
        if not 0.0 <= radius < inf:
            raise MotionError(f'{name}: the blend radius is {radius:g} m, it must be 0 or more.')
        call = Call(name, leg, chosen, radius, Move())
        self._begin(call)
        return call.move

    def _begin(self, call: Call) -> None:
        self._skip_overlapping()
        motion = self._motion
        if isinstance(motion, Track) and motion.tip.call.returned:
            if self._tcp_kept:
                self._join(motion, call)
            else:
                # A corner is one of two legs of the same point: first to the waypoint.
                self._move, self._then = call.move, call
        elif motion is None:
            self._set_out(call)
        else:
            # A path begins at rest or in a blend, nowhere else: brake first.
            stop = JointStop(self.q, self._real_joint_speed(), RUN_OUT_BRAKING)
            self._take_over(stop)
            self._move = call.move
            self._then = call
            if stop.over:
                self._motion = None
                self._come_to_rest()

    def _set_out(self, call: Call) -> None:
        """Begin from rest."""
        self._use_tcp()
        start = Start(self.q, self.T_base_tcp)
        leg = call.leg(start)
        track = from_rest(leg, call.law(leg, start), call.radius, call.move)
        room = _length(start.pose, leg) - call.radius
        self._run(None, track, call, room)

    def _join(self, track: Track, call: Call) -> None:
        """Go on from a leg whose blend is about to begin or has begun."""
        before = track.tip
        pose = before.leg.pose(before.leg.length)
        q = self._branch().at_end_of(before.leg)
        if q is None and call.name.endswith('j'):
            # No joint line begins where the arm cannot come: let it fail on its way there.
            self._move, self._then = call.move, call
            return
        q = q or self.q
        start = Start(q, pose)
        leg = call.leg(start)
        law = call.law(leg, start)
        circular = call.name == 'movep' and self._circular
        blended, whole = joined(track, leg, law, call.radius, call.move, circular)
        way = _length(pose, leg)
        if not whole and call.radius <= 0.0 and way <= before.radius:
            self._warn(
                197,
                0,
                (
                    f'Blend overlap: the waypoint of this {call.name} lies within the blend '
                    'before it, so the arm stops at the waypoint before.'
                ),
            )
        room = way - call.radius - (before.radius if call.radius > 0.0 else 0.0)
        self._run(track, blended, call, room)

    def _run(self, before: Track | None, track: Track, call: Call, room: float) -> None:
        """
        Follow a track.

        A waypoint whose blend reaches into the one before (``room`` [m] is missing) is skipped
        if the program goes on at once; if nothing follows, the arm goes there.
        """
        overlapping = call.radius > 0.0 and room < -_TOUCHING
        self._overlapping = (before, self._circular, call.name) if overlapping else None
        self._circular = call.name == 'movep'
        self._motion, self._move = track, call.move
        call.move.returned = overlapping or track.may_return(self.cycle)
        if before is None and track.pieces[0].profile.duration <= 0.0:
            self._motion, call.move.returned = None, True

    def _skip_overlapping(self) -> None:
        """Forget a waypoint that overlaps, now that another motion follows at once."""
        if self._overlapping is None:
            return
        self._motion, self._circular, name = self._overlapping
        self._overlapping = None
        self._warn(171, SKIPPED[name], f'Overlapping blends in a {name}, a waypoint was skipped.')

    def _drivable(self, name: str, radius: float, speed: float) -> float:
        """Return the radius, 0 where the tool passes it within one cycle: that is no blend."""
        if not 0.0 < radius < speed * self.cycle:
            return radius
        self._warn(
            171,
            TOO_SMALL[name],
            (
                f'Blend radius too small in a {name}: {radius:g} m is less than the way of one '
                'cycle, so the arm stops at the waypoint.'
            ),
        )
        return 0.0

    def _warn(self, code: int, argument: int, text: str) -> None:
        self.warnings.append(MotionWarning(code=code, argument=argument, text=text))

    def _take_over(self, motion: _Motion) -> Move:
        """Run a motion without a path from now on."""
        self._abort()
        self._use_tcp()
        self._motion, self._move = motion, Move()
        if isinstance(motion, _Speeding) and motion.duration is not None:
            self._move.returned = motion.over
        return self._move

    def _abort(self) -> None:
        if self._move is not None and not self._move.returned:
            self._move.returned = self._move.aborted = True
        self._then = self._overlapping = None

    # -- kinematics --------------------------------------------------------------------------

    def _forward(self, q: Vector6) -> Pose:
        return self.arm.forward(q) @ self._T_flange_tcp

    def _branch(self) -> Branch:
        return Branch(self._reach, self.q, self.T_base_tcp, self._T_tcp_flange)

    def _use_tcp(self) -> None:
        self._T_tcp_flange = self._T_flange_tcp.inverse()
        self._used_tcp = self._T_flange_tcp

    @property
    def _tcp_kept(self) -> bool:
        return self._used_tcp is self._T_flange_tcp

    def _optimal(self, a: float, v: float) -> Callable[[Leg, Start], Law]:
        def law(leg: Leg, start: Start) -> Law:
            return self._reach.fastest(leg, start.q, self._T_tcp_flange, a, v)

        return law

    def _real_joint_speed(self) -> Vector6:
        """Return the joint speed at the end of the last cycle (``qd`` is the mean of it)."""
        motion = self._motion
        if motion is None or isinstance(motion, JointStop):
            return _STILL if motion is None else motion.qd
        if isinstance(motion, JointSpeed | Servo):
            return rate_of(motion.qd, _STILL, self._rate)
        return self.qd

    def _real_twist(self) -> Vector6:
        motion = self._motion
        if motion is None or isinstance(motion, ToolStop):
            return _STILL if motion is None else motion.twist
        if isinstance(motion, ToolSpeed):
            return rate_of(motion.twist, _STILL, self._rate)
        return self.tcp_twist

    def _nominal_joint_speed(self) -> Vector6:
        """Return the joint speed as it would be without speed scaling."""
        if isinstance(self._motion, JointSpeed | Servo):
            return self._motion.qd
        return self._unscaled(self._real_joint_speed())

    def _unscaled(self, speed: Vector6) -> Vector6:
        if self._motion is None or self._scale <= 0.0:
            return _STILL
        return rate_of(speed, _STILL, 1.0 / self._scale)


def _cut(step: tuple[float, float], before: tuple[float, float]) -> float:
    """
    Return by what to divide a step so that it is not too long: a secant in logarithms.

    :param step: the step and by which factor it is too long; ``before``: the last one.
    """
    (h, ratio), (h_before, ratio_before) = step, before
    if ratio_before <= ratio:
        return ratio
    power = log(h_before / h) / log(ratio_before / ratio)
    return min(float(ratio ** min(max(power, 1.0), _HIGHEST_POWER)), _DEEPEST * ratio)


def _length(start: Pose, leg: Leg) -> float:
    """Return how far the waypoint is from the start [m]."""
    return start.distance_to(leg.pose(leg.length))
