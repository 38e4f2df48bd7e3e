# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The instructions of the trajectory point interface, by which the robot program gets a trajectory.

Each instruction is sent as one record. There is one class for each URScript motion; others switch
outputs, act at a stop, or give parameters to the next instruction. The target of a motion is
either a :class:`Pose` (of the TCP, in the robot's base) or six joint positions [rad]; an arc may
have one of each as target and via. The type number in the record of a motion follows from the
class and the kinds of its targets.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import TypeAlias

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import Joints, Vector3, Vector6, ZERO6
from ur_cartesian_driver.motion.goal.goal import ArcMode, ContactEnd, InputKind, OutputKind
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain

Target: TypeAlias = Pose | Joints

#: Default speed and acceleration of the interface: [rad/s], [rad/s^2] of the leading axis (the
#: joint with the longest way), or [m/s], [m/s^2] of the tool.
DEFAULT_VELOCITY = 1.04
DEFAULT_ACCELERATION = 1.4


@dataclass(frozen=True, slots=True, kw_only=True)
class _Move:
    """The common fields of all motions to a target; the blend radius is in [m]."""

    target: Target
    velocity: float = DEFAULT_VELOCITY
    acceleration: float = DEFAULT_ACCELERATION
    blend_radius: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _MoveNear(_Move):
    """A motion with ``q_near``, which selects the joint solution of a pose target."""

    q_near: Joints | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveJ(_MoveNear):
    """
    Straight line in joint space.

    ``q_near`` (with a pose target only) chooses the joint solution. A ``duration`` [s] > 0
    replaces velocity [rad/s] and acceleration [rad/s^2] of the leading axis.
    """

    duration: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveL(_MoveNear):
    """
    Straight line of the tool, with the tool's velocity [m/s] and acceleration [m/s^2].

    A joint target stands for the TCP pose at these joint positions. ``q_near`` is sent
    too, but the robot ignores it.
    """

    duration: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveP(_MoveNear):
    """Straight line at constant tool speed, blended by circular fillets; has no duration."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MoveC(_Move):
    """Circular arc through ``via`` to ``target``; has no duration."""

    via: Target
    mode: ArcMode = ArcMode.UNCONSTRAINED


@dataclass(frozen=True, slots=True, kw_only=True)
class OptimoveJ(_MoveNear):
    """Joint motion with limited jerk; velocity and acceleration are fractions in (0, 1]."""

    velocity: float = 0.3
    acceleration: float = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class OptimoveL(_MoveNear):
    """Straight line with limited jerk; velocity and acceleration are fractions in (0, 1]."""

    velocity: float = 0.3
    acceleration: float = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Spline:
    """
    A piece of a joint spline: quintic if it has accelerations, else cubic.

    :param target: joint positions [rad] at the end.
    :param velocities: joint velocities [rad/s] at the end.
    :param accelerations: joint accelerations [rad/s^2] at the end.
    :param duration: [s].
    """

    target: Joints
    velocities: Vector6
    accelerations: Vector6 | None = None
    duration: float


def still_spline(before: Spline, duration: float) -> Spline:
    """Return a piece that holds the joints at the end of ``before`` for a time [s]."""
    return Spline(
        target=before.target,
        velocities=ZERO6,
        accelerations=None if before.accelerations is None else ZERO6,
        duration=duration,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class SwitchOutput:
    """
    Not a motion: the robot program switches an output as the tool passes the trigger pose.

    Its record comes after the motion during or after which the output switches; it takes no time.
    """

    output: OutputKind
    pin: int
    #: Digital 0 or 1; analog a fraction of the range.
    value: float
    domain: AnalogDomain = AnalogDomain.CURRENT
    #: Pose of the TCP in base at which to switch; None = when the preceding motion has ended.
    trigger_pose: Pose | None = None
    #: Unit direction of the motion at the trigger pose, linear or angular, in the axes of this
    #: pose. The output switches when the tool crosses, in this direction, the plane through the
    #: trigger pose that is normal to the direction.
    trigger_direction: Vector6 = ZERO6
    #: Whether the tool is already past the plane when the record is read; the output then waits
    #: until the tool has gone back through the plane and crosses it anew.
    starts_beyond: bool = False
    #: Delay after the end of the preceding motion [s].
    delay: float = 0.0
    #: Whether an analog output follows the speed, by the :class:`SpeedLaw` before this record,
    #: until the next record that switches this output.
    follows_speed: bool = False
    #: Whether pulses begin, by the :class:`PulseLaw` before this record.
    begins_pulses: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedLaw:
    """
    Not a motion: how the next analog output with ``follows_speed`` depends on the speed.

    The fraction of the range is offset + gain * speed of the tool [m/s], within the bounds;
    ``filter_time`` is the time constant with which the speed is filtered [s].
    """

    gain: float
    offset: float = 0.0
    minimum: float = 0.0
    maximum: float = 1.0
    filter_time: float = 0.0


#: Number of pieces, equal in time, into which a :class:`LeadLaw` divides its ``distance``.
LEAD_PIECES = 11


@dataclass(frozen=True, slots=True, kw_only=True)
class LeadLaw:
    """
    Not a motion: the lead of the next output, and the planned motion to the place of that output.

    The lead is the time by which the output switches before the tool is at the place. With the
    speed slider at 100 %, the tool passes the trigger pose one lead before the place. A slower
    tool switches nearer to the place.
    """

    #: The lead, in real time [s].
    lead: float
    #: Way of the tool from the trigger pose to the place [m]; its turn [rad] if it only turns.
    distance: float
    #: Planned speeds of the tool [m/s or rad/s], from the place back to the trigger pose, evenly
    #: spaced in time. The acceleration between them is constant.
    speeds: tuple[float, ...]
    #: Whether way and speeds are angular.
    turns: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseLaw:
    """
    Not a motion: the parameters of the pulses that the next :class:`SwitchOutput` begins.

    :param slot: index of the output's pulse counter in the robot program.
    :param distance: way of the tool from pulse to pulse [m].
    :param phase: way from the place of the next output to the first pulse [m].
    :param width: duration of a pulse [s].
    :param count: number of pulses.
    :param goes_on: whether the train continues on appended points; pulses that remain at the end
        of the trajectory are then dropped.
    """

    slot: int
    output: OutputKind
    pin: int
    distance: float
    phase: float
    width: float
    count: int
    goes_on: bool = False


#: A record that is neither a motion nor a stop.
OutputRecord: TypeAlias = SwitchOutput | SpeedLaw | LeadLaw | PulseLaw


@dataclass(frozen=True, slots=True, kw_only=True)
class Wait:
    """
    The arm rests for some time; the robot program counts the rest as a motion.

    :param duration: time since the end of the preceding motion [s], without pauses of the program.
    """

    duration: float


@dataclass(frozen=True, slots=True, kw_only=True)
class AwaitInput:
    """
    The arm rests until the level of an input is at or above a threshold, or below it.

    :param threshold: [A] or [V]; a digital input has the level 0 or 1.
    :param below: whether the level has to fall below the threshold.
    :param timeout: longest wait [s], without pauses of the program.
    :param go_on: whether the program goes on after the timeout; if not, it ends the trajectory.
    """

    input: InputKind
    pin: int
    threshold: float
    below: bool
    timeout: float
    go_on: bool = False

    @property
    def condition(self) -> str:
        """The awaited condition, as part of a sentence."""
        name = f'{self.input.name.lower().replace("_", " ")} input {self.pin}'
        if not self.input.is_analog:
            return f'{name} {"off" if self.below else "on"}'
        return f'{name} {"below" if self.below else "at"} {self.threshold:g}'


@dataclass(frozen=True, slots=True, kw_only=True)
class ChangePayload:
    """
    The robot program sets the payload.

    :param mass: [kg].
    :param center_of_gravity: in the flange [m].
    :param inertia: about the centre of gravity, along the axes of the flange [kg m^2].
    :param transition_time: time that the controller takes to change to the payload [s].
    """

    mass: float
    center_of_gravity: Vector3
    inertia: Vector6 = ZERO6
    transition_time: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CallFunction:
    """
    The robot program calls a function of its prelude.

    :param number: the number that ``program.prelude`` gives the function.
    :param arguments: six numbers; unused ones are zeros.
    :param text: the call as it is written, for messages; not sent.
    :param timeout: longest time until the function returns [s]; not sent, because the driver
        watches the time.
    """

    number: int
    arguments: Vector6 = ZERO6
    text: str = field(default='', compare=False)
    timeout: float = field(default=inf, compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class PressLaw:
    """
    The settings of the controller's force mode for the next :class:`BeginPress`.

    :param wrench: force and torque of the tool along compliant axes [N, Nm].
    :param limits: for a compliant axis the largest speed [m/s, rad/s], for another axis the
        largest deviation [m, rad].
    :param zero_sensor: whether the robot program zeroes the force sensor at this record.
    """

    wrench: Vector6
    limits: Vector6
    damping: float
    gain_scaling: float
    zero_sensor: bool = False
    contact: ContactEnd = ContactEnd.NONE


@dataclass(frozen=True, slots=True, kw_only=True)
class BeginPress:
    """
    Force mode begins; without compliant axes, the program only watches for contact.

    :param T_base_task: the frame of the compliant axes.
    :param compliant: 1 for each compliant axis, 0 for each other one.
    :param follows_tool: whether the frame is the TCP's, updated in each cycle.
    """

    T_base_task: Pose
    compliant: Vector6
    follows_tool: bool = False


@dataclass(frozen=True, slots=True)
class EndPress:
    """Force mode ends; if a required contact did not come, the trajectory ends too."""


#: An action of the robot program while the arm is at rest; the program counts it as a motion.
Stop: TypeAlias = (
    Wait | AwaitInput | ChangePayload | CallFunction | PressLaw | BeginPress | EndPress
)
Primitive: TypeAlias = MoveJ | MoveL | MoveP | MoveC | OptimoveJ | OptimoveL | Spline | Stop
#: One record of a trajectory on the wire.
Instruction: TypeAlias = Primitive | OutputRecord
