# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Runs one experiment on a robot, records it, and ends it at any surprise.

The program on the robot is short and ends by itself, so the arm comes to rest even if both
connections are cut. A protective stop is never unlocked.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
import contextlib
from math import dist
from pathlib import Path
from typing import Any

import numpy as np

from ur_cartesian_driver.identification.law_experiments import (
    Interruption,
    LawExperiment,
    MotionBounds,
)
from ur_cartesian_driver.motion.state.rtde_state import (
    MOVABLE_SAFETY_MODES,
    RobotMode,
    RobotState,
    RuntimeState,
)
from ur_cartesian_driver.protocol.client_interfaces.primary_messages import (
    encode_command,
    PrimaryCommand,
)
from ur_cartesian_driver.robot.check.experiments import program, return_program
from ur_cartesian_driver.robot.check.finding import RobotAddress
from ur_cartesian_driver.robot.check.program_run import (
    END_TIMEOUT,
    motion_refusal,
    ProgramRun,
    REST_TIMEOUT,
    START_TIMEOUT,
    Surprise,
)
from ur_cartesian_driver.robot.rtde.probe import read_state

RECORDED = (
    'timestamp', 'target_q', 'actual_q', 'target_TCP_pose', 'target_TCP_speed', 'runtime_state',
    'safety_mode', 'target_speed_fraction',
)  # fmt: skip
#: Outputs that files contain, in the order of their columns.
_IN_FILE = tuple(name for name in RECORDED if name != 'target_TCP_speed')
#: Time after which a program has ended by itself [s].
LONGEST_PROGRAM = 10.0
#: Time recorded at rest before and after the motion, and how long a program is paused [s].
BEFORE, AFTER, PAUSED = 0.4, 1.0, 0.6
#: Longest wait for the power and the brakes of the arm [s].
POWER_UP_TIMEOUT = 60.0
#: So many packets without motion are rest.
MIN_REST = 20
#: The tool is where it should be within this distance [m].
NEAR = 1e-3


async def power_up(address: RobotAddress) -> None:
    """
    Switch the power of the arm on, and release its brakes.

    :raises OSError: the robot does not answer.
    :raises Surprise: the robot is stopped, or does not power up in time.
    """
    run = ProgramRun(address, ('target_q', 'runtime_state', 'safety_mode', 'robot_mode'))
    try:
        await run.open()
        run.send(encode_command(PrimaryCommand.RUN))
        await run.until(
            lambda row: row['robot_mode'] == RobotMode.RUNNING,
            POWER_UP_TIMEOUT,
            'the arm does not power up (is the robot in remote control?)',
        )
    finally:
        await run.close()


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
    except BaseException as error:
        try:
            run.write(path)
        except OSError as unwritten:  # must not hide what happened to the robot
            error.add_note(f'{path} cannot be written: {unwritten.strerror or unwritten}')
        raise
    else:
        run.write(path)
    finally:
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
        self._experiment, self._state, self._bounds = experiment, state, bounds
        self._run = ProgramRun(address, RECORDED, self._surprise)
        self._recorder = self._run.recorder
        #: Whether a pause was sent.
        self._pauses = False
        #: Number of rows that belong to the experiment.
        self._rows = 0

    async def open(self) -> None:
        await self._run.open()

    async def close(self) -> None:
        await self._run.close()

    async def carry_out(self) -> None:
        """Run the program, with its interruption; leave the arm at rest where it began."""
        experiment, begin = self._experiment, self._recorder.newest
        await self._rest(BEFORE)
        try:
            script = experiment.script(self._state)
            await self._run.start(program(f'identify_{experiment.name}', script))
            if experiment.interruption is not Interruption.NONE:
                await self._interrupt()
            await self._run.ended()
            await self._rest(AFTER)
            self._rows = len(self._recorder.rows)
            if experiment.interruption is Interruption.STOP:
                await self._run.play(return_program(begin['target_TCP_pose'], experiment.back))
        except BaseException as error:
            if not await self._stop():
                error.add_note(
                    'nobody can stop the program, so the arm may move for up to '
                    f'{LONGEST_PROGRAM:g} s more'
                )
            raise
        self._check_end(begin)

    async def _interrupt(self) -> None:
        """Stop the program on its way, or pause and resume it."""
        await self._rest(self._experiment.after)
        if self._experiment.interruption is Interruption.STOP:
            self._run.send(encode_command(PrimaryCommand.STOP_PROGRAM))
            return
        self._pauses = True
        self._run.send(encode_command(PrimaryCommand.PAUSE_PROGRAM))
        await self._run.until(
            lambda row: row['runtime_state'] == RuntimeState.PAUSED,
            START_TIMEOUT,
            'the program does not pause',
        )
        await self._rest(PAUSED)
        self._run.send(encode_command(PrimaryCommand.RESUME_PROGRAM))
        await self._run.until(
            lambda row: row['runtime_state'] == RuntimeState.PLAYING,
            START_TIMEOUT,
            'the program does not resume',
        )
        self._pauses = False

    async def _rest(self, time: float) -> None:
        """Wait for a time by the controller's clock [s]."""
        due = self._recorder.newest['timestamp'] + time
        await self._run.until(
            lambda row: row['timestamp'] >= due, END_TIMEOUT, 'the time stands still'
        )

    def _surprise(self, row: Mapping[str, Any]) -> str:
        """Return what nobody asked for, as a clause; '' = nothing."""
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
            missing = self._experiment.least_turn - float(joints[:, 5].max())
        else:
            far = self._experiment.places(self._state)[-1]
            missing = float(np.linalg.norm(poses[:, :3] - np.array(far), axis=1).min())
        if missing > 5.0 * NEAR:
            raise Surprise('the program ended before the arm was there and back')

    async def _stop(self) -> bool:
        """Stop the program; return whether the arm rests, as far as the connections tell."""
        row = self._recorder.newest
        if row and row['safety_mode'] not in MOVABLE_SAFETY_MODES:
            with contextlib.suppress(OSError):
                await self._rests()  # its ramp belongs to the recording
        was_sent = await self._run.stop()
        try:
            return await self._rests()
        except OSError:
            if was_sent:
                await asyncio.sleep(REST_TIMEOUT)  # without RTDE, wait as long as a stop may take
            return was_sent

    async def _rests(self) -> bool:
        """
        Wait until the target stands still; return whether it does within :data:`REST_TIMEOUT`.

        :raises OSError: RTDE is lost.
        """
        recorder = self._recorder
        place = recorder.names.index('target_q') if recorder.names else 0

        def still(row: Mapping[str, Any]) -> bool:
            rows = recorder.rows[-MIN_REST:]
            return len(rows) == MIN_REST and all(each[place] == row['target_q'] for each in rows)

        return await recorder.wait_for(still, REST_TIMEOUT)

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
