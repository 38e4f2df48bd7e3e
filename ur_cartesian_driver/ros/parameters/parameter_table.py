# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Every parameter of the node but its default: description, range and choices.

The defaults come from the dataclasses that use the values, so a program without ROS has the same.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from typing import TypeAlias

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor

from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.protocol.program.wire_dialects import DIALECTS

ParameterValue: TypeAlias = bool | int | float | str | list[str]

_TYPE_NAMES: Mapping[type, str] = {
    bool: 'true or false',
    int: 'a whole number',
    float: 'a number',
    str: 'a text',
    list: 'a list of texts',
}


class ParameterError(ValueError):
    """A parameter is unknown or has an invalid value; the text is one sentence."""


@dataclass(frozen=True, slots=True)
class ParameterDeclaration:
    """One parameter: what it means, and which values it takes."""

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
        if type(default) is int:
            integers = IntegerRange(from_value=int(self.low), to_value=int(self.high))
            descriptor.integer_range = [integers]
        elif type(default) is float:
            floats = FloatingPointRange(from_value=self.low, to_value=self.high)
            descriptor.floating_point_range = [floats]
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
                hint = '; put it in quotes that the shell does not remove'
            raise ParameterError(
                f'Parameter {self.name} is {value!r}, but must be {_TYPE_NAMES[wanted]}{hint}.'
            )
        if isinstance(value, (int, float)) and not self.low <= value <= self.high:
            raise ParameterError(
                f'Parameter {self.name} is {value}, but must lie between {self.low:g} and '
                f'{self.high:g}.'
            )
        if self.choices and value not in self.choices:
            raise ParameterError(
                f'Parameter {self.name} is {value!r}, but must be one of '
                f'{", ".join(self.choices)}.'
            )


_PORT = (0, 65535)

#: Name, description, unit and largest sensible value of each quantity that has a tolerance.
_TOLERANCE_PARAMETERS = (
    ('position', 'position', 'm', 10.0),
    ('orientation', 'orientation', 'rad', 3.2),
    ('linear_velocity', 'velocity', 'm/s', 10.0),
    ('angular_velocity', 'angular velocity', 'rad/s', 50.0),
    ('linear_acceleration', 'acceleration', 'm/s^2', 1000.0),
    ('angular_acceleration', 'angular acceleration', 'rad/s^2', 1000.0),
)


def _tolerances(which: str, where: str) -> tuple[ParameterDeclaration, ...]:
    """Return the defaults for zeros in ``<which>_tolerance`` of a goal."""
    return tuple(
        ParameterDeclaration(
            f'{which}_tolerance_{name}',
            f'Largest {phrase} error {where}, where the goal does not specify one [{unit}]; '
            '0: no limit.',
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
        'Model of the robot; a robot that reports another model is refused.',
        choices=tuple(MODELS),
    ),
    ParameterDeclaration('robot_ip', 'Address of the robot.'),
    ParameterDeclaration('tf_prefix', 'Prefix of joint and frame names, for example left_.'),
    ParameterDeclaration(
        'static_frames',
        'Fixed frames for goals, and tools as controlled frames, each as "name parent x y z qx '
        'qy qz qw" [m, unit quaternion]; the parent is base, base_link, tool0, flange, '
        'tool0_controller or another of these frames. Empty texts are skipped.',
    ),
    ParameterDeclaration(
        'tf_max_age',
        'Largest age of the newest tf2 transform of a frame when a goal is planned [s]; static '
        'transforms have no age.',
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
        'Power on the arm and release its brakes on the first connection, and never again; only '
        'with headless_mode.',
    ),
    ParameterDeclaration(
        'wire_dialect',
        'Message version of the robot program; an older one only for a robot that runs a saved, '
        'older External Control program.',
        choices=tuple(DIALECTS),
    ),
    # -- what a goal may do
    ParameterDeclaration(
        'on_new_goal',
        'A goal arrives while another one runs: preempt the running one if the new one passes '
        'all checks, or reject the new one (it ends ABORTED).',
        choices=('preempt', 'reject'),
    ),
    ParameterDeclaration('max_points', 'Largest number of points in a goal.', 1, 1_000_000),
    ParameterDeclaration(
        'max_tool_speed',
        'Largest speed of the TCP [m/s]; 0: no limit. Motions without times are slowed down '
        'to it.',
        0.0,
        10.0,
    ),
    ParameterDeclaration(
        'on_too_fast',
        'The times of a goal need more speed than the limits allow: refuse it, or slow it down.',
        choices=('refuse', 'slow'),
    ),
    ParameterDeclaration(
        'on_robot_stop',
        'The robot makes a protective or safeguard stop during a goal: abort the goal, and its '
        'motion never resumes; or continue it when a person unlocks the robot and plays its '
        'program, as the robot itself does.',
        choices=('abort', 'continue'),
    ),
    ParameterDeclaration(
        'max_approach_distance',
        'Largest distance of the tool to the first point [m]; 0: no limit.',
        0.0,
        10.0,
    ),
    ParameterDeclaration(
        'on_posture_change',
        'A line or arc cannot arrive in the required posture, or cannot be followed although its '
        'end is reachable: refuse the goal, or replace the segment by a joint motion (movej).',
        choices=('refuse', 'movej'),
    ),
    ParameterDeclaration(
        'singularity_margin_wrist',
        'Smallest angle between wrist 2 and the straight wrist on lines and arcs [rad]; 0: no '
        'limit.',
        0.0,
        1.0,
    ),
    ParameterDeclaration(
        'singularity_margin_elbow',
        'Smallest angle between the elbow and the stretched arm on lines and arcs [rad]; 0: no '
        'limit.',
        0.0,
        1.0,
    ),
    ParameterDeclaration(
        'singularity_margin_shoulder',
        'Smallest distance of the wrist centre from the point above or below the shoulder, '
        'measured along the arm, on lines and arcs [m]; 0: no limit.',
        0.0,
        1.0,
    ),
    ParameterDeclaration(
        'allow_tcp_change',
        "Set the robot's TCP to the controlled frame of a goal until the goal ends. False: a "
        'goal whose controlled frame is not the TCP must not rotate it on straight or circular '
        'segments.',
    ),
    ParameterDeclaration(
        'self_collision',
        'The arm comes closer to itself than min_clearance: off, warn in the report, refuse the '
        'goal, or auto: refuse where meshes are checked (UR3, UR5, UR10), warn where capsules '
        'are.',
        choices=('auto', 'off', 'warn', 'refuse'),
    ),
    ParameterDeclaration('min_clearance', 'Smallest distance of the arm to itself [m].', 0.0, 1.0),
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
        '[margin]" [m]: a point on the plane and its normal, which points to the allowed side, '
        'both in base (not base_link). Empty texts are skipped.',
    ),
    ParameterDeclaration(
        'stamp_tolerance', "Largest age of a goal's header.stamp on arrival [s].", 0.0, 3600.0
    ),
    ParameterDeclaration(
        'goal_time_tolerance',
        'Largest delay of the end of a goal, where the goal does not specify one [s].',
        0.001,
        3600.0,
    ),
    ParameterDeclaration(
        'start_tolerance_position',
        'Largest distance of the TCP from a first point at time 0 [m].',
        0.0,
        1.0,
    ),
    ParameterDeclaration(
        'start_tolerance_angle',
        'Largest angle of the TCP from a first point at time 0 [rad].',
        0.0,
        3.2,
    ),
    # -- monitoring
    ParameterDeclaration(
        'max_plan_deviation',
        "Largest distance of the controller's own target from the plan, blends apart [m]; 0: no "
        'limit.',
        0.0,
        1.0,
    ),
    ParameterDeclaration(
        'max_plan_deviation_angle',
        "Largest angle of the controller's own target from the plan, blends apart [rad]; 0: no "
        'limit.',
        0.0,
        3.2,
    ),
    ParameterDeclaration(
        'max_calibration_difference',
        "Warn if the robot's calibration moves the flange farther than this from its nominal "
        'pose [m]; 0: never.',
        0.0,
        1.0,
    ),
    *_tolerances('path', 'on the path'),
    *_tolerances('goal', 'at the end'),
    # -- speeds where the goal specifies none
    ParameterDeclaration(
        'linear_velocity', 'Speed of the tool on lines and arcs [m/s].', 1e-4, 10.0
    ),
    ParameterDeclaration(
        'linear_acceleration', 'Acceleration of the tool on lines and arcs [m/s^2].', 1e-3, 100.0
    ),
    ParameterDeclaration(
        'angular_velocity',
        'Angular speed of the tool on segments that only rotate it [rad/s].',
        1e-3,
        20.0,
    ),
    ParameterDeclaration(
        'angular_acceleration',
        'Angular acceleration of the tool on segments that only rotate it [rad/s^2].',
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
    # -- limits of timed motions
    ParameterDeclaration(
        'max_linear_acceleration',
        'Largest acceleration of the tool that the times of a goal may need [m/s^2].',
        0.1,
        100.0,
    ),
    ParameterDeclaration(
        'max_angular_acceleration',
        'Largest angular acceleration of the tool that the times of a goal may need [rad/s^2].',
        0.1,
        1000.0,
    ),
    ParameterDeclaration(
        'max_joint_acceleration',
        'Largest acceleration of a joint that the times of a goal may need [rad/s^2].',
        0.1,
        1000.0,
    ),
    ParameterDeclaration(
        'max_segment_time', 'Longest duration of one segment [s].', 0.1, 2147.483647
    ),
    # -- splines
    ParameterDeclaration(
        'spline_tolerance',
        'Largest distance of the tool from the curve through the points of SPLINE and SERVO '
        'goals [m]; the orientation error [rad] times 0.1 m has the same limit.',
        1e-6,
        0.01,
    ),
    ParameterDeclaration(
        'keep_open_deceleration',
        'Deceleration of the fastest joint where a goal with keep_open runs out of points '
        '[rad/s^2].',
        0.1,
        100.0,
    ),
    # -- live targets
    ParameterDeclaration(
        'live_target_enabled', 'Subscribe to ~/live_target and follow the poses there.'
    ),
    ParameterDeclaration(
        'live_target_max_age',
        'Largest age of a live target, by its stamp or else since its receipt [s]; then the arm '
        'stops smoothly until a newer one arrives.',
        0.01,
        10.0,
    ),
    ParameterDeclaration(
        'live_target_timeout',
        'Time after the last live target at which the session ends [s].',
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
        'Largest angular speed of the tool when it follows live targets [rad/s].',
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
    # -- publishing
    ParameterDeclaration(
        'state_publish_rate',
        'Rate of joint states, TCP pose, wrench, speed scaling and tf [Hz].',
        1.0,
        500.0,
    ),
    ParameterDeclaration(
        'io_publish_rate',
        'Rate at which inputs, outputs and tool data are checked for changes [Hz]; 0: never.',
        0.0,
        125.0,
    ),
    ParameterDeclaration('diagnostics_rate', 'Rate of /diagnostics [Hz]; 0: never.', 0.0, 50.0),
    ParameterDeclaration(
        'servo_state_rate', 'Largest rate of ~/servo_state [Hz]; 0: never.', 0.0, 500.0
    ),
    ParameterDeclaration('feedback_rate', "Rate of a goal's feedback [Hz].", 0.5, 500.0),
    # -- set-points
    ParameterDeclaration('servoj_gain', 'SERVO: proportional gain of servoj.', 100.0, 2000.0),
    ParameterDeclaration(
        'servoj_lookahead_time',
        'SERVO: time that servoj looks ahead, and by which the arm lags behind [s].',
        0.03,
        0.2,
    ),
    ParameterDeclaration(
        'servo_target_lag',
        'SERVO: motion time in flight to the arm, and so the longest interruption of the '
        'connection that it bridges [s].',
        0.008,
        0.2,
    ),
    ParameterDeclaration(
        'servo_buffer_depth',
        "SERVO: set-points in the robot program's buffer; servo_target_lag has to fit in at "
        '500 Hz.',
        20,
        1000,
    ),
    ParameterDeclaration(
        'servo_max_divergence',
        'SERVO: distance of a joint from its set-point at which the robot program stops the arm '
        '[rad].',
        0.01,
        3.0,
    ),
    ParameterDeclaration(
        'allow_freedrive',
        'Offer ~/freedrive_mode, in which a person guides the arm by hand; the robot program is '
        'built for it.',
    ),
    # -- open-ended goals
    ParameterDeclaration(
        'keep_open_horizon',
        'Goals with keep_open: planned motion time that the robot is given ahead [s]; at least '
        'twice keep_open_margin.',
        0.1,
        60.0,
    ),
    ParameterDeclaration(
        'keep_open_margin',
        'Goals with keep_open: time before the robot runs out of points at which the arm is '
        'brought to rest, if no more points have arrived [s].',
        0.02,
        10.0,
    ),
    ParameterDeclaration(
        'keep_open_timeout',
        'Goals with keep_open: time that a goal waits at rest for more points before it ends '
        '[s]; 0: no limit.',
        0.0,
        86400.0,
    ),
    # -- recordings
    ParameterDeclaration(
        'record_directory',
        'Directory in which each motion is recorded as a file for `ur-cartesian plot`; empty: no '
        'recordings.',
    ),
    ParameterDeclaration(
        'record_max_size',
        'Largest size of all recordings together [MB]; the oldest ones are removed, and a single '
        'one ends at half of it.',
        1.0,
        1e6,
    ),
    # -- network
    ParameterDeclaration('rtde_port', 'RTDE port of the robot.', *_PORT),
    ParameterDeclaration('primary_port', 'Port of the primary interface of the robot.', *_PORT),
    ParameterDeclaration('dashboard_port', 'Port of the dashboard server of the robot.', *_PORT),
    ParameterDeclaration(
        'reverse_port',
        'Port to which the robot program connects for control messages; 0: any free port.',
        *_PORT,
    ),
    ParameterDeclaration(
        'script_sender_port',
        'Port that serves the robot program to the External Control URCap; 0: any free port.',
        *_PORT,
    ),
    ParameterDeclaration(
        'trajectory_port',
        'Port to which the robot program connects for trajectory points; 0: any free port.',
        *_PORT,
    ),
    ParameterDeclaration(
        'script_command_port',
        'Port to which the robot program connects for single commands; 0: any free port.',
        *_PORT,
    ),
    ParameterDeclaration(
        'bind_address',
        'Address at which the ports above listen; empty: the local '
        'address of the connection to the robot.',
    ),
    ParameterDeclaration(
        'reverse_ip',
        'Address at which the robot reaches this computer (NAT, containers); empty: the address '
        'at which the ports listen.',
    ),
    ParameterDeclaration(
        'allowed_peers',
        'Addresses that may connect to the ports above; empty: robot_ip. Empty texts are skipped.',
    ),
    # -- timing
    ParameterDeclaration(
        'rtde_frequency',
        "Rate of the robot's RTDE reports [Hz], at least 10; 0: the largest that it supports.",
        0.0,
        500.0,
    ),
    ParameterDeclaration(
        'robot_receive_timeout',
        'Time without a keepalive after which the robot program stops the arm [s].',
        0.02,
        10.0,
    ),
    ParameterDeclaration(
        'keepalive_period', 'Period of the keepalive to the robot program [s].', 0.002, 1.0
    ),
    ParameterDeclaration(
        'node_timeout',
        'Time without a heartbeat of this node after which its arm is stopped [s]; longer than '
        'the largest goal takes to arrive.',
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
        'Where the robot loop runs: in a process of its own, or in a thread (for tests).',
        choices=('process', 'thread'),
    ),
)
