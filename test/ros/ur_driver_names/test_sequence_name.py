# Copyright 2026 the ur_cartesian_driver contributors
# SPDX-License-Identifier: Apache-2.0
"""Motion primitives by the name of the controller of ros2_controllers."""

from action_msgs.msg import GoalStatus
from geometry_msgs.msg import PoseStamped
import numpy as np
import pytest
from std_msgs.msg import Header

from ur_cartesian_driver.motion.geometry.pose import Pose
from ur_cartesian_driver.ros.message_fields import pose_message

pytestmark = pytest.mark.slow

NAME = '/motion_primitive_forward_controller/motion_sequence'
SPEED = {'velocity': 0.1, 'acceleration': 0.5}
#: How far the target of the simulated controller may be beside exact joints [rad] and places [m].
EXACT, NEAR = 2e-6, 2e-5


def sequence(ur):
    return ur.action(NAME, 'control_msgs/action/ExecuteMotionPrimitiveSequence')


def primitive(kind, *poses, joints=(), blend=0.0, frame='', **arguments):
    """Return a primitive; its arguments are those of SPEED if none are given."""
    from control_msgs.msg import MotionArgument, MotionPrimitive

    return MotionPrimitive(
        type=getattr(MotionPrimitive, kind) if isinstance(kind, str) else kind,
        poses=[PoseStamped(header=Header(frame_id=frame), pose=pose_message(at)) for at in poses],
        joint_positions=[float(q) for q in joints],
        blend_radius=blend,
        additional_arguments=[
            MotionArgument(name=name, value=value) for name, value in (arguments or SPEED).items()
        ],
    )


def goal(client, *primitives):
    message = client._action_type.Goal()
    message.trajectory.motions = list(primitives)
    return message


def run(ur, *primitives, feedback=None):
    """Return status and result of a sequence."""
    client = sequence(ur)
    handle = ur.send(client, goal(client, *primitives), feedback)
    assert handle.accepted
    return ur.result(handle)


def succeed(ur, *primitives, feedback=None):
    status, result = run(ur, *primitives, feedback=feedback)
    assert (status, result.error_code) == (GoalStatus.STATUS_SUCCEEDED, 0), result.error_string


def refused(ur, *primitives):
    """Return the sentence of a sequence that fails before anything moves."""
    before = ur.cell.sim.state().q
    status, result = run(ur, *primitives)
    assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, result.INVALID_GOAL)
    assert ur.cell.sim.state().q == before
    return result.error_string


def beside(ur, x=0.0, y=0.0, z=0.0):
    here = ur.cell.T_base_tcp
    a, b, c = here.position
    return Pose((a + x, b + y, c + z), here.quaternion)


def traced(ur, *primitives):
    """Run a sequence to its success; return the states of the robot that were seen meanwhile."""
    client, states = sequence(ur), [ur.cell.sim.state()]
    handle = ur.send(client, goal(client, *primitives))
    done = handle.get_result_async()

    def see():
        states.append(ur.cell.sim.state())
        return done.done()

    ur.cell.spin_until(see)
    response = done.result()
    assert response.status == GoalStatus.STATUS_SUCCEEDED, response.result.error_string
    return states


def test_joints_go_to_their_positions(ur):
    there = [q + 0.1 for q in ur.cell.sim.state().q]
    succeed(ur, primitive('LINEAR_JOINT', joints=there))
    assert ur.cell.sim.state().q == pytest.approx(there, abs=EXACT)


def test_joints_go_to_a_straight_wrist(ur):
    there = [*ur.cell.sim.state().q[:4], 0.0, 0.0]
    near = [*there[:4], -0.4, 0.0]
    succeed(ur, *(primitive('LINEAR_JOINT', joints=q) for q in (near, there)))
    assert ur.cell.sim.state().q == pytest.approx(there, abs=EXACT)


def test_a_line_is_straight(ur):
    start, end = ur.cell.T_base_tcp, beside(ur, 0.05, 0.1)
    states = traced(ur, primitive('LINEAR_CARTESIAN', end))
    along = np.subtract(end.position, start.position)
    for state in states:
        offset = np.subtract(state.T_base_tcp.position, start.position)
        beside_line = offset - along * (offset @ along) / (along @ along)
        assert np.linalg.norm(beside_line) < NEAR
    assert ur.cell.T_base_tcp.distance_to(end) < NEAR


def test_an_arc_leads_through_its_via_to_its_goal(ur):
    # A half circle about a centre 5 cm beside the tool.
    end, via = beside(ur, y=0.1), beside(ur, x=0.05, y=0.05)
    centre = beside(ur, y=0.05).position
    states = traced(ur, primitive('CIRCULAR_CARTESIAN', end, via))
    offsets = [np.subtract(state.T_base_tcp.position, centre) for state in states]
    assert [np.linalg.norm(offset) for offset in offsets] == pytest.approx(
        [0.05] * len(offsets), abs=NEAR
    )
    assert max(offset[0] for offset in offsets) > 0.04
    assert ur.cell.T_base_tcp.distance_to(end) < NEAR


def test_the_sequence_of_the_example_is_executed(ur):
    """A joint motion, down, up, a joint motion, an arc; blended, and all with a move_time of 0."""
    arguments = {**SPEED, 'move_time': 0.0}
    q = ur.cell.sim.state().q
    first = [q[0] + 0.1, *q[1:]]
    above = beside(ur)
    down = beside(ur, z=-0.1)
    end, via = beside(ur, y=-0.1), beside(ur, x=-0.05, y=-0.05)
    feedback = []
    succeed(
        ur,
        primitive('LINEAR_JOINT', joints=first, blend=0.01, **arguments),
        primitive('LINEAR_CARTESIAN', down, blend=0.005, **arguments),
        primitive('LINEAR_CARTESIAN', above, blend=0.005, **arguments),
        primitive('LINEAR_JOINT', joints=first, **arguments),
        primitive('LINEAR_JOINT', joints=q, **arguments),
        primitive('CIRCULAR_CARTESIAN', end, via, **arguments),
        feedback=feedback,
    )
    assert ur.cell.T_base_tcp.distance_to(end) < NEAR
    indices = [message.current_primitive_index for message in feedback]
    assert indices == sorted(indices)
    assert set(indices) <= set(range(6))
    assert indices[-1] == 5


def test_a_blend_passes_beside_its_point(ur):
    corner, end = beside(ur, y=0.1), beside(ur, x=0.1, y=0.1)
    states = traced(
        ur,
        primitive('LINEAR_CARTESIAN', corner, blend=0.03),
        primitive('LINEAR_CARTESIAN', end),
    )
    nearest = min(corner.distance_to(state.T_base_tcp) for state in states)
    assert 0.003 < nearest < 0.03


def test_a_move_time_is_the_time_of_the_motion(ur):
    end = beside(ur, y=0.1)
    states = traced(ur, primitive('LINEAR_CARTESIAN', end, move_time=3.0))
    moving = [i for i, state in enumerate(states) if any(state.qd)]
    first, last = moving[0], moving[-1]
    assert states[last].timestamp - states[first].timestamp <= 3.1
    assert states[last + 1].timestamp - states[first - 1].timestamp >= 2.99


def test_poses_are_in_their_frame(ur):
    base_link = Pose((0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))  # rotated by pi about z
    end = beside(ur, y=0.05)
    succeed(ur, primitive('LINEAR_CARTESIAN', base_link.inverse() @ end, frame='base_link'))
    assert ur.cell.T_base_tcp.distance_to(end) < NEAR


def test_joints_have_the_prefix_of_the_driver(make_ur):
    ur = make_ur(tf_prefix='my_ur_')
    ur.cell.wait_ready()
    there = [q + 0.05 for q in ur.cell.sim.state().q]
    succeed(ur, primitive('LINEAR_JOINT', joints=there))
    assert ur.cell.sim.state().q == pytest.approx(there, abs=EXACT)


def test_what_cannot_be_done_is_refused_with_the_index_of_the_primitive(ur):
    line, there = primitive('LINEAR_CARTESIAN', beside(ur, y=0.05)), beside(ur, y=0.1)
    for wrong, text in (
        (primitive('LINEAR_CARTESIAN', there, speed=0.1), "motions[1].additional_arguments 'sp"),
        (primitive('LINEAR_CARTESIAN', there, blend=-0.1), 'segments[1].blend_radius'),
        (primitive('LINEAR_CARTESIAN', beside(ur, x=3.0)), 'UNREACHABLE: trajectory.points[1]'),
        (primitive('LINEAR_JOINT', joints=[9.0] * 6), 'JOINT_LIMIT: trajectory.points[1]'),
    ):
        assert text in refused(ur, line, wrong)
    nowhere = primitive('LINEAR_CARTESIAN', there, frame='nowhere')
    assert '"nowhere"' in refused(ur, nowhere)


@pytest.mark.parametrize('wrong', ['empty', 'type', 'ambiguous'])
def test_what_the_controller_rejects_is_rejected(ur, wrong, capfd):
    client, pose, q = sequence(ur), ur.cell.T_base_tcp, ur.cell.sim.state().q
    motions, text = {
        'empty': ([], 'trajectory.motions is empty'),
        'type': ([primitive('UNKNOWN')], 'trajectory.motions[0].type is -1'),
        'ambiguous': ([primitive('LINEAR_JOINT', pose, joints=q)], 'the target is ambiguous'),
    }[wrong]
    assert not ur.send(client, goal(client, *motions)).accepted
    assert text in capfd.readouterr().err


def test_a_line_leads_to_where_the_joints_put_the_tool(ur):
    there = [q + 0.1 for q in ur.cell.sim.state().q]
    succeed(ur, primitive('LINEAR_CARTESIAN', joints=there))
    assert ur.cell.sim.state().q == pytest.approx(there, abs=1e-4)


def test_a_goal_is_cancelled_and_the_arm_stands(ur):
    client, start = sequence(ur), ur.cell.T_base_tcp
    slow = primitive('LINEAR_CARTESIAN', beside(ur, y=0.2), velocity=0.02, acceleration=0.5)
    handle = ur.send(client, goal(client, slow))
    ur.cell.spin_until(lambda: start.distance_to(ur.cell.T_base_tcp) > 0.005)
    ur.cell.await_(handle.cancel_goal_async())
    status, result = ur.result(handle)
    assert status == GoalStatus.STATUS_CANCELED
    assert (result.error_code, result.error_string[:10]) == (-1, 'CANCELLED:')
    assert ur.cell.sim.state().qd == pytest.approx((0.0,) * 6)
    assert start.distance_to(ur.cell.T_base_tcp) < 0.15


def test_a_second_goal_is_rejected_while_one_runs(ur, capfd):
    client = sequence(ur)
    line = primitive('LINEAR_CARTESIAN', beside(ur, y=0.05), velocity=0.02, acceleration=0.5)
    first = ur.send(client, goal(client, line))
    assert not ur.send(client, goal(client, line)).accepted
    assert 'motion_sequence: goal rejected: a goal is being executed' in capfd.readouterr().err
    assert ur.result(first)[0] == GoalStatus.STATUS_SUCCEEDED
    second = ur.send(client, goal(client, primitive('LINEAR_CARTESIAN', beside(ur, y=-0.02))))
    assert ur.result(second)[0] == GoalStatus.STATUS_SUCCEEDED


def test_another_goal_of_the_driver_replaces_a_sequence(ur):
    client = sequence(ur)
    line = primitive('LINEAR_CARTESIAN', beside(ur, y=0.2), velocity=0.02, acceleration=0.5)
    handle = ur.send(client, goal(client, line))
    ur.cell.spin_until(lambda: any(ur.cell.sim.state().qd))
    assert ur.cell.run(ur.cell.goal((2.0, 0.05, 0.0, 0.0)))[1].error_code == 0
    status, result = ur.result(handle)
    assert (status, result.error_code) == (GoalStatus.STATUS_ABORTED, result.INVALID_GOAL)
    assert result.error_string.startswith('PREEMPTED: ')


def test_without_the_driver_a_goal_is_rejected(make_ur, capfd):
    ur = make_ur({'driver': 'nobody'})
    client = sequence(ur)
    line = primitive('LINEAR_CARTESIAN', Pose((0.4, 0.2, 0.3), (1.0, 0.0, 0.0, 0.0)))
    assert not ur.send(client, goal(client, line)).accepted
    assert 'nobody/follow_cartesian_trajectory; start the driver' in capfd.readouterr().err
