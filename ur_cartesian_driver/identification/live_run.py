# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Runs one experiment on a robot, records it, and ends it at any surprise.

The program on the robot is short and ends by itself, so the arm comes to rest even if both
connections are cut. A protective stop is never unlocked.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from math import dist
from pathlib import Path
from typing import Any

import numpy as np

from ur_cartesian_driver.identification.law_experiments import (
    Interruption,
    LawExperiment,
    MotionBounds,
)
from ur_cartesian_driver.motion.state.rtde_state import RobotState, RuntimeState, SafetyMode
from ur_cartesian_driver.protocol.client_interfaces.primary_messages import (
    encode_command,
    PrimaryCommand,
)
from ur_cartesian_driver.robot.check.experiment_runner import motion_refusal
from ur_cartesian_driver.robot.check.experiments import program, return_program
from ur_cartesian_driver.robot.check.finding import RobotAddress
from ur_cartesian_driver.robot.check.primary_observations import LOCAL_CONTROL, PrimaryProbe
from ur_cartesian_driver.robot.check.rtde_recorder import RtdeRecorder
from ur_cartesian_driver.robot.rtde.probe import read_state

RECORDED = (
    'timestamp', 'target_q', 'actual_q', 'target_TCP_pose', 'target_TCP_speed', 'runtime_state',
    'safety_mode', 'target_speed_fraction',
)  # fmt: skip
#: Outputs that files contain, in the order of their columns.
_IN_FILE = tuple(name for name in RECORDED if name != 'target_TCP_speed')
#: Longest times until the arm moves, until the program has done the next thing, and until the arm
#: rests after a stop [s].
START_TIMEOUT, END_TIMEOUT, REST_TIMEOUT = 3.0, 30.0, 3.0
#: Time recorded at rest before and after the motion, and how long a program is paused [s].
BEFORE, AFTER, PAUSED = 0.4, 1.0, 0.6
#: So many packets without motion are rest.
MIN_REST = 20
#: The tool is where it should be within this distance [m].
NEAR = 1e-3
_SAFE = (SafetyMode.NORMAL, SafetyMode.REDUCED)


class Surprise(Exception):
    """Something happened that nobody asked for; the text is a clause."""


async def ready_state(address: RobotAddress, start: RobotState | None) -> RobotState:
    """
    Return the state of a robot that may be moved.

    :param start: the state in which the first experiment began; None = this is the first one.
    :raises OSError: the robot does not answer.
    :raises Surprise: it must not be moved now, or is elsewhere.
    """
    if refusal := await motion_refusal(address):
        raise Surprise(refusal)
    state = await read_state(address.host, address.rtde_port)
    if state.target_speed_fraction < 0.999:
        raise Surprise(
            f'the speed slider is at {state.target_speed_fraction:.0%}; set it to 100 %'
        )
    if start is not None:
        off = start.actual_tcp_pose.distance_to(state.actual_tcp_pose)
        if off > 2.0 * NEAR:
            raise Surprise(f'the tool is {1e3 * off:.1f} mm from where it was left')
    return state


async def record_experiment(
    address: RobotAddress,
    experiment: LawExperiment,
    state: RobotState,
    bounds: MotionBounds,
    path: Path,
) -> None:
    """
    Run an experiment, and write its recording, also if it does not come to its end.

    :param state: of the robot, at rest.
    :param path: of the recording: text with titles, packed.
    :raises Surprise: the motion was ended, or did not happen as it should.
    :raises OSError: a connection was lost or refused.
    """
    run = _Run(address, experiment, state, bounds)
    try:
        await run.open()
        await run.carry_out()
    finally:
        run.write(path)
        await run.close()


class _Run:
    """One experiment, from its connection to its recording."""

    def __init__(
        self,
        address: RobotAddress,
        experiment: LawExperiment,
        state: RobotState,
        bounds: MotionBounds,
    ) -> None:
        self._address, self._experiment = address, experiment
        self._state, self._bounds = state, bounds
        self._recorder = RtdeRecorder(RECORDED, address.host, address.rtde_port)
        self._probe = PrimaryProbe()
        #: Whether a pause was sent, and the number of rows that belong to the experiment, and of
        #: those that were looked at.
        self._pauses, self._rows, self._seen = False, 0, 0

    async def open(self) -> None:
        await self._recorder.open()
        await self._probe.open(self._address)
        await self._until(lambda row: True, START_TIMEOUT, 'the robot streams nothing')

    async def close(self) -> None:
        self._recorder.close()
        await self._probe.close()

    async def carry_out(self) -> None:
        """Run the program, with its interruption; leave the arm at rest where it began."""
        recorder, experiment = self._recorder, self._experiment
        begin = recorder.newest
        await self._rest(BEFORE)
        try:
            await self._start(program(f'identify_{experiment.name}', self._script))
            if experiment.interruption is not Interruption.NONE:
                await self._interrupt()
            await self._ended()
            await self._rest(AFTER)
        except BaseException:
            await self._stop()
            raise
        finally:
            self._rows = len(recorder.rows)
        if experiment.interruption is Interruption.STOP:
            try:
                await self._start(return_program(begin['target_TCP_pose']))
                await self._ended()
            except BaseException:
                await self._stop()
                raise
        self._check_end(begin)

    @property
    def _script(self) -> str:
        return self._experiment.script(self._state)

    async def _interrupt(self) -> None:
        """Stop the program on its way, or pause and resume it."""
        due = self._recorder.newest['timestamp'] + self._experiment.after
        await self._until(
            lambda row: row['timestamp'] >= due, END_TIMEOUT, 'the time stands still'
        )
        if self._experiment.interruption is Interruption.STOP:
            self._send(encode_command(PrimaryCommand.STOP_PROGRAM))
            return
        self._pauses = True
        self._send(encode_command(PrimaryCommand.PAUSE_PROGRAM))
        await self._until(
            lambda row: row['runtime_state'] == RuntimeState.PAUSED,
            START_TIMEOUT,
            'the program does not pause',
        )
        await self._rest(PAUSED)
        self._send(encode_command(PrimaryCommand.RESUME_PROGRAM))
        await self._until(
            lambda row: row['runtime_state'] == RuntimeState.PLAYING,
            START_TIMEOUT,
            'the program does not resume',
        )
        self._pauses = False

    async def _start(self, script: bytes) -> None:
        """Send a program and wait until the arm moves."""
        begin = self._recorder.newest['target_q']
        self._send(script)
        await self._until(
            lambda row: row['target_q'] != begin or self._refused,
            START_TIMEOUT,
            'the arm does not move',
        )
        if self._refused:
            raise Surprise('the robot takes no programs: it is in local control')

    @property
    def _refused(self) -> bool:
        return any(LOCAL_CONTROL in line for line in self._probe.lines)

    async def _ended(self) -> None:
        await self._until(
            lambda row: row['runtime_state'] == RuntimeState.STOPPED,
            END_TIMEOUT,
            'the program does not end',
        )

    async def _rest(self, time: float) -> None:
        due = self._recorder.newest['timestamp'] + time
        await self._until(
            lambda row: row['timestamp'] >= due, END_TIMEOUT, 'the time stands still'
        )

    async def _until(
        self, is_reached: Callable[[Mapping[str, Any]], bool], time: float, otherwise: str
    ) -> None:
        """
        Wait for a row, and look at each one for surprises.

        :raises Surprise: there was one, or the row did not come in time.
        """
        surprise, recorder = '', self._recorder

        def check(row: Mapping[str, Any]) -> bool:
            nonlocal surprise
            for values in recorder.rows[self._seen :]:
                surprise = surprise or self._surprise(
                    dict(zip(recorder.names, values, strict=True))
                )
            self._seen = len(recorder.rows)
            return bool(surprise) or is_reached(row)

        reached = await recorder.wait_for(check, time)
        if surprise or not reached:
            raise Surprise(surprise or f'{otherwise} within {time:g} s')

    def _surprise(self, row: Mapping[str, Any]) -> str:
        """Return what nobody asked for, as a clause; '' = nothing."""
        if row['safety_mode'] not in _SAFE:
            return f'the robot stopped, with safety mode {SafetyMode(row["safety_mode"]).name}'
        paused = row['runtime_state'] in (RuntimeState.PAUSING, RuntimeState.PAUSED)
        if paused and not self._pauses:
            return 'the program was paused'
        if row['target_speed_fraction'] < 0.999:
            return 'the speed slider was moved'
        if outside := self._bounds.outside(row['target_TCP_pose'][:3]):
            return f'the tool left the box: {outside}'
        if fast := self._bounds.too_fast(float(np.linalg.norm(row['target_TCP_speed'][:3]))):
            return f'the tool was too fast: {fast}'
        return ''

    def _check_end(self, begin: Mapping[str, Any]) -> None:
        """Refuse a motion that did not turn back where it should, or ended elsewhere."""
        poses = self._recorder.column('target_TCP_pose')
        off = dist(poses[-1, :3], begin['target_TCP_pose'][:3])
        joints = np.abs(self._recorder.column('target_q') - np.array(begin['target_q']))
        if off > NEAR or joints[-1].max() > 0.01:
            raise Surprise(f'the program ended {1e3 * off:.1f} mm from where it began')
        if self._experiment.interruption is Interruption.STOP:
            return
        if self._experiment.wrist:
            missing = self._experiment.wrist - float(joints[:, 5].max())
        else:
            far = self._experiment.places(self._state)[-1]
            missing = float(np.linalg.norm(poses[:, :3] - np.array(far), axis=1).min())
        if missing > 5.0 * NEAR:
            raise Surprise('the program ended before the arm was there and back')

    def _send(self, request: bytes) -> None:
        if not self._probe.send(request):
            raise Surprise('the primary interface was lost')

    async def _stop(self) -> None:
        """Stop the program, and wait until the arm rests, as far as the connections allow it."""
        row = self._recorder.newest
        if row and row['safety_mode'] not in _SAFE:
            await self._until_rest()  # its ramp belongs to the recording
        self._probe.send(encode_command(PrimaryCommand.STOP_PROGRAM))
        await self._until_rest()

    async def _until_rest(self) -> None:
        """Wait until the target stands still; as long as may be necessary if nothing tells."""
        recorder, last = self._recorder, MIN_REST
        place = recorder.names.index('target_q') if recorder.names else 0

        def rests(row: Mapping[str, Any]) -> bool:
            rows = recorder.rows[-last:]
            return len(rows) == last and all(each[place] == row['target_q'] for each in rows)

        try:
            await recorder.wait_for(rests, REST_TIMEOUT)
        except OSError:
            await asyncio.sleep(REST_TIMEOUT)

    def write(self, path: Path) -> None:
        """Write the rows of the experiment."""
        count = self._rows or len(self._recorder.rows)
        if not count:
            return
        titles, columns = [], []
        for name in _IN_FILE:
            values = self._recorder.column(name)[:count]
            columns.append(values.reshape(count, -1))
            width = columns[-1].shape[1]
            titles += [name] if width == 1 else [f'{name}_{i}' for i in range(width)]
        rows = np.concatenate(columns, axis=1)
        np.savetxt(path, rows, '%.17g', header=' '.join(titles), comments='')
