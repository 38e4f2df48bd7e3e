# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The pages about robots and recovery have every state, and every sentence that asks a person to act.

Both directions: the pages have all sentences of the tables of connection and recovery, and the
source contains every sentence that the pages quote, as a whole or with values in it.
"""

import ast
import asyncio
import errno
from itertools import product
import re
import socket

from checkout import CHECKOUT, needs_checkout
import pytest
from tracked_files import tracked_files

from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RobotState,
    RuntimeState,
    SafetyMode,
)
from ur_cartesian_driver.motion.state.state_age import explain_age
from ur_cartesian_driver.msg import DriverStatus
from ur_cartesian_driver.robot.connection_status import required_action
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.services.recovery_steps import (
    next_step,
    RecoverySituation,
    RecoveryStep,
)
from ur_cartesian_driver.robot.transport import dial, error_reason, TcpConnection, TcpListener

PAGES = [CHECKOUT / 'doc' / name for name in ('robot_setup.md', 'recovery.md')]
PACKAGE = CHECKOUT / 'ur_cartesian_driver'
pytestmark = needs_checkout

#: Where the sentences come from; the simulator says what a robot says itself.
SOURCES = [
    *tracked_files(PACKAGE, 'robot/**/*.py'),
    *tracked_files(PACKAGE, 'driver/**/*.py'),
    PACKAGE / 'motion' / 'state' / 'state_age.py',
    PACKAGE / 'program' / 'render.py',
    PACKAGE / 'protocol' / 'rtde' / 'rtde_client.py',
    PACKAGE / 'ros' / 'node.py',
    PACKAGE / 'ros' / 'state' / 'joint_states_check.py',
    *tracked_files(PACKAGE, 'sim/**/*.py'),
]
ROBOT_PROGRAM = PACKAGE / 'program' / 'driver.script'

ROBOTS = [
    RobotState(
        timestamp=1.0,
        actual_q=(0.0,) * 6,
        robot_mode=mode,
        safety_mode=safety,
        runtime_state=runtime,
    )
    for mode, safety in (
        [(mode, SafetyMode.NORMAL) for mode in RobotMode]
        + [(RobotMode.RUNNING, safety) for safety in SafetyMode]
    )
    for runtime in RuntimeState
]


def table(first_column):
    """Return the rows of all tables of the page whose first column has a title."""
    text = '\n'.join(page.read_text(encoding='utf-8') for page in PAGES)
    found = re.findall(rf'^\| {first_column} \|.*\n\|[ -|]*\n((?:\|.*\n)+)', text, re.MULTILINE)
    assert found
    return [
        [cell.strip() for cell in line.strip('|').split(' | ')]
        for rows in found
        for line in rows.splitlines()
    ]


def quoted(cell):
    """Return the quoted sentence of a cell, or an empty one."""
    match = re.match(r'`([^`]+)`', cell)
    return match[1] if match else ''


def sentences():
    rows = [row[0] for row in table('sentence')] + [
        row[1] for column in ('state', 'where') for row in table(column)
    ]
    assert all(map(quoted, rows))
    return [quoted(row) for row in rows]


def pattern(text, placeholder='...'):
    """Return the pattern of a text in which a placeholder stands for anything."""
    return re.compile('.*'.join(map(re.escape, text.split(placeholder))), re.DOTALL)


def is_on_page(said):
    return any(pattern(sentence).fullmatch(said) for sentence in sentences())


# ---- states -------------------------------------------------------------------------------------


def test_every_state_is_in_the_table_with_its_number():
    there = {(row[0], row[1]) for row in table('number')}
    assert there == {(str(state.value), state.name) for state in ConnectionState}
    assert there == {(str(getattr(DriverStatus, name)), name) for _, name in there}


# ---- the pages have the driver's sentences ------------------------------------------------------


def test_every_required_action_is_on_the_page():
    said = {
        required_action(
            state,
            robot,
            program_connected=connected,
            headless_mode=headless,
            stale=stale,
            tcp_restore_pending=owed,
            program_is_ending=ending,
            foreign_program=foreign,
        )
        for state, robot, connected, headless, stale, owed, ending, foreign in product(
            ConnectionState,
            [None, *ROBOTS],
            (False, True),
            (False, True),
            ('', explain_age(0.3, 0.2)),
            (False, True),
            (False, True),
            (False, True),
        )
    } - {''}
    assert len(said) > 10
    assert [text for text in sorted(said) if not is_on_page(text)] == []


def test_every_step_that_recovery_leaves_to_an_operator_is_on_the_page():
    steps = [
        next_step(
            RecoverySituation(
                connection=state,
                robot=robot,
                program_connected=connected,
                headless=headless,
                remote_control=remote,
            )
        )
        for state, robot, connected, headless, remote in product(
            ConnectionState, ROBOTS, (False, True), (False, True), (None, False)
        )
    ]
    said = {step.text for step in steps if step.step is RecoveryStep.OPERATOR} - {''}
    assert len(said) > 10
    assert [text for text in sorted(said) if not is_on_page(text)] == []


# ---- the driver says the pages' sentences -------------------------------------------------------


def texts(tree):
    """Return the texts of a module, with ``\\0`` for each value in them."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield re.sub(r'%\.?\d*[a-z]', '\0', node.value)
        elif isinstance(node, ast.JoinedStr):
            yield ''.join(
                str(part.value) if isinstance(part, ast.Constant) else '\0' for part in node.values
            )


@pytest.fixture(scope='module')
def written():
    """All texts of the sources, each as a pattern with its literal length."""
    found = {text for path in SOURCES for text in texts(ast.parse(path.read_text()))}
    # A line in the log of a robot ends in a value.
    found |= {f'{text}\0' for text in re.findall(r'"([^"\n]+)"', ROBOT_PROGRAM.read_text())}
    return [(pattern(text, '\0'), len(text.replace('\0', ''))) for text in found if len(text) > 10]


async def refusals_of_the_system():
    """Return the messages about a port without listener, a port in use and a lost connection."""
    said = []
    with socket.create_server(('127.0.0.1', 0)) as taken:
        port = taken.getsockname()[1]
        for host in ('127.0.0.1', '192.0.2.1'):  # RFC 5737: nobody's
            listener = TcpListener(
                'reverse_port', on_open=print, on_data=print, on_closed=print, on_refused=print
            )
            with pytest.raises(OSError, match='port') as refused:
                await listener.open(host, port, frozenset())
            said.append(str(refused.value))
    with pytest.raises(OSError, match='port') as refused:
        await dial(TcpConnection(print, print), '127.0.0.1', port)
    unreachable = error_reason(OSError(errno.EHOSTUNREACH, ''))
    return [*said, str(refused.value), f'127.0.0.1 port {port}: {unreachable}']


def can_say(written, said):
    """Tell whether a text produces a sentence, at least half of it literally."""
    return any(
        length >= 0.5 * len(said.replace('...', '')) and fits.fullmatch(said)
        for fits, length in written
    )


def test_each_quoted_sentence_is_written_in_the_source(written):
    on_page = set(sentences())
    assert len(on_page) > 40
    heard = asyncio.run(refusals_of_the_system())
    assert [text for text in heard if not is_on_page(text)] == []
    # These consist of two texts each; the first two are looked for the other way round above.
    left = {
        text
        for text in on_page
        if "Another program runs on the robot, possibly another driver's" not in text
        and 'requests a robot program, but there is none' not in text
        and not any(pattern(text).fullmatch(one) for one in heard)
    }
    assert [text for text in sorted(left) if not can_say(written, text)] == []


def test_a_sentence_that_the_source_does_not_contain_is_found(written):
    assert not can_say(written, 'The robot is tired; let it sleep.')
    assert not can_say(written, 'The arm is in mode ...; switch it off.')
