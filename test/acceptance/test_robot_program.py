# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The robot program as text: the program that is sent is the one that runs.

The test plays the External Control URCap: it fetches the program from the driver's script sender,
edits it, and uploads it to the controller, which knows nothing of it but that text.
"""

import re
import socket

import pytest
from robot_ports import fetch_program
from waiting import wait_for

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.program import wrap_in_program
from ur_cartesian_driver.program.render import PREFIX
from ur_cartesian_driver.protocol.client_interfaces.primary_messages import (
    PrimaryDecoder,
    RuntimeExceptionMessage,
)
from ur_cartesian_driver.robot.lifecycle import ConnectionState

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

END = '# NODE_CONTROL_LOOP_ENDS'


@pytest.fixture
def served(make_driver):
    """A driver that waits for a program, and the text that it serves."""
    driver = make_driver(headless_mode=False)
    wait_for(lambda: driver.status.state is ConnectionState.CONNECTED)
    return driver, fetch_program(driver)


def upload(ur_sim, text):
    with socket.create_connection(('127.0.0.1', ur_sim.ports.primary)) as primary:
        primary.sendall((text + '\n').encode())


def short_goal(driver, y=0.02):
    pose = driver.state.actual_tcp_pose
    x0, y0, z0 = pose.position
    return Goal(
        waypoints=(Waypoint(time=0.4, pose=type(pose)((x0, y0 + y, z0), pose.quaternion)),)
    )


def test_the_served_program_runs_as_it_is(served, ur_sim):
    driver, text = served
    upload(ur_sim, wrap_in_program(text))
    driver.wait_ready(30.0)
    assert driver.execute(short_goal(driver), timeout=10.0).succeeded


def test_a_program_with_other_names_does_the_same(served, ur_sim):
    driver, text = served
    for name in (
        f'{PREFIX}run_point',
        f'{PREFIX}points_left',
        f'{PREFIX}abandon_trajectory',
        f'{PREFIX}run_trajectory',
        'kind',
        'timeout',
        f'{PREFIX}connect_sockets',
    ):
        text, count = re.subn(rf'\b{name}\b', f'renamed_{name}', text)
        assert count >= 2
    upload(ur_sim, wrap_in_program(text))
    driver.wait_ready(30.0)
    assert driver.execute(short_goal(driver), timeout=10.0).succeeded


def test_an_added_line_is_executed(served, ur_sim):
    driver, text = served
    text = text.replace(
        f'  local kind = point[{PREFIX}POINT_TYPE]',
        f'  local kind = point[{PREFIX}POINT_TYPE]\n  textmsg("this point is a ", kind)',
    )
    upload(ur_sim, wrap_in_program(text))
    driver.wait_ready(30.0)
    assert driver.execute(short_goal(driver), timeout=10.0).succeeded
    assert 'this point is a 1' in ur_sim.state().messages


def test_a_changed_constant_changes_the_motion(served, ur_sim, record):
    """Halve the scale of the program: the arm covers half the distance."""
    driver, text = served
    text = text.replace('MULT_TIME = 1000000.0', 'MULT_TIME = 500000.0')
    upload(ur_sim, wrap_in_program(text))
    driver.wait_ready(30.0)
    with record() as recording:
        assert driver.execute(short_goal(driver), timeout=10.0).succeeded
    # The first motion of a program takes 80 ms more.
    assert recording.duration == pytest.approx(0.88, abs=0.01)


def test_a_changed_result_changes_the_outcome(served, ur_sim):
    driver, text = served
    upload(ur_sim, wrap_in_program(text.replace('RESULT_SUCCESS = 0', 'RESULT_SUCCESS = 2')))
    driver.wait_ready(30.0)
    outcome = driver.execute(short_goal(driver), timeout=10.0)
    assert outcome.code is ErrorCode.EXECUTION_FAILED


@pytest.mark.parametrize(
    ('line', 'replacement', 'expected'),
    [
        (
            f'{PREFIX}begin_motion()',
            'no_such_function()',
            'compile_error_name_not_found:no_such_function:',
        ),
        (f'local kind = point[{PREFIX}POINT_TYPE]', 'local kind = = 3', 'syntax_error_on_line:'),
    ],
)
def test_a_broken_program_is_refused_with_line_and_column(
    served, ur_sim, line, replacement, expected
):
    driver, text = served
    program = wrap_in_program(text)
    assert line in program
    lines = program.splitlines()
    at = next(i for i, row in enumerate(lines) if row.strip() == line)
    lines[at] = lines[at].replace(line, replacement)
    with socket.create_connection(('127.0.0.1', ur_sim.ports.primary)) as primary:
        primary.settimeout(5.0)
        primary.sendall(('\n'.join(lines) + '\n\n').encode())
        decoder, errors = PrimaryDecoder(), []
        while not errors:
            errors = [
                frame
                for frame in decoder.feed(primary.recv(65536))
                if isinstance(frame, RuntimeExceptionMessage)
            ]
    assert errors[0].text.startswith(expected)
    assert errors[0].line == at + 1
    assert errors[0].column >= 1
    assert driver.status.state is ConnectionState.CONNECTED
    wait_for(lambda: expected in driver.status.last_error)
