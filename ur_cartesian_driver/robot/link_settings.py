# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The addresses, ports and timings of the connections to a robot."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
import ipaddress
from math import isfinite

from ur_cartesian_driver.motion.goal.declared_types import declare_types
from ur_cartesian_driver.program.prelude import NO_PRELUDE, Prelude
from ur_cartesian_driver.protocol.program.wire_dialects import Dialect, DIALECTS, NEWEST_DIALECT

#: A robot that reports less often cannot be monitored, nor be told from a lost one [Hz].
MIN_RTDE_FREQUENCY = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkSettings:
    """The connections to one robot; the defaults fit a real one."""

    robot_ip: str = '127.0.0.1'
    #: Model that is expected, for example ``ur5e``; a robot that reports another is refused.
    ur_type: str = 'ur5e'
    rtde_port: int = 30004
    primary_port: int = 30001
    #: Where we listen for the robot program; 0 = any free port.
    reverse_port: int = 50001
    script_sender_port: int = 50002
    trajectory_port: int = 50003
    script_command_port: int = 50004
    #: Address to listen on; empty = the local address of the RTDE connection.
    bind_address: str = ''
    #: Address that the robot program dials; empty = the one we listen on.
    reverse_ip: str = ''
    #: Addresses that may connect; empty = robot_ip only.
    allowed_peers: tuple[str, ...] = ()
    #: Upload the robot program ourselves; else a program on the robot asks for it.
    headless_mode: bool = False
    #: Which messages the robot program understands, by the version of the library that it came
    #: with; other than the newest for a program that was saved on the robot.
    wire_dialect: str = NEWEST_DIALECT.name
    #: Without a keepalive for that long [s] the robot program stops the arm and ends.
    robot_receive_timeout: float = 0.2
    #: Where the newest state of the robot is older than this [s], the driver stops the arm and
    #: takes no goal; 0 = never.
    max_state_age: float = 0.2
    #: Switch the arm on and release its brakes on the first connection (headless mode only).
    auto_power: bool = False
    #: A recovery unlocks protective stops without being asked to each time.
    unlock_protective_stops: bool = False
    #: Time between two messages on the reverse socket [s].
    keepalive_period: float = 0.02
    #: Packets per second from the robot, at least :data:`MIN_RTDE_FREQUENCY`; 0 = as many as it
    #: can.
    rtde_frequency: float = 0.0
    #: How often inputs, outputs and tool are reported [Hz]; 0 = never.
    io_publish_rate: float = 25.0
    #: Deceleration of the leading axis for every stop [rad/s^2].
    stop_deceleration: float = 4.0
    #: SERVO: how stiff ``servoj`` holds a set-point (100 to 2000), how far it looks ahead [s]
    #: (0.03 to 0.2), and how many set-points the buffer of the robot program holds.
    servoj_gain: float = 1000.0
    servoj_lookahead_time: float = 0.06
    servo_buffer_depth: int = 250
    #: Whether scripts of others are run on the robot.
    allow_scripts: bool = False
    #: File with URScript functions that goals call; empty = none.
    script_prelude: str = ''
    #: Its functions, read once, so that planner and robot have the same.
    prelude: Prelude = field(init=False, default=NO_PRELUDE)
    #: Whether a person may guide the arm by hand (freedrive).
    allow_freedrive: bool = False

    def __post_init__(self) -> None:
        """
        Refuse values that cannot work together.

        :raises ValueError: names the field, its value and the bound.
        """
        self._check_numbers()
        self._check_dialect()
        self._require_within('servoj_gain', 100.0, 2000.0)
        self._require_within('servoj_lookahead_time', 0.03, 0.2)
        self._require_within('servo_buffer_depth', 20, 1000)
        if self.script_prelude and not self.allow_scripts:
            raise ValueError(
                f'script_prelude is {self.script_prelude!r}, but allow_scripts is false; its '
                'functions are outside all checks of the driver: set allow_scripts to true, or '
                'leave script_prelude out.'
            )
        if self.script_prelude:
            # Here, because most drivers do without the parser of URScript.
            from ur_cartesian_driver.robot.prelude_file import read_prelude

            object.__setattr__(self, 'prelude', read_prelude(self.script_prelude))
        for address in self.allowed_peers:
            _require_address('allowed_peers', address)
        self._require_positive('robot_receive_timeout', 'keepalive_period', 'stop_deceleration')
        self._require_not_negative('io_publish_rate', 'max_state_age')
        if self.rtde_frequency != 0.0 and not self.rtde_frequency >= MIN_RTDE_FREQUENCY:
            raise ValueError(
                f'rtde_frequency is {self.rtde_frequency:g} Hz, it has to be 0 (as often as the '
                f'robot can) or at least {MIN_RTDE_FREQUENCY:g} Hz.'
            )
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

    def _check_numbers(self) -> None:
        """Convert all fields to their types; refuse numbers that no setting takes."""
        declare_types(self)
        for name in (each.name for each in fields(self)):
            value = getattr(self, name)
            if isinstance(value, float) and not isfinite(value):
                raise ValueError(f'{name} is {value}, it has to be finite.')
            if name.endswith('_port'):
                self._require_within(name, 0, 65535)

    def _check_dialect(self) -> None:
        if self.wire_dialect not in DIALECTS:
            raise ValueError(
                f'wire_dialect is {self.wire_dialect!r}, it has to be one of '
                f'{", ".join(DIALECTS)}.'
            )
        if self.headless_mode and self.dialect is not NEWEST_DIALECT:
            raise ValueError(
                f"wire_dialect is '{self.wire_dialect}' and headless_mode is true, but "
                'headless_mode sends our own robot program, which understands '
                f"'{NEWEST_DIALECT.name}'; "
                'leave wire_dialect out, or set headless_mode to false and start the program that '
                'is saved on the robot.'
            )

    def _require_within(self, name: str, low: float, high: float) -> None:
        value = getattr(self, name)
        if not low <= value <= high:
            raise ValueError(f'{name} is {value:g}, it has to be within {low:g} and {high:g}.')

    def _require_not_negative(self, *names: str) -> None:
        for name in names:
            value = getattr(self, name)
            if value < 0.0:
                raise ValueError(f'{name} is {value}, it must not be negative.')

    def _require_positive(self, *names: str) -> None:
        for name in names:
            value = getattr(self, name)
            if not value > 0.0:
                raise ValueError(f'{name} is {value}, it has to be greater than 0.')


def _require_address(name: str, text: str) -> None:
    """
    Refuse a host name or a network: it is compared with the addresses of clients.

    :raises ValueError: names the field and the text.
    """
    try:
        ipaddress.ip_address(text)
    except ValueError:
        raise ValueError(
            f'{name} has {text!r}, which is no IP address; use one such as 192.168.56.101.'
        ) from None
