# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Joint trajectories by the names of the UR driver's controllers."""

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
import pytest

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES, robot_model
from ur_cartesian_driver.sim.motion.imperfect_arm import typical_imperfections

pytestmark = pytest.mark.slow

FOLLOW = 'control_msgs/action/FollowJointTrajectory'
CONTROLLERS = (
    'scaled_joint_trajectory_controller',
    'joint_trajectory_controller',
    'passthrough_trajectory_controller',
)
#: The order of the joints in the UR driver's tests.
JOINTS = (
    'elbow_joint',
    'shoulder_lift_joint',
    'shoulder_pan_joint',
    'wrist_1_joint',
    'wrist_2_joint',
    'wrist_3_joint',
)


def duration(time):
    return Duration(sec=int(time), nanosec=round(time % 1.0 * 1e9))


def trajectory(*points, joints=JOINTS, **fields):
    """Return a trajectory of points (time, positions)."""
    from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

    return JointTrajectory(
        joint_names=list(joints),
        points=[
            JointTrajectoryPoint(
                time_from_start=duration(time), positions=list(positions), **fields
            )
            for time, positions in points
        ],
    )


def beside(ur, offset):
    """Return where the joints are, each turned by an offset [rad], in the order of JOINTS."""
    q = dict(zip(JOINT_NAMES, ur.cell.sim.state().q, strict=True))
    return [q[name] + offset for name in JOINTS]


def goal(client, *points, joints=JOINTS, **fields):
    return client._action_type.Goal(trajectory=trajectory(*points, joints=joints), **fields)


def follow(ur, controller=CONTROLLERS[0]):
    return ur.action(f'/{controller}/follow_joint_trajectory', FOLLOW)


@pytest.mark.parametrize('controller', CONTROLLERS)
def test_a_trajectory_is_executed(ur, controller):
    client, there, feedback = follow(ur, controller), beside(ur, 0.1), []
    scaling = ur.listen('/speed_scaling_state_broadcaster/speed_scaling', 'std_msgs/msg/Float64')
    handle = ur.send(client, goal(client, (1.0, beside(ur, 0.05)), (2.0, there)), feedback)
    assert handle.accepted
    ur.cell.spin_until(lambda: scaling and scaling[-1].data == pytest.approx(100.0))
    status, result = ur.result(handle)
    assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, 0), result.error_string
    assert beside(ur, 0.0) == pytest.approx(there, abs=1e-3)
    assert feedback
    assert set(feedback[-1].joint_names) == set(JOINTS)


def test_the_goal_of_the_integration_tests_ends_in_success(make_ur):
    # The UR driver bounds neither the speed of the tool nor the way to the first point.
    ur = make_ur(max_approach_distance=0.0, max_tool_speed=0.0)
    ur.cell.wait_ready()
    client = follow(ur)
    handle = ur.send(client, goal(client, (6.0, [0.0] * 6), (7.0, [-0.5] * 6), (8.0, [-1.0] * 6)))
    assert handle.accepted
    status, result = ur.result(handle)
    assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, 0), result.error_string


def test_the_joints_have_the_prefix_of_the_driver(make_ur):
    ur = make_ur(tf_prefix='my_ur_')
    ur.cell.wait_ready()
    client = follow(ur)
    joints = [f'my_ur_{name}' for name in JOINTS]
    handle = ur.send(client, goal(client, (1.0, beside(ur, 0.05)), joints=joints))
    assert ur.result(handle)[1].error_code == 0


def test_a_trajectory_back_in_time_is_rejected(ur):
    client = follow(ur)
    illegal = goal(client, (6.0, [0.0] * 6), (3.0, [-0.5] * 6))
    assert not ur.send(client, illegal).accepted


@pytest.mark.parametrize('wrong', ['points', 'joints', 'names', 'sizes', 'moving end', 'past'])
def test_what_a_controller_rejects_is_rejected(ur, wrong, capfd):
    client = follow(ur)
    message = goal(client, (1.0, beside(ur, 0.05)))
    match wrong:
        case 'points':
            message.trajectory.points = []
        case 'joints':
            message.trajectory.joint_names = list(JOINTS[:5])
        case 'names':
            message.trajectory.joint_names = ['left_toe', *JOINTS[1:]]
        case 'sizes':
            message.trajectory.points[0].velocities = [0.0] * 5
        case 'moving end':
            message.trajectory.points[0].velocities = [0.1] * 6
        case 'past':
            message.trajectory.header.stamp.sec = 1
    assert not ur.send(client, message).accepted
    assert 'goal rejected: ' in capfd.readouterr().err


def test_a_trajectory_that_no_arm_can_follow_is_refused_before_it_moves(ur):
    client, q = follow(ur), beside(ur, 0.0)
    message = goal(client, (1.0, q), (1.05, beside(ur, -1.0)), (3.0, beside(ur, -1.5)))
    status, result = ur.result(ur.send(client, message))
    assert status == GoalStatus.STATUS_ABORTED
    # There the arm moves, and the end is PATH_TOLERANCE_VIOLATED.
    assert result.error_code == result.INVALID_GOAL
    assert beside(ur, 0.0) == pytest.approx(q, abs=1e-6)


def test_a_goal_is_cancelled_and_the_arm_stands(ur):
    client = follow(ur)
    handle = ur.send(client, goal(client, (10.0, beside(ur, 0.2))))
    start = ur.cell.sim.state().q
    ur.cell.spin_until(lambda: abs(ur.cell.sim.state().q[0] - start[0]) > 0.02)
    ur.cell.await_(handle.cancel_goal_async())
    status, result = ur.result(handle)
    assert status == GoalStatus.STATUS_CANCELED
    assert result.error_code == result.INVALID_GOAL
    assert ur.cell.sim.state().qd == pytest.approx((0.0,) * 6)
    assert ur.cell.sim.state().q[0] < start[0] + 0.15


def test_a_new_goal_replaces_the_one_of_a_joint_trajectory_controller(ur):
    client, there = follow(ur), beside(ur, 0.1)
    first = ur.send(client, goal(client, (10.0, beside(ur, 0.2))))
    ur.cell.spin_until(lambda: any(ur.cell.sim.state().qd))
    second = ur.send(client, goal(client, (2.0, there)))
    assert ur.result(first)[0] == GoalStatus.STATUS_ABORTED
    assert ur.result(second)[1].error_code == 0
    assert beside(ur, 0.0) == pytest.approx(there, abs=1e-3)


def test_the_pass_through_controller_takes_no_goal_while_one_runs(ur):
    client = follow(ur, CONTROLLERS[2])
    first = ur.send(client, goal(client, (10.0, beside(ur, 0.2))))
    assert not ur.send(client, goal(client, (2.0, beside(ur, 0.1)))).accepted
    ur.cell.await_(first.cancel_goal_async())
    assert ur.result(first)[0] == GoalStatus.STATUS_CANCELED
    again = ur.send(client, goal(client, (2.0, beside(ur, 0.1))))
    assert ur.result(again)[1].error_code == 0


@pytest.mark.parametrize(
    'sim', [{'imperfections': typical_imperfections(robot_model('ur5e'))}], indirect=True
)
@pytest.mark.parametrize(('position', 'code'), [(1e-6, -4), (0.02, 0), (0.0, 0)])
def test_the_path_tolerance_of_a_goal_holds(ur, position, code):
    from control_msgs.msg import JointTolerance

    client = follow(ur)
    tolerance = [JointTolerance(name=name, position=position) for name in JOINTS]
    message = goal(client, (2.0, beside(ur, 0.1)), path_tolerance=tolerance)
    result = ur.result(ur.send(client, message))[1]
    assert result.error_code == code, result.error_string


def test_tolerances_that_a_goal_lacks_are_those_of_the_configuration(ur_interfaces):
    from control_msgs.action import FollowJointTrajectory
    from control_msgs.msg import JointTolerance

    from ur_cartesian_driver.ros.ur_driver_names.trajectory_actions import with_default_tolerances

    given = [JointTolerance(name=JOINTS[0], position=-1.0, velocity=0.5)]
    message = FollowJointTrajectory.Goal(
        trajectory=trajectory((1.0, [0.0] * 6)), path_tolerance=given, goal_tolerance=given
    )
    made = with_default_tolerances(message, JointTolerance)
    assert [entry.name for entry in made.path_tolerance] == list(JOINTS)
    assert [entry.position for entry in made.path_tolerance] == [-1.0] + [0.2] * 5
    assert [entry.position for entry in made.goal_tolerance] == [-1.0] + [0.1] * 5
    assert [entry.velocity for entry in made.goal_tolerance] == [0.5] + [0.2] * 5
    assert list(message.path_tolerance) == given


def test_a_goal_ends_when_its_driver_is_gone(ur):
    handle = ur.send(follow_client := follow(ur), goal(follow_client, (10.0, beside(ur, 0.2))))
    ur.cell.spin_until(lambda: any(ur.cell.sim.state().qd))
    ur.cell.executor.remove_node(ur.cell.node)
    ur.cell.node.destroy_node()
    status, result = ur.result(handle)
    assert status == GoalStatus.STATUS_ABORTED
    assert result.error_code == result.PATH_TOLERANCE_VIOLATED
    assert 'The driver is gone' in result.error_string


def test_without_the_driver_goals_are_rejected(ur):
    client = follow(ur)
    ur.cell.node.destroy_node()
    message = goal(client, (2.0, beside(ur, 0.1)))

    def is_rejected():
        return not ur.send(client, message).accepted

    ur.cell.spin_until(is_rejected)
