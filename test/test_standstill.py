# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A test runs once more if its process stood still or a robot loop was silent, and no other."""

import pytest
from small_suite import run_small_suite

pytest.importorskip('xdist')
pytest.importorskip('pytest_rerunfailures')

CASES = """
import logging
import os
from pathlib import Path
import signal
import subprocess
import time

def stand_still():
    subprocess.Popen(['sh', '-c', f'sleep 0.8; kill -CONT {os.getpid()}'])
    os.kill(os.getpid(), signal.SIGSTOP)
    time.sleep(0.1)  # the watch sees it

def ran(name):
    with Path(name).open('a') as file:
        print('ran', file=file)
    return len(Path(name).read_text().splitlines())

def test_of_time():
    if ran('time') == 1:
        stand_still()
        raise AssertionError

def test_of_a_loop():
    if ran('loop') == 1:
        raise TimeoutError('The robot loop ended unexpectedly, or hangs; wait.')

def test_of_a_logged_loop():
    if ran('log') == 1:
        logging.getLogger('ur_cartesian_driver.loop').error('the robot loop ended unexpectedly')
        raise AssertionError

def test_that_is_wrong():
    ran('wrong')
    raise AssertionError

def test_that_is_always_wrong():
    ran('always')
    stand_still()
    raise AssertionError
"""


@pytest.mark.slow
def test_a_test_runs_again_only_if_the_computer_stood_still(tmp_path):
    done = run_small_suite(tmp_path, {'test_cases.py': CASES})
    assert '2 failed, 3 passed, 4 rerun' in done.stdout, done.stdout + done.stderr
    runs = {
        name: len((tmp_path / name).read_text().splitlines())
        for name in ('time', 'loop', 'log', 'wrong', 'always')
    }
    assert runs == {'time': 2, 'loop': 2, 'log': 2, 'wrong': 1, 'always': 2}
