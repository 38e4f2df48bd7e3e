# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A goal as the client sent it, in the frame of the client.

A goal may be wrong: ``planning.request.validate`` checks it. Only a plan
(:mod:`~ur_cartesian_driver.motion.plan.plan`) is known to be feasible.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector3, Vector6, ZERO3, ZERO6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain


class SegmentType(IntEnum):
    """How the tool gets to a point; the numbers of ``MotionSegment.type``."""

    AUTO = 0
    LINEAR = 1
    JOINT = 2
    CIRCULAR = 3
    PROCESS = 4
    OPTIMIZED_LINEAR = 5
    OPTIMIZED_JOINT = 6


class ArcMode(IntEnum):
    """What the orientation does on an arc; the numbers of URScript's ``movec``."""

    UNCONSTRAINED = 0
    FIXED = 1


class FreeAxis(IntEnum):
    """An axis about which the tool may turn; the numbers of ``MotionSegment.free_axis``."""

    NONE = 0
    X = 1
    Y = 2
    Z = 3


class OutputKind(IntEnum):
    """Which output an :class:`IOCommand` switches."""

    STANDARD_DIGITAL = 0
    CONFIGURABLE_DIGITAL = 1
    TOOL_DIGITAL = 2
    STANDARD_ANALOG = 3


class OnPathTolerance(IntEnum):
    """What follows when the arm leaves the path tolerance."""

    ABORT = 0
    STALL = 1


#: How many pieces of a spline there are in the horizon behind which it can be replaced, at least.
PIECES_PER_HORIZON = 3
#: How long the motion waits for an arm that is off its path where the goal does not say it [s].
DEFAULT_STALL_TIMEOUT = 10.0


class InputKind(IntEnum):
    """Which input an :class:`InputWait` waits for."""

    STANDARD_DIGITAL = 0
    CONFIGURABLE_DIGITAL = 1
    TOOL_DIGITAL = 2
    STANDARD_ANALOG = 3
    TOOL_ANALOG = 4

    @property
    def is_analog(self) -> bool:
        """Whether it has a level [A] or [V]."""
        return self >= InputKind.STANDARD_ANALOG


class PressFrame(IntEnum):
    """Along the axes of which frame a :class:`Press` gives way."""

    #: That of the TCP, as the path turns it.
    TOOL = 0
    #: That of the goal.
    GOAL = 1
    #: That of the robot's controller.
    BASE = 2


class ContactEnd(IntEnum):
    """What the first contact of the tool means to a :class:`Press`."""

    NONE = 0
    #: The goal ends there, and has succeeded.
    ENDS = 1
    #: The same; if it does not come, the goal fails.
    REQUIRED = 2


#: The axes of a frame, and the turns about them.
PRESS_AXES = ('x', 'y', 'z', 'rx', 'ry', 'rz')

#: How far the tool may give way where a press does not say it [m], [rad].
DEFAULT_YIELDS = (0.02, 0.2)


class StaleOffset(IntEnum):
    """What becomes of a path offset of which no newer one comes."""

    #: It stays.
    HOLD = 0
    #: The tool goes back to its path.
    FADE = 1


#: Speed [m/s], acceleration [m/s^2] and timeout [s] of a path offset where the goal gives none.
DEFAULT_OFFSET_MOTION = (0.02, 0.2, 0.5)

#: How much later than planned the end may come where the goal does not say it [s], also how long
#: the arm may take from the program's SUCCESS to rest inside the goal tolerance.
DEFAULT_GOAL_TIME_TOLERANCE = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Posture:
    """The joint positions [rad] to be near to, by joint name; empty = no preference."""

    names: tuple[str, ...] = ()
    values: tuple[float, ...] = ()

    def __bool__(self) -> bool:
        """Tell whether there is any preference (also a malformed one)."""
        return bool(self.names or self.values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Waypoint:
    """One point of a goal, in the frame of the goal."""

    #: When to be there, from the start of the motion [s].
    time: float = 0.0
    pose: Pose
    #: Linear [m/s] and angular [rad/s] velocity at the point.
    twist: Vector6 = ZERO6
    #: Linear [m/s^2] and angular [rad/s^2] acceleration at the point.
    acceleration: Vector6 = ZERO6
    jerk: Vector6 = ZERO6
    posture: Posture = Posture()


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """
    The motion that ends at the waypoint of the same index; its blend lies around that waypoint.

    Units by type: LINEAR, CIRCULAR, PROCESS m/s and m/s^2 of the tool (rad/s, rad/s^2 for a pure
    rotation); JOINT rad/s and rad/s^2 of the leading axis; OPTIMIZED_* fractions in (0, 1].
    """

    type: SegmentType = SegmentType.AUTO
    #: Distance from the waypoint at which both segments are left [m].
    blend_radius: float = 0.0
    #: How long the arm rests at the waypoint [s].
    dwell: float = 0.0
    #: 0 = from the times, else the default.
    velocity: float = 0.0
    acceleration: float = 0.0
    #: A pose on the arc, CIRCULAR only.
    via: Pose | None = None
    via_posture: Posture = Posture()
    arc_mode: ArcMode = ArcMode.UNCONSTRAINED
    #: About which axis the driver may turn the waypoint's pose, from ``free_min`` to ``free_max``
    #: [rad]; both 0 = by any angle.
    free_axis: FreeAxis = FreeAxis.NONE
    free_min: float = 0.0
    free_max: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class IOCommand:
    """Switch an output when the tool passes a waypoint."""

    waypoint: int
    #: Time after the waypoint [s].
    offset: float
    output: OutputKind
    pin: int
    #: Digital 0 or 1; analog a fraction of the range.
    value: float
    #: What an analog output carries.
    domain: AnalogDomain = AnalogDomain.CURRENT


@dataclass(frozen=True, slots=True, kw_only=True)
class InputWait:
    """Wait at a waypoint, where the arm stops, until an input has a value."""

    waypoint: int
    input: InputKind
    pin: int
    #: Digital 0 or 1; analog the level to be reached [A] or [V], or the one to fall below.
    value: float
    below: bool = False
    #: Longest wait [s].
    timeout: float
    #: Whether the motion goes on then; if not, the goal ends.
    go_on: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class PayloadChange:
    """Set the payload of the controller at a waypoint, where the arm stops."""

    waypoint: int
    #: [kg]
    mass: float
    #: In the flange [m].
    center_of_gravity: Vector3 = ZERO3


@dataclass(frozen=True, slots=True, kw_only=True)
class ScriptCall:
    """Call a function of the script prelude at a waypoint, where the arm stops."""

    waypoint: int
    function: str
    arguments: tuple[float, ...] = ()
    #: Longest time until it returns [s].
    timeout: float = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ProportionalOutput:
    """An analog output that follows the speed of the tool between two waypoints."""

    first_waypoint: int
    last_waypoint: int
    #: How much earlier on the path it begins, and ends [s].
    begin_lead: float = 0.0
    end_lead: float = 0.0
    pin: int
    domain: AnalogDomain = AnalogDomain.CURRENT
    #: Fraction of the range per speed [1/(m/s)], and at speed 0.
    gain: float
    offset: float = 0.0
    #: Bounds, fractions of the range.
    minimum: float = 0.0
    maximum: float = 1.0
    #: Time constant of a low-pass filter of first order for the speed [s].
    filter_time: float = 0.0
    #: Value when it does not follow the speed.
    idle: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Press:
    """The controller's force mode between two waypoints, at both of which the arm stops."""

    first_waypoint: int
    last_waypoint: int
    frame: PressFrame = PressFrame.TOOL
    #: The compliant axes of the frame, of :data:`PRESS_AXES`.
    axes: tuple[str, ...] = ()
    #: What the tool applies along each of them [N, Nm].
    forces: tuple[float, ...] = ()
    #: How fast it gives way along each of them [m/s, rad/s]; empty = the default.
    speed_limits: tuple[float, ...] = ()
    #: How far it may be off the path along the others [m], [rad]; 0 = the default.
    max_deviation: float = 0.0
    max_deviation_angle: float = 0.0
    #: How far it may give way along compliant ones [m], [rad]; 0 = the default.
    max_yield: float = 0.0
    max_yield_angle: float = 0.0
    damping: float = 0.005
    gain_scaling: float = 1.0
    #: Whether the force sensor is zeroed before.
    zero_sensor: bool = False
    contact: ContactEnd = ContactEnd.NONE


@dataclass(frozen=True, slots=True, kw_only=True)
class SafeOutput:
    """The value that an output takes when the motion does not go on as planned."""

    output: OutputKind
    pin: int
    #: Digital 0 or 1; analog a fraction of the range.
    value: float
    domain: AnalogDomain = AnalogDomain.CURRENT
    #: Whether it gets its value back after a pause; if not, a pause that changed it ends the goal.
    restore: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerance:
    """
    Largest deviations by axis: 0 = the default, negative = unchecked, positive = the limit.

    Position [m] in the frame of the goal, orientation [rad] as the rotation vector of the error in
    the controlled frame, twist [m/s, rad/s] and acceleration [m/s^2, rad/s^2].
    """

    position: Vector3 = ZERO3
    orientation: Vector3 = ZERO3
    twist: Vector6 = ZERO6
    acceleration: Vector6 = ZERO6


@dataclass(frozen=True, slots=True, kw_only=True)
class PathOffset:
    """How far the path may give way to offsets that come while the arm moves."""

    #: Along the path, across it and normal to both [m]; 0 = not at all.
    limits: Vector3 = ZERO3
    #: Largest speed [m/s] and acceleration [m/s^2] along each of them; 0 = the default.
    speed: float = 0.0
    acceleration: float = 0.0
    #: An offset is stale when it is so old [s]; 0 = the default.
    timeout: float = 0.0
    on_stale: StaleOffset = StaleOffset.HOLD

    def __bool__(self) -> bool:
        """Tell whether the path may give way."""
        return any(self.limits)


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """A Cartesian trajectory and how to execute it."""

    waypoints: Sequence[Waypoint]
    #: Empty, or one for each waypoint.
    segments: Sequence[Segment] = ()
    #: The frame of the goal in the robot's base.
    T_base_frame: Pose = IDENTITY
    frame_id: str = ''
    #: The frame that is moved, as the goal calls it, and where it is behind the flange; None = it
    #: is the robot's active TCP.
    controlled_frame: str = ''
    T_flange_controlled: Pose | None = None
    #: How long ago the stamp of the goal was when it was received [s]; None = no stamp.
    age: float | None = None
    path_tolerance: Tolerance = Tolerance()
    goal_tolerance: Tolerance = Tolerance()
    #: How much later than planned the end may come [s]: 0 = the default, negative = without end.
    goal_time_tolerance: float = 0.0
    execution: ExecutionMode = ExecutionMode.AUTO
    io_commands: tuple[IOCommand, ...] = ()
    keep_open: bool = False
    #: How far ahead of the arm points are final, so that later ones can be replaced [s]; 0 = not
    #: asked for.
    replace_horizon: float = 0.0
    safe_outputs: tuple[SafeOutput, ...] = ()
    on_path_tolerance: OnPathTolerance = OnPathTolerance.ABORT
    #: How long the arm may stay off its path with STALL [s]; 0 = the default.
    stall_timeout: float = 0.0
    #: The part of the speed asked for below which the goal is refused; 0 = not demanded.
    min_speed_fraction: float = 0.0
    input_waits: tuple[InputWait, ...] = ()
    script_calls: tuple[ScriptCall, ...] = ()
    payload_changes: tuple[PayloadChange, ...] = ()
    proportional_outputs: tuple[ProportionalOutput, ...] = ()
    presses: tuple[Press, ...] = ()
    path_offset: PathOffset = PathOffset()
