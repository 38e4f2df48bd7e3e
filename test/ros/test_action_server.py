# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
from math import nan
from time import monotonic

from action_msgs.msg import GoalStatus
import pytest
from rcl_interfaces.srv import GetParameters
from rclpy.duration import Duration

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.msg import MotionSegment
from ur_cartesian_driver.ros.goals import action_server
from ur_cartesian_driver.ros.messages.packed_points import in_flat_arrays

pytestmark = pytest.mark.slow
SUCCEEDED, ABORTED, CANCELED = (
    GoalStatus.STATUS_SUCCEEDED,
    GoalStatus.STATUS_ABORTED,
    GoalStatus.STATUS_CANCELED,
)


def moving(cell):
    return any(abs(qd) > 0.02 for qd in cell.sim.state().qd)


def far_away(cell):
    """Return a goal that takes 5 s."""
    return cell.goal((5.0, 0.2, 0.2, 0.0))


def later(cell, seconds):
    """Return a goal that is to start some time from now."""
    goal = cell.goal((0.5, 0.0, 0.02, 0.0))
    goal.trajectory.header.stamp = (
        cell.node.get_clock().now() + Duration(seconds=seconds)
    ).to_msg()
    return goal


@pytest.mark.parametrize('form', [lambda goal: goal, in_flat_arrays], ids=['plain', 'packed'])
def test_a_goal_moves_the_arm_and_tells_about_it(cell, form):
    start = cell.T_base_tcp
    status, result = cell.run(form(cell.goal((0.6, 0.03, 0.0, 0.0), (1.2, 0.03, 0.03, 0.0))))
    assert (status, result.error_code) == (SUCCEEDED, ErrorCode.SUCCESSFUL), result.error_string
    assert [line[:8] for line in result.report[:3]] == ['point 0:', 'point 1:', 'clearanc']
    x, y, z = start.position
    assert cell.T_base_tcp.position == pytest.approx((x + 0.03, y + 0.03, z), abs=1e-4)
    assert len(cell.feedback) > 10
    progress = [feedback.progress for feedback in cell.feedback]
    assert progress == sorted(progress)
    assert {feedback.point_index for feedback in cell.feedback} == {0, 1}
    assert cell.feedback[0].header.frame_id == 'base'
    assert cell.feedback[0].controlled_frame == 'tool0_controller'


def test_a_cancelled_goal_stops_the_arm_and_the_next_one_runs(cell):
    handle = cell.send(far_away(cell))
    cell.spin_until(lambda: moving(cell))
    response = cell.await_(handle.cancel_goal_async())
    assert len(response.goals_canceling) == 1
    status, result = cell.result(handle)
    assert (status, result.error_code) == (CANCELED, ErrorCode.CANCELLED), result.error_string
    assert not moving(cell)
    status, result = cell.run(cell.goal((0.5, 0.0, 0.01, 0.0)))
    assert (status, result.error_code) == (SUCCEEDED, 0), result.error_string


def test_where_new_goals_are_rejected_a_second_one_disturbs_nothing(
    no_thread_left, sim, make_cell
):
    cell = make_cell(sim, on_new_goal='reject')
    cell.wait_ready()
    first = cell.send(cell.goal((1.5, 0.05, 0.0, 0.0)))
    cell.spin_until(lambda: moving(cell))
    status, result = cell.run(cell.goal((0.5, 0.0, 0.01, 0.0)))
    assert (status, result.error_code) == (ABORTED, ErrorCode.ROBOT_NOT_READY)
    assert 'Another goal is running' in result.error_string
    malformed = cell.goal()
    status, result = cell.run(malformed)
    assert (status, result.error_code) == (ABORTED, ErrorCode.INVALID_GOAL)
    assert 'trajectory.points is empty' in result.error_string
    status, result = cell.result(first)
    assert (status, result.error_code) == (SUCCEEDED, 0), result.error_string


def _not_a_number(goal):
    goal.trajectory.points[0].pose.position.x = nan


def _unreachable(goal):
    goal.trajectory.points[0].time_from_start.sec = 30
    goal.trajectory.points[0].pose.position.x = -1.5


def _unknown_frame(goal):
    goal.trajectory.header.frame_id = 'moon'


def _two_segments(goal):
    goal.segments = [MotionSegment(), MotionSegment()]


def _unknown_execution(goal):
    goal.execution = 77


def test_refused_goals_end_aborted_with_code_and_sentence_and_nothing_moves(single_cell):
    cell = single_cell
    q = cell.sim.state().q
    for spoil, codes, text in (
        (_not_a_number, (ErrorCode.INVALID_GOAL,), 'trajectory.points[0].pose.position'),
        (_unreachable, (ErrorCode.UNREACHABLE, ErrorCode.INVALID_GOAL), ''),
        (_unknown_frame, (ErrorCode.INVALID_GOAL,), '"moon"'),
        (_two_segments, (ErrorCode.INVALID_GOAL,), 'segments has 2 entries for 1 points'),
        (_unknown_execution, (ErrorCode.INVALID_GOAL,), 'execution is 77'),
    ):
        goal = cell.goal((1.0, 0.02, 0.0, 0.0))
        spoil(goal)
        status, result = cell.run(goal)
        assert status == ABORTED
        assert result.error_code in codes, result.error_string
        assert text in result.error_string
    assert cell.sim.state().q == q


def test_validate_only_plans_and_moves_nothing(single_cell):
    q = single_cell.sim.state().q
    status, result = single_cell.run(single_cell.goal((0.5, 0.02, 0.0, 0.0), validate_only=True))
    assert (status, result.error_code) == (SUCCEEDED, 0)
    assert [line[:8] for line in result.report[:2]] == ['point 0:', 'clearanc']
    assert single_cell.sim.state().q == q
    assert not single_cell.feedback


def test_a_goal_for_later_waits_for_its_time(single_cell):
    cell = single_cell
    begun = monotonic()
    handle = cell.send(later(cell, 1.0))
    cell.spin_until(lambda: moving(cell))
    assert monotonic() - begun > 0.9
    assert cell.result(handle)[0] == SUCCEEDED


def test_goals_beyond_a_number_are_refused_and_the_others_go_on(cell, monkeypatch):
    monkeypatch.setattr(action_server, 'MAX_GOALS', 2)
    cell.wait_ready()
    waiting = [cell.send(later(cell, 30.0)) for _ in range(2)]
    status, result = cell.run(cell.goal((0.4, 0.0, 0.01, 0.0)))
    assert (status, result.error_code) == (ABORTED, ErrorCode.ROBOT_NOT_READY)
    assert '2 goals' in result.error_string
    for handle in waiting:
        cell.await_(handle.cancel_goal_async())
        assert cell.result(handle)[0] == CANCELED
    assert cell.run(cell.goal((0.4, 0.0, 0.01, 0.0)))[1].error_code == 0


def test_a_goal_for_later_can_be_cancelled_before_it_moves(cell):
    q = cell.sim.state().q
    handle = cell.send(later(cell, 30.0))
    cell.await_(handle.cancel_goal_async())
    status, result = cell.result(handle)
    assert (status, result.error_code) == (CANCELED, ErrorCode.CANCELLED)
    assert 'before anything moved' in result.error_string
    assert cell.sim.state().q == q


def test_a_goal_is_cancelled_while_it_is_planned(cell):
    q = cell.sim.state().q
    count = 2_000
    goal = cell.goal(*((0.05 * (i + 1), 0.1 * (i + 1) / count, 0.0, 0.0) for i in range(count)))
    handle = cell.send(goal)
    cell.await_(handle.cancel_goal_async())
    status, result = cell.result(handle)
    assert (status, result.error_code) == (CANCELED, ErrorCode.CANCELLED), result.error_string
    assert cell.sim.state().q == q


def test_a_protective_stop_overtakes_a_cancel(single_cell):
    cell = single_cell
    handle = cell.send(far_away(cell))
    cell.spin_until(lambda: moving(cell))
    cell.sim.protective_stop()
    cell.await_(handle.cancel_goal_async())
    status, result = cell.result(handle)
    assert (status, result.error_code) == (ABORTED, ErrorCode.PROTECTIVE_STOP)


def test_callbacks_go_on_while_a_goal_runs(single_cell):
    """The point of deferring: the executor is free, so the node answers."""
    cell = single_cell
    handle = cell.send(cell.goal((1.5, 0.05, 0.0, 0.0)))
    cell.spin_until(lambda: moving(cell))
    asked = cell.client_node.create_client(GetParameters, '/ur_cartesian_driver/get_parameters')
    cell.spin_until(asked.service_is_ready)
    answer = cell.await_(asked.call_async(GetParameters.Request(names=['ur_type'])))
    assert answer.values[0].string_value == 'ur5e'
    assert moving(cell)
    assert cell.result(handle)[0] == SUCCEEDED


def test_an_executor_that_is_shut_down_first_stops_the_arm_without_a_traceback(single_cell):
    cell = single_cell
    cell.send(far_away(cell))
    cell.spin_until(lambda: moving(cell))
    cell.executor.shutdown()
    cell.node.destroy_node()  # an exception in the goal's thread fails the test
    deadline = monotonic() + 30.0
    while moving(cell):
        assert monotonic() < deadline, 'the arm goes on'
