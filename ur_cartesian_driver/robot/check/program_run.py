# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Runs programs that move the arm, and records the robot's reports meanwhile.

A *row* holds the recorded RTDE outputs of one packet, by name.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ur_cartesian_driver.motion.state.rtde_state import (
    MOVABLE_SAFETY_MODES,
    RobotMode,
    RuntimeState,
    SafetyMode,
)
from ur_cartesian_driver.protocol.client_interfaces.primary_messages import (
    encode_command,
    PrimaryCommand,
)
from ur_cartesian_driver.robot.check.finding import RobotAddress
from ur_cartesian_driver.robot.check.primary_observations import LOCAL_CONTROL, PrimaryProbe
from ur_cartesian_driver.robot.check.rtde_recorder import name_in, RtdeRecorder
from ur_cartesian_driver.robot.rtde.probe import read_state

#: Longest waits: for a program to move the arm, for its next expected event, for rest after a
#: stop command [s].
START_TIMEOUT, END_TIMEOUT, REST_TIMEOUT = 3.0, 30.0, 3.0
#: Time within which a lost connection is noticed [s].
LOSS_TIME = 0.25


class Surprise(Exception):
    """An unexpected event; its message is a clause, for use inside a sentence."""


async def motion_refusal(address: RobotAddress) -> str:
    """
    Return the reason why the arm must not move now, as a clause; empty = it may move.

    :raises OSError: the robot does not answer.
    """
    state = await read_state(address.host, address.rtde_port)
    if state.safety_mode not in MOVABLE_SAFETY_MODES:
        return f'the safety mode is {state.safety_mode.name}'
    if state.robot_mode is not RobotMode.RUNNING:
        return f'the arm is in mode {state.robot_mode.name}; switch it on and release the brakes'
    if state.runtime_state is not RuntimeState.STOPPED:
        return f'a program is {state.runtime_state.name}; stop it'
    return ''


class ProgramRun:
    """
    Runs programs, one after the other, on connections that are opened and closed once.

    All methods that wait raise OSError if RTDE is lost, and :class:`Surprise` if the robot stops,
    the primary interface is lost, or ``watch`` finds a fault.
    """

    def __init__(
        self,
        address: RobotAddress,
        names: Sequence[str],
        watch: Callable[[Mapping[str, Any]], str] = lambda row: '',
    ) -> None:
        """
        Prepare; :meth:`open` connects.

        :param names: RTDE outputs to record; they must include ``target_q``, ``runtime_state``
            and ``safety_mode``.
        :param watch: returns the fault that the outputs of one packet show, as a clause;
            '' = none.
        """
        self._address, self._watch = address, watch
        self.recorder = RtdeRecorder(names, address.host, address.rtde_port)
        self.probe = PrimaryProbe()
        self._seen = 0

    async def open(self) -> None:
        """
        Connect, and wait for the first row.

        :raises OSError: the robot does not answer.
        :raises Surprise: no row comes, or as for :meth:`wait_for`.
        """
        await self.recorder.open()
        await self.probe.open(self._address)
        await self.until(lambda row: True, START_TIMEOUT, 'the robot streams nothing')

    async def close(self) -> None:
        """Disconnect."""
        self.recorder.close()
        await self.probe.close()

    async def start(self, script: bytes) -> None:
        """
        Send a program, and wait until the arm moves.

        :raises Surprise: the arm does not move, or as for :meth:`wait_for`.
        """
        begin, said = self.recorder.newest['target_q'], len(self.probe.lines)

        def lines(mark: str) -> list[str]:
            return [line for line in self.probe.lines[said:] if mark in line]

        self.send(script)
        await self.wait_for(
            lambda row: row['target_q'] != begin or bool(lines(LOCAL_CONTROL)), START_TIMEOUT
        )
        if self.recorder.newest['target_q'] == begin:
            texts = lines(LOCAL_CONTROL) or lines('') or [f'nothing in {START_TIMEOUT:g} s']
            raise Surprise(f'the arm does not move: {texts[-1]}')

    async def ended(self) -> None:
        """
        Wait until the program has ended.

        :raises Surprise: it does not end within :data:`END_TIMEOUT`, or as for :meth:`wait_for`.
        """
        await self.until(
            lambda row: row['runtime_state'] == RuntimeState.STOPPED,
            END_TIMEOUT,
            'the program does not end',
        )

    async def play(self, script: bytes) -> None:
        """Run a program to its end."""
        await self.start(script)
        await self.ended()

    def send(self, request: bytes) -> None:
        """
        Send a program or a command.

        :raises Surprise: the primary interface is not connected.
        """
        if not self.probe.send(request):
            raise Surprise('the primary interface was lost')

    async def stop(self) -> bool:
        """
        Stop the program; return whether the command was sent on a connection that did not fail.

        If the connection fails, the command is sent again, for up to :data:`REST_TIMEOUT`.
        """
        loop, request = asyncio.get_running_loop(), encode_command(PrimaryCommand.STOP_PROGRAM)
        end = loop.time() + REST_TIMEOUT
        while loop.time() < end:
            losses = len(self.probe.failures)
            was_sent = self.probe.send(request)
            await asyncio.sleep(LOSS_TIME)
            # A connection that has just been cut takes the command, and loses it.
            if was_sent and len(self.probe.failures) == losses:
                return True
        return False

    async def wait_for(self, is_reached: Callable[[Mapping[str, Any]], bool], time: float) -> bool:
        """
        Wait until the newest row meets a condition, and check each row for faults.

        :param time: longest wait [s].
        :return: whether the condition was met in time.
        :raises Surprise: a row shows a fault, or the primary interface was lost.
        :raises OSError: the RTDE connection was lost.
        """
        wrong = ''

        def check(row: Mapping[str, Any]) -> bool:
            nonlocal wrong
            rows, self._seen = self.recorder.rows[self._seen :], len(self.recorder.rows)
            for values in rows:
                wrong = wrong or self._wrong(dict(zip(self.recorder.names, values, strict=True)))
            return bool(wrong or self.probe.failures) or is_reached(row)

        reached = await self.recorder.wait_for(check, time)
        if wrong:
            raise Surprise(wrong)
        if self.probe.failures:
            await self.recorder.wait_for(lambda row: False, LOSS_TIME)  # RTDE lost, too?
            raise Surprise(self.probe.failures[0])
        return reached

    async def until(
        self, is_reached: Callable[[Mapping[str, Any]], bool], time: float, otherwise: str
    ) -> None:
        """
        Wait like :meth:`wait_for`, but raise an error if the condition is not met in time.

        :param otherwise: clause for this error, such as "the program does not end".
        :raises Surprise: the condition is not met within ``time`` [s], or as for
            :meth:`wait_for`.
        """
        if not await self.wait_for(is_reached, time):
            raise Surprise(f'{otherwise} within {time:g} s')

    def _wrong(self, row: Mapping[str, Any]) -> str:
        if row['safety_mode'] not in MOVABLE_SAFETY_MODES:
            mode = name_in(SafetyMode, row['safety_mode'])
            return f'the robot stopped, with safety mode {mode}'
        return self._watch(row)
