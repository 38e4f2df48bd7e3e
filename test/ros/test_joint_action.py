# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""FollowJointTrajectory, with a stand-in for its classes: control_msgs is not on PyPI."""

from importlib import import_module
from importlib.util import find_spec
import sys
from types import ModuleType

from action_msgs.msg import GoalStatus
from builtin_interfaces.msg import Duration
from joint_trajectory_action import (
    Feedback,
    FollowJointTrajectory,
    Goal,
    JointTolerance,
    JointTrajectoryPoint,
    Result,
    StandInHandle,
    StandInServer,
)
import pytest
from rclpy.action.client import ActionClient

from ur_cartesian_driver.kinematics.robot_models import JOINT_NAMES
from ur_cartesian_driver.motion.errors import ErrorCode, InvalidGoal
from ur_cartesian_driver.motion.events import Outcome, PathPlace, Progress
from ur_cartesian_driver.motion.geometry.pose import IDENTITY
from ur_cartesian_driver.motion.goal.joint_goal import JointGoal, JointPoint
from ur_cartesian_driver.motion.goal.joint_goal import JointTolerance as OurTolerance
from ur_cartesian_driver.ros.goals.goal_actions import (
    CartesianAction,
    installed_actions,
    JointAction,
)
from ur_cartesian_driver.ros.messages.joint_messages import (
    joint_error_code,
    joint_feedback,
    joint_goal_from_message,
    joint_result,
)

SIX = (0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
NAME = '~/follow_joint_trajectory'


def goal_to(q, seconds=1.0, **fields):
    message = Goal(**fields)
    message.trajectory.joint_names = list(JOINT_NAMES)
    sec, part = divmod(seconds, 1.0)
    message.trajectory.points = [
        JointTrajectoryPoint(
            positions=list(q), time_from_start=Duration(sec=int(sec), nanosec=int(part * 1e9))
        )
    ]
    return message


def test_the_action_is_there_only_where_control_msgs_is(monkeypatch):
    monkeypatch.setitem(sys.modules, 'control_msgs', None)
    assert [type(action) for action in installed_actions()] == [CartesianAction]
    monkeypatch.setitem(sys.modules, 'ur_msgs', None)  # it may be installed
    package, module = ModuleType('control_msgs'), ModuleType('control_msgs.action')
    vars(module)['FollowJointTrajectory'] = FollowJointTrajectory
    monkeypatch.setitem(sys.modules, 'control_msgs', package)
    monkeypatch.setitem(sys.modules, 'control_msgs.action', module)
    cartesian_action, joint_action = installed_actions()
    assert type(cartesian_action) is CartesianAction
    assert type(joint_action) is JointAction
    assert joint_action.name == NAME
    assert joint_action.action_type is FollowJointTrajectory


def test_the_action_that_waits_for_contact_needs_a_ur_msgs_that_has_it(monkeypatch):
    modules = {name: ModuleType(name) for name in ('control_msgs', 'ur_msgs')}
    modules |= {f'{name}.action': ModuleType(f'{name}.action') for name in modules}
    vars(modules['control_msgs.action'])['FollowJointTrajectory'] = FollowJointTrajectory
    for name, module in modules.items():
        monkeypatch.setitem(sys.modules, name, module)
    assert [type(action) for action in installed_actions()] == [CartesianAction, JointAction]
    vars(modules['ur_msgs.action'])['FollowJointTrajectoryUntil'] = object
    assert installed_actions()[2].name == '~/follow_joint_trajectory_until'


def test_a_control_msgs_that_is_broken_is_not_taken_for_missing(monkeypatch, tmp_path):
    package = tmp_path / 'control_msgs'
    package.mkdir()
    (package / '__init__.py').touch()
    (package / 'action.py').write_text('import no_such_typesupport')
    monkeypatch.delitem(sys.modules, 'control_msgs', raising=False)
    monkeypatch.delitem(sys.modules, 'control_msgs.action', raising=False)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ModuleNotFoundError, match='no_such_typesupport'):
        installed_actions()
    sys.modules.pop('control_msgs')


def test_every_field_of_a_goal_is_read():
    message = goal_to(SIX, 1.5)
    (point,) = message.trajectory.points
    point.velocities, point.accelerations, point.effort = [0.0] * 6, list(SIX), [1.0]
    message.path_tolerance = [JointTolerance('elbow_joint', 0.1, 0.2, -1.0)]
    message.goal_tolerance = [JointTolerance('wrist_1_joint', 0.3, 0.4, 0.0)]
    message.trajectory.header.stamp.sec = 98
    read = joint_goal_from_message(message, now=100 * 10**9, time_tolerance=0.7)
    assert read == JointGoal(
        joint_names=JOINT_NAMES,
        points=(
            JointPoint(
                time=1.5,
                positions=SIX,
                velocities=(0.0,) * 6,
                accelerations=SIX,
                effort=(1.0,),
            ),
        ),
        age=2.0,
        path_tolerance=(
            OurTolerance(name='elbow_joint', position=0.1, velocity=0.2, acceleration=-1.0),
        ),
        goal_tolerance=(OurTolerance(name='wrist_1_joint', position=0.3, velocity=0.4),),
        goal_time_tolerance=0.7,
    )
    message.goal_time_tolerance.sec = -1
    assert joint_goal_from_message(message, now=0, time_tolerance=0.7).goal_time_tolerance == -1.0


@pytest.mark.parametrize('field', ['multi_dof_trajectory', 'component_path_tolerance'])
def test_joints_that_an_arm_has_not_are_refused(field):
    message = goal_to(SIX)
    if field == 'multi_dof_trajectory':
        message.multi_dof_trajectory.points = [object()]
    else:
        message.component_path_tolerance = [object()]
    with pytest.raises(InvalidGoal, match=field):
        joint_goal_from_message(message, now=0, time_tolerance=0.0)


def test_feedback_has_desired_actual_and_error_of_each_joint():
    progress = Progress(
        waypoint=0,
        fraction=0.5,
        desired_pose=IDENTITY,
        actual_pose=IDENTITY,
        desired_q=SIX,
        actual_q=(0.0,) * 6,
        desired_qd=(1.0,) * 6,
        actual_qd=(0.75,) * 6,
        time=2.5,
    )
    stamp = Goal().trajectory.header.stamp
    message = joint_feedback(Feedback, progress, JOINT_NAMES, stamp)
    assert message.joint_names == list(JOINT_NAMES)
    assert message.desired.positions == message.error.positions == list(SIX)
    assert message.error.velocities == [0.25] * 6
    assert message.actual.time_from_start == Duration(sec=2, nanosec=500_000_000)


def test_every_code_of_ours_has_one_of_the_action_and_no_failure_is_successful():
    known = {getattr(Result, name) for name in vars(Result) if name.isupper()}
    for code in ErrorCode:
        result = joint_result(Result, Outcome(code=code, text='Why.'))
        assert result.error_code in known
        assert (result.error_code == 0) == (code is ErrorCode.SUCCESSFUL)
        if code is not ErrorCode.SUCCESSFUL:
            assert result.error_string == f'{code.name}: Why.'
    assert joint_error_code(ErrorCode.COLLISION) is ErrorCode.INVALID_GOAL
    assert joint_error_code(ErrorCode.PROTECTIVE_STOP) is ErrorCode.PATH_TOLERANCE_VIOLATED
    moved = Outcome(
        code=ErrorCode.COLLISION, text='Why.', stopped=PathPlace(point=1, fraction=0.5)
    )
    assert joint_result(Result, moved).error_code == Result.PATH_TOLERANCE_VIOLATED


class JointClient:
    """Sends joint goals to the server of a cell, below rclpy's transport."""

    def __init__(self, cell):
        self.cell, self._action = cell, JointAction(FollowJointTrajectory)
        self._goals = 0
        cell.node.action_server._servers[NAME] = StandInServer()

    @property
    def q(self):
        return self.cell.sim.state().q

    def send(self, offset, seconds, **fields):
        self._goals += 1
        q = [value + offset for value in self.q]
        handle = StandInHandle(goal_to(q, seconds, **fields), self._goals)
        self.cell.node.action_server._begin(self._action, handle)
        return handle

    def moving(self, handle):
        self.cell.spin_until(lambda: handle.feedback or handle.result)
        assert handle.result is None, handle.result
        self.cell.spin_until(lambda: any(abs(qd) > 0.01 for qd in self.cell.sim.state().qd))

    def end(self, handle):
        """Return how a goal ends: status, code, name of our code."""
        self.cell.spin_until(lambda: handle.result)
        name = handle.result.error_string.split(':')[0]
        return handle.status, handle.result.error_code, name


@pytest.mark.slow
def test_a_joint_goal_runs_and_ends_with_codes_of_the_action(single_cell):
    client = JointClient(single_cell)
    begin = client.q
    done = client.send(0.02, 1.0, goal_tolerance=[JointTolerance('elbow_joint', 0.001)])
    status, code, _ = client.end(done)
    assert (status, code) == ('succeeded', 0), done.result
    assert client.q == pytest.approx([value + 0.02 for value in begin], abs=1e-4)
    assert len(done.feedback) > 5

    refused = client.send(100.0, 1.0)
    assert client.end(refused) == ('aborted', Result.INVALID_GOAL, 'INVALID_GOAL')

    cancelled = client.send(0.1, 4.0)
    client.moving(cancelled)
    cancelled.is_cancel_requested = True
    single_cell.node.action_server._cancel(cancelled)
    assert client.end(cancelled) == ('canceled', Result.INVALID_GOAL, 'CANCELLED')

    preempted = client.send(-0.1, 4.0)
    client.moving(preempted)
    status, result = single_cell.run(single_cell.goal((0.5, 0.0, 0.0, 0.01)))
    assert result.error_code == 0, result.error_string
    assert client.end(preempted) == ('aborted', Result.INVALID_GOAL, 'PREEMPTED')

    stopped = client.send(0.1, 4.0)
    client.moving(stopped)
    single_cell.sim.inject('protective_stop')
    assert client.end(stopped) == (
        'aborted',
        Result.PATH_TOLERANCE_VIOLATED,
        'PROTECTIVE_STOP',
    )


if find_spec('control_msgs') is not None:  # with a ROS installation

    @pytest.mark.slow
    def test_a_client_of_control_msgs_is_served_over_ros(single_cell):
        action_type = import_module('control_msgs.action').FollowJointTrajectory
        point_type = import_module('trajectory_msgs.msg').JointTrajectoryPoint
        client = ActionClient(
            single_cell.client_node, action_type, '/ur_cartesian_driver/follow_joint_trajectory'
        )
        single_cell.spin_until(client.server_is_ready)
        begin = single_cell.sim.state().q

        def send(offset, seconds):
            goal = action_type.Goal()
            goal.trajectory.joint_names = list(JOINT_NAMES)
            goal.trajectory.points = [
                point_type(
                    positions=[value + offset for value in begin],
                    time_from_start=Duration(sec=seconds),
                )
            ]
            feedback = []
            handle = single_cell.await_(
                client.send_goal_async(goal, lambda message: feedback.append(message.feedback))
            )
            assert handle.accepted
            return handle, feedback

        handle, feedback = send(0.02, 1)
        status, result = single_cell.result(handle)
        assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, 0), result.error_string
        assert single_cell.sim.state().q == pytest.approx([q + 0.02 for q in begin], abs=1e-4)
        assert list(feedback[-1].joint_names) == list(JOINT_NAMES)
        assert list(feedback[-1].actual.positions) == pytest.approx(
            [q + 0.02 for q in begin], abs=1e-2
        )

        handle, feedback = send(0.1, 4)
        single_cell.spin_until(lambda: feedback)
        single_cell.await_(handle.cancel_goal_async())
        status, result = single_cell.result(handle)
        assert (status, result.error_code) == (GoalStatus.STATUS_CANCELED, Result.INVALID_GOAL)
        assert result.error_string.startswith('CANCELLED: ')
        client.destroy()
