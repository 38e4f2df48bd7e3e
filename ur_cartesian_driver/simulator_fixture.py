# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The common part of two pytest fixtures of a simulated robot: ours, and the stand-alone simulator's.

pytest plugins import this module in every project that uses the environment, so the simulator is
imported only when a test starts one.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from ur_cartesian_driver.sim import SimulatedRobot


def simulated_robot(request: pytest.FixtureRequest, marker: str) -> Iterator[SimulatedRobot]:
    """
    Yield a simulated robot that listens on free ports, in a thread of this process.

    :param marker: the marker whose arguments are fields of the robot's :class:`SimulatorConfig`.
    """
    from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

    settings: dict[str, Any] = {
        'rtde_port': 0,
        'primary_port': 0,
        'dashboard_port': 0,
        'when_late': 'wait',
    } | marker_values(request, marker)
    with SimulatedRobot(SimulatorConfig(**settings)) as robot:
        yield robot


def marker_values(request: pytest.FixtureRequest, name: str) -> dict[str, Any]:
    """
    Return the merged arguments of a test's markers; the closest marker has priority.

    The test fails if a marker has an argument without a name.
    """
    values: dict[str, Any] = {}
    for marker in reversed(list(request.node.iter_markers(name))):
        if marker.args:
            pytest.fail(
                f'the marker {name} has the argument {marker.args[0]!r:.60} without a name; write '
                f'@pytest.mark.{name}(NAME=VALUE)',
                pytrace=False,
            )
        values |= marker.kwargs
    return values
