# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A test that failed while the computer stood still runs once more, and no other."""

import os
from pathlib import Path
import subprocess
import sys

import pytest

pytest.importorskip('xdist')
pytest.importorskip('pytest_rerunfailures')

HERE = Path(__file__).resolve().parent
CASES = """
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
    (tmp_path / 'test').mkdir()
    (tmp_path / 'test' / 'test_cases.py').write_text(CASES)
    (tmp_path / 'test' / 'conftest.py').write_text((HERE / 'conftest.py').read_text())
    (tmp_path / 'pytest.ini').write_text(f'[pytest]\npythonpath = {HERE / "support"}\n')
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith('PYTEST_')
    }
    done = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', 'test'],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert '2 failed, 2 passed, 3 rerun' in done.stdout, done.stdout + done.stderr
    runs = {
        name: len((tmp_path / name).read_text().splitlines())
        for name in ('time', 'loop', 'wrong', 'always')
    }
    assert runs == {'time': 2, 'loop': 2, 'wrong': 1, 'always': 2}
