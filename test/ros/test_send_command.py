# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""``ur-cartesian send`` as a process: whatever ends it, no arm moves on alone."""

import os
from pathlib import Path
import signal
import subprocess
from subprocess import PIPE
import sys

import pytest
from waiting import wait_for

pytestmark = pytest.mark.slow

#: A line of 0.25 m in 5 s, to the side of the tool where there is room.
GOAL = """
trajectory: {points: [{time_from_start: {sec: 5}, pose: {position: {x: -0.4919, y: %f, z: 0.4879},
  orientation: {x: 0.70710678, y: 0.70710678, z: 0.0, w: 0.0}}}]}
"""
MOVING = 0.02


class Senders:
    """Starts ``ur-cartesian send`` for goals that last longer than the test."""

    def __init__(self, cell, scratch):
        self._cell = cell
        self._scratch = scratch
        self._running = []

    def start(self, *options, stdout=PIPE, until_moving=True):
        """Return the process, when its goal moves the arm."""
        y = self._cell.sim.state().T_base_tcp.position[1]
        goal = self._scratch / 'goal.yaml'
        goal.write_text(GOAL % (y + (0.25 if y < 0.0 else -0.25)))
        process = self.command(goal, *options, stdout=stdout)
        if until_moving:
            wait_for(lambda: self.moving or process.poll() is not None, 30.0)
            assert process.poll() is None, process.communicate()
        return process

    def command(self, goal, *options, stdout=PIPE):
        """Return the process that sends a goal."""
        process = subprocess.Popen(
            [sys.executable, '-m', 'ur_cartesian_driver.cli', 'send', str(goal), *options],
            stdout=stdout,
            stderr=PIPE,
            text=True,
        )
        self._running.append(process)
        return process

    @property
    def moving(self):
        return max(map(abs, self._cell.sim.state().qd)) > MOVING

    def close(self):
        for process in self._running:
            process.kill()
            process.wait()
            for stream in (process.stdout, process.stderr):
                if stream is not None:
                    stream.close()


@pytest.fixture
def senders(no_thread_left, sim, make_cell, tmp_path):
    """Start senders for a node that runs in a thread."""
    cell = make_cell(sim)
    cell.wait_ready()
    made = Senders(cell, tmp_path)
    hangup = signal.signal(signal.SIGHUP, signal.SIG_DFL)  # senders inherit SIG_IGN from nohup
    with cell.spun():
        yield made
        made.close()
    signal.signal(signal.SIGHUP, hangup)


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_sender_after_its_goal(senders, number):
    process = senders.start()
    process.send_signal(number)
    output, errors = process.communicate(timeout=10.0)
    assert not senders.moving
    assert process.returncode == 128 + number, output + errors
    assert output.splitlines()[-1].startswith('CANCELED, CANCELLED (-16): ')
    assert not errors


def test_a_goal_in_a_pipe_is_read_once_and_not_noted(senders, tmp_path):
    goal, pipe = tmp_path / 'goal.yaml', tmp_path / 'pipe'
    os.mkfifo(pipe)
    whole = senders.start('--validate-only', until_moving=False)
    whole.communicate(timeout=60.0)
    process = senders.command(pipe, '--validate-only')
    with open(pipe, 'w', encoding='utf-8') as end:
        end.write(goal.read_text())
    output, errors = process.communicate(timeout=60.0)
    assert process.returncode == whole.returncode == 0, output + errors
    assert list(tmp_path.glob('*.stopped')) == []


def test_a_goal_that_was_stopped_is_resumed(senders, tmp_path):
    process = senders.start()
    goal, note = tmp_path / 'goal.yaml', tmp_path / 'goal.yaml.stopped'
    whole = goal.read_text()
    goal.write_text('# edited while the arm moves')
    process.send_signal(signal.SIGINT)
    output, _ = process.communicate(timeout=10.0)
    edited = senders.command(goal, '--resume')
    _, errors = edited.communicate(timeout=60.0)
    assert 'the file has changed since the goal was stopped' in errors
    goal.write_text(whole)
    line = output.splitlines()[-2]
    assert line.startswith('stopped on the way to point 0, at '), output
    assert line.endswith(f'"ur-cartesian send --resume {goal}" goes on from there')
    again = senders.command(goal, '--resume')
    output, errors = again.communicate(timeout=60.0)
    assert again.returncode == 0, output + errors
    assert not note.exists()
    frame = 'trajectory: {header: {frame_id: tool0}, points: [{time_from_start: {sec: 5}, '
    goal.write_text(frame + 'pose: {position: {z: 0.1}}}]}')
    relative = senders.command(goal)
    wait_for(lambda: senders.moving or relative.poll() is not None, 30.0)
    relative.send_signal(signal.SIGINT)
    output, _ = relative.communicate(timeout=10.0)
    assert 'it cannot be resumed: ' in output, output
    assert not note.exists()


def test_a_sender_whose_output_is_closed_cancels_its_goal(senders):
    process = senders.start()
    process.stdout.close()
    errors = process.stderr.read()
    assert process.wait(10.0) == 128 + signal.SIGPIPE
    assert not senders.moving
    assert errors.startswith(
        'ur-cartesian send: [Errno 32] Broken pipe; the goal ended CANCELED: '
    )
    assert errors.count('\n') == 1


@pytest.mark.skipif(not Path('/dev/full').exists(), reason='there is no /dev/full')
@pytest.mark.parametrize('full', ['recording', 'output'])
def test_a_sender_on_a_full_disk_cancels_its_goal(senders, full):
    with open('/dev/full', 'w') as disk:
        stdout, record = (PIPE, ['--record', disk.name]) if full == 'recording' else (disk, [])
        process = senders.start(*record, stdout=stdout, until_moving=False)
        _, errors = process.communicate(timeout=10.0)
    assert process.returncode == 1
    assert not senders.moving
    assert 'No space left on device' in errors
    assert '; the goal ended CANCELED: ' in errors
    assert errors.count('\n') == 1


def test_without_cancel_the_goal_goes_on(senders):
    process = senders.start('--no-cancel')
    process.send_signal(signal.SIGTERM)
    assert process.wait(10.0) == 128 + signal.SIGTERM
    assert senders.moving
