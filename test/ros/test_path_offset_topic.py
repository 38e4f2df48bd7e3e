# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Offsets of a client on ``~/path_offset`` move the tool; wrong ones are refused with a reason."""

from math import nan

from geometry_msgs.msg import Vector3, Vector3Stamped
import pytest

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.motion.errors import DriverError
from ur_cartesian_driver.ros.client import GoalClient

pytestmark = pytest.mark.slow

SERVO = FollowCartesianTrajectory.Goal.EXECUTION_SERVO


def test_offsets_of_a_client_move_the_tool_and_wrong_ones_say_why(single_cell):
    cell, subscriber = single_cell, single_cell.node.path_offsets

    def refusal(vector, frame='', ahead=0.0):
        message = Vector3Stamped(vector=vector)
        message.header.frame_id = frame
        if ahead:
            stamp = cell.node.get_clock().now().nanoseconds + round(ahead * 1e9)
            message.header.stamp.sec, message.header.stamp.nanosec = divmod(stamp, 10**9)
        with pytest.raises(DriverError) as refused:
            subscriber.give(message)
        return str(refused.value)

    subscriber.give(Vector3Stamped())  # no fault: a sensor publishes between goals, too
    goal = cell.goal((5.0, 0.05, 0.0, 0.0), execution=SERVO)  # time enough on a busy computer
    goal.path_offset.limits.z = 0.004
    goal.path_offset.timeout = 5.0
    height = cell.sim.state().T_base_tcp.position[2]
    handle = cell.send(goal)
    cell.spin_until(lambda: cell.feedback)
    assert "'camera', but offsets are in the frame of the path" in refusal(Vector3(), 'camera')
    assert 's in the future, path_offset.timeout is 5 s' in refusal(Vector3(), 'path', ahead=10.0)
    assert 's old, path_offset.timeout is 5 s' in refusal(Vector3(), ahead=-10.0)
    assert 'normal is nan' in refusal(Vector3(z=nan))
    heights = []
    with GoalClient(node=cell.client_node) as client:

        def is_high():
            client.set_path_offset(normal=0.003)
            heights.append(cell.sim.state().T_base_tcp.position[2] - height)
            return heights[-1] > 0.0029

        cell.spin_until(is_high, 20.0)
        _, result = cell.result(handle)
    assert result.error_code == 0, result.error_string
    assert max(heights) < 0.0031
    assert max(feedback.path_offset.z for feedback in cell.feedback) > 0.0029
    assert cell.sim.state().T_base_tcp.position[2] == pytest.approx(height, abs=1e-4)
