# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The parameters of planning: bounds, defaults and what to do if a goal exceeds a bound."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, Protocol

from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.cell.cell import Cell, EMPTY_CELL
from ur_cartesian_driver.motion.geometry.workspace import parse_planes
from ur_cartesian_driver.motion.goal.field_annotations import Range
from ur_cartesian_driver.motion.goal.goal import IOCommand
from ur_cartesian_driver.motion.goal.leads import Lead, with_lead_times
from ur_cartesian_driver.motion.goal.output_names import parse_safe_outputs
from ur_cartesian_driver.motion.goal.parameter_fields import check_parameters, Detected
from ur_cartesian_driver.motion.twin.laws import ASSUMED_LAWS, MotionLaws
from ur_cartesian_driver.motion.twin.twin import ArmIdentity, laws_of, Twin, UNKNOWN_ARM
from ur_cartesian_driver.motion.twin.twin_file import read_twin, TwinFileError
from ur_cartesian_driver.program.prelude import NO_PRELUDE, Prelude
from ur_cartesian_driver.protocol.program.wire_dialects import Dialect, NEWEST_DIALECT

#: Upper bounds of the parameters max_points, and min_clearance [m].
MAX_POINTS, MAX_CLEARANCE = 1_000_000, 1.0


class ProgramTraits(Protocol):
    """The settings of a driver that describe the features of its robot program."""

    @property
    def dialect(self) -> Dialect:
        """The messages that the program understands."""

    @property
    def prelude(self) -> Prelude:
        """The user's functions that the program contains."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanningOptions:
    """
    The parameters of planning, with the defaults of ``config/driver.yaml``.

    :raises ValueError: an option is not in its range.
    """

    #: Largest number of points of a goal. 20,000 points arrive within milliseconds in flat arrays
    #: (packed), within 2 s as separate messages.
    max_points: Annotated[int, Range(1, MAX_POINTS)] = 100_000
    #: Largest age of a goal's header.stamp on arrival [s].
    stamp_tolerance: Annotated[float, Range(0.0, 3600.0)] = 1.0
    #: Largest distance of the TCP from a first point whose time is 0 [m]: the robot must already
    #: be there.
    start_tolerance_position: Annotated[float, Range(0.0, 1.0)] = 0.001
    #: Largest angle of the TCP from a first point whose time is 0 [rad].
    start_tolerance_angle: Annotated[float, Range(0.0, 3.2)] = 0.01
    #: Largest distance of the tool from the first point [m]; 0.0: no limit. This catches poses in
    #: a wrong frame or unit.
    max_approach_distance: Annotated[float, Range(0.0, 10.0)] = 0.5
    #: Largest speed of the TCP [m/s]; 0.0: no limit. Motions without times are slowed down to this
    #: speed; for timed motions that need more, see on_too_fast. 0.25 m/s is the usual limit for
    #: working next to an arm; raise it when you know your cell.
    max_tool_speed: Annotated[float, Range(0.0, 10.0)] = 0.25
    #: What to do if the times of a goal need more speed than the limits allow: refuse the goal, or
    #: slow it down.
    on_too_fast: Literal['refuse', 'slow'] = 'refuse'
    #: What to do if a line or arc cannot arrive in the required posture, or passes a singularity,
    #: the end of a joint's range or poses out of reach. refuse: refuse the goal. movej: replace
    #: the line or arc by a joint motion to its end; the path is then not straight.
    on_posture_change: Literal['refuse', 'movej'] = 'refuse'
    #: What to do if the arm comes closer to itself than min_clearance: 'off' (in quotes: YAML
    #: reads the bare word as false), warn (in the report), refuse, or auto: refuse for the models
    #: that have meshes (UR3, UR5, UR10, UR3e, UR5e, UR7e), warn for the others. If there are no
    #: meshes or the extra `collision` is not installed, cylinders that contain the arm are
    #: measured.
    self_collision: Literal['auto', 'off', 'warn', 'refuse'] = 'auto'
    #: Smallest distance of the arm to itself [m]. An arm differs from its model by some
    #: millimetres.
    min_clearance: Annotated[float, Range(0.0, MAX_CLEARANCE)] = 0.005
    #: Radius of the cylinder from flange to TCP that represents the tool in the checks of
    #: self_collision and workspace_planes [m]; 0.0: no tool.
    tool_radius: Annotated[float, Range(0.0, 1.0)] = 0.0
    #: Planes that neither the arm beyond its base, nor the tool, nor the TCP may cross, each
    #: 'name x y z nx ny nz [margin]' [m]: a point on the plane, the normal, which points to the
    #: allowed side (both in base, not base_link), and the distance to keep. Goals that cross a
    #: plane are refused. Empty texts are skipped.
    #:
    #: Example: ['table 0 0 0 0 0 1', 'wall 0 0.6 0 0 -1 0 0.05']
    workspace_planes: tuple[str, ...] = ()
    #: YAML file with the bodies of the cell: table, fixtures, tools, parts. Goals that bring the
    #: arm, or what it carries, too close to them are refused. The file is read once, at the start.
    #: A relative path begins at the folder in which the driver was started. Empty: no file.
    cell_file: str = ''
    #: The bodies in cell_file, or bodies that were given in code.
    cell: Detected[Cell] = EMPTY_CELL
    #: Values that outputs take when a goal or live session ends without success, and when the arm
    #: stops in a pause or a protective stop, each 'kind pin value [current | voltage] [restore]'.
    #: kind is standard_digital, configurable_digital, tool_digital or standard_analog (value:
    #: fraction of the range). restore: the output gets its previous value back after a pause;
    #: without it, a pause that changed the output ends the goal. A goal may name more outputs, and
    #: other values for these. Empty texts are skipped.
    #:
    #: Example: ['standard_digital 3 0', 'standard_analog 0 0.0 current']
    safe_outputs: tuple[str, ...] = ()
    #: YAML file with the dead times of valves, which 'ur-cartesian valve' writes. An output
    #: command that names a valve (lead: valve_1) comes earlier by its dead time. The file is read
    #: once, at the start. A relative path begins at the folder in which the driver was started.
    #: Empty: no file.
    lead_file: str = ''
    #: The leads in lead_file, or leads that were given in code.
    leads: Detected[tuple[Lead, ...]] = ()
    #: Smallest angle between wrist 2 and the straight wrist on lines and arcs [rad]; 0.0: no
    #: limit. Near a singularity joints move fast or have to flip. Does not apply to joint motions,
    #: nor to an arm that starts near the singularity and moves away from it.
    singularity_margin_wrist: Annotated[float, Range(0.0, 1.0)] = 0.05
    #: Smallest angle between the elbow and the stretched arm on lines and arcs [rad]; 0.0: no
    #: limit.
    singularity_margin_elbow: Annotated[float, Range(0.0, 1.0)] = 0.05
    #: Smallest distance of the wrist centre from the point above or below the shoulder, measured
    #: along the arm, on lines and arcs [m]; 0.0: no limit.
    singularity_margin_shoulder: Annotated[float, Range(0.0, 1.0)] = 0.02
    #: What to do if the controlled_frame of a goal is not the robot's active TCP. true: the TCP is
    #: set to that frame until the goal ends. false: only goals that do not rotate the frame on
    #: straight or circular segments are accepted.
    allow_tcp_change: bool = True
    #: Whether the kinematics is the robot's calibrated one; if not, arcs are sent as poses.
    calibration_known: Detected[bool] = True
    #: Whether the robot's software has OPTIMIZED moves (PolyScope 5.21, PolyScope X 10.8).
    optimove_known: Detected[bool] = True
    #: Whether the robot's software has path offsets of its own (PolyScope 5 from 5.6 on).
    path_offset_known: Detected[bool] = True
    #: Whether the robot's software has payloads with inertia (PolyScope 5.10, PolyScope X).
    target_payload_known: Detected[bool] = True
    #: Version of the robot's movej and movel: 1, or 2 from PolyScope 5.22 on; 0 = unknown.
    robot_motion_version: Detected[int] = 1
    #: Whether the robot reports TCP accelerations; if not, tolerances on them are refused.
    acceleration_known: Detected[bool] = True
    #: The format of the messages that the robot program understands.
    dialect: Detected[Dialect] = NEWEST_DIALECT
    #: The user's functions that the robot program contains.
    prelude: Detected[Prelude] = NO_PRELUDE
    #: Prefix of joint and frame names, for two robots in one description, for example left_.
    tf_prefix: str = ''

    #: Largest position error on the path if the goal does not specify one [m]; 0.0: no limit.
    path_tolerance_position: Annotated[float, Range(0.0, 10.0)] = 0.0
    #: Largest orientation error on the path if the goal does not specify one [rad]; 0.0: no limit.
    path_tolerance_orientation: Annotated[float, Range(0.0, 3.2)] = 0.0
    #: Largest velocity error on the path if the goal does not specify one [m/s]; 0.0: no limit.
    path_tolerance_linear_velocity: Annotated[float, Range(0.0, 10.0)] = 0.0
    #: Largest angular velocity error on the path if the goal does not specify one [rad/s]; 0.0: no
    #: limit.
    path_tolerance_angular_velocity: Annotated[float, Range(0.0, 50.0)] = 0.0
    #: Largest acceleration error on the path if the goal does not specify one [m/s^2]; 0.0: no
    #: limit.
    path_tolerance_linear_acceleration: Annotated[float, Range(0.0, 1000.0)] = 0.0
    #: Largest angular acceleration error on the path if the goal does not specify one [rad/s^2];
    #: 0.0: no limit.
    path_tolerance_angular_acceleration: Annotated[float, Range(0.0, 1000.0)] = 0.0
    #: Largest position error at the end if the goal does not specify one [m]; 0.0: no limit.
    goal_tolerance_position: Annotated[float, Range(0.0, 10.0)] = 0.0
    #: Largest orientation error at the end if the goal does not specify one [rad]; 0.0: no limit.
    goal_tolerance_orientation: Annotated[float, Range(0.0, 3.2)] = 0.0
    #: Largest velocity error at the end if the goal does not specify one [m/s]; 0.0: no limit.
    goal_tolerance_linear_velocity: Annotated[float, Range(0.0, 10.0)] = 0.0
    #: Largest angular velocity error at the end if the goal does not specify one [rad/s]; 0.0: no
    #: limit.
    goal_tolerance_angular_velocity: Annotated[float, Range(0.0, 50.0)] = 0.0
    #: Largest acceleration error at the end if the goal does not specify one [m/s^2]; 0.0: no
    #: limit.
    goal_tolerance_linear_acceleration: Annotated[float, Range(0.0, 1000.0)] = 0.0
    #: Largest angular acceleration error at the end if the goal does not specify one [rad/s^2];
    #: 0.0: no limit.
    goal_tolerance_angular_acceleration: Annotated[float, Range(0.0, 1000.0)] = 0.0

    #: Angular speed at which the robot turns the tool on lines, for each m/s of their speed
    #: [rad/s]: 4 was recorded once, 1 is the value in the manual.
    turn_ratio: Annotated[float, Range(1.0, 4.0)] = 4.0

    #: Measured laws of motion of this arm, a twin.yaml, which times and blends of plans follow.
    #: Empty: plans follow the assumed laws.
    twin_file: str = ''
    #: Whether to use a twin_file that was measured on another arm, software or motion version.
    allow_other_twin: bool = False
    #: The twin in twin_file.
    twin: Detected[Twin | None] = None
    #: The files from which leads, twin and cell were read; '' = none, or they were given in code.
    read_files: Detected[tuple[str, str, str]] = ('', '', '')
    #: Model, software and motion version of the robot for which goals are planned, if known.
    robot: Detected[ArmIdentity] = UNKNOWN_ARM

    #: Speed of the tool on lines and arcs [m/s].
    linear_velocity: Annotated[float, Range(0.0001, 10.0)] = 0.1
    #: Acceleration of the tool on lines and arcs [m/s^2].
    linear_acceleration: Annotated[float, Range(0.001, 100.0)] = 0.5
    #: Angular speed of the tool on segments that only rotate it [rad/s].
    angular_velocity: Annotated[float, Range(0.001, 20.0)] = 0.5
    #: Angular acceleration of the tool on segments that only rotate it [rad/s^2].
    angular_acceleration: Annotated[float, Range(0.01, 400.0)] = 1.0
    #: Speed of the leading axis in joint motions [rad/s].
    joint_velocity: Annotated[float, Range(0.001, 10.0)] = 0.5
    #: Acceleration of the leading axis in joint motions [rad/s^2].
    joint_acceleration: Annotated[float, Range(0.01, 400.0)] = 1.0
    #: Speed of OPTIMIZED_* segments, as a fraction of the robot's limits.
    optimized_velocity: Annotated[float, Range(0.001, 1.0)] = 0.3
    #: Acceleration of OPTIMIZED_* segments, as a fraction of the robot's limits.
    optimized_acceleration: Annotated[float, Range(0.001, 1.0)] = 0.3

    #: Largest speed of the tool when it follows live targets [m/s]; not above max_tool_speed.
    live_target_linear_velocity: Annotated[float, Range(0.0001, 10.0)] = 0.25
    #: Acceleration of the tool when it follows live targets [m/s^2].
    live_target_linear_acceleration: Annotated[float, Range(0.001, 100.0)] = 1.0
    #: Largest angular speed of the tool when it follows live targets [rad/s].
    live_target_angular_velocity: Annotated[float, Range(0.001, 20.0)] = 1.0
    #: Angular acceleration of the tool when it follows live targets [rad/s^2].
    live_target_angular_acceleration: Annotated[float, Range(0.01, 400.0)] = 4.0
    #: Largest speed of a joint when the tool follows live targets [rad/s].
    live_target_joint_velocity: Annotated[float, Range(0.001, 10.0)] = 1.5
    #: Largest age of a live target [s], by its stamp or, without a stamp, since its receipt; after
    #: that, the arm stops smoothly until a newer target arrives.
    live_target_max_age: Annotated[float, Range(0.01, 10.0)] = 0.2
    #: Time after the last live target at which the session ends [s].
    live_target_timeout: Annotated[float, Range(0.1, 3600.0)] = 2.0

    #: Largest acceleration of the tool that the times of a goal, or the speed on its arcs, may
    #: need [m/s^2]: CIRCULAR ones, and those in which PROCESS rounds corners.
    max_linear_acceleration: Annotated[float, Range(0.1, 100.0)] = 10.0
    #: Largest angular acceleration of the tool that the times of a goal may need [rad/s^2].
    max_angular_acceleration: Annotated[float, Range(0.1, 1000.0)] = 40.0
    #: Largest acceleration of a joint that the times of a goal may need [rad/s^2].
    max_joint_acceleration: Annotated[float, Range(0.1, 1000.0)] = 40.0
    #: Largest jerk of the tool on paths with rounded corners [m/s^3].
    max_linear_jerk: Annotated[float, Range(1.0, 10_000.0)] = 50.0
    # The smallest tolerance is the resolution of joint positions in messages to the robot.
    #: Largest distance of the tool from the curve through the points of SPLINE and SERVO goals
    #: [m]; the orientation error [rad] times 0.1 m has the same limit. A smaller value needs more
    #: pieces on the wire.
    spline_tolerance: Annotated[float, Range(1e-6, 0.01)] = 0.00005
    #: Deceleration of the fastest joint when a goal with keep_open runs out of points [rad/s^2].
    #: Near the end of a range, the arm brakes with up to max_joint_acceleration.
    keep_open_deceleration: Annotated[float, Range(0.1, 100.0)] = 4.0
    #: Longest duration of one segment [s]; the default is the largest that the robot accepts.
    max_segment_time: Annotated[float, Range(0.1, NEWEST_DIALECT.max_duration)] = (
        NEWEST_DIALECT.max_duration
    )

    def __post_init__(self) -> None:
        """Check types and ranges."""
        check_parameters(self)
        parse_planes(self.workspace_planes)
        parse_safe_outputs(self.safe_outputs)
        # dataclasses.replace() runs this, too. So a file is read again only if its name has
        # changed, and not at all if its values were given in code.
        lead_file, twin_file, cell_file = self.read_files
        if self.lead_file != lead_file and (lead_file or not self.leads):
            object.__setattr__(self, 'leads', _read_leads(self.lead_file))
            lead_file = self.lead_file
        if self.twin_file != twin_file and (twin_file or self.twin is None):
            object.__setattr__(self, 'twin', _read_twin(self.twin_file))
            twin_file = self.twin_file
        if self.cell_file != cell_file and (cell_file or not self.cell):
            object.__setattr__(self, 'cell', _read_cell(self.cell_file))
            cell_file = self.cell_file
        object.__setattr__(self, 'read_files', (lead_file, twin_file, cell_file))

    @property
    def twin_problem(self) -> str:
        """A clause on how the twin's arm differs from the robot; '' = not at all, or no twin."""
        return '' if self.twin is None else self.twin.arm.differences(self.robot)

    @property
    def used_twin(self) -> Twin | None:
        """The twin that plans follow; None = the assumed laws."""
        return self.twin if self.allow_other_twin or not self.twin_problem else None

    @property
    def laws(self) -> MotionLaws:
        """
        The numbers that describe the controller's motions: of :attr:`used_twin`, or assumed.

        The measured beginning and speed of a blend hold for one shape of its curve only. If the
        twin does not know the shape, the assumed beginning and speed apply.
        """
        laws = laws_of(self.used_twin, self.turn_ratio)
        if laws.blend_shape != 'unknown':
            return laws
        return replace(
            laws,
            blend_begin=ASSUMED_LAWS.blend_begin,
            blend_speed_ratio=ASSUMED_LAWS.blend_speed_ratio,
        )

    def lead_times(self, commands: Sequence[IOCommand]) -> tuple[IOCommand, ...]:
        """
        Return output commands, each earlier by the dead time of the valve that it names.

        :raises InvalidGoal: a name is unknown, or this valve is at another output.
        """
        return with_lead_times(commands, self.leads, self.lead_file)

    def for_program(self, settings: ProgramTraits, **detected: Any) -> PlanningOptions:
        """
        Return the options for the robot program of a driver.

        :param detected: more fields to replace, such as features that the robot has.
        """
        return replace(
            self,
            **detected,
            dialect=settings.dialect,
            prelude=settings.prelude,
            # An older program may ignore the command that sets the TCP; then the old TCP would
            # follow the path.
            allow_tcp_change=self.allow_tcp_change and settings.dialect.is_own,
        )

    @property
    def older_program(self) -> str:
        """The version of the robot program if it is not the driver's own, else ''."""
        return self.dialect.older_program


def _read_leads(path: str) -> tuple[Lead, ...]:
    """
    Return the leads in a file; the path '' gives none.

    :raises ValueError: the file cannot be read, or has no leads.
    """
    if not path:
        return ()
    # Imported here, because most drivers have no such file.
    from ur_cartesian_driver.goal_files.lead_file import read_leads

    return read_leads(path)


def _read_twin(path: str) -> Twin | None:
    """
    Return the twin in a file; the path '' gives None.

    :raises ValueError: the file cannot be read, or is no twin of a known model.
    """
    if not path:
        return None
    try:
        twin = read_twin(path)
    except OSError as error:
        reason = error.strerror or error
        raise ValueError(f'twin_file is {path!r}, which cannot be read: {reason}.') from None
    except TwinFileError as error:
        raise ValueError(f'twin_file: {error}') from None
    try:
        robot_model(twin.arm.model)
    except ValueError as error:
        raise ValueError(f'twin_file: {path}, arm: {error}') from None
    return twin


def _read_cell(path: str) -> Cell:
    """
    Return the bodies in a file; the path '' gives the empty cell.

    :raises ValueError: the file cannot be read, or is no cell.
    """
    if not path:
        return EMPTY_CELL
    # Imported here, because most drivers have no such file.
    from ur_cartesian_driver.motion.cell.cell_file import read_cell

    try:
        return read_cell(path)
    except OSError as error:
        reason = error.strerror or error
        raise ValueError(f'cell_file is {path!r}, which cannot be read: {reason}.') from None
    except ValueError as error:
        raise ValueError(f'cell_file: {error}') from None
