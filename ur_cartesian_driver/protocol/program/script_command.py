# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The script command interface: single commands to the robot program, independent of its motion.

A command is 28 big-endian int32, 112 bytes: word 0 is its number, then come its arguments, then
zeros. All argument words are scaled by 1,000,000, except words marked raw.

==  =========================  =================================================================
0   command                    words 1 ..
==  =========================  =================================================================
0   ZERO_FTSENSOR
1   SET_PAYLOAD                1 mass [kg], 2-4 centre of gravity [m]
2   SET_TOOL_VOLTAGE           1 voltage [V]: 0, 12 or 24
5   START_TOOL_CONTACT
6   END_TOOL_CONTACT
9   SET_GRAVITY                1-3 acceleration [m/s^2], pointing away from the earth
10  SET_TCP_OFFSET             1-6 pose of the TCP in the flange, 7 persistence (raw; ours: other
                               robot programs ignore it)
12  SET_TARGET_PAYLOAD         1 mass [kg], 2-4 centre of gravity [m], 5-10 inertia
                               xx yy zz xy xz yz [kg m^2], 11 transition time [s]
100 SET_SAFE_OUTPUTS           ours: 1 action, 2 token (both raw), 3-20 digital outputs, standard,
                               configurable, tool (raw; -1 not named, 0 off, 1 on), 21 and 23
                               analog outputs (fractions; negative: not named), 22 and 24 their
                               domains (raw)
==  =========================  =================================================================

The driver never sends SET_TOOL_VOLTAGE; its robot program runs it because URCL's program does.
Driver and robot program lack URCL's commands 3 and 4 (force mode), 7 and 11 (friction), and 8
(force sensor).

Only START_TOOL_CONTACT is answered: one int32, 0 = contact, 1 = end without contact.

Poses are ``x y z rx ry rz`` [m, rad], as in URScript.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, fields
from enum import IntEnum
import struct
from typing import Any, ClassVar, TypeAlias

from ur_cartesian_driver.motion.geometry.vectors import Vector3, Vector6, ZERO6
from ur_cartesian_driver.motion.goal.goal import OutputKind, SafeOutput
from ur_cartesian_driver.protocol.framing import ResultDecoder, to_fixed


class ScriptCommand(IntEnum):
    """Word 0: the number of the command."""

    ZERO_FTSENSOR = 0
    SET_PAYLOAD = 1
    SET_TOOL_VOLTAGE = 2
    START_TOOL_CONTACT = 5
    END_TOOL_CONTACT = 6
    SET_GRAVITY = 9
    SET_TCP_OFFSET = 10
    SET_TARGET_PAYLOAD = 12
    SET_SAFE_OUTPUTS = 100


class TcpPersistence(IntEnum):
    """The lifetime of a TCP; robot programs other than ours ignore this."""

    #: Until another TCP is set.
    PERMANENT = 0
    #: Until RESTORE: the program remembers the previous TCP, and restores it before it ends.
    TEMPORARY = 1
    #: Ends TEMPORARY: the program restores the remembered TCP; if there is none, it sets the
    #: given one.
    RESTORE = 2


class SafeOutputsAction(IntEnum):
    """An action on safe outputs; after it, the robot program reports the command's token."""

    #: Forget the outputs.
    DISARM = 0
    #: Remember the outputs and their safe values, and set them once, in the next stop.
    ARM = 1
    #: Set the outputs now, and forget them.
    SET = 2
    #: After a pause, give the outputs the last values that the goal has given them, or else the
    #: values in the command, even if another client has changed them since. The program still
    #: remembers the safe values.
    RESTORE = 3


class ToolContactResult(IntEnum):
    """Answer of the robot program to START_TOOL_CONTACT."""

    SUCCESS = 0
    CANCELED = 1


COMMAND_WORDS = 28
COMMAND_SIZE = 4 * COMMAND_WORDS
_COMMAND = struct.Struct('>28i')

#: A number that is sent raw, without scaling.
Token: TypeAlias = int
SafeOutputs: TypeAlias = tuple[SafeOutput, ...]


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
class StartToolContactCommand:
    """Detect a contact of the tool; the answer is a :class:`ToolContactResult`."""

    command: ClassVar = ScriptCommand.START_TOOL_CONTACT


@dataclass(frozen=True, slots=True, kw_only=True)
class EndToolContactCommand:
    """Stop detecting contacts."""

    command: ClassVar = ScriptCommand.END_TOOL_CONTACT


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
    | StartToolContactCommand
    | EndToolContactCommand
    | SetGravityCommand
    | SetTcpOffsetCommand
    | SetTargetPayloadCommand
    | SetSafeOutputsCommand
)


def encode(command: AnyScriptCommand) -> bytes:
    """
    Return the 112 bytes of a command.

    :raises LocalProtocolError: a value cannot be sent; the text names the field and the bound.
    """
    words = [
        word
        for field in fields(command)
        for word in _ENCODERS[str(field.type)](getattr(command, field.name), field.name)
    ]
    return _COMMAND.pack(command.command, *words, *(0,) * (COMMAND_WORDS - 1 - len(words)))


class ToolContactResultDecoder(ResultDecoder[ToolContactResult]):
    """Decodes the answers to START_TOOL_CONTACT."""

    def __init__(self) -> None:
        """Start empty."""
        super().__init__(ToolContactResult, 'tool contact result')


def _vector(values: Iterable[float], name: str) -> list[int]:
    return [to_fixed(value, f'{name}[{i}]') for i, value in enumerate(values)]


def _raw(value: int, _: str) -> list[int]:
    return [int(value)]


#: Index of the first digital output of each kind on the wire; analog outputs follow digital ones.
FIRST_DIGITAL_OUTPUT = {
    OutputKind.STANDARD_DIGITAL: 0,
    OutputKind.CONFIGURABLE_DIGITAL: 8,
    OutputKind.TOOL_DIGITAL: 16,
}
DIGITAL_OUTPUTS, ANALOG_OUTPUTS = 18, 2
_NOT_NAMED = -1


def _safe_outputs(outputs: SafeOutputs, _: str) -> list[int]:
    words = [_NOT_NAMED] * DIGITAL_OUTPUTS + [_NOT_NAMED, 0] * ANALOG_OUTPUTS
    for output in outputs:
        if output.output is OutputKind.STANDARD_ANALOG:
            first = DIGITAL_OUTPUTS + 2 * output.pin
            words[first : first + 2] = to_fixed(output.value, 'value'), int(output.domain)
        else:
            words[FIRST_DIGITAL_OUTPUT[output.output] + output.pin] = int(output.value)
    return words


#: The encoders of fields to words, by annotation. The fields of a command are in wire order.
_ENCODERS: Mapping[str, Callable[[Any, str], list[int]]] = {
    'float': lambda value, name: [to_fixed(value, name)],
    'TcpPersistence': _raw,
    'SafeOutputsAction': _raw,
    'Token': _raw,
    'SafeOutputs': _safe_outputs,
    'Vector3': _vector,
    'Vector6': _vector,
}
