# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The fault matrix of the other execution modes: their phases, and the faults that may differ.

Each fault is a row of :mod:`fault_table`, with the changes of an execution mode. Faults are not
run again if their outcome cannot differ: it is decided before the execution mode matters (idle,
planning), or no execution mode uses the affected interface.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Any

from example_goals import PRELUDE
from fault_table import CONTINUED, HEADLESS, LOCAL, Row

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.robot.lifecycle import ConnectionState

E, S = ErrorCode, ConnectionState


@dataclass(frozen=True, kw_only=True)
class Mode:
    """An execution mode under faults."""

    #: Name of its goals in tests and on the page.
    name: str
    #: Description on the page.
    about: str
    phases: dict[str, str]
    headless: tuple[Row, ...]
    local: tuple[Row, ...]
    continued: tuple[Row, ...]
    #: Settings of the driver beyond the usual ones.
    settings: dict[str, Any] = field(default_factory=dict)
    #: Longest times to the result and to rest of a goal that the fault does not disturb [s].
    undisturbed: float


#: Faults of the parts that each execution mode has of its own: program, points, packets, stops.
FAULTS = (
    'protective stop',
    'emergency stop',
    'an operator stops the program',
    "another client's program replaces ours",
    'an operator pauses the program',
    'the speed slider is moved to 0',
    'the controller crashes',
    'the network cable is cut',
    'protective stop that the driver does not see',
    'RTDE is cut',
    'RTDE is 0.1 s late',
    'RTDE carries less data than needed',
    "the program's sockets are cut",
    "the program's answers are lost",
    'the reverse socket is half-open',
    'the trajectory socket is half-open',
    'the pose is measured 6 mm off',
    'the node is silent',
)
#: Faults whose outcome may differ if something is done at points or along the path.
WITH_POINTS = tuple(
    name
    for name in FAULTS
    if name not in ("another client's program replaces ours", 'the controller crashes')
)
#: Further faults of RTDE, for a mode with set-points.
FAULTS_OF_RTDE = (
    'safeguard stop',
    'an operator switches the arm off',
    'all connections are cut for 0.1 s, RTDE first',
    'all connections are cut for 0.1 s, the program first',
    'RTDE is half-open',
    'RTDE is silent for 1.5 s',
    'garbage on RTDE',
    'the reverse socket is cut',
    'the trajectory socket is cut',
)
#: Faults for a program on the pendant.
ON_THE_PENDANT = (
    'protective stop',
    'protective stop that the driver does not see',
    'an operator pauses the program',
    'the network cable is cut',
)

#: Faults that are run with on_robot_stop: continue.
CONTINUES = ('protective stop',)


def select_rows(
    rows: Iterable[Row],
    names: Iterable[str],
    phases: Iterable[str],
    undisturbed: float,
    changes: dict[str, dict[str, dict[str, Any]]],
) -> tuple[Row, ...]:
    """
    Return rows of a table for the phases of an execution mode.

    :param names: faults, in this order.
    :param undisturbed: time of a goal that a fault does not disturb [s].
    :param changes: fault -> phase, or '' for all -> fields that differ.
    """
    by_name = {row.fault: row for row in rows}
    return tuple(
        _adapt_row(by_name[name], tuple(phases), undisturbed, changes.get(name, {}))
        for name in names
    )


def _adapt_row(
    row: Row, phases: tuple[str, ...], undisturbed: float, changes: dict[str, dict[str, Any]]
) -> Row:
    """Return a row for other phases, with its changes."""
    differs = {
        phase: row.differs.get(phase, {}) | changes.get(phase, {})
        for phase in phases
        if phase in row.differs or phase in changes
    }
    usual = replace(row, **changes.get('', {}), differs={})
    return _with_times(
        replace(
            usual,
            differs={
                phase: _times(replace(usual, **differing), undisturbed, differing)
                for phase, differing in differs.items()
            },
        ),
        undisturbed,
    )


def _with_times(row: Row, undisturbed: float) -> Row:
    return replace(row, **_times(row, undisturbed, {}))


def _times(row: Row, undisturbed: float, differing: dict[str, Any]) -> dict[str, Any]:
    """Return the differences; an undisturbed goal also gets its own times."""
    if row.code is not E.SUCCESSFUL or row.waits:
        return differing
    return differing | {'result_within': undisturbed, 'rest_within': undisturbed}


def _mode(
    name: str,
    about: str,
    phases: dict[str, str],
    undisturbed: float,
    changes: dict[str, dict[str, dict[str, Any]]],
    *,
    faults: Iterable[str] = FAULTS,
    pendant: Iterable[str] = ON_THE_PENDANT,
    continued: Iterable[str] = CONTINUES,
    once: tuple[str, Iterable[str]] = ('', ()),
    more: tuple[Row, ...] = (),
    pendant_changes: dict[str, dict[str, dict[str, Any]]] | None = None,
) -> Mode:
    """
    Return an execution mode.

    :param once: a phase, and further faults that are tested in this phase only.
    :param pendant_changes: changes of the pendant's rows; None = the same changes.
    """
    return Mode(
        name=name,
        about=about,
        phases=phases,
        undisturbed=undisturbed,
        headless=(
            *select_rows(HEADLESS, faults, phases, undisturbed, changes),
            *more,
            *(
                replace(row, phases=once[:1])
                for row in select_rows(HEADLESS, once[1], phases, undisturbed, changes)
            ),
        ),
        local=select_rows(
            LOCAL,
            pendant,
            phases,
            undisturbed,
            changes if pendant_changes is None else pendant_changes,
        ),
        continued=select_rows(CONTINUED, continued, phases, undisturbed, changes),
    )


SPLINE = _mode(
    'SPLINE',
    'A half circle through four points, all but the last with twist and acceleration.',
    {
        'between points': 'on the way from the second point to the third',
        'slowing down': 'on the way to the last point, a tenth of a second before it',
        'cancelling': 'CANCEL is on the wire, the arm still moves',
    },
    1.6,
    {
        'the reverse socket is half-open': {'slowing down': {'code': E.SUCCESSFUL}},
        'the node is silent': {'slowing down': {'code': E.SUCCESSFUL}},
    },
)

#: Faults of the connection that carries the set-points.
SETPOINTS = (
    Row(
        fault='the connection of the set-points is cut',
        cause=('cut set-points',),
        code=E.CONNECTION_LOST,
        differs={'entering': {'code': E.ROBOT_NOT_READY}},
    ),
    Row(
        fault='the connection of the set-points is half-open',
        cause=('freeze set-points',),
        code=E.PROGRAM_STOPPED,
        result_within=0.7,
        rest_within=0.7,
        state_after=S.CONNECTED,
        steps=('wait until the fault ends', 'resend'),
        differs={
            'cancelling': {
                'code': E.CANCELLED,
                'state_after': S.READY,
                'steps': ('wait until the fault ends',),
            }
        },
    ),
    Row(
        fault='RTDE is 0.05 s late',
        cause=('delay rtde 0.05 s',),
        code=E.SUCCESSFUL,
        result_within=4.0,
        rest_within=4.0,
        steps=('wait until the fault ends',),
        differs={'cancelling': {'code': E.CANCELLED, 'result_within': 0.7, 'rest_within': 0.7}},
    ),
    Row(
        fault='another client has taken the inputs that set-points need',
        phases=('idle',),
        cause=('take the inputs',),
        code=E.ROBOT_NOT_READY,
        steps=('wait until the fault ends',),
    ),
)

#: Nothing has moved, and the goal ends because the robot does not answer.
_NOT_ENTERED = {'entering': {'code': E.ROBOT_NOT_READY}}
#: The program has read the cancellation and the arm is at rest: the goal has ended.
_STAYS_PAUSED = {'cancelling': {'result_within': 0.7, 'steps': ('play',)}}
#: No set-points arrive, so the robot program brakes and ends; then the driver notices that the
#: robot is silent.
_SILENT = {
    '': {
        'code': E.PROGRAM_STOPPED,
        'result_within': 0.7,
        'rest_within': 0.7,
        'state_after': S.DISCONNECTED,
        'state_within': 1.5,
        'steps': ('wait for the robot', 'resend'),
        'ready_within': 3.0,
    }
}

#: Set-points queue too: the robot program, which waits for them, brakes and ends first.
_NO_SETPOINTS = {
    'code': E.PROGRAM_STOPPED,
    'steps': ('wait until the fault ends', 'resend'),
}

#: Old states from before the cut may come first.
_PLUGGED_IN = ('wait until the fault ends', 'wait for the robot')

#: The last point is left out: whether it is reached before a timeout is a matter of milliseconds.
_NEVER_LATE = {'': {'phases': ('entering', 'between points', 'cancelling')}}

SERVO = _mode(
    'SERVO',
    'The same half circle as set-points, which the robot program buffers.',
    {
        'entering': 'the robot program was asked to take set-points, nothing has moved',
        'between points': 'on the way from the second point to the third',
        'slowing down': 'on the way to the last point, 0.2 s before it',
        'cancelling': 'the driver has left the mode of set-points, the arm still moves',
    },
    1.8,
    {
        'an operator pauses the program': _STAYS_PAUSED,
        'the network cable is cut': {'': {'steps': (*_PLUGGED_IN, 'resend')}},
        'protective stop that the driver does not see': _NOT_ENTERED,
        'RTDE is cut': _NOT_ENTERED,
        'RTDE is half-open': _SILENT,
        'RTDE is silent for 1.5 s': _SILENT,
        'garbage on RTDE': _SILENT,
        'RTDE carries less data than needed': dict.fromkeys(
            ('between points', 'cancelling'), _NO_SETPOINTS
        ),
        "the program's answers are lost": {
            '': {
                'code': E.SUCCESSFUL,
                'state_after': S.READY,
                'steps': ('wait until the fault ends',),
            }
        },
        'the reverse socket is half-open': _NEVER_LATE,
        'the node is silent': _NEVER_LATE,
    },
    faults=tuple(
        name
        for name in FAULTS
        if name not in ('the trajectory socket is half-open', 'RTDE is 0.1 s late')
    ),
    once=('between points', FAULTS_OF_RTDE),
    more=SETPOINTS,
    pendant_changes={
        'an operator pauses the program': _STAYS_PAUSED,
        'the network cable is cut': {'': {'steps': (*_PLUGGED_IN, 'play')}},
        'protective stop that the driver does not see': _NOT_ENTERED,
    },
)

WAITING = _mode(
    'Waiting for the arm',
    'The same set-points with `on_path_tolerance: STALL`; the arm is held off its path.',
    {'waiting': 'the motion stands on its path, until the arm is back'},
    2.5,
    {},
    faults=(
        'protective stop',
        'emergency stop',
        'an operator stops the program',
        'an operator pauses the program',
        'the speed slider is moved to 0',
        'the network cable is cut',
        'RTDE is cut',
        'the reverse socket is half-open',
        'the node is silent',
    ),
    pendant=('protective stop',),
)

PATH_OFFSET = _mode(
    'Path offset',
    'The same set-points with `path_offset`; an offset has moved the tool 2 mm to the side. '
    'Whatever ends the goal, the arm brakes where it is, beside the path; a pause and the slider '
    'keep it there.',
    {'beside its path': 'between the points, the path has given way'},
    1.8,
    {},
    faults=(
        'protective stop',
        'an operator pauses the program',
        'the speed slider is moved to 0',
        'the network cable is cut',
        'the pose is measured 6 mm off',
        'the node is silent',
    ),
    pendant=('protective stop',),
)

PATH_OFFSET_MOVES = _mode(
    'Path offset, PRIMITIVES',
    'A line with `path_offset`; an offset has moved the tool 2 mm to the side, by the path offset '
    'of the controller. Whatever ends the goal, the arm brakes where it is, beside the path; a '
    'pause and the slider keep it there.',
    {'beside its path': 'on the line, the path has given way'},
    2.2,
    {},
    faults=(
        'protective stop',
        'an operator pauses the program',
        'an operator stops the program',
        'the speed slider is moved to 0',
        'the network cable is cut',
        'RTDE is cut',
        'the pose is measured 6 mm off',
        'the node is silent',
    ),
    pendant=('protective stop',),
)

FEED_OVERRIDE = _mode(
    'Feed override',
    'The SPLINE goal with `feed_override`, at half its speed because its signal has ended. The '
    "speed slider is nobody's but the person's at every end.",
    {'without signal': 'between the points, at the lower bound'},
    2.5,
    {},
    faults=(
        'protective stop',
        'emergency stop',
        'an operator stops the program',
        'an operator pauses the program',
        'the speed slider is moved to 0',
        'the network cable is cut',
        'RTDE is cut',
        'the reverse socket is half-open',
        'the pose is measured 6 mm off',
        'the node is silent',
    ),
    pendant=('protective stop',),
)

FEED_OVERRIDE_SERVO = _mode(
    'Feed override, SERVO',
    'The same by set-points.',
    {'without signal': 'between the points, at the lower bound'},
    2.5,
    {},
    faults=(
        'protective stop',
        'an operator pauses the program',
        'the speed slider is moved to 0',
        'the network cable is cut',
        'RTDE is cut',
        'the pose is measured 6 mm off',
        'the node is silent',
    ),
    pendant=('protective stop',),
)

OUTPUTS = _mode(
    'Outputs',
    'PRIMITIVES with two blends; one output switches in the second blend, another one 0.6 s '
    'after the end, and an analog one follows the speed between the first point and the last. '
    'When a goal does not succeed, pending outputs are switched off, but not on; the analog one '
    'is idle after every end, and in a pause.',
    {
        'before the trigger pose': 'before the output at the second blend',
        'before the time': 'the arm is at rest at the last point, an output is pending',
        'cancelling': 'CANCEL is on the wire, the arm still moves',
    },
    2.0,
    {
        'the speed slider is moved to 0': {
            'before the time': {'waits': False, 'steps': ('move the slider up',)}
        }
    },
    faults=WITH_POINTS,
    pendant=('protective stop', 'an operator pauses the program'),
)

PULSES = _mode(
    'Pulses',
    'PRIMITIVES with two blends, pulses every 10 mm from the first point to the last, and an '
    'output that switches 0.05 s ahead of a place on the last side. When a goal does not '
    'succeed, the pulse that is on ends, no pulse follows, and that output is not switched on; '
    'a pause ends the pulse, too, and the others come when the program goes on.',
    {
        'a pulse is on': 'between the blends, the output of the pulses is on',
        'between pulses': 'between the blends, it is off',
        'cancelling': 'CANCEL is on the wire, the arm still moves',
    },
    2.0,
    {},
    faults=WITH_POINTS,
    pendant=('protective stop', 'an operator pauses the program'),
)

AT_A_POINT = _mode(
    'At a point',
    'PRIMITIVES with a `dwell` and an `input_waits` entry, whose input comes 0.4 s after the '
    'fault. Whatever ends the goal ends rest and wait, and nothing moves then.',
    {
        'resting': 'the arm rests at the first point',
        'waiting for an input': 'the arm rests at the second point, the input has not come',
    },
    3.0,
    # Nothing shows that the end was lost: the arm stands there for two seconds.
    {
        fault: {'': {'result_within': 5.0, 'rest_within': 3.0}}
        for fault in ("the program's answers are lost", 'the trajectory socket is half-open')
    },
    faults=WITH_POINTS,
    pendant=('protective stop', 'an operator pauses the program'),
)

SERVO_AT_A_POINT = _mode(
    'At a point, SERVO',
    'Set-points with a `dwell`, in which they stay the same.',
    {'resting': 'the arm rests at the first point'},
    2.0,
    {},
    faults=(
        'protective stop',
        'an operator pauses the program',
        'the network cable is cut',
        'the node is silent',
    ),
    pendant=('protective stop',),
    continued=(),
)

ROUNDED_CORNERS = _mode(
    'Rounded corners',
    'SPLINE around rounded corners, with the outputs of the square with blends, which behave as '
    'there.',
    {
        'in a corner': 'in the first corner',
        'before the trigger pose': 'between the corners, before the output at the second one',
        'cancelling': 'CANCEL is on the wire, the arm still moves',
    },
    3.0,
    {},
    faults=WITH_POINTS,
    pendant=('protective stop', 'an operator pauses the program'),
)

HELD_PART = _mode(
    'A part in the hand',
    'The same, with the path on a part that the arm leads along a tool that stands.',
    ROUNDED_CORNERS.phases,
    3.0,
    {},
    faults=WITH_POINTS,
    pendant=('protective stop', 'an operator pauses the program'),
)

SERVO_OUTPUTS = _mode(
    'Outputs, SERVO',
    'Set-points around rounded corners, with an output at the second corner, one after the end, '
    'and an analog one that follows the speed. What becomes of them is as in PRIMITIVES.',
    {
        'before the trigger pose': 'before the output at the second corner',
        'before the time': 'the arm is at rest at the last point, an output is pending',
        'cancelling': 'the driver has left the mode of set-points, the arm still moves',
    },
    3.0,
    {
        'an operator pauses the program': _STAYS_PAUSED,
        'the network cable is cut': {'': {'steps': (*_PLUGGED_IN, 'resend')}},
        'the speed slider is moved to 0': {
            'before the time': {'waits': False, 'steps': ('move the slider up',)}
        },
        # servoj creeps up to the last set-point for a second before the arm stands for two.
        **{
            fault: {
                '': {'result_within': 6.0, 'rest_within': 3.0},
                # The registers also show that the program has left the set-points.
                'cancelling': {'state_after': S.READY},
            }
            for fault in ("the program's answers are lost", 'the trajectory socket is half-open')
        },
    },
    faults=(
        'protective stop',
        'emergency stop',
        'an operator stops the program',
        'an operator pauses the program',
        'the speed slider is moved to 0',
        'the network cable is cut',
        "the program's sockets are cut",
        "the program's answers are lost",
        'the trajectory socket is half-open',
        'the node is silent',
    ),
    pendant=('protective stop',),
    continued=(),
)

SERVO_WAITS = _mode(
    'Waits, SERVO',
    'Set-points that are held while the robot program waits for an input, which comes 0.4 s after '
    'the fault.',
    {'waiting for an input': 'the arm rests at the second point, the input has not come'},
    4.0,
    {'the network cable is cut': {'': {'steps': (*_PLUGGED_IN, 'resend')}}},
    faults=(
        'protective stop',
        'an operator stops the program',
        'an operator pauses the program',
        'the network cable is cut',
        'the node is silent',
    ),
    pendant=('protective stop',),
    continued=(),
)

SCRIPTS = replace(
    _mode(
        'Scripts',
        'PRIMITIVES that call a function of the `script_prelude` at a point, which returns 0.4 s '
        'after the fault. Whatever ends the goal ends the function; what it has switched stays, '
        'but for `safe_outputs`. A paused program that is played goes on in it until it reads '
        'the message that ends it.',
        {'in a function': 'the arm rests at the second point, the function has not returned'},
        2.0,
        {},
        faults=(
            'protective stop',
            'emergency stop',
            'an operator stops the program',
            'an operator pauses the program',
            'the network cable is cut',
            "the program's sockets are cut",
            'the node is silent',
        ),
        pendant=('protective stop',),
        continued=(),
        more=(
            Row(
                fault='a client runs a secondary script (`~/run_script`)',
                cause=('script sec other(): set_tool_digital_out(1, True) end',),
                code=E.SUCCESSFUL,
                result_within=2.0,
                rest_within=2.0,
            ),
            Row(
                fault='a client runs a primary script, which is refused',
                cause=('script def other(): set_tool_digital_out(1, True) end',),
                code=E.SUCCESSFUL,
                result_within=2.0,
                rest_within=2.0,
            ),
        ),
    ),
    settings={'allow_scripts': True, 'script_prelude': str(PRELUDE)},
)

PRESS = _mode(
    'Press',
    'PRIMITIVES that press on a table with the force mode of the controller. Whatever ends the '
    'goal ends force mode; in local control a paused program keeps it until it is played.',
    {'pressing': 'the tool presses, and moves along the table'},
    2.0,
    {},
    faults=(
        'protective stop',
        'emergency stop',
        'an operator stops the program',
        'an operator pauses the program',
        'the network cable is cut',
        'RTDE is cut',
        "the program's sockets are cut",
        'the node is silent',
    ),
    pendant=('protective stop',),
    continued=(),
)

APPEND = _mode(
    'Appendable goals',
    'A goal that is appended to while it runs (`keep_open`); the last points are appended '
    'after the fault.',
    {
        'moving': 'on the path, more points are expected',
        'running out': 'no points came in time, the arm decelerates after the last one',
        'awaiting points': 'the arm is at rest, the goal waits for more points',
        'cancelling': 'CANCEL is on the wire, the arm still moves',
    },
    2.5,
    {},
    faults=tuple(
        name
        for name in FAULTS
        if name
        not in (
            'emergency stop',
            "another client's program replaces ours",
            'the controller crashes',
            "the program's sockets are cut",
        )
    ),
)

REPLACED_TAILS = _mode(
    'Replaced tails',
    'The same as set-points (SERVO). After a fault while the arm moves the tail is replaced, '
    'after one behind the last known point the last point is appended.',
    {
        'moving': 'on the path, before the part that is replaced',
        'running out': 'the set-points decelerate behind the last known point',
        'awaiting points': 'the arm is at rest, the goal waits for more points',
    },
    2.5,
    {'the network cable is cut': {'': {'steps': (*_PLUGGED_IN, 'resend')}}},
    faults=(
        'protective stop',
        'an operator stops the program',
        'an operator pauses the program',
        'the speed slider is moved to 0',
        'the network cable is cut',
        'RTDE is cut',
        'the pose is measured 6 mm off',
        'the node is silent',
    ),
    pendant=('protective stop',),
)

FREEDRIVE = replace(
    _mode(
        'Freedrive',
        'No goal, but the same faults end it: `~/freedrive_mode` lets a person guide the arm. '
        '"At rest": the arm cannot be moved by hand any more.',
        {'freedrive': 'a person may guide the arm'},
        0.0,
        {},
        faults=(
            'protective stop',
            'emergency stop',
            'an operator stops the program',
            'the network cable is cut',
            'protective stop that the driver does not see',
            'RTDE is cut',
            'RTDE carries less data than needed',
            "the program's sockets are cut",
            'the reverse socket is half-open',
            'the node is silent',
        ),
        pendant=('protective stop', 'the network cable is cut'),
        continued=(),
        more=tuple(row for row in SETPOINTS if not row.phases and row.code is not E.SUCCESSFUL),
    ),
    settings={'allow_freedrive': True},
)

MODES = (
    SPLINE,
    SERVO,
    WAITING,
    PATH_OFFSET,
    PATH_OFFSET_MOVES,
    FEED_OVERRIDE,
    FEED_OVERRIDE_SERVO,
    APPEND,
    REPLACED_TAILS,
    OUTPUTS,
    PULSES,
    AT_A_POINT,
    SERVO_AT_A_POINT,
    ROUNDED_CORNERS,
    HELD_PART,
    SERVO_OUTPUTS,
    SERVO_WAITS,
    SCRIPTS,
    PRESS,
    FREEDRIVE,
)
