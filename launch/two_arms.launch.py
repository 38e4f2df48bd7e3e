# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Start the drivers of two robots, `left` and `right`.

Each has its own namespace for topics, services and the action, its own tf_prefix for joints and
frames, and its own ports on this computer. Copy this file for more arms or other names.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import FindPackageShare

PACKAGE = 'ur_cartesian_driver'

ARGUMENTS = [
    DeclareLaunchArgument('left_robot_ip', description='Address of the left robot.'),
    DeclareLaunchArgument('right_robot_ip', description='Address of the right robot.'),
    DeclareLaunchArgument('left_ur_type', default_value='ur5e', description='Its model.'),
    DeclareLaunchArgument('right_ur_type', default_value='ur5e', description='Its model.'),
    DeclareLaunchArgument(
        'headless_mode',
        default_value='',
        choices=['', 'true', 'false'],
        description='Send the robot programs directly, instead of serving them to the External '
        'Control URCap. Needs remote control on the pendants.',
    ),
    DeclareLaunchArgument(
        'config_file',
        default_value=PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', 'driver.yaml']),
        description='YAML file with parameters for both; the arguments above override it.',
    ),
]
PORTS = ['reverse_port', 'script_sender_port', 'trajectory_port', 'script_command_port']
#: The External Control URCap needs the script sender port: 50002 (left), 50012 (right).
FIRST_PORT = {'left': 50001, 'right': 50011}


def driver(side):
    """Return the driver of one side."""
    own = {name: LaunchConfiguration(f'{side}_{name}') for name in ('robot_ip', 'ur_type')}
    shared = {name: LaunchConfiguration(name) for name in ('headless_mode', 'config_file')}
    ports = {name: str(FIRST_PORT[side] + i) for i, name in enumerate(PORTS)}
    return IncludeLaunchDescription(
        PythonLaunchDescriptionSource(
            PathJoinSubstitution([FindPackageShare(PACKAGE), 'launch', 'driver.launch.py'])
        ),
        launch_arguments={
            **own,
            **shared,
            **ports,
            'namespace': side,
            'tf_prefix': f'{side}_',
        }.items(),
    )


def generate_launch_description():
    """Return the arguments and the two drivers."""
    return LaunchDescription([*ARGUMENTS, driver('left'), driver('right')])
