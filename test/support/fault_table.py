# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Outcomes of goals that a fault hits: the table of the fault matrix.

One row for each fault. The tests run each row in each phase of a goal, and ``doc/faults.md`` is
made from it by ``scripts/make_faults.py``. Times are [s].
"""

from dataclasses import dataclass, field, replace
from typing import Any

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.robot.lifecycle import ConnectionState

E, S = ErrorCode, ConnectionState

#: Phases of a goal in which the fault happens.
PHASES = {
    'idle': 'no goal runs; one is sent 0.1 s after the fault',
    'planning': 'the goal is planned; it is sent to the robot one cycle after the fault',
    'arming': 'START is on the wire, the robot program has not begun the first point',
    'first point': 'on the segment to the first of three points',
    'mid-segment': 'on the straight part of the second segment',
    'in a blend': 'in the blend at the first point',
    'last point': 'on the second half of the last segment',
    'settling': 'the robot program has reported the end, the arm is outside the goal tolerance',
    'cancelling': 'CANCEL is on the wire, the arm still moves',
}
BEFORE = ('idle', 'planning')
MOVING = ('arming', 'first point', 'mid-segment', 'in a blend', 'last point')


@dataclass(frozen=True, kw_only=True)
class Row:
    """One fault, and the required behaviour of goal, robot and driver."""

    #: Name of the fault on the page and in tests.
    fault: str
    #: Faults to inject: texts for the simulator, or names that fault_cell knows.
    cause: tuple[str, ...]
    #: Result of the goal.
    code: ErrorCode
    #: Longest time from the fault, or from sending the goal if later, to the result.
    result_within: float = 0.3
    #: Longest time from the fault until the arm is at rest.
    rest_within: float = 0.5
    #: Whether the goal pauses, and resumes after the steps.
    waits: bool = False
    #: State of the connection after the end of the goal, before the steps.
    state_after: ConnectionState = S.READY
    #: Longest time until that state.
    state_within: float = 0.3
    #: Steps of an operator until the next goal can run.
    steps: tuple[str, ...] = ()
    #: Longest time from the last step until the driver is ready.
    ready_within: float = 1.5
    #: Largest joint travel during the steps [rad].
    travel: float = 0.0
    #: The only phases that are tested; empty = all.
    phases: tuple[str, ...] = ()
    #: Other values of fields in some phases: phase -> field -> value.
    differs: dict[str, dict[str, Any]] = field(default_factory=dict)

    def at(self, phase: str) -> 'Row':
        """Return the expected outcome in a phase."""
        return replace(self, differs={}, **self.differs.get(phase, {}))


def _in(phases: tuple[str, ...], **changes: Any) -> dict[str, dict[str, Any]]:
    return dict.fromkeys(phases, changes)


#: The driver knows that the robot cannot take a goal.
REFUSED = _in(BEFORE, code=E.ROBOT_NOT_READY)
CANCELLED = _in(('cancelling',), code=E.CANCELLED)


#: Times of a goal that the fault does not disturb.
UNDISTURBED: dict[str, Any] = {'result_within': 1.2, 'rest_within': 1.2}
POWER_UP = ('power on', 'release the brakes')


def _safety(fault: str, cause: str, code: ErrorCode, *steps: str, play: bool = True) -> Row:
    """Return the row of a stop by the safety system; ``play``: the stop pauses the program."""
    before = {'code': E.ROBOT_NOT_READY} | ({'steps': (*steps, 'play')} if play else {})
    return Row(
        fault=fault,
        cause=(cause,),
        code=code,
        state_after=S.STOPPED,
        steps=(*steps, 'play', 'resend'),
        differs=_in(BEFORE, **before),
    )


def _harmless(fault: str, *cause: str, steps: tuple[str, ...] = ()) -> Row:
    return Row(
        fault=fault,
        cause=cause,
        code=E.SUCCESSFUL,
        **UNDISTURBED,
        steps=steps,
        differs=_in(('cancelling',), code=E.CANCELLED, result_within=0.7, rest_within=0.7),
    )


def _hangs_up(fault: str, cause: str) -> Row:
    return Row(
        fault=fault,
        cause=(cause,),
        code=E.PROGRAM_STOPPED,
        state_after=S.CONNECTED,
        steps=('resend',),
        differs=REFUSED,
    )


#: When the program resumes, it reads that its goal has ended.
UNSEEN_STOP = Row(
    fault='protective stop that the driver does not see',
    cause=('drop rtde for 0.3 s', 'protective_stop'),
    code=E.CONNECTION_LOST,
    state_after=S.STOPPED,
    state_within=1.5,
    steps=('unlock', 'play'),
    differs=REFUSED,
)

#: During a goal this is refused; without a goal the program ends.
HANDED_BACK = Row(
    fault='a client hands the control back (`~/hand_back_control`)',
    cause=('hand back',),
    code=E.SUCCESSFUL,
    **UNDISTURBED,
    phases=('idle', 'mid-segment'),
    differs={
        'idle': {
            'code': E.ROBOT_NOT_READY,
            'result_within': 0.3,
            'rest_within': 0.5,
            'state_after': S.CONNECTED,
            'steps': ('resend',),
        }
    },
)

#: The driver's own thread finds the collision, some tens of milliseconds after the call.
IN_THE_WAY = Row(
    fault='a body of the cell comes into the way of what is left (`~/change_cell`)',
    cause=('body in the way',),
    code=E.COLLISION,
    result_within=0.7,
    rest_within=0.7,
    phases=(*MOVING, 'cancelling'),
    differs={'cancelling': {'code': E.CANCELLED}},
)

#: States come ever later, and so does the state that shows the arm at rest.
CONGESTED = Row(
    fault='RTDE carries less data than needed',
    cause=('throttle rtde 20000',),
    code=E.CONNECTION_LOST,
    result_within=2.3,
    rest_within=0.7,
    state_after=S.CONNECTED,
    steps=('wait until the fault ends',),
    differs=CANCELLED,
)

#: A stopped program never runs again by itself, even if another client unlocks or plays.
HEADLESS = (
    _safety('protective stop', 'protective_stop', E.PROTECTIVE_STOP, 'unlock'),
    _safety('safeguard stop', 'safeguard_stop', E.PROTECTIVE_STOP, 'reset the safeguard'),
    _safety('emergency stop', 'emergency_stop', E.EMERGENCY_STOP, 'release the button', *POWER_UP),
    _safety(
        'violation of a safety limit',
        'violation',
        E.PROTECTIVE_STOP,
        'restart safety',
        *POWER_UP,
        play=False,
    ),
    _safety(
        'fault of the safety system',
        'fault',
        E.PROTECTIVE_STOP,
        'restart safety',
        *POWER_UP,
        play=False,
    ),
    Row(
        fault='an operator stops the program',
        cause=('stop',),
        code=E.PROGRAM_STOPPED,
        state_after=S.CONNECTED,
        steps=('play', 'resend'),
        differs=REFUSED,
    ),
    Row(
        fault='an operator switches the arm off',
        cause=('power_off',),
        code=E.PROGRAM_STOPPED,
        state_after=S.CONNECTED,
        steps=(*POWER_UP, 'play', 'resend'),
        differs=REFUSED,
    ),
    HANDED_BACK,
    IN_THE_WAY,
    Row(
        fault="another client's program replaces ours",
        cause=('foreign_motion z 0.02',),
        code=E.PROGRAM_STOPPED,
        state_after=S.CONNECTED,
        rest_within=2.0,
        steps=('resend',),
        differs=REFUSED,
    ),
    Row(
        fault='an operator pauses the program',
        cause=('pause',),
        code=E.SUCCESSFUL,
        waits=True,
        steps=('play',),
        differs=_in(BEFORE, code=E.ROBOT_NOT_READY, waits=False, state_after=S.CONNECTED)
        | {
            'cancelling': {
                'code': E.CANCELLED,
                'waits': False,
                'result_within': 3.3,
                'state_after': S.CONNECTED,
                'steps': ('play', 'resend'),
            }
        },
    ),
    Row(
        fault='the speed slider is moved to 0',
        cause=('slider 0',),
        code=E.SUCCESSFUL,
        waits=True,
        steps=('move the slider up',),
        differs={'cancelling': {'code': E.CANCELLED, 'waits': False}},
    ),
    _harmless(
        'play and unlock while nothing is stopped',
        'play',
        'unlock',
        'reset_safeguard',
        'release_emergency_stop',
    ),
    _harmless(
        'another client sets motion version 2 (blends are reduced, ramps are longer)',
        'motion_version 2',
    ),
    Row(
        fault='the controller crashes',
        cause=('crash',),
        code=E.CONNECTION_LOST,
        state_after=S.DISCONNECTED,
        steps=('start the controller', *POWER_UP, 'resend'),
        differs=REFUSED,
    ),
    Row(
        fault='the network cable is cut',
        cause=('freeze all',),
        code=E.CONNECTION_LOST,
        result_within=1.3,
        rest_within=0.7,
        state_after=S.CONNECTED,
        state_within=1.3,
        steps=('wait for the robot', 'resend'),
    ),
    *(
        Row(
            fault=f'all connections are cut for 0.1 s, {first} first',
            cause=tuple(f'drop {name} for 0.1 s' for name in order),
            code=E.CONNECTION_LOST,
            state_after=S.CONNECTED,
            state_within=1.0,
            steps=('resend',),
            differs=REFUSED,
        )
        for first, order in (
            ('RTDE', ('rtde', 'primary', 'sockets')),
            ('the program', ('sockets', 'primary', 'rtde')),
        )
    ),
    UNSEEN_STOP,
    Row(
        fault='protective stop while the primary interface is down',
        cause=('drop primary for 0.5 s', 'protective_stop'),
        code=E.PROTECTIVE_STOP,
        state_after=S.STOPPED,
        steps=('unlock', 'play', 'wait until the fault ends', 'resend'),
        differs=_in(BEFORE, code=E.ROBOT_NOT_READY, steps=('unlock', 'play')),
    ),
    Row(fault='RTDE is cut', cause=('drop rtde',), code=E.CONNECTION_LOST, differs=REFUSED),
    Row(
        fault='RTDE is half-open',
        cause=('half_open rtde',),
        code=E.CONNECTION_LOST,
        result_within=1.3,
        rest_within=0.6,
        state_after=S.CONNECTED,
        ready_within=2.5,
    ),
    Row(
        fault='RTDE is silent for 1.5 s',
        cause=('silence rtde for 1.5 s',),
        code=E.CONNECTION_LOST,
        result_within=1.6,
        rest_within=0.6,
        state_after=S.DISCONNECTED,
        state_within=1.3,
        ready_within=4.0,
    ),
    _harmless('RTDE is 0.1 s late', 'delay rtde 0.1 s', steps=('wait until the fault ends',)),
    CONGESTED,
    Row(
        fault='RTDE carries almost no data',
        cause=('throttle rtde 300',),
        code=E.CONNECTION_LOST,
        result_within=2.3,
        rest_within=0.6,
        state_after=S.DISCONNECTED,
        state_within=2.5,
        steps=('wait until the fault ends',),
        ready_within=4.0,
    ),
    Row(
        fault='garbage on RTDE',
        cause=('garbage rtde 64',),
        code=E.CONNECTION_LOST,
        result_within=2.0,
        rest_within=2.0,
        state_after=S.CONNECTED,
        state_within=2.5,
        ready_within=2.5,
    ),
    _harmless('the primary interface is cut', 'drop primary'),
    _harmless('the primary interface is half-open', 'half_open primary'),
    _harmless(
        'the primary interface is silent', 'silence primary', steps=('wait until the fault ends',)
    ),
    _harmless(
        'the primary interface is late and slow',
        'delay primary 0.1 s',
        'throttle primary 1000',
        steps=('wait until the fault ends',),
    ),
    _harmless('garbage on the primary interface', 'garbage primary 64'),
    _harmless(
        'all other interfaces are cut',
        'drop secondary',
        'drop realtime',
        'drop dashboard',
        'drop interpreter',
    ),
    _hangs_up("the program's sockets are cut", 'drop sockets'),
    Row(
        fault="the program's sockets are half-open",
        cause=('half_open sockets',),
        code=E.PROGRAM_STOPPED,
        result_within=0.7,
        rest_within=0.7,
        state_after=S.CONNECTED,
        steps=('resend',),
    ),
    Row(
        fault="the program's answers are lost",
        cause=('silence sockets',),
        code=E.EXECUTION_FAILED,
        result_within=3.5,
        rest_within=1.2,
        state_after=S.CONNECTED,
        steps=('wait until the fault ends', 'resend'),
        differs={
            'settling': {
                'code': E.SUCCESSFUL,
                'state_after': S.READY,
                'steps': ('wait until the fault ends',),
            },
            'cancelling': {'code': E.CANCELLED},
        },
    ),
    _harmless(
        "the program's sockets are 0.05 s late",
        'delay sockets 0.05 s',
        steps=('wait until the fault ends',),
    ),
    _harmless(
        "the program's sockets carry 2500 bytes/s",
        'throttle sockets 2500',
        steps=('wait until the fault ends',),
    ),
    _hangs_up("garbage on the program's sockets", 'garbage sockets 64'),
    *(
        _hangs_up(f'the {name} socket is cut', f'cut {name}')
        for name in ('reverse', 'trajectory', 'script command')
    ),
    Row(
        fault='the reverse socket is half-open',
        cause=('freeze reverse',),
        code=E.PROGRAM_STOPPED,
        result_within=0.7,
        rest_within=0.7,
        state_after=S.CONNECTED,
        steps=('resend',),
        differs=CANCELLED | {'last point': {'code': E.SUCCESSFUL}},
    ),
    Row(
        fault='the trajectory socket is half-open',
        cause=('freeze trajectory',),
        code=E.EXECUTION_FAILED,
        # If the arm brakes off its path, the driver tells it to stop, and it has 3 s to answer.
        result_within=3.6,
        rest_within=1.2,
        state_after=S.CONNECTED,
        steps=('resend',),
        differs={
            'settling': {'code': E.SUCCESSFUL, 'state_after': S.READY},
            'cancelling': {'code': E.CANCELLED},
        },
    ),
    replace(
        _harmless('the script command socket is half-open', 'freeze script command'),
        steps=('resend',),
        # Here the safe values of outputs are sent and confirmed.
        differs=_in(BEFORE, code=E.ROBOT_NOT_READY, result_within=1.7, rest_within=1.7)
        | _in(('cancelling',), code=E.CANCELLED, result_within=0.9, rest_within=0.7),
    ),
    Row(
        fault='the pose is measured 6 mm off',
        cause=('offset pose z 0.006',),
        code=E.PATH_TOLERANCE_VIOLATED,
        result_within=0.7,
        steps=('wait until the fault ends',),
        differs=CANCELLED
        | {'settling': {'code': E.GOAL_TOLERANCE_VIOLATED, 'result_within': 1.7}},
    ),
    Row(
        fault='the measured pose drifts off',
        cause=('ramp pose z 0.1',),
        code=E.PATH_TOLERANCE_VIOLATED,
        result_within=0.7,
        rest_within=0.7,
        steps=('wait until the fault ends',),
        differs=CANCELLED
        | {'settling': {'code': E.GOAL_TOLERANCE_VIOLATED, 'result_within': 1.7}},
    ),
    _harmless(
        'the pose is measured with noise of 0.1 mm',
        'noise pose z 0.0001',
        steps=('wait until the fault ends',),
    ),
    Row(
        fault='the twist is measured 0.5 m/s off for 0.3 s',
        cause=('offset twist z 0.5 for 0.3 s',),
        code=E.PATH_TOLERANCE_VIOLATED,
        result_within=0.7,
        differs=CANCELLED
        | {'settling': {'code': E.GOAL_TOLERANCE_VIOLATED, 'result_within': 1.7}},
    ),
    Row(
        fault='the node is silent',
        cause=('silent owner',),
        code=E.CANCELLED,
        result_within=0.9,
        rest_within=1.0,
        steps=('wait until the fault ends',),
        differs={'last point': {'code': E.SUCCESSFUL}},
    ),
)


#: Rows with ``on_robot_stop: continue``: the robot resumes the goal by itself.
CONTINUED = tuple(
    Row(
        fault=fault,
        cause=(cause,),
        code=E.SUCCESSFUL,
        waits=True,
        steps=(step, 'play'),
        differs=_in(BEFORE, code=E.ROBOT_NOT_READY, waits=False, state_after=S.STOPPED)
        | {
            'cancelling': {
                'code': E.CANCELLED,
                'waits': False,
                'result_within': 3.3,
                'state_after': S.STOPPED,
                'steps': (step, 'play', 'resend'),
            }
        },
    )
    for fault, cause, step in (
        ('protective stop', 'protective_stop', 'unlock'),
        ('safeguard stop', 'safeguard_stop', 'reset the safeguard'),
    )
)


def _paused_by(fault: str, cause: str, code: ErrorCode, *steps: str) -> Row:
    """
    Return the row of a stop that pauses a program on the pendant.

    The interface takes no 'stop program', so a play resumes the old motion until the program reads
    the message that ends the motion; then the program has to be played again.
    """
    return Row(
        fault=fault,
        cause=(cause,),
        code=code,
        state_after=S.STOPPED,
        travel=0.001,
        steps=(*steps, 'play', 'play'),
        differs=_in(BEFORE, code=E.ROBOT_NOT_READY, steps=(*steps, 'play'), travel=0.0)
        | {'settling': {'travel': 0.0}},
    )


LOCAL = (
    _paused_by('protective stop', 'protective_stop', E.PROTECTIVE_STOP, 'unlock'),
    _paused_by('safeguard stop', 'safeguard_stop', E.PROTECTIVE_STOP, 'reset the safeguard'),
    _paused_by(
        'emergency stop', 'emergency_stop', E.EMERGENCY_STOP, 'release the button', *POWER_UP
    ),
    UNSEEN_STOP,
    Row(
        fault='an operator stops the program',
        cause=('stop',),
        code=E.PROGRAM_STOPPED,
        state_after=S.CONNECTED,
        steps=('play',),
        differs=REFUSED,
    ),
    replace(
        HANDED_BACK,
        differs=_in(('idle',), **HANDED_BACK.differs['idle'] | {'steps': ('play',)}),
    ),
    Row(
        fault='an operator pauses the program',
        cause=('pause',),
        code=E.SUCCESSFUL,
        waits=True,
        steps=('play',),
        differs=_in(BEFORE, code=E.ROBOT_NOT_READY, waits=False, state_after=S.CONNECTED)
        | {
            'cancelling': {
                'code': E.CANCELLED,
                'waits': False,
                'result_within': 3.3,
                'travel': 0.001,
                'state_after': S.CONNECTED,
                'steps': ('play', 'play'),
            }
        },
    ),
    Row(
        fault='the network cable is cut',
        cause=('freeze all',),
        code=E.CONNECTION_LOST,
        result_within=1.3,
        rest_within=0.7,
        state_after=S.CONNECTED,
        state_within=1.3,
        steps=('wait for the robot', 'play'),
    ),
    Row(
        fault="the program's sockets are cut",
        cause=('drop sockets',),
        code=E.PROGRAM_STOPPED,
        state_after=S.CONNECTED,
        steps=('play',),
        differs=REFUSED,
    ),
)
