# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The addresses, ports and timings of the connections to a robot."""

from __future__ import annotations

from dataclasses import dataclass, field
import ipaddress
from typing import Annotated, TypeAlias

from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.goal.field_annotations import Range
from ur_cartesian_driver.motion.goal.parameter_fields import check_parameters, Detected, OneOf
from ur_cartesian_driver.program.prelude import NO_PRELUDE, Prelude
from ur_cartesian_driver.protocol.program.wire_dialects import Dialect, DIALECTS, NEWEST_DIALECT

Port: TypeAlias = Annotated[int, Range(0, 65535)]


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkSettings:
    """The connections to one robot; the defaults are for a real robot."""

    #: Address of the robot.
    robot_ip: str = '127.0.0.1'
    #: Model of the robot. A robot that reports another model is refused: nothing moves.
    ur_type: Annotated[str, OneOf(tuple(MODELS))] = 'ur5e'
    #: RTDE port of the robot.
    rtde_port: Port = 30004
    #: Port of the primary interface of the robot.
    primary_port: Port = 30001
    #: Port on this computer to which the robot program connects for control messages; 0: any free
    #: port. Two drivers on one computer need different numbers for this and the next three ports.
    reverse_port: Port = 50001
    #: Port that serves the robot program to the External Control URCap; 0: any free port.
    script_sender_port: Port = 50002
    #: Port to which the robot program connects for trajectory points; 0: any free port.
    trajectory_port: Port = 50003
    #: Port to which the robot program connects for single commands; 0: any free port.
    script_command_port: Port = 50004
    #: Address at which the ports on this computer listen; empty: the local address of the
    #: connection to the robot.
    bind_address: str = ''
    #: Address to which the robot program connects, if it is not the address of these ports (NAT,
    #: containers); empty: the same address.
    reverse_ip: str = ''
    #: Addresses that may connect to the ports on this computer; ['']: robot_ip.
    allowed_peers: tuple[str, ...] = ()
    #: true: the driver sends its program to the robot: once on the first connection, if the arm is
    #: ready and no other program runs, and later when ~/resend_robot_program is called. No pendant
    #: is needed, but the robot must be in remote control (the simulator always is). false: the
    #: robot fetches the program when a person plays one with External Control on the pendant.
    headless_mode: bool = False
    #: Message version of the robot program: 2.14 for ours. For a robot that runs a saved, older
    #: External Control program: the version of its client library, rounded down to 2.0, 2.10 or
    #: 2.12 (in quotes). What such a program cannot do is refused, or done in another way that the
    #: report explains. Not possible with headless_mode.
    wire_dialect: Annotated[str, OneOf(tuple(DIALECTS))] = NEWEST_DIALECT.name
    #: Time without a keepalive after which the robot program stops the arm [s].
    robot_receive_timeout: Annotated[float, Range(0.02, 10.0)] = 0.2
    #: Largest age of the newest state of the robot [s]; 0.0: any age. With older states, which
    #: come from an overloaded network or computer, the driver would detect a violated tolerance
    #: that much later. So it stops a motion with CONNECTION_LOST, and accepts no goal until the
    #: states have been younger than half this age for 1 s. At least two periods of rtde_frequency.
    max_state_age: Annotated[float, Range(0.0, 10.0)] = 0.2
    #: true: with headless_mode, power on the arm and release its brakes on the first connection of
    #: this driver, and never again. Releasing the brakes moves the arm a little. false: a person
    #: does so, or the services ~/dashboard/power_on and ~/dashboard/brake_release, or ~/recover.
    auto_power: bool = False
    #: true: ~/recover unlocks a protective stop even if its request does not set
    #: unlock_protective_stop. You are then responsible: the manufacturer forbids resetting
    #: protective stops automatically, because a person has to look for the cause each time.
    unlock_protective_stops: bool = False
    #: Period of the keepalive to the robot program [s].
    keepalive_period: Annotated[float, Range(0.002, 1.0)] = 0.02
    # A robot that reports at less than the smallest rate cannot be monitored, nor be distinguished
    # from a lost one.
    #: Rate of the robot's RTDE reports [Hz]; 0.0: the largest that it supports (500, CB3: 125).
    rtde_frequency: Annotated[float, Range(10.0, 500.0, zero='as often as the robot can')] = 0.0
    #: true: driver and robot program use the int and double RTDE registers 0 to 23, because
    #: another client needs those from 24 on. A fieldbus (EtherNet/IP, PROFINET) of the robot has
    #: the lower ones if the installation enables it. false: they use those from 24 on.
    lower_registers: bool = False
    #: Motion version that the robot program sets for its movej and movel, and sets back when it
    #: ends: 1 or 2, on PolyScope 5 from 5.22 on; 0: leave it as it is. Plans are made for 1. A
    #: program that is stopped from outside cannot set it back.
    motion_version: Annotated[int, Range(0, 2)] = 0
    #: Rate at which ~/io_states and ~/tool_data are checked for changes [Hz]; 0.0: never.
    io_publish_rate: Annotated[float, Range(0.0, 125.0)] = 25.0
    #: Deceleration of the leading axis when a goal is stopped [rad/s^2].
    stop_deceleration: Annotated[float, Range(0.1, 100.0)] = 4.0
    #: SERVO: proportional gain of servoj. The manufacturer's guide uses 1000. With a higher gain
    #: the arm follows more closely; if it hums or shakes, lower the gain, or raise
    #: servoj_lookahead_time.
    servoj_gain: Annotated[float, Range(100.0, 2000.0)] = 1000.0
    #: SERVO: time by which servoj looks ahead and the arm lags behind [s]. The guide uses 0.06.
    #: For sharper corners, lower it step by step, with the tool mounted.
    servoj_lookahead_time: Annotated[float, Range(0.03, 0.2)] = 0.06
    #: SERVO: set-points in the robot program's buffer; servo_target_lag has to fit in at 500 Hz.
    servo_buffer_depth: Annotated[int, Range(20, 1000)] = 250
    #: true: ~/run_script runs the caller's URScript on the robot, and script_prelude may name a
    #: file. The driver checks nothing that this URScript does, and everyone who can call the
    #: service can move the arm.
    allow_scripts: bool = False
    #: File of URScript functions (def) that goals may call at points (script_calls), for example
    #: for a gripper. The file becomes part of the robot program, and needs allow_scripts. A
    #: relative path begins at the folder in which the driver was started. Empty: no file.
    script_prelude: str = ''
    #: The functions of script_prelude, read once, so that planner and robot use the same.
    prelude: Detected[Prelude] = field(init=False, default=NO_PRELUDE)
    #: true: offer ~/freedrive_mode, in which a person guides the arm by hand.
    allow_freedrive: bool = False

    def __post_init__(self) -> None:
        """
        Refuse values that cannot work together.

        :raises ValueError: a value is invalid; the text names the field, its value and the bound.
        """
        check_parameters(self)
        self._check_dialect()
        if self.script_prelude and not self.allow_scripts:
            raise ValueError(
                f'script_prelude is {self.script_prelude!r}, but allow_scripts is false; its '
                'functions are outside all checks of the driver: set allow_scripts to true, or '
                'leave script_prelude out.'
            )
        if self.script_prelude:
            # Imported here, because most drivers do not need the parser of URScript.
            from ur_cartesian_driver.robot.prelude_file import read_prelude

            object.__setattr__(self, 'prelude', read_prelude(self.script_prelude))
        for address in self.allowed_peers:
            _require_address('allowed_peers', address)
        if 0.0 < self.max_state_age * self.rtde_frequency < 2.0:
            raise ValueError(
                f'max_state_age is {self.max_state_age:g} s, it has to be 0 (any age) or at least '
                f'two periods of rtde_frequency = {self.rtde_frequency:g} Hz.'
            )
        if self.robot_receive_timeout < 2.0 * self.keepalive_period:
            raise ValueError(
                f'robot_receive_timeout is {self.robot_receive_timeout} s, it has to be at least '
                f'twice the keepalive_period of {self.keepalive_period} s.'
            )

    @property
    def dialect(self) -> Dialect:
        """The messages that the robot program understands."""
        return DIALECTS[self.wire_dialect]

    @property
    def runs_own_program(self) -> bool:
        """Whether the robot runs the program of this driver, not an older one saved on it."""
        return self.dialect.is_own

    @property
    def other_program(self) -> str:
        """A clause that names the program in place of ours."""
        return f'wire_dialect says that another one, {self.wire_dialect}, runs'

    def _check_dialect(self) -> None:
        if self.headless_mode and not self.runs_own_program:
            raise ValueError(
                f"wire_dialect is '{self.wire_dialect}' and headless_mode is true, but "
                'headless_mode sends our own robot program, which understands '
                f"'{NEWEST_DIALECT.name}'; "
                'leave wire_dialect out, or set headless_mode to false and start the program that '
                'is saved on the robot.'
            )
        if self.lower_registers and not self.runs_own_program:
            raise ValueError(
                f"wire_dialect is '{self.wire_dialect}' and lower_registers is true, but such "
                'programs use the registers from 24 on; set lower_registers to false.'
            )
        if self.motion_version and not self.runs_own_program:
            raise ValueError(
                f"wire_dialect is '{self.wire_dialect}' and motion_version is "
                f'{self.motion_version}, but such programs set no motion version; set '
                'motion_version to 0.'
            )


def _require_address(name: str, text: str) -> None:
    """
    Refuse a text that is not an IP address, because it is compared with the clients' addresses.

    :raises ValueError: the text is a host name or a network, for example.
    """
    try:
        ipaddress.ip_address(text)
    except ValueError:
        raise ValueError(
            f'{name} has {text!r}, which is no IP address; use one such as 192.168.56.101.'
        ) from None
