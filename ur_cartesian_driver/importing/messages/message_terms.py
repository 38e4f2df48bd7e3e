# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The types of messages, the fields that identify each type, and the treatment of fields."""

from __future__ import annotations

from collections.abc import Collection, Mapping

from ur_cartesian_driver.importing.import_format import honoured, left_out, refused, term_table

PATH, POSE_ARRAY = 'nav_msgs/Path', 'geometry_msgs/PoseArray'
JOINT_TRAJECTORY = 'trajectory_msgs/JointTrajectory'
ROBOT_TRAJECTORY = 'moveit_msgs/RobotTrajectory'
DISPLAY_TRAJECTORY = 'moveit_msgs/DisplayTrajectory'
#: Types of messages with a single pose: each message becomes a point of the path.
POSES = (
    'nav_msgs/Odometry',
    'geometry_msgs/PoseStamped',
    'geometry_msgs/PoseWithCovarianceStamped',
    'geometry_msgs/Pose',
)
OWN_GOAL = 'ur_cartesian_driver/FollowCartesianTrajectory'
#: Goals with the same fields as ours, but with a joint trajectory.
CONTROLLER_GOALS = ('control_msgs/FollowJointTrajectory', 'moveit_msgs/ExecuteTrajectory')
MULTI_DOF = 'trajectory_msgs/MultiDOFJointTrajectory'
_NO_PATH = 'it has no path of the tool'

TERMS = term_table(
    honoured('a path in one message', PATH, POSE_ARRAY, JOINT_TRAJECTORY),
    honoured('a path in one message', ROBOT_TRAJECTORY, DISPLAY_TRAJECTORY, *CONTROLLER_GOALS),
    refused(
        'a path in one message',
        'it is a goal already; ur-cartesian send takes it as it is',
        OWN_GOAL,
        'cartesian_control_msgs/CartesianTrajectory',
    ),
    refused('a path in one message', 'its joints have more than one axis', MULTI_DOF),
    refused(
        'a path in one message',
        'a marker is a drawing; publish a Path',
        'visualization_msgs/Marker',
        'visualization_msgs/MarkerArray',
    ),
    honoured('a path of many messages, a pose each', *POSES),
    refused(
        'a path of many messages, a pose each',
        'publish the pose of the tool as a PoseStamped',
        'tf2_msgs/TFMessage',
        'geometry_msgs/TransformStamped',
        'sensor_msgs/JointState',
        'geometry_msgs/PointStamped',
        'geometry_msgs/Point',
    ),
    refused(
        'other messages',
        _NO_PATH,
        'geometry_msgs/TwistStamped',
        'geometry_msgs/Twist',
        'geometry_msgs/WrenchStamped',
        'geometry_msgs/PolygonStamped',
        'sensor_msgs/PointCloud2',
    ),
    honoured('fields of poses', 'poses', 'header.frame_id', 'header.stamp', 'pose.position'),
    honoured('fields of poses', 'pose.orientation'),
    left_out(
        'fields of poses',
        'a goal has no such field',
        *('header.seq', 'covariance', 'twist', 'child_frame_id'),
    ),
    honoured('fields of joint trajectories', 'joint_names', 'positions', 'time_from_start'),
    left_out('fields of joint trajectories', 'joint positions have no frame', 'header'),
    left_out(
        'fields of joint trajectories',
        'the arm stops, or blends, between joint motions',
        *('velocities', 'accelerations', 'effort'),
    ),
    left_out(
        'fields of joint trajectories',
        'only the joints of the first trajectory are read',
        *('trajectory_start', 'multi_dof_joint_trajectory', 'model_id'),
    ),
    left_out('times of a whole path', 'a goal begins when it is sent', 'stamp'),
)
#: The fields that identify a type: the type of a message is the first one whose fields it has.
_TELLING: Mapping[str, tuple[str, ...]] = {
    PATH: ('poses',),
    JOINT_TRAJECTORY: ('joint_names', 'points'),
    ROBOT_TRAJECTORY: ('joint_trajectory',),
    DISPLAY_TRAJECTORY: ('trajectory', 'trajectory_start'),
    OWN_GOAL: ('trajectory',),
    'visualization_msgs/Marker': ('ns', 'points'),
    'visualization_msgs/MarkerArray': ('markers',),
    'cartesian_control_msgs/CartesianTrajectory': ('points',),
    'nav_msgs/Odometry': ('child_frame_id', 'pose'),
    'geometry_msgs/PoseStamped': ('pose',),
    'geometry_msgs/Pose': ('position', 'orientation'),
    'tf2_msgs/TFMessage': ('transforms',),
    'geometry_msgs/TransformStamped': ('transform',),
    'sensor_msgs/JointState': ('name', 'position'),
    'geometry_msgs/PointStamped': ('point',),
    'geometry_msgs/Point': ('x', 'y', 'z'),
    'geometry_msgs/TwistStamped': ('twist',),
    'geometry_msgs/Twist': ('linear', 'angular'),
    'geometry_msgs/WrenchStamped': ('wrench',),
    'geometry_msgs/PolygonStamped': ('polygon',),
    'sensor_msgs/PointCloud2': ('point_step',),
}


def message_type(fields: Collection[str]) -> str:
    """Return the type of a message by its fields; empty = the type is not in the table."""
    return next((name for name, telling in _TELLING.items() if set(telling) <= set(fields)), '')
