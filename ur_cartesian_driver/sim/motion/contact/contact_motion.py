# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The compliance of an arm, in contact with bodies and in force mode.

The robot's laws are not published; the following simple laws are ours. Along axes that are not
compliant, the arm is a spring between its target and the tool. In force mode the tool moves along
each compliant axis at a speed proportional to the missing force (the difference between the wanted
force and the force that the tool applies), up to the axis's limit. The controller adds this motion
to the target of the program. When force mode has ended and the arm stands still, the program
continues from the displaced target.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import NamedTuple

from ur_cartesian_driver.kinematics.inverse import nearest
from ur_cartesian_driver.motion.geometry.pose import (
    conjugate,
    multiply,
    Pose,
    Quaternion,
    quaternion_from_rotation_vector,
    rotate,
)
from ur_cartesian_driver.motion.geometry.vectors import (
    add,
    add6,
    dot,
    scale6,
    subtract6,
    Vector3,
    Vector6,
    vector6,
    ZERO6,
)
from ur_cartesian_driver.sim.motion.contact.contact_bodies import ContactBody
from ur_cartesian_driver.sim.motion.motion_generator import MotionGenerator
from ur_cartesian_driver.sim.motion.motion_values import MotionFault

#: Stiffness of an arm at its tool [N/m, Nm/rad]; time constant of its bending [s]. Both assumed.
ARM_STIFFNESS: Vector6 = (20e3, 20e3, 20e3, 2e3, 2e3, 2e3)
BENDING_TIME = 0.02
#: Speed along a compliant axis per missing force [m/s per N, rad/s per Nm]. Assumed.
COMPLIANCE: Vector6 = (1e-3, 1e-3, 1e-3, 0.1, 0.1, 0.1)
#: Force on the tool above which the arm stops [N]: the default force limit of a robot.
MAX_FORCE = 150.0
#: Smallest force on the tool that the controller reports as contact [N]. Assumed.
CONTACT_FORCE = 5.0
_SMALL = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceMode:
    """The arguments of ``force_mode``."""

    #: Orientation of the task frame in the base.
    q_base_task: Quaternion
    compliant: tuple[bool, ...]
    #: Forces that the tool has to apply along compliant axes [N, Nm].
    wrench: Vector6
    #: Bounds of the speed on compliant axes [m/s, rad/s]; of the deviation on others [m, rad].
    limits: Vector6


class ArmState(NamedTuple):
    """Position and motion of an arm."""

    q: Vector6
    qd: Vector6
    T_base_tcp: Pose
    tcp_twist: Vector6


class ContactMotion:
    """
    The deviation of a tool from its target, and the force on the tool; call `step` once per cycle.

    :param bodies: the bodies that the tool can touch.
    """

    def __init__(self, motion: MotionGenerator, bodies: Sequence[ContactBody]) -> None:
        """Begin without contact and without force mode."""
        self._motion, self.bodies = motion, tuple(bodies)
        #: Fraction of the difference from the static bend that disappears in a cycle.
        self._share = motion.cycle / (motion.cycle + BENDING_TIME)
        self.force_mode: ForceMode | None = None
        #: Factor on :data:`COMPLIANCE`, set by programs.
        self.gain_scaling = 1.0
        #: Wrench of the bodies on the TCP, in base axes [N, Nm].
        self.wrench: Vector6 = ZERO6
        #: Deviation of the tool from its target, in base axes [m, rad]; None = no deviation.
        self.deviation: Vector6 | None = None
        #: Rate of the deviation, in base axes [m/s, rad/s]; None = no deviation.
        self.twist: Vector6 | None = None
        #: The target of the program, displaced by force mode; None = not displaced.
        self.target: ArmState | None = None
        #: The reason why the arm has to stop; None = no reason.
        self.fault: MotionFault | None = None
        self._zero: Vector6 = ZERO6
        #: Displacement by force mode, in base axes [m, rad].
        self._yielded: Vector6 = ZERO6
        #: Rate of ``_yielded``.
        self._yield_rate: Vector6 = ZERO6
        #: Bend of the arm under the contact forces, in base axes [m, rad].
        self._bent: Vector6 = ZERO6
        self._cycles_in_contact = 0

    @property
    def measured(self) -> Vector6:
        """The wrench that the sensor measures, relative to the wrench at the last `zero`."""
        return subtract6(self.wrench, self._zero)

    def zero(self) -> None:
        """Zero the sensor at its present wrench."""
        self._zero = self.wrench

    def steps_back(self, direction: Vector3) -> int:
        """
        Return the number of cycles since the tool was last free of contact; 0 = no contact.

        :param direction: direction of motion that the contact has to oppose; zeros = any contact.
        """
        force = self.wrench[:3]
        if hypot(*force) < CONTACT_FORCE or (any(direction) and dot(direction, force) >= 0.0):
            return 0
        return self._cycles_in_contact + 1

    def step(self, *, may_move: bool) -> None:
        """
        Compute one cycle.

        :param may_move: whether force mode can move the arm: it has power, and the program is
            playing.
        """
        self.fault = None
        mode = self.force_mode
        if not self.bodies and mode is None and self.deviation is None:
            return
        if mode is None and any(self._yielded) and not self._motion.moving:
            self._take_over()
        deviation = add6(self._yielded, self._bent)
        self.wrench = self._contact(deviation)
        yielded = self._yielded
        self._cycles_in_contact = self._cycles_in_contact + 1 if any(self.wrench) else 0
        if mode is None:
            self._bend(self.wrench)
        else:
            self._comply(mode, may_move)
        moved = add6(self._yielded, self._bent)
        rate = 1.0 / self._motion.cycle
        self.twist = scale6(subtract6(moved, deviation), rate)
        self._yield_rate = scale6(subtract6(self._yielded, yielded), rate)
        self.target = self._yielding_target(rate) if any(self._yielded) else None
        at_target = max(map(abs, moved)) < _SMALL and mode is None
        self.deviation = None if at_target else moved
        if at_target:
            self.twist = None
        if hypot(*self.wrench[:3]) > MAX_FORCE:
            self.fault = MotionFault(
                code=157, argument=0, text=f'The force on the tool is above {MAX_FORCE:g} N'
            )

    def _contact(self, deviation: Vector6) -> Vector6:
        """Return the wrench of the bodies on the TCP; its torque is 0."""
        force: Vector3 = (0.0, 0.0, 0.0)
        if self.bodies:
            dx, dy, dz, *_ = deviation
            point = add(self._motion.T_base_tcp.position, (dx, dy, dz))
            twist = self._motion.tcp_twist
            velocity = add6(twist, self.twist or ZERO6)[:3]
            for body in self.bodies:
                force = add(force, body.force(point, velocity))
        return (*force, 0.0, 0.0, 0.0)

    def _bend(self, wrench: Vector6, free: Sequence[bool] = (False,) * 6) -> None:
        """Bend the arm along the axes that are not compliant (``free``); all in one frame."""
        self._bent = vector6(
            0.0 if is_free else bent + self._share * (force / stiffness - bent)
            for is_free, bent, force, stiffness in zip(
                free, self._bent, wrench, ARM_STIFFNESS, strict=True
            )
        )

    def _comply(self, mode: ForceMode, may_move: bool) -> None:
        to_task, to_base = conjugate(mode.q_base_task), mode.q_base_task
        yielded, bent = turned(to_task, self._yielded), turned(to_task, self._bent)
        applied = turned(to_task, self.measured)
        # A bend along a compliant axis at the start of force mode remains as a displacement.
        # Along the other axes, a displacement (left over from an earlier task frame) decays.
        kept = 1.0 - self._share
        yielded = vector6(
            y + b if free else kept * y
            for y, b, free in zip(yielded, bent, mode.compliant, strict=True)
        )
        if may_move:
            cycle, gain = self._motion.cycle, self.gain_scaling
            yielded = vector6(
                y + cycle * max(-limit, min(limit, gain * rate * (wanted + force))) if free else y
                for y, free, rate, wanted, force, limit in zip(
                    yielded,
                    mode.compliant,
                    COMPLIANCE,
                    mode.wrench,
                    applied,
                    mode.limits,
                    strict=True,
                )
            )
        self._bent = bent
        self._bend(turned(to_task, self.wrench), mode.compliant)
        for free, off, limit in zip(mode.compliant, self._bent, mode.limits, strict=True):
            if not free and abs(off) > limit:
                self.fault = MotionFault(
                    code=153, argument=0, text='Position deviates from path: force mode limit'
                )
        self._yielded, self._bent = turned(to_base, yielded), turned(to_base, self._bent)

    def _yielding_target(self, rate: float) -> ArmState | None:
        """Return the target displaced by force mode; if it is out of reach, the previous one."""
        motion, before = self._motion, self.target
        target, (x, y, z, *turn) = motion.T_base_tcp, self._yielded
        pose = Pose(
            add(target.position, (x, y, z)),
            multiply(quaternion_from_rotation_vector(turn), target.quaternion),
        )
        q_before = motion.q if before is None else before.q
        q = nearest(motion.arm, pose @ motion.T_flange_tcp.inverse(), q_before)
        if q is None:
            return before
        return ArmState(
            q=q,
            qd=scale6(subtract6(q, q_before), rate),
            T_base_tcp=pose,
            tcp_twist=add6(motion.tcp_twist, self._yield_rate),
        )

    def _take_over(self) -> None:
        """Make the program continue from the target that force mode has displaced."""
        if self.target is not None:
            self._motion.teleport(self.target.q)
            self._yielded, self.target = ZERO6, None


def turned(q: Quaternion, vector: Vector6) -> Vector6:
    """Return a vector of two 3-vectors (twist, wrench) with both of them rotated."""
    return (*rotate(q, vector[:3]), *rotate(q, vector[3:]))
