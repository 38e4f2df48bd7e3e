# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Start a simulated robot controller and the driver for it: no robot, no container needed."""

from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    ExecuteProcess,
    IncludeLaunchDescription,
    Shutdown,
)
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.substitutions import ExecutableInPackage, FindPackageShare

PACKAGE = 'ur_cartesian_driver'

ARGUMENTS = [
    DeclareLaunchArgument('ur_type', default_value='ur5e', description='Model of the robot.'),
    DeclareLaunchArgument(
        'robot_ip',
        default_value='127.0.0.1',
        description='Address at which the simulated controller listens.',
    ),
    DeclareLaunchArgument(
        'polyscope',
        default_value='',
        description='Version of the simulated controller. Empty: the newest for the model.',
    ),
    DeclareLaunchArgument(
        'tf_prefix', default_value='', description='Prefix of joint and frame names.'
    ),
    DeclareLaunchArgument('namespace', default_value='', description='Namespace of the node.'),
    DeclareLaunchArgument(
        'launch_rviz',
        default_value='false',
        choices=['true', 'false'],
        description='Start RViz with the arm and its plan.',
    ),
    DeclareLaunchArgument(
        'ur_driver_names',
        default_value='false',
        choices=['true', 'false'],
        description='Serve the topics, services and actions of the UR ROS 2 driver too.',
    ),
]


def generate_launch_description():
    """Return the simulator and the driver; the end of the simulator ends both."""
    simulator = ExecuteProcess(
        cmd=[
            ExecutableInPackage(package=PACKAGE, executable='sim'),
            '--model',
            LaunchConfiguration('ur_type'),
            '--host',
            LaunchConfiguration('robot_ip'),
            '--polyscope',
            LaunchConfiguration('polyscope'),
        ],
        output='screen',
        on_exit=Shutdown(),
    )
    ports = ['reverse_port', 'script_sender_port', 'trajectory_port', 'script_command_port']
    driver = IncludeLaunchDescription(
        PythonLaunchDescriptionSource(
            PathJoinSubstitution([FindPackageShare(PACKAGE), 'launch', 'driver.launch.py'])
        ),
        launch_arguments={
            **{
                name: LaunchConfiguration(name)
                for name in (
                    'ur_type',
                    'robot_ip',
                    'tf_prefix',
                    'namespace',
                    'launch_rviz',
                    'ur_driver_names',
                )
            },
            'headless_mode': 'true',
            **dict.fromkeys(ports, '0'),  # any free ports: no client needs to know them
        }.items(),
    )
    return LaunchDescription([*ARGUMENTS, simulator, driver])
