# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Script functions that move the arm; `motion_ownership` decides which thread can call them."""

from __future__ import annotations

from collections.abc import Callable

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector6, ZERO6
from ur_cartesian_driver.motion.twin.laws import ASSUMED_LAWS
from ur_cartesian_driver.sim.builtins.arguments import (
    not_negative,
    number,
    one_of,
    pose,
    positive,
    six,
    within,
)
from ur_cartesian_driver.sim.builtins.builtin_group import BuiltinGroup, without_effect
from ur_cartesian_driver.sim.builtins.kinematics_builtins import joints_of, pose_of
from ur_cartesian_driver.sim.controller import MAX_HISTORY
from ur_cartesian_driver.sim.motion import MotionGenerator, Move
from ur_cartesian_driver.sim.motion.contact.contact_motion import ForceMode
from ur_cartesian_driver.sim.motion.motion_ownership import FreedriveState, Steps
from ur_cartesian_driver.urscript.script_errors import RuntimeException
from ur_cartesian_driver.urscript.script_values import Struct, Value

# The defaults in the signatures. A call without `a` or `v` passes these very objects, and then the
# robot's own laws supply the values.
_JOINT_A, _JOINT_V = ASSUMED_LAWS.timed_joint_acceleration, ASSUMED_LAWS.timed_joint_speed
_LINEAR_A, _LINEAR_V = ASSUMED_LAWS.timed_linear_acceleration, ASSUMED_LAWS.timed_linear_speed


class MotionBuiltins(BuiltinGroup):
    """Moves to a waypoint, streams of set-points, and stops."""

    @property
    def _motion(self) -> MotionGenerator:
        return self._controller.motion

    def _take(self, waypoint: Pose | None = None) -> None:
        """
        Take ownership of the motion, and note the waypoint (None for set-point streams).

        :raises RuntimeException: the arm is in freedrive, or another thread owns the motion.
        """
        freedrive = self._controller.freedrive
        if freedrive is not FreedriveState.OFF:
            raise RuntimeException(f'The robot cannot move: it is in {freedrive.value}.')
        self._controller.ownership.take(self._controller.programs.current_thread)
        self._controller.waypoint = waypoint

    def _run(
        self, call: Callable[[], Move], waypoint: Pose | None = None, abortable: bool = False
    ) -> Steps:
        """
        Take ownership, call the motion generator, and wait until the call can return.

        :param waypoint: the target pose of a move; None for a stream of set-points.
        :param abortable: whether the interpreter command `abort` ends the call.
        """
        self._take(waypoint)
        yield from self._controller.ownership.run(call, abortable)

    def _stop(self, call: Callable[[], Move]) -> Steps:
        """Take ownership and stop; unlike moves, stops are possible in freedrive."""
        self._controller.ownership.take(self._controller.programs.current_thread)
        yield from self._controller.ownership.run(call)

    def _joints(self, q: Value, function: str) -> Vector6:
        return joints_of(self._controller, q, function)

    def _pose(self, value: Value, name: str = 'pose') -> Pose:
        return pose_of(self._controller, value, name)

    def movej(
        self,
        q: Value,
        a: Value = _JOINT_A,
        v: Value = _JOINT_V,
        t: Value = 0,
        r: Value = 0,
    ) -> Steps:
        """Move straight in joint space; a pose is converted to its nearest joint solution."""
        laws = self._motion.laws
        limits = _limits(
            laws.timed_joint_acceleration if a is _JOINT_A else a,
            laws.timed_joint_speed if v is _JOINT_V else v,
            t,
        )
        radius = not_negative(r, 'r')
        target = self._joints(q, 'movej')
        yield from self._run(
            lambda: self._motion.movej(target, *limits, radius),
            self._pose(list(target)),
            abortable=True,
        )

    def movel(
        self, pose: Value, a: Value = _LINEAR_A, v: Value = _LINEAR_V, t: Value = 0, r: Value = 0
    ) -> Steps:
        """Move the tool straight; joint positions are converted to the TCP pose."""
        laws = self._motion.laws
        limits = _limits(
            laws.timed_linear_acceleration if a is _LINEAR_A else a,
            laws.timed_linear_speed if v is _LINEAR_V else v,
            t,
        )
        radius = not_negative(r, 'r')
        target = self._pose(pose)
        yield from self._run(
            lambda: self._motion.movel(target, *limits, radius), target, abortable=True
        )

    def movep(self, pose: Value, a: Value = 1.2, v: Value = 0.25, r: Value = 0) -> Steps:
        """Move the tool straight at constant speed, with corners rounded by arcs."""
        a_, v_, _ = _limits(a, v, 0)
        radius = not_negative(r, 'r')
        target = self._pose(pose)
        yield from self._run(lambda: self._motion.movep(target, a_, v_, radius), target)

    def movec(
        self,
        pose_via: Value,
        pose_to: Value,
        a: Value = 1.2,
        v: Value = 0.25,
        r: Value = 0,
        mode: Value = 0,
    ) -> Steps:
        """Move on a circular arc through `pose_via` to `pose_to`."""
        a_, v_, _ = _limits(a, v, 0)
        radius, mode_ = not_negative(r, 'r'), one_of(mode, 'mode', (0, 1))
        via, to = self._pose(pose_via, 'pose_via'), self._pose(pose_to, 'pose_to')
        yield from self._run(lambda: self._motion.movec(via, to, a_, v_, radius, mode_), to)

    def optimovej(self, goal: Value, a: Value = 0.3, v: Value = 0.3, r: Value = 0) -> Steps:
        """Move in joint space with limited jerk; `a` and `v` are fractions of the joint limits."""
        a_, v_, radius = _fraction(a, 'a'), _fraction(v, 'v'), not_negative(r, 'r')
        target = self._joints(_without_frame(goal), 'optimovej')
        yield from self._run(
            lambda: self._motion.optimovej(target, a_, v_, radius), self._pose(list(target))
        )

    def optimovel(self, goal: Value, a: Value = 0.3, v: Value = 0.3, r: Value = 0) -> Steps:
        """Move the tool straight with limited jerk; `a`, `v` are fractions of the joint limits."""
        a_, v_, radius = _fraction(a, 'a'), _fraction(v, 'v'), not_negative(r, 'r')
        target = self._pose(_without_frame(goal), 'goal')
        yield from self._run(lambda: self._motion.optimovel(target, a_, v_, radius), target)

    def servoj(
        self,
        q: Value,
        a: Value = 0,
        v: Value = 0,
        t: Value = 0.002,
        lookahead_time: Value = 0.1,
        gain: Value = 300,
    ) -> Steps:
        """Follow a set-point for `t` seconds; `a` and `v` are ignored, as on the robot."""
        target = six(q, 'q')
        settings = (
            positive(t, 't'),
            within(lookahead_time, 'lookahead_time', 0.03, 0.2),
            within(gain, 'gain', 100, 2000),
        )
        yield from self._run(lambda: self._motion.servoj(target, *settings))

    def servoc(self, pose: Value, a: Value = 1.2, v: Value = 0.25, r: Value = 0) -> Steps:
        """
        Move like `movep`; how the manual's "servo circular" differs from it is not published.

        A call takes at least one cycle, even if the tool is already at the target: programs call
        `servoc` in a loop in which nothing else takes time.
        """
        passed = False
        for _ in self.movep(pose, a, v, r):
            passed = True
            yield
        if not passed:
            yield

    def speedj(self, qd: Value, a: Value, t: Value = None) -> Steps:
        """Change to joint speeds; return after `t`, or (if None) once the speeds are reached."""
        target, acceleration, time = six(qd, 'qd'), positive(a, 'a'), _duration(t)
        yield from self._run(lambda: self._motion.speedj(target, acceleration, time))

    def speedl(self, xd: Value, a: Value, t: Value = None, aRot: Value = 'a') -> Steps:
        """Change to a tool speed; return after `t`, or (if None) once the speed is reached."""
        twist, acceleration, time = six(xd, 'xd'), positive(a, 'a'), _duration(t)
        angular_acceleration = acceleration if aRot == 'a' else positive(aRot, 'aRot')
        yield from self._run(
            lambda: self._motion.speedl(twist, acceleration, time, angular_acceleration)
        )

    def stopj(self, a: Value) -> Steps:
        """Brake in joint space; return when the arm is at rest."""
        acceleration = positive(a, 'a')
        yield from self._stop(lambda: self._motion.stopj(acceleration))

    def stopl(self, a: Value, aRot: Value = 'a') -> Steps:
        """Brake the tool along its tangent; return when the arm is at rest."""
        acceleration = positive(a, 'a')
        angular_acceleration = acceleration if aRot == 'a' else positive(aRot, 'aRot')
        yield from self._stop(lambda: self._motion.stopl(acceleration, angular_acceleration))

    @without_effect
    def direct_torque(
        self,
        torque: Value,
        friction_comp: Value = True,
        viscous_scale: Value = None,
        coulomb_scale: Value = None,
    ) -> Steps:
        """Check the torques and wait a cycle; torques cannot move an arm without dynamics."""
        six(torque, 'torque')
        self._take()
        yield

    def is_steady(self) -> bool:
        """Return whether the arm has stood still for half a second."""
        return self._motion.steady


class ModeBuiltins(BuiltinGroup):
    """Freedrive (as a state only), force mode and tool contact."""

    def freedrive_mode(self, freeAxes: Value = None, feature: Value = None) -> None:
        """Enter freedrive, in which a person can move the arm by hand."""
        if freeAxes is not None:
            six(freeAxes, 'freeAxes')
        self._controller.freedrive = FreedriveState.FREEDRIVE

    def freedrive_mode_no_incorrect_payload_check(self) -> None:
        """Enter freedrive; the payload is not checked here in any case."""
        self._controller.freedrive = FreedriveState.FREEDRIVE

    def end_freedrive_mode(self) -> None:
        """Leave freedrive or teach mode; harmless if the arm is in neither."""
        self._controller.freedrive = FreedriveState.OFF

    def get_freedrive_status(self) -> int:
        """Return 0 (normal operation): a simulated arm is never pushed near a singularity."""
        return 0

    def teach_mode(self) -> None:
        """Enter teach mode, in which a person can move the arm by hand."""
        self._controller.freedrive = FreedriveState.TEACH

    end_teach_mode = end_freedrive_mode

    def force_mode(
        self, task_frame: Value, selection_vector: Value, wrench: Value, type: Value, limits: Value
    ) -> None:
        """Enter or change force mode; every `type` is treated as 2, which has a fixed frame."""
        frame = pose(task_frame, 'task_frame')
        compliant = tuple(flag != 0.0 for flag in six(selection_vector, 'selection_vector'))
        one_of(type, 'type', (1, 2, 3))
        bounds = six(limits, 'limits')
        for i, bound in enumerate(bounds):
            not_negative(bound, f'limits[{i}]')
        self._controller.contact.force_mode = ForceMode(
            q_base_task=frame.quaternion,
            compliant=compliant,
            wrench=six(wrench, 'wrench'),
            limits=bounds,
        )

    def end_force_mode(self) -> None:
        """Leave force mode."""
        self._controller.contact.force_mode = None

    def force_mode_set_damping(self, damping: Value) -> None:
        """Store a damping of 0..1; the simulated force law has none."""
        self._controller.stored.force_damping = within(damping, 'damping', 0, 1)

    def force_mode_get_damping(self) -> float:
        """Return the damping of force mode, 0..1."""
        return self._controller.stored.force_damping

    def force_mode_set_gain_scaling(self, scaling: Value) -> None:
        """Set the factor (0..2) on the speed of a compliant axis for a given force error."""
        self._controller.contact.gain_scaling = within(scaling, 'scaling', 0, 2)

    def tool_contact(self, direction: Value = None) -> int:
        """Return the number of cycles since the tool was last free of contact; 0 = no contact."""
        wanted = ZERO6 if direction is None else six(direction, 'direction')
        return min(self._controller.contact.steps_back(wanted[:3]), MAX_HISTORY - 1)


def _limits(a: Value, v: Value, t: Value) -> tuple[float, float, float]:
    """
    Return `a`, `v` and `t` as numbers.

    If `t` is above 0, `a` and `v` only shape the ramps, so they need not be positive.
    """
    time = not_negative(t, 't')
    if time > 0.0:
        return number(a, 'a'), number(v, 'v'), time
    return positive(a, 'a'), positive(v, 'v'), 0.0


def _without_frame(goal: Value) -> Value:
    if isinstance(goal, str | Struct):
        raise RuntimeException(
            'goal names a frame, and frames are not simulated; give joint positions or a pose'
        )
    return goal


def _fraction(value: Value, name: str) -> float:
    fraction = number(value, name)
    if not 0.0 < fraction <= 1.0:
        raise RuntimeException(f'{name} is {fraction:g}; it must be a fraction within (0, 1]')
    return fraction


def _duration(value: Value) -> float | None:
    """Return the duration of a speed command; None = until the speed is reached."""
    return None if value is None else not_negative(value, 't')
