# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Carries out one experiment: records, runs the program, and moves the tool back."""

from __future__ import annotations

import asyncio
from math import dist

import numpy as np

from ur_cartesian_driver.motion.geometry.arrays import Floats
from ur_cartesian_driver.motion.geometry.vectors import vector6
from ur_cartesian_driver.motion.state.rtde_state import RuntimeState
from ur_cartesian_driver.protocol.client_interfaces.primary_messages import (
    encode_command,
    PrimaryCommand,
)
from ur_cartesian_driver.protocol.program.registers import OutputInteger
from ur_cartesian_driver.robot.check.corner_experiment import (
    corner_messages,
    HOST,
    PAUSE_IN,
    PORT,
    SPLINE_TIME,
)
from ur_cartesian_driver.robot.check.experiments import (
    Experiment,
    program,
    return_program,
)
from ur_cartesian_driver.robot.check.finding import RobotAddress
from ur_cartesian_driver.robot.check.motion_samples import MotionSamples
from ur_cartesian_driver.robot.check.program_run import (
    END_TIMEOUT,
    ProgramRun,
    START_TIMEOUT,
    Surprise,
)
from ur_cartesian_driver.robot.check.rtde_recorder import RtdeRecorder
from ur_cartesian_driver.robot.services.rtde_input_writer import speed_slider_write, write_inputs
from ur_cartesian_driver.robot.services.service_calls import SetSpeedSliderCall
from ur_cartesian_driver.robot.transport import TcpConnection, TcpListener

_PIECES_BEGUN = f'output_int_register_{int(OutputInteger.POINTS_BEGUN)}'
_SPLINE_TIME = f'output_double_register_{SPLINE_TIME}'
RECORDED = (
    'timestamp', 'target_q', 'actual_q', 'target_TCP_pose', 'actual_TCP_pose', 'target_TCP_speed',
    'speed_scaling', 'target_speed_fraction', 'runtime_state', 'safety_mode',
    _PIECES_BEGUN, _SPLINE_TIME,
)  # fmt: skip
#: Duration of the pause of a program [s].
PAUSE = 0.5
#: Time recorded before and after the motion [s].
MARGIN = 0.3
#: The tool is moved back if it ends farther than this from its start [m].
NEAR = 1e-4


async def run_experiment(address: RobotAddress, experiment: Experiment) -> MotionSamples:
    """
    Run the motion of an experiment, and return the recorded samples.

    At the end, even after an error, the program is stopped and the slider is restored.

    :raises OSError: a connection fails, or the slider does not move.
    :raises Surprise: the safety system stops the robot, the arm does not move, or the program
        does not end.
    """
    run = ProgramRun(address, RECORDED)
    try:
        await run.open()
        return await _run(address, experiment, run)
    finally:
        await run.close()


async def _run(address: RobotAddress, experiment: Experiment, run: ProgramRun) -> MotionSamples:
    recorder, before = run.recorder, run.recorder.newest
    try:
        if experiment.slider is not None:
            await _set_slider(address, experiment.slider)
        stop_sent = await _move(experiment, run)
        samples = _samples(recorder, stop_sent)
        if dist(recorder.newest['target_TCP_pose'][:3], before['target_TCP_pose'][:3]) > NEAR:
            await run.play(return_program(before['target_TCP_pose']))
        return samples
    finally:
        try:
            await run.stop()
        finally:
            if experiment.slider is not None:
                await _set_slider(address, before['target_speed_fraction'])


async def _move(experiment: Experiment, run: ProgramRun) -> float:
    """Run the program; return the controller's time at the stop command [s]; NaN = none sent."""
    await asyncio.sleep(MARGIN)
    stop_sent = float('nan')
    if experiment.is_corner:
        await _follow_corner(experiment, run)
        return stop_sent
    await run.start(program(experiment.check, experiment.script))
    if experiment.stop_after is not None:
        due = run.recorder.newest['timestamp'] + experiment.stop_after
        await run.wait_for(lambda row: row['timestamp'] >= due, END_TIMEOUT)
        stop_sent = run.recorder.newest['timestamp']
        run.send(encode_command(PrimaryCommand.STOP_PROGRAM))
    await run.ended()
    await asyncio.sleep(MARGIN)
    return stop_sent


async def _follow_corner(experiment: Experiment, run: ProgramRun) -> None:
    """Run the program that follows a corner, and send it the pieces over a socket."""
    recorder = run.recorder
    first, rest = corner_messages(vector6(recorder.newest['target_q']))

    def send(robot: TcpConnection) -> None:
        robot.send(first if experiment.pauses else first + rest)

    listener = TcpListener(
        'corner',
        on_open=send,
        on_data=lambda _: None,
        on_closed=lambda _: None,
        on_refused=lambda _: None,
    )
    host = recorder.connection.local_address
    await listener.open(host, 0, frozenset({recorder.connection.peer_address}))
    try:
        script = experiment.script.replace(HOST, host).replace(PORT, str(listener.port))
        await run.start(program(experiment.check, script))
        if experiment.pauses:
            await _pause(run)
            if listener.connection is not None:
                listener.connection.send(rest)
            run.send(encode_command(PrimaryCommand.RESUME_PROGRAM))
        await run.ended()
        await asyncio.sleep(MARGIN)
    finally:
        listener.close()


async def _pause(run: ProgramRun) -> None:
    """
    Pause the program in the corner for :data:`PAUSE`; return at once if the robot does not pause.

    :raises Surprise: the program does not get as far as the corner.
    """
    if not await run.wait_for(lambda row: row[_PIECES_BEGUN] >= PAUSE_IN, END_TIMEOUT):
        raise Surprise('the program does not follow its pieces')
    run.send(encode_command(PrimaryCommand.PAUSE_PROGRAM))
    if await run.wait_for(lambda row: row['runtime_state'] == RuntimeState.PAUSED, START_TIMEOUT):
        await asyncio.sleep(PAUSE)


async def _set_slider(address: RobotAddress, fraction: float) -> None:
    write = speed_slider_write(SetSpeedSliderCall(fraction=fraction))
    if not await write_inputs(address.host, address.rtde_port, write):
        raise OSError(f'the speed slider does not go to {fraction:.0%}')


def _samples(recorder: RtdeRecorder, stop_sent: float) -> MotionSamples:
    speed = recorder.column('target_TCP_speed')
    return MotionSamples(
        time=recorder.column('timestamp'),
        target_q=recorder.column('target_q'),
        actual_q=recorder.column('actual_q'),
        tool_speed=np.linalg.norm(speed[:, :3], axis=1),
        scaling=recorder.column('speed_scaling'),
        fraction=recorder.column('target_speed_fraction'),
        stop_sent=stop_sent,
        target_distance=_distance(recorder, 'target_TCP_pose'),
        actual_distance=_distance(recorder, 'actual_TCP_pose'),
        spline_time=recorder.column(_SPLINE_TIME),
        pieces_begun=recorder.column(_PIECES_BEGUN),
        runtime_state=recorder.column('runtime_state'),
    )


def _distance(recorder: RtdeRecorder, name: str) -> Floats:
    """Return the distances (n,) [m] of a pose output's positions from the first of them."""
    positions = recorder.column(name)[:, :3]
    distances: Floats = np.linalg.norm(positions - positions[0], axis=1)
    return distances
