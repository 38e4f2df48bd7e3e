# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The way of a stopped robot back, over everything that a robot can report."""

from itertools import product

import pytest

from ur_cartesian_driver.motion.state.rtde_state import (
    RobotMode,
    RobotState,
    RuntimeState,
    SafetyMode,
)
from ur_cartesian_driver.robot.lifecycle import ConnectionState
from ur_cartesian_driver.robot.services.recovery import STEP_COMMANDS
from ur_cartesian_driver.robot.services.recovery_steps import (
    next_step,
    POWER_STEPS,
    RecoverySituation,
    RecoveryStep,
    SAFETY_STEPS,
    STEP_NAMES,
)

FREE = (SafetyMode.NORMAL, SafetyMode.REDUCED)
ACTIONS = set(STEP_NAMES)
EMERGENCY = [mode for mode in SafetyMode if 'EMERGENCY' in mode.name]


def situation(
    connection=ConnectionState.STOPPED,
    *,
    safety=SafetyMode.NORMAL,
    power=RobotMode.RUNNING,
    runtime=RuntimeState.STOPPED,
    **fields,
):
    return RecoverySituation(
        connection=connection,
        message='what is needed',
        robot=RobotState(
            timestamp=1.0,
            actual_q=(0.0,) * 6,
            safety_mode=safety,
            robot_mode=power,
            runtime_state=runtime,
        ),
        **{'may_unlock': True} | fields,
    )


@pytest.fixture(scope='module')
def everything():
    """Every possible situation of a robot, with its recovery step."""
    robots = [
        situation(safety=safety, power=power, runtime=runtime).robot
        for safety, power, runtime in product(SafetyMode, RobotMode, RuntimeState)
    ]
    situations = (
        RecoverySituation(
            connection=connection,
            message='what is needed',
            robot=robot,
            program_connected=connected,
            headless=headless,
            remote_control=remote,
            may_unlock=may_unlock,
        )
        for connection, robot, connected, headless, remote, may_unlock in product(
            ConnectionState,
            robots,
            (False, True),
            (False, True),
            (None, False, True),
            (False, True),
        )
    )
    return [(at, next_step(at)) for at in situations]


@pytest.mark.slow
def test_every_situation_has_a_step_and_an_end_has_a_sentence(everything):
    for _, following in everything:
        assert following.step in RecoveryStep
        if following.step in (RecoveryStep.OPERATOR, RecoveryStep.DONE):
            assert following.text.endswith('.') or following.text == 'what is needed'


@pytest.mark.slow
def test_nothing_is_done_to_a_robot_that_is_not_ours_not_there_busy_or_ready(everything):
    reached = {at.connection for at, following in everything if following.step in ACTIONS}
    assert reached == {ConnectionState.CONNECTED, ConnectionState.STOPPED}


@pytest.mark.slow
def test_in_local_control_everything_is_left_to_a_person(everything):
    assert not [
        at
        for at, following in everything
        if at.remote_control is False and following.step in ACTIONS
    ]


@pytest.mark.slow
def test_nothing_is_unlocked_unless_somebody_answers_for_it(everything):
    unlocked = {
        at.may_unlock for at, following in everything if following.step is RecoveryStep.UNLOCK
    }
    assert unlocked == {True}


@pytest.mark.slow
def test_power_brakes_and_programs_wait_for_the_safety_system(everything):
    done = {following.step for at, following in everything if at.robot.safety_mode not in FREE}
    assert done & ACTIONS == {RecoveryStep.UNLOCK, RecoveryStep.RESTART_SAFETY}


def test_the_tables_know_every_mode():
    assert set(SAFETY_STEPS) == set(SafetyMode)
    assert set(POWER_STEPS) == set(RobotMode)


def test_every_step_has_its_command():
    assert set(STEP_COMMANDS) | {RecoveryStep.SEND_PROGRAM} == ACTIONS


@pytest.mark.parametrize('mode', EMERGENCY, ids=lambda mode: mode.name)
def test_an_emergency_stop_is_for_a_person(mode):
    following = next_step(situation(safety=mode))
    assert following.step is RecoveryStep.OPERATOR
    assert 'release the button' in following.text


CASES = {
    'protective stop': ({'safety': SafetyMode.PROTECTIVE_STOP}, RecoveryStep.UNLOCK),
    'violation': ({'safety': SafetyMode.VIOLATION}, RecoveryStep.RESTART_SAFETY),
    'fault': (
        {'safety': SafetyMode.FAULT, 'power': RobotMode.POWER_OFF},
        RecoveryStep.RESTART_SAFETY,
    ),
    'safeguard': ({'safety': SafetyMode.SAFEGUARD_STOP}, RecoveryStep.OPERATOR),
    'power off': ({'power': RobotMode.POWER_OFF}, RecoveryStep.POWER_ON),
    'powering up': ({'power': RobotMode.POWER_ON}, RecoveryStep.WAIT),
    'idle': ({'power': RobotMode.IDLE}, RecoveryStep.RELEASE_BRAKES),
    'hand guided': ({'power': RobotMode.BACKDRIVE}, RecoveryStep.OPERATOR),
    'paused': (
        {'runtime': RuntimeState.PAUSED, 'program_connected': True},
        RecoveryStep.STOP_PROGRAM,
    ),
    'stopping': ({'runtime': RuntimeState.STOPPING}, RecoveryStep.WAIT),
    'foreign program': ({'runtime': RuntimeState.PLAYING}, RecoveryStep.OPERATOR),
    'our program': (
        {'runtime': RuntimeState.PLAYING, 'program_connected': True},
        RecoveryStep.WAIT,
    ),
    'no program': ({}, RecoveryStep.SEND_PROGRAM),
    'no program, not headless': ({'headless': False}, RecoveryStep.PLAY),
    'a paused goal': (
        {'connection': ConnectionState.EXECUTING, 'runtime': RuntimeState.PAUSED},
        RecoveryStep.OPERATOR,
    ),
    'a goal': (
        {'connection': ConnectionState.EXECUTING, 'runtime': RuntimeState.PLAYING},
        RecoveryStep.DONE,
    ),
    'ready': ({'connection': ConnectionState.READY}, RecoveryStep.DONE),
    'a wrong robot': ({'connection': ConnectionState.REFUSED}, RecoveryStep.OPERATOR),
}


@pytest.mark.parametrize(('fields', 'step'), CASES.values(), ids=CASES)
def test_the_way_back_step_by_step(fields, step):
    assert next_step(situation(**fields)).step is step


@pytest.mark.parametrize('connection', [ConnectionState.DISCONNECTED, ConnectionState.CONNECTING])
def test_a_robot_that_is_away_is_waited_for(connection):
    assert next_step(RecoverySituation(connection=connection)).step is RecoveryStep.WAIT


@pytest.mark.parametrize(
    'start',
    [
        {'safety': SafetyMode.PROTECTIVE_STOP, 'runtime': RuntimeState.PAUSED},
        {'safety': SafetyMode.FAULT, 'power': RobotMode.POWER_OFF},
        {'power': RobotMode.POWER_OFF},
    ],
    ids=['protective stop', 'fault', 'power off'],
)
def test_a_robot_that_obeys_gets_there(start):
    """Each step has its effect; no way is longer than the list of all steps."""
    effects: dict[RecoveryStep, dict[str, object]] = {
        RecoveryStep.UNLOCK: {'safety': SafetyMode.NORMAL},
        RecoveryStep.RESTART_SAFETY: {'safety': SafetyMode.NORMAL},
        RecoveryStep.POWER_ON: {'power': RobotMode.IDLE},
        RecoveryStep.RELEASE_BRAKES: {'power': RobotMode.RUNNING},
        RecoveryStep.STOP_PROGRAM: {'runtime': RuntimeState.STOPPED},
        RecoveryStep.SEND_PROGRAM: {'connection': ConnectionState.READY},
    }
    now = dict(start)
    for _ in range(len(effects) + 1):
        step = next_step(situation(**now)).step
        if step is RecoveryStep.DONE:
            return
        now |= effects[step]
    pytest.fail(f'it goes round in circles at {now}')
