# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Start the UR ROS 2 driver and this one for the same robot; they take turns in moving it.

A program on the pendant has an External Control node for each: the custom port of the first is
50002 (the UR driver's default), that of the second is 50012. doc/beside_the_ur_driver.md says how
they hand the arm over. Needs the package ur_robot_driver.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

PACKAGE = 'ur_cartesian_driver'

ARGUMENTS = [
    DeclareLaunchArgument('ur_type', description='Model of the robot.'),
    DeclareLaunchArgument('robot_ip', description='Address of the robot.'),
    DeclareLaunchArgument(
        'launch_rviz',
        default_value='false',
        choices=['true', 'false'],
        description='Start the RViz of the UR driver.',
    ),
    DeclareLaunchArgument(
        'config_file',
        default_value=PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', 'driver.yaml']),
        description='YAML file with parameters of this driver.',
    ),
]
#: The UR driver has 50001 to 50004.
PORTS = {
    'reverse_port': 50011,
    'script_sender_port': 50012,
    'trajectory_port': 50013,
    'script_command_port': 50014,
}


def generate_launch_description():
    """Return the arguments and both drivers."""
    ur_driver = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(
            PathJoinSubstitution(
                [FindPackageShare('ur_robot_driver'), 'launch', 'ur_control.launch.py']
            )
        ),
        launch_arguments={
            'ur_type': LaunchConfiguration('ur_type'),
            'robot_ip': LaunchConfiguration('robot_ip'),
            'launch_rviz': LaunchConfiguration('launch_rviz'),
            'headless_mode': 'false',
        }.items(),
    )
    names = {
        name: ParameterValue(LaunchConfiguration(name), value_type=str)
        for name in ('ur_type', 'robot_ip')
    }
    driver = Node(
        package=PACKAGE,
        executable='driver',
        parameters=[
            LaunchConfiguration('config_file'),
            {**names, **PORTS, 'headless_mode': False},
        ],
        # The joints and their tf are those of the UR driver.
        remappings=[('joint_states', f'{PACKAGE}/joint_states')],
        output='screen',
        emulate_tty=True,
    )
    return LaunchDescription([*ARGUMENTS, ur_driver, driver])
