# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A simulated robot, the driver, the node with the UR driver's names, and a client of it."""

from typing import Any

import pytest
from rclpy.node import Node
from ur_driver_client import UrDriverClient
from ur_interfaces import built_interfaces, CannotBuild, importable

from ur_cartesian_driver.ros.ur_driver_names.names_node import UrDriverNames
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

WELD = """def weld():
  while True:
    sync()
  end
end
"""


@pytest.fixture
def sim(request):
    """Return a simulated robot that has a program of its own; a test may set more fields."""
    ports = ('rtde_port', 'primary_port', 'dashboard_port', 'robot_api_port')
    fields: dict[str, Any] = {
        **dict.fromkeys(ports, 0),
        'when_late': 'wait',
        'frequency': 125.0,  # each cycle costs computing time
        'programs': {'weld.urp': WELD},
        **getattr(request, 'param', {}),
    }
    config = SimulatorConfig(**fields)
    with SimulatedRobot(config) as robot:
        yield robot


@pytest.fixture(scope='session')
def ur_interfaces_prefix():
    """Build the packages that the UR driver's interface needs, once."""
    try:
        return built_interfaces()
    except CannotBuild as error:
        pytest.skip(str(error))


@pytest.fixture
def ur_interfaces(ur_interfaces_prefix):
    """Let a test import ur_msgs, ur_dashboard_msgs and control_msgs."""
    with importable(ur_interfaces_prefix):
        yield


@pytest.fixture
def make_ur(ur_interfaces, no_thread_left, sim, make_cell):
    """Return a function that makes a client of the UR driver's names, with a robot behind them."""

    def make(names_parameters=None, **driver_parameters):
        cell = make_cell(sim, 'events', **driver_parameters)
        names = UrDriverNames(parameter_overrides=names_parameters, context=cell.context)
        cell.executor.add_node(names)
        cell.names = names
        client = UrDriverClient(cell)
        made.append((names, client))
        return client

    made: list[tuple[Node, UrDriverClient]] = []
    yield make
    for node, client in made:
        client.destroy()
        node.destroy_node()


@pytest.fixture
def ur(make_ur):
    """Return a client of the UR driver's names; the robot is ready for goals."""
    client = make_ur()
    client.cell.wait_ready()
    return client
