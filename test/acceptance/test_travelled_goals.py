# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals with allow_travel on the simulated robot: run, stopped, and planned again."""

import numpy as np
import pytest
from waiting import wait_for

from ur_cartesian_driver.motion.cell.cell import CellBody, PlacedShape
from ur_cartesian_driver.motion.cell.shapes import Box
from ur_cartesian_driver.motion.errors import CollisionPredicted, ErrorCode, InvalidGoal
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, IOCommand, OutputKind, Waypoint

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

OPTIONS = {'max_approach_distance': 0.1, 'joint_velocity': 1.5, 'joint_acceleration': 6.0}


@pytest.fixture
def driver(make_driver):
    made = make_driver(OPTIONS)
    made.wait_ready(30.0)
    return made


def far(home, *places):
    """A goal through places beside home, the first of which is far away."""
    return Goal(
        waypoints=tuple(Waypoint(pose=home(*place)) for place in places),
        io_commands=(
            IOCommand(
                waypoint=1,
                offset=0.0,
                output=OutputKind.STANDARD_DIGITAL,
                pin=3,
                value=1.0,
            ),
        ),
        allow_travel=True,
    )


def test_the_arm_travels_and_then_runs_the_goal_of_the_client(driver, home, record):
    goal = far(home, (0.0, 0.2, -0.05), (0.0, 0.22, -0.05), (0.0, 0.2, -0.02))
    begin, reported = np.array(home().position), []
    with record() as recording:
        motion = driver.start(driver.plan(goal), reported.append)
        assert motion.result(30.0).succeeded
    driver.set_digital_output(OutputKind.STANDARD_DIGITAL, 3, high=False)
    away = recording.positions - begin
    for place in ((0.0, 0.2, 0.0), (0.0, 0.2, -0.05), (0.0, 0.22, -0.05), (0.0, 0.2, -0.02)):
        assert np.linalg.norm(away - place, axis=1).min() < 1e-3  # the approach is from above
    points = [progress.waypoint for progress in reported]
    assert points == sorted(points)
    assert set(points) == {0, 1, 2}


def test_a_goal_that_is_stopped_in_its_travel_is_before_its_first_point(driver, home):
    goal = far(home, (0.0, 0.2, -0.05), (0.0, 0.22, -0.05))
    motion = driver.start(driver.plan(goal))
    wait_for(lambda: driver.progress is not None and driver.progress.time > 0.4, 10.0)
    motion.cancel()
    outcome = motion.result(10.0)
    assert outcome.code is ErrorCode.CANCELLED
    assert (outcome.stopped.point, outcome.stopped.fraction) == (0, 0.0)
    assert not driver.signals.outputs.standard[3]


def test_a_travel_is_planned_again_if_the_arm_has_moved_since(driver, home):
    goal = far(home, (0.0, 0.2, -0.05), (0.0, 0.22, -0.05))
    planned = driver.plan(goal)
    assert driver.renewed(planned) is planned
    driver.execute(Goal(waypoints=(Waypoint(pose=home(z=0.03)),))).raise_for_error()
    stands = driver.state.actual_q
    again = driver.renewed(planned)
    assert again is not planned
    assert again.start == pytest.approx(stands, abs=1e-3)
    assert driver.start(planned).result(30.0).succeeded
    driver.set_digital_output(OutputKind.STANDARD_DIGITAL, 3, high=False)
    end = np.subtract(driver.state.actual_tcp_pose.position, home().position)
    assert end == pytest.approx((0.0, 0.22, -0.05), abs=1e-3)


def test_a_goal_that_has_become_impossible_does_not_move_the_arm(driver, home):
    goal = far(home, (0.0, 0.2, -0.05), (0.0, 0.22, -0.05))
    planned = driver.plan(goal)
    driver.execute(Goal(waypoints=(Waypoint(pose=home(z=0.02)),))).raise_for_error()
    stands = driver.state.actual_q
    around = PlacedShape(Box((0.2, 0.2, 0.2)))
    there = Pose(home(0.0, 0.2, -0.05).position)
    driver.change_cell([CellBody(name='box', shapes=(around,), T_frame_body=there)])
    with pytest.raises(CollisionPredicted, match=r'^The travel to point 0 cannot end: .*box'):
        driver.start(planned)
    assert driver.progress is None
    assert driver.state.actual_q == pytest.approx(stands, abs=1e-3)
    with pytest.raises(InvalidGoal, match='max_approach_distance'):
        driver.plan(Goal(waypoints=goal.waypoints))
