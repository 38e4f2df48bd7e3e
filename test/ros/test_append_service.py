# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Points that are appended to a running goal by the service of the node."""

import pytest
from rclpy.duration import Duration
from unique_identifier_msgs.msg import UUID

from ur_cartesian_driver.cli import main
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.path import ExecutionMode, Path
from ur_cartesian_driver.ros.client import GoalClient
from ur_cartesian_driver.ros.messages.packed_points import in_flat_arrays
from ur_cartesian_driver.srv import AppendPoints

pytestmark = pytest.mark.slow


class Producer:
    """Appends to the goals of a cell."""

    def __init__(self, cell):
        self.cell = cell
        self._client = cell.client_node.create_client(
            AppendPoints, '/ur_cartesian_driver/append_points'
        )
        cell.spin_until(self._client.service_is_ready)

    def __call__(self, handle, first_index, *steps, goal_id=None, **fields):
        return self.ask(
            AppendPoints.Request(
                goal_id=goal_id or handle.goal_id,
                first_index=first_index,
                points=self.cell.goal(*steps).trajectory.points,
                **fields,
            )
        )

    def ask(self, request):
        return self.cell.await_(self._client.call_async(request), timeout=8.0)


def test_a_goal_is_continued_once_for_each_request_and_ends_with_the_last(single_cell):
    cell = single_cell
    append = Producer(cell)
    handle = cell.send(cell.goal((1.0, 0.03, 0.0, 0.0), keep_open=True))
    request = AppendPoints.Request(
        goal_id=handle.goal_id,
        first_index=1,
        points=cell.goal((2.0, 0.03, 0.03, 0.0), (3.0, 0.0, 0.03, 0.0)).trajectory.points,
    )
    said = append.ask(request)
    assert said.accepted, said.message
    assert (said.points_received, said.message) == (3, '2 points appended, the goal has 3.')
    assert append.ask(request) == said, 'it came twice and was taken once'
    request.points[1].pose.position.z += 0.01
    others = append.ask(request)
    assert (others.accepted, others.points_received) == (False, 3), 'others in the same place'
    assert 'continue with point 3' in others.message
    for index, step, text in (
        (5, (4.0, 0.0, 0.0, 0.0), 'first_index is 5, but the goal has 3 points; append'),
        (2, (4.0, 0.0, 0.0, 0.0), 'first_index is 2, but the goal has 3 points; continue with'),
        (3, (4.0, 3.0, 0.0, 0.0), 'points[3]'),
    ):
        refused = append(handle, index, step)
        assert (refused.accepted, refused.points_received) == (False, 3), refused.message
        assert text in refused.message
    stranger = append(handle, 0, (0.5, 0.0, 0.0, 0.0), goal_id=UUID(uuid=[1] * 16))
    assert 'No goal with this goal_id' in stranger.message
    packed = in_flat_arrays(cell.goal((4.0, 0.0, 0.0, 0.0))).packed
    request = AppendPoints.Request(goal_id=handle.goal_id, first_index=3, packed=packed, last=True)
    assert append.ask(request).accepted
    _, result = cell.result(handle)
    assert result.error_code == ErrorCode.SUCCESSFUL, result.error_string
    assert result.error_string.startswith('All 4 points were')
    assert max(feedback.points_received for feedback in cell.feedback) == 4
    late = append(handle, 4, (3.0, 0.0, 0.0, 0.0))
    assert 'it has ended, or was never sent' in late.message


def test_nothing_is_appended_to_a_goal_that_is_as_long_as_it_is(single_cell):
    append = Producer(single_cell)
    handle = single_cell.send(single_cell.goal((1.0, 0.02, 0.0, 0.0)))
    said = append(handle, 1, (2.0, 0.0, 0.0, 0.0))
    assert said.message == 'The goal was sent without keep_open: nothing can be appended.'
    assert not said.accepted
    _, result = single_cell.result(handle)
    assert result.error_code == ErrorCode.SUCCESSFUL


def test_nobody_waits_for_a_goal_whose_time_is_to_come(single_cell):
    cell = single_cell
    append = Producer(cell)
    goal = cell.goal((1.0, 0.02, 0.0, 0.0), keep_open=True)
    goal.trajectory.header.stamp = (
        cell.client_node.get_clock().now() + Duration(seconds=30)
    ).to_msg()
    handle = cell.send(goal)
    said = append(handle, 1, (2.0, 0.0, 0.0, 0.0))
    assert said.message == 'The goal does not move yet; append its points when it does.'
    cell.await_(handle.cancel_goal_async())
    _, result = cell.result(handle)
    assert result.error_code == ErrorCode.CANCELLED


def test_points_go_to_the_goal_that_moves_not_to_the_oldest(single_cell):
    cell = single_cell
    append = Producer(cell)
    waiting = cell.goal((1.0, 0.02, 0.0, 0.0))
    waiting.trajectory.header.stamp = (
        cell.client_node.get_clock().now() + Duration(seconds=60)
    ).to_msg()
    scheduled = cell.send(waiting)
    nobody = append(None, 2**32 - 1, (2.0, 0.0, 0.0, 0.0), goal_id=UUID())
    assert nobody.message.startswith('No goal runs to which points could be appended')
    tail = cell.goal((2.0, 0.03, 0.03, 0.0), (3.0, 0.0, 0.03, 0.0))
    handle = cell.send(cell.goal((1.0, 0.03, 0.0, 0.0), keep_open=True))
    with cell.spun(), GoalClient() as client:
        appended = client.append_to_running(tail, last=True)
    assert appended.accepted, appended.message
    assert (appended.first_index, appended.points_received) == (1, 3)
    _, result = cell.result(handle)
    assert result.error_code == ErrorCode.SUCCESSFUL, result.error_string
    cell.await_(scheduled.cancel_goal_async())
    cell.result(scheduled)


def test_a_client_replaces_the_tail_of_its_goal_and_appends_to_it(single_cell):
    cell, answers = single_cell, []
    (x, y, z), start = cell.T_base_tcp.position, cell.T_base_tcp

    def path(*points):
        whole, before = Path(start), 0.0
        for time, dy in points:
            whole, before = whole.spline((x, y + dy, z), duration=time - before), time
        return whole

    def act(_feedback):
        if not answers:
            answers.append(client.append(path((3.0, 0.02)), replace_from_time=0.0))
            answers.append(client.append(path((3.0, 0.04), (3.5, 0.05)), replace_from_point=2))
            answers.append(client.append(path((3.8, 0.04))))
            answers.append(client.append(path((4.3, 0.03)), last=True))

    whole = path((1.0, 0.01), (2.5, 0.02), (4.0, 0.0))
    with cell.spun(), GoalClient() as client:
        with pytest.raises(RuntimeError, match='No goal runs'):
            client.append(whole)
        outcome = client.execute(whole.executed_as(ExecutionMode.SPLINE).keep_open(), act)
        with pytest.raises(RuntimeError, match='No goal runs'):
            client.append(last=True)
    assert outcome.succeeded, outcome.text
    late, replaced, appended, end = [answer.result() for answer in answers]
    assert not late.accepted
    assert late.first_index >= 1, late.message
    assert 0.0 < late.first_time <= 2.5, late.message
    assert (replaced.accepted, replaced.first_index) == (True, 2), replaced.message
    assert (appended.accepted, appended.first_index) == (True, 4), appended.message
    assert (end.accepted, end.points_received) == (True, 6), end.message
    assert cell.T_base_tcp.position == pytest.approx((x, y + 0.03, z), abs=1e-4)


def test_a_shell_appends_to_the_goal_of_another_client(single_cell, tmp_path, capsys):
    cell = single_cell
    (x, y, z), start = cell.T_base_tcp.position, cell.T_base_tcp
    tail = tmp_path / 'tail.yaml'
    Path(start).spline((x, y + 0.01, z), duration=2.0).save(tail)

    def append(*options):
        return main(['append', *options]), *capsys.readouterr()

    with cell.spun():
        status, _, said = append('--last')
    assert status == 1
    assert said == 'No goal runs to which points could be appended: send one with keep_open.\n'
    whole = Path(start).spline((x, y + 0.02, z), duration=1.0).executed_as(ExecutionMode.SPLINE)
    handle = cell.send(whole.keep_open().to_message())
    with cell.spun():
        for place in ('--replace-from-time', '--replace-from-point'):
            status, _, said = append(str(tail), place, '0')
            assert status == 1
            assert said.startswith(
                'The points to be replaced have been sent to the robot already; replace'
            )
        status, said, _ = append(str(tail), '--last')
        assert status == 0
        assert said.startswith('1 point appended, the goal has 2')
    _, result = cell.result(handle)
    assert result.error_code == ErrorCode.SUCCESSFUL, result.error_string
    assert cell.T_base_tcp.position == pytest.approx((x, y + 0.01, z), abs=1e-4)


def test_a_defect_is_logged_with_its_traceback(single_cell, capfd):
    cell = single_cell
    handle = cell.send(cell.goal((1.0, 0.02, 0.0, 0.0), keep_open=True))
    run = cell.node.action_server.find_run(bytes(handle.goal_id.uuid))
    run.motion = None
    said = Producer(cell)(handle, 1, (2.0, 0.0, 0.0, 0.0))
    assert said.message.startswith('The driver has a defect, TypeError: ')
    assert 'Traceback' in capfd.readouterr().err
    del run.motion
    cell.await_(handle.cancel_goal_async())
    cell.result(handle)


def test_a_shell_is_asked_for_the_points(capsys):
    assert main(['append']) == 1
    assert capsys.readouterr().err == (
        'ur-cartesian append: which points? Name a file, or end the goal with --last\n'
    )
