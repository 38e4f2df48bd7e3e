# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Every fault in every phase of a goal: the matrix of doc/faults.md, in virtual time.

A sample of its cells also runs on controllers that schedule the threads of our program otherwise:
new threads begin later, or threads take turns at random. It is drawn anew in each run; the seed is
printed, and ``THREAD_SEED=N`` draws it again. The whole matrix runs on such a controller with
``THREADS='delay 3'`` or ``THREADS='seed 7'``.
"""

import os
from random import Random
from typing import Any, cast

from fault_cell import run_scenario
from fault_goals import BlendGoal, GOALS
from fault_modes import MODES
from fault_table import CONTINUED, HEADLESS, LOCAL, PHASES
import pytest
from robot_cell import run_cell

import ur_cartesian_driver.sim.faults.fault_values as faults

pytestmark = pytest.mark.slow


CONTINUE: dict[str, Any] = {'on_robot_stop': 'continue'}
LOCAL_CONTROL: dict[str, Any] = {'headless': False}
CASES = [
    pytest.param(kind, phases, row, settings | more, id=prefix + where + row.fault)
    for kind, prefix, phases, tables, more in [
        (BlendGoal, '', PHASES, (HEADLESS, LOCAL, CONTINUED), {}),
        *(
            (
                GOALS[mode.name],
                f'{mode.name}: ',
                mode.phases,
                (mode.headless, mode.local, mode.continued),
                mode.settings,
            )
            for mode in MODES
        ),
    ]
    for rows, where, settings in zip(
        tables,
        ('', 'in local control: ', 'continued: '),
        ({}, LOCAL_CONTROL, CONTINUE),
        strict=True,
    )
    for row in rows
]


@pytest.mark.exhaustive
@pytest.mark.parametrize(('kind', 'phases', 'row', 'settings'), CASES)
def test_a_goal_ends_as_the_table_says_and_the_next_one_works(kind, phases, row, settings):
    async def all_phases(cell):
        for phase in row.phases or phases:
            await run_scenario(cell, row.at(phase), phase, kind)

    run_cell(all_phases, **settings)


THREAD_SEED = os.environ.get('THREAD_SEED') or str(Random().randrange(10**6))
#: Cells in the sample.
SAMPLES = 40


@pytest.mark.parametrize('sample', range(SAMPLES))
def test_threads_and_arm_may_be_otherwise(sample):
    draw = Random(f'{THREAD_SEED} {sample}')
    kind, phases, row, settings = cast(tuple[Any, ...], draw.choice(CASES).values)
    phase = draw.choice(list(row.phases or phases))
    threads = draw.choice(['delay 1', 'delay 3', f'seed {draw.randrange(10**6)}'])
    imperfect = draw.choice(['', str(draw.randrange(10**6))])
    arm = f'imperfect arm {imperfect}' if imperfect else 'exact arm'
    print(f'THREAD_SEED={THREAD_SEED}: {threads}, {arm}, {kind.__name__}, {row.fault}, {phase}')

    async def one_phase(cell):
        await run_scenario(cell, row.at(phase), phase, kind)

    run_cell(one_phase, threads=threads, imperfect=imperfect, **settings)


def test_every_fault_that_can_be_injected_is_in_the_table():
    causes = ' '.join(cause for row in HEADLESS for cause in row.cause)
    words = set(causes.split())
    assert {action.value for action in faults.FaultEvent} <= words
    assert {
        'slider',
        'foreign_motion',
        'drop',
        'half_open',
        'silence',
        'delay',
        'throttle',
        'garbage',
        *faults.DEVIATION_SHAPES,
    } <= words
    for interface in ('rtde', 'primary', 'sockets'):
        for kind in ('drop', 'half_open', 'silence', 'delay', 'throttle', 'garbage'):
            assert f'{kind} {interface}' in causes
