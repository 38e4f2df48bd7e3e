# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Whose program runs, told from the robot's reports, when some of them are missing."""

import asyncio
from types import SimpleNamespace
from typing import Any, cast

from ur_cartesian_driver.motion.state.rtde_state import RobotState, RuntimeState
from ur_cartesian_driver.protocol.program.registers import PROGRAM_VERSION
from ur_cartesian_driver.robot.program.program_tracker import IDENTITY_TIMEOUT, ProgramTracker

NUMBER = 7


def report(time, run=0, runtime_state=RuntimeState.PLAYING):
    """Return a report of our program, which has connected ``run`` times."""
    return RobotState(
        timestamp=time,
        actual_q=(0.0,) * 6,
        runtime_state=runtime_state,
        program_version=PROGRAM_VERSION,
        program_number=NUMBER,
        program_run=run,
    )


class Sockets(SimpleNamespace):
    """The sockets of a robot program, without a network."""

    connected, ended, program_number = True, False, NUMBER
    dropped = ''

    def drop(self, reason):
        self.connected, self.dropped = False, reason


async def connected_tracker(sockets):
    """Return a tracker whose program has proved that it is ours."""
    tracker = ProgramTracker(cast(Any, sockets))
    tracker.observe(report(1.0, run=3))
    tracker.program_connected()
    assert not tracker.is_own
    tracker.observe(report(2.0, run=4))
    assert tracker.is_own
    return tracker


def test_a_connected_program_proves_itself_again_after_the_robot_was_lost():
    async def scenario():
        tracker = await connected_tracker(Sockets())
        tracker.robot_lost()
        assert not tracker.is_own
        assert not await tracker.wait_for_identity()
        tracker.observe(report(9.0, run=4))
        assert tracker.is_own
        assert await tracker.wait_for_identity()

    asyncio.run(scenario())


def test_a_program_that_is_gone_is_not_waited_for():
    async def scenario():
        sockets = Sockets()
        tracker = ProgramTracker(cast(Any, sockets))
        tracker.program_connected()
        waiting = asyncio.ensure_future(tracker.wait_for_identity())
        await asyncio.sleep(0)
        sockets.connected = False
        tracker.program_lost()
        async with asyncio.timeout(0.5 * IDENTITY_TIMEOUT):
            assert not await waiting

    asyncio.run(scenario())


def test_old_registers_do_not_make_a_program_ours_that_connected_unseen():
    async def scenario():
        tracker = await connected_tracker(Sockets())
        tracker.robot_lost()
        tracker.program_connected()
        tracker.observe(report(9.0, run=4))
        assert not tracker.is_own
        tracker.observe(report(9.1, run=5))
        assert tracker.is_own

    asyncio.run(scenario())


def test_a_dead_program_gets_its_time_anew_after_the_robot_was_lost():
    async def scenario():
        sockets = Sockets()
        tracker = await connected_tracker(sockets)
        tracker.observe(report(3.0, 4, RuntimeState.STOPPED))
        tracker.robot_lost()
        tracker.observe(report(9.0, 4, RuntimeState.STOPPED))
        assert not sockets.dropped
        tracker.observe(report(9.6, 4, RuntimeState.STOPPED))
        assert sockets.dropped == 'the robot reports that no program runs'

    asyncio.run(scenario())
