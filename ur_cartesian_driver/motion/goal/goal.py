# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
A goal as the client sent it, in the frame that it names: the only list of its fields.

Many parts of the driver handle the fields of a goal: messages, YAML files, flat arrays, columns,
checks, the builder of paths, the resumption after a stop. When each part listed the fields
itself, a new field took two dozen edits, and a forgotten edit raised no error: the field
was lost in a file or after a stop. So the dataclasses below declare everything about a field, and
all other code iterates over them (:func:`~.field_annotations.goal_fields`).

A field has a type, a unit in its comment, a default, and annotations:
:class:`~.field_annotations.Sent` if messages name or represent it differently,
:class:`~.field_annotations.Range` if not every number is allowed,
:class:`~.field_annotations.Mark` for other properties. Schema, reading, writing, conversion of
users' values to the declared types, and checks of ranges and enumerations follow from these. Goals
can have thousands of points, so the driver stores points and segments in columns
(:mod:`~.goal_columns`); ``WaypointColumns`` and ``SegmentColumns`` declare a column for each
field, and its flat array in messages. Rules that concern more than one field are in
``planning.request``.

To add a number to segments, declare it in MotionSegment.msg and PackedPoints.msg, in ``Segment``
and ``SegmentColumns``, and use it where the motion is planned. Paths accept it by name, as in
``Path.at(name=...)``. A number that belongs to the whole goal is declared in the action instead of
both messages, and needs no column. ``test/ros/test_goal_files.py`` compares these declarations
with the messages. Decide also on its meaning in a spline and in a goal with times, and refuse it
where it would have no effect, because the declaration does not tell.

There are two drawbacks. Each column is declared in addition to its field, because type checkers
would not know it otherwise. And files list a few fields in another order than messages
(``after``), or even at their defaults (``always``), so that goals are still written in the form of
existing files.

A goal may be wrong: ``planning.request.validate`` checks it. Only a plan
(:mod:`~ur_cartesian_driver.motion.plan.plan`) is known to be feasible.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Annotated

from ur_cartesian_driver.motion.geometry.arrays import Flags, Floats, Int64s
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.geometry.vectors import Vector3, Vector6, ZERO3, ZERO6
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.field_annotations import ColumnOf, Form, Mark, Range, Sent
from ur_cartesian_driver.motion.goal.inertia import MAX_TRANSITION_TIME
from ur_cartesian_driver.motion.goal.moving_frame import MovingFrame
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain


class SegmentType(IntEnum):
    """The kind of motion to a point, numbered as in ``MotionSegment.type``."""

    AUTO = 0
    LINEAR = 1
    JOINT = 2
    CIRCULAR = 3
    PROCESS = 4
    OPTIMIZED_LINEAR = 5
    OPTIMIZED_JOINT = 6


class ArcMode(IntEnum):
    """The orientation of the tool along an arc, numbered as in URScript's ``movec``."""

    UNCONSTRAINED = 0
    FIXED = 1


class FreeAxis(IntEnum):
    """An axis about which the tool may turn, numbered as in ``MotionSegment.free_axis``."""

    NONE = 0
    X = 1
    Y = 2
    Z = 3


class OutputKind(IntEnum):
    """The output that an :class:`IOCommand` switches."""

    STANDARD_DIGITAL = 0
    CONFIGURABLE_DIGITAL = 1
    TOOL_DIGITAL = 2
    STANDARD_ANALOG = 3


class OnPathTolerance(IntEnum):
    """The driver's reaction when the arm leaves the path tolerance."""

    ABORT = 0
    STALL = 1


#: Smallest number of spline pieces within the time ``Goal.replace_horizon``.
PIECES_PER_HORIZON = 3
#: How long the motion waits for an arm that is off its path, unless the goal specifies it [s].
DEFAULT_STALL_TIMEOUT = 10.0


class InputKind(IntEnum):
    """The input that an :class:`InputWait` waits for."""

    STANDARD_DIGITAL = 0
    CONFIGURABLE_DIGITAL = 1
    TOOL_DIGITAL = 2
    STANDARD_ANALOG = 3
    TOOL_ANALOG = 4

    @property
    def is_analog(self) -> bool:
        """Whether the input has an analog level [A] or [V]."""
        return self >= InputKind.STANDARD_ANALOG


class PressFrame(IntEnum):
    """The frame along whose axes the tool gives way in a :class:`Press`."""

    #: The frame of the TCP, which turns with the tool along the path; for a held part, the frame
    #: of the fixed tool.
    TOOL = 0
    #: The frame of the goal.
    GOAL = 1
    #: The base of the robot's controller.
    BASE = 2


class ContactEnd(IntEnum):
    """The effect of the tool's first contact during a :class:`Press`."""

    NONE = 0
    #: A contact ends the goal with success.
    ENDS = 1
    #: A contact ends the goal with success; without one, the goal fails.
    REQUIRED = 2


#: Names of the axes of a frame, and of the turns about them.
PRESS_AXES = ('x', 'y', 'z', 'rx', 'ry', 'rz')

#: How far the tool may give way in a press, unless the press specifies it [m], [rad].
DEFAULT_YIELDS = (0.02, 0.2)


class StaleOffset(IntEnum):
    """The driver's reaction when no newer path offset arrives in time."""

    #: The offset stays.
    HOLD = 0
    #: The tool goes back to its path.
    FADE = 1


#: Speed [m/s], acceleration [m/s^2] and timeout [s] of path offsets, unless the goal gives them.
DEFAULT_OFFSET_MOTION = (0.02, 0.2, 0.5)

#: Rate of change [1/s] and timeout [s] of a feed override, unless the goal gives them.
DEFAULT_FEED_MOTION = (0.5, 0.5)
#: The smallest fraction to which a feed override slows the motion.
MIN_FEED = 0.01

#: How much later than planned a goal may end, unless the goal specifies it [s]; also the longest
#: time from the program's SUCCESS until the arm rests inside the goal tolerance.
DEFAULT_GOAL_TIME_TOLERANCE = 1.0

#: Largest turn of the tool from its programmed orientation at a rounded corner, unless the goal
#: gives it [rad].
DEFAULT_CORNER_ANGLE = 0.02

#: The longest dwell and timeout at a point [s]; longer ones must be mistakes.
MAX_STOP_TIME = 600.0
#: The longest time from passing a point until its output is switched [s].
MAX_OUTPUT_OFFSET = 60.0
#: The longest time by which an output is switched ahead of its place [s].
MAX_OUTPUT_LEAD = 1.0
#: The longest way between a point and the place where an output is switched [m].
MAX_OUTPUT_DISTANCE = 10.0
#: Of a pulse train: the longest way between two pulses [m], the longest pulse [s], most pulses.
MAX_PULSE_DISTANCE, MAX_PULSE_WIDTH, MAX_PULSE_COUNT = 2.0, 1.0, 1_000_000

# Annotations that several fields share.
FINITE, NOT_NEGATIVE = Range(), Range(0.0)
FRACTION, SMALL_LEAD = Range(0.0, 1.0), Range(0.0, 10.0)
#: In a spline, NaN lets the driver choose the number.
RATE = Range(nan_in_splines=True)
TIMEOUT = Range(0.0, MAX_STOP_TIME, 's', above=True)
DISTANCE = Range(-MAX_OUTPUT_DISTANCE, MAX_OUTPUT_DISTANCE, 'm', 'name another point')
CORNER_DEVIATION = Range(2e-5, 0.1, 'm', zero='corners as they are')
CORNER_ANGLE = Range(1e-3, 0.5, 'rad', zero=f'{DEFAULT_CORNER_ANGLE:g} rad')

DURATION, ALWAYS = Sent(form=Form.DURATION), Sent(always=True)
DOMAIN = Sent(name='analog_domain')
POINT, FIRST_POINT, LAST_POINT = (
    Sent(name=name, form=Form.INDEX) for name in ('point_index', 'first_point', 'last_point')
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Posture:
    """The preferred joint positions [rad] by joint name; empty = no preference."""

    names: Annotated[tuple[str, ...], Sent(name='posture_joint_names', always=True)] = ()
    values: Annotated[tuple[float, ...], Sent(name='posture_joint_values', always=True)] = ()

    def __bool__(self) -> bool:
        """Return whether there is any preference, even a malformed one."""
        return bool(self.names or self.values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Waypoint:
    """One point of a goal, in the frame of the goal."""

    #: When to reach the point, from the start of the motion [s].
    time: Annotated[float, Sent(name='time_from_start', form=Form.DURATION), FINITE] = 0.0
    pose: Pose
    #: Linear [m/s] and angular [rad/s] velocity at the point.
    twist: Annotated[Vector6, RATE] = ZERO6
    #: Linear [m/s^2] and angular [rad/s^2] acceleration at the point.
    acceleration: Annotated[Vector6, RATE] = ZERO6
    #: Linear [m/s^3] and angular [rad/s^3] jerk at the point.
    jerk: Annotated[Vector6, FINITE] = ZERO6
    posture: Posture = Posture()


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class WaypointColumns:
    """The points of a goal in columns, in the units of :class:`Waypoint`."""

    #: (n, 7) x y z, quaternion x y z w
    poses: Annotated[Floats, ColumnOf('pose', always=True)]
    #: (n,)
    times: Annotated[Floats, ColumnOf('time')]
    #: (n, 6)
    twists: Annotated[Floats, ColumnOf('twist')]
    #: (n, 6)
    accelerations: Annotated[Floats, ColumnOf('acceleration')]
    #: (n, 6)
    jerks: Annotated[Floats, ColumnOf('jerk', packed=None)]
    #: The postures that are not empty, by row.
    postures: Annotated[Mapping[int, Posture], ColumnOf('posture')] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Segment:
    """
    The motion that ends at the waypoint of the same index; its blend lies around that waypoint.

    Units of velocity and acceleration, by type: LINEAR, CIRCULAR, PROCESS m/s and m/s^2 of the
    tool (rad/s and rad/s^2 for a pure rotation); JOINT rad/s and rad/s^2 of the leading axis, the
    joint with the longest way; OPTIMIZED_* fractions in (0, 1].
    """

    type: SegmentType = SegmentType.AUTO
    #: Distance from the waypoint at which the blend begins and ends [m].
    blend_radius: Annotated[float, NOT_NEGATIVE, Mark.OF_POINT] = 0.0
    #: How long the arm rests at the waypoint [s].
    dwell: Annotated[float, NOT_NEGATIVE, Mark.OF_POINT] = 0.0
    #: 0 = derived from the times of the goal, or the default velocity if the goal has no times.
    velocity: Annotated[float, NOT_NEGATIVE] = 0.0
    #: 0 = derived from the times of the goal, or the default acceleration.
    acceleration: Annotated[float, NOT_NEGATIVE] = 0.0
    #: A pose on the arc; only for CIRCULAR.
    via: Pose | None = None
    via_posture: Posture = Posture()
    arc_mode: ArcMode = ArcMode.UNCONSTRAINED
    #: Axis about which the driver may turn the waypoint's pose, by an angle from ``free_min`` to
    #: ``free_max`` [rad]; both 0 = by any angle.
    free_axis: Annotated[FreeAxis, Mark.OF_POINT] = FreeAxis.NONE
    free_min: Annotated[float, FINITE, Mark.OF_POINT] = 0.0
    free_max: Annotated[float, FINITE, Mark.OF_POINT] = 0.0
    #: Largest distance of the path from the segments at this corner [m]; 0 = the goal's value.
    corner_deviation: Annotated[float, CORNER_DEVIATION, Mark.OF_POINT] = 0.0
    #: Largest turn of the tool from its programmed orientation here [rad]; 0 = the goal's value.
    corner_angle: Annotated[float, CORNER_ANGLE, Mark.OF_POINT] = 0.0


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class SegmentColumns:
    """The segments of a goal in columns: no rows, or a row for each point."""

    #: (n,) each; enumerations as their numbers
    types: Annotated[Int64s, ColumnOf('type', always=True)]
    arc_modes: Annotated[Int64s, ColumnOf('arc_mode', always=True)]
    blend_radii: Annotated[Floats, ColumnOf('blend_radius')]
    dwells: Annotated[Floats, ColumnOf('dwell')]
    velocities: Annotated[Floats, ColumnOf('velocity')]
    accelerations: Annotated[Floats, ColumnOf('acceleration', packed='segment_accelerations')]
    #: (n, 7) poses on the arcs
    vias: Annotated[Floats, ColumnOf('via', after='free_maxima')]
    #: (n,) whether the row has a pose on its arc
    has_via: Flags
    #: The non-empty postures on the arcs, by row.
    via_postures: Annotated[Mapping[int, Posture], ColumnOf('via_posture')] = field(
        default_factory=dict
    )
    free_axes: Annotated[Int64s, ColumnOf('free_axis')]
    free_minima: Annotated[Floats, ColumnOf('free_min')]
    free_maxima: Annotated[Floats, ColumnOf('free_max')]
    corner_deviations: Annotated[Floats, ColumnOf('corner_deviation')]
    corner_angles: Annotated[Floats, ColumnOf('corner_angle')]


@dataclass(frozen=True, slots=True, kw_only=True)
class IOCommand:
    """
    Switch an output when the tool passes a place: a waypoint, or a place beside it on the path.

    ``distance`` or ``fraction`` move the place away from the waypoint, ``offset`` moves the time.
    """

    waypoint: Annotated[int, POINT]
    #: Time after the place, in the controller's scaled time [s]. If negative, a lead: the output
    #: switches that much ahead of the place, in real time.
    offset: Annotated[
        float,
        Sent(form=Form.DURATION, always=False, after='domain'),
        Range(-MAX_OUTPUT_LEAD, MAX_OUTPUT_OFFSET, 's', 'name another point'),
    ]
    output: OutputKind
    pin: int
    #: Digital 0 or 1; analog a fraction of the range.
    value: float
    #: Whether an analog output carries a current or a voltage.
    domain: Annotated[AnalogDomain, DOMAIN] = AnalogDomain.CURRENT
    #: Way along the path from the waypoint to the place [m]; negative = before the waypoint.
    distance: Annotated[float, DISTANCE] = 0.0
    #: This way as a fraction of a segment's length: if negative, of the segment that ends at the
    #: waypoint; if positive, of the segment that begins there.
    fraction: Annotated[float, Range(-1.0, 1.0)] = 0.0
    #: Name of a valve in ``lead_file``, by whose dead time the command comes earlier; '' = none.
    lead: str = ''
    #: The name of the valve whose dead time ``offset`` contains already; '' = none.
    lead_name: Annotated[str, Mark.NOT_SENT] = field(default='', compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class InputWait:
    """Wait at a waypoint, where the arm stops, until an input has a value."""

    waypoint: Annotated[int, POINT]
    input: InputKind
    pin: int
    #: Digital 0 or 1; analog the level [A] or [V] that the input must reach, or with ``below``
    #: fall below.
    value: float
    below: Annotated[bool, Sent(after='timeout')] = False
    #: Longest wait [s].
    timeout: Annotated[float, TIMEOUT]
    #: Whether the motion goes on after the timeout; if not, the goal ends.
    go_on: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ScriptCall:
    """Call a function of the script prelude at a waypoint, where the arm stops."""

    waypoint: Annotated[int, POINT]
    function: str
    #: Messages to the robot program cannot carry larger numbers.
    arguments: Annotated[tuple[float, ...], Range(-2147.0, 2147.0)] = ()
    #: Longest time until the function returns [s].
    timeout: Annotated[float, ALWAYS, TIMEOUT] = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PayloadChange:
    """Set the payload of the controller at a waypoint, where the arm stops."""

    waypoint: Annotated[int, POINT]
    #: [kg]
    mass: Annotated[float, Range(0.0, 100.0, 'kg')]
    #: In the flange frame [m].
    center_of_gravity: Annotated[Vector3, ALWAYS] = ZERO3
    #: About the centre of gravity, along the axes of the flange [kg m^2]: xx, yy, zz, xy, xz, yz;
    #: empty = a point mass.
    inertia: tuple[float, ...] = ()
    #: Time that the controller takes to change to this payload [s].
    transition_time: Annotated[float, Range(0.0, MAX_TRANSITION_TIME, 's')] = 0.0


class PartAction(IntEnum):
    """The change of a body of the cell, numbered as in ``PartChange.action``."""

    #: From the point on, the body moves with the flange, and keeps its pose relative to it.
    ATTACH = 0
    #: From the point on, the body stays at the place where it was put.
    RELEASE = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class PartChange:
    """Tell the collision checks that the tool takes or releases a body at a stop."""

    waypoint: Annotated[int, POINT]
    #: Name of a body of the cell.
    body: str
    action: Annotated[PartAction, ALWAYS] = PartAction.ATTACH


@dataclass(frozen=True, slots=True, kw_only=True)
class ProportionalOutput:
    """An analog output that follows the speed of the tool between two waypoints."""

    first_waypoint: Annotated[int, FIRST_POINT]
    last_waypoint: Annotated[int, LAST_POINT]
    #: How long before the first waypoint the output begins to follow the speed [s].
    begin_lead: Annotated[float, SMALL_LEAD] = 0.0
    #: How long before the last waypoint the output ceases to follow the speed [s].
    end_lead: Annotated[float, SMALL_LEAD] = 0.0
    pin: Annotated[int, Sent(always=False), Range(0, 1)]
    domain: Annotated[AnalogDomain, Sent(name='analog_domain', after='last_waypoint')] = (
        AnalogDomain.CURRENT
    )
    #: Fraction of the range per speed of the tool [1/(m/s)].
    gain: Annotated[float, Sent(always=False), Range(-1000.0, 1000.0)]
    #: Fraction of the range at speed 0.
    offset: Annotated[float, Range(-100.0, 100.0)] = 0.0
    #: Lower bound of the output, a fraction of the range.
    minimum: Annotated[float, FRACTION] = 0.0
    #: Upper bound of the output, a fraction of the range.
    maximum: Annotated[float, ALWAYS, FRACTION] = 1.0
    #: Time constant of a low-pass filter of first order for the speed [s].
    filter_time: Annotated[float, SMALL_LEAD] = 0.0
    #: Value while the output does not follow the speed, a fraction of the range.
    idle: Annotated[float, FRACTION] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class PulseTrain:
    """Pulses of a digital output, evenly along the path between two waypoints."""

    first_waypoint: Annotated[int, FIRST_POINT]
    last_waypoint: Annotated[int, LAST_POINT]
    output: OutputKind
    pin: int
    #: Way along the path from pulse to pulse [m].
    distance: Annotated[float, Sent(always=False), Range(0.0, MAX_PULSE_DISTANCE, 'm', above=True)]
    #: Way along the path from the first waypoint to the first pulse [m].
    phase: Annotated[float, Range(0.0, MAX_OUTPUT_DISTANCE, 'm')] = 0.0
    #: How long the output stays on [s], in real time; 0 = one cycle of the controller.
    width: Annotated[float, Range(0.0, MAX_PULSE_WIDTH, 's')] = 0.0
    #: Number of pulses; 0 = as many as there is room for.
    count: Annotated[int, Sent(form=Form.COUNT), Range(0, MAX_PULSE_COUNT)] = 0
    #: Whether the pulses go on along points that are appended, to the end of the goal.
    goes_on: Annotated[bool, Mark.NOT_SENT] = field(default=False, compare=False)


#: ``Press.first_waypoint`` of the driver's own presses that begin at the start of the motion.
START_OF_MOTION = -1


@dataclass(frozen=True, slots=True, kw_only=True)
class Press:
    """The controller's force mode between two waypoints, at both of which the arm stops."""

    first_waypoint: Annotated[int, FIRST_POINT]
    last_waypoint: Annotated[int, LAST_POINT]
    frame: PressFrame = PressFrame.TOOL
    #: The names of the compliant axes of the frame, from :data:`PRESS_AXES`.
    axes: tuple[str, ...] = ()
    #: Force or torque of the tool along each compliant axis [N, Nm].
    forces: tuple[float, ...] = ()
    #: Largest speed of the tool along each compliant axis [m/s, rad/s]; empty = the default.
    speed_limits: tuple[float, ...] = ()
    #: How far the tool may be off the path along the other axes [m]; 0 = the default.
    max_deviation: Annotated[float, ALWAYS, Range(0.0, 0.1)] = 0.0
    #: How far the tool may be turned off the path about the other axes [rad]; 0 = the default.
    max_deviation_angle: Annotated[float, ALWAYS, Range(0.0, 0.5)] = 0.0
    #: How far the tool may give way along compliant axes [m]; 0 = the default.
    max_yield: Annotated[float, ALWAYS, Range(0.0, 0.5)] = 0.0
    #: How far the tool may give way about compliant axes [rad]; 0 = the default.
    max_yield_angle: Annotated[float, ALWAYS, Range(0.0, 1.5)] = 0.0
    #: The settings ``damping`` and ``gain_scaling`` of the controller's force mode.
    damping: Annotated[float, ALWAYS, FRACTION] = 0.005
    gain_scaling: Annotated[float, ALWAYS, Range(0.0, 2.0)] = 1.0
    #: Whether the force sensor is zeroed before the press begins.
    zero_sensor: Annotated[bool, ALWAYS] = False
    contact: Annotated[ContactEnd, Sent(after='speed_limits')] = ContactEnd.NONE


@dataclass(frozen=True, slots=True, kw_only=True)
class SafeOutput:
    """The value that an output takes when the motion does not go on as planned."""

    output: OutputKind
    pin: int
    #: Digital 0 or 1; analog a fraction of the range.
    value: float
    domain: Annotated[AnalogDomain, DOMAIN] = AnalogDomain.CURRENT
    #: Whether the output is restored after a pause; if not, a pause that changed it ends the goal.
    restore: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Tolerance:
    """
    Largest deviations by axis: 0 = the default, negative = unchecked, positive = the limit.

    Position [m] in the frame of the goal, orientation [rad] as the rotation vector of the error in
    the controlled frame, twist [m/s, rad/s] and acceleration [m/s^2, rad/s^2].
    """

    position: Annotated[Vector3, Sent(name='position_error'), FINITE] = ZERO3
    orientation: Annotated[Vector3, Sent(name='orientation_error'), FINITE] = ZERO3
    twist: Annotated[Vector6, Sent(name='twist_error'), FINITE] = ZERO6
    acceleration: Annotated[Vector6, Sent(name='acceleration_error'), FINITE] = ZERO6


@dataclass(frozen=True, slots=True, kw_only=True)
class PathOffset:
    """The bounds of path offsets, which arrive while the arm moves."""

    #: Largest offset along the path, across it and normal to both [m]; 0 = none. The upper bound,
    #: 0.1 m, is the default of the controller's own path offsets.
    limits: Annotated[Vector3, Range(0.0, 0.1, 'm')] = ZERO3
    #: Largest speed of the offset along each axis [m/s]; 0 = the default.
    speed: Annotated[float, Range(0.0, 0.1, 'm/s')] = 0.0
    #: Largest acceleration of the offset along each axis [m/s^2]; 0 = the default.
    acceleration: Annotated[float, Range(0.0, 2.0, 'm/s^2')] = 0.0
    #: The age at which an offset is stale [s]; 0 = the default.
    timeout: Annotated[float, Range(0.0, 60.0, 's')] = 0.0
    on_stale: StaleOffset = StaleOffset.HOLD

    def __bool__(self) -> bool:
        """Return whether path offsets are allowed."""
        return any(self.limits)


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedOverride:
    """The bounds of a feed override: a signal that slows the motion while the arm moves."""

    #: Smallest fraction of the planned speed, also without a valid signal; 0 = no override.
    minimum: Annotated[float, Range(MIN_FEED, 1.0, zero='no override')] = 0.0
    #: Largest fraction of the planned speed; 0 = 1.
    maximum: Annotated[float, Range(MIN_FEED, 1.0, zero='as planned')] = 0.0
    #: How fast the fraction changes at most [1/s]; 0 = the default.
    rate: Annotated[float, Range(0.01, 10.0, '1/s', zero=f'{DEFAULT_FEED_MOTION[0]:g} 1/s')] = 0.0
    #: The age at which the signal is stale [s]; 0 = the default.
    timeout: Annotated[float, Range(0.02, 60.0, 's', zero=f'{DEFAULT_FEED_MOTION[1]:g} s')] = 0.0

    def __bool__(self) -> bool:
        """Return whether a signal may slow the motion."""
        return self.minimum > 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """A Cartesian trajectory and how to execute it."""

    frame_id: Annotated[str, Sent(name='trajectory.header.frame_id')] = ''
    waypoints: Annotated[Sequence[Waypoint], Sent(name='trajectory.points', always=False)]
    #: Name of the controlled frame; '' = it is given only by its pose, or is the active TCP.
    controlled_frame: Annotated[str, Sent(name='trajectory.controlled_frame')] = ''
    #: Pose of the controlled frame in the flange; None = the frame is the robot's active TCP.
    T_flange_controlled: Annotated[Pose | None, Mark.NOT_SENT] = None
    #: Pose of the goal's frame in the robot's base.
    T_base_frame: Annotated[Pose, Mark.NOT_SENT] = IDENTITY
    #: Set if the goal's frame is on a part that the flange carries; poses are then in this frame,
    #: and ``T_base_frame`` is the identity. None = the frame is fixed in the base.
    moving_frame: Annotated[MovingFrame | None, Mark.NOT_SENT] = None
    #: Age of the goal's stamp on receipt [s]; None = no stamp.
    age: Annotated[float | None, Mark.NOT_SENT] = None
    path_tolerance: Tolerance = Tolerance()
    goal_tolerance: Tolerance = Tolerance()
    #: How much later than planned the goal may end [s]: 0 = the default, negative = any time.
    goal_time_tolerance: Annotated[float, DURATION, FINITE] = 0.0
    #: Empty, or one segment for each waypoint.
    segments: Sequence[Segment] = ()
    io_commands: tuple[IOCommand, ...] = ()
    input_waits: Annotated[tuple[InputWait, ...], Sent(after='script_calls')] = ()
    script_calls: tuple[ScriptCall, ...] = ()
    payload_changes: Annotated[tuple[PayloadChange, ...], Sent(after='presses')] = ()
    proportional_outputs: tuple[ProportionalOutput, ...] = ()
    presses: tuple[Press, ...] = ()
    execution: ExecutionMode = ExecutionMode.AUTO
    keep_open: bool = False
    #: Points due within this time [s] are fixed, and later ones can be replaced; 0 = none can.
    replace_horizon: Annotated[
        float, Range(0.05, 1.0, 's', 'set it to 0.15', zero='nothing is replaced')
    ] = 0.0
    safe_outputs: tuple[SafeOutput, ...] = ()
    #: The goal is refused if the planned speed falls below this fraction of the speed asked for.
    min_speed_fraction: Annotated[
        float, Range(0.0, 1.0, remedy='give a fraction', zero='not demanded')
    ] = 0.0
    on_path_tolerance: OnPathTolerance = OnPathTolerance.ABORT
    #: With STALL, how long the arm may stay off its path [s]; 0 = the default.
    stall_timeout: Annotated[
        float, DURATION, Range(0.0, unit='s', remedy=f'set 0 for {DEFAULT_STALL_TIMEOUT:g} s')
    ] = 0.0
    path_offset: PathOffset = PathOffset()
    #: Largest distance of the path from lines and arcs at their corners [m], unless a segment has
    #: its own; 0 = corners are not rounded.
    corner_deviation: Annotated[float, CORNER_DEVIATION] = 0.0
    #: Largest turn of the tool from its programmed orientation at corners [rad]; 0 = the default.
    corner_angle: Annotated[float, CORNER_ANGLE] = 0.0
    feed_override: FeedOverride = FeedOverride()
    pulses: tuple[PulseTrain, ...] = ()
    part_changes: tuple[PartChange, ...] = ()
    #: Whether the driver may plan a travel to the first point, if that point is far away or the
    #: direct way is blocked.
    allow_travel: bool = False
