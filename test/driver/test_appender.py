# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Who appends points gets an answer, whatever becomes of the robot loop."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from math import pi
import queue

import pytest

from ur_cartesian_driver.driver.appender import Appender
from ur_cartesian_driver.execution.goal.goal_commands import AnswerAppend
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import InvalidGoal, RobotNotReady
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Goal, Waypoint
from ur_cartesian_driver.motion.state.rtde_state import RobotState
from ur_cartesian_driver.planning import plan, PlanningOptions
from ur_cartesian_driver.planning.append.append_planner import plan_first_part
from ur_cartesian_driver.planning.append.appendable_goal import AppendedPoints

ARM = Arm(robot_model('ur5e'))
Q = (0.3, -pi / 2, pi / 2, -pi / 2, -pi / 2, 0.0)
HOME = ARM.forward(Q)
STATE = RobotState(
    timestamp=0.0, actual_q=Q, target_q=Q, actual_tcp_pose=HOME, target_tcp_pose=HOME
)
OPTIONS = PlanningOptions(self_collision='off')


def point(k):
    x, y, z = HOME.position
    return Waypoint(pose=Pose((x + 0.02 * k, y, z), HOME.quaternion))


@pytest.fixture
def sent():
    """What the robot loop is asked."""
    return queue.SimpleQueue()


@pytest.fixture
def goal(sent):
    """A goal of one point whose robot loop answers as the test says."""

    def made(timeout=60.0):
        part = plan_first_part(
            plan(Goal(waypoints=(point(1),), keep_open=True), STATE, ARM, OPTIONS), ARM, OPTIONS
        )
        return Appender(
            1,
            part,
            planning_inputs=lambda: (ARM, OPTIONS),
            send=sent.put,
            progress=lambda: None,
            timeout=timeout,
        )

    return made


@pytest.fixture
def elsewhere():
    """A thread that appends while the test answers."""
    with ThreadPoolExecutor(1) as pool:
        yield pool


def number(sent):
    return sent.get(timeout=20.0).append_job.number


def test_points_that_are_taken_count_and_refused_ones_do_not(goal, sent, elsewhere):
    appender = goal()
    first = elsewhere.submit(appender.append, AppendedPoints(waypoints=(point(2), point(3))))
    appender.answer(AnswerAppend(number=number(sent)))
    assert first.result(20.0).points == appender.points == 3
    second = elsewhere.submit(appender.append, AppendedPoints(waypoints=(point(4),)))
    appender.answer(AnswerAppend(number=number(sent), refusal='The goal is ending.'))
    with pytest.raises(RobotNotReady, match='The goal is ending'):
        second.result(20.0)
    assert appender.points == 3


def test_the_end_of_the_goal_answers_who_waits_and_all_who_come_later(goal, sent, elsewhere):
    appender = goal()
    waits = elsewhere.submit(appender.append, AppendedPoints(waypoints=(point(2),)))
    asked = number(sent)
    appender.end()
    appender.answer(AnswerAppend(number=asked))  # it comes too late
    for ended in (waits, elsewhere.submit(appender.append, AppendedPoints(last=True))):
        with pytest.raises(RobotNotReady, match='The goal has ended'):
            ended.result(20.0)
    assert sent.empty(), 'nobody is asked any more'


def test_points_that_are_replaced_do_not_count_as_ahead_of_the_arm(sent, elsewhere):
    options = replace(OPTIONS, max_points=3)
    opened = Goal(
        waypoints=tuple(replace(point(k), time=1.0 * k) for k in (1, 2, 3)),
        execution=ExecutionMode.SPLINE,
        keep_open=True,
    )
    appender = Appender(
        1,
        plan_first_part(plan(opened, STATE, ARM, options), ARM, options),
        planning_inputs=lambda: (ARM, options),
        send=sent.put,
        progress=lambda: None,
        timeout=20.0,
    )
    later = tuple(replace(point(k), time=1.0 * k) for k in (4, 5, 6))
    first = elsewhere.submit(appender.append, AppendedPoints(waypoints=later))
    appender.answer(AnswerAppend(number=number(sent)))
    assert first.result(20.0).points == 6
    with pytest.raises(InvalidGoal, match=r'would put 7 points ahead of the arm; the limit is 6'):
        appender.append(AppendedPoints(waypoints=(replace(point(7), time=7.0),)))
    tail = AppendedPoints(
        waypoints=tuple(replace(point(k), time=1.0 * k) for k in (4, 5, 7)), replace_from_point=3
    )
    second = elsewhere.submit(appender.append, tail)
    appender.answer(AnswerAppend(number=number(sent)))
    assert second.result(20.0).points == 6


def test_a_robot_loop_that_does_not_answer_is_not_asked_again(goal, sent):
    """It may have the points or not, and where others would have to begin depends on that."""
    appender = goal(timeout=0.0)
    for waypoints in ((point(2),), (point(2), point(3))):
        with pytest.raises(RobotNotReady, match='did not answer: nothing can be appended'):
            appender.append(AppendedPoints(waypoints=waypoints))
    assert number(sent) == 1
    assert sent.empty()
