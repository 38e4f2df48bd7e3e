# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
The fixture ``ur_controller``: a simulated robot on free ports; installed as a pytest plugin.

``@pytest.mark.ur_controller(model='ur10e')`` sets fields of its
:class:`~ur_controller_sim.SimulatorConfig`, such as ``faults=['protective_stop at 0.35 m']``.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

from ur_cartesian_driver.simulator_fixture import simulated_robot

if TYPE_CHECKING:
    from ur_cartesian_driver.sim import SimulatedRobot


def pytest_configure(config: pytest.Config) -> None:
    """Register the marker."""
    config.addinivalue_line(
        'markers', 'ur_controller(**config): fields of the SimulatorConfig of that fixture'
    )


@pytest.fixture
def ur_controller(request: pytest.FixtureRequest) -> Iterator[SimulatedRobot]:
    """Yield a simulated robot that listens on free ports, in a thread of this process."""
    yield from simulated_robot(request, 'ur_controller')
