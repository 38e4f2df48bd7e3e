# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The link to a robot, here a simulated one: its events and their order."""

import asyncio
import contextlib
from dataclasses import replace
import logging
from types import SimpleNamespace
from typing import Any

import pytest

from ur_cartesian_driver.kinematics.robot_models import MODELS
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.state.rtde_state import RobotMode, RobotState, RuntimeState
from ur_cartesian_driver.protocol.rtde.rtde_packages import RtdeTextMessage
from ur_cartesian_driver.robot.connection_status import ConnectionStatus, required_action
from ur_cartesian_driver.robot.lifecycle import ConnectionEvent, ConnectionState
from ur_cartesian_driver.robot.link import CAUSE_TIMEOUT, LinkCallbacks, model_names, RobotLink
from ur_cartesian_driver.robot.link_settings import LinkSettings
from ur_cartesian_driver.robot.link_status import LOG_DELAY
from ur_cartesian_driver.robot.program.tcp_setter import TemporaryTcpSetter
from ur_cartesian_driver.robot.rtde.state_stream import StateStream


class Ear:
    """Everything that a link tells, in order."""

    def __init__(self, ports, *, headless):
        self.heard = []
        self.log = []
        self._ready = asyncio.Event()
        self.link = RobotLink(
            LinkSettings(
                rtde_port=ports.rtde,
                primary_port=ports.primary,
                reverse_port=0,
                trajectory_port=0,
                script_command_port=0,
                script_sender_port=0,
                headless_mode=headless,
            ),
            LinkCallbacks(
                state=self.heard.append,
                event=lambda event: None,
                status=self._status,
                geometry=lambda geometry: None,
                limits=lambda limits: None,
                log=lambda level, text: self.log.append((level, text)),
            ),
        )

    def _status(self, status):
        self.heard.append(status)
        if status.state is ConnectionState.READY:
            self._ready.set()

    async def ready(self):
        await asyncio.wait_for(self._ready.wait(), 5.0)

    def statuses(self, state):
        return [
            index
            for index, told in enumerate(self.heard)
            if isinstance(told, ConnectionStatus) and told.state is state
        ]


@contextlib.asynccontextmanager
async def listening(ur_sim, *, headless=True):
    ear = Ear(ur_sim.ports, headless=headless)
    life = asyncio.create_task(ear.link.run())
    try:
        yield ear
    finally:
        life.cancel()
        ear.link.close()
        with contextlib.suppress(asyncio.CancelledError):
            await life


def test_who_hears_that_the_robot_is_ready_knows_where_it_stands(ur_sim):
    async def run():
        async with listening(ur_sim) as ear:
            await ear.ready()
        first_ready = ear.statuses(ConnectionState.READY)[0]
        assert any(isinstance(told, RobotState) for told in ear.heard[:first_ready])

    asyncio.run(run())


def test_a_state_is_told_before_what_follows_from_it(ur_sim):
    """A program that outlived the connection makes the driver ready with the first state."""

    async def run():
        async with listening(ur_sim) as ear:
            await ear.ready()
            state = next(told for told in reversed(ear.heard) if isinstance(told, RobotState))
            ear.link._on_state(replace(state, runtime_state=RuntimeState.PAUSED))
            ear.heard.clear()
            ear.link._on_state(state)
        assert ear.heard[0] is state
        assert ear.statuses(ConnectionState.READY)

    asyncio.run(run())


def test_a_program_that_was_told_to_end_takes_no_goal_until_it_has(ur_sim):
    async def run():
        async with listening(ur_sim) as ear:
            await ear.ready()
            ear.link.set_executing(True)
            ear.link.control.stop('a test')
            ear.link.set_executing(False)
            assert ear.link.status.state is ConnectionState.CONNECTED
            assert 'told to end' in ear.link.status.not_ready()

    asyncio.run(run())


def test_the_log_asks_for_nothing_while_the_program_is_on_its_way(ur_sim):
    async def run():
        async with listening(ur_sim) as ear:
            await ear.ready()
        assert not [text for _, text in ear.log if 'resend' in text]

    asyncio.run(run())


def test_warnings_that_the_controller_sends_over_rtde_are_logged():
    texts: list[str] = []

    async def run():
        stream = StateStream(0.0, 0.0, lambda state: None, on_text=texts.append)
        for level, text in ((3, 'so it is'), (1, 'an input is in use')):
            stream._on_data(RtdeTextMessage(text=text, level=level).encode())

    asyncio.run(run())
    assert texts == ['an input is in use']


def test_a_type_that_no_model_has_is_no_fault_of_ur_type(ur_sim):
    assert model_names(12, 5) == []

    async def run():
        async with listening(ur_sim) as ear:
            await ear.ready()
            ear.link._status.apply(ConnectionEvent.ROBOT_LOST)
            ear.link._status.apply(ConnectionEvent.ROBOT_ANSWERED)
            unknown: Any = SimpleNamespace(robot_type=12)
            ear.link._on_configuration(unknown)
            status = ear.link.status
        assert status.state is ConnectionState.REFUSED
        assert 'reports the type 12, which this driver does not know' in status.message

    asyncio.run(run())


def test_the_geometry_of_a_refused_robot_is_not_taken(ur_sim):
    async def run():
        async with listening(ur_sim) as ear:
            await ear.ready()
            ear.link._status.apply(ConnectionEvent.ROBOT_LOST, calibration_known=False)
            ear.link._status.apply(ConnectionEvent.ROBOT_ANSWERED)
            other: Any = SimpleNamespace(robot_type=3)
            ear.link._on_configuration(other)
            ear.link._on_kinematics(MODELS['ur10e'].geometry)
            status = ear.link.status
        assert status.state is ConnectionState.REFUSED
        assert not status.calibration_known

    asyncio.run(run())


def test_a_robot_that_is_lost_with_its_program_is_the_headline(ur_sim):
    async def run():
        async with listening(ur_sim) as ear:
            await ear.ready()
            ear.link._on_program_lost('the program is gone')
            ear.link._on_robot_lost('RTDE is gone', 'RTDE: it is gone')
            await asyncio.sleep(3.0 * CAUSE_TIMEOUT)
            assert 'The robot is gone. ' in ear.link.status.last_error

    asyncio.run(run())


@pytest.mark.parametrize(
    ('mode', 'part'),
    [
        (RobotMode.POWER_OFF, 'switch it on and release its brakes'),
        (RobotMode.IDLE, 'switch it on and release its brakes'),
        (RobotMode.BOOTING, 'wait until it can be switched on'),
        (RobotMode.CONFIRM_SAFETY, 'a person to confirm its safety configuration'),
    ],
)
def test_each_mode_of_the_arm_has_its_remedy(mode, part):
    state = RobotState(timestamp=0.0, actual_q=(0.0,) * 6, robot_mode=mode)
    assert part in required_action(
        ConnectionState.CONNECTED, state, program_connected=False, headless_mode=True
    )


@pytest.mark.parametrize('is_foreign', [False, True])
def test_the_tcp_is_not_restored_under_a_paused_program_of_others(is_foreign):
    sent: list[bytes] = []
    program: Any = SimpleNamespace(connected=False)
    primary: Any = SimpleNamespace(send=lambda data, is_wanted: sent.append(data))
    setter = TemporaryTcpSetter(program, primary, headless_mode=True)
    state = RobotState(timestamp=0.0, actual_q=(0.0,) * 6, runtime_state=RuntimeState.PAUSED)
    setter.restore(IDENTITY, state, lambda: not is_foreign)
    assert bool(sent) is not is_foreign


@pytest.mark.slow
def test_the_log_asks_for_a_program_that_does_not_come(ur_sim):
    async def run():
        async with listening(ur_sim, headless=False) as ear:
            await asyncio.sleep(LOG_DELAY + 1.0)
        assert (
            logging.INFO,
            'The robot program does not run; play a program with the External '
            'Control node on the pendant.',
        ) in ear.log

    asyncio.run(run())
