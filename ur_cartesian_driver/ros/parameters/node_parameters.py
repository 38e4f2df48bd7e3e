# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The parameters of the node: each declared once, with description and range.

Defaults come from the dataclasses that use the values, :class:`DriverConfig` and
:class:`PlanningOptions`, so a program without ROS starts from the same ones. All parameters are
read-only: they say what robot this is and within which bounds it may move, and a change of that
under a running goal helps nobody.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from difflib import get_close_matches
from math import inf, isfinite
from typing import Any, TypeAlias

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.exceptions import InvalidParameterException, InvalidParameterTypeException
from rclpy.node import Node
from rclpy.parameter import Parameter

from ur_cartesian_driver.driver import DriverConfig
from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, MODELS
from ur_cartesian_driver.planning.options import PlanningOptions
from ur_cartesian_driver.protocol.program.wire_dialects import DIALECTS
from ur_cartesian_driver.ros.tf.known_frames import Frames, StaticFrame

ParameterValue: TypeAlias = bool | int | float | str | list[str]

_TYPE_NAMES: Mapping[type, str] = {
    bool: 'true or false',
    int: 'a whole number',
    float: 'a number',
    str: 'a text',
    list: 'a list of texts',
}
#: Fields that are not set but found out.
_DETECTED_OPTIONS = ('calibration_known', 'optimove_known', 'acceleration_known', 'dialect')
#: Parameters that rclpy itself makes out of what it is given.
_RCLPY_PARAMETERS = ('use_sim_time', 'start_type_description_service', 'qos_overrides.')


class ParameterError(ValueError):
    """A parameter has a value that it cannot have; the text is one sentence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeSettings:
    """What the node itself wants to know."""

    on_new_goal: str = 'preempt'
    goal_time_tolerance: float = 1.0
    state_publish_rate: float = 50.0
    diagnostics_rate: float = 1.0
    static_frames: tuple[str, ...] = ()
    tf_max_age: float = 1.0
    live_target_enabled: bool = False
    servo_state_rate: float = 25.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """All parameters, sorted by who uses them."""

    driver: DriverConfig
    planning: PlanningOptions
    node: NodeSettings
    frames: Frames

    @property
    def joint_names(self) -> tuple[str, ...]:
        """The names of the joints, with ``tf_prefix``."""
        return tuple(self.planning.tf_prefix + name for name in JOINT_NAMES)


@dataclass(frozen=True, slots=True)
class ParameterDeclaration:
    """A parameter but for its default: what it is, and which values it takes."""

    name: str
    description: str
    low: float = -inf
    high: float = inf
    choices: tuple[str, ...] = ()

    def descriptor(self, default: ParameterValue) -> ParameterDescriptor:
        """Return what ``ros2 param describe`` shows."""
        descriptor = ParameterDescriptor(
            name=self.name,
            description=self.description,
            read_only=True,
            additional_constraints='one of: ' + ', '.join(self.choices) if self.choices else '',
        )
        if isfinite(self.low) and isfinite(self.high) and not isinstance(default, bool):
            if isinstance(default, int):
                descriptor.integer_range = [
                    IntegerRange(from_value=int(self.low), to_value=int(self.high))
                ]
            elif isinstance(default, float):
                descriptor.floating_point_range = [
                    FloatingPointRange(from_value=self.low, to_value=self.high)
                ]
        return descriptor

    def check(self, value: ParameterValue, default: ParameterValue) -> None:
        """
        Refuse a value of another type or out of range.

        :raises ParameterError: with the bound.
        """
        wanted = type(default)
        if type(value) is not wanted:
            hint = f'; write {value}.0' if wanted is float and type(value) is int else ''
            if wanted is str:  # YAML reads off as false, 2.14 as a number
                hint = '; put it in quotes, which the shell must not take away'
            raise ParameterError(
                f'Parameter {self.name} is {value!r}, but it is {_TYPE_NAMES[wanted]}{hint}.'
            )
        if isinstance(value, (int, float)) and not self.low <= value <= self.high:
            raise ParameterError(
                f'Parameter {self.name} is {value}; it must lie between {self.low:g} and '
                f'{self.high:g}.'
            )
        if self.choices and value not in self.choices:
            raise ParameterError(
                f'Parameter {self.name} is {value!r}; it is one of {", ".join(self.choices)}.'
            )


_PORT = (0, 65535)

#: Name, words, unit and largest sensible value of everything that has a tolerance.
_TOLERANCE_PARAMETERS = (
    ('position', 'position', 'm', 10.0),
    ('orientation', 'orientation', 'rad', 3.2),
    ('linear_velocity', 'velocity', 'm/s', 10.0),
    ('angular_velocity', 'angular velocity', 'rad/s', 50.0),
    ('linear_acceleration', 'acceleration', 'm/s^2', 1000.0),
    ('angular_acceleration', 'angular acceleration', 'rad/s^2', 1000.0),
)


def _tolerances(which: str, where: str) -> tuple[ParameterDeclaration, ...]:
    """Return the parameters that stand in for zeros of ``<which>_tolerance``."""
    return tuple(
        ParameterDeclaration(
            f'{which}_tolerance_{name}',
            f'Largest deviation of the {phrase} {where}, where the goal does not say '
            f'[{unit}]; 0: without limit.',
            0.0,
            upper,
        )
        for name, phrase, unit, upper in _TOLERANCE_PARAMETERS
    )


#: Every parameter of the node, in the order of ``config/driver.yaml``.
DECLARATIONS: tuple[ParameterDeclaration, ...] = (
    # -- which robot
    ParameterDeclaration(
        'ur_type',
        'Model of the robot; a robot that reports another one is refused.',
        choices=tuple(MODELS),
    ),
    ParameterDeclaration('robot_ip', 'Address of the robot.'),
    ParameterDeclaration('tf_prefix', 'Prefix of joint and frame names, for example left_.'),
    ParameterDeclaration(
        'static_frames',
        'Fixed frames in which goals may be given, and tools that they may move, each as '
        '"name parent x y z qx qy qz qw" [m, unit quaternion]; the parent is base, '
        'base_link, tool0, flange, tool0_controller or another one of them. Empty texts '
        'are skipped.',
    ),
    ParameterDeclaration(
        'tf_max_age',
        'How old the newest transform of a frame of tf2 may be when a goal is planned '
        '[s]; static ones are never old.',
        0.001,
        3600.0,
    ),
    # -- the robot program
    ParameterDeclaration(
        'headless_mode',
        'Send the robot program directly (needs remote control), instead of serving it '
        'to the External Control URCap.',
    ),
    ParameterDeclaration(
        'auto_power',
        'Switch the arm on and release its brakes on the first connection, and never '
        'again; only with headless_mode.',
    ),
    ParameterDeclaration(
        'wire_dialect',
        'Version of the messages that the robot program understands; an older one only '
        'for a robot that runs a saved, older External Control program of its own.',
        choices=tuple(DIALECTS),
    ),
    # -- what a goal may do
    ParameterDeclaration(
        'on_new_goal',
        'A goal that comes while another one runs: it may preempt that one once it has '
        'passed all checks, or reject it (it ends ABORTED).',
        choices=('preempt', 'reject'),
    ),
    ParameterDeclaration(
        'max_points', 'Longest list of points that a goal may have.', 1, 1_000_000
    ),
    ParameterDeclaration(
        'max_tool_speed',
        'Largest speed of the TCP [m/s]; 0: without bound. Motions without times are '
        'slowed to it.',
        0.0,
        10.0,
    ),
    ParameterDeclaration(
        'on_too_fast',
        'A goal whose times need more speed than the limits allow: refuse it, or slow it down.',
        choices=('refuse', 'slow'),
    ),
    ParameterDeclaration(
        'on_robot_stop',
        'What becomes of a goal when the robot makes a protective or safeguard stop: '
        'abort it, and the old motion never goes on; or continue it when somebody has '
        'unlocked the robot and plays its program, as the robot itself does.',
        choices=('abort', 'continue'),
    ),
    ParameterDeclaration(
        'max_approach_distance',
        'Longest way of the tool to the first point [m]; 0: without bound.',
        0.0,
        10.0,
    ),
    ParameterDeclaration(
        'on_posture_change',
        'A straight line or arc that cannot arrive in the posture asked for, or cannot be '
        'gone although its end can be reached: refuse the goal, or go there by a joint '
        'motion.',
        choices=('refuse', 'movej'),
    ),
    ParameterDeclaration(
        'singularity_margin_wrist',
        'How near straight lines and arcs may come to a straight wrist [rad]; 0: without limit.',
        0.0,
        1.0,
    ),
    ParameterDeclaration(
        'singularity_margin_elbow',
        'How near straight lines and arcs may come to a stretched arm [rad]; 0: without limit.',
        0.0,
        1.0,
    ),
    ParameterDeclaration(
        'singularity_margin_shoulder',
        'How near straight lines and arcs may bring the centre of the wrist to the place '
        'above or below the shoulder, measured along the arm [m]; 0: without limit.',
        0.0,
        1.0,
    ),
    ParameterDeclaration(
        'allow_tcp_change',
        'Set the TCP of the robot to the controlled frame of a goal for the time of the '
        'goal. False: a goal whose controlled frame is not the TCP must not turn it on '
        'straight or circular segments.',
    ),
    ParameterDeclaration(
        'self_collision',
        'A goal on whose way the arm comes too near to itself: off, warn in its report, '
        'refuse it, or auto: refuse where meshes tell (UR3, UR5, UR10), warn where only '
        'capsules do.',
        choices=('auto', 'off', 'warn', 'refuse'),
    ),
    ParameterDeclaration('min_clearance', 'How near the arm may come to itself [m].', 0.0, 1.0),
    ParameterDeclaration(
        'tool_radius',
        'Radius of a tool between flange and TCP, for self_collision and '
        'workspace_planes [m]; 0: no tool.',
        0.0,
        1.0,
    ),
    ParameterDeclaration(
        'workspace_planes',
        'Planes that neither arm, tool nor TCP may cross, each as "name x y z nx ny nz '
        '[margin]" [m]: a point on it and its normal into the allowed side, both in '
        'base (not base_link). Empty texts are skipped.',
    ),
    ParameterDeclaration(
        'stamp_tolerance', 'How old the stamp of a goal may be when it arrives [s].', 0.0, 3600.0
    ),
    ParameterDeclaration(
        'goal_time_tolerance',
        'How much later than planned the end may be reached, where the goal does not say [s].',
        0.001,
        3600.0,
    ),
    ParameterDeclaration(
        'start_tolerance_position',
        'How far the robot may stand from a first point at time 0 [m].',
        0.0,
        1.0,
    ),
    ParameterDeclaration(
        'start_tolerance_angle',
        'How far the robot may stand from a first point at time 0 [rad].',
        0.0,
        3.2,
    ),
    # -- what is watched
    ParameterDeclaration(
        'max_plan_deviation',
        "How far the controller's own target may be from the plan, corners apart [m]; 0: any way.",
        0.0,
        1.0,
    ),
    ParameterDeclaration(
        'max_plan_deviation_angle',
        "How far the controller's own target may be from the plan, corners apart [rad]; "
        '0: any angle.',
        0.0,
        3.2,
    ),
    ParameterDeclaration(
        'max_calibration_difference',
        'Warn of a robot whose calibration moves the flange farther than this from where '
        'the nominal model has it [m]; 0: never.',
        0.0,
        1.0,
    ),
    *_tolerances('path', 'on the way'),
    *_tolerances('goal', 'at the end'),
    # -- speeds where the goal says nothing
    ParameterDeclaration(
        'linear_velocity', 'Speed of the tool on lines and arcs [m/s].', 1e-4, 10.0
    ),
    ParameterDeclaration(
        'linear_acceleration', 'Acceleration of the tool on lines and arcs [m/s^2].', 1e-3, 100.0
    ),
    ParameterDeclaration(
        'angular_velocity', 'Speed of a segment that only turns the tool [rad/s].', 1e-3, 20.0
    ),
    ParameterDeclaration(
        'angular_acceleration',
        'Acceleration of a segment that only turns the tool [rad/s^2].',
        1e-2,
        400.0,
    ),
    ParameterDeclaration(
        'joint_velocity', 'Speed of the leading axis in joint motions [rad/s].', 1e-3, 10.0
    ),
    ParameterDeclaration(
        'joint_acceleration',
        'Acceleration of the leading axis in joint motions [rad/s^2].',
        1e-2,
        400.0,
    ),
    ParameterDeclaration(
        'optimized_velocity',
        "Speed of OPTIMIZED_* segments, as a fraction of the robot's limits.",
        1e-3,
        1.0,
    ),
    ParameterDeclaration(
        'optimized_acceleration',
        "Acceleration of OPTIMIZED_* segments, as a fraction of the robot's limits.",
        1e-3,
        1.0,
    ),
    # -- bounds of timed motions
    ParameterDeclaration(
        'max_linear_acceleration',
        'Largest acceleration of the tool that a time may lead to [m/s^2].',
        0.1,
        100.0,
    ),
    ParameterDeclaration(
        'max_angular_acceleration',
        'Largest angular acceleration of the tool that a time may lead to [rad/s^2].',
        0.1,
        1000.0,
    ),
    ParameterDeclaration(
        'max_joint_acceleration',
        'Largest acceleration of a joint that a time may lead to [rad/s^2].',
        0.1,
        1000.0,
    ),
    ParameterDeclaration(
        'max_segment_time', 'Longest duration of one segment [s].', 0.1, 2147.483647
    ),
    # -- splines
    ParameterDeclaration(
        'spline_tolerance',
        'How far the tool may be beside the curve through the points '
        'of SPLINE and SERVO goals [m]; how far turned is as much at 0.1 m.',
        1e-6,
        0.01,
    ),
    ParameterDeclaration(
        'keep_open_deceleration',
        'How hard the fastest joint brakes where an open goal '
        'ends without a last point [rad/s^2].',
        0.1,
        100.0,
    ),
    # -- live targets
    ParameterDeclaration(
        'live_target_enabled', 'Follow the poses on ~/live_target; false: nobody listens there.'
    ),
    ParameterDeclaration(
        'live_target_max_age',
        'How old a live target may be, by its stamp or else since it came [s]; then the '
        'arm stops smoothly until a newer one comes.',
        0.01,
        10.0,
    ),
    ParameterDeclaration(
        'live_target_timeout',
        'How long after the last live target the session ends [s].',
        0.1,
        3600.0,
    ),
    ParameterDeclaration(
        'live_target_linear_velocity',
        'Largest speed of the tool when it follows live targets [m/s]; not above max_tool_speed.',
        1e-4,
        10.0,
    ),
    ParameterDeclaration(
        'live_target_linear_acceleration',
        'Acceleration of the tool when it follows live targets [m/s^2].',
        1e-3,
        100.0,
    ),
    ParameterDeclaration(
        'live_target_angular_velocity',
        'Largest speed at which the tool turns when it follows live targets [rad/s].',
        1e-3,
        20.0,
    ),
    ParameterDeclaration(
        'live_target_angular_acceleration',
        'Angular acceleration of the tool when it follows live targets [rad/s^2].',
        1e-2,
        400.0,
    ),
    ParameterDeclaration(
        'live_target_joint_velocity',
        'Largest speed of a joint when the tool follows live targets [rad/s].',
        1e-3,
        10.0,
    ),
    # -- what is published
    ParameterDeclaration(
        'state_publish_rate',
        'How often joint states, TCP pose, wrench, speed scaling and tf are published [Hz].',
        1.0,
        500.0,
    ),
    ParameterDeclaration(
        'io_publish_rate',
        'How often changes of inputs, outputs and tool data are looked for [Hz]; 0: never.',
        0.0,
        125.0,
    ),
    ParameterDeclaration(
        'diagnostics_rate', 'How often /diagnostics is published [Hz]; 0: never.', 0.0, 50.0
    ),
    ParameterDeclaration(
        'servo_state_rate',
        'How often ~/servo_state is published at most [Hz]; 0: never.',
        0.0,
        500.0,
    ),
    ParameterDeclaration('feedback_rate', 'How often a goal sends feedback [Hz].', 0.5, 500.0),
    # -- set-points
    ParameterDeclaration(
        'servoj_gain', 'SERVO: how stiff servoj holds a set-point.', 100.0, 2000.0
    ),
    ParameterDeclaration(
        'servoj_lookahead_time',
        'SERVO: how far servoj looks ahead, and so lags behind [s].',
        0.03,
        0.2,
    ),
    ParameterDeclaration(
        'servo_target_lag',
        'SERVO: motion time that is under way to the arm, so how long '
        'nothing may come through [s].',
        0.008,
        0.2,
    ),
    ParameterDeclaration(
        'servo_buffer_depth',
        'SERVO: set-points that the buffer of the robot program '
        'holds; servo_target_lag has to fit in at 500 Hz.',
        20,
        1000,
    ),
    ParameterDeclaration(
        'servo_max_divergence',
        'SERVO: the robot program stops the arm when a joint is farther from its set-point [rad].',
        0.01,
        3.0,
    ),
    ParameterDeclaration(
        'allow_freedrive',
        'Whether people may push the arm in the teach mode of the servo; '
        'the robot program is made for it.',
    ),
    # -- goals that go on
    ParameterDeclaration(
        'keep_open_horizon',
        'Goals with keep_open: planned time of the motion that the '
        'robot is given ahead [s]; at least twice keep_open_margin.',
        0.1,
        60.0,
    ),
    ParameterDeclaration(
        'keep_open_margin',
        'Goals with keep_open: how long before the robot runs out of '
        'points it is brought to rest, if no more come [s].',
        0.02,
        10.0,
    ),
    ParameterDeclaration(
        'keep_open_timeout',
        'Goals with keep_open: how long one waits at rest for more '
        'points until it ends [s]; 0: without end.',
        0.0,
        86400.0,
    ),
    # -- what is recorded
    ParameterDeclaration(
        'record_directory',
        'Directory in which each motion is recorded, a file each, to '
        'be drawn by `ur-cartesian plot`; empty: nothing is.',
    ),
    ParameterDeclaration(
        'record_max_size',
        'What the recordings may take together [MB]; the oldest ones '
        'are removed, and one alone ends at half of it.',
        1.0,
        1e6,
    ),
    # -- network
    ParameterDeclaration('rtde_port', 'Port of RTDE on the robot.', *_PORT),
    ParameterDeclaration('primary_port', 'Port of the primary interface on the robot.', *_PORT),
    ParameterDeclaration('dashboard_port', 'Port of the dashboard of the robot.', *_PORT),
    ParameterDeclaration(
        'reverse_port',
        'Port to which the robot program connects for control messages; 0: any free one.',
        *_PORT,
    ),
    ParameterDeclaration(
        'script_sender_port',
        'Port that serves the robot program to the External Control URCap; 0: any free one.',
        *_PORT,
    ),
    ParameterDeclaration(
        'trajectory_port',
        'Port to which the robot program connects for trajectory points; 0: any free one.',
        *_PORT,
    ),
    ParameterDeclaration(
        'script_command_port',
        'Port to which the robot program connects for single commands; 0: any free one.',
        *_PORT,
    ),
    ParameterDeclaration(
        'bind_address',
        'Address at which the ports above listen; empty: the local '
        'address of the connection to the robot.',
    ),
    ParameterDeclaration(
        'reverse_ip',
        'Address at which the robot reaches this computer (NAT, '
        'containers); empty: the one that is listened at.',
    ),
    ParameterDeclaration(
        'allowed_peers',
        'Addresses that may connect to the ports above; empty: robot_ip. Empty texts are skipped.',
    ),
    # -- timing
    ParameterDeclaration(
        'rtde_frequency',
        'How often the robot reports its state [Hz], at least 10; 0: as often as it can.',
        0.0,
        500.0,
    ),
    ParameterDeclaration(
        'robot_receive_timeout',
        'How long the robot program waits for a sign of life before it stops the arm [s].',
        0.02,
        10.0,
    ),
    ParameterDeclaration(
        'keepalive_period', 'How often the robot program gets a sign of life [s].', 0.002, 1.0
    ),
    ParameterDeclaration(
        'node_timeout',
        'How long this node may be silent before the arm is stopped [s]; '
        'longer than the largest goal takes to arrive.',
        0.5,
        60.0,
    ),
    ParameterDeclaration(
        'stop_deceleration',
        'Deceleration of the leading axis when a goal is stopped [rad/s^2].',
        0.1,
        100.0,
    ),
    ParameterDeclaration(
        'robot_loop',
        'Where the connection to the robot is served: in a process of its '
        'own, or in a thread (tests).',
        choices=('process', 'thread'),
    ),
)


def defaults() -> dict[str, ParameterValue]:
    """Return the default of every parameter, by name."""
    values: dict[str, ParameterValue] = {}
    for options in (DriverConfig(), PlanningOptions(), NodeSettings()):
        for name in _names(type(options)):
            value = getattr(options, name)
            values[name] = _texts(value) if isinstance(value, tuple) else value
    return values


def declare_parameters(node: Node) -> Settings:
    """
    Declare all parameters of a node and return their values.

    :param node: made with ``automatically_declare_parameters_from_overrides``, because that is
        how names that nobody declares, mistyped ones for instance, come to light.
    :raises ParameterError: a name is unknown or a value cannot be; nothing runs yet.
    """
    by_name = defaults()
    _refuse_unknown(node.list_parameters([], 0).names, by_name)
    values: dict[str, ParameterValue] = {}
    for declaration in DECLARATIONS:
        default = by_name[declaration.name]
        if node.has_parameter(declaration.name):
            declaration.check(_plain(node.get_parameter(declaration.name).value), default)
            node.undeclare_parameter(declaration.name)
        try:
            parameter = node.declare_parameter(
                declaration.name, default, declaration.descriptor(default)
            )
        # What check() does not know.
        except (InvalidParameterException, InvalidParameterTypeException) as error:
            raise ParameterError(f'Parameter {declaration.name}: {error}.') from None
        values[declaration.name] = _plain(parameter.value)
    return settings(values)


def settings_from(given: Mapping[str, ParameterValue]) -> Settings:
    """
    Return values and, for all that are not given, the defaults; without a node.

    :raises ParameterError: a name is unknown or a value cannot be.
    """
    values = defaults()
    _refuse_unknown(given, values)
    for declaration in DECLARATIONS:
        if declaration.name in given:
            value = given[declaration.name]
            declaration.check(value, values[declaration.name])
            values[declaration.name] = value
    return settings(values)


def settings(values: Mapping[str, ParameterValue]) -> Settings:
    """
    Return parameter values, sorted by who uses them.

    :raises ParameterError: values do not go together.
    """
    try:
        planning = PlanningOptions(**_fields_of(PlanningOptions, values))
        node = NodeSettings(**_fields_of(NodeSettings, values))
        return Settings(
            driver=DriverConfig(**_fields_of(DriverConfig, values)),
            planning=planning,
            node=node,
            frames=Frames(planning.tf_prefix, map(StaticFrame.parse, node.static_frames)),
        )
    except ValueError as error:
        raise ParameterError(f'Parameter {str(error).rstrip(".")}.') from None


def as_overrides(
    values: Mapping[str, ParameterValue] | Iterable[Parameter] | None,
) -> list[Parameter]:
    """Return values by name as rclpy wants them."""
    if isinstance(values, Mapping):
        return [
            Parameter(name, value=[''] if value == [] else value)  # [] would be bytes
            for name, value in values.items()
        ]
    return list(values or ())


def _refuse_unknown(names: Iterable[str], known: Iterable[str]) -> None:
    for name in names:
        if name in known or name.startswith(_RCLPY_PARAMETERS):
            continue
        near = get_close_matches(name, list(known), n=1)
        hint = f'did you mean {near[0]}?' if near else 'config/driver.yaml lists all there are.'
        raise ParameterError(f'There is no parameter {name}; {hint}')


def _names(options: type[Any]) -> list[str]:
    return [field.name for field in fields(options) if field.name not in _DETECTED_OPTIONS]


def _fields_of(options: type[Any], values: Mapping[str, ParameterValue]) -> dict[str, Any]:
    return {name: _without_blanks(values[name]) for name in _names(options)}


def _without_blanks(value: ParameterValue) -> object:
    """Return a list as a tuple without the empty texts that keep it from being empty."""
    return tuple(text for text in value if text.strip()) if isinstance(value, list) else value


def _texts(value: object) -> list[str]:
    """Return a list of texts that is never empty: YAML and ROS have no type for an empty one."""
    assert isinstance(value, (list, tuple))
    return [str(text) for text in value] or ['']


def _plain(value: Any) -> ParameterValue:
    """Return a parameter's value as plain Python; arrays come as other sequences."""
    return value if isinstance(value, (bool, int, float, str)) else _texts(value)
