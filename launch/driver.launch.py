# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""
Start the driver node of one robot, with parameters from a file and the command line.

The arguments have the names of the UR ROS 2 driver; the file has what is not given. Two robots
need two namespaces, two tf_prefixes and, on one address, different ports (0: any free port).
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
from launch_ros.substitutions import FindPackageShare

MODELS = [
    'ur3',
    'ur5',
    'ur10',
    'ur3e',
    'ur5e',
    'ur7e',
    'ur10e',
    'ur12e',
    'ur16e',
    'ur8long',
    'ur15',
    'ur18',
    'ur20',
    'ur30',
]
PACKAGE = 'ur_cartesian_driver'

ARGUMENTS = [
    DeclareLaunchArgument(
        'ur_type',
        choices=MODELS,
        description='Model of the robot; a robot that reports another model is refused.',
    ),
    DeclareLaunchArgument('robot_ip', description='Address of the robot.'),
    DeclareLaunchArgument(
        'reverse_ip',
        default_value='',
        description='Address at which the robot reaches this computer (NAT, containers). Unless '
        'the file has one, the local address of the connection to the robot.',
    ),
    DeclareLaunchArgument(
        'headless_mode',
        default_value='',
        choices=['', 'true', 'false'],
        description='Send the robot program directly, instead of serving it to the External '
        'Control URCap. Needs remote control on the pendant.',
    ),
    DeclareLaunchArgument(
        'tf_prefix',
        default_value='',
        description='Prefix of joint and frame names, for example left_.',
    ),
    DeclareLaunchArgument(
        'reverse_port',
        default_value='',
        description='Port to which the robot program connects for control messages.',
    ),
    DeclareLaunchArgument(
        'script_sender_port',
        default_value='',
        description='Port that serves the robot program to the External Control URCap.',
    ),
    DeclareLaunchArgument(
        'trajectory_port',
        default_value='',
        description='Port to which the robot program connects for trajectory points.',
    ),
    DeclareLaunchArgument(
        'script_command_port',
        default_value='',
        description='Port to which the robot program connects for single commands.',
    ),
    DeclareLaunchArgument('namespace', default_value='', description='Namespace of the node.'),
    DeclareLaunchArgument(
        'config_file',
        default_value=PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', 'driver.yaml']),
        description='YAML file with parameters; the arguments above override it.',
    ),
    DeclareLaunchArgument(
        'launch_rviz',
        default_value='false',
        choices=['true', 'false'],
        description='Start RViz with the arm and its plan; the driver then publishes the frames '
        'of the links, so that no robot_state_publisher is needed.',
    ),
    DeclareLaunchArgument(
        'ur_driver_names',
        default_value='false',
        choices=['true', 'false'],
        description='Serve the topics, services and actions of the UR ROS 2 driver too, by a '
        'node of its own.',
    ),
]
STRINGS = ['ur_type', 'robot_ip', 'reverse_ip', 'tf_prefix']
PORTS = ['reverse_port', 'script_sender_port', 'trajectory_port', 'script_command_port']
# Without a type, launch would read a value as YAML: robot_ip 10 would become a number.
TYPES = {'headless_mode': bool, **dict.fromkeys(STRINGS, str), **dict.fromkeys(PORTS, int)}


def driver(context):
    """Return the node of the driver; only arguments that are given override the file."""
    parameters = {
        name: ParameterValue(LaunchConfiguration(name), value_type=type_)
        for name, type_ in TYPES.items()
        if LaunchConfiguration(name).perform(context)
    }
    if LaunchConfiguration('launch_rviz').perform(context) == 'true':
        parameters['publish_link_frames'] = True
    return [
        Node(
            package=PACKAGE,
            executable='driver',
            namespace=LaunchConfiguration('namespace'),
            parameters=[LaunchConfiguration('config_file'), parameters],
            output='screen',
            emulate_tty=True,
        )
    ]


def generate_launch_description():
    """Return the arguments and the nodes."""
    names = Node(
        package=PACKAGE,
        executable='ur_driver_names',
        namespace=LaunchConfiguration('namespace'),
        # A section ur_driver_names of the file has its parameters.
        parameters=[LaunchConfiguration('config_file')],
        output='screen',
        emulate_tty=True,
        condition=IfCondition(LaunchConfiguration('ur_driver_names')),
    )
    rviz = Node(
        package='rviz2',
        executable='rviz2',
        namespace=LaunchConfiguration('namespace'),
        arguments=[
            '--display-config',
            PathJoinSubstitution([FindPackageShare(PACKAGE), 'config', 'driver.rviz']),
            '--fixed-frame',
            [LaunchConfiguration('tf_prefix'), 'base'],
        ],
        condition=IfCondition(LaunchConfiguration('launch_rviz')),
    )
    return LaunchDescription([*ARGUMENTS, OpaqueFunction(function=driver), names, rviz])
