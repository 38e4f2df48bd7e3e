# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Goals by the names of their frames, from the message to the arm and back to the feedback."""

from dataclasses import replace

from action_msgs.msg import GoalStatus
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
import pytest
from rclpy.duration import Duration
from waiting import wait_for

from ur_cartesian_driver.action import FollowCartesianTrajectory
from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import (
    IDENTITY,
    Pose,
    quaternion_from_rotation_vector,
)
from ur_cartesian_driver.msg import CartesianTrajectoryPoint
from ur_cartesian_driver.ros.message_fields import duration_message, pose_message
from ur_cartesian_driver.ros.tf.tf_lookup import TransformLookup
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

pytestmark = pytest.mark.slow

TCP = Pose((0.0, 0.01, 0.12), quaternion_from_rotation_vector((0.2, 0.0, 0.0)))
NOZZLE = Pose((0.02, 0.0, 0.15), (0.0, 0.0, 1.0, 0.0))
BASE_LINK = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))
TABLE = BASE_LINK @ Pose((0.3, 0.2, 0.1), quaternion_from_rotation_vector((0.0, 0.0, 0.5)))
CAMERA = Pose((-0.2, 0.3, 0.4), quaternion_from_rotation_vector((0.3, 0.1, 0.0)))


class StandInBuffer:
    """Knows where a camera is, as tf2_ros.Buffer does."""

    def lookup_transform(self, target_frame, source_frame, time, timeout=None):
        if (target_frame, source_frame) != ('base', 'camera'):
            raise LookupError(source_frame)
        message = TransformStamped()
        message.transform.translation = Vector3(**dict(zip('xyz', CAMERA.position, strict=True)))
        message.transform.rotation = Quaternion(
            **dict(zip('xyzw', CAMERA.quaternion, strict=True))
        )
        return message


class Cell:
    """A cell whose robot has a TCP, and goals by name."""

    def __init__(self, cell):
        self.cell = cell
        numbers = ', '.join(f'{v!r}' for v in TCP.rotation_vector())
        cell.sim.run_script(f'sec theirs():\n  set_tcp(p[{numbers}])\nend\n')
        driver = cell.node.driver
        wait_for(lambda: driver.state.T_flange_tcp.distance_to(TCP) < 1e-9)
        server = cell.node.action_server
        server._context = replace(
            server._context,
            frames=server.frames.with_transforms(
                TransformLookup(StandInBuffer(), LookupError, now=lambda: 0, max_age=1.0)
            ),
        )

    def snapshot(self, T_flange_frame):
        """Return where a frame behind the flange is in base."""
        state = self.cell.sim.state()
        return state.T_base_tcp @ TCP.inverse() @ T_flange_frame

    def goal(self, frame_id, controlled_frame, pose, delay=None):
        message = FollowCartesianTrajectory.Goal()
        trajectory = message.trajectory
        trajectory.header.frame_id, trajectory.controlled_frame = frame_id, controlled_frame
        if delay is not None:
            trajectory.header.stamp = (
                self.cell.node.get_clock().now() + Duration(seconds=delay)
            ).to_msg()
        trajectory.points.append(
            CartesianTrajectoryPoint(
                time_from_start=duration_message(0.4), pose=pose_message(pose)
            )
        )
        return message

    def run(self, *goal):
        self.cell.feedback.clear()
        status, result = self.cell.run(self.goal(*goal))
        assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
        return result


@pytest.fixture
def named(no_thread_left, make_cell):
    config = SimulatorConfig(rtde_port=0, primary_port=0, dashboard_port=0, frequency=125.0)
    table = 'table base_link 0.3 0.2 0.1 {} {} {} {}'.format(
        *quaternion_from_rotation_vector((0.0, 0.0, 0.5))
    )
    with SimulatedRobot(config) as robot:
        cell = make_cell(robot, static_frames=[table, 'nozzle tool0 0.02 0 0.15 0 0 1 0'])
        cell.wait_ready()
        yield Cell(cell)
        cell.close()


def same(a, b):
    return a.distance_to(b) < 1e-4 and a.angle_to(b) < 1e-3


def test_goals_go_to_where_their_frames_say(named):
    frames = {'base_link': BASE_LINK, 'table': TABLE, 'camera': CAMERA}
    for frame_id, controlled, T_flange_frame in (
        ('base_link', 'nozzle', NOZZLE),
        ('table', 'tool0', IDENTITY),
        ('camera', '', TCP),
    ):
        start, T_base_frame = named.snapshot(T_flange_frame), frames[frame_id]
        x, y, z = start.position
        target = Pose((x, y + 0.02, z), start.quaternion)
        result = named.run(frame_id, controlled, T_base_frame.inverse() @ target)
        assert same(named.snapshot(T_flange_frame), target)
        assert any('restored at its end' in line for line in result.report) == bool(controlled)
        last = named.cell.feedback[-1]
        assert last.header.frame_id == frame_id
        assert last.controlled_frame == (controlled or 'tool0_controller')
        p = last.actual.pose.position
        assert T_base_frame.apply((p.x, p.y, p.z)) == pytest.approx(target.position, abs=1e-4)
        moving = max(
            named.cell.feedback,
            key=lambda f: abs(f.actual.twist.linear.x) + abs(f.actual.twist.linear.y),
        )
        v = moving.actual.twist.linear
        along_base = Pose((0.0, 0.0, 0.0), T_base_frame.quaternion).apply((v.x, v.y, v.z))
        assert along_base[1] > 0.02
        assert along_base[::2] == pytest.approx((0.0, 0.0), abs=2e-3)
        assert all(
            f.actual.acceleration.linear.x == f.actual.acceleration.linear.x
            for f in named.cell.feedback
        )  # not NaN


def test_a_goal_in_a_frame_of_the_arm_is_a_relative_motion_from_where_it_starts(named):
    step = Pose((0.0, 0.0, 0.01), quaternion_from_rotation_vector((0.0, 0.0, 0.2)))
    for frame_id, controlled, T_flange_frame in (
        ('tool0', 'tool0', IDENTITY),
        ('tool0_controller', '', TCP),
    ):
        start = named.snapshot(T_flange_frame)
        named.run(frame_id, controlled, step)
        assert same(named.snapshot(T_flange_frame), start @ step)
    # One for later starts from where another one has brought the arm.
    handle = named.cell.send(named.goal('tool0', 'tool0', step, 1.5))
    start = named.snapshot(IDENTITY)
    named.run('base', 'tool0', start @ Pose((0.01, 0.0, 0.0)))
    start = named.snapshot(IDENTITY)
    status, result = named.cell.result(handle)
    assert status == GoalStatus.STATUS_SUCCEEDED, result.error_string
    assert same(named.snapshot(IDENTITY), start @ step)


def test_frames_that_nobody_knows_refuse_and_move_nothing(named):
    q = named.cell.sim.state().q
    for frame_id, controlled, text in (
        ('moon', '', 'trajectory.header.frame_id is "moon"'),
        ('', 'moon', 'trajectory.controlled_frame is "moon"'),
        ('', 'table', 'does not move with the arm'),
    ):
        status, result = named.cell.run(named.goal(frame_id, controlled, IDENTITY))
        assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, ErrorCode.INVALID_GOAL)
        assert text in result.error_string
    assert named.cell.sim.state().q == q
