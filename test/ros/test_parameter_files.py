# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Parameter files and arguments that are read without a node, against rclpy's own reading."""

import pytest
import rclpy
from rclpy.context import Context

from ur_cartesian_driver.ros.parameters.parameter_files import read_settings, yaml_value
from ur_cartesian_driver.ros.parameters.parameter_table import ParameterError

SCALARS = (
    *('1e-1', '1.0e-1', '1E5', '.5', '5.', '+1', '-2', '0x10', '010', '1_000', '1:30', '0o10'),
    *('on', 'Off', 'yes', 'y', 'N', 'true', 'FALSE', '.inf', '-.inf', '1.e+3', '2020-01-01'),
    *('word', "'1'", '"on"'),
)


@pytest.fixture
def values_of_a_node():
    """Return a function that returns what rclpy makes of the arguments of a node."""
    context = Context()

    def values(*arguments, namespace=''):
        rclpy.init(args=['--ros-args', *arguments], context=context)
        node = rclpy.create_node(
            'ur_cartesian_driver',
            namespace=namespace,
            context=context,
            automatically_declare_parameters_from_overrides=True,
        )
        found = {
            name: node.get_parameter(name).value for name in node.list_parameters([], 0).names
        }
        node.destroy_node()
        return found

    yield values
    rclpy.shutdown(context=context)


def test_scalars_have_the_types_that_ros_gives_them(private_ros_graph, values_of_a_node):
    words = (word for i, text in enumerate(SCALARS) for word in ('-p', f'p{i}:={text}'))
    expected = values_of_a_node(*words)
    for i, text in enumerate(SCALARS):
        value = yaml_value(text, text)
        assert (type(value), value) == (type(expected[f'p{i}']), expected[f'p{i}']), text


@pytest.mark.parametrize(
    'text',
    [
        'left: {ur_cartesian_driver: {ros__parameters: {robot_ip: 10.0.0.1}}}',
        '/**: {ros__parameters: {robot_ip: 10.0.0.2}}\n'
        'left: {ur_cartesian_driver: {ros__parameters: {robot_ip: 10.0.0.1}}}',
        '/left/ur_cartesian_driver: {ros__parameters: {robot_ip: 10.0.0.1}}',
        '/**: {ur_cartesian_driver: {ros__parameters: {robot_ip: 10.0.0.1}}}',
        '/**: {other: {ros__parameters: {robot_ip: 10.0.0.2}}, '
        'ros__parameters: {robot_ip: 10.0.0.1}}',
    ],
)
def test_namespaces_may_be_nested(private_ros_graph, values_of_a_node, tmp_path, text):
    file = tmp_path / 'parameters.yaml'
    file.write_text(text)
    expected = values_of_a_node('--params-file', str(file), namespace='left')
    assert expected['robot_ip'] == '10.0.0.1'
    assert read_settings([file]).driver.robot_ip == '10.0.0.1'


@pytest.mark.parametrize(
    ('text', 'sentence'),
    [
        (
            '/left/ur_cartesian_driver: {ros__parameters: {robot_ip: 10.0.0.1}}\n'
            'right: {ur_cartesian_driver: {ros__parameters: {robot_ip: 10.0.0.2}}}',
            'has parameters for drivers in several namespaces, /left, /right; give',
        ),
        ('/**: {ros__parameters: [a]}', r'ros__parameters of /\*\* must be a mapping; write'),
        ('/**: {ros__parameters: {}}', 'has no parameters for a node ur_cartesian_driver'),
        ('other: {ros__parameters: {robot_ip: 10.0.0.1}}', 'has no parameters for a node'),
        ('- a', 'has no parameters for a node'),
        ('{', 'is not YAML: '),
    ],
)
def test_a_file_that_fits_no_driver_or_two_is_refused(tmp_path, text, sentence):
    file = tmp_path / 'parameters.yaml'
    file.write_text(text)
    with pytest.raises(ParameterError, match=sentence):
        read_settings([file])
