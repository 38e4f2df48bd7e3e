# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Tests that compute go to the workers for them, and every test runs once."""

import os
from pathlib import Path
import re

import pytest

pytest.importorskip('xdist')
from overlap import COMPUTING, is_for_computing, LOW_PRIORITY, rank
from small_suite import run_small_suite

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


def test_acceptance_tests_in_virtual_time_are_named_as_computing():
    for module in sorted((HERE / 'acceptance').glob('test_*.py')):
        text = module.read_text()
        is_virtual = re.search(r'\b(run_cell|RobotInMemory)\b', text)
        reads_clocks = re.search(
            r'ur_sim|subprocess|threading|\bdriver[,)]|import time|SimulatedRobot', text
        )
        if is_virtual and not reads_clocks:
            assert rank(f'test/acceptance/{module.name}') >= 0, module.name


@pytest.mark.slow
@pytest.mark.parametrize('workers', [1, 4])
def test_each_test_runs_once_on_a_worker_of_its_kind(tmp_path, workers):
    modules = {f'{folder}/test_{folder}.py': CASES for folder in ('faults', 'ros')}
    done = run_small_suite(tmp_path, modules, '-n', str(workers), '--overlap')
    assert done.returncode == 0, done.stdout + done.stderr
    ran = [line.split() for line in (tmp_path / 'ran').read_text().splitlines()]
    assert len({(file, number) for _, file, number, _ in ran}) == len(ran) == 40
    for worker, file, _, priority in ran:
        computes = 'faults' in file
        assert computes or not is_for_computing(worker)
        # Else those that share the processor with a worker at a normal one take ten times as long.
        assert int(priority) == min(os.nice(0) + LOW_PRIORITY * computes, 19)
