# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Fills the robot program with addresses and with the constants of the protocol.

Every number that both sides must agree on lives once, in an enum of
:mod:`ur_cartesian_driver.protocol`; the head of the program is written from there. Lines of the
program that start with ``#!`` are instructions for this module:

``#! constants``
    the constants stand here.
``#! include NAME``
    the file ``NAME.script`` stands here.
``#! if FEATURE`` ... ``#! end``
    kept only where the controller's software has the feature, because a controller refuses a
    program that names a function which it does not know. ``freedrive`` is no matter of the software:
    it is kept where teaching is allowed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from importlib.resources import files

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.motion.goal import OutputKind
from ur_cartesian_driver.protocol.framing import FIXED_POINT
from ur_cartesian_driver.protocol.program import point_fields, registers, reverse, script_command
from ur_cartesian_driver.protocol.program import trajectory_points as trajectory

PROGRAM_NAME = 'ur_cartesian_driver'

#: A set-point of the buffered servo is repeated until each joint is as near to it [rad], as in the
#: manufacturer's guide, but not more often than this.
SERVO_TOLERANCE = 0.2
SERVO_MAX_REPEATS = 500
#: A set-point that comes longer after the one before stands for one step, as in the guide.
SERVO_MAX_STEPS = 50

#: The first software of the CB3/e-Series line and of PolyScope X that has a feature.
FEATURES: dict[str, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    'optimove': ((5, 21, 0), (10, 8, 0)),
    'target_payload': ((5, 10, 0), (10, 0, 0)),
}

#: How the program follows splines.
SPLINE_CONSTANTS: dict[str, float] = {
    #: How fast the leading axis changes its speed from step to step [rad/s^2]; the client
    #: library's number for speedj.
    'ACCELERATION': 40.0,
    #: What part of a distance from the polynomial one step takes away.
    'CORRECTION': 0.4,
    #: How hard the last piece may end in motion [rad/s^2], and the greatest mean speed of a
    #: joint [rad/s]; the client library's numbers, as the next one.
    'MAX_DECELERATION': 15.0,
    'MAX_SPEED': 20.0,
    #: A first point without time may lie so far from where the arm is [rad].
    'START_TOLERANCE': 0.01,
    #: Slower than this is at rest [rad/s].
    'REST_SPEED': 0.0001,
    #: Where a step is less than this nobody can tell how far it led [rad].
    'MIN_STEP': 1e-06,
    #: Less than this [s] or [rad] comes from rounding.
    'ROUNDING': 1e-10,
}

#: An output takes effect at the end of a cycle: so many cycles ahead is the nearest to its place.
OUTPUT_LEAD = 1.5
#: The words of an output that wait with it, and where in them the program looks.
OUTPUT_WORDS = 18
OUTPUT_COLUMNS = {
    point_fields.PointField.OUTPUT_KIND: 'KIND',
    point_fields.PointField.OUTPUT_PIN: 'PIN',
    point_fields.PointField.OUTPUT_VALUE: 'VALUE',
    point_fields.PointField.OUTPUT_DOMAIN: 'DOMAIN',
    point_fields.PointField.STARTS_BEYOND: 'STARTS_BEYOND',
}


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramSettings:
    """What differs from one installation to the next."""

    #: The address at which the robot reaches the driver.
    host: str
    reverse_port: int
    trajectory_port: int
    script_command_port: int
    #: Software of the controller: major, minor, bugfix.
    version: tuple[int, int, int] = (5, 21, 0)
    #: Deceleration of the leading axis for every stop [rad/s^2].
    stop_deceleration: float = 4.0
    #: How long the program waits for the next trajectory point [s].
    point_timeout: float = 0.5
    #: How stiff ``servoj`` holds a set-point (100 to 2000), and how far it looks ahead [s] (0.03
    #: to 0.2).
    servoj_gain: float = 2000.0
    servoj_lookahead_time: float = 0.03
    #: How many set-points the buffered servo can hold.
    servo_buffer_depth: int = 250
    #: Whether the buffered servo may let people push the arm.
    allow_freedrive: bool = False

    def __post_init__(self) -> None:
        """Refuse a host that would not survive inside a quoted string."""
        if not self.host or not all(c.isalnum() or c in '.-_:' for c in self.host):
            raise LocalProtocolError(
                f'reverse_ip: {self.host!r} is no host name or address; set it to the address '
                'at which the robot reaches this computer.'
            )


def render(settings: ProgramSettings) -> str:
    """
    Return the program's text for the script sender: header and node, without a ``def`` around.

    :raises LocalProtocolError: an instruction in the program is unknown (a defect of ours).
    """
    return '\n'.join(_lines('driver', settings)) + '\n'


def wrap_in_program(text: str) -> str:
    """Return the text as a program that can be uploaded: indented, in a ``def`` of our name."""
    body = ''.join(f'\t{line}\n' if line else '\n' for line in text.splitlines())
    return f'def {PROGRAM_NAME}():\n{body}end\n'


def has_feature(feature: str, version: tuple[int, int, int]) -> bool:
    """Tell whether the controller's software knows a feature of :data:`FEATURES`."""
    classic, polyscope_x = FEATURES[feature]
    return version >= (polyscope_x if version[0] >= 10 else classic)


def _lines(name: str, settings: ProgramSettings) -> Iterator[str]:
    """Yield the lines of a part of the program, instructions carried out."""
    keep = True
    text = files('ur_cartesian_driver.program').joinpath(f'{name}.script').read_text('ascii')
    for line in text.splitlines():
        match line.split():
            case ['#!', 'constants']:
                yield from constants(settings)
            case ['#!', 'include', part]:
                yield from _lines(part, settings)
            case ['#!', 'if', 'freedrive']:
                keep = settings.allow_freedrive
            case ['#!', 'if', feature] if feature in FEATURES:
                keep = has_feature(feature, settings.version)
            case ['#!', 'end']:
                keep = True
            case ['#!', *rest]:
                raise LocalProtocolError(f'{name}.script: unknown instruction {rest}')
            case _ if keep:
                yield line


def constants(settings: ProgramSettings) -> Iterator[str]:
    """Yield one assignment for each constant of the program."""
    yield f'DRIVER_HOST = "{settings.host}"'
    yield f'REVERSE_PORT = {settings.reverse_port}'
    yield f'TRAJECTORY_PORT = {settings.trajectory_port}'
    yield f'COMMAND_PORT = {settings.script_command_port}'
    yield f'STOP_DECELERATION = {settings.stop_deceleration}'
    yield f'POINT_TIMEOUT = {settings.point_timeout}'
    # PolyScope X takes twice as many reads in a step as its predecessors.
    yield f'DISCARDED_PER_STEP = {20 if settings.version[0] >= 10 else 10}'
    yield f'MULT_JOINTSTATE = {FIXED_POINT}'
    yield f'MULT_TIME = {FIXED_POINT}'
    yield f'REVERSE_FIELDS = {reverse.MESSAGE_FIELDS}'
    yield f'POINT_FIELDS = {trajectory.POINT_FIELDS}'
    yield f'COMMAND_FIELDS = {script_command.COMMAND_WORDS}'
    yield f'STREAM_LENGTH = {2**31 - 1}'
    yield f'TCP_RESOLUTION = {2.0 / FIXED_POINT:.6f}'
    yield f'REGISTER_POINTS_BEGUN = {int(registers.POINTS_BEGUN)}'
    yield from _servo_constants(settings)
    yield from _enum('MODE', reverse.ControlMode)
    yield from _enum('TRAJECTORY', reverse.TrajectoryAction)
    yield from _enum('MOTION', point_fields.MotionType)
    yield from _enum('SPLINE', point_fields.SplineKind)
    for name, value in SPLINE_CONSTANTS.items():
        yield f'SPLINE_{name} = {value:.10f}'
    yield from _enum('RESULT', TrajectoryResult)
    yield from _enum('COMMAND', script_command.ScriptCommand)
    yield from _enum('TCP', script_command.TcpPersistence)
    yield f'MAX_PENDING_OUTPUTS = {trajectory.MAX_PENDING_OUTPUTS}'
    yield f'OUTPUT_WORDS = {OUTPUT_WORDS}'
    # Of floats, as the matrices that are made with them.
    yield f'OUTPUT_ONES = {[1.0] * trajectory.MAX_PENDING_OUTPUTS}'
    yield f'OUTPUT_ROW = {[0.0] * OUTPUT_WORDS}'
    yield f'OUTPUT_LEAD = {OUTPUT_LEAD}'
    yield from _enum('OUTPUT', OutputKind)
    # Where a field stands in the row of an output that waits.
    for field, name in OUTPUT_COLUMNS.items():
        yield f'OUTPUT_{name} = {field.value}'
    # Where a field of a point stands in the list that the robot reads, its length first.
    yield from _enum('POINT', point_fields.PointField, offset=1)


def _servo_constants(settings: ProgramSettings) -> Iterator[str]:
    """Yield those of the buffered servo."""
    yield f'SERVOJ_GAIN = {settings.servoj_gain}'
    yield f'SERVOJ_LOOKAHEAD_TIME = {settings.servoj_lookahead_time}'
    yield f'SERVO_ALLOW_FREEDRIVE = {settings.allow_freedrive}'
    yield f'SERVO_BUFFER_DEPTH = {settings.servo_buffer_depth}'
    # A list as long as the buffer: old controllers have no other way to make one.
    yield f'SERVO_ONES = {[1.0] * settings.servo_buffer_depth}'
    yield f'SERVO_ROW = {[0.0] * 6}'
    yield f'SERVO_MAX_STEPS = {SERVO_MAX_STEPS}'
    yield f'SERVO_MAX_REPEATS = {SERVO_MAX_REPEATS}'
    yield f'SERVO_TOLERANCE = {[SERVO_TOLERANCE] * 6}'
    yield from _enum('SERVO_IN', registers.InputInteger)
    yield from _enum('SERVO_IN', registers.InputDouble)
    yield from _enum('SERVO_OUT', registers.OutputInteger)
    yield from _enum('SERVO_OUT', registers.OutputDouble)
    yield from _enum('SERVO_MODE', registers.ServoMode)
    yield from _enum('SERVO_SYNC', registers.SyncState)
    yield from _enum('SERVO_ERROR', registers.ExternalError)


def _enum(prefix: str, members: type[IntEnum], offset: int = 0) -> Iterator[str]:
    for name, member in members.__members__.items():  # aliases too
        yield f'{prefix}_{name} = {member.value + offset}'
