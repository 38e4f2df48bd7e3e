# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Fixtures for tests of programs that use the driver; installed as a pytest plugin.

``ur_sim``
    a simulated robot on free ports; ``@pytest.mark.ur_sim(model='ur10e')`` sets fields of its
    :class:`~ur_cartesian_driver.sim.SimulatorConfig`, such as
    ``faults=['protective_stop at 0.35 m']``; ``ur_sim.inject('drop rtde')`` injects a fault
    during a test.
``cartesian_driver``
    the driver's node, connected to ``ur_sim`` and ready for goals; add it to your own executor,
    which has to spin it. ``@pytest.mark.cartesian_driver(max_tool_speed=1.0)`` sets parameters.
``private_ros_graph``
    isolates the nodes of a test run from all others; ``cartesian_driver`` uses it. A test fails
    if rclpy runs in another domain, because its goals could reach a real robot.

pytest imports this module in every project that uses the environment. To keep that fast, heavy
imports are in the fixtures.
"""

from __future__ import annotations

from collections.abc import Iterator
import contextlib
import errno
import os
import socket
import sys
from typing import Any, TYPE_CHECKING

import pytest

from ur_cartesian_driver.simulator_fixture import marker_values, simulated_robot

if TYPE_CHECKING:
    from ur_cartesian_driver.ros import CartesianDriverNode
    from ur_cartesian_driver.sim import SimulatedRobot

#: ROS domains that users rarely choose, the rarest first; 0 to 101 are allowed on all systems.
DOMAINS = range(100, 59, -1)
#: How long the driver may take to connect to the simulator [s].
READY_TIMEOUT = 10.0


def pytest_configure(config: pytest.Config) -> None:
    """Register the markers, and ignore a warning that ROS 2 itself causes."""
    # The warning comes from lark 0.12, which generated messages load by way of rosidl_parser.
    config.addinivalue_line(
        'filterwarnings',
        "ignore:module 'sre_(parse|constants)' is deprecated:DeprecationWarning",
    )
    config.addinivalue_line(
        'markers', 'ur_sim(**config): fields of the SimulatorConfig of the ur_sim fixture'
    )
    config.addinivalue_line(
        'markers', 'cartesian_driver(**parameters): parameters of the cartesian_driver fixture'
    )


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_call(item: pytest.Item) -> None:
    """Check the domain of tests with nodes of their own, once their fixtures are set up."""
    domain = getattr(item, 'funcargs', {}).get('private_ros_graph')
    if domain is not None:
        _check_domain(domain)


@pytest.fixture
def ur_sim(request: pytest.FixtureRequest) -> Iterator[SimulatedRobot]:
    """Yield a simulated robot that listens on free ports, in a thread of this process."""
    yield from simulated_robot(request, 'ur_sim')


@pytest.fixture(scope='session')
def private_ros_graph(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """
    Isolate the nodes of this test run, and yield their ROS domain.

    The graph stays on this computer, in a domain that no other run with this plugin uses, and logs
    go to a temporary folder. Discovery range and log folder are kept if they are set already.
    """
    with contextlib.ExitStack() as stack, pytest.MonkeyPatch.context() as environment:
        domain = next((d for d in DOMAINS if _lock_domain(d, stack)), None)
        if domain is None:
            pytest.fail(
                f'other test runs use all ROS domains from {DOMAINS[-1]} to {DOMAINS[0]}; wait '
                'for them to end',
                pytrace=False,
            )
        for name, value in {
            'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
            'ROS_LOG_DIR': str(tmp_path_factory.mktemp('ros_log')),
        }.items():
            if name not in os.environ:
                environment.setenv(name, value)
        environment.setenv('ROS_DOMAIN_ID', str(domain))
        yield domain


def _lock_domain(domain: int, stack: contextlib.ExitStack) -> bool:
    """Lock a domain until the stack closes; return False if another run has locked it."""
    # The socket has a name in Linux's abstract namespace, and no file. So no user can leave a lock
    # behind that others may not open, and processes with the same network share the lock.
    lock = stack.enter_context(socket.socket(socket.AF_UNIX))
    try:
        lock.bind(f'\0ur_cartesian_driver_test_domain_{domain}')
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            return False
        raise
    return True


def _check_domain(domain: int) -> None:
    """Fail a test whose nodes would be in another domain than the private one."""
    if 'rclpy' not in sys.modules:
        return
    from rclpy.utilities import get_default_context

    context = get_default_context()
    if context.ok() and (other := context.get_domain_id()) != domain:
        pytest.fail(
            f'rclpy runs in ROS domain {other} and not in the private one, {domain}, so the nodes '
            'of this test could reach robots; let the fixture that calls rclpy.init() request '
            'private_ros_graph and name no domain, or call rclpy.shutdown() before',
            pytrace=False,
        )


@pytest.fixture
def cartesian_driver(
    request: pytest.FixtureRequest, private_ros_graph: int, ur_sim: SimulatedRobot
) -> Iterator[CartesianDriverNode]:
    """Yield the driver's node, connected to ``ur_sim`` and ready; destroy it afterwards."""
    import rclpy
    from rclpy.utilities import get_default_context

    from ur_cartesian_driver.ros import CartesianDriverNode

    _check_domain(private_ros_graph)
    parameters: dict[str, Any] = {
        'robot_ip': ur_sim.config.host,
        'ur_type': ur_sim.config.model,
        'headless_mode': True,
        'robot_loop': 'thread',
        'rtde_port': ur_sim.ports.rtde,
        'primary_port': ur_sim.ports.primary,
        'dashboard_port': ur_sim.ports.dashboard,
        'robot_api_port': ur_sim.ports.robot_api,
        'reverse_port': 0,
        'script_sender_port': 0,
        'trajectory_port': 0,
        'script_command_port': 0,
        # Robot, driver and test share one interpreter, which can be busy for longer than 0.2 s.
        'robot_receive_timeout': 1.0,
        'max_state_age': 0.0,
    } | marker_values(request, 'cartesian_driver')
    started_here = not get_default_context().ok()
    if started_here:
        rclpy.init()
    try:
        node = CartesianDriverNode(parameter_overrides=parameters)
        try:
            node.driver.wait_ready(READY_TIMEOUT)
            yield node
        finally:
            node.destroy_node()
    finally:
        if started_here:
            rclpy.shutdown()
