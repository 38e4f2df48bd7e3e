# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The driver as a library: mistakes of its users' code do no harm."""

from dataclasses import dataclass, replace
import os
import socket
import threading
from typing import Any

import numpy as np
import pytest
from waiting import wait_for

from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode, InvalidGoal, LocalProtocolError
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.goal.goal import Goal, Segment, Tolerance, Waypoint

pytestmark = [pytest.mark.acceptance, pytest.mark.slow, pytest.mark.both_arms]


@pytest.fixture
def short_goal(home):
    return Goal(waypoints=(Waypoint(pose=home(y=0.01), time=0.3),))


def test_a_callback_that_raises_does_not_cost_the_outcome(driver, short_goal, caplog):
    def defective(_):
        raise LookupError('a defect of the caller')

    motion = driver.start(driver.plan(short_goal), defective)
    motion.add_done_callback(defective)
    assert motion.result(5.0).succeeded
    assert 'a defect of the caller' in caplog.text
    assert driver.execute(short_goal, timeout=5.0).succeeded


def of_user(value: Any) -> Any:
    """Return a value whose type no checker knows."""
    return value


@pytest.mark.parametrize('number', [np.float32, np.float64])
def test_numbers_of_numpy_are_numbers(driver, home, number: Any):
    pose: Any = home(y=0.01)
    point: Any = {
        'pose': Pose(*of_user((np.array(pose.position, dtype=number), np.array(pose.quaternion)))),
        'time': number(0.3),
    }
    parts: Any = {
        'waypoints': [Waypoint(**point)],
        'segments': [Segment(blend_radius=number(0.0))],
        'goal_time_tolerance': number(2.0),
        'path_tolerance': Tolerance(position=of_user(np.full(3, 0.01, dtype=number))),
    }
    goal = Goal(**parts)
    outcome = driver.execute(goal, timeout=5.0)
    assert outcome.succeeded, outcome.text
    assert driver.set_payload(number(0.5), np.zeros(3, dtype=number)).ok


@dataclass(frozen=True)
class MyTolerance(Tolerance):
    """A class that the robot process cannot import."""


def test_what_cannot_be_sent_to_the_robot_process_is_refused_and_leaves_no_motion(
    driver, short_goal
):
    planned = driver.plan(short_goal)
    unpicklable = replace(planned, goal=replace(planned.goal, goal_time_tolerance=lambda: 1.0))
    with pytest.raises(LocalProtocolError, match='StartMotion cannot be sent to the robot proc'):
        driver.start(unpicklable)
    with pytest.raises(LocalProtocolError, match='17 is no service call'):
        driver.call(17)
    assert driver.execute(short_goal, timeout=5.0).succeeded


def test_what_the_robot_process_cannot_read_ends_with_the_reason(make_driver):
    driver = make_driver(robot_loop='process')
    driver.wait_ready(60.0)
    goal = Goal(waypoints=(Waypoint(pose=Pose((0.0, 0.0, -0.01)), time=0.3),))
    goal = replace(goal, T_base_frame=driver.state.actual_tcp_pose)
    planned = driver.plan(goal)
    foreign = replace(planned, goal=replace(planned.goal, path_tolerance=MyTolerance()))
    outcome = driver.start(foreign).result(20.0)
    assert outcome.code is ErrorCode.EXECUTION_FAILED
    assert 'classes that only your program has' in outcome.text
    assert driver.execute(goal, timeout=20.0).succeeded


def test_a_live_target_that_is_none_is_refused_by_name(driver, home):
    for target, age, sentence in (
        ('there', 0.0, "T_base_tcp is 'there', which is no Pose"),
        (home(), float('nan'), 'age is nan s; it must be finite, and at least 0'),
        (home(), -1.0, 'age is -1.0 s'),
        (home(), 'old', "age is 'old', which is no number"),
    ):
        with pytest.raises(InvalidGoal, match=sentence):
            driver.start_live_session(target, age=age)


def test_a_callback_may_close_the_driver(driver, short_goal):
    motion = driver.start(driver.plan(short_goal), lambda _: driver.close())
    assert motion.result(5.0).code in (ErrorCode.CANCELLED, ErrorCode.CONNECTION_LOST)
    assert driver.state is None


def test_after_a_timeout_the_arm_is_free_for_the_next_goal(driver, home, short_goal):
    with pytest.raises(TimeoutError):
        driver.execute(Goal(waypoints=(Waypoint(pose=home(y=0.2), time=4.0),)), timeout=0.5)
    assert driver.execute(short_goal, timeout=5.0).succeeded


def test_a_newer_goal_preempts_a_running_one(driver, home):
    motion = driver.start(driver.plan(Goal(waypoints=(Waypoint(pose=home(y=0.2), time=4.0),))))
    wait_for(lambda: max(map(abs, driver.state.target_qd)) > 0.05)
    beyond = Goal(waypoints=(Waypoint(pose=home(z=-5.0), time=60.0),))
    assert driver.execute(beyond, preempt=True).code is ErrorCode.INVALID_GOAL
    assert (
        driver.execute(Goal(waypoints=(Waypoint(pose=home(), time=1.0),))).code
        is ErrorCode.ROBOT_NOT_READY
    )
    assert driver.rest_state.actual_q != driver.state.actual_q
    assert not motion.done()
    back = Goal(waypoints=(Waypoint(pose=home(), time=1.0),))
    assert driver.execute(back, preempt=True, timeout=10.0).succeeded
    old = motion.result(0.0)
    assert old.code is ErrorCode.PREEMPTED
    assert old.text == 'A newer motion took the place of this one (on the way to point 0).'
    assert driver.rest_state.actual_q == driver.state.actual_q


def test_a_line_back_and_forth_keeps_a_tight_path_tolerance(driver, home):
    """The count of points of the goal before is still in the register when the next one starts."""
    tolerance = Tolerance(position=(0.002,) * 3)
    there = [0.002 * (i + 1) for i in range(10)]
    for positions in (there, there[-2::-1], there, there[-2::-1]):
        goal = Goal(
            path_tolerance=tolerance,
            waypoints=tuple(
                Waypoint(pose=home(y=y), time=0.05 * (i + 1)) for i, y in enumerate(positions)
            ),
        )
        outcome = driver.execute(goal, timeout=10.0)
        assert outcome.succeeded, outcome.text


def test_opening_and_closing_leaves_nothing_behind(make_driver, ur_sim):
    def held():
        return len(os.listdir('/proc/self/fd')) + threading.active_count()

    assert ur_sim.ports.rtde
    before = held()
    make_driver().close()
    wait_for(lambda: held() <= before)
    for _ in range(10):
        make_driver().close()
    wait_for(lambda: held() <= before)  # the simulator, in this process too, hangs up later


def test_the_log_says_what_is_needed_and_when_the_robot_is_ready(make_driver, caplog):
    caplog.set_level('INFO', logger='ur_cartesian_driver')
    driver = make_driver(headless_mode=False)
    wait_for(lambda: 'play a program with the External Control node' in caplog.text)
    driver.resend_robot_program()
    wait_for(lambda: 'ready for goals' in caplog.text)
    assert 'paused' not in caplog.text


def test_the_log_names_a_port_that_is_taken(make_driver, caplog):
    caplog.set_level('INFO', logger='ur_cartesian_driver')
    with socket.create_server(('127.0.0.1', 0)) as server:
        make_driver(reverse_port=server.getsockname()[1])
        wait_for(lambda: 'set reverse_port to a free port' in caplog.text)


NOMINAL = robot_model('ur5e').geometry


@pytest.mark.ur_sim(geometry=replace(NOMINAL, d=(NOMINAL.d[0] + 0.02, *NOMINAL.d[1:])))
@pytest.mark.parametrize(('bound', 'warns'), [(0.01, True), (0.03, False), (0.0, False)])
def test_a_calibration_far_from_the_model_is_warned_of(make_driver, bound, warns, caplog):
    driver = make_driver(max_calibration_difference=bound)
    driver.wait_ready(30.0)
    wait_for(lambda: driver.arm.calibrated)
    driver.close()
    warned = [
        record
        for record in caplog.records
        if 'up to 20.0 mm from the nominal ur5e' in record.getMessage()
    ]
    assert bool(warned) is warns
