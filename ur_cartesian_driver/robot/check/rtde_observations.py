# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Observe RTDE: software, outputs, stream, state at rest, free inputs."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Mapping

import numpy as np

from ur_cartesian_driver.motion.state.rtde_state import RobotMode, RuntimeState, SafetyMode
from ur_cartesian_driver.protocol.program.registers import OFFSET_INPUTS, SERVO_INPUTS
from ur_cartesian_driver.protocol.rtde.rtde_client import max_frequency, RtdeClientCodec
from ur_cartesian_driver.protocol.rtde.rtde_packages import ControllerVersion
from ur_cartesian_driver.robot.check.finding import (
    Finding,
    note,
    ok,
    problem,
    RobotAddress,
    skipped,
)
from ur_cartesian_driver.robot.check.rtde_recorder import name_in, RtdeRecorder
from ur_cartesian_driver.robot.rtde.rtde_connection import RtdeConnection
from ur_cartesian_driver.robot.rtde.state_decoding import REQUIRED_FIELDS

#: Oldest software that runs the robot program, by major version: older ones cannot add two lists.
MIN_VERSIONS = {3: (3, 14, 3), 5: (5, 9, 4)}
#: Outputs to record in addition to the driver's own recipe.
EXTRA_OUTPUTS = ('target_speed_fraction', 'payload', 'payload_cog', 'payload_inertia')
#: Input registers by purpose; instead of these (24 to 47), the driver can use 24 lower ones.
REGISTER_GROUPS: Mapping[str, tuple[str, ...]] = {
    'SERVO registers': tuple(SERVO_INPUTS),
    'path offset registers': tuple(OFFSET_INPUTS),
}
#: Inputs that the driver writes, by purpose.
INPUT_GROUPS: Mapping[str, tuple[str, ...]] = {
    'speed slider': ('speed_slider_mask', 'speed_slider_fraction'),
    'outputs': ('standard_digital_output_mask', 'standard_digital_output'),
    **REGISTER_GROUPS,
}
#: Time for which this check tries to get the inputs of a closed connection [s]; a goal tries for
#: 0.2 s.
RELEASE_TIMEOUT = 2.0
#: Longest pause between two packets that leaves margin to the timeout of the robot program [s].
MAX_GAP = 0.1
#: Joint speed below which an arm is at rest [rad/s]; more than the noise of the measurement.
REST_SPEED = 5e-3


async def observe_rtde(
    recorder: RtdeRecorder, version: ControllerVersion, seconds: float
) -> list[Finding]:
    """Return the findings after recording the stream for a number of seconds."""
    await asyncio.sleep(seconds)
    findings = [_software(version), _outputs(recorder), _stream(recorder, version)]
    if recorder.rows:
        findings += [_state(recorder), _speed_scaling(recorder), _rest(recorder), _tool(recorder)]
    return findings


def _software(version: ControllerVersion) -> Finding:
    number = version.release
    needed = MIN_VERSIONS.get(version.major)
    data = {'version': str(version)}
    if needed is not None and number < needed:
        oldest = '.'.join(map(str, needed))
        text = f'The software is {version}; the robot program needs {oldest}'
        return problem('software', text, **data)
    return ok('software', f'The software is {version}.', **data)


def _outputs(recorder: RtdeRecorder) -> Finding:
    missing = recorder.missing
    data = {'missing': list(missing)}
    if needed := [name for name in missing if name in REQUIRED_FIELDS]:
        text = f'The robot lacks RTDE outputs that the driver needs: {", ".join(needed)}'
        return problem('rtde_outputs', text, **data)
    if missing:
        return note(
            'rtde_outputs', f'The robot lacks the optional outputs {", ".join(missing)}.', **data
        )
    return ok('rtde_outputs', 'The robot has all RTDE outputs that the driver reads.', **data)


def _stream(recorder: RtdeRecorder, version: ControllerVersion) -> Finding:
    """Compare the clocks of controller and computer, and find pauses and skipped cycles."""
    stamps, arrivals = recorder.column('timestamp'), np.array(recorder.arrivals)
    if len(stamps) < 10:
        return problem('rtde_stream', f'Only {len(stamps)} RTDE packets came in')
    cycle = 1.0 / max_frequency(version)
    steps, gaps = np.diff(stamps), np.diff(arrivals)
    skipped = int(np.sum(np.round(steps / cycle) - 1))
    rate = float(np.polyfit(arrivals, stamps, 1)[0])
    data = {
        'packets': len(stamps),
        'seconds': round(float(arrivals[-1] - arrivals[0]), 3),
        'skipped_cycles': skipped,
        'gap_ms': {
            'median': round(1e3 * float(np.median(gaps)), 3),
            'p99': round(1e3 * float(np.percentile(gaps, 99)), 3),
            'max': round(1e3 * float(gaps.max()), 3),
        },
        'controller_clock_rate': round(rate, 6),
    }
    text = (
        f'{len(stamps)} packets at {1.0 / cycle:g} Hz, {skipped} cycles left out, longest pause '
        f'{1e3 * gaps.max():.1f} ms; the clock of the controller runs {1e6 * (rate - 1.0):+.0f} '
        'ppm against ours.'
    )
    if gaps.max() > MAX_GAP:
        return note('rtde_stream', f'{text} Pauses above 100 ms end goals.', **data)
    return ok('rtde_stream', text, **data)


def _state(recorder: RtdeRecorder) -> Finding:
    modes = {
        'robot_mode': name_in(RobotMode, recorder.newest['robot_mode']),
        'safety_mode': name_in(SafetyMode, recorder.newest['safety_mode']),
        'program': name_in(RuntimeState, recorder.newest['runtime_state']),
    }
    text = 'Arm {robot_mode}, safety {safety_mode}, program {program}.'.format(**modes)
    return ok('state', text, **modes)


def _speed_scaling(recorder: RtdeRecorder) -> Finding:
    scaling, fraction = recorder.column('speed_scaling'), recorder.column('target_speed_fraction')
    if not _is_idle(recorder):
        return skipped('speed_scaling', 'A program runs, or the arm moves')
    data = {'speed_scaling': float(scaling[-1]), 'target_speed_fraction': float(fraction[-1])}
    text = (
        f'At rest speed_scaling is {scaling[-1]:g}, with the slider at {fraction[-1]:.0%} '
        '(recorded on other robots: 0).'
    )
    return (ok if scaling[-1] == 0.0 else note)('speed_scaling', text, **data)


def _rest(recorder: RtdeRecorder) -> Finding:
    """Measure noise and static error of the joints."""
    if not _is_idle(recorder):
        return skipped('rest', 'A program runs, or the arm moves')
    q, target = recorder.column('actual_q'), recorder.column('target_q')
    noise = 1e3 * np.ptp(q, axis=0).max()
    error = 1e3 * np.abs(q - target).max(axis=0).max()
    speed = np.abs(recorder.column('actual_qd')).max()
    return ok(
        'rest',
        f'At rest the joints tremble by {noise:.3f} mrad (peak to peak), up to {speed:.2g} rad/s, '
        f'and rest up to {error:.3f} mrad off their targets.',
        noise_mrad=round(float(noise), 4),
        static_error_mrad=round(float(error), 4),
        max_speed=float(speed),
    )


def _tool(recorder: RtdeRecorder) -> Finding:
    newest = recorder.newest
    offset = [round(value, 6) for value in newest.get('tcp_offset', ())]
    mass = newest.get('payload')
    data = {name: newest.get(name) for name in ('payload', 'payload_cog', 'payload_inertia')}
    text = f'TCP in the flange {offset}, payload {"unknown" if mass is None else f"{mass:g} kg"}'
    return ok('tool', f'{text}: check them on the pendant.', tcp_offset=offset, **data)


def _is_idle(recorder: RtdeRecorder) -> bool:
    return bool(
        recorder.newest['runtime_state'] == RuntimeState.STOPPED
        and np.abs(recorder.column('actual_qd')).max() < REST_SPEED
        and not np.ptp(recorder.column('target_q'), axis=0).any()
    )


async def observe_inputs(address: RobotAddress) -> AsyncIterator[Finding]:
    """Request the inputs without writing them; measure the time until the robot frees them."""
    taken = {}
    for purpose, names in INPUT_GROUPS.items():
        try:
            await _request_inputs(address, names)
        except OSError as error:
            taken[purpose] = str(error)
    if taken:
        lower_is_free = await _has_free_lower_registers(address)
        yield note(
            'rtde_inputs',
            f'The driver cannot write what it needs for {", ".join(taken)}: '
            f'{next(iter(taken.values()))} The registers 0 to 23 are '
            f'{"free" if lower_is_free else "taken, too"}.',
            refused=sorted(taken),
            lower_registers_free=lower_is_free,
        )
        return
    yield ok('rtde_inputs', 'No other client holds the RTDE inputs that the driver writes.')
    loop = asyncio.get_running_loop()
    begin = loop.time()
    names = INPUT_GROUPS['SERVO registers']
    while loop.time() < begin + RELEASE_TIMEOUT:
        try:
            await _request_inputs(address, names)
        except OSError:
            await asyncio.sleep(0.01)
            continue
        passed = loop.time() - begin
        yield (ok if passed < 0.2 else note)(
            'inputs_release',
            f'The inputs of a closed connection are free after {1e3 * passed:.0f} ms '
            '(the driver tries for 200 ms).',
            seconds=round(passed, 4),
        )
        return
    yield note(
        'inputs_release',
        f'The inputs of a closed connection stay taken for {RELEASE_TIMEOUT:g} s.',
    )


async def _has_free_lower_registers(address: RobotAddress) -> bool:
    try:
        for names in REGISTER_GROUPS.values():
            await _request_inputs(address, names, lower_registers=True)
    except OSError:
        return False
    return True


async def _request_inputs(
    address: RobotAddress, names: tuple[str, ...], *, lower_registers: bool = False
) -> None:
    codec = RtdeClientCodec(('timestamp',), names, lower_registers=lower_registers)
    connection = RtdeConnection(codec, lambda *_: None)
    try:
        await connection.open(address.host, address.rtde_port)
    finally:
        connection.close()
