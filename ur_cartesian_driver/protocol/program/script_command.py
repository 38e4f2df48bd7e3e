# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The script command interface: single commands to the robot program, independent of its motion.

A command is 28 big-endian int32, 112 bytes: word 0 is its number, then come its arguments, then
zeros. All argument words are scaled by 1,000,000 except those marked raw.

==  =========================  =================================================================
0   command                    words 1 ..
==  =========================  =================================================================
0   ZERO_FTSENSOR
1   SET_PAYLOAD                1 mass [kg], 2-4 centre of gravity [m]
2   SET_TOOL_VOLTAGE           1 voltage [V]: 0, 12 or 24
3   START_FORCE_MODE           1-6 task frame, 7-12 selection (0, 1), 13-18 wrench [N, Nm],
                               19 type (1-3), 20-25 limits, 26 damping, 27 gain scaling
4   END_FORCE_MODE
5   START_TOOL_CONTACT
6   END_TOOL_CONTACT
7   SET_FRICTION_COMPENSATION  1 on (0, 1; raw)
8   FT_RTDE_INPUT_ENABLE       1 on (0, 1; raw), 2 mass of the sensor [kg], 3-5 its offset [m],
                               6-8 its centre of gravity [m]
9   SET_GRAVITY                1-3 acceleration [m/s^2], pointing away from the earth
10  SET_TCP_OFFSET             1-6 pose of the TCP in the flange, 7 persistence (raw; ours: other
                               robot programs ignore it)
11  SET_FRICTION_SCALES        1-6 viscous, 7-12 Coulomb, limited to [0, 1]
12  SET_TARGET_PAYLOAD         1 mass [kg], 2-4 centre of gravity [m], 5-10 inertia
                               xx yy zz xy xz yz [kg m^2], 11 transition time [s]
100 SET_SAFE_OUTPUTS           ours: 1 action, 2 token (both raw), 3-20 digital outputs, standard,
                               configurable, tool (raw; -1 not named, 0 off, 1 on), 21 and 23
                               analog outputs (fractions; negative: not named), 22 and 24 their
                               domains (raw)
==  =========================  =================================================================

Only START_TOOL_CONTACT is answered: one int32, 0 = contact, 1 = ended before a contact.

Poses are ``x y z rx ry rz`` [m, rad], as in URScript.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
import struct
from typing import Any, ClassVar, get_args, TypeAlias

from ur_cartesian_driver.motion.errors import LocalProtocolError, RemoteProtocolError
from ur_cartesian_driver.motion.geometry.vectors import Vector3, Vector6, ZERO6
from ur_cartesian_driver.motion.goal.goal import OutputKind, SafeOutput
from ur_cartesian_driver.motion.state.io_signals import AnalogDomain
from ur_cartesian_driver.protocol.framing import (
    checked_size,
    FIXED_POINT,
    from_fixed,
    hex_text,
    RecordDecoder,
    ResultDecoder,
    to_fixed,
)


class ScriptCommand(IntEnum):
    """Word 0: the number of the command."""

    ZERO_FTSENSOR = 0
    SET_PAYLOAD = 1
    SET_TOOL_VOLTAGE = 2
    START_FORCE_MODE = 3
    END_FORCE_MODE = 4
    START_TOOL_CONTACT = 5
    END_TOOL_CONTACT = 6
    SET_FRICTION_COMPENSATION = 7
    FT_RTDE_INPUT_ENABLE = 8
    SET_GRAVITY = 9
    SET_TCP_OFFSET = 10
    SET_FRICTION_SCALES = 11
    SET_TARGET_PAYLOAD = 12
    SET_SAFE_OUTPUTS = 100


class TcpPersistence(IntEnum):
    """How long a TCP lasts; robot programs other than ours ignore this."""

    #: Until another TCP is set.
    PERMANENT = 0
    #: Until RESTORE: the program remembers the previous TCP, and restores it before it ends.
    TEMPORARY = 1
    #: Ends TEMPORARY: the program restores the remembered TCP; if there is none, it sets the
    #: given one.
    RESTORE = 2


class SafeOutputsAction(IntEnum):
    """What the robot program does with safe outputs; then it reports the command's token."""

    #: Forget the outputs.
    DISARM = 0
    #: Remember the outputs, and set them once in the next stop.
    ARM = 1
    #: Set the outputs now, and forget them.
    SET = 2


class ToolContactResult(IntEnum):
    """Answer of the robot program to START_TOOL_CONTACT."""

    SUCCESS = 0
    CANCELED = 1


COMMAND_WORDS = 28
COMMAND_SIZE = 4 * COMMAND_WORDS
_COMMAND = struct.Struct('>28i')

Flags6: TypeAlias = tuple[bool, bool, bool, bool, bool, bool]
#: Six numbers, limited to [0, 1] when they are sent.
Fractions6: TypeAlias = Vector6
#: A number that is not scaled.
Token: TypeAlias = int
SafeOutputs: TypeAlias = tuple[SafeOutput, ...]
#: Software version: major, minor, bugfix.
SoftwareVersion: TypeAlias = tuple[int, int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroFtSensorCommand:
    """Define the present force as zero."""

    command: ClassVar = ScriptCommand.ZERO_FTSENSOR


@dataclass(frozen=True, slots=True, kw_only=True)
class SetPayloadCommand:
    """Set the mass [kg] of the payload, and its centre of gravity in the flange frame [m]."""

    command: ClassVar = ScriptCommand.SET_PAYLOAD
    mass: float
    cog: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetToolVoltageCommand:
    """Set the voltage of the tool connector: 0, 12 or 24 V."""

    command: ClassVar = ScriptCommand.SET_TOOL_VOLTAGE
    voltage: int

    def __post_init__(self) -> None:
        """Check the voltage."""
        if self.voltage not in (0, 12, 24):
            raise LocalProtocolError(f'voltage is {self.voltage} V, but must be 0, 12 or 24.')


@dataclass(frozen=True, slots=True, kw_only=True)
class StartForceModeCommand:
    """
    Make the arm compliant in some axes of the task frame.

    :param task_frame: its pose in the base.
    :param selection: the compliant axes.
    :param wrench: target force [N] and torque [Nm] in the compliant axes.
    :param type: how the controller transforms the task frame, 1 to 3 as in URScript.
    :param limits: speed [m/s, rad/s] in compliant axes, deviation [m, rad] in the others.
    :param damping: 0 to 1.
    :param gain_scaling: 0 to 2; has no effect on CB3.
    """

    command: ClassVar = ScriptCommand.START_FORCE_MODE
    task_frame: Vector6
    selection: Flags6
    wrench: Vector6
    type: int
    limits: Vector6
    damping: float = 0.025
    gain_scaling: float = 0.5

    def __post_init__(self) -> None:
        """Check the ranges."""
        _check_range('type', self.type, 1, 3)
        _check_range('damping', self.damping, 0, 1)
        _check_range('gain_scaling', self.gain_scaling, 0, 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class EndForceModeCommand:
    """End force mode."""

    command: ClassVar = ScriptCommand.END_FORCE_MODE


@dataclass(frozen=True, slots=True, kw_only=True)
class StartToolContactCommand:
    """Detect a contact of the tool; the answer is a :class:`ToolContactResult`."""

    command: ClassVar = ScriptCommand.START_TOOL_CONTACT


@dataclass(frozen=True, slots=True, kw_only=True)
class EndToolContactCommand:
    """Stop detecting contacts."""

    command: ClassVar = ScriptCommand.END_TOOL_CONTACT


@dataclass(frozen=True, slots=True, kw_only=True)
class SetFrictionCompensationCommand:
    """Switch friction compensation for torque control on or off."""

    command: ClassVar = ScriptCommand.SET_FRICTION_COMPENSATION
    enabled: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class FtRtdeInputEnableCommand:
    """Set whether forces come from RTDE's ``external_force_torque``, and describe their sensor."""

    command: ClassVar = ScriptCommand.FT_RTDE_INPUT_ENABLE
    enabled: bool
    sensor_mass: float = 0.0
    sensor_offset: Vector3 = (0.0, 0.0, 0.0)
    sensor_cog: Vector3 = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class SetGravityCommand:
    """Set the acceleration that opposes gravity [m/s^2], which points away from the earth."""

    command: ClassVar = ScriptCommand.SET_GRAVITY
    gravity: Vector3


@dataclass(frozen=True, slots=True, kw_only=True)
class SetTcpOffsetCommand:
    """Set the active TCP: its pose in the flange."""

    command: ClassVar = ScriptCommand.SET_TCP_OFFSET
    offset: Vector6
    persistence: TcpPersistence = TcpPersistence.PERMANENT


@dataclass(frozen=True, slots=True, kw_only=True)
class SetFrictionScalesCommand:
    """Scale the friction compensation of each joint; values are limited to [0, 1]."""

    command: ClassVar = ScriptCommand.SET_FRICTION_SCALES
    viscous: Fractions6
    coulomb: Fractions6


@dataclass(frozen=True, slots=True, kw_only=True)
class SetTargetPayloadCommand:
    """Change the payload within a time [s]: mass [kg], centre of gravity [m], inertia [kg m^2]."""

    command: ClassVar = ScriptCommand.SET_TARGET_PAYLOAD
    mass: float
    cog: Vector3 = (0.0, 0.0, 0.0)
    inertia: Vector6 = ZERO6
    transition_time: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SetSafeOutputsCommand:
    """Arm, disarm or set the safe values of outputs; our own robot program only."""

    command: ClassVar = ScriptCommand.SET_SAFE_OUTPUTS
    action: SafeOutputsAction
    #: Number by which the robot program confirms that it has carried out the action.
    token: Token
    outputs: SafeOutputs = ()


AnyScriptCommand: TypeAlias = (
    ZeroFtSensorCommand
    | SetPayloadCommand
    | SetToolVoltageCommand
    | StartForceModeCommand
    | EndForceModeCommand
    | StartToolContactCommand
    | EndToolContactCommand
    | SetFrictionCompensationCommand
    | FtRtdeInputEnableCommand
    | SetGravityCommand
    | SetTcpOffsetCommand
    | SetFrictionScalesCommand
    | SetTargetPayloadCommand
    | SetSafeOutputsCommand
)

#: First software versions that have a command: of PolyScope 3 to 5; of PolyScope X.
MIN_VERSIONS: Mapping[ScriptCommand, tuple[SoftwareVersion, SoftwareVersion]] = {
    ScriptCommand.SET_FRICTION_COMPENSATION: ((5, 23, 0), (10, 10, 0)),
    ScriptCommand.SET_FRICTION_SCALES: ((5, 25, 1), (10, 12, 1)),
}


def encode(command: AnyScriptCommand, robot_version: SoftwareVersion | None = None) -> bytes:
    """
    Return the 112 bytes of a command.

    :param robot_version: software of the robot, which may lack the command; None = not checked.
    :raises LocalProtocolError: a value cannot be sent, or the software lacks the command.
    """
    if robot_version is not None:
        _check_version(command.command, robot_version)
    words = _words(command)
    return _COMMAND.pack(command.command, *words, *(0,) * (COMMAND_WORDS - 1 - len(words)))


def decode(data: bytes) -> AnyScriptCommand:
    """
    Return the command that 112 bytes encode; words after the arguments are ignored.

    :raises RemoteProtocolError: the size, the number of the command or an argument is invalid.
    """
    number, *words = _COMMAND.unpack(checked_size(data, COMMAND_SIZE, 'script command'))
    try:
        return _command(ScriptCommand(number), words)
    except (ValueError, LocalProtocolError) as error:
        raise RemoteProtocolError(f'Invalid script command: {error} {hex_text(data)}') from None


class ScriptCommandDecoder(RecordDecoder[AnyScriptCommand]):
    """Decodes script commands, as the robot does."""

    def __init__(self) -> None:
        """Start empty."""
        super().__init__(COMMAND_SIZE, 'script command', decode)


class ToolContactResultDecoder(ResultDecoder[ToolContactResult]):
    """Decodes the answers to START_TOOL_CONTACT."""

    def __init__(self) -> None:
        """Start empty."""
        super().__init__(ToolContactResult, 'tool contact result')


def _words(command: AnyScriptCommand) -> list[int]:
    """Return the words of a command after its number."""
    return [
        word
        for field in fields(command)
        for word in _ARGUMENTS[str(field.type)].encode(getattr(command, field.name), field.name)
    ]


def _command(number: ScriptCommand, words: Sequence[int]) -> AnyScriptCommand:
    """Return the command for a number and the words after it."""
    command: type[AnyScriptCommand] = _COMMANDS[number]
    values: dict[str, Any] = {}
    start = 0
    for field in fields(command):
        argument = _ARGUMENTS[str(field.type)]
        values[field.name] = argument.decode(words[start : start + argument.count], field.name)
        start += argument.count
    return command(**values)


@dataclass(frozen=True, slots=True)
class _Words:
    """
    An argument on the wire.

    :param count: number of words.
    :param encode: turns the value, and the field's name for errors, into words.
    :param decode: turns words, and the field's name for errors, into the value.
    """

    count: int
    encode: Callable[[Any, str], Iterable[int]]
    decode: Callable[[Sequence[int], str], Any]


def _vector(count: int) -> _Words:
    return _Words(
        count,
        lambda values, name: [to_fixed(v, f'{name}[{i}]') for i, v in enumerate(values)],
        lambda words, _: tuple(map(from_fixed, words)),
    )


def _raw(kind: type[int]) -> _Words:
    """Return the conversion of one unscaled word to and from a type of integer."""
    return _Words(1, lambda value, _: [int(value)], lambda words, _: kind(words[0]))


def _as_int(value: float, field: str) -> int:
    if value != int(value):
        raise LocalProtocolError(f'{field} is {value!r}, but must be a whole number.')
    return int(value)


#: Index of the first digital output of each kind on the wire; analog outputs follow digital ones.
FIRST_DIGITAL_OUTPUT = {
    OutputKind.STANDARD_DIGITAL: 0,
    OutputKind.CONFIGURABLE_DIGITAL: 8,
    OutputKind.TOOL_DIGITAL: 16,
}
DIGITAL_OUTPUTS, ANALOG_OUTPUTS = 18, 2
_NOT_NAMED = -1


def _safe_output_words(outputs: SafeOutputs) -> list[int]:
    words = [_NOT_NAMED] * DIGITAL_OUTPUTS + [_NOT_NAMED, 0] * ANALOG_OUTPUTS
    for output in outputs:
        if output.output is OutputKind.STANDARD_ANALOG:
            first = DIGITAL_OUTPUTS + 2 * output.pin
            words[first : first + 2] = to_fixed(output.value, 'value'), int(output.domain)
        else:
            words[FIRST_DIGITAL_OUTPUT[output.output] + output.pin] = int(output.value)
    return words


def _safe_outputs(words: Sequence[int]) -> SafeOutputs:
    """Return the outputs that words name; the wire does not carry their ``restore``."""
    digital = (
        SafeOutput(output=kind, pin=i - first, value=float(words[i]))
        for kind, first in FIRST_DIGITAL_OUTPUT.items()
        for i in range(first, min(first + 8, DIGITAL_OUTPUTS))
        if words[i] >= 0
    )
    analog = (
        SafeOutput(
            output=OutputKind.STANDARD_ANALOG,
            pin=pin,
            value=from_fixed(words[i]),
            domain=AnalogDomain(words[i + 1]),
        )
        for pin, i in enumerate(range(DIGITAL_OUTPUTS, DIGITAL_OUTPUTS + 2 * ANALOG_OUTPUTS, 2))
        if words[i] >= 0
    )
    return (*digital, *analog)


_FLOAT = _Words(
    1, lambda value, name: [to_fixed(value, name)], lambda words, _: from_fixed(words[0])
)
_VECTOR6 = _vector(6)
#: Conversion of a field by its annotation. The fields of a command are in wire order.
_ARGUMENTS: Mapping[str, _Words] = {
    'float': _FLOAT,
    'int': _Words(1, _FLOAT.encode, lambda words, name: _as_int(from_fixed(words[0]), name)),
    'bool': _raw(bool),
    'TcpPersistence': _raw(TcpPersistence),
    'SafeOutputsAction': _raw(SafeOutputsAction),
    'Token': _raw(int),
    'SafeOutputs': _Words(
        22,
        lambda outputs, _: _safe_output_words(outputs),
        lambda words, _: _safe_outputs(words),
    ),
    'Vector3': _vector(3),
    'Vector6': _VECTOR6,
    # URCL clamps these values, but refuses invalid values of other fields; our bytes have to
    # equal URCL's.
    'Fractions6': _Words(
        6,
        lambda values, name: _VECTOR6.encode([min(max(v, 0.0), 1.0) for v in values], name),
        _VECTOR6.decode,
    ),
    'Flags6': _Words(
        6,
        lambda values, _: [FIXED_POINT * bool(value) for value in values],
        lambda words, _: tuple(word != 0 for word in words),
    ),
}
_COMMANDS: Mapping[ScriptCommand, Any] = {cls.command: cls for cls in get_args(AnyScriptCommand)}


def _check_version(command: ScriptCommand, version: SoftwareVersion) -> None:
    if command not in MIN_VERSIONS:
        return
    polyscope_5, polyscope_x = MIN_VERSIONS[command]
    needed = polyscope_x if version >= (10, 0, 0) else polyscope_5
    if version < needed:
        raise LocalProtocolError(
            f'{command.name} needs software {_dotted(polyscope_5)} or {_dotted(polyscope_x)}, but '
            f'the robot runs {_dotted(version)}; update the robot.'
        )


def _dotted(version: SoftwareVersion) -> str:
    return '.'.join(str(part) for part in version)


def _check_range(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise LocalProtocolError(f'{name} is {value!r}, but must lie within {low} and {high}.')
