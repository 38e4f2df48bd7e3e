# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A signal on ``~/feed_override`` slows the goal that permits it; ``~/status`` says who slows."""

from time import monotonic

import pytest
from std_msgs.msg import Float64

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.msg import DriverStatus
from ur_cartesian_driver.ros.client import GoalClient
from ur_cartesian_driver.ros.topics import LATCHED_QOS

pytestmark = pytest.mark.slow

SPLINE = FollowCartesianTrajectory.Goal.EXECUTION_SPLINE


def test_the_signal_of_a_client_slows_the_goal_and_the_status_says_so(single_cell):
    cell, slowed = single_cell, []
    cell.client_node.create_subscription(
        DriverStatus,
        f'{cell.node.get_name()}/status',
        lambda status: slowed.append(status.slowed_by),
        LATCHED_QOS,
    )
    cell.node.feed_overrides.give(Float64(data=0.5))  # no goal runs: no fault
    goal = cell.goal((3.0, 0.05, 0.0, 0.0), execution=SPLINE)
    goal.feed_override.minimum = 0.1
    goal.feed_override.rate = 5.0
    goal.feed_override.timeout = 60.0
    handle = cell.send(goal)
    begin = monotonic()

    def has_feed(feed):
        return cell.feedback and cell.feedback[-1].feed_override == pytest.approx(feed)

    cell.spin_until(lambda: has_feed(0.1))
    with GoalClient(node=cell.client_node) as client:

        def is_slow():
            client.set_feed_override(0.3)
            return has_feed(0.3)

        cell.spin_until(is_slow, 20.0)
        cell.spin_until(lambda: slowed and slowed[-1] == 'feed override 30%', 8.0)
        _, result = cell.result(handle)
    assert result.error_code == 0, result.error_string
    assert monotonic() - begin > 3.0 / 0.3 - 1.0
    assert any('feed_override: ' in line and 'followed' in line for line in result.report)
