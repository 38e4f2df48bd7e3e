# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Tests that compute go to the workers for them, and every test runs once."""

import os
from pathlib import Path
import subprocess
import sys

import pytest

pytest.importorskip('xdist')
from overlap import COMPUTING, is_for_computing

HERE = Path(__file__).resolve().parent
CASES = """
import os
import pytest

@pytest.mark.parametrize('number', range(20))
def test_where_it_runs(number):
    with open('ran', 'a') as ran:
        print(os.environ['PYTEST_XDIST_WORKER'], __file__, number, os.nice(0), file=ran)
"""


@pytest.mark.parametrize('path', COMPUTING)
def test_what_is_named_as_computing_exists(path):
    assert (HERE.parent / path).exists()


@pytest.mark.slow
@pytest.mark.parametrize('workers', [1, 4])
def test_each_test_runs_once_on_a_worker_of_its_kind(tmp_path, workers):
    for folder in ('test/faults', 'test/ros'):
        (tmp_path / folder).mkdir(parents=True)
        (tmp_path / folder / f'test_{Path(folder).name}.py').write_text(CASES)
    (tmp_path / 'test' / 'conftest.py').write_text((HERE / 'conftest.py').read_text())
    (tmp_path / 'pytest.ini').write_text(f'[pytest]\npythonpath = {HERE / "support"}\n')
    environment = {
        name: value for name, value in os.environ.items() if not name.startswith('PYTEST_')
    }
    done = subprocess.run(
        [sys.executable, '-m', 'pytest', '-q', '-n', str(workers), '--overlap', 'test'],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    ran = [line.split() for line in (tmp_path / 'ran').read_text().splitlines()]
    assert len({(file, number) for _, file, number, _ in ran}) == len(ran) == 40
    for worker, file, _, priority in ran:
        if is_for_computing(worker):
            assert 'faults' in file
        else:
            assert int(priority) == os.nice(0)
