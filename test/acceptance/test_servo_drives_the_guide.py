# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""The sample program of the servoj guide executes our goals: the contract is the same."""

from types import SimpleNamespace
from typing import Any

from goal_machines import servo_machine
import numpy as np
import pytest
from servo_cell import GuideCell

from ur_cartesian_driver.execution.goal.goal_commands import EnterServo, Finish, WriteInputs
from ur_cartesian_driver.execution.goal.motion_job import MotionJob
from ur_cartesian_driver.execution.servo.servo_stream import ServoSettings
from ur_cartesian_driver.kinematics.chain import Arm
from ur_cartesian_driver.kinematics.robot_models import robot_model
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.events import CancelRequested, ServoReceived, StateReceived
from ur_cartesian_driver.motion.goal.execution_modes import ExecutionMode
from ur_cartesian_driver.motion.goal.goal import Tolerance
from ur_cartesian_driver.motion.plan.joint_spline import JointSpline
from ur_cartesian_driver.motion.plan.plan import ReferencePath
from ur_cartesian_driver.motion.plan.primitive import Spline
from ur_cartesian_driver.motion.state.rtde_state import RobotState

pytestmark = [pytest.mark.acceptance, pytest.mark.slow]

REST = (0.0,) * 6
DURATION = 0.6


def job(home):
    """There and on, through a point that is passed in motion."""
    arm = Arm(robot_model('ur5e'))
    via, to = (tuple(a + part for a in home) for part in (0.1, 0.2))
    spline = JointSpline.of(
        home,
        [
            Spline(target=via, velocities=(0.5,) * 6, accelerations=REST, duration=DURATION / 2),
            Spline(target=to, velocities=REST, accelerations=REST, duration=DURATION / 2),
        ],
    )
    times = np.linspace(0.0, DURATION, 121)
    poses = [arm.forward(tuple(q)) for q in spline.rows(times)[0]]
    return MotionJob(
        points=2,
        duration=DURATION,
        due=DURATION,
        spline=spline,
        execution=ExecutionMode.SERVO,
        waypoint=np.array([0, 1], dtype=np.int32),
        goal_tolerance=Tolerance(position=(1e-3,) * 3),
        reference=ReferencePath(
            poses=np.array([[*pose.position, *pose.quaternion] for pose in poses]),
            time=times,
            point=(times > DURATION / 2).astype(np.int32),
        ),
    )


def state_of(controller):
    """Return the robot state of RTDE, the machine's other packet."""
    motion = controller.motion
    return RobotState(
        timestamp=controller.time,
        actual_q=motion.q,
        actual_qd=motion.qd,
        target_q=motion.q,
        target_qd=motion.qd,
        actual_tcp_pose=motion.T_base_tcp,
        target_tcp_pose=motion.T_base_tcp,
        actual_tcp_twist=motion.tcp_twist,
        target_tcp_twist=motion.tcp_twist,
        effective_speed=motion.scaling,
        runtime_state=controller.programs.state,
    )


def drive(slider=1.0, cancel_after=None):
    """Run a goal on the sample program; return the measurements."""
    cell = GuideCell()
    goal: Any = servo_machine(job(cell.q), ServoSettings(lookahead_time=0.06))
    seen = SimpleNamespace(
        commands=goal.start(state_of(cell.controller)),
        home=cell.q,
        times=[],
        motion=[],
        q=[],
        cell=cell,
        spline=goal.job.spline,
    )

    def take(feedback):
        commands = goal.step(ServoReceived(feedback=feedback), cell.time)
        commands += goal.step(StateReceived(state=state_of(cell.controller)), cell.time)
        if cancel_after is not None and goal.feeder.stream.motion_time >= cancel_after:
            commands += goal.step(CancelRequested(), cell.time)
        seen.commands += commands
        seen.motion.append(goal.feeder.stream.motion_time)
        seen.q.append(cell.q)
        rows = [command.values for command in commands if isinstance(command, WriteInputs)]
        return rows[-1] if rows else None

    cell.controller.set_slider(slider)
    for _ in range(3000):
        cell.cycle(take)
        ends = [command for command in seen.commands if isinstance(command, Finish)]
        if ends:
            seen.outcome = ends[0].outcome
            return seen
    raise AssertionError(cell.log)


@pytest.mark.parametrize('slider', [1.0, pytest.param(0.5, marks=pytest.mark.exhaustive)])
def test_a_goal_arrives_with_the_reported_lag(slider):
    seen = drive(slider)
    assert seen.outcome.code is ErrorCode.SUCCESSFUL, seen.outcome
    assert seen.q[-1] == pytest.approx([a + 0.2 for a in seen.home], abs=1e-3)
    # The arm lags the last set-point by the sample's lookahead, in the robot's own time.
    motion, q = np.array(seen.motion), np.array(seen.q)
    moving = (motion > 0.1) & (motion < DURATION - 0.01)
    expected = seen.spline.rows(motion[moving] - 0.06)[0]
    assert np.abs(q[moving] - expected).max() < 6e-3
    assert any(isinstance(command, EnterServo) for command in seen.commands)
    assert 'Buffer overflow' not in seen.cell.log


def test_a_cancel_stops_the_arm_and_leaves_the_sample_program_running():
    seen = drive(cancel_after=0.3)
    assert seen.outcome.code is ErrorCode.CANCELLED
    for _ in range(400):  # the sample waits until the arm has been at rest for a while
        seen.cell.cycle(lambda feedback: None)
    assert 'finished exit invokes for SERVO' in seen.cell.log
    assert seen.cell.controller.programs.running
    assert seen.home[0] + 0.02 < seen.q[-1][0] < seen.home[0] + 0.18
