# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A program that reads the points in another way is told from one that is slow or fast."""

from goal_machines import point_machine
import numpy as np
import pytest

from ur_cartesian_driver.execution.goal.goal_commands import Finish, SendControl
from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.execution.monitoring.speed_check import (
    MAX_SLOWDOWN,
    MAX_START_DELAY,
    PEAK_TO_MEAN,
    SPEED_MARGINS,
    SpeedCheck,
)
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import StateReceived, TrajectoryEnded, TrajectoryResult
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.motion.geometry.vectors import ZERO6
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.motion.state.rtde_state import RobotState, RuntimeState
from ur_cartesian_driver.protocol.program.reverse import TrajectoryAction

#: 0.1 m in 1 s, then a turn of 1 rad about z in 2 s, its quaternion with the other sign.
POSES = np.array(
    [
        [0.4, 0.0, 0.2, 0.0, 0.0, 0.0, 1.0],
        [0.5, 0.0, 0.2, 0.0, 0.0, 0.0, 1.0],
        [0.5, 0.0, 0.2, 0.0, 0.0, -np.sin(0.5), -np.cos(0.5)],
    ]
)
PATH = ReferencePath(
    poses=POSES, point=np.array([0, 0, 1], dtype=np.int32), time=np.array([0.0, 1.0, 3.0])
)
FASTEST = PEAK_TO_MEAN * 0.1 + SPEED_MARGINS[0], PEAK_TO_MEAN * 0.5 + SPEED_MARGINS[1]


def twist(v=0.0, w=0.0):
    return (0.0, v, 0.0, 0.0, 0.0, w)


@pytest.mark.parametrize(
    ('moved', 'elapsed', 'planned', 'clause'),
    [
        (twist(FASTEST[0] - 1e-6), 1.0, 1.0, None),
        (twist(FASTEST[0] + 1e-6), 1.0, 1.0, 'm/s'),
        (twist(w=FASTEST[1] - 1e-3), 1.0, 1.0, None),
        (twist(w=FASTEST[1] + 1e-3), 1.0, 1.0, 'rad/s'),
        (ZERO6, MAX_START_DELAY + MAX_SLOWDOWN * 0.5 - 0.01, 0.5, None),
        (
            ZERO6,
            MAX_START_DELAY + MAX_SLOWDOWN * 0.5 + 0.01,
            0.5,
            'controller has come only as far as the plan after 0.50 s',
        ),
    ],
)
def test_the_bounds_follow_from_the_plan(moved, elapsed, planned, clause):
    said = SpeedCheck(PATH).violation(moved, elapsed, planned)
    if clause is None:
        assert said is None
    else:
        assert clause in said
        assert 'wire_dialect' in said


def test_a_path_at_rest_permits_harmless_speeds():
    still = ReferencePath(
        poses=POSES[:1].repeat(2, axis=0),
        point=np.zeros(2, dtype=np.int32),
        time=np.array([0.0, 1.0]),
    )
    assert SpeedCheck(still).violation(twist(0.9 * SPEED_MARGINS[0]), 0.1, 0.0) is None


def robot(time, x=0.4, v=0.0, begun=0, qd=0.0):
    pose = Pose((x, 0.0, 0.2))
    return StateReceived(
        state=RobotState(
            timestamp=time,
            actual_q=ZERO6,
            actual_qd=(qd,) * 6,
            actual_tcp_pose=pose,
            target_tcp_pose=pose,
            actual_tcp_twist=twist(v),
            target_tcp_twist=twist(v),
            runtime_state=RuntimeState.PLAYING,
            points_begun=begun,
        )
    )


def machine(**changes):
    made = point_machine(MotionJob(points=2, reference=PATH, duration=3.0, **changes))
    made.start(robot(0.0).state)
    made.step(robot(0.0), 0.0)
    return made


def is_cancelled(commands):
    return SendControl(action=TrajectoryAction.CANCEL, count=2) in commands


@pytest.mark.parametrize(
    ('begun', 'job', 'stopped'),
    [
        (0, {}, True),
        (1, {}, False),
        (1, {'reports_points_begun': False}, True),
        (0, {'has_speed_profile': False}, False),
    ],
)
def test_only_a_program_without_progress_reports_is_checked(begun, job, stopped):
    made = machine(**job)
    assert is_cancelled(made.step(robot(0.01, x=0.4001, v=0.5, begun=begun), 0.01)) == stopped


def test_a_program_that_does_not_get_on_is_stopped_by_the_time_of_the_controller():
    made = machine()
    crawl = {'x': 0.4001, 'v': 1e-4}
    assert not is_cancelled(made.step(robot(2.9, **crawl), 2.9))
    assert is_cancelled(made.step(robot(3.1, **crawl), 3.1))


def outcome(commands):
    return [c.outcome for c in commands if isinstance(c, Finish)]


@pytest.mark.parametrize('tolerance', [0.0, 0.3, -1.0])
def test_a_success_without_the_motion_is_none(tolerance):
    made = machine(goal_time_tolerance=tolerance)
    assert not outcome(made.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 0.1))
    # A state reported before the end may come after it.
    assert not outcome(made.step(robot(0.11), 0.11))
    (end,) = outcome(made.step(robot(1.2), 1.2))
    assert end.code is ErrorCode.EXECUTION_FAILED
    assert '0.1000 m' in end.text
    assert 'wire_dialect' in end.text


def test_a_packet_from_before_the_end_is_waited_out():
    made = machine()
    made.step(TrajectoryEnded(result=TrajectoryResult.SUCCESS), 0.1)
    made.step(robot(0.11), 0.11)
    state = robot(0.2, x=0.5).state
    turned = Pose((0.5, 0.0, 0.2), tuple(POSES[2, 3:]))
    arrived = RobotState(
        timestamp=0.2,
        actual_q=ZERO6,
        actual_qd=ZERO6,
        actual_tcp_pose=turned,
        target_tcp_pose=turned,
        runtime_state=state.runtime_state,
    )
    (end,) = outcome(made.step(StateReceived(state=arrived), 0.2))
    assert end.code is ErrorCode.SUCCESSFUL
