# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The order of calls that begin and end a watch for contact."""

import asyncio
from types import SimpleNamespace
from typing import Any, cast

import pytest

from ur_cartesian_driver.driver import DriverConfig
from ur_cartesian_driver.motion.state.rtde_state import RobotState, RuntimeState
from ur_cartesian_driver.protocol.program.registers import PROGRAM_VERSION
from ur_cartesian_driver.protocol.program.script_command import ToolContactResult
from ur_cartesian_driver.robot.connection_status import ConnectionStatus
from ur_cartesian_driver.robot.program.contact_watch import ContactWatch
from ur_cartesian_driver.robot.program.program_tracker import ProgramTracker
from ur_cartesian_driver.robot.services.dashboard_service import DashboardPorts
from ur_cartesian_driver.robot.services.service_calls import EndContactWatchCall, WatchContactCall
from ur_cartesian_driver.robot.services.service_dispatcher import ServiceDispatcher

NUMBER = 7
PORTS = DashboardPorts(dashboard=29999, robot_api=80)


class Link(SimpleNamespace):
    """A robot whose program has just connected, and reads commands."""

    def __init__(self):
        self.status, self.version = ConnectionStatus(), None
        self.robot = RobotState(
            timestamp=1.0,
            actual_q=(0.0,) * 6,
            runtime_state=RuntimeState.PLAYING,
            program_version=PROGRAM_VERSION,
            program_number=NUMBER,
            program_run=1,
        )
        self.commands = []
        self.program = SimpleNamespace(
            connected=True, ended=False, program_number=NUMBER, send_command=self.send_command
        )
        self.control = SimpleNamespace(tracker=ProgramTracker(cast(Any, self.program)))
        self.contact_watch = ContactWatch(cast(Any, self.program), lambda is_active: None)
        self.control.tracker.program_connected()

    def send_command(self, command):
        self.commands.append(command)
        return True


@pytest.mark.parametrize('steps', range(4))
def test_an_end_does_not_overtake_a_watch_that_waits_for_the_program(steps):
    """The end comes some steps of the event loop before the program shows itself."""

    async def scenario():
        link = Link()
        dispatcher = ServiceDispatcher(DriverConfig(), PORTS, cast(Any, link))
        watching = asyncio.ensure_future(dispatcher.dispatch(WatchContactCall()))
        await asyncio.sleep(0)
        ending = asyncio.ensure_future(dispatcher.dispatch(EndContactWatchCall()))
        for _ in range(steps):
            await asyncio.sleep(0)
        link.control.tracker.observe(link.robot)
        assert (await ending).ok
        assert len(link.commands) == 2  # begin, end
        link.contact_watch.take(ToolContactResult.CANCELED)
        async with asyncio.timeout(5.0):
            assert (await watching).text == 'The watch was ended before the tool touched.'

    asyncio.run(scenario())
