# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Every command of the dashboard: its answer, and the software that has it."""

from __future__ import annotations

from collections.abc import Callable
import re
from typing import Any

import pytest

from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.protocol.dashboard import COMMAND_SPECS
from ur_cartesian_driver.sim.controller_assembly import assemble
from ur_cartesian_driver.sim.interfaces.dashboard_session import DashboardSession
from ur_cartesian_driver.sim.interfaces.tcp_server import HangUp
from ur_cartesian_driver.sim.simulator_config import SimulatorConfig
from ur_cartesian_driver.sim.state.power_and_safety import SafetyEvent

#: Command, the answer that the manufacturer's client library wants, and the minor versions of
#: PolyScope 3 and 5 from which on that library sends it; None: in none.
TABLE = [
    ('load a.urp', r'Loading program: .*a\.urp.*', 0, 0),
    ('play', r'Starting program', 0, 0),
    ('pause', r'Pausing program', 0, 0),
    ('stop', r'Stopped', 0, 0),
    ('quit', r'Disconnected', 0, 0),
    ('shutdown', r'Shutting down', 0, 0),
    ('power on', r'Powering on', 0, 0),
    ('power off', r'Powering off', 0, 0),
    ('brake release', r'Brake releasing', 0, 0),
    ('unlock protective stop', r'Protective stop releasing', 1, 0),
    ('close popup', r'closing popup', 0, 0),
    ('close safety popup', r'closing safety popup', 1, 0),
    ('restart safety', r'Restarting safety', 7, 1),
    ('running', r'Program running: (true|false)', 0, 0),
    ('robotmode', r'Robotmode: RUNNING', 0, 0),
    ('safetymode', r'Safetymode: NORMAL', 0, 0),
    ('safetystatus', r'Safetystatus: NORMAL', None, 4),
    ('get loaded program', r'Loaded program: .*a\.urp', 0, 0),
    ('programState', r'(STOPPED|PLAYING|PAUSED) a\.urp', 0, 0),
    ('isProgramSaved', r'(true|false) a\.urp', 0, 0),
    ('popup careful', r'showing popup', 0, 0),
    ('addToLog a line', r'Added log message', 0, 0),
    ('PolyscopeVersion', r'URSoftware \d+(\.\d+){1,3} \(.*', 0, 0),
    ('version', r'\d+(\.\d+){3}', None, 0),
    ('setUserRole operator', r'Setting user role: operator', 1, None),
    ('getUserRole', r'PROGRAMMER|OPERATOR|NONE|LOCKED|RESTRICTED', 1, None),
    ('set operational mode manual', r'Operational mode .*manual.*', None, 0),
    ('get operational mode', r'NONE|MANUAL|AUTOMATIC', None, 6),
    ('clear operational mode', r'No longer controlling the operational mode\. .*', None, 0),
    ('load installation default.installation', r'Loading installation: .*default.*', 2, 0),
    ('is in remote control', r'true|false', None, 6),
    ('get serial number', r'20\d+', 12, 6),
    ('get robot model', r'UR\d+', 12, 6),
    ('generate flight report system', r'Flight Report generated with id:.*', 13, 8),
    ('generate support file /programs', r'Completed successfully:.*', 13, 8),
    ('saveLog', r'Log saved to disk', 13, 8),
]
PROGRAM = 'def a():\n  while True:\n    sync()\n  end\nend\n'


class DashboardUser:
    """A session without sockets; a program is loaded."""

    def __init__(self, major: int, minor: int, **settings: Any) -> None:
        self.controller = assemble(
            SimulatorConfig(
                model='ur5' if major < 5 else 'ur5e',
                polyscope=f'{major}.{minor}',
                programs={'a.urp': PROGRAM},
                **settings,
            )
        ).controller
        self.session = DashboardSession(self.controller)
        self.ask('load a.urp')

    def ask(self, line: str) -> str:
        try:
            answer = self.session.feed(line.encode() + b'\n').decode()
            for _ in range(100):
                if answer:
                    break
                self.controller.step()
                answer = self.session.feed(b'').decode()
        except HangUp as hangup:
            answer = hangup.farewell.decode()
        assert answer.count('\n') == 1
        return answer.removesuffix('\n')

    def wait(self, seconds: float) -> None:
        for _ in range(round(seconds / self.controller.cycle)):
            self.controller.step()


def minors(column):
    return [(row[0], row[1], row[column]) for row in TABLE if row[column] is not None]


@pytest.mark.parametrize(
    ('major', 'command', 'answer', 'minor'),
    [*[(3, *row) for row in minors(2)], *[(5, *row) for row in minors(3)]],
)
def test_a_command_is_answered_from_its_version_on(major, command, answer, minor):
    user = DashboardUser(major, minor)
    if command == 'pause':
        user.ask('play')
        user.wait(0.1)
    assert re.fullmatch(answer, user.ask(command))
    if minor:
        # An older one may take `load installation` for the name of a program.
        before = DashboardUser(major, minor - 1).ask(command)
        assert before.startswith(('could not understand: ', 'File not found: installation '))


@pytest.mark.parametrize(
    ('major', 'command'),
    [
        *[(3, row[0]) for row in TABLE if row[2] is None],
        *[(5, row[0]) for row in TABLE if row[3] is None],
    ],
)
def test_a_series_that_never_had_a_command_does_not_understand_it(major, command):
    assert 'could not understand' in DashboardUser(major, 15).ask(command)


def test_the_table_is_complete():
    assert len({row[0] for row in TABLE}) == len(TABLE) == len(COMMAND_SPECS)
    for name, spec in COMMAND_SPECS.items():
        words = name + ' ' * spec.takes_argument
        assert any(row[0].startswith(words) for row in TABLE), name


@pytest.mark.parametrize(
    ('command', 'answer'),
    [
        ('load b.urp', 'File not found: b.urp'),
        ('load installation other.installation', 'File not found: other.installation'),
        ('pause', 'Failed to execute: pause'),
        ('addToLog', 'No log message to add'),
        ('set operational mode dancing', 'could not understand: "set operational mode dancing"'),
        ('play now', 'could not understand: "play now"'),
        ('', 'could not understand: ""'),
    ],
)
def test_what_cannot_be_done_is_said(command, answer):
    assert DashboardUser(5, 21).ask(command) == answer


@pytest.mark.parametrize(
    ('command', 'answer'),
    [
        ('polyscopeVersion', 'URSoftware 5.21.0.0 (Jan 01 2026)'),
        ('Load A.urp', 'File not found: A.urp'),
        ('ROBOTMODE', 'Robotmode: RUNNING'),
        ('Pause', 'Failed to execute: pause'),
        ('popup Hold ON', 'showing popup'),
    ],
)
def test_capital_letters_make_no_difference_in_commands(command, answer):
    user = DashboardUser(5, 21)
    assert user.ask(command) == answer
    assert [popup.text for popup in user.controller.popups] in ([], ['Hold ON'])


def test_the_name_of_a_program_may_stand_in_quotation_marks():
    assert 'a.urp' in DashboardUser(5, 21).ask('load "a.urp"')
    assert DashboardUser(5, 21).ask('load "b c.urp"') == 'File not found: b c.urp'


@pytest.mark.parametrize('command', ['load a.urp', 'play', 'stop', 'power off', 'brake release'])
def test_in_local_control_commands_are_refused_until_the_client_reconnects(command):
    # Several issues of the drivers for ROS quote these words of robots.
    refusal = (
        'Command is not allowed due to safety reasons, please switch robot to Remote Control '
        'mode and reconnect to port 29999'
    )
    user = DashboardUser(5, 21, remote_control=False)
    assert user.ask(command) == refusal
    assert user.ask('robotmode') == 'Robotmode: RUNNING'
    assert user.ask('is in remote control') == 'false'
    user.controller.remote_control = True
    assert user.ask(command) == refusal
    user.session = DashboardSession(user.controller)
    assert user.ask(command) != refusal


def test_manual_mode_ends_remote_control():
    # The user manual of PolyScope X says so; a client of URSim quotes the answer to `clear`.
    user = DashboardUser(5, 21)
    assert user.ask('is in remote control') == 'true'
    user.ask('set operational mode AUTOMATIC')
    assert user.ask('get operational mode') == 'AUTOMATIC'
    assert user.ask('is in remote control') == 'true'
    user.ask('set operational mode MANUAL')
    assert user.ask('get operational mode') == 'MANUAL'
    assert user.ask('is in remote control') == 'false'
    assert user.ask('play').startswith('Command is not allowed')
    assert user.ask('clear operational mode') == (
        "No longer controlling the operational mode. Current operational mode: 'NONE'."
    )
    assert user.ask('get operational mode') == 'NONE'
    assert user.ask('is in remote control') == 'false'


@pytest.mark.parametrize('command', ['power on', 'brake release', 'play'])
def test_an_arm_in_emergency_stop_refuses(command):
    user = DashboardUser(5, 21)
    user.controller.safety_event(SafetyEvent.EMERGENCY_STOP)
    user.wait(0.1)
    assert user.ask(command) == f'Failed to execute: {command}'
    assert user.ask('safetystatus') == 'Safetystatus: ROBOT_EMERGENCY_STOP'


def test_what_clients_poll_for_comes_true():
    user = DashboardUser(5, 21, power='off')
    user.ask('power on')
    user.wait(1.0)
    assert user.ask('robotmode') == 'Robotmode: IDLE'
    assert user.ask('power on') == 'Powering on'
    user.ask('brake release')
    user.wait(1.0)
    assert user.ask('robotmode') == 'Robotmode: RUNNING'
    for command, state in [
        ('play', 'PLAYING'),
        ('pause', 'PAUSED'),
        ('play', 'PLAYING'),
        ('stop', 'STOPPED'),
    ]:
        user.ask(command)
        user.wait(0.1)
        assert user.ask('programState') == f'{state} a.urp'
        assert user.ask('running') == f'Program running: {str(state != "STOPPED").lower()}'
    user.ask('power off')
    assert user.ask('robotmode') == 'Robotmode: POWER_OFF'


@pytest.mark.parametrize(
    ('command', 'answer'), [('stop', 'Stopped\nSTOPPED'), ('pause', 'Pausing program\nPAUSED')]
)
def test_a_stop_and_a_pause_are_answered_when_they_are_completed(command, answer):
    """The next command waits for its turn."""
    user = DashboardUser(5, 21)
    user.ask('play')
    user.wait(0.1)
    assert user.session.feed(f'{command}\nprogramState\nrobotmode\n'.encode()) == b''
    user.wait(0.1)
    done = f'{answer} a.urp\nRobotmode: RUNNING\n'
    assert user.session.feed(b'').decode() == done
    assert user.session.feed(b'') == b''


def test_a_program_is_loaded_when_it_has_been_compiled_beside_the_cycles():
    user = DashboardUser(5, 21)
    jobs: list[Callable[[], None]] = []

    def aside(work, then):
        jobs.append(lambda: then(work()))

    user.controller.programs.compile_aside = aside
    assert user.session.feed(b'load b.urp\nload a.urp\nget loaded program\n') == (
        b'File not found: b.urp\n'
    )
    user.wait(0.1)
    assert user.session.feed(b'') == b''
    (job,) = jobs
    job()
    assert user.session.feed(b'').decode() == (
        'Loading program: a.urp\nLoaded program: /programs/a.urp\n'
    )


def test_a_protective_stop_is_unlocked_after_five_seconds_and_leaves_the_program_paused():
    user = DashboardUser(5, 21)
    user.ask('play')
    user.wait(0.1)
    user.controller.safety_event(SafetyEvent.PROTECTIVE_STOP)
    user.wait(4.0)
    assert user.ask('unlock protective stop').startswith('Cannot unlock protective stop until 5s')
    assert user.ask('safetymode') == 'Safetymode: PROTECTIVE_STOP'
    user.wait(1.5)
    assert user.ask('unlock protective stop') == 'Protective stop releasing'
    assert user.ask('safetymode') == 'Safetymode: NORMAL'
    assert user.ask('robotmode') == 'Robotmode: RUNNING'
    assert user.controller.programs.state is RuntimeState.PAUSED


def test_a_violation_is_left_by_restarting_safety_without_power():
    user = DashboardUser(5, 21)
    user.controller.safety_event(SafetyEvent.VIOLATION)
    assert user.ask('safetystatus') == 'Safetystatus: VIOLATION'
    assert user.ask('restart safety') == 'Restarting safety'
    assert user.ask('safetystatus') == 'Safetystatus: NORMAL'
    assert user.ask('robotmode') == 'Robotmode: POWER_OFF'
