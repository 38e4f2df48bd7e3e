# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Renders the robot program: inserts the addresses and the constants of the protocol.

Every number on which driver and robot program must agree is defined once, in Python (mostly in
:mod:`ur_cartesian_driver.protocol`); the head of the program is rendered from these definitions.
Lines of the program that start with ``#!`` are instructions for this module:

``#! constants``
    insert the constants.
``#! include NAME``
    insert the file ``NAME.script``.
``#! prelude``
    insert the script prelude unchanged.
``#! calls``
    insert the code that calls the functions of the prelude by their numbers.
``#! if FEATURE`` ... ``#! end``, ``#! if not FEATURE`` ... ``#! end``
    keep these lines only if the controller's software has, or lacks, the feature, because a
    controller refuses a program that names an unknown function. Two features do not depend on
    the software: lines for ``freedrive`` are kept if the settings allow freedrive, and lines for
    ``prelude`` if the prelude defines functions.

The program is sent without empty lines, and without comments except the markers of the External
Control node. Programs on the pendant share a name space with the robot program, so each variable,
function and thread that the robot program defines at its top level is sent with the
:data:`PREFIX`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import cache, lru_cache
from importlib.resources import files
import re

from ur_cartesian_driver.motion.errors import LocalProtocolError
from ur_cartesian_driver.motion.events import TrajectoryResult
from ur_cartesian_driver.motion.goal.goal import ContactEnd, InputKind, OutputKind
from ur_cartesian_driver.motion.plan.approach import ARRIVAL_TOLERANCE, BRAKING_FRACTION
from ur_cartesian_driver.motion.plan.primitive import LEAD_PIECES
from ur_cartesian_driver.program.prelude import NO_PRELUDE, Prelude
from ur_cartesian_driver.protocol.framing import FIXED_POINT
from ur_cartesian_driver.protocol.program import point_fields, registers, reverse, script_command
from ur_cartesian_driver.protocol.program import trajectory_points as trajectory
from ur_cartesian_driver.protocol.rtde.rtde_fields import LOWER_REGISTERS

PROGRAM_NAME = 'ur_cartesian_driver'

#: Prefix, on the robot, of every global variable, function and thread of the program.
PREFIX = 'urcd_'

#: Comments by which the External Control node divides the program.
MARKERS = frozenset(
    {
        '# HEADER_BEGIN',
        '# HEADER_END',
        '# NODE_CONTROL_LOOP_BEGINS',
        '# NODE_CONTROL_LOOP_ENDS',
    }
)

_DEFINITION = re.compile(r'(?:def|thread) (\w+)\(|(\w+) = ')
_STRING_OR_NAME = re.compile(r'"[^"]*"|\w+')

#: The buffered servo repeats a set-point until each joint is within this tolerance [rad] of it.
SERVO_TOLERANCE = 0.2
#: Largest number of such repetitions, as in the manufacturer's guide.
SERVO_MAX_REPEATS = 500
#: If more controller steps than this lie between two set-points, one step is assumed, as in the
#: guide.
SERVO_MAX_STEPS = 50
#: The buffered servo has come to rest at a set-point if the target is within this distance [rad],
#: and slower than this speed [rad/s]; both are norms over all joints.
SERVO_END_TOLERANCE, SERVO_REST_SPEED = 1e-4, 1e-3
#: The buffered servo counts as at rest, too, if the time of the motion, delayed by the lag of
#: servoj, is within this time [s] of the set-point's time, which takes nine lookahead times.
SERVO_SETTLED = 1e-5

#: Placeholder, above any version, for a feature that no version is known to have.
_NO_VERSION = (1000, 0, 0)
#: For each feature, the first version of CB3/e-Series and of PolyScope X software that has it.
FEATURES: dict[str, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    'optimove': ((5, 21, 0), (10, 8, 0)),
    'motion_version': ((5, 22, 0), _NO_VERSION),
    'path_offset': ((5, 6, 0), _NO_VERSION),
    'target_payload': ((5, 10, 0), (10, 0, 0)),
}

#: Constants of the spline interpolation.
SPLINE_CONSTANTS: dict[str, float] = {
    #: speedj gets at least the acceleration that brakes the fastest joint in this time [s].
    'BRAKING_TIME': 0.025,
    #: Bounds [rad/s^2] on the acceleration for speedj, whatever the braking time.
    'MIN_BRAKING': 1.0,
    'MAX_ACCELERATION': 40.0,
    #: If a call of speedj has taken at least this many steps, the program was paused meanwhile,
    #: and the arm went on for a while.
    'COASTED': 2.0,
    #: If the speed slider shortens a step, speedj is called for this fraction of the short step.
    'SHORT_CALL': 0.9,
    #: If the arm reaches more than this fraction of the planned speed, the speed slider is assumed
    #: not to shorten the next step.
    'FULL_SPEED': 0.999,
    #: Smallest planned fraction of a step, even if the arm nearly stands still.
    'MIN_FRACTION': 0.01,
    #: A call has taken one step if the arm moved the planned distance, to within this fraction.
    'SAME_STEP': 0.02,
    #: Fraction of the position error corrected in one step.
    'CORRECTION': 0.4,
    #: Largest deceleration [rad/s^2] at the end of the last piece, as in the client library.
    'MAX_DECELERATION': 15.0,
    #: Largest mean joint speed [rad/s] of a piece, as in the client library.
    'MAX_SPEED': 20.0,
    #: Largest distance [rad] from the arm to a first point at time 0, as in the client library.
    'START_TOLERANCE': 0.01,
    #: If, at the end of a spline, the arm is farther than this [rad] from the last point, or still
    #: moves by more than this in a step, a movej covers the rest.
    'END_TOLERANCE': 1e-05,
    #: Acceleration [rad/s^2] and speed [rad/s] of that movej.
    'END_ACCELERATION': 15.0,
    'END_SPEED': 1.0,
    #: Below this speed [rad/s] the arm is at rest.
    'REST_SPEED': 0.0001,
    #: Smallest planned step [rad] whose progress can be measured.
    'MIN_STEP': 1e-06,
    #: Smaller differences [s] or [rad] are rounding errors.
    'ROUNDING': 1e-10,
}

#: Constants of force mode.
PRESS_CONSTANTS: dict[str, float] = {
    #: Time [s] for which the arm stands still before force mode begins, as the manual advises.
    'REST_TIME': 0.02,
    #: Acceleration [m/s^2] and speed [m/s] of the move back to the place of contact.
    'RETURN_ACCELERATION': 0.5,
    'RETURN_SPEED': 0.02,
    #: The step [s] of a CB3 controller; its force mode has no gain scaling.
    'STEP_WITHOUT_GAIN': 0.008,
}

#: Speed [m/s] below which the watch for contact regards the tool as resting.
WATCH_REST_SPEED = 0.001

#: Constants of path offsets.
OFFSET_CONSTANTS: dict[str, float] = {
    #: The controller's number for offsets along the axes of the base.
    'FRAME_BASE': 1,
    #: Time constant [s] of the controller's filter; at 500 Hz it gives the coefficient 0.1, which
    #: the manual calls a good compromise for welding.
    'FILTER_TIME': 0.018,
    #: The controller's default limit [rad] of rotational offsets; no offset here turns the tool.
    'MAX_TURN': 0.52,
    #: Fraction of its acceleration with which an offset brakes, as in the driver.
    'BRAKING': BRAKING_FRACTION,
    #: Distance [m] from its target within which an offset has arrived, as in the driver.
    'TOLERANCE': ARRIVAL_TOLERANCE,
    #: Largest change [1/s] of the rate of the offset's time, which follows the motion's rate.
    'RATE_CHANGE': 10.0,
    #: A step of the offset's time up to this [s] does not move the offset.
    'MIN_TIME': 1e-6,
    #: The tool is on its path if its offset is not larger than this [m].
    'GONE': 1e-6,
}

#: Cycles by which an output is switched early, because it takes effect at the end of a cycle.
OUTPUT_LEAD = 1.5
#: A tool that has moved in a step by this [m] more than twice the distance that its speed explains
#: has coasted into a pause.
OUTPUT_JUMP = 1e-4
#: The number of words that the program keeps for a pending output.
OUTPUT_WORDS = 18
#: The columns among these words that the program uses, and their names in the program.
OUTPUT_COLUMNS = {
    point_fields.PointField.OUTPUT_KIND: 'KIND',
    point_fields.PointField.OUTPUT_PIN: 'PIN',
    point_fields.PointField.OUTPUT_VALUE: 'VALUE',
    point_fields.PointField.OUTPUT_DOMAIN: 'DOMAIN',
    point_fields.PointField.HAS_TRIGGER_POSE: 'HAS_TRIGGER_POSE',
    point_fields.PointField.STARTS_BEYOND: 'STARTS_BEYOND',
}


#: The columns for an analog output that follows the speed: its law in the order of a record,
#: whether the output follows the speed now, and the filtered speed [m/s].
FOLLOW_COLUMNS = ('GAIN', 'OFFSET', 'MINIMUM', 'MAXIMUM', 'FILTER_TIME', 'ACTIVE', 'SPEED')

#: The columns for an output with a lead, after the planned speeds: the lead [s], the way left
#: [m or rad], the way left at the end of the present piece, the number of this piece, the rate of
#: the path's time, whether the lead runs, and whether the tool only turns.
LEAD_COLUMNS = ('TIME', 'LEFT', 'LEFT_LATER', 'PIECE', 'RATE', 'ACTIVE', 'TURNS')
#: The columns for the pulses of an output: the distance between pulses [m], the way to the next
#: one [m], their width [s], their number left, the slot, kind and pin of the output, whether
#: pulses left at the end are dropped; the time for which the output stays on [s], whether pulses
#: are given (1: since this step), and their count.
PULSE_COLUMNS = (
    *('DISTANCE', 'WAY', 'WIDTH', 'LEFT', 'SLOT', 'OUTPUT', 'PIN', 'GOES_ON'),
    *('TIME_ON', 'ACTIVE', 'GIVEN'),
)
#: The slowest motion that counts as one [m per cycle]. A slower tool is at a pulse if the pulse is
#: no farther away than this [m].
PULSE_TOLERANCE = 1e-6
#: Planned speed [m/s or rad/s] below which the actual speed does not give the rate of the path's
#: time.
LEAD_MIN_SPEED = 2e-4


@dataclass(frozen=True, slots=True, kw_only=True)
class ProgramSettings:
    """The settings of the program that differ between installations."""

    #: Address at which the robot reaches the driver.
    host: str
    reverse_port: int
    trajectory_port: int
    script_command_port: int
    #: The number by which the driver recognises this program; random, and never 0.
    number: int = 1
    #: Software version of the controller: major, minor, bugfix.
    version: tuple[int, int, int] = (5, 21, 0)
    #: Deceleration [rad/s^2] of the leading axis in every stop.
    stop_deceleration: float = 4.0
    #: Timeout [s] of the next trajectory point.
    point_timeout: float = 0.5
    #: Stiffness of ``servoj``.
    servoj_gain: float = 1000.0
    #: Lookahead time [s] of ``servoj``.
    servoj_lookahead_time: float = 0.06
    #: Capacity of the buffered servo [set-points].
    servo_buffer_depth: int = 250
    #: Whether the buffered servo may switch to freedrive.
    allow_freedrive: bool = False
    #: Whether the program uses the int and double registers from 0 on, not from 24 on.
    lower_registers: bool = False
    #: The motion version that the program sets for itself; 0 = none.
    motion_version: int = 0
    #: The user's functions that the program contains.
    prelude: Prelude = NO_PRELUDE

    def __post_init__(self) -> None:
        """Refuse a host that could end its quoted string, and an impossible motion version."""
        if not self.host or not all(c.isalnum() or c in '.-_:' for c in self.host):
            raise LocalProtocolError(
                f'reverse_ip: {self.host!r} is not a host name or address; set it to the address '
                'at which the robot reaches this computer.'
            )
        if self.motion_version and not has_feature('motion_version', self.version):
            raise LocalProtocolError(
                f'motion_version is {self.motion_version}, but the software of the robot, '
                f'{".".join(map(str, self.version))}, is not known to have motion versions '
                '(PolyScope 5 has them from 5.22 on); set motion_version to 0.'
            )


@lru_cache(maxsize=4)  # a driver renders the same program again for each new connection
def render(settings: ProgramSettings) -> str:
    """
    Return the program for the script sender: header and node, without a ``def`` around them.

    :raises LocalProtocolError: the program has an unknown instruction, which is a bug in it.
    """
    lines = [line for line in _lines('driver', settings) if not _is_comment(line)]
    own = {match[1] or match[2] for line in lines if (match := _DEFINITION.match(line))}

    def rename(found: re.Match[str]) -> str:
        return PREFIX + found[0] if found[0] in own else found[0]

    return ''.join(
        f'{line if isinstance(line, _ForeignLine) else _STRING_OR_NAME.sub(rename, line)}\n'
        for line in lines
    )


class _ForeignLine(str):
    """A line of the prelude, or of the code that calls its functions; the names get no prefix."""

    __slots__ = ()


@cache
def taken_names() -> tuple[frozenset[str], frozenset[str]]:
    """Return the controller functions that the program calls, and the program's local names."""
    text = ''.join(
        files('ur_cartesian_driver.program').joinpath(f'{name}.script').read_text('ascii')
        for name in ('driver', 'servo')
    )
    parameters = ','.join(re.findall(r'def \w+\((.*)\):', text))
    names = {*re.findall(r'local (\w+)', text), *re.findall(r'\w+', parameters)}
    calls = frozenset(re.findall(r'(\w+)\(', text))
    return calls - set(re.findall(r'(?:def|thread) (\w+)\(', text)), frozenset(names)


def wrap_in_program(text: str) -> str:
    """Return the text as a program that can be uploaded: indented, within a ``def``."""
    body = ''.join(f'\t{line}\n' for line in text.splitlines() if line not in MARKERS)
    return f'def {PROGRAM_NAME}():\n{body}end\n'


def _is_comment(line: str) -> bool:
    """Return whether a line is empty, or is a comment other than a marker."""
    return line not in MARKERS and line.lstrip()[:1] in ('', '#')


def has_feature(feature: str, version: tuple[int, int, int]) -> bool:
    """Return whether the controller's software has a feature of :data:`FEATURES`."""
    classic, polyscope_x = FEATURES[feature]
    return version >= (polyscope_x if version[0] >= 10 else classic)


def _lines(name: str, settings: ProgramSettings) -> Iterator[str]:
    """Yield the lines of one file of the program, with its instructions carried out."""
    keep = True
    text = files('ur_cartesian_driver.program').joinpath(f'{name}.script').read_text('ascii')
    for line in text.splitlines():
        match line.split():
            case ['#!', 'constants']:
                yield from constants(settings)
            case ['#!', 'include', part]:
                yield from _lines(part, settings)
            case ['#!', 'prelude']:
                yield from map(_ForeignLine, settings.prelude.lines)
            case ['#!', 'calls']:
                yield from map(_ForeignLine, settings.prelude.dispatch())
            case ['#!', 'if', 'prelude']:
                keep = bool(settings.prelude.functions)
            case ['#!', 'if', 'freedrive']:
                keep = settings.allow_freedrive
            case ['#!', 'if', feature] if feature in FEATURES:
                keep = has_feature(feature, settings.version)
            case ['#!', 'if', 'not', feature] if feature in FEATURES:
                keep = not has_feature(feature, settings.version)
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
    # In a step, PolyScope X can read twice as many messages as its predecessors.
    yield f'DISCARDED_PER_STEP = {20 if settings.version[0] >= 10 else 10}'
    # Floats, because the program divides by them and needs the fractions.
    yield f'MULT_JOINTSTATE = {float(FIXED_POINT)}'
    yield f'MULT_TIME = {float(FIXED_POINT)}'
    yield f'REVERSE_FIELDS = {reverse.MESSAGE_FIELDS}'
    yield f'POINT_FIELDS = {trajectory.POINT_FIELDS}'
    yield f'COMMAND_FIELDS = {script_command.COMMAND_WORDS}'
    yield f'STREAM_LENGTH = {2**31 - 1}'
    yield f'TCP_RESOLUTION = {2.0 / FIXED_POINT:.6f}'
    yield from _register_constants(settings)
    yield f'PROGRAM_VERSION = {registers.PROGRAM_VERSION}'
    yield f'PROGRAM_NUMBER = {settings.number}'
    yield f'MOTION_VERSION = {settings.motion_version}'
    # Motion version 1 is the name of the only behaviour that PolyScope 3 and 5 had before 5.22.
    yield f'ONLY_MOTION_VERSION = {1 if settings.version[0] < 10 else 0}'
    yield from _servo_constants(settings)
    yield from _message_constants()
    yield from _output_constants()
    yield from _event_constants()


def _register_constants(settings: ProgramSettings) -> Iterator[str]:
    """Yield the numbers of the RTDE registers that the program reads and writes."""
    shift = -LOWER_REGISTERS if settings.lower_registers else 0
    output = registers.OutputInteger
    for register in (
        output.POINTS_BEGUN,
        output.SAFE_OUTPUTS_TOKEN,
        output.PROGRAM_VERSION,
        output.PROGRAM_NUMBER,
        output.PROGRAM_RUN,
        output.MOTION_VERSION,
        output.PULSES,
    ):
        yield f'REGISTER_{register.name} = {register + shift}'
    for prefix, members in (
        ('SERVO_IN', registers.InputInteger),
        ('SERVO_IN', registers.InputDouble),
        ('SERVO_OUT', registers.OutputInteger),
        ('SERVO_OUT', registers.OutputDouble),
        ('OFFSET_IN', registers.OffsetInput),
        ('OFFSET_OUT', registers.OffsetOutput),
        ('FEED_OUT', registers.FeedOutput),
    ):
        yield from _enum(prefix, members, offset=shift)


def _message_constants() -> Iterator[str]:
    """Yield the numbers that occur in messages of the driver."""
    yield from _enum('MODE', reverse.ControlMode)
    yield from _enum('TRAJECTORY', reverse.TrajectoryAction)
    yield from _enum('MOTION', point_fields.MotionType)
    yield from _enum('SPLINE', point_fields.SplineKind)
    for name, value in SPLINE_CONSTANTS.items():
        yield f'SPLINE_{name} = {value:.10f}'
    yield from _enum('RESULT', TrajectoryResult)
    yield from _enum('COMMAND', script_command.ScriptCommand)
    yield from _enum('TOOL_CONTACT', script_command.ToolContactResult)
    yield f'NO_COMMAND = {[0] * (script_command.COMMAND_WORDS + 1)}'


def _output_constants() -> Iterator[str]:
    """Yield the constants of safe outputs, and of outputs switched along the path."""
    yield from _enum('SAFE_OUTPUTS', script_command.SafeOutputsAction)
    # Indices in the list that the robot reads; its length, command, action and token come first.
    yield 'SAFE_DIGITAL = 4'
    yield f'SAFE_ANALOG = {4 + script_command.DIGITAL_OUTPUTS}'
    yield f'SAFE_LAST = {3 + script_command.DIGITAL_OUTPUTS + 2 * script_command.ANALOG_OUTPUTS}'
    yield f'DIGITAL_OUTPUTS = {script_command.DIGITAL_OUTPUTS}'
    yield f'ANALOG_OUTPUTS = {script_command.ANALOG_OUTPUTS}'
    for kind in (OutputKind.CONFIGURABLE_DIGITAL, OutputKind.TOOL_DIGITAL):
        name = kind.name.removesuffix('_DIGITAL')
        yield f'FIRST_{name}_OUTPUT = {script_command.FIRST_DIGITAL_OUTPUT[kind]}'
    yield from _enum('TCP', script_command.TcpPersistence)
    yield f'MAX_PENDING_OUTPUTS = {trajectory.MAX_PENDING_OUTPUTS}'
    yield f'OUTPUT_WORDS = {OUTPUT_WORDS}'
    # Floats, because a matrix of floats is made from them.
    yield f'OUTPUT_ONES = {[1.0] * (trajectory.MAX_PENDING_OUTPUTS + trajectory.MAX_LEADS)}'
    yield f'OUTPUT_ROW = {[0.0] * OUTPUT_WORDS}'
    yield f'OUTPUT_LEAD = {OUTPUT_LEAD}'
    yield f'OUTPUT_JUMP = {OUTPUT_JUMP}'
    yield f'MAX_LEADS = {trajectory.MAX_LEADS}'
    yield f'LEAD_PIECES = {LEAD_PIECES}'
    yield f'LEAD_ONES = {[1.0] * trajectory.MAX_LEADS}'
    yield f'LEAD_ROW = {[0.0] * (LEAD_PIECES + 1 + len(LEAD_COLUMNS))}'
    for column, name in enumerate(LEAD_COLUMNS, LEAD_PIECES + 1):
        yield f'LEAD_{name} = {column}'
    yield f'LEAD_MIN_SPEED = {LEAD_MIN_SPEED}'
    yield f'PULSE_TRAINS = {trajectory.MAX_PULSE_TRAINS}'
    yield f'PULSE_ONES = {[1.0] * trajectory.MAX_PULSE_TRAINS}'
    yield f'PULSE_ROW = {[0.0] * len(PULSE_COLUMNS)}'
    for column, name in enumerate(PULSE_COLUMNS):
        yield f'PULSE_{name} = {column}'
    yield f'PULSE_TOLERANCE = {PULSE_TOLERANCE}'
    yield f'PULSE_COUNTS = {registers.PULSE_COUNTS}'
    yield from _enum('OUTPUT', OutputKind)


def _event_constants() -> Iterator[str]:
    """Yield the constants of waits, presses, path offsets and outputs that follow the speed."""
    yield from _enum('INPUT', InputKind)
    yield from _enum('CONTACT', ContactEnd)
    for name, value in PRESS_CONSTANTS.items():
        yield f'PRESS_{name} = {value}'
    yield f'WATCH_REST_SPEED = {WATCH_REST_SPEED}'
    for name, value in OFFSET_CONSTANTS.items():
        yield f'OFFSET_{name} = {value:.10g}'
    yield f'TRAJECTORY_TAKES_OFFSETS = {int(reverse.TAKES_OFFSETS)}'
    yield from _enum('FOLLOW', point_fields.FollowKind)
    # Floats, because a matrix of floats is made from them: a row for each analog output.
    yield f'FOLLOW_ONES = {[1.0] * script_command.ANALOG_OUTPUTS}'
    yield f'FOLLOW_ROW = {[0.0] * len(FOLLOW_COLUMNS)}'
    for column, name in enumerate(FOLLOW_COLUMNS):
        yield f'FOLLOW_{name} = {column}'
    # Columns of the fields in the row of a pending output.
    for field, name in OUTPUT_COLUMNS.items():
        yield f'OUTPUT_{name} = {field.value}'
    # Indices of the fields in the list that the robot reads; its first item is its length.
    yield from _enum('POINT', point_fields.PointField, offset=1)


def _servo_constants(settings: ProgramSettings) -> Iterator[str]:
    """Yield the constants of the buffered servo."""
    yield f'SERVOJ_GAIN = {settings.servoj_gain}'
    yield f'SERVOJ_LOOKAHEAD_TIME = {settings.servoj_lookahead_time}'
    yield f'SERVO_ALLOW_FREEDRIVE = {settings.allow_freedrive}'
    yield f'SERVO_BUFFER_DEPTH = {settings.servo_buffer_depth}'
    # A list as long as the buffer, written out because old controllers have no other way.
    yield f'SERVO_ONES = {[1.0] * settings.servo_buffer_depth}'
    # The joint positions, and their time on the path.
    yield f'SERVO_ROW = {[0.0] * 7}'
    yield f'SERVO_MAX_STEPS = {SERVO_MAX_STEPS}'
    yield f'SERVO_MAX_REPEATS = {SERVO_MAX_REPEATS}'
    yield f'SERVO_TOLERANCE = {[SERVO_TOLERANCE] * 6}'
    yield f'SERVO_END_TOLERANCE = {SERVO_END_TOLERANCE}'
    yield f'SERVO_REST_SPEED = {SERVO_REST_SPEED}'
    yield f'SERVO_SETTLED = {SERVO_SETTLED:.10f}'
    yield from _enum('SERVO_MODE', registers.ServoMode)
    yield from _enum('SERVO_SYNC', registers.SyncState)
    yield from _enum('SERVO_ERROR', registers.ExternalError)


def _enum(prefix: str, members: type[IntEnum], offset: int = 0) -> Iterator[str]:
    for name, member in members.__members__.items():  # aliases too
        yield f'{prefix}_{name} = {member.value + offset}'
