# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The controller's path offset: a Cartesian offset that is added to the motion of a program.

The motion runs as if there were no offset, and in each cycle the target is displaced by the
filtered offset. Frames, filter, limits and the stop at the end follow the script manual. The
following rules are ours, because the manual has none:

* a new offset replaces the previous offset, even if that was set in another frame;
* the offset remains applied at standstill, in pauses and in stops; while set-points (servoj,
  speedj, speedl) lead the arm, the offset has no effect, and the set-points start from the
  displaced position;
* the frame MOTION keeps its axes while the tool stands still or moves along its own z axis; before
  the first motion this frame does not exist, and offsets in this frame have no effect;
* an offset that needs more than the maximum speed of a joint, or a joint acceleration above
  :data:`MAX_JOINT_ACCELERATION`, causes a protective stop (the manual only warns of such stops);
* when the program ends, the offset remains until the arm stands still; the arm does not return.
"""

from __future__ import annotations

from ur_cartesian_driver.motion.geometry.pose import (
    conjugate,
    multiply,
    Pose,
    quaternion_from_rotation_vector,
    rotate,
    rotation_vector_from_quaternion,
)
from ur_cartesian_driver.motion.geometry.vectors import (
    add,
    cross,
    dot,
    norm,
    scale,
    scale6,
    subtract,
    subtract6,
    unit,
    Vector3,
    Vector6,
    vector6,
    ZERO3,
    ZERO6,
)
from ur_cartesian_driver.sim.motion.arm_target import ArmTarget
from ur_cartesian_driver.sim.motion.kinematics.joint_kinematics import (
    MAX_JOINT_ACCELERATION,
    max_joint_difference,
)
from ur_cartesian_driver.sim.motion.motion_values import MotionFault

#: Frames of an offset, by their numbers in programs.
BASE, TCP, MOTION, WORLD = FRAMES = (1, 2, 3, 4)
#: Default limit of the translation [m]; of the rotation [rad].
MAX_TRANSLATION, MAX_ROTATION = 0.1, 0.52
#: The frame MOTION keeps its axes if the speed of the tool is below this [m/s]; or if the sine of
#: the angle between the motion and the tool's z axis is below this.
_MIN_SPEED, _MIN_ANGLE_SINE = 1e-6, 0.01
#: Smaller differences [m, rad] between filtered and wanted offset are treated as zero.
_NONE = 1e-12
#: A step that exceeds a limit by less than this factor is accepted, because of rounding.
_ROUNDING = 1.0 + 1e-6

Axes = tuple[Vector3, Vector3, Vector3]
_BASE_AXES: Axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


class ControllerPathOffset:
    """
    The offset that a program adds to the target of its motion.

    :param motion_target: the target without an offset.
    """

    def __init__(self, motion_target: ArmTarget) -> None:
        """Begin without an offset."""
        self._motion = motion_target
        self.enabled = False
        #: Coefficient of the filter (1 = no filter); limits along [m] and about [rad] each axis.
        self.alpha, self.max_translation, self.max_rotation = 1.0, MAX_TRANSLATION, MAX_ROTATION
        #: The displaced target; None = there is no offset.
        self.target: ArmTarget | None = None
        self._frame, self._wanted, self._applied = BASE, ZERO6, ZERO6
        #: The axes of the frame MOTION in the base; None before the first motion.
        self._axes: Axes | None = None
        #: Displacement of the joints by the offset [rad]; rate of this displacement [rad/s].
        self._change, self._change_rate = ZERO6, ZERO6

    @property
    def is_active(self) -> bool:
        """Whether the offset is enabled, or still displaces the target."""
        return self.enabled or self.target is not None

    # -- called for programs -------------------------------------------------------------------

    def set(self, frame: int, offset: Vector6) -> None:
        """Set the wanted offset in a frame [m, rad], clamped to the limits."""
        if frame != self._frame:
            self._frame, self._applied = frame, self.applied(frame)
        bounds = (self.max_translation,) * 3 + (self.max_rotation,) * 3
        self._wanted = vector6(
            max(-bound, min(bound, item)) for item, bound in zip(offset, bounds, strict=True)
        )

    def applied(self, frame: int) -> Vector6:
        """Return the currently applied offset, expressed in a frame [m, rad]."""
        if self.target is None or frame == self._frame:
            return self._applied
        motion, displaced = self._motion.T_base_tcp, self.target.T_base_tcp
        if frame == TCP:
            return (motion.inverse() @ displaced).rotation_vector()
        if frame == WORLD:
            return (motion @ displaced.inverse()).rotation_vector()
        shift = subtract(displaced.position, motion.position)
        turn = rotation_vector_from_quaternion(
            multiply(displaced.quaternion, conjugate(motion.quaternion))
        )
        axes = self._axes_of(frame)
        return vector6([dot(axis, each) for each in (shift, turn) for axis in axes])

    def end(self) -> None:
        """End the offset; the motion continues from the displaced position."""
        self.enabled, self._wanted = False, ZERO6
        self.end_displacement()

    def end_displacement(self) -> None:
        """Continue the motion from the displaced position; keep the wanted offset for later."""
        target = self.target
        if target is not None:
            self._motion.take_over(target)
        self.target, self._applied, self._change, self._change_rate = None, ZERO6, ZERO6, ZERO6

    def end_of_program(self) -> None:
        """Keep the offset until the arm stands still; reset limits and filter."""
        self.enabled, self.alpha = False, 1.0
        self.max_translation, self.max_rotation = MAX_TRANSLATION, MAX_ROTATION
        self._axes = None if self.target is None else self._axes

    def forget(self) -> None:
        """Discard the offset, because the arm was teleported."""
        self.target, self._wanted = None, ZERO6
        self.end_displacement()

    # -- one cycle -----------------------------------------------------------------------------

    def step(self, *, moving: bool, is_led: bool) -> MotionFault | None:
        """
        Displace the target for a cycle; return a fault if the arm cannot follow.

        :param moving: whether the arm is in motion.
        :param is_led: whether set-points (servoj, speedj, speedl) lead the arm.
        """
        self._update_axes()
        if not self.enabled and not moving:
            self.end()
        if is_led or (self._frame == MOTION and self._axes is None):
            return None
        before = self._applied
        if self.enabled:
            self._applied = self._filtered(before)
        if self.target is None:
            if not any(self._applied):
                return None
            self.target = self._motion.copy()
        fault = self._displace(self.target)
        if fault is not None:
            self._applied = before
            self.target.hold()
        return fault

    def hold(self) -> None:
        """Keep the displaced target in place for this cycle."""
        if self.target is not None:
            self.target.hold()

    def _filtered(self, before: Vector6) -> Vector6:
        alpha, wanted = self.alpha, self._wanted
        if before == wanted:
            return before
        after = vector6(
            [alpha * a + (1.0 - alpha) * b for a, b in zip(wanted, before, strict=True)]
        )
        return wanted if max_joint_difference(after, wanted) < _NONE else after

    def _displace(self, target: ArmTarget) -> MotionFault | None:
        motion = self._motion
        if any(self._applied):
            pose = self._displaced(motion.T_base_tcp)
            T_tcp_flange = (
                motion.T_tcp_flange if motion.tcp_is_active else motion.T_flange_tcp.inverse()
            )
            q = motion.kinematics.joints(pose @ T_tcp_flange, target.q)
        else:
            pose, q = motion.T_base_tcp, motion.q
        change = None if q is None else subtract6(q, motion.q)
        if q is None or change is None or self._is_sudden(target, q, change):
            return MotionFault(
                code=204,
                argument=1,
                text='Path sanity check: sudden change in target position by a path offset.',
            )
        rate = 1.0 / motion.cycle
        self._change_rate = scale6(subtract6(change, self._change), rate)
        self._change = change
        target.move_to(q, pose)
        return None

    def _is_sudden(self, target: ArmTarget, q: Vector6, change: Vector6) -> bool:
        """Return whether the offset demands too much speed or acceleration of a joint."""
        motion = self._motion
        rate = scale6(subtract6(change, self._change), 1.0 / motion.cycle)
        most = MAX_JOINT_ACCELERATION * motion.cycle
        return (
            max_joint_difference(rate, self._change_rate) > most
            or motion.kinematics.overspeed_factor(q, target.q) > _ROUNDING
        )

    def _displaced(self, pose: Pose) -> Pose:
        """Return a pose of the motion without offset, displaced by the applied offset."""
        offset = self._applied
        if self._frame == TCP:
            return pose @ Pose.from_rotation_vector(offset)
        if self._frame == WORLD:
            return Pose.from_rotation_vector(offset).inverse() @ pose
        axes = self._axes_of(self._frame)
        position = add(pose.position, _in_base(axes, offset[:3]))
        if not any(offset[3:]):
            return Pose(position, pose.quaternion)
        turn = quaternion_from_rotation_vector(_in_base(axes, offset[3:]))
        return Pose(position, multiply(turn, pose.quaternion))

    def _axes_of(self, frame: int) -> Axes:
        return _BASE_AXES if frame == BASE or self._axes is None else self._axes

    def _update_axes(self) -> None:
        """Align the frame MOTION with the tool's direction of motion, if the tool moves."""
        direction = self._motion.tcp_twist[:3]
        speed = norm(direction)
        if speed < _MIN_SPEED:
            return
        along = scale(direction, 1.0 / speed)
        across = cross(along, rotate(self._motion.T_base_tcp.quaternion, (0.0, 0.0, 1.0)))
        if norm(across) > _MIN_ANGLE_SINE:
            across = unit(across)
            self._axes = along, across, cross(along, across)


def _in_base(axes: Axes, vector: Vector3) -> Vector3:
    total = ZERO3
    for axis, value in zip(axes, vector, strict=True):
        total = add(total, scale(axis, value))
    return total
