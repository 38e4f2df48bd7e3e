# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The small parts of the controller: uploads, power, safety, watchdogs, configuration, clock."""

import asyncio
import itertools
import time

from hypothesis import given
from hypothesis import strategies as st
import pytest

from ur_cartesian_driver.motion.state.rtde_state import RobotMode, SafetyMode
from ur_cartesian_driver.sim.clock import RealClock
from ur_cartesian_driver.sim.interfaces.primary_commands import execute_command
from ur_cartesian_driver.sim.programs.rtde_watchdog import Watchdogs
from ur_cartesian_driver.sim.programs.script_upload import (
    UploadDecoder,
    UploadedLine,
    UploadedProgram,
    UploadTooLong,
)
from ur_cartesian_driver.sim.rtde_output_values import output_getter
from ur_cartesian_driver.sim.simulator_config import SimulatorConfig
from ur_cartesian_driver.sim.state.power_and_safety import (
    ArmPower,
    SAFETY_TRANSITIONS,
    SafetyEvent,
    SafetySystem,
    STATUS_BITS,
)

STREAM = (
    b'power on\r\n\n# nothing\ndef a():\n\tif True:\n\t\tb = "end"\n\tend\n# c\nend\n\n'
    b'sec s():\n  sync()\nend\nset speed 0.5\n'
)
ITEMS = [
    UploadedLine('power on'),
    UploadedProgram('def a():\n\tif True:\n\t\tb = "end"\n\tend\n# c\nend\n'),
    UploadedProgram('sec s():\n  sync()\nend\n'),
    UploadedLine('set speed 0.5'),
]


@given(st.lists(st.integers(0, len(STREAM)), max_size=8))
def test_it_does_not_matter_how_a_stream_is_cut(cuts):
    uploads, items = UploadDecoder(), []
    edges = [0, *sorted(cuts), len(STREAM)]
    for start, end in itertools.pairwise(edges):
        items += uploads.feed(STREAM[start:end])
    assert items == ITEMS


@pytest.mark.parametrize(
    'text',
    [
        'def a():\n  sync()\nend # of a\n',
        'def\ta():\n  sync()\nend\n',
        'sec a():\nif True:\nsync()\nend\nend\n',
        'def a():\nsec = 1\nwhile True:\nsync()\nend\nend\n',
    ],
)
def test_a_program_ends_at_its_own_end(text):
    stop = b'stop program\n'
    items = UploadDecoder().feed(text.encode() + stop)
    assert items == [UploadedProgram(text), UploadedLine('stop program')]


def test_a_program_without_end_is_not_collected_for_ever():
    uploads = UploadDecoder()
    uploads.feed(b'def a():\n' + (b'  ' + b'x' * 2**16 + b'\n') * 15)
    assert uploads.feed(b'x' * 2**17) == [UploadTooLong()]
    assert uploads.feed(b'x' * 2**21) == []
    assert uploads.feed(b'x\n  end\ndef a():\nend\npower off\n') == [UploadedLine('power off')]


def test_one_line_blocks_in_a_program_count_once():
    text = b'def a():\n  if True: sync() end\n  while False: sync() end\nend\n'
    assert UploadDecoder().feed(text) == [UploadedProgram(text.decode())]


@pytest.mark.parametrize('mode', list(SafetyMode))
@pytest.mark.parametrize('event', list(SafetyEvent))
def test_each_safety_event_in_each_mode_is_in_the_table_or_refused(mode, event):
    safety = SafetySystem(unlock_delay=0.0)
    safety.mode = mode
    refusal = safety.step(event, now=100.0)
    target = SAFETY_TRANSITIONS.get(mode, {}).get(event)
    assert bool(refusal) is (target is None)
    assert safety.mode is (target or mode)


def test_every_mode_that_can_be_reached_has_status_bits():
    assert {mode for row in SAFETY_TRANSITIONS.values() for mode in row.values()} <= set(
        STATUS_BITS
    )


def test_unlocking_is_refused_for_the_delay_exactly():
    safety = SafetySystem(unlock_delay=5.0)
    safety.step(SafetyEvent.PROTECTIVE_STOP, now=10.0)
    assert 'wait another 0.1 s' in safety.step(SafetyEvent.UNLOCK, now=14.9)
    assert safety.step(SafetyEvent.UNLOCK, now=15.0) == ''


@pytest.mark.parametrize(
    ('command', 'before', 'after'),
    [
        ('on', RobotMode.POWER_OFF, RobotMode.IDLE),
        ('on', RobotMode.IDLE, RobotMode.IDLE),
        ('on', RobotMode.RUNNING, RobotMode.RUNNING),
        ('release_brakes', RobotMode.POWER_OFF, RobotMode.RUNNING),
        ('release_brakes', RobotMode.IDLE, RobotMode.RUNNING),
    ],
)
def test_power_goes_as_far_as_the_command_says_and_no_farther(command, before, after):
    power = ArmPower(before, power_on_time=1.0, brake_release_time=1.0)
    getattr(power, command)(now=100.0)
    for now in range(100, 120):
        power.step(float(now))
    assert power.mode is after


def test_a_second_command_does_not_begin_the_way_again():
    power = ArmPower(RobotMode.POWER_OFF, power_on_time=1.0, brake_release_time=1.0)
    for tenth in range(25):  # a client repeats its command until it sees the effect
        power.on(tenth / 10)
        power.step(tenth / 10)
    assert power.mode is RobotMode.IDLE


def test_a_watchdog_reports_once_until_it_is_fed_again():
    dogs = Watchdogs()
    dogs.watch('x', frequency=10.0, action='stop', now=0.0)
    assert dogs.expired(0.1) == []
    assert dogs.expired(0.11) == [('x', 'stop')]
    assert dogs.expired(0.2) == []
    dogs.written(('x', 'y'), 0.3)
    assert dogs.expired(0.5) == [('x', 'stop')]
    dogs.watch('x', frequency=0.0, action='stop', now=0.6)
    assert dogs.expired(9.0) == []


@pytest.mark.parametrize(
    ('settings', 'names'),
    [
        ({'model': 'ur6'}, 'ur6'),
        ({'polyscope': 'five'}, 'five'),
        ({'polyscope': '3.15'}, '3.15'),
        ({'model': 'ur5', 'polyscope': '5.21'}, '5.21'),
        ({'power': 'half'}, 'half'),
        ({'frequency': 0.0}, '0.0 Hz'),
        ({'rate': -1.0}, '-1.0'),
        ({'q': (0.0,) * 5}, '5 values'),
        ({'answers': 'yes'}, "answers is 'yes'; give a list of answers"),
    ],
)
def test_a_configuration_that_cannot_be_is_refused_by_name(settings, names):
    with pytest.raises(ValueError, match=names):
        SimulatorConfig(**settings)


@pytest.mark.parametrize(
    ('model', 'cycle', 'version'),
    [
        ('ur5e', 0.002, (5, 21, 0, 0)),
        ('ur10', 0.008, (3, 15, 8, 0)),
        ('ur20', 0.002, (5, 21, 0, 0)),
    ],
)
def test_the_generation_decides_the_cycle_and_the_software(model, cycle, version):
    config = SimulatorConfig(model=model)
    assert (config.cycle, config.version) == (cycle, version)


@pytest.mark.parametrize(
    ('line', 'mode'),
    [
        ('power off', RobotMode.POWER_OFF),
        ('set robotmode run', RobotMode.RUNNING),
        ('power on', RobotMode.RUNNING),
    ],
)
def test_the_script_port_takes_commands(bench, line, mode):
    execute_command(bench.controller, UploadedLine(line), may_send=True)
    bench.wait(2.0)
    assert bench.controller.power.mode is mode


def test_the_script_port_can_stop_pause_and_resume(bench):
    bench.start('while True:\n  sync()\nend')
    states = []
    for line in ('pause program', 'resume program', 'stop program', 'halt'):
        execute_command(bench.controller, UploadedLine(line), may_send=True)
        bench.wait(0.1)
        states.append(bench.programs.state.name)
    assert states == ['PAUSED', 'PLAYING', 'STOPPED', 'STOPPED']


def test_an_error_in_a_bare_line_is_in_its_first_line(bench):
    execute_command(bench.controller, UploadedLine('nonsense(1)'), may_send=True)
    assert bench.log == ['1:1: compile_error_name_not_found:nonsense:']


def test_the_real_clock_does_not_drift():
    async def cycles(count):
        clock, start = RealClock(0.002), time.monotonic()
        for _ in range(count):
            await clock.next_cycle()
        return time.monotonic() - start, clock

    taken, clock = asyncio.run(cycles(50))
    assert taken >= 50 * 0.002 - 1e-4
    if not clock.slips:  # late, but never by more than the last cycle's own lateness
        assert taken <= 50 * 0.002 + clock.lateness().worst + 0.01


def test_a_simulator_that_stood_still_says_so_in_its_time_stamps(bench):
    """A client that compares them with its own clock must not take the next states for old."""

    async def cycles(clock):
        await clock.next_cycle()
        time.sleep(0.15)  # noqa: ASYNC251  the computer is busy
        for _ in range(3):
            await clock.next_cycle()

    clock, start = RealClock(0.002, rate=2.0), time.monotonic()
    asyncio.run(cycles(clock))
    assert clock.slips >= 1
    assert 0.28 <= clock.skipped <= 2.0 * (time.monotonic() - start)
    before = bench.controller.time
    bench.controller.skipped_time = clock.skipped
    assert bench.controller.time == before
    assert output_getter('timestamp', 0.0)(bench.controller) == before + clock.skipped


def test_a_simulator_that_waits_for_a_busy_computer_leaves_no_time_out():
    async def cycles(clock):
        await clock.next_cycle()
        time.sleep(0.15)  # noqa: ASYNC251  the computer is busy
        await clock.next_cycle()

    clock = RealClock(0.002, when_late='wait')
    asyncio.run(cycles(clock))
    assert clock.slips >= 1
    assert clock.skipped == 0.0
