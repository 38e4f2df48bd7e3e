# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The sub-packages of a robot state frame on the primary interface.

Each is ``uint32`` size (these five bytes included), ``uint8`` type, body; big-endian. A UR5e sends
them in the order and sizes of this table, 1386 bytes with the frame's header. A reader takes what
it knows from the front of a body: newer software appends to it, but never sends less.

====  ====================  ====  ===============================================================
type  class                 size  body
====  ====================  ====  ===============================================================
0     RobotModeData         47    u64 timestamp; 7 flags; i8 robot mode; u8 control mode;
                                  f64 target speed fraction, speed scaling, greatest fraction;
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

from dataclasses import dataclass
from enum import IntEnum
import struct
from typing import Any, cast, ClassVar, TypeAlias

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.motion.goal import ZERO6
from ur_cartesian_driver.motion.pose import Vector6
from ur_cartesian_driver.motion.state import RobotMode, SafetyMode
from ur_cartesian_driver.protocol.framing import hex_text

Integers6: TypeAlias = tuple[int, int, int, int, int, int]
Pair: TypeAlias = tuple[float, float]
Pairs6: TypeAlias = tuple[Pair, Pair, Pair, Pair, Pair, Pair]

#: Mode of a joint or the tool in normal operation.
JOINT_RUNNING = 253

_SUB_HEADER = struct.Struct('>IB')
_MODE = struct.Struct('>Q7?bB3d')
_JOINT = struct.Struct('>3d4fB')
_CARTESIAN = struct.Struct('>12d')
_KINEMATICS = struct.Struct('>6I24dI')
_CALIBRATION = struct.Struct('>6d')
_BOARD_HEAD = struct.Struct('>IIBBddbbdd4fB??')
_BOARD_IMMI = struct.Struct('>IIff')
_BOARD_TAIL = struct.Struct('>IB?B')
_TOOL = struct.Struct('>BBddfBffB')
_CONFIGURATION = struct.Struct('>53d4i')
_FORCE = struct.Struct('>7d')
_ADDITIONAL = struct.Struct('>3?B')
_TOOL_COMMUNICATION = struct.Struct('>?3i2f')
_TOOL_MODE = struct.Struct('>3B')


class RobotType(IntEnum):
    """``ConfigurationData.robot_type``; UR7e counts as UR5, UR12e as UR10."""

    UR5 = 1
    UR10 = 2
    UR3 = 3
    UR16 = 4
    UR18 = 5
    UR8LONG = 6
    UR20 = 7
    UR30 = 8
    UR15 = 9


def pack(layout: struct.Struct, *values: Any) -> bytes:
    """
    Return packed values.

    :raises LocalProtocolError: one does not fit.
    """
    try:
        return layout.pack(*values)
    except (struct.error, OverflowError) as error:
        raise LocalProtocolError(f'{values} cannot be sent: {error}.') from None


def unpack(layout: struct.Struct, body: bytes, what: str, offset: int = 0) -> tuple[Any, ...]:
    """
    Return the values at a place of a body, which may be longer.

    :raises RemoteProtocolError: the body is too short.
    """
    if len(body) < offset + layout.size:
        raise RemoteProtocolError(
            f'A {what} has at least {offset + layout.size} bytes, but {len(body)} came: '
            f'{hex_text(body)}.'
        )
    return layout.unpack_from(body, offset)


@dataclass(frozen=True, slots=True, kw_only=True)
class RawSubPackage:
    """A sub-package as it came."""

    sub_type: int
    body: bytes

    def encode(self) -> bytes:
        """Return the body."""
        return self.body


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotModeData:
    """Power, stops and program; ``robot_mode`` is a number of :class:`RobotMode`, or newer."""

    sub_type: ClassVar = 0
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

    def encode(self) -> bytes:
        """Return the body."""
        return pack(
            _MODE,
            self.timestamp,
            self.real_robot_connected,
            self.real_robot_enabled,
            self.power_on,
            self.emergency_stopped,
            self.protective_stopped,
            self.program_running,
            self.program_paused,
            self.robot_mode,
            self.control_mode,
            self.target_speed_fraction,
            self.speed_scaling,
            self.target_speed_fraction_limit,
        ) + bytes(1)

    @classmethod
    def decode(cls, body: bytes) -> RobotModeData:
        """Return the content of a body; RemoteProtocolError if it is too short."""
        return cls(**dict(zip(cls.__slots__, unpack(_MODE, body, 'robot mode data'), strict=True)))


@dataclass(frozen=True, slots=True, kw_only=True)
class JointData:
    """Joints: positions [rad], velocities [rad/s], currents [A], voltages [V], motors [deg C]."""

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
        return b''.join(
            pack(_JOINT, q, target, qd, current, voltage, temperature, 0.0, mode)
            for q, target, qd, current, voltage, temperature, mode in zip(
                self.q_actual,
                self.q_target,
                self.qd_actual,
                self.current,
                self.voltage,
                self.temperature,
                self.mode,
                strict=True,
            )
        )

    @classmethod
    def decode(cls, body: bytes) -> JointData:
        """Return the content of a body; RemoteProtocolError if it is too short."""
        joints = [unpack(_JOINT, body, 'joint data', i * _JOINT.size) for i in range(6)]
        q, target, qd, current, voltage, temperature, _, mode = zip(*joints, strict=True)
        return cls(
            q_actual=cast(Vector6, q),
            q_target=cast(Vector6, target),
            qd_actual=cast(Vector6, qd),
            current=cast(Vector6, current),
            voltage=cast(Vector6, voltage),
            temperature=cast(Vector6, temperature),
            mode=cast(Integers6, mode),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolData:
    """The tool connector: inputs [V or A by range], voltages [V], current [A], heat [deg C]."""

    sub_type: ClassVar = 2
    analog_input_range: tuple[int, int] = (1, 1)
    analog_input: Pair = (0.0, 0.0)
    voltage_48v: float = 0.0
    output_voltage: int = 0
    current: float = 0.0
    temperature: float = 0.0
    mode: int = JOINT_RUNNING

    def encode(self) -> bytes:
        """Return the body."""
        return pack(
            _TOOL,
            *self.analog_input_range,
            *self.analog_input,
            self.voltage_48v,
            self.output_voltage,
            self.current,
            self.temperature,
            self.mode,
        )

    @classmethod
    def decode(cls, body: bytes) -> ToolData:
        """Return the content of a body; RemoteProtocolError if it is too short."""
        v = unpack(_TOOL, body, 'tool data')
        return cls(
            analog_input_range=v[0:2],
            analog_input=v[2:4],
            voltage_48v=v[4],
            output_voltage=v[5],
            current=v[6],
            temperature=v[7],
            mode=v[8],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ImmiData:
    """The injection moulding machine interface (Euromap 67): bits, supply [V], current [A]."""

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
    1 reserved. Older software ends before the selector. ``safety_mode`` is a number of
    :class:`SafetyMode`, or a newer one.
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
        head = pack(
            _BOARD_HEAD,
            self.digital_input_bits,
            self.digital_output_bits,
            *self.analog_input_range,
            *self.analog_input,
            *self.analog_output_domain,
            *self.analog_output,
            self.temperature,
            self.robot_voltage_48v,
            self.robot_current,
            self.io_current,
            self.safety_mode,
            self.reduced_mode,
            self.immi is not None,
        )
        immi = (
            b''
            if self.immi is None
            else pack(
                _BOARD_IMMI,
                self.immi.input_bits,
                self.immi.output_bits,
                self.immi.voltage_24v,
                self.immi.current,
            )
        )
        return (
            head
            + immi
            + pack(
                _BOARD_TAIL,
                self.reserved_1,
                self.operational_mode_selector,
                self.three_position_enabling_device,
                self.reserved_2,
            )
        )

    @classmethod
    def decode(cls, body: bytes) -> MasterboardData:
        """Return the content of a body; RemoteProtocolError if it is too short."""
        v = unpack(_BOARD_HEAD, body, 'masterboard data')
        offset = _BOARD_HEAD.size
        immi = None
        if v[16]:
            i = unpack(_BOARD_IMMI, body, 'masterboard data', offset)
            immi = ImmiData(input_bits=i[0], output_bits=i[1], voltage_24v=i[2], current=i[3])
            offset += _BOARD_IMMI.size
        if len(body) >= offset + 4:  # older software ends behind the reserved word
            body = body.ljust(offset + _BOARD_TAIL.size, b'\0')
        tail = unpack(_BOARD_TAIL, body, 'masterboard data', offset)
        return cls(
            digital_input_bits=v[0],
            digital_output_bits=v[1],
            analog_input_range=v[2:4],
            analog_input=v[4:6],
            analog_output_domain=v[6:8],
            analog_output=v[8:10],
            temperature=v[10],
            robot_voltage_48v=v[11],
            robot_current=v[12],
            io_current=v[13],
            safety_mode=v[14],
            reduced_mode=v[15],
            immi=immi,
            reserved_1=tail[0],
            operational_mode_selector=tail[1],
            three_position_enabling_device=tail[2],
            reserved_2=tail[3],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class CartesianInfo:
    """The TCP in the base, and in the flange: ``x y z rx ry rz`` [m, rad]."""

    sub_type: ClassVar = 4
    tcp_pose: Vector6
    tcp_offset: Vector6 = ZERO6

    def encode(self) -> bytes:
        """Return the body."""
        return pack(_CARTESIAN, *self.tcp_pose, *self.tcp_offset)

    @classmethod
    def decode(cls, body: bytes) -> CartesianInfo:
        """Return the content of a body; RemoteProtocolError if it is too short."""
        v = unpack(_CARTESIAN, body, 'Cartesian info')
        return cls(tcp_pose=cast(Vector6, v[:6]), tcp_offset=cast(Vector6, v[6:]))


@dataclass(frozen=True, slots=True, kw_only=True)
class KinematicsInfo:
    """
    The Denavit-Hartenberg parameters of this very arm [m, rad], as calibrated in the factory.

    :param status: 0 = the checksums are right.
    """

    sub_type: ClassVar = 5
    checksum: Integers6 = (0xFFFFFFFF,) * 6
    theta: Vector6
    a: Vector6
    d: Vector6
    alpha: Vector6
    status: int = 0

    def encode(self) -> bytes:
        """Return the body."""
        return pack(
            _KINEMATICS, *self.checksum, *self.theta, *self.a, *self.d, *self.alpha, self.status
        )

    @classmethod
    def decode(cls, body: bytes) -> KinematicsInfo:
        """Return the content of a body; RemoteProtocolError if it is too short."""
        v = unpack(_KINEMATICS, body, 'kinematics info')
        return cls(
            checksum=cast(Integers6, v[:6]),
            theta=cast(Vector6, v[6:12]),
            a=cast(Vector6, v[12:18]),
            d=cast(Vector6, v[18:24]),
            alpha=cast(Vector6, v[24:30]),
            status=v[30],
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ConfigurationData:
    """
    What the arm is and may do.

    Body: 6 x 2 f64 position limits [rad]; 6 x 2 f64 greatest speed [rad/s] and acceleration
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
    controller_box_type: int = 4
    #: A number of :class:`RobotType`, or a newer one.
    robot_type: int
    robot_sub_type: int = 0
    reserved: tuple[int, ...] = ()

    def encode(self) -> bytes:
        """Return the body."""
        limits = [x for pair in (*self.position_limits, *self.motion_limits) for x in pair]
        return pack(
            _CONFIGURATION,
            *limits,
            self.v_joint_default,
            self.a_joint_default,
            self.v_tool_default,
            self.a_tool_default,
            self.eq_radius,
            *self.a,
            *self.d,
            *self.alpha,
            *self.theta,
            self.masterboard_version,
            self.controller_box_type,
            self.robot_type,
            self.robot_sub_type,
        ) + b''.join(pack(struct.Struct('>h'), word) for word in self.reserved)

    @classmethod
    def decode(cls, body: bytes) -> ConfigurationData:
        """Return the content of a body; RemoteProtocolError if it is too short."""
        v = unpack(_CONFIGURATION, body, 'configuration data')
        surplus = min(len(body) - _CONFIGURATION.size, 4) // 2
        return cls(
            position_limits=_pairs(v[0:12]),
            motion_limits=_pairs(v[12:24]),
            v_joint_default=v[24],
            a_joint_default=v[25],
            v_tool_default=v[26],
            a_tool_default=v[27],
            eq_radius=v[28],
            a=cast(Vector6, v[29:35]),
            d=cast(Vector6, v[35:41]),
            alpha=cast(Vector6, v[41:47]),
            theta=cast(Vector6, v[47:53]),
            masterboard_version=v[53],
            controller_box_type=v[54],
            robot_type=v[55],
            robot_sub_type=v[56],
            reserved=struct.unpack_from(f'>{surplus}h', body, _CONFIGURATION.size),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceModeData:
    """Force [N] and torque [Nm] at the TCP, and a measure of the distance to singularities."""

    sub_type: ClassVar = 7
    wrench: Vector6 = ZERO6
    dexterity: float = 0.0

    def encode(self) -> bytes:
        """Return the body."""
        return pack(_FORCE, *self.wrench, self.dexterity)

    @classmethod
    def decode(cls, body: bytes) -> ForceModeData:
        """Return the content of a body; RemoteProtocolError if it is too short."""
        v = unpack(_FORCE, body, 'force mode data')
        return cls(wrench=cast(Vector6, v[:6]), dexterity=v[6])


@dataclass(frozen=True, slots=True, kw_only=True)
class AdditionalInfo:
    """Buttons for freedrive."""

    sub_type: ClassVar = 8
    teach_button_pressed: bool = False
    freedrive_button_enabled: bool = True
    io_enabled_freedrive: bool = False
    reserved: int = 0

    def encode(self) -> bytes:
        """Return the body."""
        return pack(
            _ADDITIONAL,
            self.teach_button_pressed,
            self.freedrive_button_enabled,
            self.io_enabled_freedrive,
            self.reserved,
        )

    @classmethod
    def decode(cls, body: bytes) -> AdditionalInfo:
        """Return the content of a body; RemoteProtocolError if it is too short."""
        return cls(
            **dict(zip(cls.__slots__, unpack(_ADDITIONAL, body, 'additional info'), strict=True))
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationData:
    """Six numbers for the manufacturer's own use."""

    sub_type: ClassVar = 9
    values: Vector6 = ZERO6

    def encode(self) -> bytes:
        """Return the body."""
        return pack(_CALIBRATION, *self.values)

    @classmethod
    def decode(cls, body: bytes) -> CalibrationData:
        """Return the content of a body; RemoteProtocolError if it is too short."""
        return cls(values=cast(Vector6, unpack(_CALIBRATION, body, 'calibration data')))


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolCommunication:
    """The serial port of the tool connector."""

    sub_type: ClassVar = 11
    enabled: bool = False
    baud_rate: int = 115200
    parity: int = 0
    stop_bits: int = 1
    rx_idle_chars: float = 1.5
    tx_idle_chars: float = 3.5

    def encode(self) -> bytes:
        """Return the body."""
        return pack(
            _TOOL_COMMUNICATION,
            self.enabled,
            self.baud_rate,
            self.parity,
            self.stop_bits,
            self.rx_idle_chars,
            self.tx_idle_chars,
        )

    @classmethod
    def decode(cls, body: bytes) -> ToolCommunication:
        """Return the content of a body; RemoteProtocolError if it is too short."""
        values = unpack(_TOOL_COMMUNICATION, body, 'tool communication info')
        return cls(**dict(zip(cls.__slots__, values, strict=True)))


@dataclass(frozen=True, slots=True, kw_only=True)
class ToolModeInfo:
    """How the outputs of the tool connector are driven."""

    sub_type: ClassVar = 12
    output_mode: int = 0
    digital_output_mode_0: int = 1
    digital_output_mode_1: int = 1

    def encode(self) -> bytes:
        """Return the body."""
        return pack(
            _TOOL_MODE, self.output_mode, self.digital_output_mode_0, self.digital_output_mode_1
        )

    @classmethod
    def decode(cls, body: bytes) -> ToolModeInfo:
        """Return the content of a body; RemoteProtocolError if it is too short."""
        return cls(
            **dict(zip(cls.__slots__, unpack(_TOOL_MODE, body, 'tool mode info'), strict=True))
        )


#: The content is the manufacturer's own; only the size is known.
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
    Return the sub-packages of a state frame without the frame's header.

    Types 0, 3, 5 and 6 are read, because the driver needs them. The others stay raw: their size
    varies with the software, and ``decode`` of their class reads them where that is wanted.

    :raises RemoteProtocolError: a size is impossible, or a body that is read is too short.
    """
    packages: list[SubPackage] = []
    start = 0
    while start < len(body):
        size, sub_type = unpack(_SUB_HEADER, body, 'state sub-package', start)
        if not _SUB_HEADER.size <= size <= len(body) - start:
            raise RemoteProtocolError(
                f'A state sub-package says that it has {size} bytes, but {len(body) - start} '
                f'are left: {hex_text(body[start:])}.'
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
