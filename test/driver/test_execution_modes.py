# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The three tables of execution modes have the same rows: traits, planners, feeders."""

from __future__ import annotations

import inspect

import pytest

from ur_cartesian_driver.driver.loop.goal_machine_factory import FEEDERS
from ur_cartesian_driver.motion.goal.execution_modes import EXECUTION_MODES, ExecutionMode
from ur_cartesian_driver.planning.planner import PLANNERS


def test_every_mode_but_auto_has_traits():
    assert set(EXECUTION_MODES) == set(ExecutionMode) - {ExecutionMode.AUTO}
    with pytest.raises(KeyError):
        _ = ExecutionMode.AUTO.traits


def test_every_mode_has_a_planner_and_a_feeder():
    assert set(PLANNERS) == set(FEEDERS) == set(EXECUTION_MODES)
    for planner in PLANNERS.values():
        assert list(inspect.signature(planner).parameters) == ['planner']
    for feeder in FEEDERS.values():
        assert list(inspect.signature(feeder).parameters) == ['request', 'config']
