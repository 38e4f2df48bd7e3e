# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""A newer goal takes the place of the one that runs, and only if it can run itself."""

from random import Random

from action_msgs.msg import GoalStatus
import pytest
from rclpy.duration import Duration

from ur_cartesian_driver.motion.errors import ErrorCode
from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.msg import CartesianTrajectoryPoint
from ur_cartesian_driver.ros.message_fields import duration_message, pose_message
from ur_cartesian_driver.sim import SimulatedRobot, SimulatorConfig

pytestmark = pytest.mark.slow
SUCCEEDED, ABORTED, CANCELED = (
    GoalStatus.STATUS_SUCCEEDED,
    GoalStatus.STATUS_ABORTED,
    GoalStatus.STATUS_CANCELED,
)
#: Behind the flange of the simulated arm.
NOZZLE = 'nozzle tool0 0.0 0.0 0.1 0 0 0 1'
#: A stop that takes seconds, so that things can happen in it [rad/s^2].
GENTLY = 0.12


@pytest.fixture
def sim():
    """Return a robot with the cycle of a CB3, which costs less."""
    with SimulatedRobot(
        SimulatorConfig(rtde_port=0, primary_port=0, dashboard_port=0, frequency=125.0)
    ) as robot:
        yield robot


class Place:
    """The first place of the tool, from which goals count wherever the tool is meanwhile."""

    def __init__(self, cell):
        self.cell, self.T_base_tcp = cell, cell.T_base_tcp

    def goal(self, *steps, **fields):
        """Return a goal of steps (seconds, x, y, z) from here."""
        message = self.cell.goal(**fields)
        for time, *offset in steps:
            x, y, z = (a + b for a, b in zip(self.T_base_tcp.position, offset, strict=True))
            message.trajectory.points.append(
                CartesianTrajectoryPoint(
                    time_from_start=duration_message(time),
                    pose=pose_message(Pose((x, y, z), self.T_base_tcp.quaternion)),
                )
            )
        return message

    def far(self):
        """Return a goal that takes 5 s."""
        return self.goal((5.0, 0.0, 0.3, 0.0))

    def is_near(self, *offset):
        """Tell whether the tool is beside this place by so much."""
        return all(
            abs(there - here - d) < 5e-4
            for there, here, d in zip(
                self.cell.T_base_tcp.position, self.T_base_tcp.position, offset, strict=True
            )
        )


def leading_speed(cell):
    return max(map(abs, cell.sim.state().qd))


def moving(cell):
    return leading_speed(cell) > 0.02


def outcomes(cell, handles):
    """Return status and code of each goal; each of them ends."""
    futures = [handle.get_result_async() for handle in handles]
    cell.spin_until(lambda: all(future.done() for future in futures), 20.0)
    return [(future.result().status, future.result().result.error_code) for future in futures]


def name(handle):
    return f'goal {bytes(handle.goal_id.uuid).hex()[:8]}'


def log(cell):
    return ' '.join(map(str, cell.sim.controller.messages.log))


def test_a_newer_goal_takes_the_place_of_the_running_one(cell):
    place = Place(cell)
    old = cell.send(place.far())
    cell.spin_until(lambda: moving(cell))
    new = cell.send(place.goal((0.8, 0.02, 0.0, 0.0)))
    status, result = cell.result(old)
    assert (status, result.error_code) == (ABORTED, ErrorCode.PREEMPTED)
    assert result.error_string == (
        f'{name(new).capitalize()} took the place of this one (on the way to point 0).'
    )
    status, result = cell.result(new)
    assert (status, result.error_code) == (SUCCEEDED, 0), result.error_string
    assert place.is_near(0.02, 0.0, 0.0)
    assert 'ignored' not in log(cell)


def test_goals_that_do_not_pass_leave_the_running_one_alone(single_cell):
    cell, place = single_cell, Place(single_cell)
    old = cell.send(place.goal((2.5, 0.0, 0.12, 0.0)))
    cell.spin_until(lambda: moving(cell))
    strange = place.goal((1.0, 0.02, 0.0, 0.0))
    strange.trajectory.header.frame_id = 'moon'
    refused = [
        cell.send(goal)
        for goal in (
            place.goal(),
            place.goal((0.05, 0.3, 0.0, 0.0)),
            place.goal((60.0, -5.0, 0.0, 0.0)),
            strange,
        )
    ]
    checked = cell.send(place.goal((1.0, 0.0, 0.02, 0.0), validate_only=True))
    assert {status for status, _ in outcomes(cell, refused)} == {ABORTED}
    assert outcomes(cell, [checked]) == [(SUCCEEDED, 0)]
    assert moving(cell)
    assert outcomes(cell, [old]) == [(SUCCEEDED, 0)]
    # The target went its way in one go: one acceleration, one deceleration.
    speeds = [feedback.desired.twist.linear.y for feedback in cell.feedback]
    top = max(speeds)
    held = [i for i, speed in enumerate(speeds) if speed > 0.9 * top]
    assert min(speeds[held[0] : held[-1]]) > 0.9 * top


def test_a_paused_robot_is_not_made_ready_by_a_newer_goal(single_cell):
    cell, place = single_cell, Place(single_cell)
    old = cell.send(place.goal((1.5, 0.0, 0.05, 0.0)))
    cell.spin_until(lambda: moving(cell))
    cell.sim.pause_program()
    cell.spin_until(lambda: not moving(cell))
    status, result = cell.run(place.goal((1.0, 0.0, 0.01, 0.0)))
    assert (status, result.error_code) == (ABORTED, ErrorCode.ROBOT_NOT_READY)
    assert 'paused or stopped' in result.error_string
    cell.sim.play_program()
    assert outcomes(cell, [old]) == [(SUCCEEDED, 0)]


def test_of_ten_goals_at_once_the_newest_runs(single_cell):
    cell, place = single_cell, Place(single_cell)
    first = cell.send(place.far())
    cell.spin_until(lambda: moving(cell))
    sent = [
        cell.client.send_goal_async(place.goal((0.8, 0.0, 0.0, 0.002 * (i + 1))))
        for i in range(10)
    ]
    cell.spin_until(lambda: all(future.done() for future in sent))
    *old, newest = outcomes(cell, [first, *(future.result() for future in sent)])
    assert old == [(ABORTED, ErrorCode.PREEMPTED)] * 10
    assert newest == (SUCCEEDED, 0)
    assert place.is_near(0.0, 0.0, 0.02)


def test_a_goal_that_is_still_planned_makes_way_too(single_cell):
    cell, place = single_cell, Place(single_cell)
    count = 1_500
    long = cell.send(
        place.goal(*((0.05 * (i + 1), 0.0, 0.1 * (i + 1) / count, 0.0) for i in range(count)))
    )
    short = cell.send(place.goal((0.5, 0.0, 0.0, 0.01)))
    assert cell.result(short)[0] == SUCCEEDED
    status, result = cell.result(long)
    assert (status, result.error_code) == (ABORTED, ErrorCode.PREEMPTED)
    assert result.error_string == (
        f'{name(short).capitalize()} took the place of this one before anything moved.'
    )
    assert place.is_near(0.0, 0.0, 0.01)


def test_a_goal_takes_the_place_of_another_one_when_its_time_has_come(single_cell):
    cell, place = single_cell, Place(single_cell)
    later = place.goal((0.5, 0.0, 0.0, 0.0))
    later.trajectory.header.stamp = (cell.node.get_clock().now() + Duration(seconds=1.5)).to_msg()
    new = cell.send(later)
    old = cell.send(place.far())
    cell.spin_until(lambda: moving(cell))
    assert outcomes(cell, [old, new]) == [(ABORTED, ErrorCode.PREEMPTED), (SUCCEEDED, 0)]
    assert place.is_near(0.0, 0.0, 0.0)
    assert cell.node.get_clock().now().nanoseconds / 1e9 > (
        later.trajectory.header.stamp.sec + 1e-9 * later.trajectory.header.stamp.nanosec
    )


def test_the_tcp_of_the_old_goal_is_back_before_the_new_one_begins(no_thread_left, sim, make_cell):
    cell = make_cell(sim, static_frames=[NOZZLE])
    cell.wait_ready()
    before = cell.node.driver.state
    place = Place(cell)
    x, y, z = (before.actual_tcp_pose @ Pose((0.0, 0.0, 0.1))).position
    about_nozzle = place.goal((2.0, 0.0, 0.05, 0.0), (3.0, 0.0, 0.1, 0.0))
    about_nozzle.trajectory.controlled_frame = 'nozzle'
    for i, point in enumerate(about_nozzle.trajectory.points):
        position = point.pose.position
        position.x, position.y, position.z = x, y + 0.05 * (i + 1), z
    handles = [cell.send(about_nozzle)]
    cell.spin_until(lambda: moving(cell))
    handles.append(cell.send(about_nozzle))
    cell.spin_until(lambda: cell.result(handles[0]) and moving(cell))
    handles.append(cell.send(place.goal((1.0, 0.0, 0.0, 0.0))))
    *old, new = outcomes(cell, handles)
    assert old == [(ABORTED, ErrorCode.PREEMPTED)] * 2
    assert new == (SUCCEEDED, 0)
    assert place.is_near(0.0, 0.0, 0.0)
    assert cell.node.driver.state.T_flange_tcp == before.T_flange_tcp


@pytest.fixture
def gentle_cell(no_thread_left, sim, make_cell):
    """Return a cell whose arm takes its time to stop."""
    cell = make_cell(sim, stop_deceleration=GENTLY)
    cell.wait_ready()
    return cell


def under_way(cell, place):
    """Return a goal that has its speed."""
    goal = cell.send(place.far())
    cell.spin_until(lambda: cell.feedback and cell.feedback[-1].progress > 0.1)
    return goal


def preempting(cell, place):
    """Let a goal wait for the stop of another one; return both."""
    old = under_way(cell, place)
    speed = leading_speed(cell)
    new = cell.send(place.goal((1.0, 0.0, 0.0, 0.0)))
    cell.spin_until(lambda: leading_speed(cell) < 0.8 * speed)
    assert moving(cell)
    return old, new


def test_whatever_happens_while_the_arm_stops_each_goal_ends_with_its_code(gentle_cell):
    cell, place = gentle_cell, Place(gentle_cell)
    old, new = preempting(cell, place)
    newest = cell.send(place.goal((0.6, 0.0, 0.01, 0.0)))
    assert outcomes(cell, [old, new, newest]) == [
        (ABORTED, ErrorCode.PREEMPTED),
        (ABORTED, ErrorCode.PREEMPTED),
        (SUCCEEDED, 0),
    ]

    cell.feedback.clear()
    old, new = preempting(cell, place)
    cell.await_(new.cancel_goal_async())
    assert outcomes(cell, [new]) == [(CANCELED, ErrorCode.CANCELLED)]
    cell.await_(old.cancel_goal_async())
    assert outcomes(cell, [old]) == [(ABORTED, ErrorCode.PREEMPTED)]
    assert not moving(cell)

    cell.feedback.clear()
    old = under_way(cell, place)
    cell.await_(old.cancel_goal_async())
    new = cell.send(place.goal((0.6, 0.0, 0.0, 0.0)))
    assert outcomes(cell, [old, new]) == [(CANCELED, ErrorCode.CANCELLED), (SUCCEEDED, 0)]
    assert 'ignored' not in log(cell)

    cell.feedback.clear()
    old, new = preempting(cell, place)
    assert moving(cell)
    cell.sim.protective_stop()
    assert outcomes(cell, [old]) == [(ABORTED, ErrorCode.PROTECTIVE_STOP)]
    status, result = cell.result(new)
    assert (status, result.error_code) == (ABORTED, ErrorCode.ROBOT_NOT_READY)
    assert 'is in a protective stop' in result.error_string
    assert f'so it preempted {name(old)}, which is over' in result.error_string


def test_a_node_that_is_destroyed_meanwhile_ends_both(gentle_cell):
    old, new = preempting(gentle_cell, Place(gentle_cell))
    assert old.accepted
    assert new.accepted
    gentle_cell.close()  # no_thread_left looks for leaks


@pytest.mark.parametrize('executor', ['multi'])
def test_a_storm_of_goals_and_cancels_leaves_no_goal_without_its_end(cell):
    random, place, handles = Random(20), Place(cell), []
    for _ in range(24):
        offset = [random.uniform(-0.02, 0.02) for _ in range(3)]
        match random.choice(['goal', 'goal', 'goal', 'cancel', 'refused', 'validate']):
            case 'cancel' if handles:
                random.choice(handles).cancel_goal_async()
            case 'refused':
                handles.append(cell.send(place.goal((0.001, 0.4, 0.0, 0.0))))
            case 'validate':
                handles.append(cell.send(place.goal((1.0, *offset), validate_only=True)))
            case _:
                handles.append(cell.send(place.goal((1.0, *offset))))
        until = cell.node.get_clock().now() + Duration(seconds=random.choice([0.0, 0.02, 0.1]))
        cell.spin_until(lambda until=until: cell.node.get_clock().now() >= until)
    handles.append(cell.send(place.goal((1.0, 0.0, 0.0, 0.01))))
    *ended, last = outcomes(cell, handles)
    assert last == (SUCCEEDED, 0)
    assert place.is_near(0.0, 0.0, 0.01)
    assert not moving(cell)
    assert set(ended) <= {
        (SUCCEEDED, 0),
        (CANCELED, ErrorCode.CANCELLED),
        (ABORTED, ErrorCode.PREEMPTED),
        (ABORTED, ErrorCode.INVALID_GOAL),
    }
    assert 'ignored' not in log(cell)
    assert cell.node.action_server.idle
