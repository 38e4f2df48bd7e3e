# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The registry of execution modes names, for each of them, a planner and a feeder that exist."""

from __future__ import annotations

import inspect
from pkgutil import resolve_name

import pytest

from ur_cartesian_driver.motion.goal.execution_modes import EXECUTION_MODES, ExecutionMode


def test_every_mode_but_auto_is_registered() -> None:
    assert set(EXECUTION_MODES) == set(ExecutionMode) - {ExecutionMode.AUTO}
    with pytest.raises(KeyError):
        _ = ExecutionMode.AUTO.traits


@pytest.mark.parametrize('mode', EXECUTION_MODES, ids=lambda mode: mode.name)
def test_every_mode_has_a_planner_and_a_feeder(mode: ExecutionMode) -> None:
    planner, feeder = resolve_name(mode.traits.planner), resolve_name(mode.traits.feeder)
    assert list(inspect.signature(planner).parameters) == ['planner']
    assert list(inspect.signature(feeder).parameters) == ['request', 'config']


def test_outputs_are_switched_only_where_the_robot_program_gets_points() -> None:
    for mode, traits in EXECUTION_MODES.items():
        assert not (traits.switches_outputs and traits.streams_setpoints), mode.name
