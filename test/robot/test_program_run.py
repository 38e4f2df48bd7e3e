# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Programs that move a simulated arm end with it at rest, whatever happens to the connections."""

import asyncio

import pytest
from waiting import wait_for

from ur_cartesian_driver.motion.state.rtde_state import RuntimeState, SafetyMode
from ur_cartesian_driver.robot.check.finding import RobotAddress
from ur_cartesian_driver.robot.check.program_run import ProgramRun, Surprise
from ur_cartesian_driver.robot.check.rtde_recorder import name_in

pytestmark = pytest.mark.slow

NAMES = ('timestamp', 'target_q', 'runtime_state', 'safety_mode')
ENDLESS = b"""
def endless():
  while True:
    movej([0.1, -1.2, 1.4, -1.6, -1.5, 0.2])
    sync()
  end
end
"""


def on(ur_sim, act):
    """Let a run of the simulated robot act, and return the result."""
    address = RobotAddress(
        host='127.0.0.1', rtde_port=ur_sim.ports.rtde, primary_port=ur_sim.ports.primary
    )

    async def whole():
        run = ProgramRun(address, NAMES)
        try:
            await run.open()
            return await act(run)
        finally:
            await run.close()

    return asyncio.run(asyncio.wait_for(whole(), 60.0))


@pytest.mark.ur_sim(frequency=125.0, q=(0.0, -1.2, 1.4, -1.6, -1.5, 0.2))
def test_a_stop_reaches_the_robot_after_its_connection_was_lost(ur_sim):
    async def act(run):
        await run.start(ENDLESS)
        ur_sim.inject('drop primary')
        with pytest.raises(Surprise, match='primary interface: '):
            await run.ended()
        return await run.stop()

    assert on(ur_sim, act)
    wait_for(lambda: ur_sim.state().runtime_state is RuntimeState.STOPPED)


@pytest.mark.ur_sim(frequency=125.0, q=(0.0, -1.2, 1.4, -1.6, -1.5, 0.2))
def test_a_stop_that_no_connection_takes_is_said(ur_sim):
    async def act(run):
        await run.start(ENDLESS)
        ur_sim.inject('drop primary for 1000 s')
        with pytest.raises(Surprise, match='primary interface: '):
            await run.ended()
        return await run.stop()

    assert not on(ur_sim, act)
    assert ur_sim.state().runtime_state is RuntimeState.PLAYING


@pytest.mark.ur_sim(frequency=125.0)
def test_a_program_that_does_not_start_says_why(ur_sim):
    async def act(run):
        await run.start(b'def broken():\n  movej([0, 1])\nend\n')

    with pytest.raises(Surprise, match=r'^the arm does not move: .*(line|program)'):
        on(ur_sim, act)


def test_a_safety_mode_that_no_list_has_is_a_number():
    assert name_in(SafetyMode, 3) == 'PROTECTIVE_STOP'
    assert name_in(SafetyMode, 21) == 'unknown (21)'


@pytest.mark.ur_sim(frequency=125.0, q=(0.0, -1.2, 1.4, -1.6, -1.5, 0.2))
def test_an_unknown_safety_mode_is_a_surprise(ur_sim):
    async def act(run):
        await run.start(ENDLESS)
        row = list(run.recorder.rows[-1])
        row[NAMES.index('safety_mode')] = 21
        run.recorder.rows.append(tuple(row))
        with pytest.raises(Surprise, match=r'with safety mode unknown \(21\)$'):
            await run.ended()
        await run.stop()

    on(ur_sim, act)
