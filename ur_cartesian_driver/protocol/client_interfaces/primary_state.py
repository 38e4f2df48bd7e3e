# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The sub-packages of a robot state frame on the primary interface.

Each is big-endian: ``uint32`` size, ``uint8`` type, body; the size counts all three.
A UR5e sends the sub-packages in the order and with the sizes of this table, together 1386 bytes
with the frame's header. Only the known beginning of a body is decoded, because newer software
appends fields, but never omits any.

====  ====================  ====  ===============================================================
type  class                 size  body
====  ====================  ====  ===============================================================
0     RobotModeData         47    u64 timestamp; 7 flags; i8 robot mode; u8 control mode;
                                  f64 target speed fraction, speed scaling, max fraction;
                                  1 reserved
1     JointData             251   6 x (f64 q, q target, qd; f32 current, voltage, temperature,
                                  not used; u8 mode)
4     CartesianInfo         101   6 f64 TCP pose, 6 f64 TCP offset
5     KinematicsInfo        225   6 u32 checksum; 6 f64 each: theta, a, d, alpha; u32 status
9     CalibrationData       53    6 f64, for the manufacturer only
3     MasterboardData       75    see the class; 91 with an injection moulding interface
2     ToolData              37    2 u8 ranges, 2 f64 inputs, f32 48 V, u8 output voltage,
                                  f32 current, temperature, u8 mode
6     ConfigurationData     445   see the class; 447 or 449 in newer software
7     ForceModeData         61    6 f64 wrench, f64 dexterity
8     AdditionalInfo        9     3 flags: teach button, freedrive enabled, freedrive by IO; 1
                                  reserved
10    (SAFETY_DATA)         43    for the manufacturer only
11    ToolCommunication     26    flag; i32 baud rate, parity, stop bits; f32 idle chars rx, tx
12    ToolModeInfo          8     u8 output mode, u8 mode of digital outputs 0 and 1
====  ====================  ====  ===============================================================

Note the different orders of the Denavit-Hartenberg columns: theta, a, d, alpha in KinematicsInfo,
a, d, alpha, theta in ConfigurationData.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
import struct
from typing import cast, ClassVar, TypeAlias

from ur_cartesian_driver.motion.errors import RemoteProtocolError
from ur_cartesian_driver.motion.geometry.vectors import Vector6, ZERO6
from ur_cartesian_driver.motion.state.rtde_state import RobotMode, SafetyMode
from ur_cartesian_driver.protocol.client_interfaces.body_layout import (
    Body,
    BodyLayout,
    pack,
    unpack,
)
from ur_cartesian_driver.protocol.framing import hex_text

Integers6: TypeAlias = tuple[int, int, int, int, int, int]
Pair: TypeAlias = tuple[float, float]
Pairs6: TypeAlias = tuple[Pair, Pair, Pair, Pair, Pair, Pair]

#: Mode of a joint or the tool in normal operation.
JOINT_RUNNING = 253

_SUB_HEADER = struct.Struct('>IB')
_JOINT = struct.Struct('>3d4fB')
_CONFIGURATION = BodyLayout('12d 12d d d d d d 6d 6d 6d 6d i i i i', 'configuration data')
_BOARD_HEAD = BodyLayout('I I 2B 2d 2b 2d f f f f B ? ?', 'masterboard data')
_BOARD_TAIL = BodyLayout('I B ? B', 'masterboard data')


@dataclass(frozen=True, slots=True, kw_only=True)
class RawSubPackage:
    """A sub-package that is not decoded."""

    sub_type: int
    body: bytes

    def encode(self) -> bytes:
        """Return the body."""
        return self.body


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotModeData(Body):
    """Power, stops, program; ``robot_mode`` may be a number that :class:`RobotMode` lacks."""

    sub_type: ClassVar = 0
    layout: ClassVar = BodyLayout('Q ? ? ? ? ? ? ? b B d d d', 'robot mode data', padding=1)
    timestamp: int = 0
    real_robot_connected: bool = True
    real_robot_enabled: bool = True
    power_on: bool = True
    emergency_stopped: bool = False
    protective_stopped: bool = False
    program_running: bool = False
    program_paused: bool = False
    robot_mode: int = RobotMode.RUNNING
    control_mode: int = 0
    target_speed_fraction: float = 1.0
    speed_scaling: float = 1.0
    target_speed_fraction_limit: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class JointData:
    """Joint positions [rad], speeds [rad/s], currents [A], voltages [V], temperatures [deg C]."""

    sub_type: ClassVar = 1
    q_actual: Vector6
    q_target: Vector6
    qd_actual: Vector6 = ZERO6
    current: Vector6 = ZERO6
    voltage: Vector6 = ZERO6
    temperature: Vector6 = ZERO6
    mode: Integers6 = (JOINT_RUNNING,) * 6

    def encode(self) -> bytes:
        """Return the body; the unused temperature of the electronics is 0."""
        columns = (getattr(self, name) for name in self.__slots__)
        return b''.join(
            pack(_JOINT, *numbers, 0.0, mode) for *numbers, mode in zip(*columns, strict=True)
        )

    @classmethod
    def decode(cls, body: bytes) -> JointData:
        """Decode a body; RemoteProtocolError if it is too short."""
        joints = [unpack(_JOINT, body, 'joint data', i * _JOINT.size) for i in range(6)]
        *columns, _, mode = zip(*joints, strict=True)
        construct: Callable[..., JointData] = cls
        return construct(**dict(zip(cls.__slots__, [*columns, mode], strict=True)))


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolData(Body):
    """Tool connector: inputs [V or A by range], voltages [V], current [A], temperature [deg C]."""

    sub_type: ClassVar = 2
    layout: ClassVar = BodyLayout('2B 2d f B f f B', 'tool data')
    analog_input_range: tuple[int, int] = (1, 1)
    analog_input: Pair = (0.0, 0.0)
    voltage_48v: float = 0.0
    output_voltage: int = 0
    current: float = 0.0
    temperature: float = 0.0
    mode: int = JOINT_RUNNING


@dataclass(frozen=True, slots=True, kw_only=True)
class ImmiData(Body):
    """Injection moulding machine interface (Euromap 67): bits, supply [V], current [A]."""

    layout: ClassVar = BodyLayout('I I f f', 'masterboard data')
    input_bits: int = 0
    output_bits: int = 0
    voltage_24v: float = 0.0
    current: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MasterboardData:
    """
    The controller box.

    Body: u32 digital inputs, u32 digital outputs, 2 u8 input ranges, 2 f64 inputs, 2 i8 output
    domains, 2 f64 outputs, f32 temperature [deg C], voltage 48 V [V], current of the robot [A], of
    the IO [A], u8 safety mode, flag reduced, flag IMMI; with IMMI: u32 inputs, u32 outputs, f32
    voltage, f32 current; u32 reserved, u8 operational mode selector, flag three-position switch,
    1 reserved. The body of older software ends before the selector. ``safety_mode`` may be
    a number that :class:`SafetyMode` lacks.
    """

    sub_type: ClassVar = 3
    digital_input_bits: int = 0
    digital_output_bits: int = 0
    analog_input_range: tuple[int, int] = (1, 1)
    analog_input: Pair = (0.0, 0.0)
    analog_output_domain: tuple[int, int] = (0, 0)
    analog_output: Pair = (0.0, 0.0)
    temperature: float = 0.0
    robot_voltage_48v: float = 48.0
    robot_current: float = 0.0
    io_current: float = 0.0
    safety_mode: int = SafetyMode.NORMAL
    reduced_mode: bool = False
    immi: ImmiData | None = None
    reserved_1: int = 0
    operational_mode_selector: int = 0
    three_position_enabling_device: bool = False
    reserved_2: int = 0

    def encode(self) -> bytes:
        """Return the body."""
        values = [getattr(self, name) for name in self.__slots__]
        head, immi, tail = values[:12], self.immi, values[13:]
        return (
            _BOARD_HEAD.pack([*head, immi is not None])
            + (immi.encode() if immi else b'')
            + _BOARD_TAIL.pack(tail)
        )

    @classmethod
    def decode(cls, body: bytes) -> MasterboardData:
        """Decode a body; RemoteProtocolError if it is too short."""
        *head, has_immi = _BOARD_HEAD.unpack(body)
        offset = _BOARD_HEAD.size
        immi = None
        if has_immi:
            immi = ImmiData.decode(body[offset:])
            offset += ImmiData.layout.size
        if len(body) >= offset + 4:  # a body of older software ends after the reserved word
            body = body.ljust(offset + _BOARD_TAIL.size, b'\0')
        values = [*head, immi, *_BOARD_TAIL.unpack(body, offset)]
        return cls(**dict(zip(cls.__slots__, values, strict=True)))


@dataclass(frozen=True, slots=True, kw_only=True)
class CartesianInfo(Body):
    """TCP in the base frame and in the flange frame: ``x y z rx ry rz`` [m, rad]."""

    sub_type: ClassVar = 4
    layout: ClassVar = BodyLayout('6d 6d', 'Cartesian info')
    tcp_pose: Vector6
    tcp_offset: Vector6 = ZERO6


@dataclass(frozen=True, slots=True, kw_only=True)
class KinematicsInfo(Body):
    """
    Denavit-Hartenberg parameters of this arm [m, rad], as calibrated in the factory.

    :param status: 0 = the checksums are right.
    """

    sub_type: ClassVar = 5
    layout: ClassVar = BodyLayout('6I 6d 6d 6d 6d I', 'kinematics info')
    checksum: Integers6 = (0xFFFFFFFF,) * 6
    theta: Vector6
    a: Vector6
    d: Vector6
    alpha: Vector6
    status: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfigurationData:
    """
    Model and limits of the arm.

    Body: 6 x 2 f64 position limits [rad]; 6 x 2 f64 max speed [rad/s] and acceleration
    [rad/s^2]; f64 default speeds and accelerations of joints and tool, radius for tool rotations
    [m]; 6 f64 each: a, d, alpha, theta [m, rad]; i32 masterboard version, type of the controller
    box, type of the robot, sub type; 0 to 2 i16 reserved.
    """

    sub_type: ClassVar = 6
    position_limits: Pairs6
    motion_limits: Pairs6
    v_joint_default: float = 1.0471975511965976
    a_joint_default: float = 1.3962634015954636
    v_tool_default: float = 0.25
    a_tool_default: float = 1.2
    eq_radius: float = 0.25
    a: Vector6
    d: Vector6
    alpha: Vector6
    theta: Vector6
    masterboard_version: int = 6
    #: Arm that the box is for: 4 = UR5, 5 = UR10, 6 = UR3, 10 = UR20, 11 = UR30, 16 = UR16.
    controller_box_type: int = 4
    #: Model: 1 = UR5 (also UR7e), 2 = UR10 (also UR12e), 3 = UR3, 4 = UR16, 5 = UR18,
    #: 6 = UR8 Long, 7 = UR20, 8 = UR30, 9 = UR15.
    robot_type: int
    #: Series: 2 = CB3, 3 = e-Series.
    robot_sub_type: int = 3
    reserved: tuple[int, ...] = ()

    def encode(self) -> bytes:
        """Return the body."""
        numbers = [getattr(self, name) for name in self.__slots__[:-1]]
        reserved = struct.Struct(f'>{len(self.reserved)}h')
        return _CONFIGURATION.pack(numbers) + pack(reserved, *self.reserved)

    @classmethod
    def decode(cls, body: bytes) -> ConfigurationData:
        """Decode a body; RemoteProtocolError if it is too short."""
        position_limits, motion_limits, *numbers = _CONFIGURATION.unpack(body)
        surplus = min(len(body) - _CONFIGURATION.size, 4) // 2
        reserved = struct.unpack_from(f'>{surplus}h', body, _CONFIGURATION.size)
        values = [_pairs(position_limits), _pairs(motion_limits), *numbers, reserved]
        construct: Callable[..., ConfigurationData] = cls
        return construct(**dict(zip(cls.__slots__, values, strict=True)))


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceModeData(Body):
    """Force [N] and torque [Nm] at the TCP, and a measure of the distance to singularities."""

    sub_type: ClassVar = 7
    layout: ClassVar = BodyLayout('6d d', 'force mode data')
    wrench: Vector6 = ZERO6
    dexterity: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class AdditionalInfo(Body):
    """Freedrive buttons."""

    sub_type: ClassVar = 8
    layout: ClassVar = BodyLayout('? ? ? B', 'additional info')
    teach_button_pressed: bool = False
    freedrive_button_enabled: bool = True
    io_enabled_freedrive: bool = False
    reserved: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationData(Body):
    """Six numbers for the manufacturer only."""

    sub_type: ClassVar = 9
    layout: ClassVar = BodyLayout('6d', 'calibration data')
    values: Vector6 = ZERO6


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolCommunication(Body):
    """Serial port of the tool connector."""

    sub_type: ClassVar = 11
    layout: ClassVar = BodyLayout('? i i i f f', 'tool communication info')
    enabled: bool = False
    baud_rate: int = 115200
    parity: int = 0
    stop_bits: int = 1
    rx_idle_chars: float = 1.5
    tx_idle_chars: float = 3.5


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolModeInfo(Body):
    """Modes of the tool connector's outputs."""

    sub_type: ClassVar = 12
    layout: ClassVar = BodyLayout('B B B', 'tool mode info')
    output_mode: int = 0
    digital_output_mode_0: int = 1
    digital_output_mode_1: int = 1


#: The safety data; only their size is known, because they are for the manufacturer only.
SAFETY_DATA = RawSubPackage(sub_type=10, body=bytes(38))

SubPackage: TypeAlias = (
    RobotModeData
    | JointData
    | ToolData
    | MasterboardData
    | CartesianInfo
    | KinematicsInfo
    | ConfigurationData
    | ForceModeData
    | AdditionalInfo
    | CalibrationData
    | ToolCommunication
    | ToolModeInfo
    | RawSubPackage
)


def encode_sub_package(package: SubPackage) -> bytes:
    """Return a sub-package with its header."""
    body = package.encode()
    return pack(_SUB_HEADER, _SUB_HEADER.size + len(body), package.sub_type) + body


def decode_sub_packages(body: bytes) -> tuple[SubPackage, ...]:
    """
    Return the sub-packages in the body of a state frame (the frame without its header).

    Types 0, 3, 5 and 6 are decoded, because the driver needs them. The others stay raw, because
    their sizes depend on the software; a caller can decode them with ``decode`` of their class.

    :raises RemoteProtocolError: a size is impossible, or a decoded body is too short.
    """
    packages: list[SubPackage] = []
    start = 0
    while start < len(body):
        size, sub_type = unpack(_SUB_HEADER, body, 'state sub-package', start)
        if not _SUB_HEADER.size <= size <= len(body) - start:
            raise RemoteProtocolError(
                f'The size of a state sub-package is given as {size} bytes, but '
                f'{len(body) - start} are left: {hex_text(body[start:])}.'
            )
        content = body[start + _SUB_HEADER.size : start + size]
        reader = _READ.get(sub_type)
        packages.append(
            RawSubPackage(sub_type=sub_type, body=content)
            if reader is None
            else reader.decode(content)
        )
        start += size
    return tuple(packages)


_READ: dict[int, type[RobotModeData | MasterboardData | KinematicsInfo | ConfigurationData]] = {
    cls.sub_type: cls
    for cls in (RobotModeData, MasterboardData, KinematicsInfo, ConfigurationData)
}


def _pairs(values: tuple[float, ...]) -> Pairs6:
    return cast(Pairs6, tuple(zip(values[0::2], values[1::2], strict=True)))
