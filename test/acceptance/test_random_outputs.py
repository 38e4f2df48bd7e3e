# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Random goals with outputs by place, leads that overtake one another, and pulses, all in one run.

Lines, rounded corners, splines, dwells; points that are appended, goals that are resumed; pauses,
and sliders that move. The judge (``test/support/output_judge.py``) knows nothing of the plan.
"""

import pytest
from random_cases import cases, SEED
from random_outputs import accepted, verdicts
from robot_in_memory import RobotInMemory

pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.random]


@pytest.mark.parametrize('number', range(cases(500)))
def test_outputs_and_pulses_are_in_place(number):
    robot = RobotInMemory('ur5e')
    case, attempt = accepted(number, robot)
    print(
        f'RANDOM_SEED={SEED}: {number}.{attempt}', case.kind, case.shape, case.speed, case.pauses
    )
    assert [verdict.misses for verdict in verdicts(case, robot) if verdict.misses] == []
