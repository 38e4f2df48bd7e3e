# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Every fault in every phase of a goal: the matrix of doc/faults.md, in virtual time."""

from typing import Any

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
