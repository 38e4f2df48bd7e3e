# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Import options, the same for all formats, and the notation in which users write them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from math import inf
import re

from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.geometry.pose import IDENTITY, Pose
from ur_cartesian_driver.motion.goal.goal import CORNER_DEVIATION, IOCommand, OutputKind
from ur_cartesian_driver.motion.goal.output_names import output_fault

#: Length of each unit [m].
LENGTH_UNITS: Mapping[str, float] = {
    'um': 1e-6,
    'mm': 1e-3,
    'cm': 1e-2,
    'm': 1.0,
    'in': 0.0254,
    'ft': 0.3048,
}

_KINDS = {
    'standard': OutputKind.STANDARD_DIGITAL,
    'configurable': OutputKind.CONFIGURABLE_DIGITAL,
    'tool': OutputKind.TOOL_DIGITAL,
    'analog': OutputKind.STANDARD_ANALOG,
}
_LENGTH = re.compile(r'\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*([a-z]*)\s*', re.IGNORECASE)
_CODE_WORD = re.compile(r'([A-Z])(-?[0-9]+(?:\.[0-9]+)?)')
#: S, or an M-code with the words that must stand beside it, such as ``M280 S40``.
_CODE = re.compile(rf'S|M[0-9]+(\.[0-9]+)?(\s*{_CODE_WORD.pattern})*')


class ToolOrientation(Enum):
    """The source of the tool's orientation."""

    #: At each point, the orientation in the file; without one, as NORMALS; without normal, as
    #: DOWN.
    FILE = 'file'
    #: The tool's axis z opposite to the surface normals in the file.
    NORMALS = 'normals'
    #: The tool's z opposite to z of the frame, and its x along y of the frame.
    DOWN = 'down'


@dataclass(frozen=True, slots=True)
class CodeOutput:
    """The output that a code of a program switches, and its value."""

    kind: OutputKind
    pin: int
    #: The value that the output gets, 0 to 1; for the code S, the S number at which it gets 1.
    value: float

    def command(self, value: float) -> IOCommand:
        """
        Return the command that sets the output to a value.

        :raises ValueError: the output cannot have the value.
        """
        if (fault := output_fault(self.kind, self.pin, value)) is not None:
            raise ValueError(f'the {fault[0]} {fault[1]}')
        return IOCommand(waypoint=0, offset=0.0, output=self.kind, pin=self.pin, value=value)


def parse_code_output(text: str) -> tuple[str, CodeOutput]:
    """
    Return code and output of ``M3=standard:2:1``, ``M280 S40=tool:0:1`` or ``S=analog:0:10000``.

    :raises ValueError: the text has none of these forms, there is no such output, it cannot have
        the value, or S drives a digital output.
    """
    try:
        code, rest = text.upper().split('=')
        kind, pin, value = rest.lower().split(':')
        output = CodeOutput(_KINDS[kind], int(pin), float(value))
        if _CODE.fullmatch(code) is None:
            raise KeyError(code)
        # M03 and M3 are one code, S40 and S40.0 one value.
        words = [f'{word[1]}{float(word[2]):g}' for word in _CODE_WORD.finditer(code)]
        code = ' '.join(words) or 'S'
    except (KeyError, ValueError):
        raise ValueError(
            f'{text!r} is not of the form CODE=KIND:PIN:VALUE, such as M3=standard:2:1, '
            "'M280 S40=standard:0:1' or S=analog:0:10000; kinds are standard, configurable, tool "
            'and analog'
        ) from None
    if code == 'S' and kind != 'analog':
        raise ValueError(f'{text!r}: S is a level, which only an analog output has')
    if code == 'S' and not 0.0 < output.value < inf:
        raise ValueError(f'{text!r}: {output.value:g} is no S number above 0')
    try:
        output.command(1.0 if code == 'S' else output.value)
    except ValueError as error:
        raise ValueError(f'{text!r}: {error}') from None
    return code, output


def parse_length(text: str) -> float:
    """
    Return the length [m] in a text with a unit, such as ``0.1mm``.

    :raises ValueError: the text is no length or has no unit, or the length is negative, or 100 m
        or more.
    """
    match = _LENGTH.fullmatch(text)
    if match is None or match[2].lower() not in LENGTH_UNITS:
        raise ValueError(f'{text!r} is no length; give number and unit, such as 0.1mm')
    length = float(match[1]) * LENGTH_UNITS[match[2].lower()]
    if not 0.0 <= length < 100.0:
        raise ValueError(f'{text!r} is not at least 0 and below 100 m')
    return length


@dataclass(frozen=True, slots=True, kw_only=True)
class ImportOptions:
    """Options for making a goal of a file."""

    #: The frame of the points; empty = the frame of the file, else the robot's base.
    frame: str = ''
    #: The frame that moves along the path; a fixed tool, for a path on a part that the arm holds.
    #: Empty = the active TCP.
    tool: str = ''
    #: The pose of the file's origin in the frame.
    origin: Pose = IDENTITY
    #: Unit of lengths without one; overrides the unit of a DXF drawing. Empty = a file that lacks
    #: a unit is refused, except G-code, which is in mm.
    unit: str = ''
    #: Factor on all lengths, about the origin of the file.
    scale: float = 1.0
    orientation: ToolOrientation = ToolOrientation.FILE
    #: Speed [m/s] of lines and arcs except travel; None = the file's, else the driver's parameter.
    speed: float | None = None
    #: Speed [m/s] of travel (G0, and between two contours); None = the driver's parameter.
    travel_speed: float | None = None
    #: Acceleration [m/s^2] of lines and arcs; None = the file's, else the driver's parameter.
    acceleration: float | None = None
    #: Duration [s] of the motion to the first point, if the file has times; None = the time of
    #: this point in the file.
    approach_time: float | None = None
    #: Blend radius [m] at inner points for which the file has none; smaller where lines are short.
    blend: float = 0.0
    #: Corner deviation [m] of lines and arcs for which the file has none; 0 = the arm stops at
    #: these corners, or passes them with a blend.
    corner: float = 0.0
    #: Largest distance of the simplified path from the file's [m]; 0 = all points are kept.
    simplify: float = 0.0
    #: Largest distance [m] between a curve that arcs cannot represent and the lines in its place.
    tolerance: float = 5e-5
    #: Distance [m] by which the tool retracts between two contours.
    lift: float = 0.0
    #: Outputs by the code that switches them: S, or an M-code with its values.
    outputs: Mapping[str, CodeOutput] = field(default_factory=dict)
    #: Whether the points of a joint trajectory are joined by straight lines of the tool; if not,
    #: by joint motions.
    lines: bool = False
    #: The arm for which a file's joint positions are meant.
    arm: Arm = field(default_factory=lambda: Arm(robot_model('ur5e')))
    #: The active TCP for which a file's joint positions are meant.
    T_flange_tcp: Pose = IDENTITY

    @property
    def moves_path(self) -> bool:
        """Whether an option moves or scales the path; joint positions permit no such option."""
        moved = self.frame not in ('', 'base') or self.origin != IDENTITY
        return moved or bool(self.tool) or self.scale != 1.0

    def __post_init__(self) -> None:
        """
        Check ``corner``.

        :raises ValueError: ``corner`` is out of its range, or ``blend`` is given, too.
        """
        if not CORNER_DEVIATION.holds(self.corner):
            raise ValueError(f'corner {CORNER_DEVIATION.refusal(self.corner)[0]}')
        if self.corner and self.blend:
            raise ValueError('blend and corner are two ways past a point; give one of them')
