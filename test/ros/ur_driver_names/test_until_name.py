# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Contact of the tool: trajectories until it touches, and a watch, by the UR driver's names."""

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
import pytest

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

pytestmark = pytest.mark.slow

NAME = '/trajectory_until_node/execute'
#: Where the simulated tool touches: a face across y, 5 cm beside the tool of a UR5e.
FACE = -0.0833


@pytest.fixture
def sim(request):
    """Return a simulated robot; a test may put bodies around it."""
    config = SimulatorConfig(
        rtde_port=0,
        primary_port=0,
        dashboard_port=0,
        when_late='wait',
        contacts=getattr(request, 'param', ()),
    )
    with SimulatedRobot(config) as robot:
        yield robot


touching = pytest.mark.parametrize('sim', [(f'plane 0 {FACE} 0 0 -1 0',)], indirect=True)


def until(ur):
    return ur.action(NAME, 'ur_msgs/action/FollowJointTrajectoryUntil')


def swing(ur, client, *points, **fields):
    """Return a goal of points (seconds, turn of the base from here)."""
    from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

    pan, *rest = ur.cell.sim.state().q
    return client._action_type.Goal(
        trajectory=JointTrajectory(
            joint_names=list(JOINT_NAMES),
            points=[
                JointTrajectoryPoint(
                    time_from_start=Duration(sec=seconds), positions=[pan + turn, *rest]
                )
                for seconds, turn in points
            ],
        ),
        **fields,
    )


@touching
def test_the_trajectory_ends_where_the_tool_touches(ur):
    client, feedback = until(ur), []
    status, result = ur.result(ur.send(client, swing(ur, client, (3, -0.05), (8, -0.3)), feedback))
    assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, 0), result.error_string
    assert result.until_condition_result == result.TRIGGERED
    assert result.error_string.startswith('The tool touched at ')
    assert ur.cell.T_base_tcp.position[1] == pytest.approx(FACE, abs=1e-3)
    assert feedback[-1].joint_names == list(JOINT_NAMES)


def test_a_trajectory_without_contact_goes_to_its_end(ur):
    client, there = until(ur), ur.cell.sim.state().q[0] - 0.1
    status, result = ur.result(ur.send(client, swing(ur, client, (1, -0.05), (2, -0.1))))
    assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, 0), result.error_string
    assert result.until_condition_result == result.NOT_TRIGGERED
    assert ur.cell.sim.state().q[0] == pytest.approx(there, abs=1e-5)


def test_a_goal_is_cancelled_and_nothing_was_triggered(ur):
    client = until(ur)
    handle = ur.send(client, swing(ur, client, (10, -0.3)))
    ur.cell.spin_until(lambda: any(ur.cell.sim.state().qd))
    assert not ur.send(client, swing(ur, client, (2, 0.1))).accepted
    ur.cell.await_(handle.cancel_goal_async())
    status, result = ur.result(handle)
    assert (status, result.error_code) == (GoalStatus.STATUS_CANCELED, result.INVALID_GOAL)
    assert result.until_condition_result == result.NOT_TRIGGERED
    assert ur.cell.sim.state().qd == pytest.approx((0.0,) * 6)


@touching
def test_other_goals_do_not_end_where_the_tool_touches(ur):
    client = until(ur)
    assert ur.result(ur.send(client, swing(ur, client, (8, -0.3))))[1].error_code == 0
    name = '/joint_trajectory_controller/follow_joint_trajectory'
    plain = ur.action(name, 'control_msgs/action/FollowJointTrajectory')
    status, result = ur.result(ur.send(plain, swing(ur, plain, (3, 0.1))))
    assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, 0), result.error_string


def test_what_the_node_rejects_is_rejected(ur, capfd):
    client = until(ur)
    assert not ur.send(client, swing(ur, client, (2, 0.1), until_type=7)).accepted
    assert 'until_type is 7' in capfd.readouterr().err
    assert not ur.send(client, swing(ur, client)).accepted
    assert 'the trajectory has no points' in capfd.readouterr().err


def test_a_refusal_of_the_driver_was_not_triggered(ur):
    client = until(ur)
    status, result = ur.result(ur.send(client, swing(ur, client, (1, 9.0))))
    assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, result.INVALID_GOAL)
    assert 'max_approach_distance' in result.error_string
    assert result.until_condition_result == result.NOT_TRIGGERED


def watch(ur):
    return ur.action('/tool_contact_controller/detect_tool_contact', 'ur_msgs/action/ToolContact')


@touching
@pytest.mark.parametrize('controller', ['joint_trajectory', 'passthrough_trajectory'])
def test_a_watch_stops_a_trajectory_and_succeeds(ur, controller):
    contact = watch(ur)
    watching = ur.send(contact, contact._action_type.Goal())
    assert watching.accepted
    name = f'/{controller}_controller/follow_joint_trajectory'
    client = ur.action(name, 'control_msgs/action/FollowJointTrajectory')
    moving = ur.send(client, swing(ur, client, (3, -0.05), (8, -0.3)))
    status, _ = ur.result(watching)
    assert status == GoalStatus.STATUS_SUCCEEDED
    assert ur.cell.T_base_tcp.position[1] == pytest.approx(FACE, abs=1e-3)
    status, result = ur.result(moving)
    assert status == GoalStatus.STATUS_ABORTED
    assert result.error_code == result.PATH_TOLERANCE_VIOLATED
    assert 'while detect_tool_contact watched' in result.error_string
    # The watch is over, as that of the UR driver is.
    status, result = ur.result(ur.send(client, swing(ur, client, (3, 0.1))))
    assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, 0), result.error_string


@touching
def test_a_watch_and_a_trajectory_until_contact_both_succeed(ur):
    contact, client = watch(ur), until(ur)
    watching = ur.send(contact, contact._action_type.Goal())
    moving = ur.send(client, swing(ur, client, (3, -0.05), (8, -0.3)))
    status, result = ur.result(moving)
    assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, 0), result.error_string
    assert result.until_condition_result == result.TRIGGERED
    assert ur.result(watching)[0] == GoalStatus.STATUS_SUCCEEDED


def test_a_watch_rejects_another_one_and_is_cancelled(ur, capfd):
    contact = watch(ur)
    for _ in range(2):
        watching = ur.send(contact, contact._action_type.Goal())
        assert watching.accepted
        assert not ur.send(contact, contact._action_type.Goal()).accepted
        assert 'a goal is being executed' in capfd.readouterr().err
        ur.cell.await_(watching.cancel_goal_async())
        assert ur.result(watching)[0] == GoalStatus.STATUS_CANCELED


def test_a_watch_ends_with_the_program(ur, capfd):
    contact = watch(ur)
    watching = ur.send(contact, contact._action_type.Goal())
    assert ur.io('zero_ftsensor').success  # carried out after the watch has begun
    assert ur.io('hand_back_control').success
    assert ur.result(watching)[0] == GoalStatus.STATUS_ABORTED
    assert 'The watch for contact ended with the robot program: ' in capfd.readouterr().err
    assert ur.io('resend_robot_program').success
    watching = ur.send(contact, contact._action_type.Goal())
    ur.cell.await_(watching.cancel_goal_async())
    assert ur.result(watching)[0] == GoalStatus.STATUS_CANCELED
