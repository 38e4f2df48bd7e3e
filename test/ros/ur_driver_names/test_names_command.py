# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The node of the names as the process that `ur-cartesian-driver --ur-driver-names` starts."""

import os
import signal
import subprocess
import sys

import pytest
import rclpy
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from ur_interfaces import environment
from waiting import wait_for

pytestmark = pytest.mark.slow

POWER_ON = '/dashboard_client/power_on'


@pytest.fixture
def names_there(ur_interfaces):
    """Return a function that returns whether a node serves the names."""
    context = Context()
    rclpy.init(args=[], context=context)
    node = rclpy.create_node('looking', context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(node)

    def look():
        executor.spin_once(timeout_sec=0.05)
        return POWER_ON in dict(node.get_service_names_and_types())

    yield look
    node.destroy_node()
    executor.shutdown()
    rclpy.shutdown(context=context)


@pytest.mark.parametrize('end', [signal.SIGTERM, signal.SIGKILL])
def test_the_names_come_and_go_with_the_driver(
    sim, parameters_for, names_there, ur_interfaces_prefix, end
):
    arguments = [
        word
        for name, value in parameters_for(sim, robot_loop='process').items()
        for word in ('-p', f'{name}:={str(value).lower()}')
    ]
    module = 'ur_cartesian_driver.ros.node'
    command = [sys.executable, '-m', module, '--ur-driver-names', '--ros-args', *arguments]
    variables = os.environ if ur_interfaces_prefix is None else environment(ur_interfaces_prefix)
    with subprocess.Popen(command, env=variables) as driver:
        try:
            wait_for(names_there, 60.0)
            driver.send_signal(end)
            driver.wait(20.0)
            wait_for(lambda: not names_there(), 60.0)
        finally:
            driver.kill()


@pytest.mark.parametrize(
    ('given', 'sentence'),
    [
        (
            'release:=foxy',
            "Parameter release is 'foxy', but must be one of jazzy, lyrical.",
        ),
        (
            'io_states_rat:=1.0',
            'There is no parameter io_states_rat; did you mean io_states_rate?',
        ),
        ('x:=1', 'There is no parameter x; doc/coming_from/ur_driver.md lists all.'),
    ],
)
def test_a_wrong_parameter_is_a_sentence(private_ros_graph, given, sentence):
    module = 'ur_cartesian_driver.ros.ur_driver_names.names_node'
    done = subprocess.run(
        # As the driver's process passes its own parameters on.
        [sys.executable, '-m', module, '--ros-args', '-p', 'ur_type:=ur5e', '-p', given],
        capture_output=True,
        text=True,
        timeout=60.0,
        check=False,
    )
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == f'ur_driver_names: {sentence}'
