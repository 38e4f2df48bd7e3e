# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""What the owner of a driver sets, and what the driver tells about its connection."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

from ur_cartesian_driver.robot.lifecycle import ConnectionState


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverConfig:
    """How to reach the robot; the defaults are those of a real one."""

    robot_ip: str = '127.0.0.1'
    #: Model that is expected, for example ``ur5e``; a robot that reports another is refused.
    ur_type: str = 'ur5e'
    rtde_port: int = 30004
    primary_port: int = 30001
    dashboard_port: int = 29999
    #: Where we listen for the robot program; 0 = any free port.
    reverse_port: int = 50001
    script_sender_port: int = 50002
    trajectory_port: int = 50003
    script_command_port: int = 50004
    #: Address to listen on; empty = the local address of the RTDE connection.
    bind_address: str = ''
    #: Address that the robot program dials; empty = the one we listen on.
    reverse_ip: str = ''
    #: Addresses that may call; empty = robot_ip only.
    allowed_peers: tuple[str, ...] = ()
    #: Upload the robot program ourselves; else a program on the robot asks for it.
    headless_mode: bool = False
    #: The program stops the arm and ends when we are silent for that long [s].
    robot_receive_timeout: float = 0.2
    #: Time between two messages on the reverse socket [s].
    keepalive_period: float = 0.02
    #: Packets per second from the robot; 0 = as many as it can.
    rtde_frequency: float = 0.0
    #: Progress reports per second.
    feedback_rate: float = 25.0
    #: The arm is stopped when the owner of the driver is silent for that long [s].
    node_timeout: float = 5.0
    #: ``process`` (robust) or ``thread`` (light: tests and scripts).
    robot_loop: str = 'process'
    #: Deceleration of the leading axis for every stop [rad/s^2].
    stop_deceleration: float = 4.0

    def __post_init__(self) -> None:
        """
        Refuse values that cannot work together.

        :raises ValueError: names the field, its value and the bound.
        """
        if self.robot_loop not in ('process', 'thread'):
            raise ValueError(
                f"robot_loop is {self.robot_loop!r}, it has to be 'process' or 'thread'.")
        for name in ('robot_receive_timeout', 'keepalive_period', 'feedback_rate',
                     'node_timeout', 'stop_deceleration'):
            value = getattr(self, name)
            if not value > 0.0:
                raise ValueError(f'{name} is {value}, it has to be greater than 0.')
        if self.robot_receive_timeout < 2.0 * self.keepalive_period:
            raise ValueError(
                f'robot_receive_timeout is {self.robot_receive_timeout} s, it has to be at least '
                f'twice the keepalive_period of {self.keepalive_period} s.')


@dataclass(frozen=True, slots=True, kw_only=True)
class DriverStatus:
    """How far the connection is, and what is needed before a goal can run."""

    state: ConnectionState = ConnectionState.DISCONNECTED
    #: One sentence: what is needed; empty when nothing is.
    message: str = ''
    #: The last thing that went wrong.
    last_error: str = ''
    #: What the robot says it is; empty until it has said so.
    robot_model: str = ''
    polyscope_version: str = ''
    program_running: bool = False
    calibration_known: bool = False
    #: The ports that we really listen on, by the name of the parameter.
    ports: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the read-only mapping as a plain one."""
        return _status, ({name: getattr(self, name) for name in self.__slots__ if name != 'ports'}
                         | {'ports': dict(self.ports)},)


def _status(fields: dict[str, object]) -> DriverStatus:
    return DriverStatus(**fields)  # type: ignore[arg-type]
